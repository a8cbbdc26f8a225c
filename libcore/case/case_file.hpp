#pragma once

/// The text of a case: sections, keys and values with their places, before any meaning is given to them.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus {

/// Where something was written. Line 0: not in a file (the command line, what targets led to), or nowhere in
/// particular; no file: the case as a whole.
struct Place {
  std::string file;  ///< as the user named it
  int line = 0;

  bool is_command_line() const { return line == 0; }
  std::string text() const;  ///< "case.ini:12", "command line"
};

/// A mistake of the user with its place.
struct Mistake {
  Place place;
  std::string message;
};

/// Mistakes in the order in which they were found.
class Mistakes {
 public:
  void add(const Place& place, std::string message);
  void add(const Mistakes& others);
  bool empty() const { return list_.empty(); }
  const std::vector<Mistake>& list() const { return list_; }
  /// Throws one InputError with all of them in the order of the file, if there are any; those of the command line and
  /// of the case as a whole come last.
  void throw_if_any(const std::filesystem::path& case_path) const;

 private:
  std::vector<Mistake> list_;
};

struct CaseEntry {
  std::string key;
  std::string value;  ///< as written, trimmed, without comment, with its quotes
  Place place;
};

/// `[kind]` or `[kind.name]`; the kind is empty where the title was malformed (and is reported as a mistake).
struct CaseSection {
  std::string kind;
  std::string name;
  Place place;
  std::vector<CaseEntry> entries;  ///< in the order of the file

  std::string title() const { return name.empty() ? kind : kind + "." + name; }
};

/// A parsed case file. Text in double quotes may hold `;` and `#`, which else start a comment at the start of a line or
/// after white space. A section or key given twice is a mistake. Parsing never stops at a mistake: all are collected.
class CaseFile {
 public:
  /// Reads the file on the root and parses it on every rank. overrides: SECTION.KEY=VALUE, later ones win. Throws
  /// InputError where the file cannot be read. Collective.
  static CaseFile read(const Communicator& comm, const std::filesystem::path& path,
                       const std::vector<std::string>& overrides = {});

  /// Parses text; `path` is for messages and for paths relative to the case. Local.
  static CaseFile parse(std::string_view text, const std::filesystem::path& path,
                        const std::vector<std::string>& overrides = {});

  const std::filesystem::path& path() const { return path_; }
  const std::vector<CaseSection>& sections() const { return sections_; }
  /// Gives a key, or another value to it: SECTION.KEY=VALUE. origin: who says so, for messages and case.resolved.ini.
  /// What is wrong with it becomes a mistake. Local.
  void set(const std::string& assignment, const std::string& origin);

  const Mistakes& mistakes() const { return mistakes_; }
  /// Null where the file has no such section or key.
  const CaseSection* find(std::string_view kind, std::string_view name = "") const;
  const CaseEntry* find_entry(std::string_view kind, std::string_view name, std::string_view key) const;

 private:
  void parse_line(std::string_view line, const Place& place);
  void open_section(std::string_view title, const Place& place);
  std::string nearest_sibling(std::string_view kind, std::string_view name) const;

  std::filesystem::path path_;
  std::vector<CaseSection> sections_;
  Mistakes mistakes_;
  CaseSection* open_ = nullptr;  ///< only while parsing
};

/// The value without its quotes, where it is quoted as a whole.
std::string_view without_quotes(std::string_view value);

}  // namespace malleus
