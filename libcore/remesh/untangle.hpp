#pragma once

/// Repair of inverted and flat elements, before anything else is done.

#include "remesh/cavity.hpp"

namespace malleus::remeshing {

/// The body's signed volume is that of its border, whatever happens inside; a mesh without overlaps has the smallest
/// sum of |volumes| (Coupez 2000). So every step must lower the sum over its cavity, or keep it and raise the worst
/// key: first vertices move (that cannot break the topology), then cavities are starred anew, with a check that no edge
/// or face is made that exists elsewhere.
template <int D, class Metric>
class Untangler {
 public:
  explicit Untangler(WorkingMesh<D, Metric>& mesh) : mesh_(mesh), cavity_(mesh) {}

  /// Returns the number of elements of key <= 0 that are left.
  LocalId run();

 private:
  using StarOf = Star<D, Metric>;
  /// A height over a fixed face as a linear function of the moving vertex.
  struct Height {
    Point<D> slope{};  ///< unit, before it is confined to the vertex's entity
    Real offset = 0;
    Real area = 0;  ///< scaled measure of the face
  };
  struct Measure {
    Real volume = 0;  ///< sum of |scaled volumes|
    Real worst = 0;   ///< smallest height, or worst key
  };

  std::vector<LocalId> bad_elements() const;
  void relax_round(const std::vector<LocalId>& bad, int width);
  bool relax(LocalId v);
  bool gather_heights(LocalId v);
  Point<D> confined(LocalId v, const Point<D>& slope) const;
  Measure measure(const Point<D>& x) const;
  Point<D> raised(LocalId v, const Point<D>& x, Real margin) const;
  bool restar(LocalId element);
  bool remove_flat_border(LocalId element);
  bool remove_loose(LocalId element);
  bool best_star(std::span<const LocalId> candidates, LocalId removed);
  bool breaks_links(const StarOf& star);
  bool try_edges(LocalId element);
  bool try_faces(LocalId element);
  bool try_balls(LocalId element);

  WorkingMesh<D, Metric>& mesh_;
  Cavity<D, Metric> cavity_;
  std::vector<Height> heights_;
  std::vector<std::uint32_t> marks_;
  std::uint32_t stamp_ = 0;
};

}  // namespace malleus::remeshing
