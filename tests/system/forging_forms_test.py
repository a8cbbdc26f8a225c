"""Forging against closed forms beyond upsetting: sticking discs, rigid motion, filled cavities, stacks, bodies that nearly touch."""
import csv
import itertools
import math
import unittest

from box_msh import BoxMesh
from forging import K, Forging, box_mesh, flow_stress, vector
from runs import history, run


def scott(radius, height, m, speed=1.0):
    """N: thin disc of a power-law fluid between sticking plates (Scott 1931)."""
    return (math.pi * K * (speed * (2 * m + 1) / (4 * m)) ** m * (2 / height) ** (2 * m + 1) * radius ** (m + 3) / (m + 3))


def body(name, m=0.3, consistency=K):
    return f"[body.{name}]\ngroup = {name}\nconsistency = {consistency!r}\nrate_sensitivity = {m}\n"


class ThinDisc(Forging):
    def test_a_sticking_disc_tends_to_the_film_of_lubrication_theory(self):
        # At height / diameter = 0.05 the force is 1.0034 (m = 1) and 1.048 (m = 0.3) of the film's (axisymmetric
        # solutions on fine meshes).
        for m, ratio, tolerance in ((1, 1.0034, 0.02), (0.3, 1.048, 0.03)):
            box_mesh(self.directory / "box.msh", 2, size=(1.0, 0.1), cells=(40, 8))
            text = ("[case]\ngeometry = axisymmetric\n[mesh]\nfile = box.msh\n[time]\nincrements = 1\nstep = 1e-6\n" +
                    body("billet", m) +
                    "[boundary.upper]\ngroup = billet_y_high\nvelocity = 0 -1\n[boundary.lower]\ngroup = billet_y_low\n"
                    "velocity = 0 0\n[solver]\ncutoff_strain_rate = 1e-4\n")
            for ranks in (1, 3):
                row = self.forge(text, ranks=ranks)[0]
                self.assertAlmostEqual(abs(row["force_upper_y_N"]) / scott(1, 0.1, m) / ratio, 1, delta=tolerance)


class RigidMotion(Forging):
    def test_turning_and_moving_strain_nothing(self):
        for dim in (2, 3):
            box_mesh(self.directory / "box.msh", dim, cells=(3, 3, 3))
            velocity = "velocity_x = 0.5 - (y - 0.3)\nvelocity_y = (x - 0.2) - 0.1\n" + ("velocity_z = 0.25\n" if dim == 3 else "")
            text = "[mesh]\nfile = box.msh\n[time]\nincrements = 1\nstep = 1e-3\n" + body("billet")
            for axis, side in itertools.product("xyz"[:dim], ("low", "high")):
                text += f"[boundary.{axis}_{side}]\ngroup = billet_{axis}_{side}\n{velocity}"
            text += f"[probe.inside]\npoint = {'0.4 ' * dim}\nfields = strain_rate velocity\n"
            for ranks in (1, 2, 4):
                self.forge(text, ranks=ranks)
                with open(self.directory / "out" / "probe-inside.csv", newline="") as file:
                    last = list(csv.DictReader(file))[-1]
                self.assertLess(float(last["strain_rate"]), 1e-12)
                self.assertAlmostEqual(float(last["velocity_x"]), 0.4, delta=1e-3)
                self.assertAlmostEqual(float(last["velocity_y"]), 0.1, delta=1e-3)


class Cavity(Forging):
    """Walls that are 2 % away: full where the height has fallen to 1/1.02 (1/1.02^2 in space)."""

    LIMIT = 40 * K

    def scene(self, dim, end, press):
        # The corner nodes are held by two or three planes.
        box_mesh(self.directory / "box.msh", dim, cells=(4, 4, 4))
        up = "0 " * (dim - 1)
        text = (f"[mesh]\nfile = box.msh\n[time]\n{end}\nstep = 0.005\n[penalty]\npenalty = 1e5\n" + body("billet") +
                f"[tool.upper]\nshape = plane\npoint = {up}1\nnormal = {up}-1\nvelocity = {up}-1\n{press}"
                f"[tool.lower]\nshape = plane\npoint = {up}0\nnormal = {up}1\n")
        for axis in range(dim - 1):
            text += f"[tool.wall_{'xy'[axis]}]\nshape = plane\npoint = {vector(dim, axis, 1.02)}\nnormal = {vector(dim, axis, -1)}\n"
            text += f"[boundary.plane_{'xy'[axis]}]\ngroup = billet_{'xy'[axis]}_low\ntype = symmetry\n"
        return text

    def test_a_die_fills_into_its_corners(self):
        for dim in (2, 3):
            rows = self.forge(self.scene(dim, "stroke = 0.1", f"press = hydraulic\nforce_limit = {self.LIMIT!r}\n"))
            self.assertAlmostEqual(rows[-1]["stroke_upper_m"], 1 - 1.02 ** (1 - dim), delta=1e-5)
            self.assertLess(abs(rows[-1]["volume_change"]), 1e-6)
            self.assertIn("stalled at its force limit", (self.directory / "out" / "run.log").read_text())

    def test_a_full_die_holds_the_press_at_its_limit(self):
        for dim, ranks in ((2, 1), (3, 1), (3, 3)):
            rows = self.forge(self.scene(dim, "end = 0.06", f"press = hydraulic\nforce_limit = {self.LIMIT!r}\n"), ranks=ranks)
            self.assertAlmostEqual(rows[-1]["time_s"], 0.06)
            for row in rows[-3:]:
                self.assertAlmostEqual(row[f"force_upper_{'xyz'[dim - 1]}_N"] / self.LIMIT, 1, delta=2e-3)
                # The pressure is the same all around.
                self.assertAlmostEqual(abs(row["force_wall_x_x_N"]) / self.LIMIT, 1.02**-dim, delta=5e-3)
                self.assertAlmostEqual(row["stroke_upper_m"], 1 - 1.02 ** (1 - dim), delta=1e-5)
                self.assertLess(abs(row["volume_change"]), 1e-6)

    def test_tools_that_go_on_in_a_full_die_end_the_run(self):
        for dim in (2, 3):
            case = self.directory / "case.ini"
            case.write_text(self.scene(dim, "end = 0.06", ""))
            result = run("forge", case, self.directory / "out", check=False)
            self.assertEqual(result.returncode, 3, result.stdout + result.stderr)
            self.assertIn("the die is full", result.stderr)
            for row in history(self.directory / "out"):
                self.assertLess(row["force_upper_y_N" if dim == 2 else "force_upper_z_N"], 5 * K)


class Stack(Forging):
    """Two blocks under a moving end, without friction: one block of twice the height."""

    def scene(self, distance):
        mesh = BoxMesh(2)
        mesh.add("lower", [0.0, 0.0], [1.0, 1.0], (4, 4))
        mesh.add("upper", [0.0, 1.0 + distance], [1.0, 2.0 + distance], (6, 6))
        mesh.write(self.directory / "box.msh")
        text = "[mesh]\nfile = box.msh\n[time]\nincrements = 3\nstep = 0.01\n" + body("lower") + body("upper")
        for name in ("lower", "upper"):
            text += f"[boundary.{name}_x]\ngroup = {name}_x_low\ntype = symmetry\n"
        return text + ("[boundary.top]\ngroup = upper_y_high\nvelocity = free -2\n[boundary.bottom]\ngroup = lower_y_low\n"
                       "velocity = free 0\n[contact.middle]\nslave = upper\nmaster = lower\n")

    def test_bodies_a_millionth_apart_or_overlapping_touch(self):
        for distance in (0.0, 1e-6, -1e-6):
            for ranks in (1, 2):
                rows = self.forge(self.scene(distance), ranks=ranks)
                for i, row in enumerate(rows):
                    height = 2 - 2 * 0.01 * i
                    force = flow_stress(2, 2 / height, 0.3) * 2 / height
                    self.assertAlmostEqual(abs(row["force_top_y_N"]) / force, 1, delta=5e-3)


if __name__ == "__main__":
    unittest.main()
