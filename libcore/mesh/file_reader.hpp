#pragma once

/// Buffered reading of text and binary files by byte or by line, with the place of every value for messages.

#include <charconv>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.hpp"
#include "base/types.hpp"

namespace malleus {

/// One open file and a window of it in memory. Every failure is an InputError that names the file and the place.
class FileReader {
 public:
  /// Lines between two entries of a line index.
  static constexpr GlobalId index_step = 4096;

  explicit FileReader(std::string path);
  FileReader(const FileReader&) = delete;
  FileReader& operator=(const FileReader&) = delete;
  ~FileReader();

  const std::string& path() const noexcept { return path_; }
  GlobalId size() const noexcept { return size_; }
  GlobalId position() const noexcept { return window_begin_ + static_cast<GlobalId>(next_); }
  GlobalId remaining() const noexcept { return size_ - position(); }
  bool at_end() const noexcept { return position() >= size_; }

  void seek(GlobalId position);
  /// Number of the line that starts here, counted from 1; kept right by read_line() and skip_lines() alone.
  GlobalId line_number() const noexcept { return line_number_; }
  void set_line_number(GlobalId line) noexcept { line_number_ = line; }

  /// The next line without its end; valid until the next call. The file must not be at its end.
  std::string_view read_line();
  /// Goes over lines; false where the file ends before.
  bool skip_lines(GlobalId count);
  /// Copies bytes; the file must have them.
  void read_bytes(void* target, GlobalId count);
  template <class T>
  T read_value() {
    T value;
    read_bytes(&value, sizeof(T));
    return value;
  }
  /// Goes behind the next occurrence of the text; false where there is none.
  bool skip_behind(std::string_view text);

  /// From now on keeps the offset of each line 1, 1 + index_step, ... that is passed. Call at the start of the file.
  void index_lines() { line_index_.assign(1, 0); }
  std::vector<GlobalId> take_line_index() { return std::move(line_index_); }
  /// Goes to the start of a line by an index made before.
  void seek_line(GlobalId line, const std::vector<GlobalId>& line_index);

  [[noreturn]] void fail_at_line(GlobalId line, const std::string& what) const;
  [[noreturn]] void fail_at_byte(GlobalId position, const std::string& what) const;

 private:
  bool refill();  ///< more bytes behind those unread; false at the end of the file
  void pass_line_end();

  std::string path_;
  int descriptor_ = -1;
  GlobalId size_ = 0;
  std::vector<char> window_;
  GlobalId window_begin_ = 0;  ///< file position of window_[0]
  std::size_t next_ = 0;       ///< first unread byte of the window
  std::size_t filled_ = 0;
  GlobalId line_number_ = 1;
  std::vector<GlobalId> line_index_;
};

/// The values of one line of text.
class LineFields {
 public:
  /// what: names the record in messages, such as "a node".
  LineFields(const FileReader& file, GlobalId line_number, std::string_view line, const char* what)
      : file_(file), line_number_(line_number), rest_(line), what_(what) {}

  template <class T>
  T get() {
    skip_blanks();
    T value{};
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    const bool ends_well = end == rest_.data() + rest_.size() || is_blank(*end);
    if (error != std::errc() || !ends_well) fail_on_value();
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    return value;
  }
  bool has_more() {
    skip_blanks();
    return !rest_.empty();
  }
  std::string_view rest() const noexcept { return rest_; }
  void expect_end() {
    if (has_more()) fail("'" + shortened(rest_) + "' is too much for " + what_);
  }
  [[noreturn]] void fail(const std::string& what) const { file_.fail_at_line(line_number_, what); }

 private:
  static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
  void skip_blanks() {
    while (!rest_.empty() && is_blank(rest_.front())) rest_.remove_prefix(1);
  }
  static std::string shortened(std::string_view text);
  [[noreturn]] void fail_on_value() const;

  const FileReader& file_;
  GlobalId line_number_;
  std::string_view rest_;
  const char* what_;
};

}  // namespace malleus
