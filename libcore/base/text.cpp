#include "base/text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>

namespace malleus {
namespace {

constexpr std::string_view white_space = " \t\r\n\v\f";

bool is_digit(char letter) {
  return letter >= '0' && letter <= '9';
}

std::string in_lower_case(std::string_view text) {
  std::string lower(text);
  for (char& letter : lower) letter = static_cast<char>(std::tolower(static_cast<unsigned char>(letter)));
  return lower;
}

/// Optimal string alignment distance: Levenshtein with swaps of neighbours. Three rows of the table are kept.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::array<std::vector<std::size_t>, 3> rows;
  for (auto& row : rows) row.resize(b.size() + 1);
  auto& [before_last, last, current] = rows;
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    current[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      current[j] = std::min({last[j] + 1, current[j - 1] + 1, change});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) current[j] = std::min(current[j], before_last[j - 2] + 1);
    }
    std::swap(before_last, last);
    std::swap(last, current);
  }
  return last[b.size()];
}

}  // namespace

std::string_view trim(std::string_view text) {
  const std::size_t first = text.find_first_not_of(white_space);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(white_space) - first + 1);
}

std::vector<std::string> split_words(std::string_view text) {
  std::vector<std::string> words;
  for (text = trim(text); !text.empty(); text = trim(text)) {
    const bool quoted = text.front() == '"';
    if (quoted) text.remove_prefix(1);
    const std::size_t end = std::min(quoted ? text.find('"') : text.find_first_of(white_space), text.size());
    words.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + (quoted ? 1 : 0), text.size()));
  }
  return words;
}

std::string join(std::span<const std::string> words, std::string_view separator) {
  std::string text;
  for (const std::string& word : words) {
    if (&word != words.data()) text += separator;
    text += word;
  }
  return text;
}

std::string format_real(Real value) {
  return fmt::format("{}", value);
}

std::optional<Real> take_real(std::string_view& text) {
  std::string_view rest = text;
  if (!rest.empty() && rest.front() == '+') rest.remove_prefix(1);
  const std::size_t lead = !rest.empty() && rest.front() == '-' ? 1 : 0;
  const bool double_sign = lead == 1 && rest.data() != text.data();
  const bool decimal = rest.size() > lead && (is_digit(rest[lead]) || rest[lead] == '.');
  if (!decimal || double_sign) return {};
  Real value = 0;
  const auto [end, failure] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
  if (failure != std::errc() || !std::isfinite(value)) return {};
  text = std::string_view(end, static_cast<std::size_t>(rest.data() + rest.size() - end));
  return value;
}

std::string nearest_name(std::string_view word, std::span<const std::string> known) {
  constexpr std::size_t longest_compared = 64;
  constexpr std::size_t shortest_beginning = 3;
  if (word.size() > longest_compared) return {};
  const std::string lower = in_lower_case(word);
  std::string best;
  std::string continued;
  std::size_t limit = 2 + word.size() / 3;
  for (const std::string& name : known) {
    if (name.size() > longest_compared) continue;
    const std::string lower_name = in_lower_case(name);
    if (continued.empty() && lower.size() >= shortest_beginning && lower_name.starts_with(lower)) continued = name;
    const std::size_t distance = edit_distance(lower, lower_name);
    const bool shares_a_letter = distance < std::max(word.size(), name.size());
    if (distance >= limit || !shares_a_letter) continue;
    best = name;
    limit = distance;
  }
  return best.empty() ? continued : best;
}

std::string did_you_mean(std::string_view word, std::span<const std::string> known) {
  const std::string best = nearest_name(word, known);
  return best.empty() ? "" : fmt::format("; did you mean '{}'?", best);
}

}  // namespace malleus
