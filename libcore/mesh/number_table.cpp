#include "mesh/number_table.hpp"

#include <algorithm>
#include <bit>
#include <limits>

#include "base/error.hpp"

namespace malleus {

NumberTable::NumberTable(std::size_t expected) {
  numbers_.reserve(expected);
  rebuild(std::bit_ceil(std::max<std::size_t>(16, expected * 2)));
}

/// The low bits keep runs of numbers together in memory; the mixed high bits spread numbers with a large stride.
std::size_t NumberTable::slot_of(GlobalId number) const {
  const auto bits = static_cast<std::uint64_t>(number);
  const std::uint64_t spread = (bits >> bits_) * 0x9E3779B97F4A7C15ULL;
  std::size_t slot = (bits + (spread >> 20)) & (slots_.size() - 1);
  while (slots_[slot] >= 0 && numbers_[static_cast<std::size_t>(slots_[slot])] != number) {
    slot = (slot + 1) & (slots_.size() - 1);
  }
  return slot;
}

void NumberTable::rebuild(std::size_t slots) {
  bits_ = static_cast<unsigned>(std::countr_zero(slots));
  slots_.assign(slots, -1);
  for (std::size_t i = 0; i < numbers_.size(); ++i) slots_[slot_of(numbers_[i])] = static_cast<LocalId>(i);
}

LocalId NumberTable::insert(GlobalId number) {
  std::size_t slot = slot_of(number);
  if (slots_[slot] >= 0) return slots_[slot];
  check(numbers_.size() < static_cast<std::size_t>(std::numeric_limits<LocalId>::max()),
        "the entities of a rank are counted in 32 bits");
  if ((numbers_.size() + 1) * 4 > slots_.size() * 3) {
    rebuild(slots_.size() * 2);
    slot = slot_of(number);
  }
  slots_[slot] = size();
  numbers_.push_back(number);
  return slots_[slot];
}

LocalId NumberTable::find(GlobalId number) const {
  return slots_[slot_of(number)];
}

}  // namespace malleus
