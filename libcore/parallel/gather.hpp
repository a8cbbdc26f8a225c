#pragma once

/// Small lists of all ranks on all ranks: tables of the size of the quotient graph of a partition, not of the mesh.

#include <span>
#include <type_traits>
#include <vector>

#include "base/error.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// The lists of all ranks one after another, in rank order. Below 2^31 bytes in all. Collective.
template <class T>
std::vector<T> gather_lists(const Communicator& comm, std::span<const T> mine) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (comm.size() == 1) return {mine.begin(), mine.end()};
  const std::vector<GlobalId> counts = comm.gather_to_all(static_cast<GlobalId>(mine.size_bytes()));
  std::vector<int> bytes;
  std::vector<int> offsets;
  GlobalId total = 0;
  for (const GlobalId count : counts) {
    offsets.push_back(static_cast<int>(total));
    bytes.push_back(static_cast<int>(count));
    total += count;
    check(total < (GlobalId{1} << 31), "gathered lists are small");
  }
  std::vector<T> all(static_cast<std::size_t>(total) / sizeof(T));
  MPI_Allgatherv(mine.data(), static_cast<int>(mine.size_bytes()), MPI_BYTE, all.data(), bytes.data(), offsets.data(),
                 MPI_BYTE, comm.raw());
  return all;
}

}  // namespace malleus
