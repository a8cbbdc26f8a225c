/// libFuzzer's entry: one executable for all doors; the environment variable MALLEUS_DOOR names the one to knock at.

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "base/log.hpp"
#include "doors.hpp"

namespace {

malleus::fuzz::Door door = nullptr;
std::unique_ptr<malleus::Communicator> world;
std::string scratch;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  MPI_Init(argc, argv);
  world = std::make_unique<malleus::Communicator>(MPI_COMM_WORLD);
  malleus::log::start(false, malleus::log::Level::quiet);
  const char* name = std::getenv("MALLEUS_DOOR");
  const char* directory = std::getenv("MALLEUS_SCRATCH");
  door = name == nullptr ? nullptr : malleus::fuzz::find_door(name);
  if (door == nullptr || directory == nullptr) {
    std::fputs("MALLEUS_DOOR names no door, or MALLEUS_SCRATCH no directory; see scripts/fuzz\n", stderr);
    return 1;
  }
  scratch = directory;
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (door == nullptr) std::exit(1);
  door(*world, {reinterpret_cast<const char*>(data), size}, scratch);
  return 0;
}
