"""Forging against closed forms, through the executable.

Frictionless upsetting of a prism between flat ends is homogeneous: with the rate V/H along the axis, a free axis carries
nothing, and F = A sqrt(3) K (sqrt(3) V/H)^m; in plane strain F = A 2 K (2 V/H)^m. Exact on any mesh.
"""
import math
import unittest

from box_msh import BoxMesh
from forging import Forging, K, box_mesh, case_text, flow_stress, symmetries, vector
from runs import history, run, summary


class Upsetting(Forging):
    TOLERANCE = 1e-6
    SHARP = f"[solver]\nnewton_tolerance = {TOLERANCE}\nlinear_tolerance = 1e-9\ncutoff_strain_rate = 1e-6\n"

    def test_force_is_exact_where_the_velocity_is_imposed(self):
        for dim, axis in ((2, 0), (2, 1), (3, 0), (3, 1), (3, 2)):
            box_mesh(self.directory / "box.msh", dim)
            for m in (1, 0.5, 0.3, 0.1):
                with self.subTest(dim=dim, axis=axis, m=m):
                    row = self.forge(case_text(m, dim, axis, "boundaries", extra=self.SHARP),
                                     "-D", "motion.scheme=euler")[0]
                    force = flow_stress(dim, 1, m)
                    self.assertAlmostEqual(row[f"force_high_{'xyz'[axis]}_N"] / force, 1, delta=10 * self.TOLERANCE)
                    self.assertAlmostEqual(row[f"force_low_{'xyz'[axis]}_N"] / force, -1, delta=10 * self.TOLERANCE)
                    self.assertLessEqual(row["newton_iterations"], 1 if m == 1 else 15)

    def test_a_row_counts_the_iterations_of_its_own_solve(self):
        # The first increment solves twice, at its start and at its middle.
        box_mesh(self.directory / "box.msh", 2)
        rows = self.forge(case_text(1, 2, 1, "boundaries", time="increments = 2\nstep = 1e-3"))
        self.assertEqual([row["newton_iterations"] for row in rows], [1, 1])
        self.assertIn("newton 1+1,", (self.directory / "out" / "run.log").read_text())

    def test_a_tool_presses_by_the_penalty_law(self):
        # r = c eta / edge: p = r (V - what is left of it on each side), so F is that of the speed V - 2 p / r.
        dim, axis, c = 2, 1, 1e2
        box_mesh(self.directory / "box.msh", dim, cells=(4, 4))
        for m in (1, 0.3):
            with self.subTest(m=m):
                extra = self.SHARP + f"[penalty]\npenalty = {c}\naugmented = no\n"
                row = self.forge(case_text(m, dim, axis, "tools", extra=extra), "-D", "motion.scheme=euler")[0]
                viscosity = K * math.sqrt(3) ** (m - 1)
                r = c * viscosity / 0.25
                pressure = row["force_upper_y_N"]
                self.assertAlmostEqual(pressure / flow_stress(dim, 1 - 2 * pressure / r, m), 1, delta=1e-5)
                self.assertGreater(1 - pressure / flow_stress(dim, 1, m), 1e-4)
                self.assertAlmostEqual(row["max_penetration_m"] / (pressure / r * 1e-3), 1, delta=1e-4)

    def test_the_augmented_lagrangian_forgets_the_penalty(self):
        box_mesh(self.directory / "box.msh", 2, cells=(4, 4))
        extra = self.SHARP + "[penalty]\npenalty = 100\naugmented = yes\npenetration = 1e-9\n"
        row = self.forge(case_text(0.3, 2, 1, "tools", extra=extra), "-D", "motion.scheme=euler")[0]
        self.assertAlmostEqual(row["force_upper_y_N"] / flow_stress(2, 1, 0.3), 1, delta=1e-5)

    def test_euler_loses_volume_by_its_discrete_map(self):
        # A step multiplies the height by 1 - e and each free width by 1 + e (plane strain), 1 + e/2 (3D).
        box_mesh(self.directory / "box.msh", 2, cells=(2, 2))
        rows = self.forge(case_text(0.3, 2, 1, "boundaries", time="increments = 4\nstep = 0.05"),
                          "-D", "motion.scheme=euler", "-D", "solver.newton_tolerance=1e-10",
                          "-D", "solver.linear_tolerance=1e-12")
        height, volume = 1.0, 1.0
        for row in rows:
            strain = 0.05 / height
            height -= 0.05
            volume *= (1 - strain) * (1 + strain)
            self.assertAlmostEqual(row["volume_change"], volume - 1, delta=1e-9)

    def test_second_order_schemes_keep_volume_and_force(self):
        box_mesh(self.directory / "box.msh", 2, cells=(2, 2))
        errors = {}
        for scheme in ("adams-bashforth-2", "runge-kutta-2", "euler"):
            for steps in (4, 8):
                rows = self.forge(case_text(0.3, 2, 1, "boundaries", time=f"increments = {steps}\nstep = {0.2 / steps}"),
                                  "-D", f"motion.scheme={scheme}", "-D", "motion.volume_target=no",
                                  "-D", "solver.newton_tolerance=1e-9", "-D", "solver.linear_tolerance=1e-11")
                errors[scheme, steps] = abs(rows[-1]["volume_change"])
        self.assertLess(errors["euler", 4] / errors["euler", 8], 2.6)
        self.assertGreater(errors["adams-bashforth-2", 4] / errors["adams-bashforth-2", 8], 3.2)
        self.assertGreater(errors["runge-kutta-2", 4] / errors["runge-kutta-2", 8], 3.2)
        self.assertLess(errors["adams-bashforth-2", 8], 0.1 * errors["euler", 8])

    def test_the_volume_target_holds_the_volume(self):
        box_mesh(self.directory / "box.msh", 2, cells=(2, 2))
        rows = self.forge(case_text(0.3, 2, 1, "boundaries", time="increments = 8\nstep = 0.05"))
        self.assertLess(abs(rows[-1]["volume_change"]), 4e-4)
        raw = summary(self.directory / "out")["accuracy"]["raw_volume_drift"]
        self.assertGreater(abs(raw), 5 * abs(rows[-1]["volume_change"]))

    def test_ranks_agree_and_runs_repeat(self):
        box_mesh(self.directory / "box.msh", 3, cells=(3, 3, 3))
        text = case_text(0.3, 3, 2, "tools", time="increments = 3\nstep = 0.02", extra=self.SHARP)
        reference = self.forge(text)
        column = "force_upper_z_N"
        for ranks in (2, 3, 4):
            rows = self.forge(text, ranks=ranks, name=f"out{ranks}")
            for row, expected in zip(rows, reference):
                self.assertAlmostEqual(row[column] / expected[column], 1, delta=1e-5)
        again = self.forge(text, ranks=2, name="again")
        ignored = {"wall_s"}
        first = history(self.directory / "out2")
        for row, expected in zip(again, first):
            self.assertEqual({k: v for k, v in row.items() if k not in ignored},
                             {k: v for k, v in expected.items() if k not in ignored})

    def test_units_do_not_matter(self):
        # The same block in m and Pa, and in mm, MPa; friction 0.3 in mm and s is 300 in m and s.
        forces = []
        for unit, size, pressure, friction in (("m", 1.0, "Pa", 300e-3), ("mm", 1000.0, "Pa", 300e-3)):
            box_mesh(self.directory / "box.msh", 2, size=(size, size), cells=(4, 4))
            text = case_text(0.3, 2, 1, "tools", time="increments = 2\nstep = 0.02")
            text = text.replace("file = box.msh", f"file = box.msh\nlength_unit = {unit}")
            text = text.replace("normal = 0 -1.0", f"normal = 0 -1.0\nfriction = {friction}")
            if unit == "mm":
                text = text.replace("point = 0 1.0", "point = 0 1000 mm").replace("velocity = 0 -1.0", "velocity = 0 -1000 mm/s")
                text = text.replace(f"consistency = {K!r}", "consistency = 179.2 MPa.s^m")
            forces.append(self.forge(text)[-1]["force_upper_y_N"])
        self.assertAlmostEqual(forces[1] / forces[0], 1, delta=1e-8)


class Reference(Forging):
    """Homogeneous flows lie in the space of the elements: their errors are those of the solver."""
    SHARP = "[solver]\nnewton_tolerance = 1e-9\nlinear_tolerance = 1e-11\n"

    def test_a_revolved_upsetting_meets_its_known_solution(self):
        # v = (r/2, -z) V/H; |grad v|^2 = 1/4 + 1/4 + 1 over the volume pi of the cylinder
        box_mesh(self.directory / "box.msh", 2, cells=(4, 4))
        text = case_text(0.3, 2, 1, "boundaries", time="increments = 2\nstep = 0.01").replace(symmetries(2, 1), "")
        text = "[case]\ngeometry = axisymmetric\n" + text + self.SHARP
        # The height is 1 - t: rates at the start of an increment, when forces and fields are taken, follow it.
        good = '[reference]\nvelocity_x = "x/2/(1-t)"\nvelocity_y = "-y/(1-t)"\n'
        off = '[reference]\nvelocity_x = "x"\nvelocity_y = "-y"\n'
        for ranks in (1, 3):
            self.forge(text + good, "-D", "motion.volume_target=no", ranks=ranks)
            errors = summary(self.directory / "out")["accuracy"]["errors"]
            self.assertLess(errors["velocity_l2"], 1e-4)  # the height after one step of a second-order scheme
            self.assertLess(errors["velocity_h1_relative"], 1e-4)
            rows = self.forge(text + off, "-D", "reference.at=every", "-D", "time.increments=1", ranks=ranks)
            # error of the gradients: 1/2 in two of them; known: 1, 1, 1
            self.assertAlmostEqual(rows[0]["velocity_h1"] / math.sqrt(0.5 * math.pi), 1, delta=1e-6)
            errors = summary(self.directory / "out")["accuracy"]["errors"]
            self.assertAlmostEqual(errors["velocity_h1"], rows[0]["velocity_h1"], delta=1e-15)
            self.assertAlmostEqual(errors["velocity_h1_relative"], math.sqrt(0.5 / 3), delta=1e-6)
            # error of the values: r/2, integral of r^2/4 2 pi r = pi/8
            self.assertAlmostEqual(rows[0]["velocity_l2"] / math.sqrt(math.pi / 8), 1, delta=1e-6)

    def test_errors_are_in_the_history_only_where_asked(self):
        box_mesh(self.directory / "box.msh", 2)
        text = case_text(0.3, 2, 1, "boundaries") + '[reference]\nvelocity_x = "x"\nvelocity_y = "-y"\n'
        self.assertNotIn("velocity_l2", self.forge(text)[0])
        self.assertLess(self.forge(text, "-D", "reference.at=every")[0]["velocity_l2"], 1e-3)


class Robustness(Forging):
    def stick(self, m, *options, check=True):
        box_mesh(self.directory / "box.msh", 2, cells=(6, 6))
        text = case_text(m, 2, 1, "tools", time="increments = 2\nstep = 0.02")
        text = text.replace("shape = plane\n", "shape = plane\nfriction = 1e3\n")
        (self.directory / "case.ini").write_text(text)
        return run("forge", self.directory / "case.ini", self.directory / "out", *options, check=check)

    def test_picard_helps_where_newton_fails(self):
        self.stick(0.3)
        expected = history(self.directory / "out")[0]["force_upper_y_N"]
        said = self.stick(0.3, "-D", "solver.max_newton=2").stdout
        self.assertIn("Picard's method", said)
        row = history(self.directory / "out")[0]
        self.assertAlmostEqual(row["dt_s"], 0.02 / 8, delta=1e-9)
        self.assertAlmostEqual(row["force_upper_y_N"] / expected, 1, delta=1e-3)

    def test_what_does_not_converge_is_never_accepted(self):
        result = self.stick(0.3, "-D", "solver.newton_tolerance=1e-15", "-D", "solver.linear_tolerance=1e-12", check=False)
        self.assertEqual(result.returncode, 3)
        for part in ("neither Newton's nor Picard's method converges", "worst at (", "The last good state is that of increment 0"):
            self.assertIn(part, result.stderr)
        self.assertEqual(summary(self.directory / "out")["exit_code"], 3)

    def test_steps_that_lose_volume_are_shortened(self):
        for dim in (2, 3):
            box_mesh(self.directory / "box.msh", dim)
            text = case_text(0.3, dim, 1, "tools", time="stroke = 0.5\nstep = 0.3")
            text = text.replace("shape = plane\n", "shape = plane\nfriction = 1\n")
            rows = self.forge(text)
            self.assertLess(max(row["dt_s"] for row in rows), 0.2)
            self.assertLess(max(abs(row["volume_change"]) for row in rows), 1e-2)
            self.assertLess(abs(rows[-1]["volume_change"]), 2e-3)

    def test_lost_volume_is_told(self):
        box_mesh(self.directory / "box.msh", 2)
        self.forge(case_text(0.3, 2, 1, "boundaries", time="increments = 3\nstep = 0.1"), "-D", "motion.scheme=euler")
        warnings = summary(self.directory / "out")["warnings"]
        self.assertEqual(sum("the volume of the bodies has changed by" in text for text in warnings), 1)


class Gravity(Forging):
    def test_the_ground_bears_the_weight(self):
        for dim in (2, 3):
            axis = dim - 1
            box_mesh(self.directory / "box.msh", dim, cells=(3, 3, 3))
            text = case_text(1, dim, axis, "tools").replace("rate_sensitivity = 1", "rate_sensitivity = 1\ndensity = 7800")
            text = text[:text.index("[tool.upper]")] + text[text.index("[tool.lower]"):]
            row = self.forge(text + f"[gravity]\nacceleration = {vector(dim, axis, -9.81)}\n", ranks=2)[0]
            self.assertAlmostEqual(row[f"force_lower_{'xyz'[axis]}_N"] / (-7800 * 9.81), 1, delta=1e-5)

    def test_a_viscous_column_sinks_at_its_rate(self):
        # Plane strain, H = 1, free on one side: mean axial stress rho g (H - y) = 4 eta e, mean over y: e = rho g H / (8 eta).
        # With m = 1, eta = K: the top sinks with the integral of e, rho g H^2 / (8 eta), but for shear near the corners.
        box_mesh(self.directory / "box.msh", 2, size=(0.1, 1.0), cells=(3, 30))
        eta = 1e4
        text = case_text(1, 2, 1, "tools", time="increments = 1\nstep = 1e-6").replace(f"{K!r}", repr(eta))
        text = text.replace("rate_sensitivity = 1", "rate_sensitivity = 1\ndensity = 1000")
        text = text[:text.index("[tool.upper]")] + text[text.index("[tool.lower]"):]
        text += "[gravity]\nacceleration = 0 -10\n[probe.top]\npoint = 0.05 0.999\nfields = velocity\n"
        self.forge(text)
        with open(self.directory / "out" / "probe-top.csv") as file:
            speed = float(file.read().splitlines()[-1].split(",")[-1])
        self.assertAlmostEqual(-speed / (1000 * 10 / (8 * eta)), 1, delta=0.03)


class Chained(Forging):
    def test_two_operations_are_one(self):
        # Half of the stroke, then the other half as a case of its own, on another number of ranks.
        for dim in (2, 3):
            with self.subTest(dim=dim):
                box_mesh(self.directory / "box.msh", dim)
                axis = dim - 1
                column = f"force_upper_{'xyz'[axis]}_N"
                text = case_text(0.3, dim, axis, "tools", time="increments = 8\nstep = 0.02")
                text = text.replace("shape = plane\n", "shape = plane\nfriction = 0.5\n")
                text += f"[probe.centre]\npoint = {' '.join(['0.45'] * dim)}\nfields = equivalent_strain\n"
                whole = self.forge(text, name="whole")
                strain = self.strain_at_the_probe("whole")
                self.forge(text.replace("increments = 8", "increments = 4"), ranks=2, name="first")
                second = text.replace("increments = 8", "increments = 4").replace(
                    f"point = {vector(dim, axis, 1.0)}", f"point = {vector(dim, axis, 0.92)}")
                rows = self.forge(second + "[initial]\nfrom = first\n", ranks=3, name="second")
                self.assertEqual(rows[0]["increment"], 1)
                self.assertAlmostEqual(rows[-1]["time_s"], 0.08, delta=1e-12)
                self.assertAlmostEqual(rows[-1][column] / whole[-1][column], 1, delta=2e-3)
                self.assertAlmostEqual(self.strain_at_the_probe("second") / strain, 1, delta=2e-2)

    def strain_at_the_probe(self, name):
        with open(self.directory / name / "probe-centre.csv") as file:
            return float(file.read().splitlines()[-1].split(",")[-1])

    def test_what_is_no_run_is_refused(self):
        box_mesh(self.directory / "box.msh", 2)
        (self.directory / "nothing").mkdir()
        (self.directory / "case.ini").write_text(case_text(0.3, 2, 1, "tools") + "[initial]\nfrom = nothing\n")
        for ranks in (1, 2):
            result = run("forge", self.directory / "case.ini", self.directory / "out", ranks=ranks, check=False)
            self.assertEqual(result.returncode, 2)
            self.assertIn("there is no complete state of a run", result.stderr)


class Contact(Forging):
    def blocks(self, dim, lower_cells, upper_cells, time="increments = 1\nstep = 1e-3", consistency=K):
        mesh = BoxMesh(dim)
        mesh.add("lower", [0.0] * dim, [1.0] * dim, lower_cells[:dim])
        low = [0.0] * dim
        low[1] = 1.0
        high = [1.0] * dim
        high[1] = 2.0
        mesh.add("upper", low, high, upper_cells[:dim])
        mesh.write(self.directory / "box.msh")
        text = f"[mesh]\nfile = box.msh\n[time]\n{time}\n"
        for body, k in (("lower", consistency), ("upper", K)):
            text += f"[body.{body}]\ngroup = {body}\nconsistency = {k!r}\nrate_sensitivity = 0.3\n"
            for axis in "xz"[:dim - 1]:
                text += f"[boundary.{body}_{axis}]\ngroup = {body}_{axis}_low\ntype = symmetry\n"
        for name, group, speed in (("top", "upper_y_high", -2.0), ("bottom", "lower_y_low", 0.0)):
            velocity = " ".join(repr(speed) if a == 1 else "free" for a in range(dim))
            text += f"[boundary.{name}]\ngroup = {group}\nvelocity = {velocity}\n"
        return text + ("[contact.middle]\nslave = upper\nmaster = lower\n"
                       "[solver]\nnewton_tolerance = 1e-6\nlinear_tolerance = 1e-8\ncutoff_strain_rate = 1e-6\n"
                       "[penalty]\npenalty = 1e4\naugmented = yes\npenetration = 1e-8\n")

    def test_block_on_block_is_one_block(self):
        # Nodes against facets without friction do not pass the patch test exactly where meshes do not match:
        # 1e-4 in force with the finer slave, 2e-3 with the coarser.
        for dim, lower, upper, tolerance in ((2, (4, 4), (4, 4), 2e-5), (2, (4, 4), (7, 7), 1e-3),
                                             (3, (2, 2, 2), (2, 2, 2), 2e-5), (3, (2, 2, 2), (3, 3, 3), 5e-3)):
            with self.subTest(dim=dim, lower=lower, upper=upper):
                row = self.forge(self.blocks(dim, lower, upper), "-D", "motion.scheme=euler")[0]
                force = flow_stress(dim, 1, 0.3)
                self.assertAlmostEqual(row["force_top_y_N"] / force, 1, delta=tolerance)
                self.assertAlmostEqual(row["force_lower_y_N"] / row["force_top_y_N"], -1, delta=1e-5)
                self.assertAlmostEqual(row["force_bottom_y_N"] / row["force_top_y_N"], -1, delta=1e-5)

    def test_bodies_in_contact_agree_on_any_ranks(self):
        text = self.blocks(3, (2, 2, 2), (3, 3, 3), time="increments = 2\nstep = 0.01")
        reference = self.forge(text)
        for ranks in (2, 3, 4):
            rows = self.forge(text, ranks=ranks, name=f"out{ranks}")
            for row, expected in zip(rows, reference):
                self.assertAlmostEqual(row["force_lower_y_N"] / expected["force_lower_y_N"], 1, delta=1e-5)

    def test_a_warm_start_knows_the_contacts(self):
        # Sliding blocks that stick hard: the contacts of the last increment are a guess that Newton hardly mends.
        for dim, lower, upper in ((2, (4, 4), (7, 7)), (3, (2, 2, 2), (3, 3, 3))):
            text = self.blocks(dim, lower, upper, time="increments = 4\nstep = 0.02", consistency=3 * K)
            rows = self.forge(text.replace("slave = upper\n", "slave = upper\nfriction = 1000\n"))
            self.assertLessEqual(rows[0]["newton_iterations"], 20)  # two solves from a cold start
            for row in rows[1:]:
                self.assertLessEqual(row["newton_iterations"], 6)

    def test_a_restart_knows_the_contacts(self):
        text = self.blocks(2, (4, 4), (7, 7), time="increments = 6\nstep = 0.02", consistency=3 * K)
        text = text.replace("slave = upper\n", "slave = upper\nfriction = 1000\n")
        whole = self.forge(text)
        self.forge(text, "--steps", "3", ranks=2, name="parts")
        rows = self.forge(text, "--restart", name="parts")
        self.assertEqual(len(rows), 6)
        for row, expected in zip(rows[3:], whole[3:]):
            self.assertAlmostEqual(row["force_top_y_N"] / expected["force_top_y_N"], 1, delta=1e-5)
            self.assertLessEqual(row["newton_iterations"], 6)

    def test_friction_between_bodies_balances(self):
        text = self.blocks(2, (4, 4), (6, 6), consistency=3 * K).replace("slave = upper\n", "slave = upper\nfriction = 1\n")
        row = self.forge(text)[0]
        self.assertAlmostEqual(row["force_lower_y_N"] / row["force_top_y_N"], -1, delta=1e-5)
        self.assertAlmostEqual(row["force_bottom_y_N"] / row["force_top_y_N"], -1, delta=1e-5)
        self.assertGreater(abs(row["force_lower_x_N"]), 1e-3 * row["force_top_y_N"])

    def test_a_rigid_body_is_a_master_without_unknowns(self):
        text = self.blocks(2, (4, 4), (6, 6)).replace("rate_sensitivity = 0.3\n", "law = rigid\n", 1)
        text = text.replace(f"consistency = {K!r}\nlaw = rigid", "law = rigid")
        row = self.forge(text, "-D", "motion.scheme=euler")[0]
        self.assertAlmostEqual(row["force_top_y_N"] / flow_stress(2, 2, 0.3), 1, delta=1e-4)
        self.assertAlmostEqual(row["force_lower_y_N"] / row["force_top_y_N"], -1, delta=1e-5)

    def test_friction_raises_the_force_up_to_sticking(self):
        box_mesh(self.directory / "box.msh", 2, cells=(6, 6))
        forces = []
        for friction in (0, 0.1, 1, 1e2, 1e5):
            text = case_text(0.3, 2, 1, "tools").replace("normal = 0 -1.0", f"normal = 0 -1.0\nfriction = {friction}")
            text = text.replace("normal = 0 1.0", f"normal = 0 1.0\nfriction = {friction}")
            forces.append(self.forge(text)[0]["force_upper_y_N"])
        for low, high in zip(forces, forces[1:]):
            self.assertGreater(high, low)
        self.assertLess(forces[-1] / forces[-2] - 1, 0.02)  # sticking already
        self.assertLess(forces[-1] / forces[0], 2)

    def test_limited_friction_is_bounded_by_sticking(self):
        box_mesh(self.directory / "box.msh", 2, cells=(6, 6))
        forces = []
        for keys in ("", "friction_law = tresca\nfriction = 0.2\n", "friction_law = tresca\nfriction = 1\n",
                     "friction_law = coulomb\nfriction = 0.1\n"):
            text = case_text(0.3, 2, 1, "tools").replace("shape = plane\n", "shape = plane\n" + keys)
            forces.append(self.forge(text)[0]["force_upper_y_N"])
        self.assertTrue(forces[0] < forces[1] < forces[2], forces)
        self.assertTrue(forces[0] < forces[3] < forces[2], forces)

    def test_a_tool_that_does_not_touch_yet_comes_in_one_free_step(self):
        box_mesh(self.directory / "box.msh", 2, cells=(3, 3))
        text = case_text(0.3, 2, 1, "tools", time="increments = 2\nstep = 0.5").replace("point = 0 1.0", "point = 0 1.1")
        rows = self.forge(text)
        self.assertAlmostEqual(rows[0]["time_s"], 0.1, delta=1e-12)
        self.assertEqual(rows[0]["force_upper_y_N"], 0)
        self.assertEqual(rows[0]["newton_iterations"], 0)
        self.assertGreater(rows[1]["force_upper_y_N"], 0.9 * flow_stress(2, 1, 0.3))


class SurfaceTools(Forging):
    """A tool from a gmsh file does what the plane does that it draws."""

    @staticmethod
    def write_msh(path, dim, points, facets):
        lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(points))]
        lines += [f"{i} " + " ".join(repr(float(c)) for c in p) for i, p in enumerate(points, 1)]
        lines += ["$EndNodes", "$Elements", str(len(facets))]
        lines += [f"{i} {dim - 1} 2 1 1 " + " ".join(str(n + 1) for n in f) for i, f in enumerate(facets, 1)]
        path.write_text("\n".join(lines + ["$EndElements", ""]))

    def check(self, dim, points, facets, ranks=1, keys=""):
        axis = dim - 1
        box_mesh(self.directory / "box.msh", dim)
        self.write_msh(self.directory / "tool.msh", dim, points, facets)
        text = case_text(0.3, dim, axis, "tools", time="increments = 2\nstep = 0.02")
        expected = self.forge(text, ranks=ranks)
        plane = f"shape = plane\npoint = {vector(dim, axis, 1.0)}\nnormal = {vector(dim, axis, -1.0)}\n"
        self.assertIn(plane, text)
        surface = f"shape = surface\nfile = tool.msh\nlength_unit = mm\n{keys}"
        rows = self.forge(text.replace(plane, surface), ranks=ranks, name="surface")
        for row, other in zip(rows, expected):
            column = f"force_upper_{'xyz'[axis]}_N"
            self.assertAlmostEqual(row[column] / other[column], 1, delta=1e-6)

    def test_triangles_are_a_tool(self):
        # A block above the billet, its faces turned at random; closed, so that they are turned outward.
        mm = 1000.0
        points = [(x, y, z) for z in (mm, 1.5 * mm) for y in (-mm, 3 * mm) for x in (-mm, 3 * mm)]
        quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
        facets = [t for i, (a, b, c, d) in enumerate(quads)
                  for t in ([(a, b, c), (c, a, d)] if i % 2 else [(a, c, b), (a, c, d)])]
        for ranks in (1, 3):
            self.check(3, points, facets, ranks=ranks)

    def test_lines_are_a_tool_in_two_dimensions(self):
        # From left to right the right-hand side, the material's, is below.
        mm = 1000.0
        points = [(x * mm, mm, 0) for x in (-1, 0.4, 1.3, 3)]
        self.check(2, points, [(0, 1), (1, 2), (3, 2)])
        self.check(2, points, [(3, 2), (2, 1), (0, 1)], keys="material = inside\n", ranks=2)

    def test_files_without_a_surface_are_refused(self):
        box_mesh(self.directory / "box.msh", 2)
        self.write_msh(self.directory / "tool.msh", 2, [(0, 0, 0)], [])
        text = case_text(0.3, 2, 1, "tools") + "[tool.other]\nshape = surface\nfile = tool.msh\n"
        (self.directory / "case.ini").write_text(text)
        for ranks in (1, 2):
            result = run("forge", self.directory / "case.ini", self.directory / "out", ranks=ranks, check=False)
            self.assertEqual(result.returncode, 2)
            self.assertIn("tool.msh: the file has no lines", result.stderr)


class Revolved(Forging):
    """Axisymmetric scenes: x is the radius, y the axis; forces are those of the whole revolution."""

    def scene(self, m, tool, time, size=(1.0, 1.0), cells=(8, 8)):
        box_mesh(self.directory / "box.msh", 2, size=size, cells=cells)
        return ("[case]\ngeometry = axisymmetric\n" +
                f"[mesh]\nfile = box.msh\n[time]\n{time}\n[body.billet]\ngroup = billet\nconsistency = {K!r}\n"
                f"rate_sensitivity = {m}\n[tool.upper]\n{tool}"
                "[tool.lower]\nshape = plane\npoint = 0 0\nnormal = 0 1\n")

    PLANE = "shape = plane\npoint = 0 1\nnormal = 0 -1\nvelocity = 0 -1\n"

    def test_a_plane_upsets_a_disc(self):
        for m in (1, 0.3):
            rows = self.forge(self.scene(m, self.PLANE, "increments = 3\nstep = 0.01"),
                              "-D", "solver.cutoff_strain_rate=1e-6")
            for i, row in enumerate(rows):
                height = 1 - 0.01 * i
                force = math.pi / height * math.sqrt(3) * K * (math.sqrt(3) / height) ** m
                self.assertAlmostEqual(row["force_upper_y_N"] / force, 1, delta=2e-3)
                self.assertAlmostEqual(row["volume_m3"] / math.pi, 1, delta=1e-4)

    def test_a_container_stops_the_flow_outward(self):
        container = "[tool.wall]\nshape = cylinder\nmaterial = inside\npoint = 0 0\naxis = 0 1\nradius = 1.05\n"
        rows = self.forge(self.scene(0.3, self.PLANE, "stroke = 0.08\nstep = 0.01") + container)
        # free until R = 1.05, at H = 1/1.05^2 = 0.907: a plain disc before, no pressure on the wall
        first = [row for row in rows if row["stroke_upper_m"] < 0.07]
        self.assertTrue(all(row["force_wall_x_N"] == 0 for row in first))
        rows = self.forge(self.scene(0.3, self.PLANE, "stroke = 0.092\nstep = 0.01") + container)
        free = math.pi / 0.908 * math.sqrt(3) * K * (math.sqrt(3) / 0.908) ** 0.3
        self.assertAlmostEqual(rows[-1]["force_upper_y_N"] / free, 1, delta=0.05)

    def test_a_sphere_presses_a_disc_as_in_three_dimensions(self):
        tool = "shape = sphere\npoint = 0 3\nradius = 2\nvelocity = 0 -1\nfriction = 1e3\n"
        rows = self.forge(self.scene(1, tool, "increments = 6\nstep = 0.01", cells=(12, 12)))
        mesh = BoxMesh(3)
        mesh.add("billet", [0.0] * 3, [1.0] * 3, (8, 8, 8))
        # The quarter of a cylinder: squares become discs.
        mesh.points = [[x * math.sqrt(1 - y * y / 2), y * math.sqrt(1 - x * x / 2), z] for x, y, z in mesh.points]
        mesh.write(self.directory / "box.msh")
        text = (f"[mesh]\nfile = box.msh\n[time]\nincrements = 6\nstep = 0.01\n[body.billet]\ngroup = billet\n"
                f"consistency = {K!r}\nrate_sensitivity = 1\n"
                "[boundary.x]\ngroup = billet_x_low\ntype = symmetry\n[boundary.y]\ngroup = billet_y_low\ntype = symmetry\n"
                "[tool.upper]\nshape = sphere\npoint = 0 0 3\nradius = 2\nvelocity = 0 0 -1\nfriction = 1e3\n"
                "[tool.lower]\nshape = plane\npoint = 0 0 0\nnormal = 0 0 1\n")
        solid = self.forge(text, ranks=2, name="solid")
        self.assertGreater(rows[-1]["force_upper_y_N"], 2 * rows[0]["force_upper_y_N"])
        self.assertAlmostEqual(4 * solid[-1]["force_upper_z_N"] / rows[-1]["force_upper_y_N"], 1, delta=0.1)


def work_done(rows):
    """J, of the upper tool: the force of a row over what it moved in it."""
    strokes = [0.0] + [row["stroke_upper_m"] for row in rows]
    return sum(row["force_upper_y_N"] * (after - before) for row, before, after in zip(rows, strokes, strokes[1:]))


class Presses(Forging):
    """Frictionless upsetting in plane strain, height 1, volume 1: F = (1/H) 2 K (2 w/H)^m."""

    def press(self, keys, time):
        box_mesh(self.directory / "box.msh", 2, cells=(2, 2))
        text = case_text(0.5, 2, 1, "tools", time=time).replace("normal = 0 -1.0", "normal = 0 -1.0\n" + keys)
        if "stroke_file" in keys:
            text = text.replace("velocity = 0 -1.0\n", "")
        return self.forge(text, "-D", "solver.newton_tolerance=1e-6", "-D", "solver.linear_tolerance=1e-9",
                          "-D", "solver.cutoff_strain_rate=1e-4", "-D", "penalty.augmented=yes")

    def test_the_hydraulic_press_keeps_its_force(self):
        # F = 2 K (2w)^m / H^(1+m) constant: dH/dt = -w, w = (F/2K)^(1/m) H^((1+m)/m) / 2
        limit = 1e8
        rows = self.press(f"press = hydraulic\nforce_limit = {limit}", "end = 2\nstep = 0.05")
        for row in rows:
            self.assertAlmostEqual(row["force_upper_y_N"] / limit, 1, delta=1e-4)
        height, steps = 1.0, 20000
        for _ in range(steps):
            middle = height - 0.5 * 2 / steps * 0.5 * (limit / (2 * K)) ** 2 * height ** 3
            height -= 2 / steps * 0.5 * (limit / (2 * K)) ** 2 * middle ** 3
        self.assertAlmostEqual(rows[-1]["stroke_upper_m"] / (1 - height), 1, delta=2e-3)

    def test_the_hammer_stops_when_its_energy_is_spent(self):
        mass, speed = 1e8, 1.0
        energy = 0.5 * mass * speed**2
        rows = self.press(f"press = hammer\nenergy = {energy}\nmass = {mass}", "end = 10\nstep = 0.01")
        self.assertAlmostEqual(work_done(rows) / energy, 1, delta=0.03)
        self.assertLess(rows[-1]["time_s"], 10)

    def test_the_crank_follows_its_rod(self):
        # height of the ram over its lowest position: r (1 - cos a) + l - sqrt(l^2 - r^2 sin^2 a), a before it
        r, l, rate = 0.2, 0.5, 2.0

        def height(angle):
            return r * (1 - math.cos(angle)) + l - math.sqrt(l * l - (r * math.sin(angle)) ** 2)

        angle = math.radians(70)
        end = 1.2 * angle / rate  # past the lowest position
        rows = self.press(f"press = crank\ncrank_radius = {r}\nrod_length = {l}\nrotation_speed = {rate}\n"
                          f"start_height = {height(angle)!r}", f"end = {end!r}\nstep = 0.03")
        for row in rows:
            stroke = height(angle) - height(angle - rate * row["time_s"])
            self.assertAlmostEqual(row["stroke_upper_m"], stroke, delta=1e-9)
            going_down = rate * (row["time_s"] - row["dt_s"]) < angle
            start = angle - rate * (row["time_s"] - row["dt_s"])
            left = 1 - (height(angle) - height(start))
            speed = rate * (height(start + 1e-6) - height(start - 1e-6)) / 2e-6
            if going_down and rate * row["time_s"] < angle:  # F = 2 K (2 w/H)^m / H
                self.assertAlmostEqual(row["force_upper_y_N"] / (2 * K * (2 * speed / left) ** 0.5 / left), 1, delta=0.03)
        self.assertEqual(rows[-1]["force_upper_y_N"], 0)  # going up it has left the material

    def test_the_screw_press_spends_its_energy(self):
        mass, speed = 1e8, 0.5
        energy = 0.5 * mass * speed**2
        rows = self.press(f"press = screw\nenergy = {energy}\nmass = {mass}", "end = 10\nstep = 0.01")
        self.assertAlmostEqual(work_done(rows) / energy, 1, delta=0.03)
        self.assertIn("came to rest", summary(self.directory / "out")["reason"])

    def test_the_hydraulic_press_stalls_where_nothing_yields(self):
        # The block has no way out: the press keeps its force, and the stroke is what the penalty gives.
        limit = 1e8
        box_mesh(self.directory / "box.msh", 2, cells=(4, 4))
        text = case_text(0.5, 2, 1, "tools", time="end = 0.1\nstep = 0.02")
        text = text.replace("normal = 0 -1.0", f"normal = 0 -1.0\npress = hydraulic\nforce_limit = {limit}")
        text += "[boundary.wall]\ngroup = billet_x_high\ntype = symmetry\n"
        rows = self.forge(text, "-D", "solver.newton_tolerance=1e-7", "-D", "solver.linear_tolerance=1e-9")
        for row in rows:
            self.assertAlmostEqual(row["force_upper_y_N"] / limit, 1, delta=2e-3)
        self.assertLess(rows[-1]["stroke_upper_m"], 1e-3)
        self.assertGreaterEqual(rows[-1]["stroke_upper_m"], 0)

    def test_a_container_turns_the_material_with_it(self):
        box_mesh(self.directory / "box.msh", 2, cells=(6, 6))
        text = case_text(0.3, 2, 1, "tools", time="end = 0.1\nstep = 0.005")
        text = text[:text.index("[boundary")] + (
            "[tool.box]\nshape = box\nmaterial = inside\npoint = 0.5 0.5\nsize = 1 1\nspin = 1\npivot = 0.5 0.5\n"
            "[probe.corner]\npoint = 0.9 0.5\nmoves = with-material\nfields = equivalent_strain\n")
        for ranks in (1, 2):
            rows = self.forge(text, ranks=ranks)
            with open(self.directory / "out" / "probe-corner.csv") as file:
                last = file.read().splitlines()[-1].split(",")
            x, y = float(last[2]) - 0.5, float(last[3]) - 0.5
            self.assertAlmostEqual(math.hypot(x, y), 0.4, delta=1e-3)
            self.assertAlmostEqual(math.atan2(y, x), 0.1, delta=1e-3)
            self.assertLess(float(last[-1]), 5e-3)
            self.assertLess(abs(rows[-1]["volume_change"]), 1e-3)

    def test_a_table_moves_the_tool(self):
        (self.directory / "stroke.csv").write_text("time,position\n0,0\n0.1,0.02\n0.2,0.1\n")
        rows = self.press("stroke_file = stroke.csv", "end = 0.2\nstep = 0.02")
        self.assertAlmostEqual(rows[-1]["stroke_upper_m"], 0.1, delta=1e-9)


if __name__ == "__main__":
    unittest.main()
