#pragma once

#include "parallel/communicator.hpp"

namespace malleus::test {

/// The ranks that run this test.
const Communicator& world();

}  // namespace malleus::test
