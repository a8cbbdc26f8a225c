#include "storage/atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "base/error.hpp"

namespace malleus {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const char* what) {
  throw StorageError(fmt::format("{}: {}: {}", path.string(), what, std::strerror(errno)));
}

void write_all(int file, const std::filesystem::path& path, const std::string& text) {
  std::size_t written = 0;
  while (written < text.size()) {
    const ssize_t count = ::write(file, text.data() + written, text.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      const int reason = errno;
      ::close(file);
      ::unlink(path.c_str());
      errno = reason;
      fail(path, "cannot be written");
    }
    written += static_cast<std::size_t>(count);
  }
}

}  // namespace

void write_file_atomically(const std::filesystem::path& path, const std::string& text) {
  std::filesystem::path aside = path;
  aside += ".tmp";
  const int file = ::open(aside.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (file < 0) fail(aside, "cannot be created");
  write_all(file, aside, text);
  if (::fsync(file) != 0 && errno != EINVAL) {
    ::close(file);
    fail(aside, "cannot be flushed to the disk");
  }
  if (::close(file) != 0) fail(aside, "cannot be closed");
  if (::rename(aside.c_str(), path.c_str()) != 0) fail(path, "cannot be renamed into place");
}

void flush_to_disk(const std::filesystem::path& path) {
  const int file = ::open(path.c_str(), O_RDONLY);
  if (file < 0 || (::fsync(file) != 0 && errno != EINVAL)) {
    const int reason = errno;
    if (file >= 0) ::close(file);
    errno = reason;
    fail(path, "cannot be flushed to the disk");
  }
  ::close(file);
}

void make_directories(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) {
    throw StorageError(fmt::format("{}: the directory cannot be created: {}", path.string(), error.message()));
  }
}

std::string read_text_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) fail(path, "cannot be opened");
  std::ostringstream text;
  text << file.rdbuf();
  if (file.bad()) fail(path, "cannot be read");
  return text.str();
}

std::vector<std::string> read_whole_lines(const std::filesystem::path& path) {
  const std::string text = read_text_file(path);
  std::vector<std::string> lines;
  std::size_t begin = 0;
  for (std::size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n', begin)) {
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

}  // namespace malleus
