#include "forge/motion.hpp"

#include <fmt/format.h>

#include <cmath>

#include "base/log.hpp"
#include "mesh/simplex.hpp"

namespace malleus::forge {
namespace {

/// An increment is given up where an edge changes by more than this times the share that steps are planned for.
constexpr Real tolerance_of_share = 2;
/// A step of a second-order scheme in which a body's volume drifts by more than this share is given up.
constexpr Real tolerated_drift = 5e-3;
/// From this share on the user is told of the volume that is lost in all.
constexpr Real alarming_loss = 1e-2;

}  // namespace

std::string Motion::purpose() const {
  switch (scene_.motion.scheme) {
    case TimeScheme::adams_bashforth_2:
      return "the mesh follows the material: Adams-Bashforth 2, started by Runge-Kutta 2";
    case TimeScheme::runge_kutta_2:
      return "the mesh follows the material: Runge-Kutta 2";
    case TimeScheme::euler:
      return "the mesh follows the material: explicit Euler";
  }
  return "";
}

Outcome Motion::advance(const Increment& increment) {
  saved_coordinates_ = scene_.mesh.coordinates;
  const auto strain = std::as_const(scene_.fields)[field_name::equivalent_strain].values();
  saved_strain_.assign(strain.begin(), strain.end());
  saved_bodies_ = scene_.bodies;
  saved_progress_ = scene_.progress;
  if (const Outcome outcome = check_edges(increment.dt); outcome.kind != Outcome::Kind::done) return outcome;
  if (const Outcome outcome = move(increment.dt); outcome.kind != Outcome::Kind::done) return outcome;
  if (const Outcome outcome = check_volumes(); outcome.kind != Outcome::Kind::done) return outcome;
  integrate_strain(increment.dt);
  account_volume();
  account_strokes(increment);
  return Outcome::done();
}

void Motion::roll_back() {
  scene_.mesh.coordinates = saved_coordinates_;
  scene_.fields[field_name::equivalent_strain].assign(saved_strain_);
  scene_.bodies = saved_bodies_;
  scene_.progress = saved_progress_;
}

Outcome Motion::check_edges(Real dt) const {
  const Mesh& mesh = scene_.mesh;
  const auto displacement = [&](LocalId node) {
    return Vector(dt * to_vector(scene_.step_velocity.data() + static_cast<std::size_t>(node) * mesh.dim, mesh.dim));
  };
  Real worst = 0;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const Vector edge = to_vector(mesh.point(nodes[i]), mesh.dim) - to_vector(mesh.point(nodes[j]), mesh.dim);
        worst = std::max(worst, (displacement(nodes[i]) - displacement(nodes[j])).norm() / edge.norm());
      }
    }
  }
  worst = scene_.comm->max(worst);
  if (worst <= tolerance_of_share * scene_.motion.edge_share) return Outcome::done();
  return Outcome::retry(fmt::format("an edge would change by {:.0f} % of its length", 100 * worst));
}

Outcome Motion::move(Real dt) {
  Mesh& mesh = scene_.mesh;
  for (std::size_t i = 0; i < mesh.coordinates.size(); ++i) mesh.coordinates[i] += dt * scene_.step_velocity[i];
  LocalId turned = -1;
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements() && turned < 0; ++e) {
      if (!(simplex_volume<D>(simplex_points<D>(mesh, e)) > 0)) turned = e;
    }
  });
  if (!scene_.comm->any(turned >= 0)) return Outcome::done();
  const GlobalId speaker = scene_.comm->min(turned >= 0 ? static_cast<GlobalId>(scene_.comm->rank())
                                                        : static_cast<GlobalId>(scene_.comm->size()));
  std::array<Real, 3> place = {0, 0, 0};
  if (scene_.comm->rank() == speaker) {
    const Vector point = to_vector(mesh.point(mesh.nodes_of_element(turned)[0]), mesh.dim);
    place = {point[0], point[1], point[2]};
  }
  scene_.comm->broadcast(std::span<Real>(place), static_cast<int>(speaker));
  mesh.coordinates = saved_coordinates_;
  return Outcome::retry(
      fmt::format("an element at ({:.4g}, {:.4g}, {:.4g}) m would turn over", place[0], place[1], place[2]));
}

void Motion::integrate_strain(Real dt) {
  auto strain = scene_.fields[field_name::equivalent_strain].values();
  for (std::size_t e = 0; e < strain.size(); ++e) strain[e] += dt * scene_.step_strain_rate[e];
}

/// Steps so long that the scheme's error shows in the volume. Euler's, whose error is known, is taken as it is.
Outcome Motion::check_volumes() {
  if (scene_.motion.scheme == TimeScheme::euler) return Outcome::done();
  const std::vector<Real> volumes = body_volumes(scene_);
  for (std::size_t region = 0; region < scene_.bodies.size(); ++region) {
    const Body& body = scene_.bodies[region];
    if (!body.is_deformable() || !(body.volume > 0)) continue;
    const Real drift = std::log(volumes[region] / body.volume) - scene_.progress.asked_strains[region];
    if (std::abs(drift) <= tolerated_drift) continue;
    scene_.mesh.coordinates = saved_coordinates_;
    return Outcome::retry(fmt::format("the volume of {} would change by {:.2g} %", body.name, 100 * drift));
  }
  return Outcome::done();
}

void Motion::warn_of_loss() {
  Real start = 0;
  for (const Body& body : scene_.bodies) start += body.is_deformable() ? body.start_volume : 0;
  const Real change = start > 0 ? scene_.deformable_volume() / start - 1 : 0;
  if (std::abs(change) < alarming_loss || has_warned_) return;
  has_warned_ = true;
  log::warn(
      fmt::format("the volume of the bodies has changed by {:.2g} %: shorten the steps ([time] step, [motion] "
                  "strain){}",
                  100 * change, scene_.motion.scheme == TimeScheme::euler ? " or leave scheme = euler" : ""));
}

/// What the motion lost beyond what was asked back: the drift that there were without volume targets.
void Motion::account_volume() {
  const std::vector<Real> volumes = body_volumes(scene_);
  Progress& progress = scene_.progress;
  Real change = 0;
  Real start = 0;
  for (std::size_t region = 0; region < scene_.bodies.size(); ++region) {
    Body& body = scene_.bodies[region];
    if (body.is_deformable() && body.volume > 0) {
      progress.volume_losses[region] = std::log(volumes[region] / body.volume) - progress.asked_strains[region];
      change += body.volume * progress.volume_losses[region];
      start += body.start_volume;
    }
    body.volume = volumes[region];
  }
  if (start > 0) scene_.progress.raw_volume_drift += change / start;
  warn_of_loss();
}

void Motion::account_strokes(const Increment& increment) {
  Progress& progress = scene_.progress;
  for (std::size_t t = 0; t < scene_.tools.size(); ++t) {
    Tool& tool = scene_.tools[t];
    if (!(tool.motion().direction.squaredNorm() > 0)) continue;
    tool.press().commit(tool.resistance(flow_.report().tool_forces[t]), increment.start(), flow_.displacement());
  }
  const Real middle = increment.start() + 0.5 * increment.dt;
  for (std::size_t i = 0; i < progress.boundary_strokes.size(); ++i) {
    const auto mean = scene_.boundaries->mean_velocity(i, middle);
    progress.boundary_strokes[i] += increment.dt * to_vector(mean.data(), 3).norm();
  }
  const Mesh& mesh = scene_.mesh;
  std::vector<Real> sums(scene_.bodies.size() * 4, 0.0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto region = static_cast<std::size_t>(mesh.element_region[static_cast<std::size_t>(e)]);
    for (const LocalId node : mesh.nodes_of_element(e)) {
      for (int c = 0; c < mesh.dim; ++c) {
        sums[region * 4 + static_cast<std::size_t>(c)] +=
            scene_.step_velocity[static_cast<std::size_t>(node) * static_cast<std::size_t>(mesh.dim) +
                                 static_cast<std::size_t>(c)];
      }
      sums[region * 4 + 3] += 1;
    }
  }
  scene_.comm->sum_in_place(sums);
  for (std::size_t region = 0; region < scene_.bodies.size(); ++region) {
    const Real count = sums[region * 4 + 3];
    if (count > 0)
      progress.body_strokes[region] += increment.dt * to_vector(sums.data() + region * 4, 3).norm() / count;
  }
  progress.time = increment.time;
  progress.last_step = progress.was_pushed ? increment.dt : 0;
}

Real smallest_quality(const Scene& scene) {
  const Mesh& mesh = scene.mesh;
  Real smallest = 1;
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const auto region = static_cast<std::size_t>(mesh.element_region[static_cast<std::size_t>(e)]);
      if (!scene.bodies[region].is_deformable()) continue;
      smallest = std::min(smallest, simplex_quality<D>(simplex_points<D>(mesh, e)));
    }
  });
  return scene.comm->min(smallest);
}

}  // namespace malleus::forge
