#include "parallel/sparse_exchange.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

TEST(SparseExchange, EachRankHearsFromThoseThatNameIt) {
  const int next = (world().rank() + 1) % world().size();
  const auto received = sparse_exchange<int>(world(), {{next, {world().rank(), 7}}});
  const int previous = (world().rank() + world().size() - 1) % world().size();
  ASSERT_EQ(received.size(), 1U);
  EXPECT_EQ(received.at(previous), (std::vector<int>{previous, 7}));
}

TEST(SparseExchange, SilenceIsAllowed) {
  EXPECT_TRUE(sparse_exchange<int>(world(), {}).empty());
}

TEST(SparseExchange, ManyRoundsInARowStayApart) {
  for (int round = 0; round < 200; ++round) {
    std::map<int, std::vector<int>> outgoing;
    for (int rank = round % 2; rank < world().size(); rank += 2) outgoing[rank] = {round};
    for (const auto& [rank, values] : sparse_exchange(world(), outgoing)) EXPECT_EQ(values, std::vector<int>{round});
  }
}

TEST(SparseExchange, LongMessagesArriveWhole) {
  std::vector<GlobalId> values(300000);
  std::iota(values.begin(), values.end(), world().rank());
  const auto received = sparse_exchange<GlobalId>(world(), {{0, values}});
  if (!world().is_root()) return;
  ASSERT_EQ(received.size(), static_cast<std::size_t>(world().size()));
  for (const auto& [rank, numbers] : received) {
    ASSERT_EQ(numbers.size(), values.size());
    EXPECT_EQ(numbers.back(), rank + 299999);
  }
}

}  // namespace
}  // namespace malleus
