#pragma once

/// Space divided among ranks by planes, half of the work on each side, and again in each half: smooth borders that mean
/// the same before and after a remesh (recursive bisection; Williams 1991 compares it with others).

#include <array>
#include <span>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus {

class PlaneCuts {
 public:
  /// points: [n][dim] of this rank, weights: [n], >= 0. Planes stand across the longest direction of what they divide.
  /// Collective; the same planes on all ranks.
  PlaneCuts(const Communicator& comm, int dim, std::span<const Real> points, std::span<const Real> weights, int parts);

  /// In [0, parts). Local.
  int part_of(const Real* point) const;

 private:
  struct Cut {
    std::array<Real, 3> normal = {1, 0, 0};  ///< unit
    Real offset = 0;
    int first = 0, parts = 0;  ///< of this branch; its lower side gets half of them
    bool is_leaf() const { return parts <= 1; }
  };
  class Level;

  Real height(const Cut& cut, const Real* point) const;
  std::size_t child(std::size_t branch, const Real* point) const;

  int dim_;
  std::vector<Cut> cuts_;  ///< a binary tree: the branches of cut n are 2 n + 1 and 2 n + 2
};

}  // namespace malleus
