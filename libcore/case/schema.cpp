#include "case/schema.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.hpp"
#include "base/text.hpp"
#include "parallel/agreement.hpp"

namespace malleus {
namespace {

std::string origin_of(const Key& key, const CaseEntry* entry) {
  if (entry != nullptr) return entry->place.text();
  if (key.has_levels) return fmt::format("accuracy level {}", level_names[static_cast<std::size_t>(key.level)]);
  return "default";
}

/// A default or starter that its own key refuses is a defect of the description: case.resolved.ini could not be read
/// again. A member without a meaningful default is a std::optional. Leaves the key's member changed.
void check_own_values(const std::string& title, const Key& key) {
  std::vector<std::string> values(key.level_values.begin(), key.level_values.end());
  values.push_back(key.starter);
  if (!key.is_required) values.push_back(key.print());
  for (const std::string& value : values) {
    try {
      if (!value.empty()) key.assign(value);
    } catch (const InputError& error) {
      check(false,
            fmt::format("[{}] {} refuses its own default or starter: {}", title, key.name, error.what()).c_str());
    }
  }
}

std::string fault_of_path(const std::filesystem::path& path, PathRule rule) {
  std::error_code failure;
  if (!std::filesystem::exists(path, failure)) return fmt::format("no such file or directory: {}", path.string());
  const bool is_directory = std::filesystem::is_directory(path, failure);
  if (rule == PathRule::existing_file && is_directory) return fmt::format("{} is a directory", path.string());
  if (rule == PathRule::existing_directory && !is_directory) return fmt::format("{} is no directory", path.string());
  return {};
}

}  // namespace

CaseReader::CaseReader(const Communicator& comm, CaseFile file) : comm_(&comm), file_(std::move(file)) {
  const CaseEntry* entry = file_.find_entry("accuracy", "", "level");
  if (entry == nullptr) return;
  const auto* const found = std::find(level_names.begin(), level_names.end(), without_quotes(entry->value));
  if (found != level_names.end()) level_ = static_cast<Level>(found - level_names.begin());
}

void CaseReader::describe(std::string_view kind, Occurrence occurrence, int at_least, std::string_view text,
                          const Section& section) {
  SectionDescription& description = descriptions_.emplace_back();
  description.kind = kind;
  description.occurrence = occurrence;
  description.at_least = at_least;
  description.text = text;
  for (const Key& key : section.keys()) {
    const std::string default_text = key.print();
    if (comm_ == nullptr) check_own_values(description.title(), key);
    Key& described = description.keys.emplace_back(key);
    described.default_text = default_text;
    described.assign = nullptr;
    described.print = nullptr;
    described.fault_of_exponents = nullptr;
  }
}

std::vector<const CaseSection*> CaseReader::occurrences(std::string_view kind) const {
  std::vector<const CaseSection*> found;
  for (const CaseSection& section : file_.sections()) {
    if (section.kind == kind && !section.name.empty()) found.push_back(&section);
  }
  return found;
}

void CaseReader::close(const Section& section) {
  mistakes_.add(section.mistakes());
  for (const Key& key : section.keys()) {
    const CaseEntry* entry = section.entry(key.name);
    if (entry == nullptr && section.is_out_of_force(key.name)) continue;
    if (entry != nullptr) note_references(section, key, *entry);
    InForce& value = in_force_.emplace_back();
    value.section = section.title();
    value.key = key.name;
    value.value = entry != nullptr ? entry->value : key.print();
    value.origin = origin_of(key, entry);
    value.is_given = entry != nullptr;
    value.is_path = key.path_rule != PathRule::none;
    value.is_vector = key.is_vector;
  }
}

void CaseReader::note_references(const Section& section, const Key& key, const CaseEntry& entry) {
  const std::string subject = fmt::format("[{}] {}", section.title(), key.name);
  const bool is_empty_word = !key.empty_word.empty() && without_quotes(entry.value) == key.empty_word;
  if (is_empty_word) return;
  if (key.reference != Reference::none) {
    const bool is_list = key.type == words_converter().type;
    const auto names = is_list ? split_words(entry.value) : std::vector{std::string(without_quotes(entry.value))};
    for (const std::string& name : names) {
      named_values_.push_back({entry.place, subject, key.reference, key.referred_section, name});
    }
  }
  const bool must_exist = key.path_rule == PathRule::existing_file || key.path_rule == PathRule::existing_directory;
  if (must_exist) {
    const std::filesystem::path given(without_quotes(entry.value));
    needed_paths_.push_back({entry.place, subject, key.path_rule, given.is_absolute() ? given : directory() / given});
  }
  if (key.is_only_in_3d) given_vectors_.push_back({entry.place, subject, 0});
  if (key.components > 0) given_vectors_.push_back({entry.place, subject, key.components});
}

bool CaseReader::given(std::string_view section, std::string_view key) const {
  const std::size_t dot = section.find('.');
  const std::string_view name = dot == std::string_view::npos ? "" : section.substr(dot + 1);
  return file_.find_entry(section.substr(0, dot), name, key) != nullptr;
}

std::string CaseReader::located(const std::string& message) const {
  const std::string path = file_.path().string();
  if (message.starts_with("the ")) return fmt::format("{}: {}", path, message);
  const std::size_t close = message.find(']');
  if (!message.starts_with("[") || close == std::string::npos) return message;
  const std::string_view title = std::string_view(message).substr(1, close - 1);
  const std::size_t dot = title.find('.');
  const std::string_view name = dot == std::string_view::npos ? "" : title.substr(dot + 1);
  const CaseSection* section = file_.find(title.substr(0, dot), name);
  if (section == nullptr) return fmt::format("{}: {}", path, message);
  const std::size_t key_at = std::min(message.find_first_not_of(' ', close + 1), message.size());
  const std::size_t key_end = std::min(message.find_first_of(" :=", key_at), message.size());
  const CaseEntry* entry =
      file_.find_entry(title.substr(0, dot), name, std::string_view(message).substr(key_at, key_end - key_at));
  return fmt::format("{}: {}", (entry != nullptr ? entry->place : section->place).text(), message);
}

void CaseReader::fail(std::string_view section, std::string_view key, const std::string& message) {
  const std::size_t dot = section.find('.');
  const std::string_view kind = section.substr(0, dot);
  const std::string_view name = dot == std::string_view::npos ? "" : section.substr(dot + 1);
  const CaseSection* source = file_.find(kind, name);
  const CaseEntry* entry = file_.find_entry(kind, name, key);
  const Place whole_case = {file_.path().string(), 0};
  const Place place = entry != nullptr ? entry->place : (source != nullptr ? source->place : whole_case);
  const std::string value = entry != nullptr ? fmt::format(" = {}", entry->value) : "";
  const std::string subject = key.empty() ? "" : fmt::format(" {}{}:", key, value);
  mistakes_.add(place, fmt::format("[{}]{} {}", section, subject, message));
}

const SectionDescription* CaseReader::description_of(const CaseSection& section) const {
  const auto found = std::find_if(descriptions_.begin(), descriptions_.end(), [&](const SectionDescription& d) {
    return d.kind == section.kind && (d.occurrence == Occurrence::repeated) == !section.name.empty();
  });
  return found == descriptions_.end() ? nullptr : &*found;
}

std::string CaseReader::owner_of(std::string_view key) const {
  for (const SectionDescription& description : descriptions_) {
    for (const Key& known : description.keys) {
      if (known.name == key) return description.title();
    }
  }
  return {};
}

void CaseReader::find_unknown_keys(const CaseSection& section, const SectionDescription& description) {
  std::vector<std::string> known;
  for (const Key& key : description.keys) known.push_back(key.name);
  for (const CaseEntry& entry : section.entries) {
    if (std::find(known.begin(), known.end(), entry.key) != known.end()) continue;
    std::string hint;
    if (const std::string owner = owner_of(entry.key); !owner.empty()) {
      hint = fmt::format("; that key belongs to [{}]", owner);
    } else {
      hint = did_you_mean(entry.key, known);
    }
    if (hint.empty()) hint = fmt::format("; known are {}", join(known));
    mistakes_.add(entry.place, fmt::format("unknown key '{}' in [{}]{}", entry.key, section.title(), hint));
  }
}

void CaseReader::find_unknown_names() {
  std::vector<std::string> kinds;
  for (const SectionDescription& description : descriptions_) kinds.push_back(description.kind);
  for (const CaseSection& section : file_.sections()) {
    if (section.kind.empty()) continue;  // malformed, and reported
    if (const SectionDescription* description = description_of(section)) {
      find_unknown_keys(section, *description);
      continue;
    }
    const bool is_known_kind = std::find(kinds.begin(), kinds.end(), section.kind) != kinds.end();
    std::string what;
    if (!is_known_kind) {
      what = fmt::format("unknown section [{}]{}", section.title(), did_you_mean(section.kind, kinds));
    } else if (section.name.empty()) {
      what = fmt::format("section [{0}] needs a name: [{0}.NAME]", section.kind);
    } else {
      what = fmt::format("section [{}] takes no name: [{}]", section.title(), section.kind);
    }
    mistakes_.add(section.place, what);
  }
  for (const SectionDescription& description : descriptions_) {
    const auto n_given = static_cast<int>(occurrences(description.kind).size());
    if (description.occurrence != Occurrence::repeated || n_given >= description.at_least) continue;
    mistakes_.add({file_.path().string(), 0},
                  fmt::format("needs at least {} section{} [{}]: {}", description.at_least,
                              description.at_least > 1 ? "s" : "", description.title(), description.text));
  }
}

void CaseReader::find_wrong_references() {
  for (const NamedValue& value : named_values_) {
    if (value.reference != Reference::section) continue;
    std::vector<std::string> known;
    for (const CaseSection* section : occurrences(value.section)) known.push_back(section->name);
    if (std::find(known.begin(), known.end(), value.name) != known.end()) continue;
    const std::string hint = did_you_mean(value.name, known);
    const std::string others = known.empty() ? "; the case has none" : fmt::format("; the case has {}", join(known));
    mistakes_.add(value.place, fmt::format("{} = {}: no section [{}.{}]{}", value.subject, value.name, value.section,
                                           value.name, hint.empty() ? others : hint));
  }
}

void CaseReader::find_missing_paths() {
  // The root alone looks at the disk; one line of text a path, empty where all is well.
  std::string faults;
  on_root(*comm_, [&] {
    for (const NeededPath& needed : needed_paths_) faults += fault_of_path(needed.path, needed.rule) + '\n';
  });
  comm_->broadcast(faults);
  for (const NeededPath& needed : needed_paths_) {
    const std::size_t end = faults.find('\n');
    const std::string fault = faults.substr(0, end);
    faults.erase(0, end + 1);
    if (!fault.empty()) mistakes_.add(needed.place, fmt::format("{}: {}", needed.subject, fault));
  }
}

void CaseReader::finish() {
  check(comm_ != nullptr, "a case reader that only documents cannot finish");
  mistakes_.add(file_.mistakes());
  find_unknown_names();
  find_wrong_references();
  find_missing_paths();
  mistakes_.throw_if_any(file_.path());
}

void CaseReader::check_mesh(const MeshNames& mesh) {
  dimension_ = mesh.dimension;
  for (const NamedValue& value : named_values_) {
    const bool is_volume = value.reference == Reference::volume_group;
    if (!is_volume && value.reference != Reference::surface_group) continue;
    const auto& known = is_volume ? mesh.volume_groups : mesh.surface_groups;
    const auto& other = is_volume ? mesh.surface_groups : mesh.volume_groups;
    if (std::find(known.begin(), known.end(), value.name) != known.end()) continue;
    const std::string kind = is_volume ? "volume" : "boundary";
    std::string hint = did_you_mean(value.name, known);
    if (std::find(other.begin(), other.end(), value.name) != other.end()) {
      hint = fmt::format("; it is a group of {}", is_volume ? "the boundary" : "the volume");
    } else if (hint.empty()) {
      hint = known.empty() ? "; it has none" : fmt::format("; it has {}", join(known));
    }
    mistakes_.add(value.place, fmt::format("{} = {}: the mesh has no {} group of that name{}", value.subject,
                                           value.name, kind, hint));
  }
  for (const GivenVector& vector : given_vectors_) {
    const bool fits = vector.components == 0 ? mesh.dimension == 3 : vector.components == mesh.dimension;
    if (fits) continue;
    const std::string what =
        vector.components == 0 ? "a third component" : fmt::format("{} components", vector.components);
    mistakes_.add(vector.place,
                  fmt::format("{}: {}, but the mesh has {} dimensions", vector.subject, what, mesh.dimension));
  }
  mistakes_.throw_if_any(file_.path());
}

}  // namespace malleus
