#include "case/section.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.hpp"
#include "base/text.hpp"

namespace malleus {

Section::Section(std::string title, const CaseSection* source, std::filesystem::path case_directory, Level level)
    : title_(std::move(title)), source_(source), case_directory_(std::move(case_directory)), level_(level) {}

Key& Section::add(std::string_view name, std::string_view type, std::string_view unit, std::string_view text) {
  const bool is_new = std::none_of(keys_.begin(), keys_.end(), [&](const Key& key) { return key.name == name; });
  check(is_new, "a key of a case section is bound twice");
  Key& key = keys_.emplace_back();
  key.name = name;
  key.type = type;
  key.unit = unit;
  key.text = text;
  key.level = level_;
  key.case_directory = case_directory_;
  return key;
}

KeyOf<Real> Section::real(std::string_view name, Real& member, std::string_view unit, std::string_view text) {
  return custom(name, member, real_converter(unit), text);
}

KeyOf<Real> Section::real(std::string_view name, std::optional<Real>& member, std::string_view unit,
                          std::string_view text) {
  return custom(name, member, real_converter(unit), text);
}

KeyOf<int> Section::integer(std::string_view name, int& member, std::string_view text) {
  return custom(name, member, integer_converter(), text);
}

KeyOf<int> Section::integer(std::string_view name, std::optional<int>& member, std::string_view text) {
  return custom(name, member, integer_converter(), text);
}

KeyOf<GlobalId> Section::count(std::string_view name, GlobalId& member, std::string_view text) {
  return custom(name, member, count_converter(), text);
}

KeyOf<GlobalId> Section::count(std::string_view name, std::optional<GlobalId>& member, std::string_view text) {
  return custom(name, member, count_converter(), text);
}

KeyOf<bool> Section::flag(std::string_view name, bool& member, std::string_view text) {
  return custom(name, member, flag_converter(), text);
}

KeyOf<std::string> Section::string(std::string_view name, std::string& member, std::string_view text) {
  return custom(name, member, string_converter(), text);
}

KeyOf<std::string> Section::string(std::string_view name, std::optional<std::string>& member, std::string_view text) {
  return custom(name, member, string_converter(), text);
}

KeyOf<std::vector<std::string>> Section::words(std::string_view name, std::vector<std::string>& member,
                                               std::string_view text) {
  return custom(name, member, words_converter(), text);
}

KeyOf<Real> Section::duration(std::string_view name, std::optional<Real>& member, std::string_view text) {
  return custom(name, member, duration_converter(), text).at_least(0);
}

KeyOf<std::array<Real, 3>> Section::vector(std::string_view name, std::array<Real, 3>& member, std::string_view unit,
                                           std::string_view text) {
  auto key = custom(name, member, vector_converter(unit), text);
  keys_.back().is_vector = true;
  return key;
}

KeyOf<std::array<Real, 3>> Section::vector(std::string_view name, std::optional<std::array<Real, 3>>& member,
                                           std::string_view unit, std::string_view text) {
  auto key = custom(name, member, vector_converter(unit), text);
  keys_.back().is_vector = true;
  return key;
}

KeyOf<std::array<std::optional<Real>, 3>> Section::partial_vector(
    std::string_view name, std::optional<std::array<std::optional<Real>, 3>>& member, std::string_view unit,
    std::string_view text) {
  auto key = custom(name, member, partial_vector_converter(unit), text);
  keys_.back().is_vector = true;
  return key;
}

KeyOf<Expression> Section::expression(std::string_view name, Expression& member, std::string_view unit,
                                      std::string_view text) {
  return custom(name, member, expression_converter(unit), text);
}

KeyOf<Expression> Section::expression(std::string_view name, std::optional<Expression>& member, std::string_view unit,
                                      std::string_view text) {
  return custom(name, member, expression_converter(unit), text);
}

KeyOf<Expression> Section::temperature_formula(std::string_view name, std::optional<Expression>& member,
                                               std::string_view unit, std::string_view text) {
  return custom(name, member, temperature_formula_converter(unit), text);
}

void Section::expressions(std::string_view name, std::array<std::optional<Expression>, 3>& members,
                          std::string_view unit, std::string_view text) {
  for (std::size_t i = 0; i < members.size(); ++i) {
    auto key = expression(fmt::format("{}_{}", name, "xyz"[i]), members[i], unit, text);
    if (i == 2) key.only_in_3d();
  }
}

KeyOf<std::filesystem::path> Section::path(std::string_view name, std::filesystem::path& member,
                                           std::string_view text) {
  auto key = custom(name, member, path_converter(), text);
  keys_.back().path_rule = PathRule::any;
  return key;
}

const CaseEntry* Section::entry(std::string_view key) const {
  if (source_ == nullptr) return nullptr;
  const auto found = std::find_if(source_->entries.begin(), source_->entries.end(),
                                  [&](const CaseEntry& candidate) { return candidate.key == key; });
  return found == source_->entries.end() ? nullptr : &*found;
}

Place Section::place() const {
  return source_ != nullptr ? source_->place : Place{};
}

bool Section::given(std::string_view key) const {
  return entry(key) != nullptr;
}

void Section::fail(std::string_view key, const std::string& message) {
  const CaseEntry* found = entry(key);
  const std::string what = found != nullptr ? fmt::format("{} = {}", key, found->value) : std::string(key);
  mistakes_.add(found != nullptr ? found->place : place(), fmt::format("[{}] {}: {}", title_, what, message));
}

void Section::fail(const std::string& message) {
  mistakes_.add(place(), fmt::format("[{}] {}", title_, message));
}

void Section::require(std::string_view key, std::string_view why) {
  if (!given(key)) fail(fmt::format("needs '{}' ({})", key, why));
}

void Section::refuse(std::string_view key, std::string_view why) {
  out_of_force_.emplace_back(key);
  if (given(key)) fail(key, fmt::format("not allowed here ({})", why));
}

void Section::require_one_of(std::initializer_list<std::string_view> keys) {
  const std::vector<std::string> names(keys.begin(), keys.end());
  const auto n_given = std::count_if(keys.begin(), keys.end(), [&](std::string_view key) { return given(key); });
  if (n_given == 0) fail(fmt::format("needs one of {}", join(names)));
  refuse_more_than_one_of(keys);
}

void Section::refuse_more_than_one_of(std::initializer_list<std::string_view> keys) {
  const std::vector<std::string> names(keys.begin(), keys.end());
  std::string_view first;
  for (const std::string_view key : keys) {
    if (!given(key)) {
      out_of_force_.emplace_back(key);
      continue;
    }
    if (first.empty()) {
      first = key;
    } else {
      fail(key, fmt::format("only one of {} may be given, and {} is", join(names), first));
    }
  }
}

bool Section::is_out_of_force(std::string_view key) const {
  return std::find(out_of_force_.begin(), out_of_force_.end(), key) != out_of_force_.end();
}

void Section::read_value(Key& key, const CaseEntry& entry) {
  const std::string_view raw = entry.value;
  const bool is_broken = raw.empty() || std::count(raw.begin(), raw.end(), '"') % 2 != 0;
  if (is_broken) return;  // the case file has reported it
  key.source = fmt::format("{}: [{}] {}", entry.place.text(), title_, key.name);
  try {
    key.assign(raw);
  } catch (const InputError& error) {
    fail(key.name, error.what());
    has_wrong_value_ = true;
  }
}

void Section::read_values() {
  for (Key& key : keys_) {
    const CaseEntry* found = entry(key.name);
    if (found != nullptr) {
      read_value(key, *found);
    } else if (key.is_required) {
      fail(fmt::format("needs '{}': {} ({})", key.name, key.text, key.allowed()));
    }
  }
  for (const Key& key : keys_) {
    const std::string fault = key.fault_of_exponents ? key.fault_of_exponents() : "";
    if (!fault.empty()) fail(key.name, fault);
  }
}

}  // namespace malleus
