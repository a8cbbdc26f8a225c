"""Forging: what scenes are refused or told of, how runs end, and what outputs and probes show."""
import csv
import unittest

import h5py
import numpy

from box_msh import BoxMesh
from forging import Forging, K, box_mesh, case_text, flow_stress, vector
from runs import run, summary


class Blow(Forging):
    def test_a_hammer_spends_its_energy_and_no_more(self):
        # Steps far too long for the blow are asked for. With m = 1 in plane strain F = 4 K v w0 h0 / h^2, so m dv/ds =
        # -4 K w0 h0 / h^2 and the blow ends at 1/h = 1/h0 + m v0 / (4 K w0 h0), here with w0 = h0 = 1.
        box_mesh(self.directory / "box.msh", 2, cells=(3, 3))
        mass, speed = 1e6, 200.0
        energy = 0.5 * mass * speed ** 2
        text = case_text(1, 2, 1, "tools", time="stroke = 0.9\nstep = 1")
        text = text.replace("velocity = 0 -1.0", f"velocity = 0 -1.0\npress = hammer\nmass = {mass}\nenergy = {energy}")
        rows = self.forge(text, "-D", "output.every=1000")
        self.assertIn("the presses came to rest", (self.directory / "out" / "run.log").read_text())
        strokes = [0.0] + [row["stroke_upper_m"] for row in rows]
        work = sum(row["force_upper_y_N"] * (b - a) for row, a, b in zip(rows, strokes, strokes[1:]))
        self.assertAlmostEqual(work / energy, 1, delta=0.01)
        height = 1 / (1 + mass * speed / (4 * K))
        self.assertAlmostEqual(strokes[-1] / (1 - height), 1, delta=5e-3)


class Stroke(Forging):
    """Runs that nothing but their stroke ends."""

    def test_it_ends_where_a_press_stalls(self):
        # Below the cut-off rate (0.01 of the scene's) the material is linear: at 0.02 of the force for full speed the
        # press has less than a thousandth of it.
        box_mesh(self.directory / "box.msh", 2, cells=(2, 2))
        limit = 0.02 * flow_stress(2, 1, 0.3)
        text = case_text(0.3, 2, 1, "tools", time="stroke = 0.9")
        text = text.replace("velocity = 0 -1.0", f"velocity = 0 -1.0\npress = hydraulic\nforce_limit = {limit!r}")
        rows = self.forge(text, "-D", "output.every=1000")
        self.assertEqual(summary(self.directory / "out")["status"], "done")
        self.assertIn("the press of upper stalled at its force limit", summary(self.directory / "out")["reason"])
        self.assertLess(rows[-1]["stroke_upper_m"], 0.1)

    def test_it_needs_something_that_moves(self):
        box_mesh(self.directory / "box.msh", 2)
        text = case_text(0.3, 2, 1, "boundaries", time="stroke = 0.1").replace("free -1.0", "free 0.0")
        (self.directory / "case.ini").write_text(text)
        result = run("forge", self.directory / "case.ini", self.directory / "out", "--check", check=False)
        self.assertEqual(result.returncode, 2)
        self.assertIn("case.ini:4: [time] stroke = 0.1: no tool and no boundary moves", result.stderr)


class Stress(Forging):
    """2 eta eps - p I of the state that velocity, pressure and viscosity belong to, in outputs and at probes."""
    DIAGONAL, OTHERS = [0, 3, 5], [1, 2, 4]  # of xx xy xz yy yz zz

    def stick(self, dim, ranks, extra):
        box_mesh(self.directory / "box.msh", dim, cells=(4, 4, 4))
        text = case_text(0.3, dim, dim - 1, "tools", time="increments = 3\nstep = 0.05", extra=extra)
        self.forge(text.replace("shape = plane\n", "shape = plane\nfriction = 1\n"), "-D",
                   "motion.volume_target=no", "-D", "motion.scheme=adams-bashforth-2", ranks=ranks)

    def test_it_is_of_the_state_of_its_output(self):
        for dim, ranks in ((2, 1), (3, 3)):
            self.stick(dim, ranks, "[output]\nprecision = float64\n")
            files = sorted((self.directory / "out" / "case.fields").glob("s*.h5"))
            for file in files[ranks:]:  # the first state is at rest
                with h5py.File(file) as h5:
                    for part in h5.values():
                        stress, pressure = part["stress"][:], part["pressure"][:][part["cells"][:]].mean(axis=1)
                        scale = numpy.abs(stress).max()
                        normal = stress[:, self.DIAGONAL[:dim]] + pressure[:, None]
                        j2 = 0.5 * (normal ** 2).sum(axis=1) + (stress[:, self.OTHERS] ** 2).sum(axis=1)
                        equivalent = 3 * part["viscosity"][:] * part["strain_rate"][:]
                        self.assertLess(numpy.abs(numpy.sqrt(3 * j2) - equivalent).max() / scale, 1e-8)

    def test_probes_show_the_increments_own(self):
        # Frictionless: the free direction carries nothing, the other one the force.
        box_mesh(self.directory / "box.msh", 2, cells=(4, 4))
        for fields in ("", "fields = stress pressure\n"):
            text = case_text(0.3, 2, 1, "boundaries", time="increments = 3\nstep = 0.02",
                             extra=f"[probe.p]\npoint = 0.4 0.4\n{fields}[output]\nfields = velocity\n")
            rows = self.forge(text, "-D", "solver.newton_tolerance=1e-8", "-D", "motion.volume_target=no")
            with open(self.directory / "out" / "probe-p.csv") as file:
                probed = list(csv.DictReader(file))
            for n, (row, at) in enumerate(zip(rows, probed)):
                height = 1 - 0.02 * n
                force = -row["force_high_y_N"] * height  # the width is 1 / height
                self.assertAlmostEqual(float(at["stress_1"]) / force, 1, delta=2e-3)
                self.assertAlmostEqual(float(at["stress_0"]) / force, 0, delta=1e-5)
                self.assertAlmostEqual(-2 * float(at["pressure"]) / force, 1, delta=2e-3)


class WrongScenes(Forging):
    def refused(self, text, *parts, ranks=(1, 2)):
        (self.directory / "case.ini").write_text(text)
        for count in ranks:
            result = run("forge", self.directory / "case.ini", self.directory / "out", ranks=count, check=False)
            self.assertEqual(result.returncode, 2, result.stderr)
            for part in parts:
                self.assertIn(part, result.stderr)

    def test_two_sections_of_a_group_are_refused_with_both_lines(self):
        box_mesh(self.directory / "box.msh", 2)
        text = case_text(0.3, 2, 1, "boundaries")
        line = text[:text.index("group = billet_y_high")].count("\n") + 1
        second = text + "[boundary.again]\ngroup = billet_y_high\ntraction = 0 1 Pa\n"
        self.refused(second, f"case.ini:{second.count(chr(10)) - 1}: [boundary.again] group = billet_y_high",
                     "already that of [boundary.high] (", f"case.ini:{line})")
        self.refused(text + "[body.other]\ngroup = billet\nlaw = rigid\n", "[body.other] group = billet",
                     "already that of [body.billet] (")

    def test_forces_without_a_finite_value_are_refused_on_all_ranks(self):
        box_mesh(self.directory / "box.msh", 2, cells=(8, 8))
        for expression in ("1/(x-0.5)", "sqrt(x-0.9)"):
            self.refused(case_text(0.3, 2, 1, "boundaries") + f'[body_force]\ny = "{expression}"\n',
                         "[body_force] y", ranks=(1, 2, 4))


    def test_keys_that_another_one_overrules_are_refused(self):
        box_mesh(self.directory / "box.msh", 2)
        text = case_text(0.3, 2, 1, "tools")
        for keys, part in (("velocity_x = 1", "velocity_x = 1: is already given as velocity"),
                           ("force_limit = 10 N", "force_limit = 10 N: not allowed here (only press = hydraulic"),
                           ("energy = 1 J", "energy = 1 J: not allowed here (only press = hammer"),
                           ("crank_radius = 1", "crank_radius = 1: not allowed here (only press = crank"),
                           ("radius = 1", "radius = 1: not allowed here (only shape = sphere"),
                           ("size = 1 1", "size = 1 1: not allowed here (only shape = box"),
                           ("pivot = 1 1", "pivot = 1 1: not allowed here (the tool has no spin)")):
            with self.subTest(keys):
                self.refused(text.replace("[tool.upper]\n", f"[tool.upper]\n{keys}\n"), part, ranks=(1,))
        both = case_text(0.3, 2, 1, "boundaries")
        held = "velocity = free 0.0"
        self.refused(both.replace(held, held + "\ntraction = 0 5"), "traction = 0 5: the velocity along y is imposed",
                     ranks=(1,))
        self.forge(both.replace(held, held + "\ntraction = 5 0"))

    def test_a_mesh_beyond_the_axis_is_refused(self):
        mesh = BoxMesh(2)
        mesh.add("billet", [-0.25, 0.0], [1.0, 1.0], (3, 3))
        mesh.write(self.directory / "box.msh")
        text = "[case]\ngeometry = axisymmetric\n" + case_text(0.3, 2, 1, "boundaries")
        self.refused(text, "case.ini:2: [case] geometry = axisymmetric", "the mesh has r < 0: smallest x = -0.25 m")


class Start(Forging):
    def messages(self, text, *options, ranks=1):
        self.forge(text, "--steps", "1", *options, ranks=ranks)
        return (self.directory / "out" / "run.log").read_text(), summary(self.directory / "out")["warnings"]

    def test_gaps_and_overlaps_are_told(self):
        for dim in (2, 3):
            axis = dim - 1
            box_mesh(self.directory / "box.msh", dim, cells=(4, 4, 4))
            text = case_text(0.3, dim, axis, "tools")
            at_top = f"point = {vector(dim, axis, 1.0)}"
            ranks = 1 if dim == 2 else 3
            log, warnings = self.messages(text, ranks=ranks)
            self.assertIn("tool upper: touches at the start", log)
            self.assertEqual([w for w in warnings if "overlap" in w], [])
            log, _ = self.messages(text.replace(at_top, f"point = {vector(dim, axis, 1.125)}"), ranks=ranks)
            self.assertIn("tool upper: 0.125 m away at the start", log)
            _, warnings = self.messages(text.replace(at_top, f"point = {vector(dim, axis, 0.999)}"), ranks=ranks)
            overlaps = [w for w in warnings if "overlap" in w]
            self.assertEqual(len(overlaps), 1)
            self.assertIn("tool upper: 0.001 m of overlap at the start", overlaps[0])
            self.assertNotIn("wrong side", overlaps[0])

    def test_a_tool_turned_the_wrong_way_is_told(self):
        box_mesh(self.directory / "box.msh", 2, cells=(4, 4))
        text = case_text(0.3, 2, 1, "tools", time="increments = 1\nstep = 1e-3")
        text += "[tool.turned]\nshape = plane\npoint = 0 1\nnormal = 0 1\n"
        (self.directory / "case.ini").write_text(text)
        for options, ranks in ((("--check",), 1), ((), 2)):
            result = run("forge", self.directory / "case.ini", self.directory / "out", *options, ranks=ranks, check=False)
            self.assertEqual(result.returncode, 2)
            for part in ("[tool.turned] normal = 0 1", "body 'billet' lies wholly inside the tool at the start, 1 m deep"):
                self.assertIn(part, result.stderr)

    def test_a_sheet_turned_inside_out_is_told(self):
        box_mesh(self.directory / "box.msh", 3, cells=(2, 2, 2))
        corners = [(-1, -1, 1), (2, -1, 1), (2, 2, 1), (-1, 2, 1)]
        for order, code in (((0, 1, 2, 3), 2), ((0, 3, 2, 1), 0)):
            p = [corners[i] for i in order]
            facets = "".join("facet normal 0 0 0\nouter loop\n"
                             + "".join("vertex {} {} {}\n".format(*x) for x in triangle) + "endloop\nendfacet\n"
                             for triangle in ((p[0], p[1], p[2]), (p[0], p[2], p[3])))
            (self.directory / "top.stl").write_text(f"solid t\n{facets}endsolid t\n")
            text = case_text(0.3, 3, 2, "tools").replace(
                "[tool.upper]\nshape = plane\npoint = 0 0 1.0\nnormal = 0 0 -1.0\n",
                "[tool.upper]\nshape = surface\nfile = top.stl\n")
            self.assertIn("top.stl", text)
            (self.directory / "case.ini").write_text(text)
            result = run("forge", self.directory / "case.ini", self.directory / "out", check=False)
            self.assertEqual(result.returncode, code, result.stderr)
            self.assertEqual("turn its facets" in result.stderr, code == 2)


if __name__ == "__main__":
    unittest.main()
