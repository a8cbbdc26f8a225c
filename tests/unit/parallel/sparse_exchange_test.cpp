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

TEST(SparseExchange, ParcelsLongerThanAPieceArriveWhole) {
  for (const std::size_t bytes :
       {std::size_t{0}, std::size_t{1}, std::size_t{999}, std::size_t{1000}, std::size_t{100001}}) {
    std::vector<Parcel> outgoing;
    for (int rank = 0; rank < world().size(); ++rank) {
      Parcel parcel = {rank, std::vector<std::byte>(bytes)};
      for (std::size_t i = 0; i < bytes; ++i)
        parcel.bytes[i] = static_cast<std::byte>((7 * i + static_cast<std::size_t>(world().rank() + 3 * rank)) % 251);
      outgoing.push_back(std::move(parcel));
    }
    const std::vector<Parcel> received = sparse_exchange(world(), std::move(outgoing), 1000);
    ASSERT_EQ(received.size(), static_cast<std::size_t>(world().size()));
    for (const Parcel& parcel : received) {
      ASSERT_EQ(parcel.bytes.size(), bytes);
      for (std::size_t i = 0; i < bytes; ++i) {
        ASSERT_EQ(parcel.bytes[i],
                  static_cast<std::byte>((7 * i + static_cast<std::size_t>(parcel.rank + 3 * world().rank())) % 251));
      }
    }
  }
}

}  // namespace
}  // namespace malleus
