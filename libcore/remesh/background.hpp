#pragma once

/// The input mesh as it was: where new points go on its surface, and which metric holds there.

#include "remesh/input_surface.hpp"
#include "remesh/locator.hpp"

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
  /// The mesh must be the input, renumbered. hausdorff [m]: how far the centre of a face may be from the input surface;
  /// 0 = no such bound. varies: the metric is not the same everywhere.
  Background(WorkingMesh<D, Metric>& mesh, Real hausdorff, bool varies);

  /// Place on the edge (a, b), near its middle in metric length, on the edge's entity. On curved entities with
  /// `straight` it stays on the chord.
  Site<D, Metric> site_on_edge(LocalId a, LocalId b, EntityOf entity, bool straight = false) const;
  /// Place for vertex v on its own entity, nearest to a wanted position.
  Site<D, Metric> site_for(LocalId v, const Point<D>& wanted) const;
  /// Moves a site inside the body.
  void move_site(Site<D, Metric>& site, const Point<D>& position) const {
    site.position = position;
    set_metric(site);
  }
  /// May a curved patch have a face (edge in 2D) with these points? hint: facet (segment) of the patch near it, or -1.
  bool allows_face(const std::array<Point<D>, D>& face, LocalId hint) const;
  /// Facet (in 2D, segment) of a patch near a vertex, -1 where it is not known.
  LocalId hint(LocalId v, std::int16_t patch) const;
  /// Is v on a curved patch, or on a curve (D = 3) that bends?
  bool is_on_curved(LocalId v) const;
  /// Outward or inward unit normal of a curved patch at one of its inner vertices.
  Point<D> normal_at(LocalId v) const;

 private:
  bool is_curved(EntityOf entity) const;
  SurfacePoint<D> on_entity(const Point<D>& x, EntityOf entity, LocalId hint) const;
  LocalId hint_for(LocalId v, EntityOf entity) const;
  void set_metric(Site<D, Metric>& site) const;

  const WorkingMesh<D, Metric>& mesh_;
  Real hausdorff_;
  InputSurface<D> surface_;
  Locator<D> locator_;  ///< empty for a constant metric
  std::vector<typename Metric::Log> logs_;
};

}  // namespace malleus::remeshing
