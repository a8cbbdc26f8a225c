#include "mesh/ordered_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "base/error.hpp"
#include "parallel/agreement.hpp"

namespace malleus {
namespace {

constexpr int block_tag = 91;
constexpr std::size_t block_bytes = std::size_t{1} << 22;

}  // namespace

OrderedFile::OrderedFile(const Communicator& comm, std::string path)
    : comm_(comm), path_(std::move(path)), aside_(path_ + ".tmp") {
  on_root(comm, [&] {
    file_.open(aside_, std::ios::binary | std::ios::trunc);
    if (!file_) throw StorageError(fmt::format("{}: cannot be created: {}", path_, std::strerror(errno)));
    is_open_ = true;
  });
}

OrderedFile::~OrderedFile() {
  if (!is_open_) return;
  file_.close();
  std::remove(aside_.c_str());
}

void OrderedFile::receive(int rank) {
  std::uint64_t size = 0;
  MPI_Recv(&size, 1, MPI_UINT64_T, rank, block_tag, comm_.raw(), MPI_STATUS_IGNORE);
  std::string block;
  for (std::uint64_t at = 0; at < size; at += block.size()) {
    block.resize(std::min<std::uint64_t>(block_bytes, size - at));
    MPI_Recv(block.data(), static_cast<int>(block.size()), MPI_CHAR, rank, block_tag, comm_.raw(), MPI_STATUS_IGNORE);
    file_.write(block.data(), static_cast<std::streamsize>(block.size()));
  }
}

void OrderedFile::append(const std::string& mine) {
  if (comm_.is_root()) {
    file_.write(mine.data(), static_cast<std::streamsize>(mine.size()));
    for (int rank = 1; rank < comm_.size(); ++rank) receive(rank);
    return;
  }
  const std::uint64_t size = mine.size();
  MPI_Send(&size, 1, MPI_UINT64_T, 0, block_tag, comm_.raw());
  for (std::size_t at = 0; at < mine.size(); at += block_bytes) {
    const std::size_t count = std::min(block_bytes, mine.size() - at);
    MPI_Send(mine.data() + at, static_cast<int>(count), MPI_CHAR, 0, block_tag, comm_.raw());
  }
}

void OrderedFile::append_from_root(const std::string& bytes) {
  if (comm_.is_root()) file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

void OrderedFile::close() {
  on_root(comm_, [&] {
    file_.close();
    if (!file_) throw StorageError(fmt::format("{}: cannot be written to the end (is the disk full?)", path_));
    if (std::rename(aside_.c_str(), path_.c_str()) != 0) {
      throw StorageError(fmt::format("{}: cannot be renamed into place: {}", path_, std::strerror(errno)));
    }
    is_open_ = false;
  });
}

}  // namespace malleus
