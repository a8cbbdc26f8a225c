#include "forge/increment_errors.hpp"

#include <array>
#include <cmath>

#include "mesh/simplex.hpp"

namespace malleus::forge {
namespace {

/// Sums over the elements of deformable bodies, all weighted by their power of deformation.
struct Powers {
  Real all = 0;
  Real sensitivity = 0;  ///< m
  Real cut_off = 0;      ///< share of the viscosity that the cut-off takes
  Real returned = 0;     ///< m d / 3
};

/// Radius of an element's middle in axisymmetric scenes, m: its ring's volume but for 2 pi; else 1.
Real mean_radius(const Scene& scene, LocalId e) {
  if (scene.geometry != Geometry::axisymmetric) return 1;
  const auto nodes = scene.mesh.nodes_of_element(e);
  Real sum = 0;
  for (const LocalId node : nodes) sum += scene.mesh.point(node)[0];
  return std::abs(sum) / static_cast<Real>(nodes.size());
}

Powers sum_powers(const Scene& scene, Real dt) {
  const auto viscosity = std::as_const(scene.fields)[field_name::viscosity].values();
  const auto rate = std::as_const(scene.fields)[field_name::strain_rate].values();
  const Real cut_off = scene.solver.cutoff_strain_rate * scene.scale.rate();
  std::array<Real, 4> sums = {0, 0, 0, 0};
  with_dim(scene.mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < scene.mesh.elements(); ++e) {
      const auto i = static_cast<std::size_t>(e);
      const auto region = static_cast<std::size_t>(scene.mesh.element_region[i]);
      const Body& body = scene.bodies[region];
      if (!body.is_deformable() || !(rate[i] > 0)) continue;
      const Real measure = simplex_volume<D>(simplex_points<D>(scene.mesh, e)) * mean_radius(scene, e);
      const Real power = measure * viscosity[i] * rate[i] * rate[i];
      const Real m = body.sensitivity;
      sums[0] += power;
      sums[1] += power * m;
      sums[2] += power * (1 - std::pow(1 + std::pow(cut_off / rate[i], 2), (m - 1) / 2));
      sums[3] += power * m * std::abs(scene.progress.asked_strains[region]) / (3 * rate[i] * dt);
    }
  });
  scene.comm->sum_in_place(sums);
  return {sums[0], sums[1], sums[2], sums[3]};
}

}  // namespace

ForceErrors increment_errors(const Scene& scene, const FlowReport& report, Real dt) {
  ForceErrors errors;
  errors.nonlinear = report.residual;
  errors.balance = report.force_imbalance / 2;
  const Powers powers = sum_powers(scene, dt);
  if (!(powers.all > 0)) return errors;
  errors.cut_off = powers.cut_off / powers.all;
  errors.returned = powers.returned / powers.all;
  const Real given = std::abs(report.power.imposed + report.power.tools);
  if (given > 0) errors.contact = powers.sensitivity / powers.all * std::abs(report.penalty_power) / given;
  return errors;
}

void ForceErrorSums::add(const ForceErrors& increment) {
  ++increments_;
  squares_.contact += increment.contact * increment.contact;
  squares_.cut_off += increment.cut_off * increment.cut_off;
  squares_.returned += increment.returned * increment.returned;
  squares_.nonlinear += increment.nonlinear * increment.nonlinear;
  squares_.balance += increment.balance * increment.balance;
}

ForceErrors ForceErrorSums::mean() const {
  if (!(increments_ > 0)) return {};
  const auto root = [&](Real square) { return std::sqrt(square / increments_); };
  return {root(squares_.contact), root(squares_.cut_off), root(squares_.returned), root(squares_.nonlinear),
          root(squares_.balance)};
}

nlohmann::json ForceErrorSums::save() const {
  return {{"increments", increments_},     {"contact", squares_.contact},     {"cut_off", squares_.cut_off},
          {"returned", squares_.returned}, {"nonlinear", squares_.nonlinear}, {"balance", squares_.balance}};
}

void ForceErrorSums::restore(const nlohmann::json& saved) {
  increments_ = saved.at("increments");
  squares_ = {saved.at("contact"), saved.at("cut_off"), saved.at("returned"), saved.at("nonlinear"),
              saved.at("balance")};
}

}  // namespace malleus::forge
