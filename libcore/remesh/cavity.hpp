#pragma once

/// The one operator: a few elements are emptied and the hole is starred from one of its vertices or from a new point.
///
/// A cavity is the shell of an edge, the ball of a vertex, or the pair at a face. Its border faces keep what lies
/// beyond them. A star joins every border face to the apex, save those that hold the apex and those that vanish: faces
/// of the boundary that hold the removed vertices (both ends of an edge that is split or turned on the boundary; the
/// vertex that is collapsed). Since the border is kept, a star whose elements are all positive fills the hole exactly
/// where no boundary face vanishes: it has the minimal sum of |volumes| (Coupez 2000). Among such stars the best worst
/// shape key wins.

#include <span>

#include "remesh/background.hpp"

namespace malleus::remeshing {

/// A way to fill the hole.
template <int D, class Metric>
struct Star {
  LocalId apex = -1;  ///< an existing vertex, or -1: the new point
  Site<D, Metric> site;
  LocalId removed_a = -1;  ///< faces of the boundary that hold removed_a (and removed_b where it is given) vanish
  LocalId removed_b = -1;
};

template <int D>
struct BorderFace {
  std::array<LocalId, D> node;  ///< seen from inside, so that (face, apex) is positive
  FaceRef outside;
  std::int16_t patch;
  std::int16_t region;
};

template <int D, class Metric>
class Cavity {
 public:
  using Mesh = WorkingMesh<D, Metric>;
  static constexpr std::size_t largest = 480;  ///< elements

  explicit Cavity(Mesh& mesh) : mesh_(mesh) {}

  /// Elements around a vertex; false where there are too many.
  bool gather_ball(LocalId vertex) {
    return gather_ball_while(vertex, [](LocalId) { return true; });
  }
  /// The same, given up as soon as accept(v) fails for a vertex of the ball (which may be asked for more than once).
  template <class Accept>
  bool gather_ball_while(LocalId vertex, Accept&& accept);
  /// Elements around the edge of local vertices a, b of an element; ring() is filled. False where there are too many.
  bool gather_shell(LocalId element, std::size_t edge);
  /// The elements on both sides of a face; false on the boundary.
  bool gather_pair(LocalId element, std::size_t face);
  /// Border faces and inner patch faces of the gathered elements.
  void find_border();

  std::span<const LocalId> elements() const { return {gathered_.data(), gathered_count_}; }
  std::span<const BorderFace<D>> border() const { return border_; }
  std::span<const BorderFace<D>> inner_patches() const { return inner_; }
  /// Vertices around the shell's edge, in order; a closed ring does not repeat its first.
  std::span<const LocalId> ring() const { return ring_; }
  bool is_closed() const { return closed_; }
  /// Does a face of a patch hold the edge whose shell is gathered, or the vertex whose ball is, with elements on both
  /// sides?
  bool has_inner_patch() const { return inner_patch_; }
  /// Worst shape key of the gathered elements.
  Real worst_key() const;
  Real scaled_volume_sum(bool absolute) const;

  /// Worst key of a star; stops early, with a value <= limit, once it is known not to exceed limit.
  Real evaluate(const Star<D, Metric>& star, Real limit) const;
  /// Sum of |scaled volume| over the star's elements; counts those <= 0.
  Real absolute_volume(const Star<D, Metric>& star, int& inverted) const;
  /// Does a frozen patch lose a face?
  bool removes_frozen(const Star<D, Metric>& star) const;
  /// Calls visit(face nodes, patch) for each face that a patch gains by the star, apex last.
  template <class Visit>
  void visit_new_patch_faces(const Star<D, Metric>& star, Visit&& visit) const;

  /// Carries it out. star.apex must be a vertex (make one first for a new point). Elements made are in made().
  void commit(const Star<D, Metric>& star);
  std::span<const LocalId> made() const { return made_; }

  /// Marks usable by operators: vertices marked since the last call to new_vertex_marks().
  void new_vertex_marks() {
    vertex_marks_.resize(mesh_.vertices.size(), 0);
    ++vertex_stamp_;
  }
  void mark_vertex(LocalId v) { vertex_marks_[static_cast<std::size_t>(v)] = vertex_stamp_; }
  bool is_marked(LocalId v) const { return vertex_marks_[static_cast<std::size_t>(v)] == vertex_stamp_; }

 private:
  struct Link {
    std::uint64_t key;
    FaceRef face;  ///< no_face: void beyond
    std::int16_t patch;
    bool open;
  };
  static constexpr std::size_t slots = 4096;

  static bool holds(const std::array<LocalId, D>& nodes, LocalId v) {
    bool found = false;
    for (const LocalId n : nodes) found |= n == v;
    return found;
  }
  static bool vanishes(const BorderFace<D>& face, const Star<D, Metric>& star) {
    if (star.removed_a < 0 || !holds(face.node, star.removed_a)) return false;
    return star.removed_b < 0 || holds(face.node, star.removed_b);
  }
  static std::uint64_t link_key(const std::array<LocalId, D>& nodes, std::size_t without) {
    if constexpr (D == 2) {
      return static_cast<std::uint64_t>(nodes[1 - without]);
    } else {
      return edge_key(nodes[(without + 1) % 3], nodes[(without + 2) % 3]);
    }
  }
  void begin(LocalId a, LocalId b) {
    gathered_count_ = 0;
    ring_.clear();
    inner_patch_ = false;
    kernel_a_ = a;
    kernel_b_ = b;
  }
  void add(LocalId e) { gathered_[gathered_count_++] = e; }
  /// Does the face of an element lie inside the cavity if there is an element beyond it? All faces at the vertex of a
  /// ball or at the edge of a shell do.
  bool holds_kernel(const Element<D>& element, std::size_t face) const {
    const LocalId opposite = element.node[face];
    return opposite != kernel_a_ && opposite != kernel_b_;
  }
  bool is_of_pair(LocalId e) const { return e == gathered_[0] || e == gathered_[1]; }
  void walk_shell(LocalId from, std::array<LocalId, 4> abpq, bool forward);
  void link(std::uint64_t key, FaceRef face, std::int16_t patch);
  void join(const Link& first, FaceRef face, std::int16_t patch, std::uint64_t key);
  void set_side(FaceRef face, FaceRef other, std::int16_t patch);
  std::int16_t inner_patch_at(std::uint64_t key) const;
  void note_inner_links(const Star<D, Metric>& star);
  LocalId take_slot();
  void make_element(const BorderFace<D>& face, LocalId apex);

  Mesh& mesh_;
  std::array<LocalId, largest + 2 * D + 2> gathered_{};
  std::size_t gathered_count_ = 0;
  std::vector<BorderFace<D>> border_;
  std::vector<BorderFace<D>> inner_;
  std::vector<LocalId> ring_;
  std::vector<LocalId> made_;
  LocalId kernel_a_ = -1;  ///< the vertex of the ball, or an end of the shell's edge
  LocalId kernel_b_ = -1;  ///< the other end
  bool inner_patch_ = false;
  std::vector<std::uint32_t> vertex_marks_;
  std::uint32_t vertex_stamp_ = 0;
  bool closed_ = false;
  std::size_t reused_ = 0;
  std::array<Link, slots> links_{};
  std::array<std::uint32_t, slots> link_stamps_{};
  std::uint32_t link_stamp_ = 0;
  std::vector<std::pair<std::uint64_t, std::int16_t>> inner_links_;
};

template <int D, class Metric>
template <class Accept>
bool Cavity<D, Metric>::gather_ball_while(LocalId vertex, Accept&& accept) {
  begin(vertex, -1);
  closed_ = true;
  const std::uint32_t stamp = ++mesh_.stamp;
  const LocalId first = mesh_.vertex(vertex).element;
  mesh_.element(first).stamp = stamp;
  for (const LocalId v : mesh_.element(first).node) {
    if (!accept(v)) return false;
  }
  add(first);
  for (std::size_t n = 0; n < gathered_count_; ++n) {
    const Element<D>& element = mesh_.element(gathered_[n]);
    for (std::size_t f = 0; f <= D; ++f) {
      if (element.node[f] == vertex) continue;
      const FaceRef ref = element.neighbour[f];
      inner_patch_ = inner_patch_ || (ref != no_face && element.patch[f] != no_patch);
      if (ref == no_face) {
        closed_ = false;
        continue;
      }
      Element<D>& next = mesh_.element(element_of(ref));
      if (next.stamp == stamp) continue;
      next.stamp = stamp;
      if (!accept(next.node[local_face(ref)])) return false;
      add(element_of(ref));
    }
    if (gathered_count_ > largest) return false;
  }
  return true;
}

template <int D, class Metric>
template <class Visit>
void Cavity<D, Metric>::visit_new_patch_faces(const Star<D, Metric>& star, Visit&& visit) const {
  const auto each = [&](const BorderFace<D>& face) {
    if (face.patch == no_patch || !vanishes(face, star) || holds(face.node, star.apex)) return;
    for (std::size_t without = 0; without < D; ++without) {
      const LocalId gone = face.node[without];
      if (gone != star.removed_a && gone != star.removed_b) continue;
      std::array<LocalId, D> made = face.node;
      made[without] = star.apex;
      visit(made, face.patch);
    }
  };
  for (const auto& face : border_) each(face);
  for (const auto& face : inner_) each(face);
}

}  // namespace malleus::remeshing
