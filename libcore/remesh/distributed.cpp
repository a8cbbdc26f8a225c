#include "remesh/distributed.hpp"

#include <mpi.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>

#include "base/index.hpp"
#include "partition/balance.hpp"
#include "partition/interface_release.hpp"
#include "remesh/interface_strip.hpp"
#include "remesh/plane_cuts.hpp"
#include "remesh/selection.hpp"

namespace malleus {
namespace {

constexpr const char* mark_field_name = "remeshing_mark";

class DistributedRemesher {
 public:
  DistributedRemesher(const Communicator& comm, Mesh& mesh, FieldStore& fields, const Metric& metric,
                      const DistributedRemeshOptions& options)
      : comm_(comm), mesh_(mesh), fields_(fields), uniform_(metric), options_(options) {
    store_metric(mesh, metric, fields);
  }

  DistributedRemeshReport run() {
    report_.nodes_before = mesh_.total_nodes();
    report_.elements_before = mesh_.total_elements;
    timed("report", [&] { report_.before = metric_fit(comm_, mesh_, metric()); });
    while (refine_in_stage()) {
    }
    spread_over_all();
    remesh_all(options_.local);
    report_.interface_nodes = remesh_strips(options_.local, options_.strip_rounds);
    timed("balance", [&] {
      if (is_uneven()) deal_by(PlaneCuts(comm_, mesh_.dim, centroids(mesh_), ones(), comm_.size()));
      if (options_.balances_by_cost) balance_by_cost(comm_, mesh_, fields_, solver_work(), false);
    });
    timed("report", [&] { report_.after = metric_fit(comm_, mesh_, metric()); });
    if (fields_.has(metric_field_name)) fields_.remove(metric_field_name);
    finish();
    return report_;
  }

 private:
  Metric metric() const { return stored_metric(mesh_, fields_, uniform_); }

  template <class Work>
  void timed(const char* name, Work work) {
    if (options_.announces) options_.announces(name);
    const Real start = MPI_Wtime();
    const auto ticks = std::clock();
    work();
    const auto is_same = [&](const RemeshPhase& known) { return known.name == name; };
    auto phase = std::find_if(report_.phases.begin(), report_.phases.end(), is_same);
    if (phase == report_.phases.end()) phase = report_.phases.insert(phase, {name});
    phase->wall_s += MPI_Wtime() - start;
    phase->processor_s += static_cast<Real>(std::clock() - ticks) / CLOCKS_PER_SEC;
  }

  /// Work of each element: what it will become, and what it costs even if it is only looked at or taken away.
  std::vector<Real> predicted_work() const {
    constexpr Real own_cost = 0.3;  // in elements to be made
    std::vector<Real> work = predicted_elements_of_each(local_arrays(mesh_), metric());
    for (Real& count : work) count += own_cost;
    return work;
  }

  /// Divides the mesh among the first ranks, each time along other cuts.
  void spread_along_curve(int ranks) {
    constexpr Real scale = 1000;
    std::vector<GlobalId> weights;
    for (const Real work : predicted_work())
      weights.push_back(static_cast<GlobalId>(std::clamp(scale * work, 1.0, 1e12)));
    note(divide_along_curve(comm_, mesh_, fields_, weights, ranks, static_cast<int>(report_.rounds.size())));
  }

  /// Divides the mesh among all ranks by planes. What lies along them is brought to the metric before, while it is
  /// still inside a rank: interfaces that fit spoil nothing beside them, and little is left to be done again.
  void spread_over_all() {
    if (comm_.size() == 1) return;
    const PlaneCuts cuts(comm_, mesh_.dim, centroids(mesh_), predicted_work(), comm_.size());
    std::vector<std::uint8_t> band = elements_at(mesh_, cuts, options_.band_layers);
    if (needs_remesh(band)) timed("remesh bands", [&] { remesh(std::move(band), options_.local); });
    timed("balance", [&] { deal_by(cuts); });
  }

  void deal_by(const PlaneCuts& cuts) {
    const std::vector<Real> points = centroids(mesh_);
    std::vector<int> parts;
    for (LocalId e = 0; e < mesh_.elements(); ++e)
      parts.push_back(cuts.part_of(points.data() + static_cast<std::ptrdiff_t>(e) * mesh_.dim));
    note(migrate(comm_, mesh_, fields_, parts));
  }

  /// Are more than a few of the selected elements such as a remesh would better?
  bool needs_remesh(const std::vector<std::uint8_t>& selected) const {
    constexpr Real few = 0.02;
    const std::vector<std::uint8_t> bad = misfits(mesh_, metric(), {});
    std::array<Real, 2> sums = {0, 0};
    for (std::size_t e = 0; e < selected.size(); ++e) {
      sums[0] += selected[e];
      sums[1] += selected[e] & bad[e];
    }
    comm_.sum_in_place(sums);
    return sums[1] > few * sums[0];
  }

  void note(const MigrationReport& moved) {
    moved_ += moved.moved_elements;
    sent_ += moved.sent_bytes;
  }

  /// A mesh too small for all ranks grows first on those that have enough to do; and where interfaces are far too
  /// coarse, what is beside them would come out in bad shape: then all is refined by as much in several steps.
  bool refine_in_stage() {
    constexpr Real largest_growth = 12;
    if (comm_.size() == 1) return false;
    const GlobalId ranks = std::clamp<GlobalId>(mesh_.total_elements / options_.fewest_elements, 1, comm_.size());
    const Real growth = ranks < comm_.size() ? growth_of_all() : growth_at_interfaces();
    const Real stages = std::ceil(std::log(std::max(growth, 1.0)) / std::log(largest_growth));
    if (stages <= 1) return false;
    timed("balance", [&] { spread_along_curve(static_cast<int>(ranks)); });
    remesh_coarser(std::pow(growth, (1 - 1 / stages) / mesh_.dim));
    return true;
  }

  bool is_uneven() const {
    constexpr Real tolerance = 0.05;
    const auto largest = static_cast<Real>(comm_.max(static_cast<GlobalId>(mesh_.elements())));
    return largest > std::max(1.0, static_cast<Real>(mesh_.total_elements) / comm_.size() * (1 + tolerance));
  }
  std::vector<Real> ones() const { return std::vector<Real>(index(mesh_.elements()), 1); }

  /// Elements to make for each one there is.
  Real growth_of_all() const {
    return predicted_elements(comm_, mesh_, metric()) / static_cast<Real>(std::max<GlobalId>(1, mesh_.total_elements));
  }
  Real growth_at_interfaces() const {
    const std::vector<Real> predicted = predicted_elements_of_each(local_arrays(mesh_), metric());
    const std::vector<std::uint8_t> shared = shared_nodes(mesh_);
    std::array<Real, 2> sums = {0, 0};
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      const auto nodes = mesh_.nodes_of_element(e);
      if (std::none_of(nodes.begin(), nodes.end(), [&](LocalId node) { return shared[index(node)] != 0; })) continue;
      sums[0] += predicted[index(e)];
      sums[1] += 1;
    }
    comm_.sum_in_place(sums);
    return sums[1] > 0 ? sums[0] / sums[1] : 1;
  }

  /// The first time all ranks get as much of the strips; the little that is then left is drawn for.
  void leave_interfaces(const std::vector<std::uint8_t>& marks, int round) {
    ReleaseOptions release;
    release.aim = round == 0 ? ReleaseAim::equal_strips : ReleaseAim::most_released;
    release.layers = options_.moved_layers;
    release.round = round;
    note(migrate(comm_, mesh_, fields_, move_interfaces_inside(comm_, mesh_, predicted_work(), release, marks).parts));
  }

  /// Remeshes with sizes that are larger than wanted by up to a factor, but no larger than now.
  void remesh_coarser(Real factor) {
    const Metric wanted = metric();
    const bool was_uniform = wanted.kind() == Metric::Kind::uniform;
    const Metric now = current_sizes(comm_, mesh_);
    const Real uniform = uniform_.values().front();
    Metric coarser = was_uniform ? Metric::per_node(std::vector<Real>(index(mesh_.nodes()), uniform)) : wanted;
    const auto n = static_cast<std::size_t>(coarser.components());
    for (std::size_t node = 0; node < index(mesh_.nodes()); ++node) {
      const bool tensors = coarser.kind() == Metric::Kind::tensors;
      const Real size = tensors ? largest_size(coarser, node) : coarser.values()[node];
      const Real times = std::clamp(now.values()[node] / size, 1.0, factor);
      for (std::size_t c = 0; c < n; ++c) coarser.values()[node * n + c] *= tensors ? 1 / (times * times) : times;
    }
    // The wanted metric travels along as an ordinary field, its values interpolated linearly.
    keep_wanted(wanted);
    store_metric(mesh_, coarser, fields_);
    RemeshOptions quick = options_.local;
    quick.improvement_rounds = std::min(quick.improvement_rounds, 2);
    quick.keep_volume = false;
    remesh_all(quick);
    // Interfaces of the next stage cross these: what is held in bad shape would spoil what lies around it.
    remesh_strips(quick, 1);
    restore_wanted(was_uniform);
  }

  Real largest_size(const Metric& tensors, std::size_t node) const {
    const auto n = static_cast<std::size_t>(tensors.components());
    Real trace = 0;
    for (int i = 0; i < mesh_.dim; ++i) trace += tensors.values()[node * n + static_cast<std::size_t>(i * (i + 3) / 2)];
    return std::sqrt(mesh_.dim / trace);
  }

  void keep_wanted(const Metric& wanted) {
    if (wanted.kind() == Metric::Kind::uniform) return;
    Field& kept = fields_.declare(mesh_, {wanted_field_name, "1", Support::node, wanted.components()});
    kept.assign(wanted.values());
  }
  void restore_wanted(bool was_uniform) {
    if (was_uniform) {
      fields_.remove(metric_field_name);
      return;
    }
    const Field& kept = fields_[wanted_field_name];
    std::vector<Real> values(kept.values().begin(), kept.values().end());
    const Metric wanted =
        kept.components() == 1 ? Metric::per_node(std::move(values)) : Metric::tensors(mesh_.dim, std::move(values));
    fields_.remove(wanted_field_name);
    store_metric(mesh_, wanted, fields_);
  }

  void remesh_all(const RemeshOptions& options) {
    timed("remesh", [&] { remesh(std::vector<std::uint8_t>(index(mesh_.elements()), 1), options); });
  }

  void leave_out_kept(std::vector<std::uint8_t>& selected) const {
    if (options_.kept_regions.empty()) return;
    for (std::size_t e = 0; e < selected.size(); ++e) {
      if (options_.kept_regions[static_cast<std::size_t>(mesh_.element_region[e])] != 0) selected[e] = 0;
    }
  }

  void remesh(std::vector<std::uint8_t> selected, const RemeshOptions& options) {
    const auto start = std::clock();
    leave_out_kept(selected);
    const auto mine = static_cast<GlobalId>(std::count(selected.begin(), selected.end(), 1));
    const RemeshReport local = remesh_selection(comm_, mesh_, fields_, selected, uniform_, options);
    RemeshRound round;
    round.elements = comm_.sum(mine);
    round.largest_elements = comm_.max(mine);
    round.moved_elements = moved_;
    round.sent_bytes = sent_;
    round.remesh_s = comm_.max(static_cast<Real>(std::clock() - start) / CLOCKS_PER_SEC);
    report_.rounds.push_back(round);
    moved_ = 0;
    sent_ = 0;
    report_.splits += local.splits;
    report_.collapses += local.collapses;
    report_.swaps += local.swaps;
    report_.moves += local.moves;
    report_.volume_error = std::max(report_.volume_error, local.volume_error);
  }

  /// Returns the number of nodes about which interfaces never moved away.
  GlobalId remesh_strips(const RemeshOptions& options, int rounds) {
    // Marks follow the mesh as a field: on nodes that interfaces held in the last remesh.
    fields_.declare(mesh_, {mark_field_name, "1", Support::node, 1});
    std::vector<std::uint8_t> marks = misfit_interface();
    for (int round = 0; round < rounds && comm_.any(is_any(marks)); ++round) {
      timed("move interfaces", [&] {
        set_marks(marks);
        leave_interfaces(marks, round);
      });
      timed("remesh strips", [&] { marks = remesh_strip(options); });
    }
    fields_.remove(mark_field_name);
    return comm_.sum(static_cast<GlobalId>(std::count(marks.begin(), marks.end(), 1)));
  }

  /// Remeshes about the marked nodes; returns those that were held by an interface again, in the new mesh.
  std::vector<std::uint8_t> remesh_strip(const RemeshOptions& options) {
    const std::vector<int> distance = layers_from(mesh_, get_marks(), options_.strip_layers);
    std::vector<std::uint8_t> selected(index(mesh_.elements()), 0);
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      int nearest = options_.strip_layers;
      for (const LocalId node : mesh_.nodes_of_element(e)) nearest = std::min(nearest, distance[index(node)]);
      selected[index(e)] = nearest < options_.strip_layers ? 1 : 0;
    }
    const std::vector<std::uint8_t> shared = shared_nodes(mesh_);
    std::vector<std::uint8_t> held(shared.size(), 0);
    for (std::size_t node = 0; node < held.size(); ++node)
      held[node] = shared[node] != 0 && distance[node] == 0 ? 1 : 0;
    set_marks(held);
    remesh(selected, options);
    // Marks of new nodes are interpolated: what was held keeps exactly 1 and its place among the shared nodes.
    std::vector<std::uint8_t> marks = get_marks();
    const std::vector<std::uint8_t> misfit = misfit_interface();
    for (std::size_t node = 0; node < marks.size(); ++node) marks[node] = marks[node] != 0 && misfit[node] != 0 ? 1 : 0;
    return marks;
  }

  /// Shared nodes of elements that interfaces kept from fitting: those that fit need no second look.
  std::vector<std::uint8_t> misfit_interface() const {
    const std::vector<std::uint8_t> bad = misfits(mesh_, metric(), {});
    std::vector<std::uint8_t> marks(index(mesh_.nodes()), 0);
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      if (bad[index(e)] == 0) continue;
      for (const LocalId node : mesh_.nodes_of_element(e)) marks[index(node)] = 1;
    }
    level_largest(mesh_, marks);
    const std::vector<std::uint8_t> shared = shared_nodes(mesh_);
    for (std::size_t node = 0; node < marks.size(); ++node) marks[node] &= shared[node];
    return marks;
  }

  static bool is_any(const std::vector<std::uint8_t>& marks) {
    return std::find(marks.begin(), marks.end(), 1) != marks.end();
  }
  void set_marks(const std::vector<std::uint8_t>& marks) {
    fields_[mark_field_name].assign({marks.begin(), marks.end()});
  }
  std::vector<std::uint8_t> get_marks() const {
    std::vector<std::uint8_t> marks;
    for (const Real value : fields_[mark_field_name].values()) marks.push_back(value >= 1 ? 1 : 0);
    return marks;
  }

  void finish() {
    report_.nodes_after = mesh_.total_nodes();
    report_.elements_after = mesh_.total_elements;
    for (GlobalId* count : {&report_.splits, &report_.collapses, &report_.swaps, &report_.moves})
      *count = comm_.sum(*count);
    report_.volume_error = comm_.max(report_.volume_error);
    for (RemeshPhase& phase : report_.phases) {
      phase.wall_s = comm_.max(phase.wall_s);
      phase.processor_s = comm_.max(phase.processor_s);
    }
  }

  static constexpr const char* wanted_field_name = "remeshing_wanted";

  const Communicator& comm_;
  Mesh& mesh_;
  FieldStore& fields_;
  Metric uniform_;  ///< the metric where it is uniform; else the store has it
  const DistributedRemeshOptions& options_;
  DistributedRemeshReport report_;
  GlobalId moved_ = 0;  ///< since the last round
  GlobalId sent_ = 0;
};

}  // namespace

DistributedRemeshReport remesh_distributed(const Communicator& comm, Mesh& mesh, FieldStore& fields,
                                           const Metric& metric, const DistributedRemeshOptions& options) {
  return DistributedRemesher(comm, mesh, fields, metric, options).run();
}

}  // namespace malleus
