#include "case/case_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <iterator>
#include <limits>
#include <utility>

#include "base/error.hpp"
#include "base/text.hpp"
#include "parallel/agreement.hpp"

namespace malleus {
namespace {

constexpr std::uintmax_t largest_case_bytes = 16U << 20U;

std::string read_text(const std::filesystem::path& path) {
  std::error_code failure;
  const std::string name = path.string();
  if (!std::filesystem::exists(path, failure)) throw InputError(fmt::format("{}: no such file", name));
  if (!std::filesystem::is_regular_file(path, failure)) {
    throw InputError(fmt::format("{}: not a file; expected a case file", name));
  }
  if (std::filesystem::file_size(path, failure) > largest_case_bytes) {
    throw InputError(fmt::format("{}: larger than {} MiB; expected a case file", name, largest_case_bytes >> 20U));
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw InputError(fmt::format("{}: cannot be read (permissions?)", name));
  std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  if (stream.bad()) throw InputError(fmt::format("{}: reading failed", name));
  return text;
}

/// The line up to a comment: `;` or `#` outside quotes, first or after white space.
std::string_view without_comment(std::string_view line) {
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"') quoted = !quoted;
    const bool marks = line[i] == ';' || line[i] == '#';
    const bool starts = i == 0 || line[i - 1] == ' ' || line[i - 1] == '\t';
    if (marks && starts && !quoted) return line.substr(0, i);
  }
  return line;
}

bool is_name_letter(char letter) {
  const auto code = static_cast<unsigned char>(letter);
  return std::isalnum(code) != 0 || letter == '_' || letter == '-' || code >= 0x80;
}

bool is_name(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), is_name_letter);
}

/// A name, or names joined by dots as in `link.0-1`.
bool is_key(std::string_view text) {
  while (true) {
    const std::size_t dot = text.find('.');
    if (!is_name(text.substr(0, dot))) return false;
    if (dot == std::string_view::npos) return true;
    text.remove_prefix(dot + 1);
  }
}

/// Readable form of what was found, for messages.
std::string shown(std::string_view text) {
  constexpr std::size_t longest = 60;
  std::string result(text.substr(0, longest));
  for (char& letter : result) {
    const auto code = static_cast<unsigned char>(letter);
    if (code < 0x20 || code == 0x7f) letter = '?';
  }
  return text.size() > longest ? result + "..." : result;
}

/// What is wrong with a value, or empty.
std::string fault_of_value(std::string_view value) {
  if (value.empty()) return "has no value";
  if (std::count(value.begin(), value.end(), '"') % 2 != 0) return "has an unclosed quote";
  return {};
}

}  // namespace

std::string Place::text() const {
  return is_command_line() ? file : fmt::format("{}:{}", file, line);
}

void Mistakes::add(const Place& place, std::string message) {
  Mistake& mistake = list_.emplace_back();
  mistake.place = place;
  mistake.message = std::move(message);
}

void Mistakes::add(const Mistakes& others) {
  list_.insert(list_.end(), others.list_.begin(), others.list_.end());
}

void Mistakes::throw_if_any(const std::filesystem::path& case_path) const {
  if (list_.empty()) return;
  const auto line_of = [](const Mistake& mistake) {
    return mistake.place.is_command_line() ? std::numeric_limits<int>::max() : mistake.place.line;
  };
  std::vector<Mistake> sorted = list_;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [&](const Mistake& a, const Mistake& b) { return line_of(a) < line_of(b); });
  std::string text;
  if (sorted.size() > 1) text = fmt::format("{} mistakes in {}\n  ", sorted.size(), case_path.string());
  for (const Mistake& mistake : sorted) {
    if (&mistake != sorted.data()) text += "\n  ";
    const std::string place = mistake.place.file.empty() ? case_path.string() : mistake.place.text();
    text += fmt::format("{}: {}", place, mistake.message);
  }
  throw InputError(text);
}

std::string_view without_quotes(std::string_view value) {
  const bool whole = value.size() >= 2 && value.front() == '"' && value.find('"', 1) == value.size() - 1;
  return whole ? value.substr(1, value.size() - 2) : value;
}

CaseFile CaseFile::read(const Communicator& comm, const std::filesystem::path& path,
                        const std::vector<std::string>& overrides) {
  std::string text;
  on_root(comm, [&] { text = read_text(path); });
  comm.broadcast(text);
  return parse(text, path, overrides);
}

CaseFile CaseFile::parse(std::string_view text, const std::filesystem::path& path,
                         const std::vector<std::string>& overrides) {
  CaseFile file;
  file.path_ = path;
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
  if (text.find('\0') != std::string_view::npos) {
    file.mistakes_.add(Place{path.string(), 1}, "not a text file in ASCII or UTF-8 (it holds zero bytes)");
    return file;
  }
  for (int line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    file.parse_line(text.substr(0, end), {path.string(), line});
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  file.open_ = nullptr;
  for (const std::string& assignment : overrides) file.set(assignment, "command line");
  return file;
}

const CaseSection* CaseFile::find(std::string_view kind, std::string_view name) const {
  const auto found = std::find_if(sections_.begin(), sections_.end(), [&](const CaseSection& section) {
    return section.kind == kind && section.name == name;
  });
  return found == sections_.end() ? nullptr : &*found;
}

const CaseEntry* CaseFile::find_entry(std::string_view kind, std::string_view name, std::string_view key) const {
  const CaseSection* section = find(kind, name);
  if (section == nullptr) return nullptr;
  const auto found = std::find_if(section->entries.begin(), section->entries.end(),
                                  [&](const CaseEntry& entry) { return entry.key == key; });
  return found == section->entries.end() ? nullptr : &*found;
}

void CaseFile::open_section(std::string_view title, const Place& place) {
  const std::size_t dot = title.find('.');
  const std::string kind(trim(title.substr(0, dot)));
  const std::string name(dot == std::string_view::npos ? "" : trim(title.substr(dot + 1)));
  const bool is_well_formed = is_name(kind) && (dot == std::string_view::npos || is_name(name));
  if (!is_well_formed) {
    mistakes_.add(place, fmt::format("'[{}]' is no section; expected [section] or [section.NAME] with letters, "
                                     "digits, '_' and '-'",
                                     shown(title)));
  } else if (const CaseSection* earlier = find(kind, name)) {
    mistakes_.add(place,
                  fmt::format("section [{}] is given twice, first at {}", earlier->title(), earlier->place.text()));
  }
  sections_.push_back({is_well_formed ? kind : "", is_well_formed ? name : "", place, {}});
  open_ = &sections_.back();
}

void CaseFile::parse_line(std::string_view line, const Place& place) {
  line = trim(without_comment(trim(line)));
  if (line.empty()) return;
  if (line.front() == '[') {
    const std::size_t end = line.find(']');
    if (end == std::string_view::npos) {
      mistakes_.add(place, fmt::format("'{}': the closing ']' is missing", shown(line)));
    } else if (end + 1 != line.size()) {
      mistakes_.add(place, fmt::format("'{}': unexpected text after ']'", shown(line)));
    }
    open_section(line.substr(1, std::min(end, line.size()) - 1), place);
    return;
  }
  const std::size_t equals = line.find('=');
  const std::string key(trim(line.substr(0, equals)));
  if (equals == std::string_view::npos || !is_key(key)) {
    mistakes_.add(place, fmt::format("expected 'key = value' or '[section]', found '{}'", shown(line)));
    return;
  }
  if (open_ == nullptr) {
    mistakes_.add(place, fmt::format("key '{}' stands before the first [section]", key));
    return;
  }
  const std::string value(trim(line.substr(equals + 1)));
  if (const std::string fault = fault_of_value(value); !fault.empty()) {
    mistakes_.add(place, fmt::format("[{}] {} {}", open_->title(), key, fault));
  }
  const CaseEntry* earlier = find_entry(open_->kind, open_->name, key);
  if (earlier != nullptr) {
    mistakes_.add(place,
                  fmt::format("[{}] {} is given twice, first at {}", open_->title(), key, earlier->place.text()));
    return;
  }
  open_->entries.push_back({key, value, place});
}

/// "; did you mean 'body.billet'?" for a title near that of a section of the same kind. Short names and names that
/// differ in digits alone (probe.p1, probe.p2) are taken for new sections.
std::string CaseFile::nearest_sibling(std::string_view kind, std::string_view name) const {
  const auto without_digits = [](std::string_view text) {
    std::string letters;
    std::copy_if(text.begin(), text.end(), std::back_inserter(letters), [](char c) { return c < '0' || c > '9'; });
    return letters;
  };
  std::vector<std::string> siblings;
  for (const CaseSection& section : sections_) {
    const bool is_numbered = without_digits(section.name) == without_digits(name);
    if (section.kind == kind && !section.name.empty() && !is_numbered) siblings.push_back(section.name);
  }
  const std::string nearest = name.size() < 3 ? "" : nearest_name(name, siblings);
  return nearest.empty() ? "" : fmt::format("; did you mean '{}.{}'?", kind, nearest);
}

void CaseFile::set(const std::string& assignment, const std::string& origin) {
  const Place place = {origin, 0};
  const std::size_t equals = assignment.find('=');
  const std::string_view target = trim(std::string_view(assignment).substr(0, equals));
  const std::size_t dot = target.rfind('.');
  if (equals == std::string::npos || dot == std::string_view::npos || !is_name(target.substr(dot + 1))) {
    mistakes_.add(place, fmt::format("-D {}: expected SECTION.KEY=VALUE", shown(assignment)));
    return;
  }
  const std::string_view title = target.substr(0, dot);
  const std::size_t inner = title.find('.');
  const std::string kind(title.substr(0, inner));
  const std::string name(inner == std::string_view::npos ? "" : title.substr(inner + 1));
  const std::string key(target.substr(dot + 1));
  std::string value(trim(std::string_view(assignment).substr(equals + 1)));
  const bool is_unquoted = value.find('"') == std::string::npos;
  if (without_comment(value) != value && is_unquoted)
    value = fmt::format("\"{}\"", value);  // the shell took the quotes
  std::string fault = fault_of_value(value);
  if (without_comment(value) != value) fault = "holds ; or # outside quotes";
  if (value.find('\n') != std::string::npos) fault = "holds more than one line";
  if (!fault.empty()) mistakes_.add(place, fmt::format("[{}] {} {}", title, key, fault));
  auto section = std::find_if(sections_.begin(), sections_.end(),
                              [&](const CaseSection& s) { return s.kind == kind && s.name == name; });
  if (section == sections_.end()) {
    if (const std::string hint = nearest_sibling(kind, name); !hint.empty()) {
      mistakes_.add(place, fmt::format("the case has no section [{}]{}", title, hint));
      return;
    }
    open_section(title, place);
    section = std::prev(sections_.end());
  }
  auto entry =
      std::find_if(section->entries.begin(), section->entries.end(), [&](const CaseEntry& e) { return e.key == key; });
  if (entry == section->entries.end()) entry = section->entries.insert(entry, CaseEntry{key, {}, {}});
  entry->value = value;
  entry->place = place;
}

}  // namespace malleus
