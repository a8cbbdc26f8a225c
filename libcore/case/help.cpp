#include "case/help.hpp"

#include <fmt/format.h>

#include "base/error.hpp"
#include "base/text.hpp"

namespace malleus {
namespace {

std::string default_of(const Key& key) {
  if (key.is_required) return "required";
  if (key.has_levels) return fmt::format("{} (by level)", join(key.level_values, " / "));
  if (!key.default_words.empty()) return key.default_words;
  return key.default_text.empty() ? "none" : key.default_text;
}

std::string note_on(const SectionDescription& description) {
  switch (description.occurrence) {
    case Occurrence::always:
      return "";
    case Occurrence::optional:
      return " (optional)";
    case Occurrence::repeated:
      return description.at_least > 0 ? fmt::format(" (repeated, at least {})", description.at_least) : " (repeated)";
  }
  return "";
}

std::string help_of(const SectionDescription& description) {
  std::string text = fmt::format("[{}]{}: {}\n", description.title(), note_on(description), description.text);
  for (const Key& key : description.keys) {
    const std::string value = key.is_required ? "required" : "default: " + default_of(key);
    text += fmt::format("  {:<20} {}; {}\n  {:<20} {}\n", key.name, key.allowed(), value, "", key.text);
  }
  return text;
}

std::string in_table(std::string_view text) {
  std::string cell;
  for (const char letter : text) {
    if (letter == '|') cell += '\\';
    cell += letter;
  }
  return cell;
}

/// Whether the template shows the section ready for use: an empty section that is always in force changes nothing.
bool is_active(const SectionDescription& description) {
  return description.occurrence == Occurrence::always || description.at_least > 0;
}

std::string template_of(const SectionDescription& description) {
  const bool active = is_active(description);
  const std::string kind = description.kind;
  const bool is_repeated = description.occurrence == Occurrence::repeated;
  std::string text = fmt::format("; {}{}\n{}[{}]\n", description.text, note_on(description), active ? "" : ";",
                                 is_repeated ? fmt::format("{0}.{0}1", kind) : kind);
  for (const Key& key : description.keys) {
    const std::string value = key.starter.empty() ? key.default_text : key.starter;
    const bool is_set = active && (key.is_required || !key.starter.empty());
    text += fmt::format("; {} ({}; {})\n", key.text, key.allowed(), default_of(key));
    text += fmt::format("{}{} = {}\n", is_set ? "" : ";", key.name, value);
  }
  return text;
}

}  // namespace

std::string help_text(const CaseReader& reader, std::string_view section) {
  const std::string_view kind = section.substr(0, section.find('.'));
  std::string text;
  std::vector<std::string> kinds;
  for (const SectionDescription& description : reader.descriptions()) {
    kinds.push_back(description.kind);
    if (!kind.empty() && description.kind != kind) continue;
    text += (text.empty() ? "" : "\n") + help_of(description);
  }
  if (text.empty()) {
    const std::string hint = did_you_mean(kind, kinds);
    throw InputError(fmt::format("--help-case: unknown section '{}'{}", section,
                                 hint.empty() ? "; known are " + join(kinds) : hint));
  }
  return text;
}

std::string template_text(const CaseReader& reader, std::string_view program) {
  std::string text = fmt::format(
      "; A starter case for {}. Lines that start with ';' are comments; ';key = value' shows a default.\n"
      "; A value may carry its unit (179.2 MPa, 5 mm/s); a bare number is SI.\n",
      program);
  for (const SectionDescription& description : reader.descriptions()) text += "\n" + template_of(description);
  return text;
}

std::string markdown_page(const CaseReader& reader, std::string_view program) {
  std::string text = fmt::format("# Case files of {}\n", program);
  for (const SectionDescription& description : reader.descriptions()) {
    text += fmt::format("\n## [{}]\n\n{}{}\n", description.title(), description.text, note_on(description));
    if (description.keys.empty()) continue;
    text += "\n| key | value | default | meaning |\n| --- | --- | --- | --- |\n";
    for (const Key& key : description.keys) {
      text += fmt::format("| `{}` | {} | {} | {} |\n", key.name, in_table(key.allowed()), in_table(default_of(key)),
                          in_table(key.text));
    }
  }
  return text;
}

}  // namespace malleus
