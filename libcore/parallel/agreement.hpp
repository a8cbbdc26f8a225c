#pragma once

/// Errors in parallel: what one rank meets, all ranks raise, so that none waits in a collective.

#include <functional>

#include "parallel/communicator.hpp"

namespace malleus {

/// Runs `work` on each rank and then agrees. Where it threw an Error on some rank, all ranks throw an Error of
/// the same kind, with the message and code of the lowest such rank. Other exceptions become a Defect on all ranks.
/// Collective; `work` itself must hold no collective calls.
void agree(const Communicator& comm, const std::function<void()>& work);

/// Runs `work` on the root alone (reading a small file, say) and raises its error on all ranks. Collective.
void on_root(const Communicator& comm, const std::function<void()>& work);

}  // namespace malleus
