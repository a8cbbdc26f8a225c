"""Cavities whose air is void: not modelled, only its pressure acts.

Between plates the gate pressure grows by 12 eta U^2 / H^2 a second, as with two fluids. Air that nothing lets out is a gas,
p V = constant, where [air] says so.
"""
import pathlib
import tempfile
import unittest

import numpy as np

from box_msh import BoxMesh
from channel_case import AIR, CHANNEL, ETA, H, SLOPE, U, channel_mesh
from runs import history, run, summary

ATMOSPHERE = 101325.0
VOID = AIR.replace("viscosity = 0.1", "law = void")
SEALED = CHANNEL.replace("[vent.outlet]", "[wall.outlet]")
SLIPPING = SEALED.replace("[wall.outlet]", "[wall.outlet]\ncondition = slip").replace(
    "[wall.lower]", "[wall.lower]\ncondition = slip").replace("[wall.upper]", "[wall.upper]\ncondition = slip")


class Void(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def fill(self, text, name="case", *options, ranks=1, check=True):
        case = self.directory / f"{name}.ini"
        case.write_text(text)
        output = self.directory / f"out-{name}"
        result = run("inject", case, output, *options, ranks=ranks, check=check)
        return history(output) if check else result

    def test_gate_pressure_grows_as_with_air(self):
        channel_mesh(self.directory / "channel.msh", 6)
        rows = self.fill(CHANNEL + VOID + "[time]\nend = 0.35\n")
        late = [row for row in rows if row["time_s"] > 0.1]
        slope = np.polyfit([row["time_s"] - row["dt_s"] for row in late], [row["pressure_gate_Pa"] for row in late], 1)[0]
        self.assertLess(abs(slope / (SLOPE * U) - 1), 0.1)
        self.assertLess(max(abs(row["volume_error"]) for row in rows), 1e-9)
        three = self.fill(CHANNEL + VOID + "[time]\nend = 0.35\n", "three", ranks=3)
        self.assertLess(abs(three[-1]["pressure_gate_Pa"] / rows[-1]["pressure_gate_Pa"] - 1), 1e-3)

    def test_the_pressure_outside_lifts_all_pressures(self):
        channel_mesh(self.directory / "channel.msh", 4)
        text = CHANNEL + VOID + "[time]\nincrements = 3\n"
        low = self.fill(text, "low")
        high = self.fill(text.replace("[vent.outlet]", "[vent.outlet]\npressure = 5e4"), "high")
        for a, b in zip(low, high):
            self.assertAlmostEqual((b["pressure_gate_Pa"] - a["pressure_gate_Pa"]) / 5e4, 1, 4)

    def test_a_tube_turned_about_its_axis_and_a_slab_fill(self):
        tube = BoxMesh(2)
        tube.add("cavity", [0.0, 0.0], [H, 3 * H], [6, 18])
        tube.write(self.directory / "tube.msh")
        text = (f"[case]\ngeometry = axisymmetric\n[mesh]\nfile = tube.msh\n[fluid.polymer]\nviscosity = {ETA}\n[inlet.gate]\n"
                f"group = cavity_y_low\nfluid = polymer\nflow_rate = {np.pi * H ** 2 * U}\n[vent.outlet]\ngroup = cavity_y_high\n"
                f"[wall.pipe]\ngroup = cavity_x_high\n{VOID.replace('0.004 - x', '0.004 - y')}[time]\nend = 0.3\n")
        rows = self.fill(text, "tube", ranks=2)
        late = [row for row in rows if row["time_s"] > 0.12]
        slope = np.polyfit([row["time_s"] - row["dt_s"] for row in late], [row["pressure_gate_Pa"] for row in late], 1)[0]
        self.assertLess(abs(slope / (8 * ETA * U / H ** 2 * U) - 1), 0.1)
        slab = BoxMesh(3)
        slab.add("cavity", [0.0] * 3, [2 * H, H, H / 2], [8, 4, 2])
        slab.write(self.directory / "channel.msh")
        sides = "[symmetry.low]\ngroup = cavity_z_low\n[symmetry.high]\ngroup = cavity_z_high\n"
        rows = self.fill(CHANNEL.replace(f"flow_rate = {U * H}", f"flow_rate = {U * H * H / 2}") + sides + VOID, "slab", ranks=2)
        self.assertGreater(rows[-1]["fill_fraction"], 0.9)
        self.assertLess(max(abs(row["volume_error"]) for row in rows), 1e-3)

    def test_gas_in_a_closed_tube_is_compressed_by_the_closed_form(self):
        channel_mesh(self.directory / "channel.msh", 2)
        text = SLIPPING + VOID + "[time]\nend = 0.4\n[air]\ntrapped = gas\n"
        for ranks in (1, 2):
            rows = self.fill(text, f"gas-{ranks}", ranks=ranks)
            for row in rows:
                exact = ATMOSPHERE * (3 * H / (3 * H - U * row["time_s"]) - 1)
                self.assertLess(abs(row["trapped_air_Pa"] / exact - 1), 5e-3)
                self.assertLess(abs(row["pressure_gate_Pa"] / exact - 1), 5e-3)

    def test_gas_and_a_given_pressure_come_to_rest(self):
        channel_mesh(self.directory / "channel.msh", 4)
        pressed = SEALED.replace(f"flow_rate = {U * H}", "pressure = 1e5")
        last = self.fill(pressed + VOID + "[time]\nend = 1.6\nstep = 0.1\n[air]\ntrapped = gas\n")[-1]
        self.assertLess(abs(last["trapped_air_Pa"] / 1e5 - 1), 0.01)
        self.assertLess(abs(last["fill_fraction"] - (1 - 0.75 * ATMOSPHERE / (ATMOSPHERE + 1e5))), 0.003)

    def test_air_that_escapes_lets_a_closed_cavity_fill(self):
        channel_mesh(self.directory / "channel.msh", 4, length=2.0)
        rows = self.fill(SEALED + VOID + "[air]\ntrapped = vented\n")
        self.assertGreater(rows[-1]["fill_fraction"], 0.97)
        self.assertEqual(summary(self.directory / "out-case")["reason"], "cavity full")

    def test_what_makes_no_sense_is_refused(self):
        channel_mesh(self.directory / "channel.msh", 4)
        for text, words in ((SEALED + VOID, "sealed"),
                            (CHANNEL + AIR + "[air]\ntrapped = gas\n", "law = void"),
                            (CHANNEL.replace("fluid = polymer", "fluid = air") + VOID, "void")):
            with self.subTest(words=words):
                ended = self.fill(text, check=False)
                self.assertEqual(ended.returncode, 2, ended.stderr)
                self.assertIn(words, ended.stderr)


if __name__ == "__main__":
    unittest.main()
