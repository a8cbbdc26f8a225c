#include "parallel/agreement.hpp"

#include <gtest/gtest.h>

#include "base/error.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

TEST(Agreement, AnErrorOnOneRankIsRaisedOnAll) {
  const int guilty = world().size() - 1;
  try {
    agree(world(), [&] {
      if (world().rank() == guilty) throw InputError("rank has no bread");
    });
    FAIL() << "no error was raised";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), exit_code::wrong_input);
    EXPECT_STREQ(error.what(), "rank has no bread");
  }
}

TEST(Agreement, TheLowestRankSpeaksForAll) {
  try {
    agree(world(), [&] { throw StorageError("rank " + std::to_string(world().rank())); });
    FAIL() << "no error was raised";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "rank 0");
  }
}

TEST(Agreement, ForeignExceptionsAreDefectsEverywhere) {
  EXPECT_THROW(on_root(world(), [] { throw std::out_of_range("index"); }), Defect);
}

TEST(Agreement, NothingIsRaisedWhereAllWentWell) {
  int calls = 0;
  agree(world(), [&] { ++calls; });
  EXPECT_EQ(calls, 1);
}

}  // namespace
}  // namespace malleus
