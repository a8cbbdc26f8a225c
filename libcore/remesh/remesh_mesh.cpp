#include "remesh/remesh_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "remesh/geometry.hpp"

namespace malleus {
namespace {

void check_size(std::size_t found, std::size_t wanted, const char* what) {
  if (found != wanted) throw InputError(fmt::format("remesh: {} has {} entries, {} expected", what, found, wanted));
}

void check_numbers(std::span<const LocalId> numbers, LocalId limit, const char* what) {
  for (const LocalId number : numbers) {
    if (number < 0 || number >= limit)
      throw InputError(fmt::format("remesh: {} names node {}, of {}", what, number, limit));
  }
}

template <int D>
Real volume_of(const RemeshMesh& mesh, LocalId element) {
  std::array<remeshing::Point<D>, D + 1> x;
  std::array<const remeshing::Point<D>*, D + 1> pointers;
  const auto nodes = mesh.nodes_of_element(element);
  for (std::size_t i = 0; i <= D; ++i) {
    std::copy_n(mesh.point(nodes[i]), D, x[i].begin());
    pointers[i] = &x[i];
  }
  return remeshing::scaled_volume<D>(pointers) / remeshing::factorial<D>;
}

}  // namespace

void check_arrays(const RemeshMesh& mesh) {
  const auto d = static_cast<std::size_t>(mesh.dimension);
  if (mesh.dimension != 2 && mesh.dimension != 3)
    throw InputError(fmt::format("remesh: dimension {} is neither 2 nor 3", mesh.dimension));
  check_size(mesh.coordinates.size() % d, 0, "the rest of the coordinates");
  check_size(mesh.element_nodes.size(), mesh.element_region.size() * (d + 1), "element_nodes");
  check_size(mesh.facet_nodes.size(), mesh.facet_group.size() * d, "facet_nodes");
  check_size(mesh.curve_nodes.size(), mesh.curve_group.size() * 2, "curve_nodes");
  if (!mesh.frozen.empty()) check_size(mesh.frozen.size(), static_cast<std::size_t>(mesh.nodes()), "frozen");
  check_numbers(mesh.element_nodes, mesh.nodes(), "an element");
  check_numbers(mesh.facet_nodes, mesh.nodes(), "a facet");
  check_numbers(mesh.curve_nodes, mesh.nodes(), "a curve edge");
  check_numbers(mesh.corners, mesh.nodes(), "a corner");
  for (const Real x : mesh.coordinates) {
    if (!std::isfinite(x)) throw InputError("remesh: a coordinate is not a finite number");
  }
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    const auto nodes = mesh.nodes_of_element(e);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (std::find(nodes.begin(), nodes.begin() + static_cast<std::ptrdiff_t>(i), nodes[i]) !=
          nodes.begin() + static_cast<std::ptrdiff_t>(i))
        throw InputError(fmt::format("remesh: element {} has node {} twice", e, nodes[i]));
    }
  }
}

Real signed_volume(const RemeshMesh& mesh, std::int32_t region) {
  Real sum = 0;
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    if (region != any_region && mesh.element_region[static_cast<std::size_t>(e)] != region) continue;
    sum += mesh.dimension == 2 ? volume_of<2>(mesh, e) : volume_of<3>(mesh, e);
  }
  return sum;
}

}  // namespace malleus
