#pragma once

/// From arbitrary global numbers to local indices.

#include <span>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// A set of distinct numbers >= 0, indexed 0, 1, ... in the order in which they were first inserted. Memory follows
/// the count of numbers, not their range; runs of consecutive numbers are found fastest. Local.
class NumberTable {
 public:
  explicit NumberTable(std::size_t expected = 0);

  LocalId insert(GlobalId number);      ///< index of the number, new or known
  LocalId find(GlobalId number) const;  ///< index, or -1
  LocalId size() const noexcept { return static_cast<LocalId>(numbers_.size()); }
  const std::vector<GlobalId>& numbers() const noexcept { return numbers_; }
  std::vector<GlobalId> take_numbers() && { return std::move(numbers_); }

 private:
  std::size_t slot_of(GlobalId number) const;
  void rebuild(std::size_t slots);

  std::vector<GlobalId> numbers_;
  std::vector<LocalId> slots_;  ///< a power of two of them; -1 = free
  unsigned bits_ = 0;
};

}  // namespace malleus
