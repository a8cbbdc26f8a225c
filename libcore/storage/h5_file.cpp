#include "storage/h5_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <numeric>

#include "base/error.hpp"

namespace malleus {
namespace {

static_assert(sizeof(hid_t) == sizeof(std::int64_t));

/// Closes an HDF5 identifier at the end of a scope.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  hid_t get() const { return id_; }
  bool is_open() const { return id_ >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// Creation properties without times of day, so that the same values give the same bytes.
class TimelessProperties {
 public:
  explicit TimelessProperties(hid_t of) : list_(H5Pcreate(of), H5Pclose) { H5Pset_obj_track_times(list_.get(), false); }
  hid_t get() const { return list_.get(); }

 private:
  Handle list_;
};

/// Equal stretches of rows, of some megabytes each.
std::vector<hsize_t> chunk_of(std::vector<hsize_t> shape, std::size_t value_bytes) {
  constexpr hsize_t most_bytes = hsize_t{1} << 24;
  const hsize_t row = std::accumulate(shape.begin() + 1, shape.end(), hsize_t{value_bytes}, std::multiplies<>());
  const hsize_t most_rows = std::max<hsize_t>(1, most_bytes / row);
  const hsize_t chunks = (shape[0] + most_rows - 1) / most_rows;
  shape[0] = (shape[0] + chunks - 1) / chunks;
  return shape;
}

/// Bytes by which the image of a file grows.
constexpr std::size_t image_growth = std::size_t{1} << 20;

void* keep_place(void* image) {
  return image;
}
herr_t forget_place(void* /*image*/) {
  return 0;
}

/// HDF5 frees the memory of a file: at its end, when all is in place, its first bytes go to the image, as many as that
/// holds.
herr_t free_memory(void* memory, H5FD_file_image_op_t operation, void* image) {
  auto& kept = *static_cast<std::vector<char>*>(image);
  if (operation == H5FD_FILE_IMAGE_OP_FILE_CLOSE && !kept.empty()) std::memcpy(kept.data(), memory, kept.size());
  std::free(memory);
  return 0;
}
void* make_memory(std::size_t bytes, H5FD_file_image_op_t /*operation*/, void* /*image*/) {
  return std::malloc(bytes);
}
void* copy_memory(void* to, const void* from, std::size_t bytes, H5FD_file_image_op_t /*operation*/, void* /*image*/) {
  return std::memcpy(to, from, bytes);
}
void* grow_memory(void* memory, std::size_t bytes, H5FD_file_image_op_t /*operation*/, void* /*image*/) {
  return std::realloc(memory, bytes);
}

/// The file is made in memory, and leaves its bytes in the image when it is closed.
void keep_image(hid_t access, std::vector<char>& image) {
  H5Pset_fapl_core(access, image_growth, false);
  H5FD_file_image_callbacks_t callbacks = {make_memory, copy_memory,  grow_memory, free_memory,
                                           keep_place,  forget_place, &image};
  H5Pset_file_image_callbacks(access, &callbacks);
}

/// The number of the system's error; 0 = written.
int write_bytes(const std::filesystem::path& path, std::span<const char> bytes) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (file < 0) return errno;
  int error = 0;
  while (!bytes.empty() && error == 0) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written >= 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    } else if (errno != EINTR) {
      error = errno;
    }
  }
  if (::close(file) != 0 && error == 0) error = errno;
  return error;
}

template <class T>
hid_t memory_type();
template <>
hid_t memory_type<double>() {
  return H5T_NATIVE_DOUBLE;
}
template <>
hid_t memory_type<float>() {
  return H5T_NATIVE_FLOAT;
}
template <>
hid_t memory_type<std::int32_t>() {
  return H5T_NATIVE_INT32;
}
template <>
hid_t memory_type<std::int64_t>() {
  return H5T_NATIVE_INT64;
}

}  // namespace

H5File::H5File(const std::filesystem::path& path, Mode mode) : path_(path), is_written_(mode != Mode::read) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // failures are told by our own errors
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  const TimelessProperties timeless(H5P_FILE_CREATE);
  is_checked_ = mode == Mode::create_checked;
  if (is_checked_) H5Pset_libver_bounds(access.get(), H5F_LIBVER_V110, H5F_LIBVER_V110);
  if (is_written_) keep_image(access.get(), image_);
  file_ = is_written_ ? H5Fcreate(path.c_str(), H5F_ACC_TRUNC, timeless.get(), access.get())
                      : H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.get());
  if (file_ < 0) fail(is_written_ ? "cannot be created" : "cannot be opened as an HDF5 file");
}

H5File::~H5File() {
  if (file_ >= 0) H5Fclose(file_);
}

void H5File::close() {
  bool is_whole = H5Fflush(file_, H5F_SCOPE_LOCAL) >= 0;
  if (is_whole && is_written_) {
    const ssize_t bytes = H5Fget_file_image(file_, nullptr, 0);
    is_whole = bytes > 0;
    image_.resize(static_cast<std::size_t>(std::max<ssize_t>(bytes, 0)));
  }
  is_whole = H5Fclose(file_) >= 0 && is_whole;
  file_ = -1;
  if (!is_whole) fail("cannot be put together in memory");
  if (!is_written_) return;
  if (const int error = write_bytes(path_, image_)) fail(fmt::format("cannot be written: {}", std::strerror(error)));
}

void H5File::fail(const std::string& what) const {
  throw StorageError(fmt::format("{}: {}", path_.string(), what));
}

void H5File::make_group(const std::string& path) {
  const TimelessProperties timeless(H5P_GROUP_CREATE);
  const Handle group(H5Gcreate2(file_, path.c_str(), H5P_DEFAULT, timeless.get(), H5P_DEFAULT), H5Gclose);
  if (!group.is_open()) fail("group " + path + " cannot be created");
}

template <class T>
void H5File::write_dataset(const std::string& path, std::span<const T> values, const std::vector<std::uint64_t>& dims) {
  const auto count = std::accumulate(dims.begin(), dims.end(), std::uint64_t{1}, std::multiplies<>());
  check(count == values.size(), "the shape of a dataset fits its values");
  const TimelessProperties timeless(H5P_DATASET_CREATE);
  const std::vector<hsize_t> shape(dims.begin(), dims.end());
  if (is_checked_ && count > 0) {
    const std::vector<hsize_t> chunk = chunk_of(shape, sizeof(T));
    H5Pset_chunk(timeless.get(), static_cast<int>(chunk.size()), chunk.data());
    H5Pset_fletcher32(timeless.get());
  }
  const Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), H5Sclose);
  const Handle set(
      H5Dcreate2(file_, path.c_str(), memory_type<T>(), space.get(), H5P_DEFAULT, timeless.get(), H5P_DEFAULT),
      H5Dclose);
  if (!set.is_open()) fail("dataset " + path + " cannot be created");
  if (count > 0 && H5Dwrite(set.get(), memory_type<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
    fail("dataset " + path + " cannot be written (is the disk full?)");
  }
}

void H5File::write(const std::string& path, std::span<const double> values, const std::vector<std::uint64_t>& dims) {
  write_dataset(path, values, dims);
}
void H5File::write(const std::string& path, std::span<const float> values, const std::vector<std::uint64_t>& dims) {
  write_dataset(path, values, dims);
}
void H5File::write(const std::string& path, std::span<const std::int32_t> values,
                   const std::vector<std::uint64_t>& dims) {
  write_dataset(path, values, dims);
}
void H5File::write(const std::string& path, std::span<const std::int64_t> values,
                   const std::vector<std::uint64_t>& dims) {
  write_dataset(path, values, dims);
}

void H5File::write_text(const std::string& path, const std::string& text) {
  const TimelessProperties timeless(H5P_DATASET_CREATE);
  const Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), std::max<std::size_t>(text.size(), 1));
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle set(H5Dcreate2(file_, path.c_str(), type.get(), space.get(), H5P_DEFAULT, timeless.get(), H5P_DEFAULT),
                   H5Dclose);
  const std::string padded = text.empty() ? std::string(1, '\0') : text;
  if (!set.is_open() || H5Dwrite(set.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, padded.data()) < 0) {
    fail("text " + path + " cannot be written");
  }
}

bool H5File::has(const std::string& path) const {
  for (std::size_t slash = path.find('/', 1); slash != std::string::npos; slash = path.find('/', slash + 1)) {
    if (H5Lexists(file_, path.substr(0, slash).c_str(), H5P_DEFAULT) <= 0) return false;
  }
  return H5Lexists(file_, path.c_str(), H5P_DEFAULT) > 0;
}

std::vector<std::uint64_t> H5File::dims(const std::string& path) const {
  const Handle set(H5Dopen2(file_, path.c_str(), H5P_DEFAULT), H5Dclose);
  if (!set.is_open()) fail("has no dataset " + path);
  const Handle space(H5Dget_space(set.get()), H5Sclose);
  const int rank = H5Sget_simple_extent_ndims(space.get());
  if (rank < 0) fail("dataset " + path + " is damaged");
  std::vector<hsize_t> shape(static_cast<std::size_t>(rank));
  H5Sget_simple_extent_dims(space.get(), shape.data(), nullptr);
  return {shape.begin(), shape.end()};
}

template <class T>
std::vector<T> H5File::read_dataset(const std::string& path) const {
  const std::vector<std::uint64_t> shape = dims(path);
  const Handle set(H5Dopen2(file_, path.c_str(), H5P_DEFAULT), H5Dclose);
  const auto count = std::accumulate(shape.begin(), shape.end(), std::uint64_t{1}, std::multiplies<>());
  if (count > 0 && H5Dget_storage_size(set.get()) == 0) fail("dataset " + path + " is damaged");
  std::vector<T> values(count);
  if (count > 0 && H5Dread(set.get(), memory_type<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
    fail("dataset " + path + " cannot be read");
  }
  return values;
}

std::vector<double> H5File::read_doubles(const std::string& path) const {
  return read_dataset<double>(path);
}
std::vector<std::int32_t> H5File::read_int32(const std::string& path) const {
  return read_dataset<std::int32_t>(path);
}
std::vector<std::int64_t> H5File::read_int64(const std::string& path) const {
  return read_dataset<std::int64_t>(path);
}

std::string H5File::read_text(const std::string& path) const {
  const Handle set(H5Dopen2(file_, path.c_str(), H5P_DEFAULT), H5Dclose);
  if (!set.is_open()) fail("has no text " + path);
  const Handle type(H5Dget_type(set.get()), H5Tclose);
  std::string text(H5Tget_size(type.get()), '\0');
  if (H5Dread(set.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, text.data()) < 0) {
    fail("text " + path + " cannot be read");
  }
  text.erase(std::find(text.begin(), text.end(), '\0'), text.end());
  return text;
}

std::vector<std::string> H5File::names_in(const std::string& group) const {
  const Handle opened(H5Gopen2(file_, group.c_str(), H5P_DEFAULT), H5Gclose);
  if (!opened.is_open()) fail("has no group " + group);
  H5G_info_t info;
  H5Gget_info(opened.get(), &info);
  std::vector<std::string> names;
  for (hsize_t i = 0; i < info.nlinks; ++i) {
    const auto length = H5Lget_name_by_idx(opened.get(), ".", H5_INDEX_NAME, H5_ITER_INC, i, nullptr, 0, H5P_DEFAULT);
    if (length < 0) fail("group " + group + " is damaged");
    std::string name(static_cast<std::size_t>(length) + 1, '\0');
    H5Lget_name_by_idx(opened.get(), ".", H5_INDEX_NAME, H5_ITER_INC, i, name.data(), name.size(), H5P_DEFAULT);
    name.pop_back();
    names.push_back(std::move(name));
  }
  return names;
}

std::string hdf5_version() {
  unsigned major = 0, minor = 0, release = 0;
  H5get_libversion(&major, &minor, &release);
  return fmt::format("HDF5 {}.{}.{}", major, minor, release);
}

}  // namespace malleus
