#pragma once

/// The case reader: from a case file to structs, from one description of every key.
///
/// A section is a struct. Its describe() binds each key once: member (whose value is the default), unit, range and
/// text. From these bindings come the reading with all its messages, `--help-case`, `--template`, the documentation
/// page and case.resolved.ini.
///
///     enum class Law { norton_hoff, rigid };
///
///     struct Body {
///       std::string name;                  // NAME of [body.NAME], set by the reader
///       std::string group;
///       Law law = Law::norton_hoff;
///       std::optional<Real> consistency;   // no default: optional, so that 0 never stands for "not given"
///       Real rate_sensitivity = 1;
///
///       void describe(Section& s) {
///         s.string("group", group, "physical volume").required().starter("billet").names_volume_group();
///         s.choice("law", law, {{"norton-hoff", Law::norton_hoff}, {"rigid", Law::rigid}}, "how it deforms");
///         s.real("rate_sensitivity", rate_sensitivity, "", "m").above(0).at_most(1);
///         s.real("consistency", consistency, "Pa.s^m", "K").above(0).starter("179.2 MPa.s^m")
///             .exponent_is("rate_sensitivity", rate_sensitivity);
///       }
///       void validate(Section& s) {        // optional: rules between keys
///         if (law == Law::norton_hoff) s.require("consistency", "law = norton-hoff");
///       }
///     };
///
///     struct ForgeCase {
///       MeshSection mesh;
///       std::optional<Thermal> thermal;
///       std::vector<Body> bodies;
///
///       void describe(CaseReader& reader) {
///         reader.section("mesh", mesh, "the mesh");                    // always in force
///         reader.optional("thermal", thermal, "the heat equation");    // absent: models nothing
///         reader.repeated("body", bodies, "a deformable body", 1);     // [body.NAME], at least one
///       }
///     };
///
///     CaseReader reader(comm, CaseFile::read(comm, path, overrides));
///     ForgeCase forge_case;
///     forge_case.describe(reader);
///     reader.finish();                     // throws one InputError with every mistake of the case
///     ... read the mesh ...
///     reader.check_mesh({dimension, volume_groups, surface_groups});   // the same for what needs the mesh
///     write(reader.resolved(output_directory));
///
/// With a default-constructed CaseReader nothing is read and the same describe() only documents: see help.hpp.
/// This also tests the description, once instead of at each reading:
/// a default (of a key that is not required) and a starter must be values that the key itself accepts,
/// else it throws a Defect.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "case/section.hpp"

namespace malleus {

enum class Occurrence { always, optional, repeated };

/// What is known of one kind of section, for help and documentation.
struct SectionDescription {
  std::string kind;
  Occurrence occurrence = Occurrence::always;
  int at_least = 0;  ///< of repeated ones
  std::string text;
  std::vector<Key> keys;  ///< without their functions

  std::string title() const { return occurrence == Occurrence::repeated ? kind + ".NAME" : kind; }
};

/// A value that was in force, and where it came from.
struct InForce {
  std::string section;
  std::string key;
  std::string value;   ///< case text; empty where it has no value
  std::string origin;  ///< "case.ini:12", "default", "accuracy level fine", "command line"
  bool is_given = false;
  bool is_path = false;
  bool is_vector = false;
};

/// What a case is checked against once the mesh is read.
struct MeshNames {
  int dimension = 3;
  std::vector<std::string> volume_groups;
  std::vector<std::string> surface_groups;
};

class CaseReader {
 public:
  /// Only documents.
  CaseReader() = default;
  /// Reads. The communicator must outlive the reader.
  CaseReader(const Communicator& comm, CaseFile file);

  /// @name What the case may hold. Local.
  /// @{
  template <class T>
  void section(std::string_view kind, T& target, std::string_view text);
  template <class T>
  void optional(std::string_view kind, std::optional<T>& target, std::string_view text);
  template <class T>
  void repeated(std::string_view kind, std::vector<T>& targets, std::string_view text, int at_least = 0);
  /// @}

  /// A mistake at a key (or, where the key is not given or empty, at its section), for rules between sections; to be
  /// called before finish() or check_mesh(), with the same arguments on every rank. section: "mesh", "body.billet".
  void fail(std::string_view section, std::string_view key, const std::string& message);
  bool given(std::string_view section, std::string_view key) const;

  /// A message about the scene with its place in the case: one that starts with "[section]" or "[section] key" gets the
  /// file and line of that, one that starts with "the " the file; others have a place of their own. Local.
  std::string located(const std::string& message) const;

  /// Throws one InputError that holds every mistake of the case, on all ranks. Collective.
  void finish();
  /// Throws one InputError with every unknown group and every vector of another dimension than the mesh's. Local.
  void check_mesh(const MeshNames& mesh);

  /// What the program chose itself, or moved, instead of what the description gave: a line of case.resolved.ini. Local.
  void record(std::string_view section, std::string_view key, const std::string& value, std::string_view origin);
  /// case.resolved.ini for that directory: every key in force with its origin. Running it gives the same run. Local.
  std::string resolved(const std::filesystem::path& output_directory) const;

  const std::vector<SectionDescription>& descriptions() const { return descriptions_; }
  const std::vector<InForce>& in_force() const { return in_force_; }
  const CaseFile& file() const { return file_; }
  Level level() const { return level_; }

 private:
  /// A value that names something.
  struct NamedValue {
    Place place;
    std::string subject;  ///< "[body.billet] group"
    Reference reference = Reference::none;
    std::string section;
    std::string name;
  };
  struct NeededPath {
    Place place;
    std::string subject;
    PathRule rule = PathRule::any;
    std::filesystem::path path;
  };
  struct GivenVector {
    Place place;
    std::string subject;
    int components = 0;  ///< 0: a key that belongs to a third component
  };

  void describe(std::string_view kind, Occurrence occurrence, int at_least, std::string_view text,
                const Section& section);
  std::vector<const CaseSection*> occurrences(std::string_view kind) const;
  std::filesystem::path directory() const { return file_.path().parent_path(); }
  template <class T>
  void bind(const std::string& title, const CaseSection* source, T& target);
  void close(const Section& section);
  void note_references(const Section& section, const Key& key, const CaseEntry& entry);
  void find_unknown_names();
  void find_unknown_keys(const CaseSection& section, const SectionDescription& description);
  void find_wrong_references();
  void find_missing_paths();
  const SectionDescription* description_of(const CaseSection& section) const;
  std::string owner_of(std::string_view key) const;

  const Communicator* comm_ = nullptr;
  CaseFile file_;
  Level level_ = Level::standard;
  std::vector<SectionDescription> descriptions_;
  std::vector<InForce> in_force_;
  Mistakes mistakes_;
  std::vector<NamedValue> named_values_;
  std::vector<NeededPath> needed_paths_;
  std::vector<GivenVector> given_vectors_;
  int dimension_ = 3;
};

template <class T>
void CaseReader::bind(const std::string& title, const CaseSection* source, T& target) {
  Section section(title, source, directory(), level_);
  target.describe(section);
  section.read_values();
  if constexpr (requires { target.validate(section); }) {
    if (section.may_validate()) target.validate(section);
  }
  close(section);
}

template <class T>
void CaseReader::section(std::string_view kind, T& target, std::string_view text) {
  T prototype = target;
  Section description(std::string(kind), nullptr, directory(), level_);
  prototype.describe(description);
  describe(kind, Occurrence::always, 0, text, description);
  if (comm_ != nullptr) bind(std::string(kind), file_.find(kind), target);
}

template <class T>
void CaseReader::optional(std::string_view kind, std::optional<T>& target, std::string_view text) {
  T prototype;
  Section description(std::string(kind), nullptr, directory(), level_);
  prototype.describe(description);
  describe(kind, Occurrence::optional, 0, text, description);
  const CaseSection* source = comm_ != nullptr ? file_.find(kind) : nullptr;
  if (source != nullptr) bind(std::string(kind), source, target.emplace());
}

template <class T>
void CaseReader::repeated(std::string_view kind, std::vector<T>& targets, std::string_view text, int at_least) {
  T prototype;
  Section description(std::string(kind) + ".NAME", nullptr, directory(), level_);
  prototype.describe(description);
  describe(kind, Occurrence::repeated, at_least, text, description);
  if (comm_ == nullptr) return;
  for (const CaseSection* source : occurrences(kind)) {
    T& target = targets.emplace_back();
    target.name = source->name;
    bind(source->title(), source, target);
  }
}

}  // namespace malleus
