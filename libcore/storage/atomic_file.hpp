#pragma once

/// Small files that are whole or absent, whatever happens while they are written.

#include <filesystem>
#include <string>
#include <vector>

namespace malleus {

/// Writes the text beside `path`, flushes it to the disk, and renames it into place. StorageError. Local.
void write_file_atomically(const std::filesystem::path& path, const std::string& text);

/// Makes what was written (a file, or the names in a directory) survive a power cut. StorageError. Local.
void flush_to_disk(const std::filesystem::path& path);

/// The directory and its parents, made where they do not exist. StorageError. Local.
void make_directories(const std::filesystem::path& path);

/// The whole text of a file. StorageError where it cannot be read. Local.
std::string read_text_file(const std::filesystem::path& path);

/// The lines of a text file without their ends. A last one that does not end, torn by a full disk or a crash, is left
/// out. StorageError. Local.
std::vector<std::string> read_whole_lines(const std::filesystem::path& path);

}  // namespace malleus
