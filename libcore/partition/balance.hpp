#pragma once

/// Equal shares for all ranks.

#include "partition/migrate.hpp"
#include "partition/partition.hpp"

namespace malleus {

/// Deals the elements anew in stretches of the space-filling curve of equal weight ([element], >= 0) to the ranks
/// [0, ranks). variant > 0: curves through other boxes, whose cuts lie elsewhere. Fields follow. Collective.
MigrationReport divide_along_curve(const Communicator& comm, Mesh& mesh, FieldStore& fields,
                                   std::span<const GlobalId> weights, int ranks, int variant = 0);

/// Deals the elements anew in equal stretches of the space-filling curve, where the present shares differ by more than
/// `tolerance` (largest over mean, minus 1) or a rank is empty that need not be. Fields follow. Collective.
MigrationReport balance_along_curve(const Communicator& comm, Mesh& mesh, FieldStore& fields, Real tolerance = 0.05);

/// What a balance by cost expected and did; the same on all ranks.
struct BalanceReport {
  Real cost_before = 0;  ///< F over the ideal, as partition_cost() counts it for equal processors, one a rank
  Real cost_after = 0;
  Real moved = 0;  ///< share of the work that changed rank
  std::string made_by;
  MigrationReport migration;
};

/// Divides the elements among the ranks by make_partition() for equal processors and moves them, fields with them,
/// where that lowers the cost. anew: from `start` instead of from where they are, as after reading. Collective.
BalanceReport balance_by_cost(const Communicator& comm, Mesh& mesh, FieldStore& fields, const WorkModel& model,
                              bool anew, PartitionStart start = PartitionStart::best);

/// "shares by ...: an increment is expected to take 1.02 of the ideal instead of 1.05; 4 % of the work moved".
std::string describe_balance(const BalanceReport& report);

}  // namespace malleus
