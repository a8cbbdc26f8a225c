#pragma once

/// An HDF5 file that all ranks write together through MPI-IO.

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus {

/// Structure is made collectively, data written by each rank alone. Its first bytes are left free for seal_file().
/// Failures are StorageErrors.
class SharedH5File {
 public:
  enum class Type { float64, int32, int64 };

  SharedH5File(const Communicator& comm, const std::filesystem::path& path);  ///< creates the file; collective
  SharedH5File(const SharedH5File&) = delete;
  SharedH5File& operator=(const SharedH5File&) = delete;
  ~SharedH5File();

  void make_group(const std::string& path);                                                       ///< collective
  void make_dataset(const std::string& path, Type type, const std::vector<std::uint64_t>& dims);  ///< collective
  void write(const std::string& path, std::span<const double> values);        ///< local; the whole dataset
  void write(const std::string& path, std::span<const std::int32_t> values);  ///< local
  void write(const std::string& path, std::span<const std::int64_t> values);  ///< local
  void close();                                                               ///< collective

 private:
  [[noreturn]] void fail(const std::string& what) const;
  void write_bytes(const std::string& path, std::int64_t type, const void* data);

  std::filesystem::path path_;
  std::int64_t file_ = -1;
};

}  // namespace malleus
