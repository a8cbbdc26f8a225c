#include "storage/seal.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <string_view>

#include "base/error.hpp"
#include "parallel/agreement.hpp"

namespace malleus {
namespace {

constexpr std::string_view mark = "malleus sealed file 1\n";

/// What stands in the file behind the mark.
struct Seal {
  std::uint64_t bytes = 0;  ///< of the rest of the file
  std::uint64_t crc32 = 0;
};

/// CRC-32 of a stretch. What cannot be read counts as other bytes.
uLong checksum_of(std::ifstream& file, std::uint64_t begin, std::uint64_t end) {
  std::array<char, 1 << 16> buffer;
  uLong sum = crc32(0, nullptr, 0);
  file.seekg(static_cast<std::streamoff>(begin));
  for (std::uint64_t at = begin; at < end && file;) {
    file.read(buffer.data(), static_cast<std::streamsize>(std::min<std::uint64_t>(buffer.size(), end - at)));
    sum = crc32(sum, reinterpret_cast<const Bytef*>(buffer.data()), static_cast<uInt>(file.gcount()));
    at += static_cast<std::uint64_t>(file.gcount());
  }
  return sum;
}

std::ifstream open_to_read(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::error_code error;
  if (!file || !std::filesystem::is_regular_file(path, error)) {
    throw InputError(fmt::format("{}: cannot be opened as a file", path.string()));
  }
  return file;
}

/// The seal that a file bears, where its length is right.
Seal read_seal(const std::filesystem::path& path) {
  std::ifstream file = open_to_read(path);
  std::array<char, seal_bytes> block{};
  file.read(block.data(), block.size());
  if (!file || std::string_view(block.data(), mark.size()) != mark) {
    throw InputError(fmt::format("{}: is no mesh file of Malleus", path.string()));
  }
  Seal seal;
  std::memcpy(&seal, block.data() + mark.size(), sizeof seal);
  if (std::any_of(block.begin() + mark.size() + sizeof seal, block.end(), [](char c) { return c != 0; })) {
    throw InputError(fmt::format("{}: wrong checksum: the file is damaged", path.string()));
  }
  const std::uint64_t size = std::filesystem::file_size(path);
  if (size != seal.bytes + seal_bytes) {
    throw InputError(fmt::format("{}: has {} bytes, but {} were written: the file is damaged", path.string(), size,
                                 seal.bytes + seal_bytes));
  }
  return seal;
}

}  // namespace

void seal_file(const std::filesystem::path& path) {
  std::ifstream written(path, std::ios::binary);
  std::error_code error;
  Seal seal;
  seal.bytes = std::filesystem::file_size(path, error) - seal_bytes;
  seal.crc32 = checksum_of(written, seal_bytes, seal_bytes + seal.bytes);
  std::array<char, seal_bytes> block{};
  std::copy(mark.begin(), mark.end(), block.begin());
  std::memcpy(block.data() + mark.size(), &seal, sizeof seal);
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  file.write(block.data(), block.size());
  file.flush();
  if (error || !written || !file) throw StorageError(fmt::format("{}: cannot be sealed", path.string()));
}

void require_seal(const Communicator& comm, const std::filesystem::path& path) {
  std::array<GlobalId, 2> shared{};
  on_root(comm, [&] {
    const Seal seal = read_seal(path);
    shared = {static_cast<GlobalId>(seal.bytes), static_cast<GlobalId>(seal.crc32)};
  });
  comm.broadcast(std::span<GlobalId>(shared));
  const auto bytes = static_cast<std::uint64_t>(shared[0]);
  const auto ranks = static_cast<std::uint64_t>(comm.size());
  const auto border = [&](std::uint64_t rank) { return bytes / ranks * rank + std::min(rank, bytes % ranks); };
  const auto me = static_cast<std::uint64_t>(comm.rank());
  GlobalId mine = 0;
  agree(comm, [&] {
    std::ifstream file = open_to_read(path);
    mine = static_cast<GlobalId>(checksum_of(file, seal_bytes + border(me), seal_bytes + border(me + 1)));
  });
  uLong whole = crc32(0, nullptr, 0);
  std::uint64_t rank = 0;
  for (const GlobalId part : comm.gather_to_all(mine)) {
    whole = crc32_combine(whole, static_cast<uLong>(part), static_cast<z_off_t>(border(rank + 1) - border(rank)));
    ++rank;
  }
  if (static_cast<GlobalId>(whole) != shared[1]) {
    throw InputError(fmt::format("{}: wrong checksum: the file is damaged", path.string()));
  }
}

}  // namespace malleus
