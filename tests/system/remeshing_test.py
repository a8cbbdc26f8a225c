"""[remesh] in runs: the mesh is made anew while a block is upset and follows the front of a filling; forces, volumes and
restarts do not notice."""
import csv
import os
import pathlib
import subprocess
import tempfile
import unittest

import small_meshes
from channel_case import AIR, CHANNEL, channel_mesh
from runs import PATIENCE, history, run

FORGE = pathlib.Path(os.environ["MALLEUS_BIN"]) / "forge"

CASE = """[mesh]
file = box.msh
[time]
stroke = {stroke} m
step = 0.025
[body.b]
group = body
law = norton-hoff
consistency = 1e6
rate_sensitivity = 0.5
[tool.upper]
shape = plane
point = {zero} 1
normal = {zero} -1
velocity = {zero} -1
friction = 0.5
[tool.lower]
shape = plane
point = {zero} 0
normal = {zero} 1
friction = 0.5
[output]
every = 100
"""


class Remeshing(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def forge(self, name, dim, remesh, *words, cells=4, stroke=0.5, ranks=1):
        (self.folder / "box.msh").write_text(small_meshes.box(dim, cells).msh())
        case = self.folder / f"{name}.ini"
        case.write_text(CASE.format(stroke=stroke, zero="0" if dim == 2 else "0 0") + remesh)
        launch = ["mpiexec", "-n", str(ranks)] if ranks > 1 else []
        result = subprocess.run([*launch, FORGE, "--quiet", "-o", self.folder / name, *words, case],
                                capture_output=True, text=True, timeout=240 * PATIENCE)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        with open(self.folder / name / "history.csv") as file:
            return [{key: float(value) for key, value in row.items() if value} for row in csv.DictReader(file)]

    def test_force_and_volume_go_on_through_remeshes(self):
        for dim, size, all_ranks in ((2, 0.08, (1, 2)), (3, 0.2, (1, 3))):
            axis = "xyz"[dim - 1]
            forces = []
            for ranks in all_ranks:
                with self.subTest(dim=dim, ranks=ranks):
                    rows = self.forge(f"run{dim}{ranks}", dim, f"[remesh]\nsize = {size}\n", ranks=ranks)
                    self.assertEqual(rows[0]["remeshed"], 1)  # the input is coarser than asked
                    self.assertGreaterEqual(sum(row["remeshed"] for row in rows), 2)
                    for before, row in zip(rows, rows[1:]):
                        self.assertLess(abs(row[f"force_upper_{axis}_N"] / before[f"force_upper_{axis}_N"] - 1), 0.12)
                        self.assertLess(abs(row["volume_change"]), 1e-3)
                        self.assertGreater(row["min_quality"], 0.1)
                    forces.append(rows[-1][f"force_upper_{axis}_N"])
            self.assertLess(max(forces) / min(forces), 1.03)

    def test_the_same_sizes_every_few_increments(self):
        rows = self.forge("every", 2, "[remesh]\nevery = 5\n", cells=8, stroke=0.3)
        self.assertEqual([int(row["increment"]) for row in rows if row["remeshed"]], [6, 11])
        self.assertAlmostEqual(rows[-1]["nodes"] / rows[0]["nodes"], 1, delta=0.35)

    def test_a_node_count_is_kept(self):
        rows = self.forge("count", 2, "[remesh]\nnodes = 300\nevery = 4\n", cells=8, stroke=0.3)
        self.assertGreater(sum(row["remeshed"] for row in rows), 1)
        self.assertAlmostEqual(rows[-1]["nodes"] / 300, 1, delta=0.3)

    def test_an_error_target_refines(self):
        coarse = self.forge("coarse", 2, "[remesh]\nerror = 0.3\nevery = 3\n", cells=6, stroke=0.2)
        fine = self.forge("fine", 2, "[remesh]\nerror = 0.08\nevery = 3\n", cells=6, stroke=0.2)
        self.assertGreater(fine[-1]["nodes"], 2 * coarse[-1]["nodes"])

    def test_a_restarted_run_gives_the_same_rows(self):
        remesh = "[remesh]\nsize = 0.1\nevery = 4\n"
        whole = self.forge("whole", 2, remesh, stroke=0.3, ranks=2)
        self.forge("parts", 2, remesh, "--steps", "6", stroke=0.3, ranks=2)
        parts = self.forge("parts", 2, remesh, "--restart", stroke=0.3, ranks=2)
        self.assertEqual(len(whole), len(parts))
        for a, b in zip(whole, parts):
            self.assertEqual((a["nodes"], a["remeshed"]), (b["nodes"], b["remeshed"]))
            self.assertAlmostEqual(a["force_upper_y_N"] / b["force_upper_y_N"], 1, delta=1e-4)


class FollowingTheFront(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def fill(self, name, across, remesh="", ranks=1):
        channel_mesh(self.folder / "channel.msh", across)
        case = self.folder / f"{name}.ini"
        case.write_text(CHANNEL + AIR + "[time]\nend = 0.25 s\n" + remesh)
        run("inject", case, self.folder / name, ranks=ranks)
        return history(self.folder / name)

    def test_a_fine_mesh_goes_with_the_front(self):
        fine = self.fill("fine", 16)[-1]
        for name, remesh, ranks in (("equal", "[remesh]\nsize = 0.5 mm\nmin_size = 0.25 mm\n", 2),
                                    ("stretched", "[remesh]\nsize = 0.5 mm\nmin_size = 0.2 mm\nanisotropic = yes\n", 1)):
            with self.subTest(name=name):
                rows = self.fill(name, 8, remesh, ranks)
                self.assertGreater(len({row["nodes"] for row in rows}), 2)
                self.assertLess(abs(rows[-1]["volume_error"]), 1e-10)
                self.assertAlmostEqual(rows[-1]["injected_m3"] / fine["injected_m3"], 1, delta=1e-6)
                self.assertAlmostEqual(rows[-1]["pressure_gate_Pa"] / fine["pressure_gate_Pa"], 1, delta=0.03)
                self.assertLess(max(row["nodes"] for row in rows), fine["nodes"])


if __name__ == "__main__":
    unittest.main()
