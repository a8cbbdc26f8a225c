#include "engine/stop_request.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "base/error.hpp"
#include "support/scratch_directory.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

TEST(StopRequest, ASignalOfOneRankIsKnownToAll) {
  const test::ScratchDirectory scratch;
  const StopRequest stop;
  EXPECT_EQ(stop.asked(world(), scratch.path()), "");
  if (world().rank() == world().size() - 1) std::raise(SIGUSR2);
  EXPECT_EQ(stop.asked(world(), scratch.path()), "signal SIGUSR2");
}

TEST(StopRequest, SignalsBeforeItCount) {
  const test::ScratchDirectory scratch;
  listen_for_stop_signals();
  std::raise(SIGTERM);
  const StopRequest stop;
  EXPECT_EQ(stop.asked(world(), scratch.path()), "signal SIGTERM");
}

/// Of a process that gets the signal twice: its exit code where it ended, -1 where it lives on.
int code_after_two(useconds_t between) {
  const pid_t child = fork();
  if (child == 0) {
    listen_for_stop_signals();
    std::raise(SIGUSR1);
    usleep(between);
    std::raise(SIGUSR1);
    _exit(77);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) != 77 ? WEXITSTATUS(status) : -1;
}

TEST(StopRequest, ASecondWishEndsTheProcessAtOnceAnEchoDoesNot) {
  if (!world().is_root()) return;
  EXPECT_EQ(code_after_two(700000), exit_code::checkpointed);
  EXPECT_EQ(code_after_two(1000), -1);
}

}  // namespace
}  // namespace malleus
