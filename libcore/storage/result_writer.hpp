#pragma once

/// What users look at: one XDMF file over closed HDF5 files, for ParaView.

#include <filesystem>
#include <string>
#include <vector>

#include "field/field.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// Writes NAME.xdmf beside NAME.fields/ in a directory. Each step is one HDF5 file per rank (per group of ranks beyond
/// 64), closed and flushed before the .xdmf, which is written aside and renamed, names it, with checksums: the results
/// can be opened at any moment, also after a crash. Form: a Temporal collection of flat Spatial collections with <Time>
/// on the Spatial one, one Uniform grid per non-empty partition, relative paths, each DataItem a whole dataset (the
/// form that ParaView 5.11 reads in serial and in parallel). Every call is collective; failures are StorageErrors on
/// all ranks.
class ResultWriter {
 public:
  enum class Precision { float32, float64 };
  ResultWriter(const Communicator& comm, std::filesystem::path directory, std::string name, Precision precision);

  /// Removes an earlier run's results and makes the directories.
  void start_anew();
  /// Keeps an earlier run's steps up to an increment and goes on after them.
  void resume_after(GlobalId last_increment);

  /// One step: owned elements, their nodes, and the fields given (node or element support), besides `region` and
  /// `partition`. Fields' copies must be up to date. time in s.
  void write(GlobalId increment, Real time, const Mesh& mesh, const std::vector<const Field*>& fields);

  GlobalId bytes_written() const noexcept { return bytes_written_; }  ///< by this rank

 private:
  struct Step {
    GlobalId increment;
    std::string xml;
  };
  void write_index() const;
  std::filesystem::path fields_directory() const { return directory_ / (name_ + ".fields"); }

  const Communicator& comm_;
  std::filesystem::path directory_;
  std::string name_;
  Precision precision_;
  std::vector<Step> steps_;  ///< on the root
  GlobalId bytes_written_ = 0;
};

}  // namespace malleus
