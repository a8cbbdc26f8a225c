/// Every input of the corpus, those that once broke a reader among them, is taken or refused, whole or damaged: no
/// crash, no hang, and the same on all ranks.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "base/log.hpp"
#include "doors.hpp"
#include "support/scratch_directory.hpp"
#include "support/world.hpp"

namespace malleus::fuzz {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> files_in(const fs::path& directory) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(directory)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

std::string read_bytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

class Corpus : public testing::TestWithParam<std::string_view> {
 protected:
  Corpus() { log::start(false, log::Level::quiet); }

  void enter(std::string_view bytes, const std::string& what) {
    EXPECT_NO_THROW(find_door(GetParam())(test::world(), bytes, scratch_.path().string())) << what;
  }

  const std::vector<fs::path> files_ = files_in(fs::path(MALLEUS_CORPUS) / GetParam());

 private:
  test::ScratchDirectory scratch_;
};

TEST_P(Corpus, IsTakenOrRefused) {
  EXPECT_GE(files_.size(), 2U);
  for (const fs::path& path : files_) enter(read_bytes(path), path.string());
}

TEST_P(Corpus, CutOrFlippedAnywhereIsTakenOrRefused) {
  constexpr std::size_t places = 12;
  for (const fs::path& path : files_) {
    const std::string whole = read_bytes(path);
    for (std::size_t k = 0; k < places; ++k) {
      const std::size_t at = whole.size() * (2 * k + 1) / (2 * places);
      enter(std::string_view(whole).substr(0, at), fmt::format("{} cut after {} bytes", path.string(), at));
      std::string flipped = whole;
      flipped[at] = static_cast<char>(flipped[at] ^ (1 << k % 8));
      enter(flipped, fmt::format("{} with bit {} of byte {} flipped", path.string(), k % 8, at));
    }
  }
}

std::vector<std::string_view> door_names() {
  std::vector<std::string_view> names;
  for (const NamedDoor& door : doors()) names.push_back(door.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Doors, Corpus, testing::ValuesIn(door_names()),
                         [](const auto& parameter) { return std::string(parameter.param); });

}  // namespace
}  // namespace malleus::fuzz
