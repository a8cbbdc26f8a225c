#pragma once

/// Equal shares for all ranks.

#include "partition/migrate.hpp"

namespace malleus {

/// Deals the elements anew in stretches of the space-filling curve of equal weight ([element], >= 0) to the ranks
/// [0, ranks). variant > 0: curves through other boxes, whose cuts lie elsewhere. Fields follow. Collective.
MigrationReport divide_along_curve(const Communicator& comm, Mesh& mesh, FieldStore& fields,
                                   std::span<const GlobalId> weights, int ranks, int variant = 0);

/// Deals the elements anew in equal stretches of the space-filling curve, where the present shares differ by more than
/// `tolerance` (largest over mean, minus 1) or a rank is empty that need not be. Fields follow. Collective.
MigrationReport balance_along_curve(const Communicator& comm, Mesh& mesh, FieldStore& fields, Real tolerance = 0.05);

}  // namespace malleus
