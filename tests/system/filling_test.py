"""Filling against closed forms, through the executable."""
import csv
import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np

from box_msh import BoxMesh
from channel_case import AIR, CHANNEL, ETA, H, SLOPE, U, channel_mesh
from filling import vortex
from runs import history, run, summary


def probe(output, name, column):
    with open(pathlib.Path(output) / f"probe-{name}.csv") as file:
        return [float(row[column]) for row in csv.DictReader(file)]


class Filling(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def case(self, text, name="case"):
        path = self.directory / f"{name}.ini"
        path.write_text(text)
        return path

    def check_thin_section(self, across, tolerance):
        """Pressure drop of a steady channel on the unstructured triangles of the shipped one."""
        shipped = pathlib.Path(os.environ["MALLEUS_SOURCE"]) / "cases" / "channel"
        case = self.case((shipped / "steady.ini").read_text())
        subprocess.run([shipped / "mesh", "--across", str(across), "-o", self.directory / "channel.msh"], check=True,
                       capture_output=True)
        output = self.directory / f"steady-{across}"
        run("inject", case, output)
        row = history(output)[0]
        self.assertAlmostEqual(row["flow_gate_m3_s"] / (U * H), 1, 5)
        thin = [w for w in summary(output)["warnings"] if "elements across" in w]
        self.assertEqual(bool(thin), across < 4)
        told = [line for line in (output / "run.log").read_text().splitlines() if line.startswith("warning: ")]
        self.assertEqual(any("elements across" in line for line in told), across < 4)
        drop = probe(output, "first", "pressure")[0] - probe(output, "second", "pressure")[0]
        self.assertLess(abs(drop / (SLOPE * 5 * H) - 1), tolerance)

    def test_pressure_drop_of_thin_sections(self):
        for across, tolerance in ((2, 0.17), (3, 0.058), (4, 0.036), (6, 0.021), (8, 0.012)):
            with self.subTest(across=across):
                self.check_thin_section(across, tolerance)

    def fill(self, name, *options, ranks=1):
        output = self.directory / name
        run("inject", self.case(CHANNEL + AIR + "[time]\nend = 0.35\n"), output, *options, ranks=ranks)
        return output

    def test_gate_pressure_grows_by_the_closed_form_and_volume_is_what_came_in(self):
        channel_mesh(self.directory / "channel.msh", 8)
        rows = history(self.fill("one"))
        late = [row for row in rows if row["time_s"] > 0.1]
        slope = np.polyfit([row["time_s"] - row["dt_s"] for row in late], [row["pressure_gate_Pa"] for row in late], 1)[0]
        self.assertLess(abs(slope / (SLOPE * U) - 1), 0.08)
        for row in rows:
            self.assertLess(abs(row["volume_error"]), 1e-9)
            self.assertAlmostEqual(row["injected_m3"] / (U * H * row["time_s"]), 1, 6)
        three = history(self.fill("three", ranks=3))
        self.assertLess(abs(three[-1]["pressure_gate_Pa"] / rows[-1]["pressure_gate_Pa"] - 1), 0.01)
        self.assertAlmostEqual(three[-1]["fill_fraction"], rows[-1]["fill_fraction"], 6)

    def test_the_same_run_gives_the_same_bytes(self):
        channel_mesh(self.directory / "channel.msh", 4)
        states = []
        for name in ("first", "second"):
            output = self.fill(name, "-D", "time.increments=4", "-D", "output.every=100", ranks=2)
            states.append([path.read_bytes() for path in sorted((output / "case.fields").iterdir())])
        self.assertEqual(*states)

    def test_a_restart_gives_the_digits_of_the_run_that_did_not_stop(self):
        channel_mesh(self.directory / "channel.msh", 4)
        once = ("-D", "time.increments=6")
        whole = history(self.fill("whole", *once, ranks=2))
        self.fill("parts", *once, "--steps", "3", ranks=2)
        parts = history(self.fill("parts", *once, "--restart", ranks=2))
        often = history(self.fill("often", *once, "-D", "checkpoint.every=1", ranks=2))
        for rows in (parts, often):
            self.assertEqual(len(rows), 6)
            for a, b in zip(whole, rows):
                self.assertEqual({**a, "wall_s": 0}, {**b, "wall_s": 0})

    def test_a_cavity_fills_to_its_end(self):
        channel_mesh(self.directory / "channel.msh", 4, length=2.0)
        text = CHANNEL.replace("[wall.lower]", "[wall.lower]\ncondition = slip") + AIR
        output = self.directory / "full"
        run("inject", self.case(text), output)
        last = history(output)[-1]
        self.assertGreater(last["fill_fraction"], 0.96)
        self.assertLess(abs(last["volume_error"]), 1e-3)
        self.assertRegex(summary(output)["reason"], "cavity full|short shot")
        trapped = sum(pocket["volume_m3"] for pocket in summary(output)["accuracy"]["trapped_air"])
        self.assertLessEqual(trapped, (1 - last["fill_fraction"]) * 2 * H * H * 1.0001)

    def test_gates_switch_over_at_a_pressure(self):
        channel_mesh(self.directory / "channel.msh", 4)
        output = self.directory / "switch"
        text = CHANNEL.replace("flow_rate", "switch_pressure = 100 kPa\nthen_pressure = 100 kPa\nflow_rate") + AIR
        run("inject", self.case(text + "[time]\nend = 0.4\n"), output)
        rows = history(output)
        before = [row for row in rows if row["pressure_gate_Pa"] < 1e5]
        after = rows[len(before):]
        self.assertTrue(before and after)
        for row in after:
            self.assertAlmostEqual(row["pressure_gate_Pa"], 1e5)
        self.assertLess(after[-1]["flow_gate_m3_s"], 0.9 * U * H)

    def test_a_prescribed_flow_moves_the_front_alone(self):
        mesh = BoxMesh(2)
        mesh.add("box", [0.0, 0.0], [1.0, 1.0], [32, 32])
        mesh.write(self.directory / "box.msh")
        text = vortex(2) + "[mesh]\nfile = box.msh\n[time]\nend = 2\n"
        output = self.directory / "vortex"
        run("inject", self.case(text), output, ranks=2)
        self.assertEqual(summary(output)["components"].keys() & {"flow", "front", "filling"}, {"flow", "front", "filling"})
        self.assertLess(summary(output)["accuracy"]["errors"]["level_set_l1_relative"], 0.08)
        self.assertAlmostEqual(history(output)[-1]["fill_fraction"], history(output)[0]["fill_fraction"], 9)

    def test_fluid_at_rest_has_the_pressure_of_its_weight_up_to_the_corners(self):
        for dim in (2, 3):
            mesh = BoxMesh(dim)
            mesh.add("box", [0.0] * dim, [1.0] * dim, [3] * dim)
            mesh.write(self.directory / "box.msh")
            walls = "".join(f"[wall.{a}{s}]\ngroup = box_{a}_{s}\n" for a in "xyz"[:dim] for s in ("low", "high"))
            gravity = " ".join(["0"] * (dim - 1) + ["-9.81"])
            text = (f"[mesh]\nfile = box.msh\n[time]\nincrements = 0\n[fluid.oil]\nviscosity = 1\ndensity = 900\n{walls}"
                    f"[gravity]\nacceleration = {gravity}\n[reference]\npressure = \"-8829*{'xyz'[dim - 1]}\"\n")
            for ranks in (1, 3):
                with self.subTest(dim=dim, ranks=ranks):
                    output = self.directory / "rest"
                    run("inject", self.case(text), output, ranks=ranks)
                    self.assertLess(summary(output)["accuracy"]["errors"]["pressure_l2_relative"], 1e-4)

    def test_a_tube_as_a_section_that_turns_about_its_axis(self):
        """dp/dx = 8 eta U / R^2; the axis may have a section or none."""
        mesh = BoxMesh(2)
        mesh.add("tube", [0.0, 0.0], [H, 6 * H], [8, 48])
        mesh.write(self.directory / "tube.msh")
        text = f"""[case]
geometry = axisymmetric
[mesh]
file = tube.msh
[time]
increments = 0
[fluid.polymer]
viscosity = {ETA}
[inlet.gate]
group = tube_y_low
fluid = polymer
flow_rate = {np.pi * H ** 2 * U}
[vent.outlet]
group = tube_y_high
[wall.pipe]
group = tube_x_high
[probe.first]
point = 0 {2 * H}
fields = pressure
[probe.second]
point = 0 {4 * H}
fields = pressure
"""
        for axis in ("", "[symmetry.axis]\ngroup = tube_x_low\n"):
            for method in ("block-triangular", "gmres-ilu"):
                with self.subTest(axis=axis, method=method):
                    output = self.directory / "tube"
                    run("inject", self.case(text + axis + f"[solver]\nlinear_method = {method}\n"), output)
                    drop = probe(output, "first", "pressure")[0] - probe(output, "second", "pressure")[0]
                    self.assertLess(abs(drop / (8 * ETA * U / H ** 2 * 2 * H) - 1), 0.03)

    def test_three_fluids_keep_their_volumes(self):
        channel_mesh(self.directory / "channel.msh", 6)
        text = CHANNEL + AIR + f"""[fluid.second]
viscosity = {ETA / 10}
[initial.drop]
fluid = second
shape = sphere
center = {1.6 * H} {H / 2}
radius = {0.3 * H}
[time]
end = 0.2
"""
        output = self.directory / "three"
        run("inject", self.case(text), output, ranks=2)
        for row in history(output):
            self.assertLess(abs(row["volume_error"]), 1e-3)

    def test_wrong_cases_end_with_2_and_say_why(self):
        channel_mesh(self.directory / "channel.msh", 4)
        whole = CHANNEL + AIR
        for change, words in ((("[vent.outlet]", "[wall.outlet]"), "sealed"),
                              (("[vent.outlet]\ngroup = cavity_x_high\n", ""), "cavity_x_high"),
                              (("fluid = polymer", "fluid = polymr"), "did you mean 'polymer'"),
                              (("flow_rate", "pressure = 1e5\nflow_rate"), "one of velocity, flow_rate and pressure"),
                              (("group = cavity_y_high", "group = cavity_y_low"), "already"),
                              (("fluid = air", "fluid = polymer"), "fills the cavity already"),
                              ((f"flow_rate = {U * H}", "flow_rate = -1"), "[inlet.gate] flow_rate = -1: an inlet lets fluid into"),
                              ((f"flow_rate = {U * H}", "flow_rate = \"1-t-2\""), "[inlet.gate] flow_rate: asks for -1 m^3/s at 0 s"),
                              ((f"flow_rate = {U * H}", "velocity = -1 0"), "[inlet.gate] velocity: asks for -0.004 m^3/s"),
                              (("[inlet.gate]\ngroup = cavity_x_low\nfluid = polymer\n" + f"flow_rate = {U * H}",
                                "[wall.gate]\ngroup = cavity_x_low"), "nothing moves the fluids")):
            with self.subTest(words=words):
                self.assertIn(change[0], whole)
                for ranks in (1, 2):
                    ended = run("inject", self.case(whole.replace(*change, 1)), self.directory / "wrong", ranks=ranks, check=False)
                    self.assertEqual(ended.returncode, 2, ended.stderr)
                    self.assertIn(words, ended.stderr)
                    self.assertRegex(ended.stderr, r"case\.ini")


if __name__ == "__main__":
    unittest.main()
