#pragma once

#include <cstddef>

#include "base/types.hpp"

namespace malleus {

/// The place of an entity of this rank (>= 0) in a standard container.
constexpr std::size_t index(LocalId entity) noexcept {
  return static_cast<std::size_t>(entity);
}

}  // namespace malleus
