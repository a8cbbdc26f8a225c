#pragma once

/// The input mesh as it was: where new points go on its surface, and which metric holds there.

#include "remesh/working_mesh.hpp"

namespace malleus::remeshing {

/// A place for a vertex and what goes with it.
template <int D, class Metric>
struct Site {
  Point<D> position{};
  Metric metric{};
  LocalId input_element = -1;
  LocalId input_face = -1;
};

/// What a vertex or an edge lies on: a curve, a patch, or the inside (dimension D).
struct EntityOf {
  std::uint8_t dimension = 3;
  std::int32_t id = -1;
};

template <int D, class Metric>
class Background {
 public:
  explicit Background(const WorkingMesh<D, Metric>& mesh) : mesh_(mesh) {}

  /// Place on the edge (a, b), near its middle in metric length, on the edge's entity.
  Site<D, Metric> site_on_edge(LocalId a, LocalId b, EntityOf entity) const;
  /// Place for vertex v on its own entity, nearest to a wanted position.
  Site<D, Metric> site_for(LocalId v, const Point<D>& wanted) const;
  /// May the surface have a face (edge in 2D) with these vertices, the last at a given place?
  bool allows_face(const std::array<Point<D>, D>& face, std::int16_t patch) const;

 private:
  const WorkingMesh<D, Metric>& mesh_;
};

}  // namespace malleus::remeshing
