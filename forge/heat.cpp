#include "forge/heat.hpp"

#include <fmt/format.h>

#include <cmath>

#include "fem/boundary_conditions.hpp"
#include "fem/heat_element.hpp"
#include "forge/free_surface.hpp"
#include "parallel/agreement.hpp"

namespace malleus::forge {
namespace {

constexpr Real stefan_boltzmann = 5.670374419e-8;  // W/(m^2 K^4), CODATA 2018

std::array<Real, 3> place_of(const Mesh& mesh, LocalId node) {
  const Real* x = mesh.point(node);
  return {x[0], x[1], mesh.dim == 3 ? x[2] : 0.0};
}

}  // namespace

Heat::Heat(Scene& scene, const ContactFlow& flow)
    : scene_(scene), flow_(flow), equation_(*scene.comm, scene.mesh, scene.geometry) {}

std::string Heat::purpose() const {
  const ThermalSettings& settings = scene_.thermal->settings;
  std::string text = "temperature by the heat equation, backward Euler";
  if (settings.emissivity > 0) text += ", radiation";
  if (settings.convection > 0) text += ", convection";
  return text;
}

void Heat::add_constants(HeatScene& heat) const {
  const Mesh& mesh = scene_.mesh;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const ThermalBody& body =
        scene_.thermal->bodies[static_cast<std::size_t>(mesh.element_region[static_cast<std::size_t>(e)])];
    heat.capacity.push_back(body.capacity);
    heat.conductivity.push_back(body.conductivity);
  }
}

/// eta gamma^2 with the rate that the step strains by, times the share that becomes heat.
void Heat::add_dissipation(HeatScene& heat) const {
  const auto elements = static_cast<std::size_t>(scene_.mesh.elements());
  heat.element_source.assign(elements, 0.0);
  if (!scene_.progress.was_pushed) return;
  std::vector<Real> shear_rate(elements);
  for (std::size_t e = 0; e < elements; ++e) shear_rate[e] = std::sqrt(3.0) * scene_.step_strain_rate[e];
  std::vector<Real> viscosity(elements);
  std::vector<Real> slope(elements);
  scene_.viscosity->evaluate(scene_.mesh, shear_rate, viscosity, slope);
  for (std::size_t e = 0; e < elements; ++e) {
    heat.element_source[e] = scene_.thermal->settings.dissipation * viscosity[e] * shear_rate[e] * shear_rate[e];
  }
}

/// What touches conducts and gets its share of the friction's heat; the rest of the surface convects and radiates.
void Heat::add_surfaces(HeatScene& heat) {
  const ThermalScene& thermal = *scene_.thermal;
  const FreeSurface surface(*scene_.comm, scene_.mesh, scene_.geometry, scene_.boundaries->is_free());
  const auto nodes = static_cast<std::size_t>(scene_.mesh.nodes());
  for (std::vector<Real>* values : {&heat.node_source, &heat.conductance, &heat.surroundings, &heat.emission}) {
    values->assign(nodes, 0.0);
  }
  std::vector<Real> touched(surface.nodes().size(), 0.0);
  friction_power_ = 0;
  for (const Touching& point : flow_.touching()) {
    const auto node = static_cast<std::size_t>(point.slave);
    const ThermalOpponent& opponent = thermal.opponents[static_cast<std::size_t>(point.opponent)];
    touched[point.surface] += point.area;
    const Real heat_of_friction = point.area * point.friction;
    heat.node_source[node] += opponent.slave_share * heat_of_friction;
    friction_power_ += opponent.slave_share * heat_of_friction;
    if (point.masters[0] < 0) {
      heat.conductance[node] += opponent.transfer * point.area;
      heat.surroundings[node] += opponent.transfer * point.area * opponent.temperature;
      continue;
    }
    heat.bridges.push_back(
        {scene_.mesh.global_node(point.slave), opponent.transfer * point.area, point.masters, point.weights});
    heat.bridges.back().source = (1 - opponent.slave_share) * heat_of_friction;
    friction_power_ += (1 - opponent.slave_share) * heat_of_friction;
  }
  for (std::size_t i = 0; i < surface.nodes().size(); ++i) {
    const auto node = static_cast<std::size_t>(surface.nodes()[i]);
    const Real open = std::max(0.0, surface.area(i) - touched[i]);
    heat.conductance[node] += thermal.settings.convection * open;
    heat.surroundings[node] += thermal.settings.convection * open * thermal.settings.ambient;
    heat.emission[node] = stefan_boltzmann * thermal.settings.emissivity * open;
  }
  heat.radiates_to = thermal.settings.ambient;
  if (!(thermal.settings.emissivity > 0)) heat.emission.clear();
}

void Heat::add_boundaries(HeatScene& heat, Real time) const {
  const Mesh& mesh = scene_.mesh;
  const std::vector<BoundarySettings>& settings = scene_.boundaries->settings();
  std::vector<char> is_fixed(static_cast<std::size_t>(mesh.nodes()), 0);
  agree(*scene_.comm, [&] {
    for (std::size_t i = 0; i < settings.size(); ++i) {
      for (const LocalId node : scene_.boundaries->nodes(i)) {
        if (!settings[i].temperature || is_fixed[static_cast<std::size_t>(node)] != 0) continue;
        is_fixed[static_cast<std::size_t>(node)] = 1;
        heat.fixed.push_back(node);
        heat.fixed_values.push_back(settings[i].temperature->finite_at(place_of(mesh, node), time));
      }
      if (!settings[i].heat_flux) continue;
      with_dim(mesh.dim, [&](auto d) {
        constexpr int D = decltype(d)::value;
        for (const LocalId facet : facets_of_group(mesh, mesh.find_group(settings[i].group))) {
          const auto shares = facet_integrals<D>(mesh, facet, scene_.geometry).shares();
          for (int k = 0; k < D; ++k) {
            const LocalId node = mesh.nodes_of_facet(facet)[static_cast<std::size_t>(k)];
            heat.node_source[static_cast<std::size_t>(node)] +=
                shares[k] * settings[i].heat_flux->finite_at(place_of(mesh, node), time);
          }
        }
      });
    }
  });
}

Outcome Heat::advance(const Increment& increment) {
  Field& temperature = scene_.fields[field_name::temperature];
  saved_temperature_.assign(temperature.values().begin(), temperature.values().end());
  saved_totals_ = totals_;
  HeatScene heat;
  add_constants(heat);
  add_dissipation(heat);
  add_surfaces(heat);
  add_boundaries(heat, increment.time);
  const HeatReport report = equation_.advance(heat, increment.dt, temperature.values());
  if (!report.converged) {
    temperature.assign(saved_temperature_);
    return Outcome::retry("the heat equation did not converge");
  }
  Real dissipated = 0;
  with_dim(scene_.mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < scene_.mesh.elements(); ++e) {
      if (!(heat.capacity[static_cast<std::size_t>(e)] > 0)) continue;
      const auto masses = heat_element<D>(simplex_points<D>(scene_.mesh, e), scene_.geometry).masses;
      dissipated += increment.dt * heat.element_source[static_cast<std::size_t>(e)] * masses.sum();
    }
  });
  std::array<Real, 2> sums = {dissipated, friction_power_ * increment.dt};
  scene_.comm->sum_in_place(sums);
  totals_.stored += report.stored;
  totals_.dissipated += sums[0];
  totals_.friction += sums[1];
  totals_.imposed += report.imposed + report.supplied - sums[0] - sums[1];
  totals_.lost += report.lost;
  return Outcome::done();
}

void Heat::roll_back() {
  scene_.fields[field_name::temperature].assign(saved_temperature_);
  totals_ = saved_totals_;
}

}  // namespace malleus::forge
