#pragma once

/// Small text helpers of the readers: trimming, words, numbers, and the nearest known name for a misspelt one.
/// All local.

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// The view without leading and trailing white space.
std::string_view trim(std::string_view text);

/// Words apart by white space; text in double quotes is one word, without its quotes. An unclosed quote runs to the
/// end.
std::vector<std::string> split_words(std::string_view text);

/// "a, b, c".
std::string join(std::span<const std::string> words, std::string_view separator = ", ");

/// The shortest decimal text that reads back as the same double.
std::string format_real(Real value);

/// Reads a decimal number at the start of `text` and removes it from there. Nothing is read, and `text` stays, where no
/// finite decimal number starts (nan, inf, hexadecimal and overflowing numbers are none).
std::optional<Real> take_real(std::string_view& text);

/// The known name nearest to `word` in edit distance (insert, drop, change, swap of neighbours; letter case costs
/// nothing): one letter and a third of them may differ. Else the first name that `word` begins. Empty where none is
/// near.
std::string nearest_name(std::string_view word, std::span<const std::string> known);

/// "; did you mean 'x'?", or empty where no known name is near.
std::string did_you_mean(std::string_view word, std::span<const std::string> known);

}  // namespace malleus
