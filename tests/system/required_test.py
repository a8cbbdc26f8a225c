"""A run models what its scene requires: no section, no component, no field, no column."""
import pathlib
import re
import unittest

from box_msh import BoxMesh
from forging import Forging, box_mesh, case_text
from runs import history, run, summary

ENGINE_PARTS = {"history", "output", "checkpoint"}
ENGINE_COLUMNS = {"increment", "time_s", "dt_s", "nodes", "elements", "ranks", "volume_m3", "linear_iterations", "wall_s"}
FORGE_COLUMNS = {"newton_iterations", "volume_change", "min_quality", "max_penetration_m", "remeshed", "folds"}
MESH_FIELDS = {"region", "partition"}
FLOW_FIELDS = {"velocity", "pressure", "viscosity", "strain_rate"}
ALONE = "[accuracy]\ntwo_meshes = no\n"


def fields(output):
    """Names in the .xdmf of the run."""
    path, = pathlib.Path(output).glob("*.xdmf")
    return set(re.findall(r'<Attribute Name="([^"]*)"', path.read_text()))


def files(output):
    return {path.name for path in pathlib.Path(output).iterdir()}


class What(Forging):
    """Components, fields and columns of a run."""

    def forged(self, extra, name, dim=2, pressing="boundaries"):
        text = case_text(0.5, dim, 1, pressing, extra=ALONE + extra)
        (self.directory / "case.ini").write_text(text)
        run("forge", self.directory / "case.ini", self.directory / name)
        return self.seen(name)

    def seen(self, name):
        output = self.directory / name
        return set(summary(output)["components"]) - ENGINE_PARTS, fields(output), set(history(output)[0]) - ENGINE_COLUMNS


class Forge(What):
    def setUp(self):
        super().setUp()
        box_mesh(self.directory / "box.msh", 2, cells=(4, 4))
        self.components, self.fields, self.columns = self.forged("", "plain")

    def test_imposed_velocities_need_a_flow_and_a_motion_alone(self):
        self.assertEqual(self.components, {"flow", "motion"})
        self.assertEqual(self.fields, MESH_FIELDS | FLOW_FIELDS | {"equivalent_strain", "stress", "quality"})
        sides = {f"{kind}_{side}_{unit}" for side in ("high", "low") for kind, unit in (("force", "x_N"), ("force", "y_N"), ("stroke", "m"))}
        self.assertEqual(self.columns, FORGE_COLUMNS | sides)

    def test_tools_bring_the_fields_of_contact(self):
        _, found, columns = self.forged("", "tools", pressing="tools")
        self.assertEqual(found - self.fields, {"contact_gap", "contact_pressure"})
        self.assertFalse([c for c in columns if "billet" in c])

    def test_remeshing_is_a_component_where_it_has_a_section(self):
        components, _, columns = self.forged("[remesh]\nevery = 1\n", "remesh")
        self.assertEqual(components - self.components, {"remeshing"})
        self.assertEqual(columns, self.columns)

    def test_heat_is_modelled_where_it_has_a_section(self):
        heat = "[thermal]\ninitial = 1000 K\n"
        text = case_text(0.5, 2, 1, "boundaries", extra=ALONE + heat)
        text = text.replace("rate_sensitivity = 0.5", "rate_sensitivity = 0.5\ndensity = 7800\nconductivity = 30\nheat_capacity = 600")
        (self.directory / "case.ini").write_text(text)
        run("forge", self.directory / "case.ini", self.directory / "heat")
        components, found, _ = self.seen("heat")
        self.assertEqual(found - self.fields, {"temperature"})
        self.assertEqual(len(components - self.components), 1)

    def rows(self, name, *options):
        """Rows of the matrices that a run hands to PETSc, each size once."""
        finished = run("forge", self.directory / "case.ini", self.directory / name, "--", "-mat_view", "::ascii_info")
        return set(map(int, re.findall(r"rows=(\d+)", finished.stdout)))

    def test_the_matrix_has_a_row_for_each_component_of_the_flow_alone(self):
        self.assertEqual(self.rows("rows"), {3 * summary(self.directory / "plain")["nodes"]})

    def test_points_are_recorded_where_they_are_asked_for(self):
        self.assertFalse([name for name in files(self.directory / "plain") if name.startswith("probe")])
        self.forged("[probe.middle]\npoint = 0.5 0.5\n", "probes")
        self.assertIn("probe-middle.csv", files(self.directory / "probes"))

    def test_the_estimate_is_made_where_it_is_not_refused(self):
        self.assertNotIn("estimate", self.components)
        self.forge(case_text(0.5, 2, 1, "boundaries"), name="estimate")
        self.assertIn("estimate", set(summary(self.directory / "estimate")["components"]))

    def test_a_check_names_weight_that_is_nothing_beside_the_flow_stress(self):
        for acceleration, is_named in (("0 -9.81", True), ("0 -9.81e12", False)):
            text = case_text(0.5, 2, 1, "boundaries", extra=ALONE + f"[gravity]\nacceleration = {acceleration}\n")
            text = text.replace("rate_sensitivity = 0.5", "rate_sensitivity = 0.5\ndensity = 7800")
            (self.directory / "case.ini").write_text(text)
            plan = run("forge", self.directory / "case.ini", self.directory / "weight", "--check").stdout
            self.assertEqual("no [gravity]" in plan, is_named, plan)


class Inject(What):
    def setUp(self):
        super().setUp()
        mesh = BoxMesh(2)
        mesh.add("cavity", [0.0, 0.0], [4.0, 1.0], (16, 8))
        mesh.write(self.directory / "box.msh")

    def injected(self, text, name):
        (self.directory / "case.ini").write_text("[mesh]\nfile = box.msh\n" + ALONE + text)
        run("inject", self.directory / "case.ini", self.directory / name)
        return self.seen(name)

    ENDS = ("[inlet.gate]\ngroup = cavity_x_low\nfluid = melt\nflow_rate = 1\n[vent.out]\ngroup = cavity_x_high\n"
            "[wall.low]\ngroup = cavity_y_low\n[wall.high]\ngroup = cavity_y_high\n")
    MELT = "[fluid.melt]\nlaw = newtonian\nviscosity = 1\n"

    def test_one_fluid_has_no_level_set(self):
        components, found, _ = self.injected("[time]\nincrements = 0\n[initial]\nfluid = melt\n" + self.MELT + self.ENDS, "steady")
        self.assertEqual(components, {"flow"})
        self.assertEqual(found - MESH_FIELDS, FLOW_FIELDS | {"shear_rate", "wall_shear_stress"})

    def test_a_second_fluid_brings_the_front(self):
        air = "[fluid.air]\nlaw = newtonian\nviscosity = 1e-3\n[initial]\nfluid = air\n"
        start = "[initial.start]\nfluid = melt\nlevel_set = \"1 - x\"\n"
        components, found, _ = self.injected("[time]\nincrements = 1\n" + self.MELT + air + start + self.ENDS, "filling")
        self.assertEqual(components, {"flow", "front", "filling"})
        self.assertIn("level_set", found)
        self.assertNotIn("temperature", found)

    def test_a_check_names_inertia_at_small_reynolds_numbers(self):
        for viscosity, is_named in ((100, True), (1, False)):
            melt = f"[fluid.melt]\nlaw = newtonian\nviscosity = {viscosity}\ndensity = 1\n"
            text = "[mesh]\nfile = box.msh\n[time]\nend = 1\nstep = 0.1\n[inertia]\n[initial]\nfluid = melt\n" + melt + self.ENDS
            (self.directory / "case.ini").write_text(text)
            plan = run("inject", self.directory / "case.ini", self.directory / "plan", "--check").stdout
            self.assertEqual("no [inertia]" in plan, is_named, plan)

    def test_a_check_names_thin_air_halves_and_flows_that_stay(self):
        start = "[time]\nend = 1\n[initial]\nfluid = air\n[initial.start]\nfluid = melt\nlevel_set = \"1 - x\"\n" + self.MELT + self.ENDS
        half, void, once = "mirror image about y = 0.5 m", "[fluid.air] law = void", "[flow] update = once"
        slips = start.replace("group = cavity_y_high\n", "group = cavity_y_high\ncondition = slip\n")
        for text, viscosity, named in ((start, 1e-4, {half, void}), (start, 1, {half, once}), (slips, 0.1, set())):
            (self.directory / "case.ini").write_text(f"[mesh]\nfile = box.msh\n{text}[fluid.air]\nlaw = newtonian\nviscosity = {viscosity}\n")
            plan = run("inject", self.directory / "case.ini", self.directory / "plan", "--check").stdout
            self.assertEqual({line for line in (half, void, once) if line in plan}, named, plan)

    def test_a_prescribed_flow_solves_no_equations(self):
        air = "[fluid.air]\nlaw = newtonian\nviscosity = 1e-3\n[initial]\nfluid = air\n"
        start = "[initial.start]\nfluid = melt\nlevel_set = \"1 - x\"\n"
        flow = "[flow]\nprescribed_x = 1\nprescribed_y = 0\n"
        self.injected("[time]\nincrements = 2\nstep = 0.01\n" + self.MELT + air + start + flow + self.ENDS, "carried")
        self.assertEqual(summary(self.directory / "carried")["linear"]["solves"], 0)
        self.assertNotIn("pressure", fields(self.directory / "carried"))


if __name__ == "__main__":
    unittest.main()
