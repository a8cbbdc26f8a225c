"""Filling with inertia: the driven cavity, channels that start from rest, a dam that breaks.

Cavity: U. Ghia, K. N. Ghia, C. T. Shin, J. Comput. Phys. 48 (1982) 387, table I. Dam: J. C. Martin, W. J. Moyce,
Phil. Trans. R. Soc. A 244 (1952) 312, columns twice as high as wide.
"""
import csv
import math
import unittest

from filling import Filling
from runs import history, summary

# y: velocity along the lid at x = 1/2, for Re 100 and 400
GHIA = {0.0547: (-0.03717, -0.08186), 0.1016: (-0.06434, -0.14612), 0.1719: (-0.10150, -0.24299), 0.2813: (-0.15662, -0.32726),
        0.4531: (-0.21090, -0.17119), 0.5: (-0.20581, -0.11477), 0.6172: (-0.13641, 0.02135), 0.7344: (0.00332, 0.16256),
        0.8516: (0.23151, 0.29093), 0.9531: (0.68717, 0.55892), 0.9766: (0.84123, 0.75837)}
CAVITY = """[mesh]
file = cavity.msh
[fluid.oil]
viscosity = 0.01
density = 1
[boundary.lid]
group = cavity_y_high
velocity = 1 0
[wall.low]
group = cavity_y_low
[wall.left]
group = cavity_x_low
[wall.right]
group = cavity_x_high
[inertia]
[accuracy]
two_meshes = no
[time]
increments = 0
[probe.line]
file = line.csv
fields = velocity
"""
NU, H, PRESSURE = 0.01, 1.0, 0.12
START = f"""[mesh]
file = channel.msh
[fluid.oil]
viscosity = {NU}
density = 1
[inlet.gate]
group = cavity_x_low
pressure = {PRESSURE}
[vent.out]
group = cavity_x_high
[wall.low]
group = cavity_y_low
[wall.high]
group = cavity_y_high
[inertia]
[accuracy]
two_meshes = no
[output]
every = 1000
[time]
"""
A, G = 0.146, 9.81
DAM = f"""[mesh]
file = dam.msh
[fluid.water]
viscosity = 1e-3
density = 1000
[fluid.air]
viscosity = 1.8e-5
density = 1.2
[initial]
fluid = air
[initial.column]
fluid = water
shape = box
center = 0 0
size = {2 * A} {4 * A}
[vent.top]
group = cavity_y_high
[wall.low]
group = cavity_y_low
condition = slip
[wall.left]
group = cavity_x_low
condition = slip
[wall.right]
group = cavity_x_high
condition = slip
[inertia]
[gravity]
acceleration = 0 {-G}
[accuracy]
two_meshes = no
[time]
step = 0.005
end = 0.24
[output]
every = 1000
[probe.floor]
file = floor.csv
fields = fill_time
"""
# front over the column's width: time times sqrt(2 g / a)
MARTIN_MOYCE = {2.11: 1.83, 2.33: 1.98, 2.56: 2.20, 2.78: 2.32, 3.00: 2.51, 3.22: 2.65}


def started(time):
    """Share of the steady flow between plates that start under a pressure, by the series."""
    odd = range(1, 100, 2)
    return 1 - sum(96 / (n * math.pi) ** 4 * math.exp(-(n * math.pi / H) ** 2 * NU * time) for n in odd)


def started_in_pipe(time):
    """The same in a pipe of radius H (Szymanski 1932), by zeros of J0."""
    zeros = [2.404825557695773, 5.520078110286311, 8.653727912911013, 11.79153443901428, 14.93091770848779, 18.07106396791092]
    return 1 - sum(32 / z ** 4 * math.exp(-(z / H) ** 2 * NU * time) for z in zeros)


class Inertia(Filling):
    def points(self, name, points):
        (self.directory / f"{name}.csv").write_text("x,y\n" + "".join(f"{x},{y}\n" for x, y in points))

    def probed(self, output, name):
        with open(output / f"probe-{name}.csv") as file:
            rows = list(csv.DictReader(file))
        return [row for row in rows if row["time_s"] == rows[-1]["time_s"]]

    def test_the_driven_cavity_agrees_with_ghia(self):
        self.box("cavity", [1.0, 1.0], [32, 32])
        self.points("line", [(0.5, y) for y in GHIA])
        for k, (viscosity, allowed) in enumerate(((0.01, 0.006), (0.0025, 0.016))):
            for ranks in (1, 3):
                output = self.solve(CAVITY, f"{k}-{ranks}", "-D", f"fluid.oil.viscosity={viscosity}", ranks=ranks)
                for row, known in zip(self.probed(output, "line"), GHIA.values()):
                    self.assertLess(abs(float(row["velocity_x"]) - known[k]), allowed, f"Re {1 / viscosity}, {row}")

    def test_flow_between_plates_starts_by_the_series(self):
        self.box("channel", [1.0, H], [8, 16])
        errors = []
        for step in (2, 1):
            rows = history(self.solve(START + f"step = {step}\nend = 20\n", f"plates-{step}"))
            steady = PRESSURE * H ** 3 / (12 * NU)
            errors.append(max(abs(row["flow_gate_m3_s"] / steady - started(row["time_s"])) for row in rows))
        self.assertLess(errors[1], 7e-3)  # of the first step, which is backward Euler's
        self.assertLess(errors[1], 0.6 * errors[0])
        rows = history(self.solve(START + "step = 2\nend = 20\n", "three", ranks=3))
        known = history(self.directory / "out-plates-2")
        self.assertLess(abs(rows[-1]["flow_gate_m3_s"] / known[-1]["flow_gate_m3_s"] - 1), 2e-4)

    def test_flow_in_a_pipe_and_a_slab_starts_by_the_series(self):
        self.box("channel", [H, 1.0], [16, 8])
        pipe = START.replace("cavity_x_low", "gate").replace("cavity_x_high", "out").replace("[wall.low]\ngroup = cavity_y_low\n", "")
        pipe = pipe.replace("cavity_y_high", "cavity_x_high").replace("= gate", "= cavity_y_low").replace("= out", "= cavity_y_high")
        pipe = "[case]\ngeometry = axisymmetric\n" + pipe
        rows = history(self.solve(pipe + "step = 1\nend = 20\n", "pipe", ranks=2))
        steady = math.pi * PRESSURE * H ** 4 / (8 * NU)
        for row in rows:
            self.assertLess(abs(row["flow_gate_m3_s"] / steady - started_in_pipe(row["time_s"])), 2e-2, row["time_s"])
        self.box("channel", [0.5, H, 0.25], [2, 10, 1])
        sides = "[symmetry.low]\ngroup = cavity_z_low\n[symmetry.high]\ngroup = cavity_z_high\n"
        rows = history(self.solve(sides + START + "step = 1\nend = 10\n", "slab", ranks=2))
        steady = PRESSURE / 0.5 * H ** 3 / (12 * NU) * 0.25
        for row in rows:
            self.assertLess(abs(row["flow_gate_m3_s"] / steady - started(row["time_s"])), 2e-2, row["time_s"])

    def test_a_dam_breaks_as_measured(self):
        self.box("dam", [4 * A, 3 * A], [40, 30])
        self.points("floor", [(z * A, 1e-3) for z in MARTIN_MOYCE])
        for ranks in (1, 2):
            output = self.solve(DAM, f"dam-{ranks}", ranks=ranks)
            for row, known in zip(self.probed(output, "floor"), MARTIN_MOYCE.values()):
                time = float(row["fill_time"]) * math.sqrt(2 * G / A)
                # Columns that are let go at once run ahead of those behind a gate that is drawn, by 0.1 to 0.4.
                self.assertLess(time, known + 0.05)
                self.assertGreater(time, known - 0.45)
            self.assertLess(max(abs(row["volume_error"]) for row in history(output)), 1e-9)
            self.assertEqual(summary(output)["status"], "done")

    def test_what_inertia_needs_is_asked_for(self):
        self.box("channel", [1.0, H], [4, 4])
        wrong = {"density": START.replace("density = 1\n", "") + "step = 1\nend = 2\n",
                 "step": START + "end = 2\n",
                 "update": START + "step = 1\nend = 2\n[flow]\nupdate = once\n"}
        for key, text in wrong.items():
            result = self.solve(text, key, check=False)
            self.assertEqual(result.returncode, 2, key)
            self.assertIn(key, result.stderr)


if __name__ == "__main__":
    unittest.main()
