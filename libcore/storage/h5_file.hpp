#pragma once

/// HDF5 files of one process: groups, datasets and attributes, closed when the object goes.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// A file open for writing or reading by this process alone (no MPI-IO). Paths inside the file are absolute
/// ("/p0003/points"). Every failure is a StorageError that names the file. A file to be written is made in memory and
/// goes to the disk in close(): HDF5 1.10 does not survive a write that fails. Local.
class H5File {
 public:
  enum class Mode {
    create,
    create_checked,  ///< headers and values carry checksums, which every reader of HDF5 1.10 or newer verifies
    read
  };
  H5File(const std::filesystem::path& path, Mode mode);
  H5File(const H5File&) = delete;
  H5File& operator=(const H5File&) = delete;
  ~H5File();

  void make_group(const std::string& path);

  /// Contiguous datasets (in chunks where they are checked); dims: their shape, row-major; the product is
  /// values.size().
  void write(const std::string& path, std::span<const double> values, const std::vector<std::uint64_t>& dims);
  void write(const std::string& path, std::span<const float> values, const std::vector<std::uint64_t>& dims);
  void write(const std::string& path, std::span<const std::int32_t> values, const std::vector<std::uint64_t>& dims);
  void write(const std::string& path, std::span<const std::int64_t> values, const std::vector<std::uint64_t>& dims);
  void write_text(const std::string& path, const std::string& text);

  bool has(const std::string& path) const;
  std::vector<std::uint64_t> dims(const std::string& path) const;
  std::vector<double> read_doubles(const std::string& path) const;
  std::vector<std::int32_t> read_int32(const std::string& path) const;
  std::vector<std::int64_t> read_int64(const std::string& path) const;
  std::string read_text(const std::string& path) const;
  std::vector<std::string> names_in(const std::string& group) const;  ///< sorted

  /// Flushes and closes; after it nothing may be called. Reports what the destructor would swallow.
  void close();

 private:
  [[noreturn]] void fail(const std::string& what) const;
  template <class T>
  void write_dataset(const std::string& path, std::span<const T> values, const std::vector<std::uint64_t>& dims);
  template <class T>
  std::vector<T> read_dataset(const std::string& path) const;

  std::filesystem::path path_;
  std::int64_t file_ = -1;
  bool is_written_ = false;
  std::vector<char> image_;  ///< of a file that was written, once it is closed
  bool is_checked_ = false;
};

/// "HDF5 1.10.8", say: the library in use. Local.
std::string hdf5_version();

}  // namespace malleus
