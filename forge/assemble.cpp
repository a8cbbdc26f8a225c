#include "forge/assemble.hpp"

#include "forge/earlier_state.hpp"
#include "forge/forge_process.hpp"

namespace malleus::forge {

/// The forging process, increment by increment (paper, 2.1 and 4.2):
///
///   flow     at the present place of bodies and tools
///              search, for every surface node, the tools and master facets that it may touch in this increment
///              solve  integral 2 eta eps(v):eps(w) - p div w + lambda w.n + friction = loads,  div v = target
///                     with lambda = [multiplier + r ((v - v_tool).n - gap/dt)]^+, by Newton
///              repeat with better multipliers, friction limits, search, press speed, until nothing is left to mend
///   tracers  points that go with the material
///   motion   x += dt v by the time scheme; strain; volumes; presses
///
/// An increment that one of them gives up is undone and tried with half the step. What the case does not name is not
/// in the list: see ForgeProcess::components().
std::unique_ptr<Process> ForgeSimulator::assemble(const Communicator& comm, Mesh mesh, CaseReader& reader) {
  (void)reader;
  std::optional<EarlierState> earlier;
  if (case_.initial && !case_.initial->from.empty()) earlier = read_earlier_state(comm, mesh, case_.initial->from);
  auto scene = std::make_unique<Scene>();
  build_scene(comm, earlier ? std::move(earlier->mesh) : std::move(mesh), case_, *scene);
  if (earlier) take_over(*earlier, scene->fields);
  return std::make_unique<ForgeProcess>(case_, std::move(scene));
}

}  // namespace malleus::forge
