#pragma once

/// The ranks that work together, and the small collectives that the program is written in.

#include <mpi.h>

#include <span>
#include <string>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// Owns a duplicate of an MPI communicator. Every member but rank(), size(), is_root() and raw() is collective.
class Communicator {
 public:
  explicit Communicator(MPI_Comm parent);
  Communicator(const Communicator&) = delete;
  Communicator& operator=(const Communicator&) = delete;
  ~Communicator();

  int rank() const noexcept { return rank_; }
  int size() const noexcept { return size_; }
  bool is_root() const noexcept { return rank_ == 0; }
  MPI_Comm raw() const noexcept { return comm_; }

  Real sum(Real mine) const;
  GlobalId sum(GlobalId mine) const;
  Real max(Real mine) const;
  GlobalId max(GlobalId mine) const;
  Real min(Real mine) const;
  GlobalId min(GlobalId mine) const;
  bool all(bool mine) const;  ///< true where every rank says true
  bool any(bool mine) const;  ///< true where some rank says true

  /// Entrywise over the ranks, in place; the spans have one length on all ranks.
  void sum_in_place(std::span<Real> values) const;
  void sum_in_place(std::span<GlobalId> values) const;
  void max_in_place(std::span<Real> values) const;
  void min_in_place(std::span<Real> values) const;

  GlobalId sum_of_lower_ranks(GlobalId mine) const;          ///< exclusive prefix sum; 0 on rank 0
  std::vector<GlobalId> gather_to_all(GlobalId mine) const;  ///< one value a rank: for layouts only
  std::vector<Real> gather_to_all(Real mine) const;

  /// Strings of every rank on the root, in rank order; empty elsewhere. For messages and small tables.
  std::vector<std::string> gather_to_root(const std::string& mine) const;
  void broadcast(std::string& text, int root = 0) const;
  void broadcast(std::span<Real> values, int root = 0) const;
  void broadcast(std::span<GlobalId> values, int root = 0) const;
  bool broadcast(bool value, int root = 0) const;

  void barrier() const;

  /// Counts the sparse exchanges made; 0, 1, 0, ... Their tags alternate, so that a rank which is already in the
  /// next exchange is not heard by one that is still in the last. Local, called once per exchange on every rank.
  int next_exchange_parity() const noexcept { return exchanges_++ % 2; }

 private:
  MPI_Comm comm_ = MPI_COMM_NULL;
  mutable int exchanges_ = 0;
  int rank_ = 0;
  int size_ = 1;
};

}  // namespace malleus
