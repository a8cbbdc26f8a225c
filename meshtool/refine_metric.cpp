#include "meshtool/refine_metric.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "base/error.hpp"
#include "base/text.hpp"
#include "mesh/medit_io.hpp"
#include "mesh/node_directory.hpp"
#include "parallel/agreement.hpp"
#include "remesh/distributed_metric.hpp"
#include "remesh/error_metric.hpp"

namespace malleus::meshtool {
namespace {

constexpr Real no_smallest = 1e-100;
constexpr Real no_largest = 1e100;

Real smallest(const RefineOptions& options) {
  return options.min_size > 0 ? options.min_size : no_smallest;
}
Real largest(const RefineOptions& options) {
  return options.max_size > 0 ? options.max_size : no_largest;
}

/// The solution file's values, on the root; dimension, components and count on all ranks.
MeditSolution read_solution(const Communicator& comm, const RefineOptions& options, const Mesh& mesh, GlobalId& count) {
  MeditSolution solution;
  on_root(comm, [&] { solution = read_medit_solution(options.metric); });
  count = static_cast<GlobalId>(solution.values.size()) / std::max(1, solution.components);
  std::array<GlobalId, 3> head = {solution.dimension, solution.components, count};
  comm.broadcast(std::span(head));
  solution.dimension = static_cast<int>(head[0]);
  solution.components = static_cast<int>(head[1]);
  count = head[2];
  if (solution.components != 1 && solution.components != mesh.dim * (mesh.dim + 1) / 2) {
    throw InputError(
        fmt::format("{}: {} values per node, where the mesh of dimension {} wants 1 size or a tensor of {}",
                    options.metric, solution.components, mesh.dim, mesh.dim * (mesh.dim + 1) / 2));
  }
  return solution;
}

Metric metric_of_file(const Communicator& comm, const Mesh& mesh, const std::vector<GlobalId>& numbers,
                      const RefineOptions& options) {
  GlobalId count = 0;
  MeditSolution solution = read_solution(comm, options, mesh, count);
  const GlobalId last = comm.max(numbers.empty() ? GlobalId{0} : *std::max_element(numbers.begin(), numbers.end()));
  if (last != count && !(last < count && mesh.total_nodes() < last)) {
    throw InputError(fmt::format("{}: has values of {} nodes, but the nodes of {} are numbered up to {}",
                                 options.metric, count, options.input, last));
  }
  std::vector<GlobalId> listed(comm.is_root() ? static_cast<std::size_t>(count) : 0);
  std::iota(listed.begin(), listed.end(), 1);
  NodeDirectory directory(comm, options.metric, solution.components, listed, solution.values);
  std::vector<Real> values = directory.fetch(comm, numbers);
  const bool sizes = solution.components == 1;
  const Real unit = sizes ? options.length_unit : 1 / (options.length_unit * options.length_unit);
  for (Real& value : values) value *= unit;
  Metric metric = Metric::uniform(1);
  agree(comm,
        [&] { metric = sizes ? Metric::per_node(std::move(values)) : Metric::tensors(mesh.dim, std::move(values)); });
  return metric;
}

Metric metric_of_error(const Communicator& comm, const Mesh& mesh, const FieldStore& fields,
                       const RefineOptions& options) {
  std::vector<std::string> names;
  for (const Field* field : fields.all()) {
    if (field->spec().support == Support::node) names.push_back(field->spec().name);
  }
  if (std::find(names.begin(), names.end(), options.error_of) == names.end()) {
    throw InputError(fmt::format("command line: --error-of {}: {} has no such field at its nodes{}; it has {}",
                                 options.error_of, options.input, did_you_mean(options.error_of, names),
                                 names.empty() ? "none (fields come with .h5 files)" : join(names)));
  }
  return error_metric(comm, mesh, fields[options.error_of], static_cast<Real>(options.nodes),
                      {options.anisotropic, smallest(options), largest(options)});
}

}  // namespace

Metric wanted_metric(const Communicator& comm, const Mesh& mesh, const FieldStore& fields,
                     const std::vector<GlobalId>& numbers, const RefineOptions& options) {
  if (options.size > 0) return Metric::uniform(options.size);
  const bool counted = options.nodes > 0;
  Metric metric = Metric::uniform(1);
  if (!options.metric.empty()) {
    metric = metric_of_file(comm, mesh, numbers, options);
  } else if (!options.error_of.empty()) {
    metric = metric_of_error(comm, mesh, fields, options);
  } else {
    metric = current_sizes(comm, mesh);
  }
  if (counted)
    scale_to_nodes(comm, mesh, metric, static_cast<Real>(options.nodes), smallest(options), largest(options));
  bound_sizes(metric, smallest(options), largest(options));
  limit_gradation(comm, mesh, metric, options.gradation);
  if (counted) {  // gradation makes sizes smaller: the count is met again by their scale
    scale_to_nodes(comm, mesh, metric, static_cast<Real>(options.nodes), smallest(options), largest(options));
  }
  return metric;
}

}  // namespace malleus::meshtool
