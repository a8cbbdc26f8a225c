#include "storage/shared_h5_file.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include "base/error.hpp"
#include "storage/seal.hpp"

namespace malleus {
namespace {

/// Creation properties without times of day, so that the same values give the same bytes.
hid_t timeless(hid_t of) {
  const hid_t list = H5Pcreate(of);
  H5Pset_obj_track_times(list, false);
  return list;
}

hid_t file_type(SharedH5File::Type type) {
  switch (type) {
    case SharedH5File::Type::float64:
      return H5T_IEEE_F64LE;
    case SharedH5File::Type::int32:
      return H5T_STD_I32LE;
    case SharedH5File::Type::int64:
      return H5T_STD_I64LE;
  }
  return -1;
}

}  // namespace

SharedH5File::SharedH5File(const Communicator& comm, const std::filesystem::path& path) : path_(path) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_fapl_mpio(access, comm.raw(), MPI_INFO_NULL);
  const hid_t creation = H5Pcreate(H5P_FILE_CREATE);
  H5Pset_userblock(creation, seal_bytes);
  file_ = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation, access);
  H5Pclose(creation);
  H5Pclose(access);
  if (file_ < 0) fail("cannot be created");
}

SharedH5File::~SharedH5File() {
  if (file_ >= 0) H5Fclose(file_);
}

void SharedH5File::fail(const std::string& what) const {
  throw StorageError(fmt::format("{}: {}", path_.string(), what));
}

void SharedH5File::make_group(const std::string& path) {
  const hid_t properties = timeless(H5P_GROUP_CREATE);
  const hid_t group = H5Gcreate2(file_, path.c_str(), H5P_DEFAULT, properties, H5P_DEFAULT);
  H5Pclose(properties);
  if (group < 0) fail("group " + path + " cannot be created");
  H5Gclose(group);
}

void SharedH5File::make_dataset(const std::string& path, Type type, const std::vector<std::uint64_t>& dims) {
  const std::vector<hsize_t> shape(dims.begin(), dims.end());
  const hid_t space = H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr);
  const hid_t properties = timeless(H5P_DATASET_CREATE);
  const hid_t set = H5Dcreate2(file_, path.c_str(), file_type(type), space, H5P_DEFAULT, properties, H5P_DEFAULT);
  H5Pclose(properties);
  H5Sclose(space);
  if (set < 0) fail("dataset " + path + " cannot be created");
  H5Dclose(set);
}

void SharedH5File::write_bytes(const std::string& path, std::int64_t type, const void* data) {
  const hid_t set = H5Dopen2(file_, path.c_str(), H5P_DEFAULT);
  const bool is_written = set >= 0 && H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0;
  if (set >= 0) H5Dclose(set);
  if (!is_written) fail("dataset " + path + " cannot be written (is the disk full?)");
}

void SharedH5File::write(const std::string& path, std::span<const double> values) {
  if (!values.empty()) write_bytes(path, H5T_NATIVE_DOUBLE, values.data());
}
void SharedH5File::write(const std::string& path, std::span<const std::int32_t> values) {
  if (!values.empty()) write_bytes(path, H5T_NATIVE_INT32, values.data());
}
void SharedH5File::write(const std::string& path, std::span<const std::int64_t> values) {
  if (!values.empty()) write_bytes(path, H5T_NATIVE_INT64, values.data());
}

void SharedH5File::close() {
  const bool is_closed = H5Fclose(file_) >= 0;
  file_ = -1;
  if (!is_closed) fail("cannot be written to the end (is the disk full?)");
}

}  // namespace malleus
