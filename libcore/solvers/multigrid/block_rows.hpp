#pragma once

/// Distributed sparse matrices of small dense blocks, as the multigrid holds them.

#include <span>
#include <vector>

#include "parallel/halo.hpp"

namespace malleus {

/// Local numbering of a vector's blocks on a rank: those it owns, then copies of others', by increasing global number.
struct BlockLayout {
  Ownership ownership;
  std::vector<GlobalId> copies;  ///< global numbers, increasing
  Halo halo;

  BlockLayout() = default;
  /// copies: owned by other ranks, increasing. Collective.
  BlockLayout(const Communicator& comm, Ownership owned, std::vector<GlobalId> copy_numbers)
      : ownership(std::move(owned)), copies(std::move(copy_numbers)), halo(comm, ownership, copies) {}

  LocalId owned() const noexcept { return halo.owned(); }
  LocalId size() const noexcept { return halo.owned() + halo.copies(); }
  GlobalId global(LocalId local) const {
    return local < owned() ? ownership.begin() + local : copies[static_cast<std::size_t>(local - owned())];
  }
  LocalId local(GlobalId global) const;  ///< -1 where it is not held here
};

/// Rows owned by this rank. A row's columns increase: owned ones, then copies, so in a square matrix those before the
/// diagonal, the diagonal, those after it, copies.
struct BlockGraph {
  std::vector<LocalId> offsets = {0};  ///< [row+1]
  std::vector<LocalId> columns;        ///< local blocks of the column layout
  std::vector<LocalId> diagonals;      ///< [row]: entry of the diagonal; square matrices only

  LocalId rows() const noexcept { return static_cast<LocalId>(offsets.size()) - 1; }
  LocalId entries() const noexcept { return static_cast<LocalId>(columns.size()); }
  void find_diagonals();  ///< every row must have one
};

/// Blocks of a graph's entries, each column by column. The array ends with a few zeros, so that kernels may read
/// whole registers.
template <class T>
struct BlockValues {
  int rows = 1;  ///< of a block
  int columns = 1;
  std::vector<T> values;  ///< [entry][column][row], then `padding` zeros

  static constexpr std::size_t padding = 8;
  BlockValues() = default;
  BlockValues(int block_rows, int block_columns, LocalId entries)
      : rows(block_rows), columns(block_columns), values(static_cast<std::size_t>(entries) * size() + padding, T(0)) {}

  std::size_t size() const noexcept { return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns); }
  T* at(LocalId entry) { return values.data() + static_cast<std::size_t>(entry) * size(); }
  const T* at(LocalId entry) const { return values.data() + static_cast<std::size_t>(entry) * size(); }
};

/// Calls function(integral constant) with a block size of 1, 2, 3 or 6.
template <class Function>
decltype(auto) with_block(int size, Function&& function) {
  if (size == 1) return function(std::integral_constant<int, 1>{});
  if (size == 2) return function(std::integral_constant<int, 2>{});
  if (size == 3) return function(std::integral_constant<int, 3>{});
  return function(std::integral_constant<int, 6>{});
}

/// Calls function(rows, columns) for the blocks of prolongators: dim x modes.
template <class Function>
decltype(auto) with_blocks(int rows, int columns, Function&& function) {
  return with_block(columns, [&](auto c) {
    if constexpr (c == 6) {
      if (rows == 6) return function(std::integral_constant<int, 6>{}, c);
      return function(std::integral_constant<int, 3>{}, c);
    } else if constexpr (c == 3) {
      if (rows == 2) return function(std::integral_constant<int, 2>{}, c);
      return function(c, c);
    } else {
      return function(c, c);
    }
  });
}

}  // namespace malleus
