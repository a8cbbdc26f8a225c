#pragma once

/// From the text of a value to its type and back: one converter a type. What `write` gives, `read` reads back to the
/// same value, bit for bit.

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "case/key.hpp"

namespace malleus {

Converter<Real> real_converter(std::string_view unit);
Converter<int> integer_converter();
Converter<GlobalId> count_converter();  ///< whole numbers, also written 3e5
Converter<bool> flag_converter();
Converter<std::string> string_converter();
Converter<std::vector<std::string>> words_converter();
/// Seconds: `90 s`, `2 h`, `23:45:00`, `1-12:00:00` (days), or a bare number of seconds.
Converter<Real> duration_converter();
/// Two or three numbers and a unit; the third is 0 where two are given.
Converter<std::array<Real, 3>> vector_converter(std::string_view unit);
/// The same with the word `free` where a component is left free.
Converter<std::array<std::optional<Real>, 3>> partial_vector_converter(std::string_view unit);
/// A number with unit, or a formula in SI, in quotes or without.
Converter<Expression> expression_converter(std::string_view unit);
/// The same with a formula of the temperature T [K].
Converter<Expression> temperature_formula_converter(std::string_view unit);
/// Relative paths are taken from the case file's directory.
Converter<std::filesystem::path> path_converter();
/// Index of the name among the choices.
Converter<std::size_t> choice_converter(std::vector<std::string> names);

}  // namespace malleus
