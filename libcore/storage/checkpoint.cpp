#include "storage/checkpoint.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <fstream>

#include "base/error.hpp"
#include "base/log.hpp"
#include "field/fielded_piece.hpp"
#include "parallel/agreement.hpp"
#include "storage/atomic_file.hpp"
#include "storage/field_list.hpp"
#include "storage/h5_file.hpp"

namespace malleus {
namespace {

namespace fs = std::filesystem;

constexpr int format_version = 2;
constexpr std::size_t kept_checkpoints = 2;
constexpr const char* unfinished = "unfinished-";  ///< before the name of what is not whole

std::string part_name(int part) {
  return fmt::format("part-{:05d}.h5", part);
}
std::string directory_name(GlobalId increment) {
  return fmt::format("{:09d}", increment);
}

/// CRC-32 of a whole file.
GlobalId file_checksum(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw StorageError(fmt::format("{}: cannot be opened", path.string()));
  std::array<char, 1 << 16> buffer;
  uLong sum = crc32(0, nullptr, 0);
  while (file.read(buffer.data(), buffer.size()) || file.gcount() > 0) {
    sum = crc32(sum, reinterpret_cast<const Bytef*>(buffer.data()), static_cast<uInt>(file.gcount()));
  }
  return static_cast<GlobalId>(sum);
}

GlobalId text_checksum(const std::string& text) {
  return static_cast<GlobalId>(crc32(0, reinterpret_cast<const Bytef*>(text.data()), static_cast<uInt>(text.size())));
}

template <class T>
void write_list(H5File& file, const std::string& path, const std::vector<T>& values) {
  file.write(path, std::span<const T>(values), {values.size()});
}

void write_part(const fs::path& path, const Mesh& mesh, const FieldStore& fields, const std::vector<Real>& local) {
  H5File file(path, H5File::Mode::create);
  file.make_group("/mesh");
  write_list(file, "/mesh/owned_nodes", std::vector<std::int64_t>{mesh.owned_nodes(), mesh.node_ownership.begin()});
  write_list(file, "/mesh/copy_numbers", mesh.copy_numbers);
  write_list(file, "/mesh/coordinates", mesh.coordinates);
  write_list(file, "/mesh/element_nodes", mesh.element_nodes);
  write_list(file, "/mesh/element_region", mesh.element_region);
  write_list(file, "/mesh/element_ids", mesh.element_ids);
  write_list(file, "/mesh/facet_nodes", mesh.facet_nodes);
  write_list(file, "/mesh/facet_element", mesh.facet_element);
  write_list(file, "/mesh/facet_group", mesh.facet_group);
  write_list(file, "/mesh/exterior_facets", std::vector<std::int64_t>{mesh.exterior_facets});
  file.make_group("/fields");
  for (const Field* field : fields.all()) {
    file.write("/fields/" + field->spec().name, field->values(), {field->values().size()});
  }
  write_list(file, "/local", local);
  file.close();
}

/// The manifest of a checkpoint that is whole: its checksum and the list of parts are right.
nlohmann::json read_manifest(const fs::path& directory) {
  try {
    const nlohmann::json sealed = nlohmann::json::parse(read_text_file(directory / "manifest.json"));
    nlohmann::json content = sealed.at("content");
    if (sealed.at("crc32").get<GlobalId>() != text_checksum(content.dump())) throw StorageError("wrong checksum");
    if (content.at("format").get<int>() != format_version) throw StorageError("unknown format");
    return content;
  } catch (const nlohmann::json::exception& error) {
    throw StorageError(fmt::format("{}: damaged manifest: {}", directory.string(), error.what()));
  }
}

void verify_part(const fs::path& directory, const nlohmann::json& manifest, int part) {
  const fs::path path = directory / part_name(part);
  if (file_checksum(path) != manifest.at("checksums").at(static_cast<std::size_t>(part)).get<GlobalId>()) {
    throw StorageError(fmt::format("{}: wrong checksum: the file is damaged", path.string()));
  }
}

/// What stands in one part: the mesh without its parallel plan, and the field values in the order of the manifest.
struct Part {
  Mesh mesh;
  std::int64_t owned_nodes = 0;
  std::int64_t first_node = 0;
  std::vector<std::vector<Real>> fields;
  std::vector<Real> local;
};

Part read_part(const fs::path& path, const nlohmann::json& manifest, const std::vector<FieldSpec>& specs) {
  const H5File file(path, H5File::Mode::read);
  Part part;
  Mesh& mesh = part.mesh;
  mesh.dim = manifest.at("dim");
  mesh.region_names = manifest.at("region_names").get<std::vector<std::string>>();
  mesh.group_names = manifest.at("group_names").get<std::vector<std::string>>();
  mesh.total_elements = manifest.at("elements");
  const auto owned = file.read_int64("/mesh/owned_nodes");
  check(owned.size() == 2, "a checkpoint part says which nodes it owns");
  part.owned_nodes = owned[0];
  part.first_node = owned[1];
  mesh.copy_numbers = file.read_int64("/mesh/copy_numbers");
  mesh.coordinates = file.read_doubles("/mesh/coordinates");
  mesh.element_nodes = file.read_int32("/mesh/element_nodes");
  mesh.element_region = file.read_int32("/mesh/element_region");
  mesh.element_ids = file.read_int64("/mesh/element_ids");
  mesh.facet_nodes = file.read_int32("/mesh/facet_nodes");
  mesh.facet_element = file.read_int32("/mesh/facet_element");
  mesh.facet_group = file.read_int32("/mesh/facet_group");
  mesh.exterior_facets = static_cast<LocalId>(file.read_int64("/mesh/exterior_facets").at(0));
  for (const FieldSpec& spec : specs) part.fields.push_back(file.read_doubles("/fields/" + spec.name));
  part.local = file.read_doubles("/local");
  return part;
}

/// The part as a loose piece, for another number of ranks.
FieldedPiece loosen(const Part& part, const std::vector<FieldSpec>& specs) {
  const Mesh& mesh = part.mesh;
  FieldedPiece loose;
  loose.piece.dim = mesh.dim;
  loose.piece.region_names = mesh.region_names;
  loose.piece.group_names = mesh.group_names;
  for (std::int64_t i = 0; i < part.owned_nodes; ++i) loose.piece.node_numbers.push_back(part.first_node + i);
  loose.piece.node_numbers.insert(loose.piece.node_numbers.end(), mesh.copy_numbers.begin(), mesh.copy_numbers.end());
  loose.piece.coordinates = mesh.coordinates;
  loose.piece.element_nodes = mesh.element_nodes;
  loose.piece.element_region = mesh.element_region;
  loose.piece.element_ids = mesh.element_ids;
  for (LocalId f = 0; f < mesh.facets(); ++f) {
    if (mesh.facet_group[static_cast<std::size_t>(f)] < 0) continue;
    const auto nodes = mesh.nodes_of_facet(f);
    loose.piece.facet_nodes.insert(loose.piece.facet_nodes.end(), nodes.begin(), nodes.end());
    loose.piece.facet_group.push_back(mesh.facet_group[static_cast<std::size_t>(f)]);
  }
  loose.node_values = interleave_fields(specs, part.fields, Support::node, loose.piece.node_numbers.size());
  loose.element_values = interleave_fields(specs, part.fields, Support::element, mesh.element_region.size());
  return loose;
}

/// The values of each field of a store, moved out.
std::vector<SavedField> take_fields(FieldStore& store) {
  std::vector<SavedField> saved;
  for (Field* field : store.all()) {
    saved.emplace_back(field->spec(), std::vector<Real>(field->values().begin(), field->values().end()));
  }
  return saved;
}

/// On the same number of ranks: the part as it was.
void read_same_ranks(const Communicator& comm, const fs::path& directory, const nlohmann::json& manifest,
                     SavedState& saved) {
  const std::vector<FieldSpec> specs = field_specs(manifest.at("fields"));
  Part part;
  agree(comm, [&] {
    verify_part(directory, manifest, comm.rank());
    part = read_part(directory / part_name(comm.rank()), manifest, specs);
  });
  saved.mesh = std::move(part.mesh);
  saved.local = std::move(part.local);
  saved.mesh.node_ownership = Ownership(comm, static_cast<LocalId>(part.owned_nodes));
  saved.mesh.node_halo = Halo(comm, saved.mesh.node_ownership, saved.mesh.copy_numbers);
  for (std::size_t f = 0; f < specs.size(); ++f) saved.fields.emplace_back(specs[f], std::move(part.fields[f]));
}

/// On another number of ranks: the parts are dealt out in stretches and assembled anew.
void read_other_ranks(const Communicator& comm, const fs::path& directory, const nlohmann::json& manifest,
                      SavedState& saved) {
  const std::vector<FieldSpec> specs = field_specs(manifest.at("fields"));
  const GlobalId parts = manifest.at("ranks");
  std::vector<std::vector<Real>> domain_values(specs.size());
  FieldedPiece names_only;
  names_only.piece.dim = manifest.at("dim");
  names_only.piece.region_names = manifest.at("region_names").get<std::vector<std::string>>();
  names_only.piece.group_names = manifest.at("group_names").get<std::vector<std::string>>();
  std::vector<FieldedPiece> pieces = {std::move(names_only)};
  agree(comm, [&] {
    const Part first = read_part(directory / part_name(0), manifest, specs);
    for (std::size_t f = 0; f < specs.size(); ++f) {
      if (specs[f].support == Support::domain) domain_values[f] = first.fields[f];
    }
    for (GlobalId p = parts * comm.rank() / comm.size(); p < parts * (comm.rank() + 1) / comm.size(); ++p) {
      verify_part(directory, manifest, static_cast<int>(p));
      pieces.push_back(loosen(read_part(directory / part_name(static_cast<int>(p)), manifest, specs), specs));
    }
  });
  FieldStore store;
  const Mesh nothing;
  for (const FieldSpec& spec : specs) store.declare(nothing, spec);
  saved.mesh = assemble_with_fields(comm, merge_pieces(pieces), store);
  for (std::size_t f = 0; f < specs.size(); ++f) {
    if (specs[f].support == Support::domain) store[specs[f].name].assign(domain_values[f]);
  }
  saved.fields = take_fields(store);
}

SavedState read_state(const Communicator& comm, const fs::path& directory) {
  std::string text;
  on_root(comm, [&] { text = read_manifest(directory).dump(); });
  comm.broadcast(text);
  const nlohmann::json manifest = nlohmann::json::parse(text);
  SavedState saved;
  saved.increment = manifest.at("increment");
  saved.state = manifest.at("state");
  if (manifest.at("ranks").get<int>() == comm.size()) {
    read_same_ranks(comm, directory, manifest, saved);
  } else {
    read_other_ranks(comm, directory, manifest, saved);
    saved.is_dealt_anew = true;
  }
  return saved;
}

/// Names of complete checkpoints, newest first.
std::vector<std::string> checkpoints_in(const fs::path& directory) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(directory, ignored)) {
    const std::string name = entry.path().filename().string();
    const bool is_number =
        !name.empty() && std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (entry.is_directory(ignored) && is_number) names.push_back(name);
  }
  std::sort(names.rbegin(), names.rend());
  return names;
}

/// Removes what killed or failed writes left, which would fill the disk.
void remove_unfinished(const fs::path& directory) {
  std::error_code ignored;
  std::vector<fs::path> left;
  for (const auto& entry : fs::directory_iterator(directory, ignored)) {
    if (entry.path().filename().string().starts_with(unfinished)) left.push_back(entry.path());
  }
  for (const fs::path& path : left) fs::remove_all(path, ignored);
}

/// Puts a checkpoint that is whole under its name; one that bears it already is damaged.
void put_in_place(const fs::path& aside, const fs::path& target) {
  std::error_code error;
  fs::remove_all(target, error);
  fs::rename(aside, target, error);
  if (error) throw StorageError(fmt::format("{}: cannot be renamed: {}", aside.string(), error.message()));
  flush_to_disk(target.parent_path());
}

}  // namespace

CheckpointStore::CheckpointStore(const Communicator& comm, const fs::path& output_directory)
    : comm_(comm), directory_(output_directory / "checkpoints") {}

struct CheckpointStore::Content {
  GlobalId increment;
  const Mesh& mesh;
  const FieldStore& fields;
  const nlohmann::json& state;
  const std::vector<Real>& local;
};

void CheckpointStore::write(GlobalId increment, const Mesh& mesh, const FieldStore& fields, const nlohmann::json& state,
                            const std::vector<Real>& local) {
  const fs::path target = directory_ / directory_name(increment);
  const fs::path aside = directory_ / (unfinished + directory_name(increment));
  on_root(comm_, [&] {
    make_directories(directory_);
    remove_unfinished(directory_);
    make_directories(aside);
  });
  try {
    write_aside(aside, {increment, mesh, fields, state, local});
  } catch (const StorageError& error) {  // on all ranks: the space is given back
    on_root(comm_, [&] { remove_unfinished(directory_); });
    throw StorageError(fmt::format("{}; {}", error.what(), describe_newest()));
  }
  on_root(comm_, [&] {
    put_in_place(aside, target);
    // Those of higher number are of a run that went on from an earlier state: damaged ones that were passed over.
    std::size_t kept = 0;
    std::error_code ignored;
    for (const std::string& name : checkpoints_in(directory_)) {
      const bool is_kept = name <= target.filename().string() && kept < kept_checkpoints;
      if (is_kept) ++kept;
      if (!is_kept) fs::remove_all(directory_ / name, ignored);
    }
  });
}

void CheckpointStore::write_aside(const fs::path& aside, const Content& saved) {
  GlobalId checksum = 0;
  agree(comm_, [&] {
    const fs::path part = aside / part_name(comm_.rank());
    write_part(part, saved.mesh, saved.fields, saved.local);
    flush_to_disk(part);
    checksum = file_checksum(part);
  });
  const std::vector<std::string> checksums = comm_.gather_to_root(std::to_string(checksum));
  on_root(comm_, [&] {
    nlohmann::json content = {{"format", format_version},
                              {"increment", saved.increment},
                              {"ranks", comm_.size()},
                              {"dim", saved.mesh.dim},
                              {"elements", saved.mesh.total_elements},
                              {"region_names", saved.mesh.region_names},
                              {"group_names", saved.mesh.group_names},
                              {"fields", describe_fields(saved.fields)},
                              {"state", saved.state}};
    for (const std::string& sum : checksums) content["checksums"].push_back(std::stoll(sum));
    const nlohmann::json sealed = {{"crc32", text_checksum(content.dump())}, {"content", content}};
    write_file_atomically(aside / "manifest.json", sealed.dump(1));
    flush_to_disk(aside);
  });
}

std::string CheckpointStore::describe_newest() const {
  std::string text;
  on_root(comm_, [&] {
    const std::vector<std::string> names = checkpoints_in(directory_);
    text = names.empty() ? "there is no complete checkpoint"
                         : fmt::format("the newest complete checkpoint is {}", (directory_ / names.front()).string());
  });
  comm_.broadcast(text);
  return text;
}

std::optional<SavedState> CheckpointStore::read_newest() const {
  std::string joined;
  on_root(comm_, [&] {
    for (const std::string& name : checkpoints_in(directory_)) joined += name + "\n";
  });
  comm_.broadcast(joined);
  for (std::size_t begin = 0; begin < joined.size();) {
    const std::size_t end = joined.find('\n', begin);
    const std::string name = joined.substr(begin, end - begin);
    begin = end + 1;
    try {
      return read_state(comm_, directory_ / name);
    } catch (const Error& error) {
      log::warning("checkpoint {} is passed over: {}", name, error.what());
    }
  }
  return std::nullopt;
}

void CheckpointStore::remove_all() {
  on_root(comm_, [&] {
    std::error_code ignored;
    fs::remove_all(directory_, ignored);
  });
}

}  // namespace malleus
