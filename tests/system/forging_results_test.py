"""Forging: what a run tells of itself beside forces: work, contact areas, die filling, folds, error budget."""
import os
import pathlib
import subprocess
import unittest

from box_msh import BoxMesh
from forging import Forging, K, box_mesh, case_text, flow_stress
from runs import history, run, summary


class Work(Forging):
    def test_power_balances_to_the_tolerance(self):
        # What tools give is what deformation, friction and the penalty take: an identity of the discrete equations.
        for dim, ranks in ((2, 2), (3, 1)):
            with self.subTest(dim=dim):
                box_mesh(self.directory / "box.msh", dim, cells=(4, 4, 3))
                text = case_text(0.3, dim, dim - 1, "tools", time="increments = 3\nstep = 0.01")
                text = text.replace("shape = plane\n", "shape = plane\nfriction = 0.3\n")
                rows = self.forge(text, "-D", "solver.newton_tolerance=1e-7", "-D", "motion.volume_target=no",
                                  ranks=ranks)
                work = summary(self.directory / "out")["accuracy"]["work"]
                force = f"force_upper_{'xyz'[dim - 1]}_N"
                self.assertAlmostEqual(sum(row[force] * row["dt_s"] for row in rows) / work["tools_J"], 1, delta=1e-9)
                self.assertLess(abs(work["imbalance"]), 1e-5)
                self.assertGreater(work["contact_J"], 0.02 * work["tools_J"])

    def test_frictionless_deformation_takes_all_work(self):
        box_mesh(self.directory / "box.msh", 2)
        row = self.forge(case_text(0.3, 2, 1, "boundaries"))[0]
        work = summary(self.directory / "out")["accuracy"]["work"]
        self.assertAlmostEqual(work["deformation_J"] / (flow_stress(2, 1, 0.3) * 1e-3), 1, delta=1e-3)
        self.assertAlmostEqual(work["imposed_J"] / work["deformation_J"], 1, delta=1e-4)
        self.assertEqual(row["folds"], 0)


class Surface(Forging):
    def test_contact_areas_and_filling(self):
        # The tool's line is three times as long as the billet is wide.
        box_mesh(self.directory / "box.msh", 2)
        text = case_text(0.3, 2, 1, "tools", time="increments = 2\nstep = 0.02")
        lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", "2", "1 2 1 0", "2 -1 1 0", "$EndNodes",
                 "$Elements", "1", "1 1 2 1 1 2 1", "$EndElements", ""]
        (self.directory / "tool.msh").write_text("\n".join(lines))
        plane = "shape = plane\npoint = 0 1.0\nnormal = 0 -1.0\n"
        self.assertIn(plane, text)
        rows = self.forge(text.replace(plane, "shape = surface\nfile = tool.msh\n"), ranks=2)
        for row in rows:
            width = 1 / (1 - 0.02 * (row["increment"] - 1))
            self.assertAlmostEqual(row["contact_area_upper_m2"] / width, 1, delta=1e-3)
            self.assertAlmostEqual(row["filling_upper"] * 3 / width, 1, delta=1e-3)
            self.assertAlmostEqual(row["contact_area_lower_m2"] / width, 1, delta=1e-3)
            self.assertNotIn("filling_lower", row)

    def notched(self, depth):
        """A plate with a notch in its upper side that is pressed from both sides and closes."""
        mesh = BoxMesh(2)
        mesh.add("billet", [-1.0, 0.0], [1.0, 1.0], (20, 8))
        for point in mesh.points:
            point[1] *= 1 - depth * max(0.0, 1 - abs(point[0]) / 0.4)
        mesh.write(self.directory / "box.msh")
        return ("[mesh]\nfile = box.msh\n[time]\nstroke = 0.36\nstep = 0.02\n[body.billet]\ngroup = billet\n"
                f"consistency = {K!r}\nrate_sensitivity = 1\n"
                "[boundary.left]\ngroup = billet_x_low\nvelocity = 1 free\n"
                "[boundary.right]\ngroup = billet_x_high\nvelocity = -1 free\n"
                "[boundary.ground]\ngroup = billet_y_low\ntype = symmetry\n")

    def test_a_crease_that_closes_is_a_fold(self):
        for depth, folds in ((0.6, 1), (0.0, 0)):
            for ranks in (1, 3)[:1 + folds]:
                rows = self.forge(self.notched(depth), "-D", "output.every=1000", ranks=ranks)
                self.assertEqual(rows[0]["folds"], 0)
                self.assertEqual(rows[-1]["folds"], folds)
                found = summary(self.directory / "out")["accuracy"]["folds"]
                self.assertEqual(len(found), folds)
                for fold in found:
                    self.assertAlmostEqual(fold["place_m"][0], 0, delta=0.02)
                    self.assertGreater(fold["time_s"], 0.05)
                    self.assertIn("begins to fold at", (self.directory / "out" / "run.log").read_text())


class PaperForging(Forging):
    def test_it_is_remeshed_each_increment_and_balances(self):
        case = pathlib.Path(os.environ["MALLEUS_SOURCE"]) / "cases" / "paper-forging"
        mesh = self.directory / "paper.msh"
        subprocess.run([case / "mesh", "--size", "6", "--die-size", "12", "-o", mesh], check=True, capture_output=True)
        run("forge", case / "case.ini", self.directory / "out", "-D", f"mesh.file={mesh}", "-D", "time.increments=6")
        rows = history(self.directory / "out")
        self.assertEqual([row["remeshed"] for row in rows][1:], [1] * 5)
        for row in rows:
            self.assertAlmostEqual(row["force_upper_z_N"] / row["force_lower_z_N"], -1, delta=1e-4)
            self.assertLess(abs(row["volume_change"]), 1e-4)
        # What held on the old mesh tells what holds on the new one: 14 to 26 iterations where it does not.
        iterations = [row["newton_iterations"] for row in rows[2:]]
        self.assertLessEqual(sum(iterations) / len(iterations), 7)


class Budget(Forging):
    def shares(self, *options):
        box_mesh(self.directory / "box.msh", 2)
        text = case_text(0.3, 2, 1, "tools", time="stroke = 0.1")
        self.forge(text, "-D", "output.every=1000", *options)
        result = summary(self.directory / "out")["accuracy"]
        return {share["source"]: share for share in result["error_budget"]}

    def test_it_names_what_to_turn(self):
        standard = self.shares()
        for source in ("time", "contact", "volume", "nonlinear", "linear", "balance", "cut-off"):
            self.assertIn(source, standard)
        self.assertEqual(standard["time"]["knob"], "[motion] strain")
        euler = self.shares("-D", "motion.scheme=euler")
        self.assertGreater(euler["time"]["relative"], 10 * standard["time"]["relative"])
        stiff = self.shares("-D", "penalty.penalty=1e6")
        self.assertAlmostEqual(stiff["contact"]["relative"] / standard["contact"]["relative"], 0.01, delta=1e-4)
        # The true error of the time scheme is of the size that is told: F(end) is known.
        self.assertLess(euler["time"]["relative"], 0.05)


if __name__ == "__main__":
    unittest.main()
