#include "forge/scene.hpp"

#include <numbers>

#include "mesh/simplex.hpp"

namespace malleus::forge {

Real Scene::deformable_volume() const {
  Real sum = 0;
  for (const Body& body : bodies) {
    if (body.is_deformable()) sum += body.volume;
  }
  return sum;
}

void declare_fields(Scene& scene) {
  using enum Support;
  using enum Transfer;
  const int dim = scene.dim();
  const auto declare = [&](const char* name, const char* unit, Support support, int components, Transfer transfer,
                           bool positive = false) {
    scene.fields.declare(scene.mesh, {name, unit, support, components, transfer, positive});
  };
  declare(field_name::velocity, "m/s", node, dim, interpolate);
  declare(field_name::pressure, "Pa", node, 1, interpolate);
  declare(field_name::viscosity, "Pa.s", element, 1, recompute);
  declare(field_name::strain_rate, "1/s", element, 1, interpolate, true);
  declare(field_name::equivalent_strain, "1", element, 1, interpolate, true);
  declare(field_name::stress, "Pa", element, dim * (dim + 1) / 2, recompute);
  declare(field_name::quality, "1", element, 1, recompute);
  if (scene.tools.empty() && scene.pairs.empty()) return;
  declare(field_name::contact_pressure, "Pa", node, 1, interpolate, true);
  declare(field_name::contact_gap, "m", node, 1, recompute);
}

std::vector<Real> body_volumes(const Scene& scene) {
  const Mesh& mesh = scene.mesh;
  std::vector<Real> volumes(scene.bodies.size(), 0.0);
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const SimplexPoints<D> points = simplex_points<D>(mesh, e);
      Real volume = simplex_volume<D>(points);
      if (scene.geometry == Geometry::axisymmetric) volume *= 2 * std::numbers::pi * points.row(0).mean();
      volumes[static_cast<std::size_t>(mesh.element_region[static_cast<std::size_t>(e)])] += volume;
    }
  });
  scene.comm->sum_in_place(volumes);
  return volumes;
}

bool has_turned_elements(const Scene& scene) {
  bool turned = false;
  with_dim(scene.mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < scene.mesh.elements() && !turned; ++e) {
      turned = !(simplex_volume<D>(simplex_points<D>(scene.mesh, e)) > 0);
    }
  });
  return scene.comm->any(turned);
}

}  // namespace malleus::forge
