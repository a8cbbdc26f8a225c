#include "inject/assemble.hpp"

#include "inject/process.hpp"

namespace malleus::inject {

void InjectSimulator::describe(CaseReader& reader) {
  case_.describe(reader);
  case_.check(reader);
}

/// The coupled algorithm (paper, section 2.2.4), an increment after the other until the cavity is full:
///
///   remeshing where [remesh] asks: a new mesh, fine about the front; the flow is solved again on it
///   flow      where the front has moved far enough since the last solve:
///               shares of the fluids in each element from the level sets, viscosity and density from the shares;
///               (v, p) of the Stokes equations with walls, gates, vents and symmetry; gates switch over
///   front     in substeps of a share of an element:
///               level set imposed where fluid enters; transport with v; walls take the level set beside them;
///               distance restored where its slope is lost; volume restored to what came in
///   filling   filled volume, and whether anything more will happen
///
/// A scene of one fluid has no front and nothing to fill; a prescribed flow is not solved.
std::unique_ptr<Process> InjectSimulator::assemble(const Communicator& comm, Mesh mesh, CaseReader& reader) {
  if (!case_.is_driven()) {
    reader.fail("inlet", "", "nothing moves the fluids: add an [inlet.NAME], or prescribe the flow in [flow]");
    reader.finish();
  }
  auto process = std::make_unique<FillingProcess>(comm, std::move(mesh), case_);
  if (case_.flow.is_prescribed()) {
    process->add_prescribed_flow();
  } else {
    process->add_flow();
  }
  if (process->has_fronts()) {
    process->add_front();
    process->add_filling();
  }
  process->add_remeshing();
  process->check_start();
  return process;
}

}  // namespace malleus::inject
