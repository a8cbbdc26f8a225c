#include "parallel/halo.hpp"

#include <algorithm>
#include <map>

#include "base/error.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

constexpr int halo_tag = 75;

template <class T>
MPI_Datatype mpi_type() {
  if constexpr (std::is_same_v<T, Real>) {
    return MPI_DOUBLE;
  } else if constexpr (std::is_same_v<T, float>) {
    return MPI_FLOAT;
  } else if constexpr (std::is_same_v<T, std::int32_t>) {
    return MPI_INT32_T;
  } else {
    return MPI_INT64_T;
  }
}

template <class T>
std::vector<T> pack(std::span<const T> values, std::span<const LocalId> entities, int components) {
  std::vector<T> packed;
  packed.reserve(entities.size() * static_cast<std::size_t>(components));
  for (const LocalId entity : entities) {
    const auto* first = values.data() + static_cast<std::size_t>(entity) * components;
    packed.insert(packed.end(), first, first + components);
  }
  return packed;
}

/// Sends sends(partner) of each partner, receives into a buffer of receives(partner), all at once.
template <class T, class Sends, class Receives>
std::vector<std::vector<T>> swap_buffers(MPI_Comm comm, const std::vector<Halo::Partner>& partners, int components,
                                         std::span<const T> values, Sends sends, Receives receives) {
  std::vector<std::vector<T>> outgoing(partners.size());
  std::vector<std::vector<T>> incoming(partners.size());
  std::vector<MPI_Request> requests;
  for (std::size_t i = 0; i < partners.size(); ++i) {
    incoming[i].resize(receives(partners[i]).size() * static_cast<std::size_t>(components));
    outgoing[i] = pack<T>(values, sends(partners[i]), components);
    if (!incoming[i].empty()) {
      MPI_Irecv(incoming[i].data(), static_cast<int>(incoming[i].size()), mpi_type<T>(), partners[i].rank, halo_tag,
                comm, &requests.emplace_back());
    }
    if (!outgoing[i].empty()) {
      MPI_Isend(outgoing[i].data(), static_cast<int>(outgoing[i].size()), mpi_type<T>(), partners[i].rank, halo_tag,
                comm, &requests.emplace_back());
    }
  }
  MPI_Waitall(static_cast<int>(requests.size()), requests.data(), MPI_STATUSES_IGNORE);
  return incoming;
}

const std::vector<LocalId>& sends_of(const Halo::Partner& partner) {
  return partner.sends;
}
const std::vector<LocalId>& receives_of(const Halo::Partner& partner) {
  return partner.receives;
}

}  // namespace

Ownership::Ownership(const Communicator& comm, LocalId owned) {
  const std::vector<GlobalId> counts = comm.gather_to_all(static_cast<GlobalId>(owned));
  offsets_.resize(counts.size() + 1);
  offsets_[0] = 0;
  for (std::size_t r = 0; r < counts.size(); ++r) offsets_[r + 1] = offsets_[r] + counts[r];
  begin_ = offsets_[static_cast<std::size_t>(comm.rank())];
  end_ = begin_ + owned;
}

int Ownership::owner_of(GlobalId number) const {
  const auto after = std::upper_bound(offsets_.begin(), offsets_.end(), number);
  check(after != offsets_.begin() && after != offsets_.end(), "global number has an owner");
  return static_cast<int>(after - offsets_.begin()) - 1;
}

Halo::Halo(const Communicator& comm, const Ownership& ownership, std::span<const GlobalId> copies)
    : comm_(comm.raw()),
      owned_(static_cast<LocalId>(ownership.end() - ownership.begin())),
      copies_(static_cast<LocalId>(copies.size())) {
  std::map<int, std::vector<GlobalId>> requests;
  std::map<int, Partner> partners;
  for (std::size_t i = 0; i < copies.size(); ++i) {
    const int owner = ownership.owner_of(copies[i]);
    check(owner != comm.rank(), "a copy belongs to another rank");
    requests[owner].push_back(copies[i]);
    partners[owner].receives.push_back(owned_ + static_cast<LocalId>(i));
  }
  for (const auto& [rank, numbers] : sparse_exchange(comm, requests)) {
    for (const GlobalId number : numbers) {
      partners[rank].sends.push_back(static_cast<LocalId>(number - ownership.begin()));
    }
  }
  for (auto& [rank, partner] : partners) {
    partner.rank = rank;
    partners_.push_back(std::move(partner));
  }
}

template <class T>
void Halo::update(std::span<T> values, int components) const {
  check(values.size() == static_cast<std::size_t>(owned_ + copies_) * components, "halo values have the right size");
  const auto incoming = swap_buffers<T>(comm_, partners_, components, values, sends_of, receives_of);
  for (std::size_t i = 0; i < partners_.size(); ++i) {
    const T* source = incoming[i].data();
    for (const LocalId entity : partners_[i].receives) {
      std::copy_n(source, components, values.data() + static_cast<std::size_t>(entity) * components);
      source += components;
    }
  }
}

template <class T, class Combine>
void Halo::combine(std::span<T> values, int components, Combine apply) const {
  check(values.size() == static_cast<std::size_t>(owned_ + copies_) * components, "halo values have the right size");
  const auto incoming = swap_buffers<T>(comm_, partners_, components, values, receives_of, sends_of);
  for (std::size_t i = 0; i < partners_.size(); ++i) {
    const T* source = incoming[i].data();
    for (const LocalId entity : partners_[i].sends) {
      T* target = values.data() + static_cast<std::size_t>(entity) * components;
      for (int c = 0; c < components; ++c) target[c] = apply(target[c], *source++);
    }
  }
}

void Halo::update_copies(std::span<Real> values, int components) const {
  update(values, components);
}
void Halo::update_copies(std::span<float> values, int components) const {
  update(values, components);
}
void Halo::update_copies(std::span<GlobalId> values, int components) const {
  update(values, components);
}
void Halo::update_copies(std::span<std::int32_t> values, int components) const {
  update(values, components);
}

void Halo::add_to_owners(std::span<Real> values, int components) const {
  combine(values, components, [](Real a, Real b) { return a + b; });
}
void Halo::add_to_owners(std::span<float> values, int components) const {
  combine(values, components, [](float a, float b) { return a + b; });
}
void Halo::max_to_owners(std::span<Real> values, int components) const {
  combine(values, components, [](Real a, Real b) { return std::max(a, b); });
}
void Halo::min_to_owners(std::span<Real> values, int components) const {
  combine(values, components, [](Real a, Real b) { return std::min(a, b); });
}

}  // namespace malleus
