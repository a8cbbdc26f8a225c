#include "parallel/halo.hpp"

#include <gtest/gtest.h>

#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

/// Each rank owns 3 entities and holds copies of the first entity of all other ranks.
struct StarHalo {
  Ownership ownership{world(), 3};
  std::vector<GlobalId> copies = first_of_others();
  Halo halo{world(), ownership, copies};

  static std::vector<GlobalId> first_of_others() {
    std::vector<GlobalId> numbers;
    for (int rank = 0; rank < world().size(); ++rank) {
      if (rank != world().rank()) numbers.push_back(3 * rank);
    }
    return numbers;
  }
};

TEST(Halo, CopiesTakeTheOwnersValue) {
  const StarHalo star;
  std::vector<Real> values((3 + star.copies.size()) * 2, -1.0);
  for (int i = 0; i < 6; ++i) values[i] = 100.0 * world().rank() + i;
  star.halo.update_copies(values, 2);
  for (std::size_t i = 0; i < star.copies.size(); ++i) {
    EXPECT_EQ(values[6 + 2 * i], 100.0 * (star.copies[i] / 3));
    EXPECT_EQ(values[7 + 2 * i], 100.0 * (star.copies[i] / 3) + 1);
  }
}

TEST(Halo, ContributionsOfCopiesAreSummedOnTheOwner) {
  const StarHalo star;
  std::vector<Real> values(3 + star.copies.size(), 1.0);
  star.halo.add_to_owners(values, 1);
  EXPECT_EQ(values[0], world().size());
  EXPECT_EQ(values[1], 1.0);
}

TEST(Halo, ExtremesOfCopiesReachTheOwner) {
  const StarHalo star;
  std::vector<Real> values(3 + star.copies.size(), world().rank());
  star.halo.max_to_owners(values, 1);
  EXPECT_EQ(values[0], world().size() - 1);
  std::fill(values.begin(), values.end(), world().rank());
  star.halo.min_to_owners(values, 1);
  EXPECT_EQ(values[0], 0);
}

TEST(Ownership, EveryNumberHasOneOwnerAlsoBesideEmptyRanks) {
  const bool last = world().rank() == world().size() - 1;
  const Ownership ownership(world(), last ? 5 : 0);
  EXPECT_EQ(ownership.total(), 5);
  for (GlobalId number = 0; number < 5; ++number) EXPECT_EQ(ownership.owner_of(number), world().size() - 1);
}

}  // namespace
}  // namespace malleus
