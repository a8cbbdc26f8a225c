#pragma once

#include <cstddef>

namespace malleus {

/// How many entries of an increasing row are less than `value`: its place, if it is there. Rows of a sparse matrix are
/// so short that counting all entries, without a branch, is faster than bisection, which mispredicts every other one.
template <class T>
inline std::ptrdiff_t place_in_row(const T* row, std::ptrdiff_t count, T value) noexcept {
  T less = 0;
  for (std::ptrdiff_t k = 0; k < count; ++k) less += row[k] < value ? 1 : 0;
  return static_cast<std::ptrdiff_t>(less);
}

}  // namespace malleus
