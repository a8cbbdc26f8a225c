#include "case/values.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/text.hpp"
#include "base/units.hpp"
#include "case/case_file.hpp"

namespace malleus {
namespace {

std::string with_unit(const std::string& number, const std::string& unit) {
  return unit.empty() ? number : number + " " + unit;
}

/// The unit of a key. Values are written in it as they are held, in SI.
Unit coherent_unit(std::string_view text) {
  Unit unit = parse_unit(text);
  check(unit.numerator == 1 && unit.denominator == 1 && unit.offset == 0, "the unit of a key must be coherent SI");
  return unit;
}

/// A whole number, also as 3e5, within [lowest, highest].
GlobalId read_whole(std::string_view raw, GlobalId lowest, GlobalId highest) {
  const Quantity quantity = parse_quantity(without_quotes(raw), Unit{});
  constexpr Real exactly_held = 9007199254740992;  // 2^53
  const bool fits = std::abs(quantity.value) <= exactly_held && quantity.value >= static_cast<Real>(lowest) &&
                    quantity.value <= static_cast<Real>(highest);
  if (!fits || quantity.value != std::floor(quantity.value)) {
    throw InputError(fmt::format("'{}' is not a whole number{}", raw, fits ? "" : " of this range"));
  }
  return static_cast<GlobalId>(quantity.value);
}

/// [days-]hours:minutes:seconds -> seconds; nothing where the text has another form.
std::optional<Real> read_clock(std::string_view text) {
  Real days = 0;
  if (const std::size_t dash = text.find('-'); dash != std::string_view::npos && dash > 0) {
    std::string_view number = text.substr(0, dash);
    const auto value = take_real(number);
    if (!value || !number.empty()) return {};
    days = *value;
    text.remove_prefix(dash + 1);
  }
  std::array<Real, 3> parts = {};
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto value = take_real(text);
    const bool is_last = i + 1 == parts.size();
    if (!value || !(*value >= 0) || (i > 0 && !(*value < 60))) return {};
    if (is_last != text.empty() || (!is_last && text.front() != ':')) return {};
    if (!is_last) text.remove_prefix(1);
    parts[i] = *value;
  }
  return ((days * 24 + parts[0]) * 60 + parts[1]) * 60 + parts[2];
}

std::size_t count_letters_of_word(std::string_view text, std::string_view word) {
  if (!text.starts_with(word)) return 0;
  const bool ends = text.size() == word.size() || text[word.size()] == ' ' || text[word.size()] == '\t';
  return ends ? word.size() : 0;
}

/// Whether the text looks like a number with a unit rather than a formula: a number, then a letter.
bool looks_like_quantity(std::string_view text) {
  std::string_view rest = text;
  if (!take_real(rest)) return false;
  rest = trim(rest);
  return rest.empty() || std::isalpha(static_cast<unsigned char>(rest.front())) != 0;
}

}  // namespace

Converter<Real> real_converter(std::string_view unit) {
  const Unit wanted = coherent_unit(unit);
  const std::string unit_text(unit);
  return {"number", unit_text,
          [wanted](std::string_view raw, Key& key) {
            Quantity quantity = parse_quantity(without_quotes(raw), wanted);
            key.exponents = std::move(quantity.exponents);
            return quantity.value;
          },
          [unit_text](const Real& value) { return with_unit(format_real(value), unit_text); }};
}

Converter<int> integer_converter() {
  using Limits = std::numeric_limits<int>;
  return {"whole number", "",
          [](std::string_view raw, Key&) { return static_cast<int>(read_whole(raw, Limits::min(), Limits::max())); },
          [](const int& value) { return std::to_string(value); }};
}

Converter<GlobalId> count_converter() {
  using Limits = std::numeric_limits<GlobalId>;
  return {"whole number", "", [](std::string_view raw, Key&) { return read_whole(raw, Limits::min(), Limits::max()); },
          [](const GlobalId& value) { return std::to_string(value); }};
}

Converter<bool> flag_converter() {
  const auto read = [](std::string_view raw, Key&) {
    static const std::vector<std::string> words = {"yes", "true", "on", "no", "false", "off", "1", "0"};
    const std::string_view word = without_quotes(raw);
    for (const std::string_view known : {"yes", "true", "on", "1"}) {
      if (word == known) return true;
    }
    for (const std::string_view known : {"no", "false", "off", "0"}) {
      if (word == known) return false;
    }
    throw InputError(fmt::format("expected yes or no{}", did_you_mean(word, words)));
  };
  return {"yes | no", "", read, [](const bool& value) { return std::string(value ? "yes" : "no"); }};
}

Converter<std::string> string_converter() {
  const auto write = [](const std::string& value) {
    const bool needs_quotes = value.find_first_of(";#") != std::string::npos || trim(value) != value;
    return needs_quotes ? fmt::format("\"{}\"", value) : value;
  };
  return {"text", "", [](std::string_view raw, Key&) { return std::string(without_quotes(raw)); }, write};
}

Converter<std::vector<std::string>> words_converter() {
  const auto write = [](const std::vector<std::string>& words) {
    std::vector<std::string> quoted = words;
    for (std::string& word : quoted) {
      if (word.find_first_of(" \t;#") != std::string::npos) word = fmt::format("\"{}\"", word);
    }
    return join(quoted, " ");
  };
  return {"list of words", "", [](std::string_view raw, Key&) { return split_words(raw); }, write};
}

Converter<Real> duration_converter() {
  const Unit seconds = parse_unit("s");
  const auto read = [seconds](std::string_view raw, Key&) {
    const std::string_view text = without_quotes(raw);
    if (const auto clock = read_clock(text)) return *clock;
    if (text.find(':') != std::string_view::npos) {
      throw InputError("expected hours:minutes:seconds as in 23:45:00, or a number with a unit as in 2 h");
    }
    return parse_quantity(text, seconds).value;
  };
  return {"duration", "s", read, [](const Real& value) { return with_unit(format_real(value), "s"); }};
}

Converter<std::array<Real, 3>> vector_converter(std::string_view unit) {
  const Unit wanted = coherent_unit(unit);
  const std::string unit_text(unit);
  const auto read = [wanted](std::string_view raw, Key& key) {
    const auto numbers = parse_quantities(without_quotes(raw), wanted);
    if (numbers.size() != 2 && numbers.size() != 3) {
      throw InputError(fmt::format("{} number(s), expected two or three", numbers.size()));
    }
    std::array<Real, 3> value = {};
    for (std::size_t i = 0; i < numbers.size(); ++i) value[i] = numbers[i].value;
    key.components = static_cast<int>(numbers.size());
    return value;
  };
  const auto write = [unit_text](const std::array<Real, 3>& value) {
    return with_unit(fmt::format("{} {} {}", value[0], value[1], value[2]), unit_text);
  };
  return {"vector", unit_text, read, write};
}

Converter<std::array<std::optional<Real>, 3>> partial_vector_converter(std::string_view unit) {
  using Partial = std::array<std::optional<Real>, 3>;
  const Unit wanted = coherent_unit(unit);
  const std::string unit_text(unit);
  const auto read = [wanted](std::string_view raw, Key& key) {
    std::string_view rest = trim(without_quotes(raw));
    std::vector<std::optional<Real>> numbers;
    while (!(rest.starts_with("1/") && !numbers.empty())) {
      if (const std::size_t letters = count_letters_of_word(rest, "free"); letters > 0) {
        numbers.emplace_back();
        rest = trim(rest.substr(letters));
      } else if (const auto number = take_real(rest)) {
        numbers.emplace_back(*number);
        rest = trim(rest);
      } else {
        break;
      }
    }
    if (numbers.size() != 2 && numbers.size() != 3) {
      throw InputError(
          fmt::format("{} component(s), expected two or three numbers or 'free', then a unit", numbers.size()));
    }
    Partial value;
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      if (numbers[i]) value[i] = convert_to_si(*numbers[i], rest, wanted).value;
      if (!numbers[i] && !rest.empty()) convert_to_si(0, rest, wanted);
    }
    key.components = static_cast<int>(numbers.size());
    return value;
  };
  const auto write = [unit_text](const Partial& value) {
    std::vector<std::string> words;
    for (const auto& component : value) words.push_back(component ? format_real(*component) : "free");
    return with_unit(join(words, " "), unit_text);
  };
  return {"vector, or 'free' for a free component", unit_text, read, write};
}

namespace {

Converter<Expression> formula_converter(std::string_view unit, Expression (*parse)(std::string_view),
                                        const std::string& type) {
  const Unit wanted = coherent_unit(unit);
  const auto read = [wanted, parse](std::string_view raw, Key&) {
    const std::string_view text = trim(without_quotes(raw));
    std::optional<InputError> not_a_number;
    try {
      return Expression(parse_quantity(text, wanted).value);
    } catch (const InputError& error) {
      not_a_number = error;
    }
    try {
      return parse(text);
    } catch (const InputError&) {
      if (looks_like_quantity(text)) throw InputError(*not_a_number);
      throw;
    }
  };
  const std::string unit_text(unit);
  const auto write = [unit_text](const Expression& value) {
    return value.is_constant() ? with_unit(format_real(value({}, 0)), unit_text) : fmt::format("\"{}\"", value.text());
  };
  return {type, unit_text, read, write};
}

}  // namespace

Converter<Expression> expression_converter(std::string_view unit) {
  return formula_converter(unit, &Expression::parse, "number or expression");
}

Converter<Expression> temperature_formula_converter(std::string_view unit) {
  return formula_converter(unit, &Expression::parse_of_temperature, "number or expression of the temperature T (K)");
}

Converter<std::filesystem::path> path_converter() {
  const auto read = [](std::string_view raw, Key& key) {
    const std::filesystem::path given(without_quotes(raw));
    return given.is_absolute() ? given : (key.case_directory / given).lexically_normal();
  };
  return {"path", "", read, [](const std::filesystem::path& value) { return value.string(); }};
}

Converter<std::size_t> choice_converter(std::vector<std::string> names) {
  const auto read = [names](std::string_view raw, Key&) {
    const auto found = std::find(names.begin(), names.end(), without_quotes(raw));
    if (found == names.end()) {
      throw InputError(
          fmt::format("expected one of {}{}", join(names, " | "), did_you_mean(without_quotes(raw), names)));
    }
    return static_cast<std::size_t>(found - names.begin());
  };
  return {join(names, " | "), "", read, [names](const std::size_t& index) { return names.at(index); }};
}

}  // namespace malleus
