#include "mesh/file_reader.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace malleus {
namespace {

constexpr std::size_t window_bytes = std::size_t{1} << 20;
constexpr std::size_t longest_line = std::size_t{1} << 26;

}  // namespace

FileReader::FileReader(std::string path) : path_(std::move(path)) {
  descriptor_ = open(path_.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor_ < 0) throw InputError(fmt::format("{}: cannot be opened: {}", path_, std::strerror(errno)));
  struct stat status = {};
  if (fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode)) {
    close(descriptor_);
    throw InputError(fmt::format("{}: is not a file", path_));
  }
  size_ = status.st_size;
  window_.resize(std::min(window_bytes, static_cast<std::size_t>(size_) + 1));
}

FileReader::~FileReader() {
  close(descriptor_);
}

void FileReader::seek(GlobalId position) {
  check(position >= 0 && position <= size_, "a place in the file");
  if (position >= window_begin_ && position <= window_begin_ + static_cast<GlobalId>(filled_)) {
    next_ = static_cast<std::size_t>(position - window_begin_);
    return;
  }
  window_begin_ = position;
  next_ = 0;
  filled_ = 0;
}

bool FileReader::refill() {
  if (window_begin_ + static_cast<GlobalId>(filled_) >= size_) return false;
  if (next_ > 0) {
    std::memmove(window_.data(), window_.data() + next_, filled_ - next_);
    window_begin_ += static_cast<GlobalId>(next_);
    filled_ -= next_;
    next_ = 0;
  }
  if (filled_ == window_.size()) {
    if (window_.size() >= longest_line) fail_at_byte(position(), "a line of more than 64 MiB: the file is damaged");
    window_.resize(window_.size() * 2);
  }
  const GlobalId from = window_begin_ + static_cast<GlobalId>(filled_);
  const ssize_t got = pread(descriptor_, window_.data() + filled_, window_.size() - filled_, from);
  if (got < 0 && errno == EINTR) return refill();
  if (got < 0) fail_at_byte(from, fmt::format("cannot be read: {}", std::strerror(errno)));
  if (got == 0) fail_at_byte(from, "the file became shorter while it was read");
  filled_ += static_cast<std::size_t>(got);
  return true;
}

void FileReader::pass_line_end() {
  ++line_number_;
  if (!line_index_.empty() && (line_number_ - 1) % index_step == 0) line_index_.push_back(position());
}

std::string_view FileReader::read_line() {
  std::size_t searched = 0;
  for (;;) {
    const char* begin = window_.data() + next_;
    const void* end = std::memchr(begin + searched, '\n', filled_ - next_ - searched);
    if (end != nullptr) {
      const auto length = static_cast<std::size_t>(static_cast<const char*>(end) - begin);
      next_ += length + 1;
      pass_line_end();
      return {begin, length};
    }
    searched = filled_ - next_;
    if (!refill()) break;
  }
  check(!at_end(), "there is a line to read");
  const std::string_view line(window_.data() + next_, filled_ - next_);
  next_ = filled_;
  pass_line_end();
  return line;
}

bool FileReader::skip_lines(GlobalId count) {
  for (GlobalId i = 0; i < count; ++i) {
    if (at_end()) return false;
    read_line();
  }
  return true;
}

void FileReader::read_bytes(void* target, GlobalId count) {
  if (count > remaining()) fail_at_byte(size_, "the file ends too early");
  auto* bytes = static_cast<char*>(target);
  while (count > 0) {
    if (next_ == filled_) refill();
    const auto piece = std::min(static_cast<std::size_t>(count), filled_ - next_);
    std::memcpy(bytes, window_.data() + next_, piece);
    next_ += piece;
    bytes += piece;
    count -= static_cast<GlobalId>(piece);
  }
}

bool FileReader::skip_behind(std::string_view text) {
  for (;;) {
    const std::string_view unread(window_.data() + next_, filled_ - next_);
    const std::size_t found = unread.find(text);
    if (found != std::string_view::npos) {
      next_ += found + text.size();
      return true;
    }
    if (unread.size() >= text.size()) next_ = filled_ - text.size() + 1;
    if (!refill()) return false;
  }
}

void FileReader::seek_line(GlobalId line, const std::vector<GlobalId>& line_index) {
  const auto entry = static_cast<std::size_t>((line - 1) / index_step);
  check(line >= 1 && entry < line_index.size(), "a line that was indexed");
  seek(line_index[entry]);
  line_number_ = static_cast<GlobalId>(entry) * index_step + 1;
  check(skip_lines(line - line_number_), "an indexed line exists");
}

void FileReader::fail_at_line(GlobalId line, const std::string& what) const {
  throw InputError(fmt::format("{}:{}: {}", path_, line, what));
}

void FileReader::fail_at_byte(GlobalId position, const std::string& what) const {
  throw InputError(fmt::format("{}, byte {}: {}", path_, position, what));
}

std::string LineFields::shortened(std::string_view text) {
  constexpr std::size_t longest = 40;
  std::string result(text.substr(0, longest));
  std::replace_if(
      result.begin(), result.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  while (!result.empty() && result.back() == ' ') result.pop_back();
  return text.size() > longest ? result + "..." : result;
}

void LineFields::fail_on_value() const {
  if (rest_.empty()) fail(std::string("a value is missing in ") + what_);
  const std::string_view word = rest_.substr(0, rest_.find_first_of(" \t\r"));
  fail(fmt::format("'{}' is no value for {}", shortened(word), what_));
}

}  // namespace malleus
