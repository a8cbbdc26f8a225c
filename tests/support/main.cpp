/// Entry point of every unit test: starts MPI, runs GoogleTest on all ranks, and fails where any rank failed.

#include <gtest/gtest.h>

#include <cfenv>

#include "parallel/petsc_session.hpp"
#include "parallel/session.hpp"
#include "support/world.hpp"

namespace malleus::test {
namespace {
const Communicator* world_pointer = nullptr;
}
const Communicator& world() {
  return *world_pointer;
}
}  // namespace malleus::test

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  malleus::Session session(argc, argv);
  const malleus::PetscSession petsc("tests", {});
  malleus::test::world_pointer = &session.world();
  feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
  if (!session.world().is_root()) {
    auto& listeners = testing::UnitTest::GetInstance()->listeners();
    delete listeners.Release(listeners.default_result_printer());
    struct FailuresOnly : testing::EmptyTestEventListener {
      void OnTestPartResult(const testing::TestPartResult& result) override {
        if (!result.failed()) return;
        std::fprintf(stderr, "rank %d: %s:%d\n%s\n", malleus::test::world().rank(),
                     result.file_name() != nullptr ? result.file_name() : "?", result.line_number(), result.message());
      }
    };
    listeners.Append(new FailuresOnly);
  }
  const int mine = RUN_ALL_TESTS();
  return session.world().any(mine != 0) ? 1 : 0;
}
