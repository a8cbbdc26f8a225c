#include "forge/thermal_scene.hpp"

#include <fmt/format.h>

#include <cmath>

#include "base/error.hpp"
#include "fem/heat_element.hpp"
#include "forge/scene.hpp"
#include "parallel/agreement.hpp"

namespace malleus::forge {
namespace {

std::vector<ThermalBody> read_bodies(const ForgeCase& forge_case, const Scene& scene) {
  std::vector<ThermalBody> bodies(scene.bodies.size());
  for (const BodySettings& settings : forge_case.bodies) {
    ThermalBody& body = bodies[static_cast<std::size_t>(scene.mesh.find_region(settings.group))];
    body.conductivity = settings.conductivity.value_or(0);
    body.capacity = settings.density.value_or(0) * settings.heat_capacity.value_or(0);
    body.initial = settings.temperature.value_or(forge_case.common.thermal->initial);
    body.softening = settings.softening;
  }
  return bodies;
}

ThermalOpponent of_tool(const ToolSettings& tool, Real ambient) {
  const bool conducts = tool.temperature || tool.heat_transfer;
  return {conducts ? tool.heat_transfer.value_or(default_heat_transfer) : 0, tool.temperature.value_or(ambient), 0.5};
}

std::vector<ThermalOpponent> read_opponents(const ForgeCase& forge_case, const Scene& scene,
                                            const ThermalScene& thermal) {
  std::vector<ThermalOpponent> opponents;
  for (const ToolSettings& tool : forge_case.tools) opponents.push_back(of_tool(tool, thermal.settings.ambient));
  for (std::size_t i = 0; i < scene.pairs.size(); ++i) {
    const Real slave = thermal.bodies[static_cast<std::size_t>(scene.pairs[i].slave)].effusivity();
    const Real master = thermal.bodies[static_cast<std::size_t>(scene.pairs[i].master)].effusivity();
    const bool both = slave > 0 && master > 0;
    opponents.push_back({forge_case.contacts[i].heat_transfer, 0, both ? slave / (slave + master) : 0.5});
  }
  return opponents;
}

void set_initial_temperature(Scene& scene) {
  const Mesh& mesh = scene.mesh;
  auto temperature = scene.fields[field_name::temperature].values();
  agree(*scene.comm, [&] {
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const auto region = static_cast<std::size_t>(mesh.element_region[static_cast<std::size_t>(e)]);
      const ThermalBody& body = scene.thermal->bodies[region];
      for (const LocalId node : mesh.nodes_of_element(e)) {
        const Real* x = mesh.point(node);
        const Real value = body.initial.finite_at({x[0], x[1], mesh.dim == 3 ? x[2] : 0.0}, 0);
        if (!(value > 0)) {
          throw InputError(fmt::format("[body.{}] temperature: {:g} K at ({:g}, {:g}) m is not above absolute zero",
                                       scene.bodies[region].name, value, x[0], x[1]));
        }
        temperature[static_cast<std::size_t>(node)] = value;
      }
    }
  });
}

Real softening_at(const Expression& formula, Real temperature) {
  const Real factor = formula.at_temperature(temperature);
  if (factor > 0) return factor;
  throw InputError(fmt::format("{}: the factor '{}' is {:g} at T = {:g} K; it must be positive", formula.source(),
                               formula.text(), factor, temperature));
}

}  // namespace

Real ThermalBody::effusivity() const {
  return std::sqrt(conductivity * capacity);
}

bool ThermalScene::softens() const {
  return std::any_of(bodies.begin(), bodies.end(), [](const ThermalBody& body) { return body.softening.has_value(); });
}

void SoftenedViscosity::evaluate(const Mesh& mesh, std::span<const Real> shear_rate, std::span<Real> viscosity,
                                 std::span<Real> slope) const {
  model_->evaluate(mesh, shear_rate, viscosity, slope);
  for (std::size_t e = 0; e < factors_.size(); ++e) {
    viscosity[e] *= factors_[e];
    slope[e] *= factors_[e];
  }
}

void build_thermal_scene(const ForgeCase& forge_case, Scene& scene) {
  if (!forge_case.common.thermal) return;
  ThermalScene& thermal = scene.thermal.emplace();
  thermal.settings = *forge_case.common.thermal;
  thermal.bodies = read_bodies(forge_case, scene);
  thermal.opponents = read_opponents(forge_case, scene, thermal);
  scene.fields.declare(scene.mesh, {field_name::temperature, "K", Support::node, 1, Transfer::interpolate, true});
  set_initial_temperature(scene);
  if (!thermal.softens()) return;
  scene.viscosity = std::make_unique<SoftenedViscosity>(std::move(scene.viscosity), thermal.element_softening);
  update_softening(scene);
}

void update_softening(Scene& scene) {
  if (!scene.thermal || !scene.thermal->softens()) return;
  const Mesh& mesh = scene.mesh;
  ThermalScene& thermal = *scene.thermal;
  const auto temperature = std::as_const(scene.fields)[field_name::temperature].values();
  thermal.element_softening.assign(static_cast<std::size_t>(mesh.elements()), 1.0);
  thermal.node_softening.assign(static_cast<std::size_t>(mesh.nodes()), 0.0);
  agree(*scene.comm, [&] {
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const auto i = static_cast<std::size_t>(e);
      const auto& softening = thermal.bodies[static_cast<std::size_t>(mesh.element_region[i])].softening;
      Real mean = 0;
      for (const LocalId node : mesh.nodes_of_element(e)) {
        const auto n = static_cast<std::size_t>(node);
        mean += temperature[n] / (mesh.dim + 1);
        if (thermal.node_softening[n] == 0) {
          thermal.node_softening[n] = softening ? softening_at(*softening, temperature[n]) : 1;
        }
      }
      if (softening) thermal.element_softening[i] = softening_at(*softening, mean);
    }
  });
}

std::vector<Real> body_temperatures(const Scene& scene) {
  const Mesh& mesh = scene.mesh;
  const auto temperature = scene.fields[field_name::temperature].values();
  std::vector<Real> sums(2 * scene.bodies.size(), 0.0);
  std::array<Real, 2> range = {-1e300, -1e300};  // of minus the temperature, and of the temperature
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const auto region = static_cast<std::size_t>(mesh.element_region[static_cast<std::size_t>(e)]);
      const auto masses = heat_element<D>(simplex_points<D>(mesh, e), scene.geometry).masses;
      for (int i = 0; i <= D; ++i) {
        const Real t = temperature[static_cast<std::size_t>(mesh.nodes_of_element(e)[static_cast<std::size_t>(i)])];
        sums[2 * region] += masses[i] * t;
        sums[2 * region + 1] += masses[i];
        if (!scene.thermal->bodies[region].is_modelled()) continue;
        range = {std::max(range[0], -t), std::max(range[1], t)};
      }
    }
  });
  scene.comm->sum_in_place(sums);
  scene.comm->max_in_place(range);
  std::vector<Real> means;
  for (std::size_t region = 0; region < scene.bodies.size(); ++region) {
    means.push_back(sums[2 * region + 1] > 0 ? sums[2 * region] / sums[2 * region + 1] : 0);
  }
  means.push_back(-range[0]);
  means.push_back(range[1]);
  return means;
}

}  // namespace malleus::forge
