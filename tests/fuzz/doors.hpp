#pragma once

/// The ways by which what others wrote comes into the programs: each takes any bytes.

#include <span>
#include <string>
#include <string_view>

#include "parallel/communicator.hpp"

namespace malleus::fuzz {

/// Reads the bytes as that kind of input. Returns where they were taken or properly refused (InputError); anything
/// else that is thrown is a defect. scratch: a directory for a file of them. Collective, with the same bytes on all
/// ranks.
using Door = void (*)(const Communicator& comm, std::string_view bytes, const std::string& scratch);

struct NamedDoor {
  std::string_view name;  ///< of its folder in tests/fuzz/corpus
  Door enter;
};

/// All of them.
std::span<const NamedDoor> doors();

/// The door of that name; null where there is none.
Door find_door(std::string_view name);

}  // namespace malleus::fuzz
