"""Fronts in flows that stay as they are, traced back along the stream ([front] transport = trace)."""
import csv
import math
import unittest

from channel_case import CHANNEL, H, U
from filling import Filling, vortex
from runs import history, summary

ONCE = "[fluid.air]\nviscosity = 0.1\n[initial]\nfluid = air\n[flow]\nupdate = once\n[front]\ntransport = trace\n"
PROBE = "[accuracy]\ntwo_meshes = no\n[probe.line]\nfile = line.csv\nfields = arrival_time\n"
SLIPPING = CHANNEL.replace("[wall.lower]", "[wall.lower]\ncondition = slip").replace(
    "[wall.upper]", "[wall.upper]\ncondition = slip")
VORTEX = vortex(8) + """[mesh]
file = square.msh
[front]
transport = trace
[accuracy]
two_meshes = no
[time]
step = 2
end = 8
[output]
every = 100
"""


class Trace(Filling):
    def points(self, points):
        axes = "xyz"[:len(points[0])]
        (self.directory / "line.csv").write_text(
            "\n".join([",".join(axes)] + [",".join(map(str, point)) for point in points]) + "\n")

    def arrivals(self, output):
        """(x, y), arrival time at the probe's points."""
        with open(output / "probe-line.csv") as file:
            rows = list(csv.DictReader(file))
        return [(float(r["x"]), float(r["y"]), float(r["arrival_time"])) for r in rows if r["time_s"] == rows[-1]["time_s"]]

    def test_plugs_arrive_after_way_over_speed(self):
        plane = [(0.3 * k * H + 0.1 * H, y * H) for k in range(12) for y in (0.1, 0.45, 0.95)]
        self.box("channel", [4 * H, H], [32, 8])
        self.points(plane)
        for ranks in (1, 2, 4):
            output = self.solve(SLIPPING + ONCE + PROBE, f"plane-{ranks}", ranks=ranks)
            for x, _, time in self.arrivals(output):
                self.assertLess(abs(time - x / U), 1e-4 * H / U)
            rows = history(output)
            self.assertGreater(rows[-1]["fill_fraction"], 0.999)
            self.assertLess(max(abs(row["volume_error"]) for row in rows), 1e-9)
            self.assertEqual(summary(output)["status"], "done")

    def test_plugs_in_space_and_in_pipes_do_so_too(self):
        self.box("channel", [2 * H, H, H / 2], [12, 6, 3])
        self.points([(x * H, y * H, 0.2 * H) for x in (0.3, 0.9, 1.8) for y in (0.1, 0.6)])
        sides = "[symmetry.low]\ngroup = cavity_z_low\n[symmetry.high]\ngroup = cavity_z_high\n"
        text = SLIPPING.replace(f"flow_rate = {U * H}", f"flow_rate = {U * H * H / 2}") + sides + ONCE + PROBE
        for ranks in (1, 3):
            for x, _, time in self.arrivals(self.solve(text, f"space-{ranks}", ranks=ranks)):
                self.assertLess(abs(time - x / U), 1e-4 * H / U)
        self.box("channel", [H, 3 * H], [6, 18])
        self.points([(x * H, y * H) for x in (0.1, 0.8) for y in (0.3, 1.4, 2.9)])
        pipe = (f"[case]\ngeometry = axisymmetric\n[mesh]\nfile = channel.msh\n[fluid.polymer]\nviscosity = 1000\n[inlet.gate]\n"
                f"group = cavity_y_low\nfluid = polymer\nflow_rate = {math.pi * H ** 2 * U}\n[vent.outlet]\ngroup = cavity_y_high\n"
                f"[wall.pipe]\ngroup = cavity_x_high\ncondition = slip\n")
        for _, y, time in self.arrivals(self.solve(pipe + ONCE + PROBE, "pipe", ranks=2)):
            self.assertLess(abs(time - y / U), 1e-4 * H / U)

    def test_flow_between_plates_arrives_by_the_parabola(self):
        self.box("channel", [4 * H, H], [64, 16])
        self.points([(x * H, y * H) for x in (1, 2, 3) for y in (0.25, 0.5, 0.75)])
        one = self.arrivals(self.solve(CHANNEL + ONCE + PROBE, "one"))
        for x, y, time in one:
            exact = x / (6 * U * y / H * (1 - y / H))
            self.assertLess(abs(time / exact - 1), 0.02, (x, y))
        three = self.arrivals(self.solve(CHANNEL + ONCE + PROBE, "three", ranks=3))
        for a, b in zip(one, three):
            self.assertLess(abs(a[2] / b[2] - 1), 1e-3)

    def test_a_reversed_vortex_brings_the_disc_back(self):
        self.box("square", [1.0, 1.0], [48, 48])
        area = math.pi * 0.15 ** 2
        for ranks in (1, 3):
            output = self.solve(VORTEX, f"vortex-{ranks}", ranks=ranks)
            self.assertLess(summary(output)["accuracy"]["errors"]["level_set_l1"] / area, 0.004)

    def test_what_cannot_be_traced_is_refused(self):
        self.box("channel", [4 * H, H], [16, 4])
        text = CHANNEL + ONCE
        for name, wrong in {"update": text.replace("update = once", "update = auto"),
                            "remesh": text + "[remesh]\nsize = 1e-3\n",
                            "void": text.replace("viscosity = 0.1", "law = void")}.items():
            result = self.solve(wrong, name, check=False)
            self.assertEqual(result.returncode, 2, name)
            self.assertIn("trace", result.stderr)


if __name__ == "__main__":
    unittest.main()
