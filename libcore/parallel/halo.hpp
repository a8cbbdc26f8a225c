#pragma once

/// Owner <-> copy exchange of values on entities that several ranks hold.

#include <cstdint>
#include <span>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus {

/// Which global numbers belong to which rank: rank r owns [offset(r), offset(r+1)).
class Ownership {
 public:
  Ownership() = default;
  Ownership(const Communicator& comm, LocalId owned);  ///< collective

  GlobalId begin() const noexcept { return begin_; }
  GlobalId end() const noexcept { return end_; }
  GlobalId total() const noexcept { return offsets_.empty() ? 0 : offsets_.back(); }
  bool owns(GlobalId number) const noexcept { return number >= begin_ && number < end_; }
  int owner_of(GlobalId number) const;  ///< local; number in [0, total())

 private:
  GlobalId begin_ = 0;
  GlobalId end_ = 0;
  std::vector<GlobalId> offsets_ = {0};
};

/// A reusable exchange plan. Local entities are numbered owned first, [0, owned), then copies of entities that
/// other ranks own, in the order of the list given at construction. Values are [entity][component].
class Halo {
 public:
  Halo() = default;
  /// copies: global numbers of the copies held here, each owned by another rank. Collective.
  Halo(const Communicator& comm, const Ownership& ownership, std::span<const GlobalId> copies);

  /// Owner's values -> copies. values: [owned + copies][components]. Collective among neighbours.
  void update_copies(std::span<Real> values, int components) const;
  void update_copies(std::span<float> values, int components) const;
  void update_copies(std::span<GlobalId> values, int components) const;
  void update_copies(std::span<std::int32_t> values, int components) const;
  /// Values of the copies are added to their owner's; the copies keep theirs. In rank order, so the sums repeat
  /// bit for bit. Collective among neighbours.
  void add_to_owners(std::span<Real> values, int components) const;
  void add_to_owners(std::span<float> values, int components) const;
  /// The largest (smallest) of the owner's value and its copies' goes to the owner. Collective among neighbours.
  void max_to_owners(std::span<Real> values, int components) const;
  void min_to_owners(std::span<Real> values, int components) const;

  LocalId owned() const noexcept { return owned_; }
  LocalId copies() const noexcept { return copies_; }
  int neighbours() const noexcept { return static_cast<int>(partners_.size()); }

  /// What is exchanged with one rank.
  struct Partner {
    int rank = 0;
    std::vector<LocalId> sends;     ///< owned entities of which that rank holds copies
    std::vector<LocalId> receives;  ///< copies here that that rank owns
  };
  const std::vector<Partner>& partners() const noexcept { return partners_; }

 private:
  template <class T>
  void update(std::span<T> values, int components) const;
  template <class T, class Combine>
  void combine(std::span<T> values, int components, Combine apply) const;

  MPI_Comm comm_ = MPI_COMM_NULL;  ///< not owned: that of the Communicator, which must outlive the plan
  LocalId owned_ = 0;
  LocalId copies_ = 0;
  std::vector<Partner> partners_;
};

}  // namespace malleus
