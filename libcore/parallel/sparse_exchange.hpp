#pragma once

/// Sparse all-to-all: each rank sends to the few ranks it names, and learns who sent to it.

#include <cstddef>
#include <cstring>
#include <map>
#include <span>
#include <type_traits>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus {

/// Bytes for or from one rank.
struct Parcel {
  int rank = 0;
  std::vector<std::byte> bytes;
};

/// Sends each parcel to its rank and returns those received, sorted by sender. At most one parcel a rank; parcels
/// may be empty and may go to oneself. Of any size: sent in pieces of at most piece_bytes, which an int counts, the
/// same on all ranks. The cost follows the number of partners, not of ranks (nonblocking consensus: Hoefler, Siebert,
/// Lumsdaine 2010). Collective.
std::vector<Parcel> sparse_exchange(const Communicator& comm, std::vector<Parcel> outgoing,
                                    std::size_t piece_bytes = std::size_t{1} << 30);

/// The same for values of one trivially copyable type: rank -> values, in rank order on both sides. Collective.
template <class T>
std::map<int, std::vector<T>> sparse_exchange(const Communicator& comm, const std::map<int, std::vector<T>>& outgoing) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::vector<Parcel> parcels;
  for (const auto& [rank, values] : outgoing) {
    const auto bytes = std::as_bytes(std::span(values));
    parcels.push_back({rank, {bytes.begin(), bytes.end()}});
  }
  std::map<int, std::vector<T>> incoming;
  for (const Parcel& parcel : sparse_exchange(comm, std::move(parcels))) {
    std::vector<T>& values = incoming[parcel.rank];
    values.resize(parcel.bytes.size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), parcel.bytes.data(), parcel.bytes.size());
  }
  return incoming;
}

}  // namespace malleus
