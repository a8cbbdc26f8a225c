#pragma once

/// The frame that forge and inject share: command line, case, mesh, process, engine.

#include <memory>
#include <string>
#include <vector>

#include "case/common_sections.hpp"
#include "case/schema.hpp"
#include "engine/process.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// What one program adds: its sections, and how a case and a mesh become a process.
class Simulator {
 public:
  virtual ~Simulator() = default;
  virtual std::string program() const = 0;      ///< "forge"
  virtual std::string description() const = 0;  ///< one sentence, for --help
  virtual CommonSections& common() = 0;
  virtual void forget() = 0;  ///< all settings read so far
  virtual const TimeSettings& time() const = 0;
  /// Binds every section, those of common() too. Local.
  virtual void describe(CaseReader& reader) = 0;
  /// The process of the case on the mesh. The groups that the case names exist. May fail() and then
  /// check_mesh() again, or throw InputError. Collective.
  virtual std::unique_ptr<Process> assemble(const Communicator& comm, Mesh mesh, CaseReader& reader) = 0;
};

/// What a simulator does between the start and the end of MPI and PETSc; the exit code. May be called again. Throws the
/// errors that end a program. Collective.
int answer(const Communicator& comm, Simulator& simulator, const std::vector<std::string>& arguments);

/// main() of a simulator: see the options in --help. Returns the exit code.
int run_simulator(int argc, char** argv, Simulator& simulator);

}  // namespace malleus
