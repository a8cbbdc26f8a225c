#include "support/scratch_directory.hpp"

#include <cstdlib>
#include <string>

#include "support/world.hpp"

namespace malleus::test {

namespace fs = std::filesystem;

ScratchDirectory::ScratchDirectory() {
  std::string name;
  if (world().is_root()) {
    std::string pattern = (fs::temp_directory_path() / "malleus-test-XXXXXX").string();
    if (mkdtemp(pattern.data()) != nullptr) name = pattern;
  }
  world().broadcast(name);
  path_ = name;
}

ScratchDirectory::~ScratchDirectory() {
  world().barrier();
  std::error_code ignored;
  if (world().is_root()) fs::remove_all(path_, ignored);
}

}  // namespace malleus::test
