#pragma once

/// One key of a case section: what a user may write, what it means, and how it reaches its variable.

#include <array>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/types.hpp"
#include "case/expression.hpp"

namespace malleus {

/// `[accuracy] level`: the preset of every knob that is not given by itself.
enum class Level { draft, standard, fine, reference };
inline constexpr int n_levels = 4;
inline constexpr std::array<std::string_view, n_levels> level_names = {"draft", "standard", "fine", "reference"};

/// What a key's value is the name of; names are looked up once all sections, or the mesh, are known.
enum class Reference { none, section, volume_group, surface_group };

/// What must be on disk under a path before the run.
enum class PathRule { none, any, existing_file, existing_directory };

/// An end of a range, in SI.
struct Limit {
  Real value = 0;
  bool is_included = true;
};

/// The description of a key, and the way from text to variable and back.
struct Key {
  std::string name;
  std::string type;  ///< "number", "a | b", ...
  std::string unit;
  std::string text;
  std::string starter;        ///< value in the template
  std::string empty_word;     ///< written for "no value": auto, none, ...
  std::string default_text;   ///< as case text
  std::string default_words;  ///< where the program works the default out
  std::array<std::string, n_levels> level_values;
  std::vector<std::string> choices;
  std::optional<Limit> lower;
  std::optional<Limit> upper;
  Level level = Level::standard;
  bool is_required = false;
  bool has_levels = false;
  bool is_vector = false;
  bool is_only_in_3d = false;
  Reference reference = Reference::none;
  std::string referred_section;
  PathRule path_rule = PathRule::none;
  std::filesystem::path case_directory;
  std::string source;  ///< "case.ini:12: [section] key" of the value being read

  // What was learnt from the value that was read.
  int components = 0;                     ///< of a vector
  std::map<std::string, Real> exponents;  ///< of a unit like MPa.s^0.3 for Pa.s^m
  std::function<std::string()> fault_of_exponents;

  std::function<void(std::string_view)> assign;  ///< throws InputError without place
  std::function<std::string()> print;            ///< the variable as case text; empty where it has no value

  std::string range() const;     ///< "(0, 1]", or empty
  void check_range(Real) const;  ///< throws InputError; NaN is outside every range
  std::string allowed() const;   ///< type, unit and range for messages and help
};

/// Reads and writes values of one type. `read` throws InputError without place and may note in the key what it learnt.
template <class T>
struct Converter {
  std::string type;
  std::string unit;
  std::function<T(std::string_view, Key&)> read;
  std::function<std::string(const T&)> write;
};

namespace detail {
template <class T>
struct IsOptional : std::false_type {};
template <class T>
struct IsOptional<std::optional<T>> : std::true_type {};

template <class T>
void check_numbers(const Key& key, const T& value) {
  if constexpr (std::is_same_v<T, Expression>) {
    if (value.is_constant()) key.check_range(value({}, 0));
  } else if constexpr (std::is_same_v<T, std::array<Real, 3>>) {
    for (int i = 0; i < key.components; ++i) key.check_range(value[static_cast<std::size_t>(i)]);
  } else if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
    key.check_range(static_cast<Real>(value));
  }
}
}  // namespace detail

/// What Section's functions return: adds to the description of a key. Ranges are in SI.
template <class T>
class KeyOf {
 public:
  KeyOf(Key& key, std::function<void(const T&)> set, std::function<std::string(const T&)> write)
      : key_(&key), set_(std::move(set)), write_(std::move(write)) {}

  /// The case must give it.
  KeyOf& required() {
    key_->is_required = true;
    return *this;
  }
  /// The template shows the key with this value, uncommented. Every required key without a usable default needs one.
  KeyOf& starter(std::string_view value) {
    key_->starter = value;
    return *this;
  }
  KeyOf& above(Real value) { return with_lower({value, false}); }
  KeyOf& at_least(Real value) { return with_lower({value, true}); }
  KeyOf& below(Real value) { return with_upper({value, false}); }
  KeyOf& at_most(Real value) { return with_upper({value, true}); }
  /// For keys whose default the program works out: how help calls it ("that of the case file").
  KeyOf& default_is(std::string_view words) {
    key_->default_words = words;
    return *this;
  }
  /// The default by `[accuracy] level`.
  KeyOf& by_level(const T& draft, const T& standard, const T& fine, const T& reference) {
    const std::array<const T*, n_levels> values = {&draft, &standard, &fine, &reference};
    for (std::size_t i = 0; i < values.size(); ++i) key_->level_values[i] = write_(*values[i]);
    key_->has_levels = true;
    set_(*values[static_cast<std::size_t>(key_->level)]);
    return *this;
  }
  /// For std::optional members: this word (auto, none) leaves the member without value.
  KeyOf& or_word(std::string_view word) {
    key_->empty_word = word;
    return *this;
  }
  /// The value (each word of a list) is the NAME of a section [kind.NAME] of this case.
  KeyOf& names_section(std::string_view kind) {
    key_->reference = Reference::section;
    key_->referred_section = kind;
    return *this;
  }
  /// The value is a physical group of the mesh: of its elements, or of its boundary. See CaseReader::check_mesh.
  KeyOf& names_volume_group() {
    key_->reference = Reference::volume_group;
    return *this;
  }
  KeyOf& names_surface_group() {
    key_->reference = Reference::surface_group;
    return *this;
  }
  /// A mistake where the mesh has two dimensions.
  KeyOf& only_in_3d() {
    key_->is_only_in_3d = true;
    return *this;
  }
  /// For paths: must exist before the run.
  KeyOf& existing_file() {
    key_->path_rule = PathRule::existing_file;
    return *this;
  }
  KeyOf& existing_directory() {
    key_->path_rule = PathRule::existing_directory;
    return *this;
  }
  /// For units with a symbolic power such as Pa.s^m: a unit given with a number (MPa.s^0.3) must agree with `value`,
  /// that of key `name` of the same section.
  KeyOf& exponent_is(std::string_view name, const Real& value);

 private:
  KeyOf& with_lower(Limit limit) {
    key_->lower = limit;
    return *this;
  }
  KeyOf& with_upper(Limit limit) {
    key_->upper = limit;
    return *this;
  }

  Key* key_;
  std::function<void(const T&)> set_;
  std::function<std::string(const T&)> write_;
};

/// What contradicts `value` in the exponents learnt from a unit, or empty.
std::string fault_of_exponents(const Key& key, std::string_view name, Real value);

template <class T>
KeyOf<T>& KeyOf<T>::exponent_is(std::string_view name, const Real& value) {
  key_->fault_of_exponents = [key = key_, other = std::string(name), &value] {
    return fault_of_exponents(*key, other, value);
  };
  return *this;
}

}  // namespace malleus
