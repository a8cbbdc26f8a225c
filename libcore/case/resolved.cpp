#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "base/error.hpp"
#include "base/text.hpp"
#include "case/schema.hpp"

namespace malleus {
namespace {

bool lies_within(const std::filesystem::path& inner, const std::filesystem::path& outer) {
  const auto [rest_of_outer, rest_of_inner] = std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end());
  return rest_of_outer == outer.end() || (rest_of_outer->empty() && std::next(rest_of_outer) == outer.end());
}

/// The path as the new file must name it. What was absolute stays so. What was relative to the case stays relative
/// where the output lies beside the case or below it, so that the whole may be moved; else it becomes absolute.
std::string moved_path(const std::string& value, const std::filesystem::path& case_directory,
                       const std::filesystem::path& output_directory) {
  const std::filesystem::path given(without_quotes(value));
  if (given.is_absolute()) return value;
  const std::filesystem::path here = ".";
  const auto from = std::filesystem::absolute(case_directory.empty() ? here : case_directory).lexically_normal();
  const auto to = std::filesystem::absolute(output_directory).lexically_normal();
  const auto target = (from / given).lexically_normal();
  const std::string moved = (lies_within(to, from) ? target.lexically_relative(to) : target).string();
  const bool needs_quotes = moved.find_first_of(";#") != std::string::npos;
  return needs_quotes ? fmt::format("\"{}\"", moved) : moved;
}

/// A vector that nobody gave is printed with three components; a mesh of two dimensions takes two.
std::string without_third_component(const std::string& value) {
  std::vector<std::string> words = split_words(value);
  if (words.size() >= 3) words.erase(words.begin() + 2);
  return join(words, " ");
}

}  // namespace

void CaseReader::record(std::string_view section, std::string_view key, const std::string& value,
                        std::string_view origin) {
  const auto found = std::find_if(in_force_.begin(), in_force_.end(), [&](const InForce& candidate) {
    return candidate.section == section && candidate.key == key;
  });
  check(found != in_force_.end(), "a resolved value of a key that is not in force");
  found->value = value;
  found->origin = origin;
}

std::string CaseReader::resolved(const std::filesystem::path& output_directory) const {
  constexpr std::size_t column = 52;
  std::string text =
      fmt::format("; Every key that was in force in {}, and where it came from.\n", file_.path().filename().string());
  std::string section;
  for (const InForce& item : in_force_) {
    if (item.value.empty()) continue;
    if (item.section != section) text += fmt::format("\n[{}]\n", item.section);
    section = item.section;
    std::string value = item.value;
    if (item.is_path) value = moved_path(value, directory(), output_directory);
    if (item.is_vector && !item.is_given && dimension_ == 2) value = without_third_component(value);
    const std::string line = fmt::format("{} = {}", item.key, value);
    text += line;
    text.append(line.size() < column ? column - line.size() : 1, ' ');
    text += fmt::format(" ; {}\n", item.origin);
  }
  return text;
}

}  // namespace malleus
