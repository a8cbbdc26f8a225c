/// Every input of the corpus, those that once broke a reader among them, is taken or refused: no crash, no hang, and
/// the same on all ranks.

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

class Corpus : public testing::TestWithParam<std::string_view> {};

TEST_P(Corpus, IsTakenOrRefused) {
  log::start(false, log::Level::quiet);
  const test::ScratchDirectory scratch;
  const std::vector<fs::path> files = files_in(fs::path(MALLEUS_CORPUS) / GetParam());
  EXPECT_GE(files.size(), 2U);
  for (const fs::path& path : files) {
    std::ifstream file(path, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    EXPECT_NO_THROW(find_door(GetParam())(test::world(), bytes, scratch.path().string())) << path;
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
