"""Forging with heat: closed forms of temperatures, balances of energy, and that scenes without heat have none."""
import math
import unittest

import h5py
import numpy

from box_msh import BoxMesh
from forging import Forging, K, box_mesh, case_text
from runs import summary

DENSITY, CAPACITY, CONDUCTIVITY = 7800.0, 700.0, 30.0
HEAT = f"density = {DENSITY}\nheat_capacity = {CAPACITY}\nconductivity = {CONDUCTIVITY}\n"
SIGMA = 5.670374419e-8


def with_heat(text, thermal="initial = 1300", constants=HEAT):
    """The case with constants in every body, and [thermal]."""
    return text.replace("law = norton-hoff\n", "law = norton-hoff\n" + constants) + f"[thermal]\n{thermal}\n"


class Upsetting(Forging):
    def test_what_deformation_spends_warms_the_body(self):
        # All of it, adiabatic: rho c dT = sigma de, sigma = f K (f e')^m, e' = V/H(t); f is sqrt(3), 2 in plane strain.
        m, end = 0.3, 0.7
        for dim, ranks in ((2, 2), (3, 1)):
            with self.subTest(dim=dim):
                box_mesh(self.directory / "box.msh", dim)
                factor = math.sqrt(3) if dim == 3 else 2
                work = factor * K * factor ** m * (end ** -m - 1) / m
                text = with_heat(case_text(m, dim, dim - 1, "boundaries", time="end = 0.3\nstep = 0.02"))
                row = self.forge(text, ranks=ranks)[-1]
                rise = row["temperature_billet_K"] - 1300
                self.assertAlmostEqual(rise / (work / DENSITY / CAPACITY), 1, delta=2e-3)
                self.assertAlmostEqual(row["max_temperature_K"] - row["min_temperature_K"], 0, delta=5e-4 * rise)  # newton_tolerance 1e-4
                heat = summary(self.directory / "out")["accuracy"]["heat"]
                self.assertAlmostEqual(heat["stored_J"] / heat["dissipated_J"], 1, delta=1e-7)
                half = text.replace("[thermal]", "[thermal]\ndissipation = 0.5")
                half_rise = self.forge(half, name="half")[-1]["temperature_billet_K"] - 1300
                self.assertAlmostEqual(half_rise / rise, 0.5, delta=1e-6)

    def test_a_revolved_scene_is_one_in_space(self):
        box_mesh(self.directory / "box.msh", 2)
        text = with_heat(case_text(0.3, 2, 1, "boundaries", time="increments = 8\nstep = 0.02"))
        text = text.replace("[mesh]", "[case]\ngeometry = axisymmetric\n[mesh]")
        revolved = self.forge(text)[-1]["temperature_billet_K"]
        box_mesh(self.directory / "box.msh", 3)
        solid = self.forge(with_heat(case_text(0.3, 3, 2, "boundaries", time="increments = 8\nstep = 0.02")))[-1]
        self.assertAlmostEqual((revolved - 1300) / (solid["temperature_billet_K"] - 1300), 1, delta=1e-5)

    def test_friction_and_deformation_heat_by_the_work_that_is_done(self):
        # Half of the friction's heat goes into the tools, which do not tell of it.
        box_mesh(self.directory / "box.msh", 2, cells=(6, 6))
        f = 0.3
        text = with_heat(case_text(0.3, 2, 1, "tools", time="increments = 6\nstep = 0.01"))
        text = text.replace("shape = plane\n", f"shape = plane\nfriction = {f}\n")
        rows = self.forge(text, "-D", "penalty.penalty=1e6")
        heat = summary(self.directory / "out")["accuracy"]["heat"]
        work = sum(row["force_upper_y_N"] * row["dt_s"] for row in rows)
        self.assertGreater(heat["friction_J"], 0.03 * heat["dissipated_J"])
        # Forces are those at the starts of the steps, the dissipation that of the whole steps.
        self.assertAlmostEqual((heat["dissipated_J"] + 2 * heat["friction_J"]) / work, 1, delta=0.02)

    def test_the_material_softens(self):
        box_mesh(self.directory / "box.msh", 2)
        text = with_heat(case_text(0.3, 2, 1, "boundaries", time="increments = 1\nstep = 1e-4"))
        cold = self.forge(text)[0]["force_high_y_N"]
        soft = text.replace("heat_capacity", 'softening = "exp(4000*(1/T - 1/1200))"\nheat_capacity')
        hot = self.forge(soft, name="soft")[0]["force_high_y_N"]
        self.assertAlmostEqual(hot / cold, math.exp(4000 * (1 / 1300 - 1 / 1200)), delta=1e-6)


class Contact(Forging):
    def two_blocks(self, extra=""):
        mesh = BoxMesh(2)
        mesh.add("lower", [0.0, 0.0], [0.1, 1.0], (1, 40))
        mesh.add("upper", [0.0, 1.0], [0.1, 2.0], (2, 50))
        mesh.write(self.directory / "box.msh")
        text = "[mesh]\nfile = box.msh\n[time]\nend = 2000\nstep = 25\n[thermal]\n"
        for body, temperature, k in (("lower", 300, 40.0), ("upper", 1000, 160.0)):
            text += (f"[body.{body}]\ngroup = {body}\nconsistency = {K!r}\nrate_sensitivity = 0.3\n"
                     f"density = {DENSITY}\nheat_capacity = {CAPACITY}\nconductivity = {k}\ntemperature = {temperature}\n"
                     f"[boundary.{body}]\ngroup = {body}_x_low\ntype = symmetry\n")
        return text + "[boundary.held]\ngroup = lower_y_low\nvelocity = 0 0\n[contact.middle]\nslave = upper\n" + extra

    def test_two_bodies_meet_at_the_temperature_of_their_effusivities(self):
        # Half spaces in perfect contact: the surface has (b1 T1 + b2 T2) / (b1 + b2), b = sqrt(k rho c), at once.
        self.forge(self.two_blocks("heat_transfer = 1e7\n"), "-D", "output.precision=float64", "-D", "output.every=1000", ranks=2)
        meet = (math.sqrt(40) * 300 + math.sqrt(160) * 1000) / (math.sqrt(40) + math.sqrt(160))
        files = sorted((self.directory / "out" / "case.fields").glob("s*.h5"))[-2:]
        points, temperatures = [], []
        for file in files:
            with h5py.File(file) as h5:
                for part in h5.values():
                    points += list(part["points"][:, 1])
                    temperatures += list(part["temperature"][:])
        y, found = numpy.array(points), numpy.array(temperatures)
        self.assertGreater(len(found), 100)
        for side, far, k in ((y < 1, 300, 40.0), (y > 1, 1000, 160.0)):
            width = math.sqrt(4 * k / DENSITY / CAPACITY * 2000)
            expected = [meet + (far - meet) * math.erf(abs(height - 1) / width) for height in y[side]]
            self.assertLess(numpy.abs(found[side] - expected).max(), 0.01 * 700)
        heat = summary(self.directory / "out")["accuracy"]["heat"]
        self.assertAlmostEqual(heat["stored_J"], 0, delta=1e-6 * DENSITY * CAPACITY * 0.1 * 500)

    def test_a_tool_chills_what_touches_it(self):
        # One temperature in a thin plate between two tools: rho c h dT/dt = - 2 a (T - T_tool), nothing moves.
        box_mesh(self.directory / "box.msh", 2, size=(1.0, 0.01))
        text = with_heat(case_text(0.3, 2, 1, "tools", time="end = 40\nstep = 0.4"),
                         constants=HEAT.replace("30.0", "1e5"))
        text = text.replace("velocity = 0 -1.0", "velocity = 0 0").replace("point = 0 1.0", "point = 0 0.01")
        text = text.replace("shape = plane\n", "shape = plane\ntemperature = 500\nheat_transfer = 1000\n")
        for ranks in (1, 2):
            row = self.forge(text, "-D", "output.every=1000", ranks=ranks)[-1]
            expected = 500 + 800 / (1 + 2 * 1000 * 0.4 / (DENSITY * CAPACITY * 0.01)) ** 100
            self.assertAlmostEqual(row["temperature_billet_K"], expected, delta=0.01)


class Cooling(Forging):
    """Bodies that nothing touches, so well conducting that they have one temperature."""

    def cool(self, thermal, dim=2, ranks=1, step=5.0):
        box_mesh(self.directory / "box.msh", dim)
        text = (f"[mesh]\nfile = box.msh\nlength_unit = cm\n[time]\nend = 200\nstep = {step}\n[body.billet]\n"
                f"group = billet\nconsistency = {K!r}\nrate_sensitivity = 0.3\n[thermal]\ninitial = 1500\n{thermal}\n")
        text = text.replace("group = billet\n", "group = billet\n" + HEAT.replace("30.0", "1e5"))
        return self.forge(text, "-D", "output.every=1000", ranks=ranks)

    def test_convection_is_exponential(self):
        for dim, ranks in ((2, 1), (3, 1)):
            rate = 2 * dim * 50 / (DENSITY * CAPACITY * 0.01)
            rows = self.cool("convection = 50\nambient = 300", dim, ranks)
            self.assertEqual(len(rows), 40)
            for row in rows:
                expected = 300 + 1200 * (1 + 5 * rate) ** -row["increment"]
                self.assertAlmostEqual(row["temperature_billet_K"], expected, delta=0.01)
            self.assertAlmostEqual((row["temperature_billet_K"] - 300) / 1200 / math.exp(-200 * rate), 1, delta=0.1)

    def test_radiation_goes_with_the_fourth_power(self):
        # To cold surroundings 1/T^3 grows in time.
        row = self.cool("emissivity = 0.8\nambient = 1 K", step=2)[-1]
        rate = 4 * 0.8 * SIGMA / (DENSITY * CAPACITY * 0.01)
        expected = (1500 ** -3 + 3 * rate * 200) ** (-1 / 3)
        self.assertAlmostEqual((1500 - row["temperature_billet_K"]) / (1500 - expected), 1, delta=0.015)

    def test_boundaries_give_heat_and_temperature(self):
        box_mesh(self.directory / "box.msh", 2)
        constants = HEAT.replace("30.0", "2e7")
        text = (f"[mesh]\nfile = box.msh\n[time]\nend = 20\nstep = 1\n[body.billet]\ngroup = billet\n{constants}"
                f"consistency = {K!r}\nrate_sensitivity = 0.3\n[thermal]\ninitial = 300\n"
                "[boundary.cold]\ngroup = billet_x_low\ntemperature = 300\n"
                "[boundary.hot]\ngroup = billet_x_high\nheat_flux = 2e9\n")
        row = self.forge(text)[-1]
        self.assertAlmostEqual(row["max_temperature_K"], 400, delta=0.5)
        self.assertAlmostEqual(row["temperature_billet_K"], 350, delta=0.5)


class Whole(Forging):
    """Heat in the life of a run: restarts, new meshes, ranks, and scenes without."""

    def hot(self, time="increments = 6\nstep = 0.02", cells=(4, 4)):
        box_mesh(self.directory / "box.msh", 2, cells=cells)
        text = with_heat(case_text(0.3, 2, 1, "tools", time=time), "emissivity = 0.7\ninitial = \"1200+100*y\"")
        text = text.replace("heat_capacity", 'softening = "exp(3000*(1/T - 1/1250))"\nheat_capacity')
        return text.replace("shape = plane\n", "shape = plane\nfriction = 0.2\ntemperature = 450\n")

    def test_ranks_and_restarts_agree(self):
        text = self.hot()
        reference = self.forge(text)
        for ranks in (2, 4):
            rows = self.forge(text, ranks=ranks, name=f"out{ranks}")
            for column in ("temperature_billet_K", "min_temperature_K", "max_temperature_K", "force_upper_y_N"):
                self.assertAlmostEqual(rows[-1][column] / reference[-1][column], 1, delta=1e-5)
        self.forge(text, "--steps", "3", ranks=2, name="parts")
        rows = self.forge(text, "--restart", ranks=2, name="parts")
        again = self.forge(text, ranks=2, name="whole")
        for column in ("temperature_billet_K", "min_temperature_K", "force_upper_y_N"):
            self.assertAlmostEqual(rows[-1][column] / again[-1][column], 1, delta=1e-7)

    def test_a_new_mesh_keeps_the_heat(self):
        # The heat content follows the balance of what goes in and out; each transfer may move it by little.
        text = self.hot(cells=(10, 10)) + "[remesh]\nevery = 1\n"
        rows = self.forge(text, ranks=2)
        kept = self.forge(self.hot(cells=(10, 10)), name="kept")
        self.assertEqual(sum(row["remeshed"] for row in rows), 5)
        self.assertAlmostEqual(rows[-1]["temperature_billet_K"], kept[-1]["temperature_billet_K"], delta=1.0)

    def test_the_next_operation_starts_hot(self):
        self.forge(self.hot(), name="first")
        last = summary(self.directory / "first")["final"]["temperature_billet_K"]
        text = self.hot(time="increments = 1\nstep = 1e-6") + "[initial]\nfrom = first\n"
        text = text.replace("point = 0 1.0", "point = 0 0.88")
        row = self.forge(text, name="second")[0]
        self.assertAlmostEqual(row["temperature_billet_K"], last, delta=0.1)

    def test_scenes_without_heat_have_none_of_it(self):
        box_mesh(self.directory / "box.msh", 2)
        row = self.forge(case_text(0.3, 2, 1, "tools"))[0]
        self.assertFalse([name for name in row if "temperature" in name])
        self.assertNotIn("heat", summary(self.directory / "out")["accuracy"])
        for file in (self.directory / "out" / "case.fields").glob("s*.h5"):
            with h5py.File(file) as h5:
                for part in h5.values():
                    self.assertNotIn("temperature", part)


if __name__ == "__main__":
    unittest.main()
