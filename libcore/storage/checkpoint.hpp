#pragma once

/// Complete states of a run on disk.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "field/field.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// Values of one field, as saved.
using SavedField = std::pair<FieldSpec, std::vector<Real>>;

struct SavedState {
  GlobalId increment = 0;
  bool is_dealt_anew = false;  ///< read on another number of ranks: shares may be unequal
  Mesh mesh;
  std::vector<SavedField> fields;
  nlohmann::json state;     ///< of the engine and the process; same on all ranks
  std::vector<Real> local;  ///< this rank's own; empty where it is dealt anew
};

/// Checkpoints of a run in OUTPUT/checkpoints/NNNNNN/: an HDF5 file per rank with its part of mesh and fields in
/// float64 and a manifest with the checksums of all, written last. A checkpoint is made under a temporary name,
/// flushed, and renamed: what bears its name is complete. The newest two are kept; what a write that was killed or
/// that failed has left is removed. Read on as many ranks as wrote it,
/// local numbers are the same; on others the elements are dealt out along the space-filling curve. Every call is
/// collective; failures are StorageErrors on all ranks.
class CheckpointStore {
 public:
  CheckpointStore(const Communicator& comm, const std::filesystem::path& output_directory);

  void write(GlobalId increment, const Mesh& mesh, const FieldStore& fields, const nlohmann::json& state,
             const std::vector<Real>& local = {});
  /// The newest checkpoint whose manifest and checksums are right; none where there is none. Damaged ones are named
  /// in a warning and passed over.
  std::optional<SavedState> read_newest() const;
  void remove_all();

  /// "the newest complete checkpoint is OUT/checkpoints/000000012", or that there is none: for messages.
  std::string describe_newest() const;

 private:
  struct Content;
  void write_aside(const std::filesystem::path& aside, const Content& content);

  const Communicator& comm_;
  std::filesystem::path directory_;
};

}  // namespace malleus
