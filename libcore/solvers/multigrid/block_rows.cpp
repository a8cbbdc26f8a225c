#include "solvers/multigrid/block_rows.hpp"

#include <algorithm>

#include "base/error.hpp"

namespace malleus {

LocalId BlockLayout::local(GlobalId global) const {
  if (ownership.owns(global)) return static_cast<LocalId>(global - ownership.begin());
  const auto found = std::lower_bound(copies.begin(), copies.end(), global);
  if (found == copies.end() || *found != global) return -1;
  return owned() + static_cast<LocalId>(found - copies.begin());
}

void BlockGraph::find_diagonals() {
  diagonals.resize(static_cast<std::size_t>(rows()));
  for (LocalId row = 0; row < rows(); ++row) {
    const auto r = static_cast<std::size_t>(row);
    const auto begin = columns.begin() + offsets[r];
    const auto end = columns.begin() + offsets[r + 1];
    const auto found = std::lower_bound(begin, end, row);
    check(found != end && *found == row, "every row of a square block matrix has its diagonal");
    diagonals[r] = static_cast<LocalId>(found - columns.begin());
  }
}

}  // namespace malleus
