#include "partition/balance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "mesh/curve_partition.hpp"
#include "mesh/space_filling_curve.hpp"

namespace malleus {
namespace {

/// Turns a point by angles that grow with the variant; 0 leaves it.
void turn(Real* point, int dim, int variant) {
  constexpr std::array<Real, 2> angles = {0.6, 0.45};  // rad
  for (int axis = 0; axis + 1 < dim && variant > 0; ++axis) {
    const Real c = std::cos(angles[static_cast<std::size_t>(axis)] * variant);
    const Real s = std::sin(angles[static_cast<std::size_t>(axis)] * variant);
    const Real a = point[axis];
    const Real b = point[axis + 1];
    point[axis] = c * a - s * b;
    point[axis + 1] = s * a + c * b;
  }
}

std::vector<std::uint64_t> centroid_keys(const Communicator& comm, const Mesh& mesh, int variant = 0) {
  std::vector<Real> turned = mesh.coordinates;
  for (LocalId node = 0; node < mesh.nodes(); ++node)
    turn(turned.data() + static_cast<std::ptrdiff_t>(node) * mesh.dim, mesh.dim, variant);
  const Box box = bounding_box(comm, turned, mesh.dim);
  std::vector<std::uint64_t> keys(static_cast<std::size_t>(mesh.elements()));
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    std::array<Real, 3> centroid = {0, 0, 0};
    for (const LocalId node : mesh.nodes_of_element(e)) {
      const Real* point = turned.data() + static_cast<std::ptrdiff_t>(node) * mesh.dim;
      for (int c = 0; c < mesh.dim; ++c) centroid[static_cast<std::size_t>(c)] += point[c] / (mesh.dim + 1);
    }
    keys[static_cast<std::size_t>(e)] = hilbert_key(centroid.data(), mesh.dim, box);
  }
  return keys;
}

}  // namespace

MigrationReport divide_along_curve(const Communicator& comm, Mesh& mesh, FieldStore& fields,
                                   std::span<const GlobalId> weights, int ranks, int variant) {
  std::vector<int> destinations = curve_partition(comm, centroid_keys(comm, mesh, variant), weights);
  for (int& rank : destinations) rank = static_cast<int>(static_cast<GlobalId>(rank) * ranks / comm.size());
  return migrate(comm, mesh, fields, destinations);
}

MigrationReport balance_along_curve(const Communicator& comm, Mesh& mesh, FieldStore& fields, Real tolerance) {
  const auto largest = static_cast<Real>(comm.max(static_cast<GlobalId>(mesh.elements())));
  const Real mean = static_cast<Real>(mesh.total_elements) / comm.size();
  if (largest <= std::max(1.0, mean * (1 + tolerance))) return {};
  const std::vector<std::uint64_t> keys = centroid_keys(comm, mesh);
  return migrate(comm, mesh, fields, curve_partition(comm, keys, {}));
}

BalanceReport balance_by_cost(const Communicator& comm, Mesh& mesh, FieldStore& fields, const WorkModel& model,
                              bool anew, PartitionStart start) {
  const std::vector<int> here(static_cast<std::size_t>(mesh.elements()), comm.rank());
  const Architecture ranks = equal_architecture(comm.size());
  PartitionOptions options;
  options.starts_anew = anew;
  options.start = start;
  const PartitionPlan plan = make_partition(comm, mesh, model, ranks, options, here);
  BalanceReport report = {plan.before.cost, plan.after.cost, plan.moved, plan.made_by, {}};
  report.migration = migrate(comm, mesh, fields, plan.parts);
  return report;
}

std::string describe_balance(const BalanceReport& report) {
  return fmt::format(
      "shares by {}: an increment is expected to take {:.3f} of the ideal instead of {:.3f}; {:.1f} % of "
      "the work moved",
      report.made_by, report.cost_after, report.cost_before, 100 * report.moved);
}

}  // namespace malleus
