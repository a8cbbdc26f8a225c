#include "case/common_sections.hpp"

namespace malleus {

void CommonSections::describe_start(CaseReader& reader) {
  reader.section("case", case_settings, "the case as a whole");
  reader.section("mesh", mesh, "the mesh that the run starts from");
  reader.section("accuracy", accuracy, "the trade of speed for accuracy, in one word");
}

void CommonSections::describe_scene(CaseReader& reader) {
  reader.repeated("boundary", boundaries, "what is imposed on a part of the boundary");
  reader.optional("gravity", gravity, "weight of bodies and fluids");
  reader.optional("inertia", inertia, "inertia terms; without this section there are none");
  reader.optional("thermal", thermal, "heat equation; without this section there is none");
  reader.optional("air", air, "air that the material traps");
  reader.optional("body_force", body_force, "force per volume");
  reader.optional("reference", reference, "a known solution, against which errors are computed");
  reader.repeated("probe", probes, "points at which fields are recorded");
}

void CommonSections::refuse_heat_without_thermal(CaseReader& reader) const {
  if (thermal) return;
  for (const BoundarySettings& boundary : boundaries) {
    if (!boundary.has_heat()) continue;
    reader.fail("boundary." + boundary.name, boundary.temperature ? "temperature" : "heat_flux",
                "no heat is modelled: add a section [thermal], or remove the key");
  }
}

void CommonSections::describe_run(CaseReader& reader) {
  reader.section("solver", solver, "nonlinear and linear solver");
  reader.optional("remesh", remesh, "adaptive remeshing; without this section there is none");
  reader.section("output", output, "what is written");
  reader.section("checkpoint", checkpoint, "states from which a run goes on");
  reader.section("limits", limits, "when a run must stop");
  reader.section("partition", partition, "how the mesh is shared among ranks");
}

}  // namespace malleus
