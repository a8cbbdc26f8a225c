#pragma once

/// Repair of a partition in place, by pairs of parts: all over the machine disjoint pairs are formed, and each improves
/// its common border while the others do the same (paper, section 3.1.4).
///
/// The vertices stay on their ranks; only their part numbers change. For a round of disjoint pairs each rank marks the
/// vertices within some steps of the pairs' borders, sends these bands to one rank a pair, which solves a PairProblem,
/// and hears which vertices changed. The work of a round follows the length of the borders, not the size of the mesh.
/// Loads and the quotient graph, tables of the size of the machine, are known to all ranks.

#include <map>
#include <span>
#include <vector>

#include "partition/architecture.hpp"
#include "partition/band_exchange.hpp"
#include "partition/work_graph.hpp"

namespace malleus {

/// Two parts with a common border, p < q.
struct QuotientEdge {
  int p = 0;
  int q = 0;
  Real weight = 0;                      ///< of the edges across
  std::array<Real, 2> border = {0, 0};  ///< weights of the vertices of p next to q, and of q next to p
};

/// What a pair of parts aims at in a round.
struct PairGoal {
  int p = 0;
  int q = 0;
  std::array<Real, 2> aims = {0, 0};   ///< loads wanted of p and q, in weights
  std::array<Real, 2> slack = {0, 0};  ///< by which they may be exceeded
  int depth = 3;                       ///< steps from the border that the band reaches
};

struct RefinementSettings {
  int passes = 6;        ///< over all pairs
  int depth = 4;         ///< of the bands
  int inner_passes = 2;  ///< of the search in a band
  int stall = 200;       ///< moves without a gain after which a search ends
};

/// What was done, for reports; the same on all ranks. Messages and bytes are those of a machine with a rank a part: the
/// second part of a pair sends its side of the band to the first and hears which of its vertices changed.
struct RefinementCount {
  GlobalId rounds = 0;       ///< of disjoint pairs
  GlobalId flow_rounds = 0;  ///< times that flows were solved and sent, of the most in one go
  GlobalId pairs = 0;        ///< over all rounds
  GlobalId moved_vertices = 0;
  GlobalId messages = 0;
  GlobalId bytes = 0;

  void add(const RefinementCount& other);
};

class PairRefiner {
 public:
  /// parts: [vertex], copies up to date. targets: [part] weights aimed at, adding up to all. Collective.
  PairRefiner(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
              std::vector<int> parts, std::vector<Real> targets);

  const std::vector<int>& parts() const noexcept { return parts_; }
  const std::vector<Real>& loads() const noexcept { return loads_; }
  const RefinementCount& count() const noexcept { return count_; }
  std::vector<int> take_parts() && { return std::move(parts_); }

  /// Largest load over target, minus 1; parts of target 0 are not looked at. Local.
  Real imbalance() const;

  /// Borders between parts, the same on all ranks, by (p, q). Collective.
  std::vector<QuotientEdge> quotient();

  /// Lowers the cut pair by pair; loads within tolerance of their targets stay there, others come nearer. Collective.
  void smooth(Real tolerance, const RefinementSettings& settings);

  /// Brings the loads within tolerance of the targets by flows along the quotient graph (Hu and Blake, 1999), at most
  /// `rounds` times all along. Returns how many were made. Collective.
  int diffuse(Real tolerance, int rounds);

  /// absorb_stray_pieces(). Collective.
  GlobalId absorb_pieces();

  /// absorb_pieces() and flows to make up for it, undone where they end with loads out of balance: bodies that do not
  /// hang together want parts of several pieces. Returns whether something was absorbed. Collective.
  bool tidy(Real tolerance);

  /// One round: the goals' parts are disjoint. Returns how many vertices changed part, for each goal. Collective.
  std::vector<GlobalId> improve(std::span<const PairGoal> goals, const RefinementSettings& settings);

 private:
  struct Answer {
    GlobalId number;
    std::int64_t part;
  };
  struct Flow {
    QuotientEdge edge;
    Real weight;     ///< to go from p to q
    Real potential;  ///< of the giver: parts receive before they give
  };
  using PieceLists = std::map<int, std::vector<BandPiece>>;  ///< by goal

  void start(std::vector<int> parts);
  void find_candidates();
  void list_copy_neighbours();
  void note_change(LocalId vertex);
  void update_copies_of_parts();
  std::vector<QuotientEdge> local_quotient();
  void mark_seeds(const PairGoal& goal, std::span<const LocalId> vertices, std::vector<LocalId>& layer);
  std::vector<LocalId> mark_bands(std::span<const PairGoal> goals);
  void mark(LocalId vertex, std::vector<LocalId>& layer);
  void hand_marks_to_owners(std::vector<LocalId>& layer);
  PieceLists cut_pieces(std::span<const PairGoal> goals, std::span<const LocalId> band);
  void add_to_piece(LocalId vertex, const PairGoal& goal, BandPiece& piece) const;
  PieceLists send_pieces(PieceLists pieces, std::span<const PairGoal> goals) const;
  std::vector<Answer> solve(PieceLists pieces, std::span<const PairGoal> goals, const RefinementSettings& settings);
  void apply(const std::vector<Answer>& answers);
  PairGoal balanced_goal(const QuotientEdge& edge, Real tolerance, int depth) const;
  GlobalId send_flows(std::vector<Flow> flows, Real tolerance);
  int worker_of(const PairGoal& goal) const;
  int goal_of(LocalId vertex) const { return goal_of_part_[static_cast<std::size_t>(part_of(vertex))]; }
  int part_of(LocalId vertex) const { return parts_[static_cast<std::size_t>(vertex)]; }
  bool touches(LocalId vertex, int part) const;

  const Communicator& comm_;
  const WorkGraph& graph_;
  const Architecture& architecture_;
  std::vector<int> parts_;
  std::vector<Real> targets_;
  std::vector<Real> loads_;
  std::vector<LocalId> candidates_;  ///< owned vertices among which those at borders are
  std::vector<char> is_candidate_;
  std::map<std::pair<int, int>, std::vector<LocalId>> borders_;  ///< owned vertices at each border, by quotient()
  std::vector<LocalId> recent_;                                  ///< those that may have come to a border since
  std::vector<char> is_recent_;
  std::vector<std::int64_t> copy_start_;  ///< owned neighbours of the copies: [copy + 1]
  std::vector<LocalId> copy_neighbours_;
  std::vector<Real> handed_;        ///< [vertex] scratch: copies marked in this step
  std::vector<int> goal_of_part_;   ///< in the present round, -1 elsewhere
  std::vector<std::int32_t> mark_;  ///< [vertex] the round in which it is in a band
  std::vector<LocalId> place_;      ///< [owned vertex] in the piece of its band, in the present round
  std::int32_t round_ = 0;
  RefinementCount count_;
};

/// Greedy edge colouring: rounds of disjoint pairs, each round taking pairs in the given order. Local.
std::vector<std::vector<std::size_t>> disjoint_rounds(std::span<const std::pair<int, int>> pairs, int n_parts);

}  // namespace malleus
