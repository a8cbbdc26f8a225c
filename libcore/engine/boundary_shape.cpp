#include "engine/boundary_shape.hpp"

#include <algorithm>

#include "base/index.hpp"
#include "fem/facet.hpp"

namespace malleus {
namespace {

Position between(const std::vector<Position>& corners) {
  Position mean = {};
  for (const Position& corner : corners) {
    for (std::size_t c = 0; c < 3; ++c) mean[c] += corner[c] / static_cast<Real>(corners.size());
  }
  return mean;
}

template <int D>
void measure(const Mesh& mesh, LocalId facet, Real length, BoundaryFacet& found) {
  const Point<D> area_normal = facet_area_normal<D>(facet_points<D>(mesh, facet));
  found.area = area_normal.norm() / std::pow(length, D - 1);
  for (int c = 0; c < D; ++c) found.normal[index(c)] = area_normal[c] / area_normal.norm();
}

}  // namespace

BoundingFrame bounding_frame(const Communicator& comm, const Mesh& mesh) {
  std::array<Real, 6> extremes;
  extremes.fill(-1e300);
  for (LocalId node = 0; node < mesh.nodes(); ++node) {
    for (int c = 0; c < mesh.dim; ++c) {
      extremes[index(c)] = std::max(extremes[index(c)], mesh.point(node)[c]);
      extremes[index(c + 3)] = std::max(extremes[index(c + 3)], -mesh.point(node)[c]);
    }
  }
  comm.max_in_place(extremes);
  BoundingFrame frame;
  for (int c = 0; c < mesh.dim; ++c) {
    frame.middle[index(c)] = (extremes[index(c)] - extremes[index(c + 3)]) / 2;
    frame.half[index(c)] = (extremes[index(c)] + extremes[index(c + 3)]) / 2;
    frame.length = std::max(frame.length, frame.half[index(c)]);
  }
  return frame;
}

BoundaryFacet boundary_facet(const Mesh& mesh, LocalId facet, const BoundingFrame& frame) {
  BoundaryFacet found;
  mesh.dim == 3 ? measure<3>(mesh, facet, frame.length, found) : measure<2>(mesh, facet, frame.length, found);
  std::vector<Position> corners;
  for (const LocalId node : mesh.nodes_of_facet(facet)) {
    Position point = {};
    std::copy_n(mesh.point(node), mesh.dim, point.begin());
    corners.push_back(frame.inside(point));
  }
  const Real at_corner = mesh.dim == 3 ? 1.0 / 20 : 1.0 / 6;
  const Real at_centre = mesh.dim == 3 ? 9.0 / 20 : 4.0 / 6;
  for (const Position& corner : corners) found.points.emplace_back(corner, at_corner * found.area);
  found.points.emplace_back(between(corners), at_centre * found.area);
  if (mesh.dim == 3) {
    for (std::size_t i = 0; i < 3; ++i) {
      found.points.emplace_back(between({corners[i], corners[(i + 1) % 3]}), 2.0 / 15 * found.area);
    }
  }
  return found;
}

}  // namespace malleus
