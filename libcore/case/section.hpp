#pragma once

/// Binds the keys of one section to the members of a struct. See schema.hpp for the whole picture and an example.

#include <array>
#include <deque>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "case/case_file.hpp"
#include "case/key.hpp"
#include "case/values.hpp"

namespace malleus {

/// What describe() and validate() of a section's struct talk to. All local; every rank does the same.
///
/// Each binding takes the key's name, the member (its value is the default; an std::optional member without value means
/// "not given"), the SI unit, and a text for help and documentation. Section names and keys are snake_case.
class Section {
 public:
  /// source: the section as it stands in the file, or null (defaults hold, or only a description is wanted).
  Section(std::string title, const CaseSection* source, std::filesystem::path case_directory, Level level);
  Section(const Section&) = delete;
  Section& operator=(const Section&) = delete;

  /// @name Bindings, for describe()
  /// @{
  KeyOf<Real> real(std::string_view name, Real& member, std::string_view unit, std::string_view text);
  KeyOf<Real> real(std::string_view name, std::optional<Real>& member, std::string_view unit, std::string_view text);
  KeyOf<int> integer(std::string_view name, int& member, std::string_view text);
  KeyOf<int> integer(std::string_view name, std::optional<int>& member, std::string_view text);
  KeyOf<GlobalId> count(std::string_view name, GlobalId& member, std::string_view text);
  KeyOf<GlobalId> count(std::string_view name, std::optional<GlobalId>& member, std::string_view text);
  KeyOf<bool> flag(std::string_view name, bool& member, std::string_view text);
  KeyOf<std::string> string(std::string_view name, std::string& member, std::string_view text);
  KeyOf<std::string> string(std::string_view name, std::optional<std::string>& member, std::string_view text);
  KeyOf<std::vector<std::string>> words(std::string_view name, std::vector<std::string>& member, std::string_view text);
  /// Wall time: seconds.
  KeyOf<Real> duration(std::string_view name, std::optional<Real>& member, std::string_view text);
  /// Two or three components, as the mesh has dimensions (see CaseReader::check_mesh); the third is 0 in 2D.
  KeyOf<std::array<Real, 3>> vector(std::string_view name, std::array<Real, 3>& member, std::string_view unit,
                                    std::string_view text);
  KeyOf<std::array<Real, 3>> vector(std::string_view name, std::optional<std::array<Real, 3>>& member,
                                    std::string_view unit, std::string_view text);
  /// The word `free` leaves a component without value.
  KeyOf<std::array<std::optional<Real>, 3>> partial_vector(std::string_view name,
                                                           std::optional<std::array<std::optional<Real>, 3>>& member,
                                                           std::string_view unit, std::string_view text);
  KeyOf<Expression> expression(std::string_view name, Expression& member, std::string_view unit, std::string_view text);
  KeyOf<Expression> expression(std::string_view name, std::optional<Expression>& member, std::string_view unit,
                               std::string_view text);
  /// A formula of the temperature T.
  KeyOf<Expression> temperature_formula(std::string_view name, std::optional<Expression>& member, std::string_view unit,
                                        std::string_view text);
  /// The keys name_x, name_y, name_z.
  void expressions(std::string_view name, std::array<std::optional<Expression>, 3>& members, std::string_view unit,
                   std::string_view text);
  /// The member is empty where nothing is given; else absolute or relative to the working directory.
  KeyOf<std::filesystem::path> path(std::string_view name, std::filesystem::path& member, std::string_view text);
  /// {"norton-hoff", Law::norton_hoff}, ...: every value that the enum can have.
  template <class Enum>
  requires std::is_enum_v<Enum> KeyOf<Enum> choice(std::string_view name, Enum& member,
                                                   std::vector<std::pair<std::string, Enum>> choices,
                                                   std::string_view text);
  template <class Enum>
  KeyOf<Enum> choice(std::string_view name, std::optional<Enum>& member,
                     std::vector<std::pair<std::string, Enum>> choices, std::string_view text);
  /// A type of the caller's own.
  template <class T, class Member>
  KeyOf<T> custom(std::string_view name, Member& member, const Converter<T>& converter, std::string_view text);
  /// @}

  /// @name For validate(): called once all keys of the section are read
  /// @{
  const std::string& title() const { return title_; }
  bool given(std::string_view key) const;
  /// A mistake at the line of the key (of the section where the key is not given).
  void fail(std::string_view key, const std::string& message);
  void fail(const std::string& message);
  /// A mistake where the key is not given; why: "law = power-law".
  void require(std::string_view key, std::string_view why);
  /// A mistake where the key is given; why: "law = newtonian". Its default is not in force then.
  void refuse(std::string_view key, std::string_view why);
  /// A mistake unless one, and only one, of the keys is given.
  void require_one_of(std::initializer_list<std::string_view> keys);
  /// A mistake where more than one of the keys is given.
  void refuse_more_than_one_of(std::initializer_list<std::string_view> keys);
  /// @}

  /// @name For CaseReader
  /// @{
  void read_values();
  /// Whether the struct's own validation makes sense: all values that are given could be read.
  bool may_validate() const { return !has_wrong_value_; }
  const std::deque<Key>& keys() const { return keys_; }
  const CaseEntry* entry(std::string_view key) const;
  /// Whether validation found that the key has no meaning here, so that its default is not in force.
  bool is_out_of_force(std::string_view key) const;
  const Mistakes& mistakes() const { return mistakes_; }
  /// @}

 private:
  template <class Enum, class Member>
  KeyOf<Enum> bind_choice(std::string_view name, Member& member, std::vector<std::pair<std::string, Enum>> choices,
                          std::string_view text);
  Key& add(std::string_view name, std::string_view type, std::string_view unit, std::string_view text);
  void read_value(Key& key, const CaseEntry& entry);
  Place place() const;

  std::string title_;
  const CaseSection* source_;
  std::filesystem::path case_directory_;
  Level level_;
  std::deque<Key> keys_;  ///< a deque: keys stay where they are while more are added
  Mistakes mistakes_;
  std::vector<std::string> out_of_force_;
  bool has_wrong_value_ = false;
};

template <class T, class Member>
KeyOf<T> Section::custom(std::string_view name, Member& member, const Converter<T>& converter, std::string_view text) {
  Key& key = add(name, converter.type, converter.unit, text);
  key.assign = [&member, &key, read = converter.read](std::string_view raw) {
    if constexpr (detail::IsOptional<Member>::value) {
      if (!key.empty_word.empty() && without_quotes(raw) == key.empty_word) {
        member.reset();
        return;
      }
    }
    T value = [&] {
      try {
        return read(raw, key);
      } catch (const InputError& error) {
        if (key.empty_word.empty()) throw;
        throw InputError(std::string(error.what()) + ", nor '" + key.empty_word + "'");
      }
    }();
    detail::check_numbers(key, value);
    if constexpr (std::is_same_v<T, Expression>) value.set_source(key.source);
    member = std::move(value);
  };
  key.print = [&, write = converter.write]() -> std::string {
    if constexpr (detail::IsOptional<Member>::value) {
      return member ? write(*member) : key.empty_word;
    } else {
      return write(member);
    }
  };
  return {key, [&member](const T& value) { member = value; }, converter.write};
}

template <class Enum>
requires std::is_enum_v<Enum> KeyOf<Enum> Section::choice(std::string_view name, Enum& member,
                                                          std::vector<std::pair<std::string, Enum>> choices,
                                                          std::string_view text) {
  return bind_choice(name, member, std::move(choices), text);
}

template <class Enum>
KeyOf<Enum> Section::choice(std::string_view name, std::optional<Enum>& member,
                            std::vector<std::pair<std::string, Enum>> choices, std::string_view text) {
  return bind_choice(name, member, std::move(choices), text);
}

template <class Enum, class Member>
KeyOf<Enum> Section::bind_choice(std::string_view name, Member& member,
                                 std::vector<std::pair<std::string, Enum>> choices, std::string_view text) {
  std::vector<std::string> names;
  for (const auto& choice : choices) names.push_back(choice.first);
  const Converter<std::size_t> index = choice_converter(names);
  Converter<Enum> converter;
  converter.type = index.type;
  converter.read = [index, choices](std::string_view raw, Key& key) { return choices[index.read(raw, key)].second; };
  converter.write = [choices](const Enum& value) -> std::string {
    for (const auto& [word, known] : choices) {
      if (known == value) return word;
    }
    return {};
  };
  KeyOf<Enum> key = custom(name, member, converter, text);
  keys_.back().choices = std::move(names);
  return key;
}

}  // namespace malleus
