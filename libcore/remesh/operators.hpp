#pragma once

/// Split, collapse, swap and relocation: each gathers a cavity, looks for its best star, and commits it or leaves the
/// mesh as it was. All share one rule for boundaries: a vertex moves and merges within its entity only.

#include "remesh/ball_shape.hpp"
#include "remesh/cavity.hpp"

namespace malleus::remeshing {

/// What counts as too long, too short and too bad; lengths are metric, squared.
struct Limits {
  Real long_edge = 2.0;        ///< split above
  Real short_edge = 0.5;       ///< collapse below
  Real longest_made = 2.0;     ///< a collapse makes no edge above
  Real nearest_ring = 0.45;    ///< a split puts no point nearer to the vertices around the edge
  Real split_key = 0.02;       ///< a split leaves no element below this and below a share of the present worst
  Real collapse_key = 0.08;    ///< likewise for a collapse
  Real collapse_gain = 0;      ///< a collapse multiplies the worst key by at least this
  float small_change = 0.02F;  ///< relative change of a key from which its element is looked at again
  float large_change = 1e30F;  ///< and its vertices, too
  Real balance_key = 0.25;     ///< a turn for balance leaves no element below this
  Real swap_gain = 1.03;       ///< a swap multiplies the worst key by at least this
};

/// Accepted operations.
struct OperationCounts {
  std::int64_t splits = 0;
  std::int64_t collapses = 0;
  std::int64_t swaps = 0;
  std::int64_t moves = 0;
};

template <int D, class Metric>
class Operators {
 public:
  using Mesh = WorkingMesh<D, Metric>;
  using StarOf = Star<D, Metric>;

  Operators(Mesh& mesh, const Background<D, Metric>& background)
      : mesh_(mesh), background_(background), cavity_(mesh) {}

  Limits limits;
  OperationCounts counts;
  std::vector<LocalId> swap_list;    ///< elements whose swaps are worth a look
  std::vector<LocalId> length_list;  ///< elements whose edges may be too long or too short
  std::vector<LocalId> move_list;    ///< vertices whose surroundings changed

  /// Splits an edge of an element near its middle. Edges on frozen patches stay.
  bool split(LocalId element, std::size_t edge);
  /// Merges vertex v into its neighbour w.
  bool collapse(LocalId v, LocalId w);
  /// Turns an edge: its shell is starred from the best vertex around it.
  bool swap_edge(LocalId element, std::size_t edge);
  /// Replaces the pair at a face by the shell of a new edge (3D).
  bool swap_face(LocalId element, std::size_t face);
  /// Any swap at an element.
  bool swap_at(LocalId element);
  /// Turns an edge (2D) where that brings the numbers of triangles at its four vertices nearer to the ideal, at some
  /// expense of shape that relocation makes good.
  bool balance(LocalId element, std::size_t edge);
  /// Before a pass of balance().
  void count_surplus();
  /// Moves a vertex where its elements become better.
  bool relocate(LocalId v);

  /// Betters one of the worst elements: by a swap, by looking for the best place of each of its vertices, by a merger,
  /// or by a new vertex. limits.swap_gain and limits.collapse_gain say what counts.
  bool mend(LocalId element);

  /// Puts an element on the lists, if it is not.
  void enlist(LocalId element, std::uint8_t lists);
  void enlist_vertex(LocalId v);

 private:
  StarOf star_from(LocalId apex) const {
    const Vertex& vertex = mesh_.vertex(apex);
    return {apex, {mesh_.point(apex), mesh_.metric(apex), vertex.input_element, vertex.input_face}, -1, -1};
  }
  EntityOf edge_entity(LocalId a, LocalId b) const;
  bool is_near_ring(const StarOf& star) const;
  bool split_at(StarOf star, EntityOf entity, LocalId a, LocalId b);
  bool may_collapse(LocalId v, LocalId w) const;
  bool keeps_links(LocalId v, LocalId w);
  bool bends_surface(const StarOf& star) const;
  bool faces_stay_close(const StarOf& star) const;
  bool ball_stays_close(LocalId v) const;
  void move_curve_edges(LocalId v, LocalId w);
  bool swap_patch_edge(LocalId a, LocalId b, Real worst);
  bool swap_inner_edge(LocalId a, LocalId b, Real worst);
  Real ring_key(LocalId a, LocalId b, std::size_t from, Real limit) const;
  Real pair_key(const Element<D>& element, std::size_t face, LocalId beyond, Real limit) const;
  void note_tried(LocalId a, LocalId b);
  bool edge_exists(LocalId a, LocalId b);
  std::size_t edge_of(LocalId e, LocalId a, LocalId b) const;
  void note_ball(LocalId v);
  Point<D> ideal_position(LocalId v) const;
  bool try_site(LocalId v, const Site<D, Metric>& site, Real worst, Real total);
  bool return_to_surface(LocalId v, Real worst);
  void note_changes();
  template <class Try>
  bool search_place(Point<D> start, std::span<const LocalId> around, Try&& try_place) const;
  void find_around(LocalId but, std::vector<LocalId>& around);
  bool raise_worst(LocalId v, const Site<D, Metric>& site, Real& worst);
  bool optimise(LocalId v);
  bool insert_at(LocalId element, std::size_t edge);
  template <class Accept>
  bool put_at(LocalId v, const Site<D, Metric>& site, Real floor, Accept&& accept);
  void commit(const StarOf& star);
  LocalId take_vertex();

  Mesh& mesh_;
  const Background<D, Metric>& background_;
  Cavity<D, Metric> cavity_;
  BallShape<D> ball_;  ///< of the vertex that relocation looks at
  std::vector<float> keys_;
  std::vector<LocalId> around_;
  std::vector<float> surplus_;  ///< [vertex] triangles beyond the ideal number (2D, for balance)
};

}  // namespace malleus::remeshing
