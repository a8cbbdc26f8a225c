#pragma once

/// The curved boundary of the input as smooth patches and curves, kept until the end of a remesh: new points go onto
/// it, so that repeated resampling does not wear it down.
///
/// Facets in 3D are cubic PN triangles (Vlachos, Peters, Boyd, Mitchell 2001) on vertex normals weighted after Max
/// (1999), exact on spheres; feature curves, and boundary curves in 2D, are cubic Hermite segments on tangents that are
/// exact on circles. At the ends of curves and the rims of patches one-sided data is mirrored from the inside.

#include <map>

#include "remesh/working_mesh.hpp"

namespace malleus::remeshing {

/// A point of the input's boundary and the piece it lies on.
template <int D>
struct SurfacePoint {
  Point<D> position{};
  Point<D> direction{};  ///< unit: normal of a facet, tangent of a segment
  LocalId piece = -1;    ///< facet or segment
};

template <int D>
class InputSurface {
 public:
  /// Takes over all curved patches and, where there is any, all curves. vertices' input_face is set: on patches and
  /// curves a piece at them, at corners the key that hint() understands.
  template <class Metric>
  void build(WorkingMesh<D, Metric>& mesh);

  bool is_empty() const { return facets_.empty() && segments_.empty(); }
  /// A facet of the patch at or near a vertex; -1 where it is not known.
  LocalId facet_hint(const Vertex& vertex, std::int32_t patch) const;
  /// A segment of the curve (in 2D, of the patch) at or near a vertex.
  LocalId segment_hint(const Vertex& vertex, std::int32_t curve) const;
  /// The point of the patch (curve) over which x stands, walking from a piece of it.
  SurfacePoint<D> on_patch(const Point<D>& x, LocalId facet) const;
  SurfacePoint<D> on_curve(const Point<D>& x, LocalId segment) const;

 private:
  struct Facet {
    std::array<LocalId, 3> vertex{};
    std::array<Point<D>, 3> corner{};
    std::array<Point<D>, 3> normal{};
    std::array<LocalId, 3> neighbour{};  ///< across the edge opposite each corner, within the patch
    std::int32_t patch = -1;
  };
  struct Segment {
    std::array<LocalId, 2> vertex{};
    std::array<Point<D>, 2> end{};
    std::array<Point<D>, 2> tangent{};   ///< unit, from end 0 to end 1
    std::array<LocalId, 2> neighbour{};  ///< beyond each end, within the curve
    std::int32_t curve = -1;
  };
  using Key = std::pair<std::int64_t, std::int32_t>;  ///< (vertex or segment, patch or curve)

  void connect_facets();
  void orient_facets();
  void set_normals();
  void connect_segments(const std::vector<Vertex>& vertices);
  void set_tangents();
  static Point<D> evaluate(const Facet& facet, const std::array<Real, 3>& weights);
  static Point<D> evaluate(const Segment& segment, Real t);
  static std::array<Real, 3> weights_of(const Facet& facet, const Point<D>& x);

  std::vector<Facet> facets_;
  std::vector<Segment> segments_;
  std::map<Key, LocalId> corner_facets_;    ///< (corner, patch) -> facet
  std::map<Key, LocalId> corner_segments_;  ///< (corner, curve) -> segment
  std::map<Key, LocalId> segment_facets_;   ///< (segment, patch) -> facet
};

}  // namespace malleus::remeshing
