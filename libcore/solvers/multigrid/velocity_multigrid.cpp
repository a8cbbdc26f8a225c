#include "solvers/multigrid/velocity_multigrid.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>

#include "base/index.hpp"
#include "solvers/multigrid/block_kernels.hpp"
#include "solvers/multigrid/coarsest_solver.hpp"
#include "solvers/multigrid/galerkin.hpp"

namespace malleus {
namespace {

/// A level in the precision of the cycle.
template <class T>
struct CycleLevel {
  BlockLayout layout;
  BlockGraph graph;
  BlockValues<T> values;
  std::vector<T> inverses;
  BlockLayout coarse_layout;  ///< of the prolongator's columns
  BlockGraph prolongator;
  BlockValues<T> prolongator_values;
  std::vector<T> b, x, residual, coarse;
  std::vector<T> first;  ///< correction of the first of two visits; empty where there is but one

  SweepMatrix<T> matrix() const { return {&graph, &values, inverses.data()}; }
};

template <class T>
std::vector<T> convert(std::vector<Real>&& values) {
  if constexpr (std::is_same_v<T, Real>) {
    return std::move(values);
  } else {
    std::vector<T> result(values.begin(), values.end());
    values = {};
    return result;
  }
}

template <class T>
BlockValues<T> convert(BlockValues<Real>&& values) {
  BlockValues<T> result;
  result.rows = values.rows;
  result.columns = values.columns;
  result.values = convert<T>(std::move(values.values));
  return result;
}

/// Ownership of `count` coarse nodes a rank after gathering them onto few enough ranks that each has its share.
Ownership coarse_ownership(const Communicator& comm, LocalId count, const MultigridSettings& settings, int modes) {
  const std::vector<GlobalId> counts = comm.gather_to_all(static_cast<GlobalId>(count));
  GlobalId total = 0;
  int active = 0;
  for (const GlobalId c : counts) {
    total += c;
    active += c > 0 ? 1 : 0;
  }
  const auto enough = static_cast<int>(std::min<GlobalId>(active, total / settings.nodes_per_rank));
  const int groups = total * modes <= settings.coarsest_unknowns ? 1 : std::max(1, enough);
  LocalId mine = 0;
  int seen = 0;
  int group_head = -1;
  int last_group = -1;
  for (int rank = 0; rank < comm.size(); ++rank) {
    const GlobalId c = counts[static_cast<std::size_t>(rank)];
    if (c == 0) continue;
    const int group = static_cast<int>(static_cast<GlobalId>(seen++) * groups / active);
    if (group != last_group) group_head = rank;
    last_group = group;
    if (group_head == comm.rank()) mine += static_cast<LocalId>(c);
  }
  return {comm, mine};
}

/// Aggregates are made anew with half the threshold where they hold fewer nodes than so many, that often.
constexpr GlobalId slow_coarsening = 3;
constexpr int most_thresholds = 5;

template <class T>
class SmoothedAggregation final : public VelocityMultigrid {
 public:
  SmoothedAggregation(const Communicator& comm, MultigridLevel finest, const NodeConstraints* constraints,
                      const MultigridSettings& settings)
      : comm_(comm), settings_(settings), dim_(finest.values.rows) {
    MultigridLevel level = std::move(finest);
    const NodeConstraints* fine_constraints = constraints;
    while (true) {
      summarize(level);
      invert_diagonals(level);
      const bool is_small = summary_.back().nodes * level.values.rows <= settings.coarsest_unknowns;
      MultigridLevel next;
      Prolongator prolongator;
      const bool goes_on = !is_small && static_cast<int>(summary_.size()) < settings.max_levels &&
                           coarsen(level, fine_constraints, next, prolongator);
      if (!goes_on) break;
      keep(level, std::move(prolongator));
      level = std::move(next);
      fine_constraints = nullptr;
    }
    coarsest_ = std::make_unique<CoarsestSolver<T>>(comm, std::move(level));
  }

  void apply(const Real* residual, Real* correction) override {
    if (levels_.empty()) {
      apply_coarsest_only(residual, correction);
      return;
    }
    CycleLevel<T>& finest = levels_.front();
    const std::size_t size = index(finest.layout.owned()) * static_cast<std::size_t>(dim_);
    std::transform(residual, residual + size, finest.b.begin(), [](Real r) { return static_cast<T>(r); });
    cycle(0);
    std::copy_n(finest.x.begin(), size, correction);
  }

  const std::vector<MultigridLevelSummary>& levels() const override { return summary_; }

  Real operator_complexity() const override {
    Real all = 0;
    for (const MultigridLevelSummary& level : summary_) all += entries(level);
    return summary_.empty() || entries(summary_.front()) == 0 ? 1 : all / entries(summary_.front());
  }

  std::size_t bytes() const override {
    std::size_t sum = 0;
    for (const CycleLevel<T>& level : levels_) {
      sum += sizeof(T) *
             (level.values.values.size() + level.inverses.size() + level.prolongator_values.values.size() +
              level.b.size() + level.x.size() + level.residual.size() + level.coarse.size() + level.first.size());
      sum += sizeof(LocalId) * (level.graph.columns.size() + 2 * level.graph.offsets.size() +
                                level.prolongator.columns.size() + level.prolongator.offsets.size());
    }
    return sum;
  }

 private:
  static Real entries(const MultigridLevelSummary& level) {
    return level.entries_per_row * static_cast<Real>(level.nodes) * level.block * level.block;
  }

  void summarize(const MultigridLevel& level) {
    MultigridLevelSummary line;
    line.nodes = level.layout.ownership.total();
    line.block = level.values.rows;
    const GlobalId entries_here = level.graph.entries();
    const GlobalId entries_in_all = comm_.sum(entries_here);
    line.entries_per_row = line.nodes > 0 ? static_cast<Real>(entries_in_all) / static_cast<Real>(line.nodes) : 0;
    line.active_ranks = static_cast<int>(comm_.sum(GlobalId{level.graph.rows() > 0 ? 1 : 0}));
    summary_.push_back(line);
  }

  /// False where aggregation no longer makes the level clearly smaller.
  bool coarsen(MultigridLevel& level, const NodeConstraints* constraints, MultigridLevel& next,
               Prolongator& prolongator) {
    if (level.left_out.empty()) level.left_out.assign(index(level.graph.rows()), false);
    Real threshold = settings_.threshold;
    Aggregates aggregates;
    GlobalId total = 0;
    // Where strong couplings are rare (stiff bodies, contacts) weaker ones count too: a coarsest level that is large
    // costs more in its direct solve than all the rest.
    for (int attempt = 0; attempt < most_thresholds; ++attempt, threshold /= 2) {
      aggregates = aggregate(level.layout, level.graph, level.values, dim_, threshold, level.left_out);
      total = comm_.sum(static_cast<GlobalId>(aggregates.count));
      if (slow_coarsening * total <= summary_.back().nodes) break;
    }
    if (total == 0 || 10 * total > 8 * summary_.back().nodes) return false;
    estimate_largest_eigenvalue(comm_, level);
    const int modes = coarse_modes(dim_, settings_.rigid_modes);
    const Ownership ownership = coarse_ownership(comm_, aggregates.count, settings_, modes);
    CoarseSpace space =
        make_coarse_space(comm_, level, aggregates, ownership, {dim_, settings_.rigid_modes}, constraints);
    make_coarse_operator(comm_, level, space.prolongator, next);
    next.points = std::move(space.points);
    next.scale = space.scale;
    next.has_rotations = settings_.rigid_modes;
    prolongator = std::move(space.prolongator);
    return true;
  }

  void keep(MultigridLevel& level, Prolongator prolongator) {
    CycleLevel<T>& kept = levels_.emplace_back();
    kept.layout = std::move(level.layout);
    kept.graph = std::move(level.graph);
    kept.values = convert<T>(std::move(level.values));
    kept.inverses = convert<T>(std::move(level.inverses));
    kept.coarse_layout = std::move(prolongator.layout);
    kept.prolongator = std::move(prolongator.graph);
    kept.prolongator_values = convert<T>(std::move(prolongator.values));
    const auto block = static_cast<std::size_t>(kept.values.rows);
    kept.b.assign(index(kept.layout.owned()) * block, T(0));
    kept.residual = kept.b;
    if (is_visited_twice(levels_.size() - 1)) kept.first = kept.b;
    kept.x.assign(index(kept.layout.size()) * block, T(0));
    kept.coarse.assign(index(kept.coarse_layout.size()) * static_cast<std::size_t>(kept.prolongator_values.columns),
                       T(0));
  }

  void apply_coarsest_only(const Real* residual, Real* correction) {
    const std::size_t size = coarsest_->right_side().size();
    std::transform(residual, residual + size, coarsest_->right_side().begin(),
                   [](Real r) { return static_cast<T>(r); });
    coarsest_->solve();
    std::copy_n(coarsest_->solution().begin(), size, correction);
  }

  std::vector<T>& right_side_of(std::size_t l) { return l < levels_.size() ? levels_[l].b : coarsest_->right_side(); }
  const std::vector<T>& solution_of(std::size_t l) const {
    return l < levels_.size() ? levels_[l].x : coarsest_->solution();
  }

  /// Of the levels kept, the last of which is above the coarsest. Twice: the first two below the finest, where that
  /// takes off what makes iterations grow with the mesh and costs little; further down it would cost messages alone.
  static bool is_visited_twice(std::size_t l) { return l == 1 || l == 2; }

  /// Leaves the correction of level l in its x. Two cycles are still symmetric: 2 M - M A M.
  void visit(std::size_t l) {
    cycle(l);
    if (l >= levels_.size() || !is_visited_twice(l)) return;
    CycleLevel<T>& level = levels_[l];
    std::copy_n(level.x.begin(), level.first.size(), level.first.begin());
    level.layout.halo.update_copies(std::span(level.x), level.values.rows);
    subtract_product(level.matrix(), level.x.data(), level.b.data());
    cycle(l);
    std::transform(level.first.begin(), level.first.end(), level.x.begin(), level.x.begin(), std::plus<>());
  }

  /// From levels_[l].b to levels_[l].x.
  void cycle(std::size_t l) {
    if (l == levels_.size()) {
      coarsest_->solve();
      return;
    }
    CycleLevel<T>& level = levels_[l];
    const int block = level.values.rows;
    const int modes = level.prolongator_values.columns;
    sweep_forward_from_zero(level.matrix(), level.b.data(), level.x.data());
    level.layout.halo.update_copies(std::span(level.x), block);
    residual_after_forward(level.matrix(), level.x.data(), level.residual.data());
    restrict_rows(level.prolongator, level.prolongator_values, level.residual.data(), level.coarse_layout.size(),
                  level.coarse.data());
    level.coarse_layout.halo.add_to_owners(std::span(level.coarse), modes);
    std::vector<T>& coarse_b = right_side_of(l + 1);
    std::copy_n(level.coarse.begin(), coarse_b.size(), coarse_b.begin());
    visit(l + 1);
    std::copy_n(solution_of(l + 1).begin(), coarse_b.size(), level.coarse.begin());
    level.coarse_layout.halo.update_copies(std::span(level.coarse), modes);
    add_prolonged(level.prolongator, level.prolongator_values, level.coarse.data(), level.x.data());
    level.layout.halo.update_copies(std::span(level.x), block);
    sweep_backward(level.matrix(), level.b.data(), level.x.data());
  }

  const Communicator& comm_;
  MultigridSettings settings_;
  int dim_;
  std::vector<MultigridLevelSummary> summary_;
  std::vector<CycleLevel<T>> levels_;
  std::unique_ptr<CoarsestSolver<T>> coarsest_;
};

}  // namespace

std::unique_ptr<VelocityMultigrid> make_velocity_multigrid(const Communicator& comm, MultigridLevel finest,
                                                           const NodeConstraints& constraints,
                                                           const MultigridSettings& settings) {
  if (settings.double_precision) {
    return std::make_unique<SmoothedAggregation<double>>(comm, std::move(finest), &constraints, settings);
  }
  return std::make_unique<SmoothedAggregation<float>>(comm, std::move(finest), &constraints, settings);
}

std::unique_ptr<VelocityMultigrid> make_scalar_multigrid(const Communicator& comm, MultigridLevel finest,
                                                         const MultigridSettings& settings) {
  return std::make_unique<SmoothedAggregation<float>>(comm, std::move(finest), nullptr, settings);
}

}  // namespace malleus
