#include "forge/earlier_state.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.hpp"
#include "base/log.hpp"
#include "forge/scene.hpp"
#include "partition/balance.hpp"
#include "storage/checkpoint.hpp"

namespace malleus::forge {
namespace {

void require_names(const std::vector<std::string>& expected, const std::vector<std::string>& found,
                   const std::filesystem::path& directory) {
  for (const std::string& name : expected) {
    if (std::find(found.begin(), found.end(), name) != found.end()) continue;
    throw InputError(
        fmt::format("[initial] from = {}: the state there has no group '{}', which [mesh] file has; it has {}",
                    directory.string(), name, fmt::join(found, ", ")));
  }
}

}  // namespace

EarlierState read_earlier_state(const Communicator& comm, const Mesh& expected,
                                const std::filesystem::path& directory) {
  std::optional<SavedState> saved = CheckpointStore(comm, directory).read_newest();
  if (!saved) {
    throw InputError(
        fmt::format("[initial] from = {}: there is no complete state of a run (in its directory 'checkpoints')",
                    directory.string()));
  }
  if (saved->mesh.dim != expected.dim) {
    throw InputError(fmt::format("[initial] from = {}: the state there has {} dimensions, [mesh] file has {}",
                                 directory.string(), saved->mesh.dim, expected.dim));
  }
  require_names(expected.region_names, saved->mesh.region_names, directory);
  require_names(expected.group_names, saved->mesh.group_names, directory);
  log::info("starts from increment {} of the run in {}", saved->increment, directory.string());
  EarlierState earlier;
  earlier.mesh = std::move(saved->mesh);
  for (auto& [spec, values] : saved->fields) earlier.fields.declare(earlier.mesh, spec).assign(std::move(values));
  balance_along_curve(comm, earlier.mesh, earlier.fields);
  return earlier;
}

void take_over(const EarlierState& earlier, FieldStore& fields) {
  for (const char* name : {field_name::equivalent_strain, field_name::temperature}) {
    if (!earlier.fields.has(name) || !fields.has(name)) continue;
    const auto values = earlier.fields[name].values();
    fields[name].assign(std::vector<Real>(values.begin(), values.end()));
  }
}

}  // namespace malleus::forge
