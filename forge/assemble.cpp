#include "forge/assemble.hpp"

#include <fmt/format.h>

#include "forge/earlier_state.hpp"
#include "forge/forge_process.hpp"
#include "forge/initial_contact.hpp"

namespace malleus::forge {

namespace {

/// A tool that is turned inside out, or stands beyond the body.
void refuse_swallowed_bodies(const ForgeCase& forge_case, Scene& scene, CaseReader& reader) {
  std::vector<char> may_be_open;
  for (const ToolSettings& tool : forge_case.tools) may_be_open.push_back(tool.shape == ShapeKind::surface ? 1 : 0);
  for (const Swallowed& one : find_swallowed(scene, may_be_open)) {
    const ToolSettings& tool = forge_case.tools[one.tool];
    const bool is_plane = tool.shape == ShapeKind::plane;
    const bool is_surface = tool.shape == ShapeKind::surface;
    reader.fail("tool." + tool.name,
                is_plane     ? "normal"
                : is_surface ? "file"
                             : "material",
                fmt::format("body '{}' lies wholly inside the tool at the start, {:.3g} m deep: move the tool, or turn "
                            "{} the other way",
                            one.body, one.depth,
                            is_plane     ? "its normal"
                            : is_surface ? "its facets or `material`"
                                         : "`material`"));
  }
}

}  // namespace

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
  std::optional<EarlierState> earlier;
  if (case_.initial && !case_.initial->from.empty()) earlier = read_earlier_state(comm, mesh, case_.initial->from);
  auto scene = std::make_unique<Scene>();
  build_scene(comm, earlier ? std::move(earlier->mesh) : std::move(mesh), case_, *scene);
  if (earlier) take_over(*earlier, scene->fields);
  refuse_swallowed_bodies(case_, *scene, reader);
  return std::make_unique<ForgeProcess>(case_, std::move(scene));
}

}  // namespace malleus::forge
