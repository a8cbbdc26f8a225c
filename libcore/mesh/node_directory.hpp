#pragma once

/// Coordinates of the nodes of a mesh by number, spread over the ranks while the mesh is being distributed.

#include <span>
#include <string>
#include <vector>

#include "mesh/number_table.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// The rank that keeps what is known about a node number: numbers go to ranks in blocks, so that neighbours in the
/// numbering travel together, and the blocks are spread so that sparse numbers do not all meet on one rank. Local.
int rendezvous_rank(GlobalId number, int ranks);

/// A rank knows the coordinates of the numbers whose rendezvous it is.
class NodeDirectory {
 public:
  /// numbers, coordinates [node][dim] as this rank read them, in any order and on any rank. A number given twice with
  /// different coordinates is an InputError. source: name of the file for messages. Collective.
  NodeDirectory(const Communicator& comm, std::string source, int dim, std::span<const GlobalId> numbers,
                std::span<const Real> coordinates);

  /// Coordinates [number][dim] of the numbers, each once; an unknown number is an InputError. Collective.
  std::vector<Real> fetch(const Communicator& comm, std::span<const GlobalId> numbers);

  GlobalId repeated() const noexcept { return repeated_; }  ///< numbers given again, same place; local
  GlobalId never_fetched() const;                           ///< numbers that nobody asked for; local

 private:
  void add(GlobalId number, const Real* point);

  std::string source_;
  int dim_;
  NumberTable table_;
  std::vector<Real> coordinates_;
  std::vector<char> was_fetched_;
  GlobalId repeated_ = 0;
};

}  // namespace malleus
