#pragma once

/// Checksums over whole files, kept in their first bytes.

#include <cstdint>
#include <filesystem>

#include "parallel/communicator.hpp"

namespace malleus {

/// Bytes at the start of a file that its seal takes: an HDF5 user block of the least size.
constexpr std::uint64_t seal_bytes = 512;

/// Writes into the first seal_bytes of a file, which its format leaves free, how long the rest is and its CRC-32.
/// Nothing else of the file changes. StorageError. Local.
void seal_file(const std::filesystem::path& path);

/// Reads the file, each rank a stretch of it, and compares. InputError on all ranks where it bears no seal, is
/// shorter or longer than it was, or has other bytes. After it nothing in the file can surprise its reader.
/// Collective.
void require_seal(const Communicator& comm, const std::filesystem::path& path);

}  // namespace malleus
