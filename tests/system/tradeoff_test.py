"""The trade of speed for accuracy: the error budget of a run, targets, scripts/tradeoff and scripts/sweep."""
import csv
import json
import math
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

from runs import PATIENCE

SOURCE = pathlib.Path(os.environ["MALLEUS_SOURCE"])
BINARIES = pathlib.Path(os.environ["MALLEUS_BIN"])
CHANNEL = SOURCE / "cases" / "channel"
LENGTH, HEIGHT, VISCOSITY, SPEED = 40e-3, 4e-3, 1000.0, 20e-3
PRESSURE = 12 * VISCOSITY * SPEED / HEIGHT ** 2 * LENGTH  # of the gate: the profile is that of the outlet all along


def run(command):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300 * PATIENCE)


class Folder(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        for name in ("steady.ini", "case.ini"):
            shutil.copy(CHANNEL / name, self.folder)

    def mesh(self, across):
        subprocess.run([CHANNEL / "mesh", "--across", str(across), "-o", self.folder / "channel.msh"], check=True, capture_output=True)

    def fill(self, name, *settings, ranks=1, case="steady.ini"):
        changes = [word for setting in settings for word in ("-D", setting)]
        start = ["mpirun", "--oversubscribe", "-n", ranks] if ranks > 1 else []
        finished = run([*start, BINARIES / "inject", self.folder / case, "-o", self.folder / name, *changes])
        self.assertEqual(finished.returncode, 0, finished.stderr)
        return finished.stdout, json.loads((self.folder / name / "summary.json").read_text())


class Budget(Folder):
    def check(self, *arguments):
        finished = run([SOURCE / "scripts" / "budgets", "--bin", BINARIES, "-o", self.folder / "budgets", *arguments])
        self.assertEqual(finished.returncode, 0, finished.stdout + finished.stderr)
        return finished.stdout

    def test_estimates_are_within_a_factor_of_two_of_the_truth_on_every_closed_form(self):
        self.assertGreater(len(self.check("--levels", "draft").splitlines()), 25)
        words = [word for name in ("known flow, square", "known flow, cube, varying", "softens", "axisymmetric, m = 1", "plane strain, m = 0.3", "upsetting, 3D, m = 0.3")
                 for word in ("--scene", name)]
        self.check("--levels", "standard", *words)

    def test_on_ranks_the_estimate_is_of_the_same_size_and_names_a_knob(self):
        self.mesh(8)
        alone, (log, together) = self.fill("alone")[1], self.fill("together", ranks=3)
        estimates = [summary["accuracy"]["estimated_error"] for summary in (alone, together)]
        self.assertLess(max(estimates) / min(estimates), 2)
        self.assertIn("to halve the error by", log)

    def test_a_run_that_does_not_ask_makes_no_other_mesh(self):
        self.mesh(6)
        log, summary = self.fill("out", "accuracy.two_meshes=no")
        self.assertNotIn("space", [share["source"] for share in summary["accuracy"].get("error_budget", [])])

    def test_the_estimate_changes_no_result(self):
        self.mesh(4)
        rows = []
        for two_meshes in ("yes", "no"):
            self.fill(two_meshes, f"accuracy.two_meshes={two_meshes}", "time.increments=2", case="case.ini")
            with open(self.folder / two_meshes / "history.csv", newline="") as file:
                rows.append([{k: v for k, v in row.items() if k != "wall_s"} for row in csv.DictReader(file)][0])
        self.assertEqual(rows[0], rows[1])


class Forecast(Folder):
    def test_what_a_check_foretells_is_what_the_run_takes(self):
        # Processor time on a machine with other work is uncertain by half: three times is wrong in any case.
        words = [word for name in ("channel/steady", "channel/case", "upsetting/plane") for word in ("--case", name)]
        finished = run([SOURCE / "scripts" / "forecasts", "--bin", BINARIES, "-o", self.folder / "forecasts", *words])
        self.assertEqual(finished.returncode, 0, finished.stdout + finished.stderr)
        self.assertIn("3 cases", finished.stdout)


class Targets(Folder):
    def test_the_mesh_is_chosen_so_that_the_error_is_met(self):
        self.mesh(8)
        nodes = {}
        for target in (0.03, 0.002):
            log, summary = self.fill("out", f"accuracy.target_error={target}", ranks=2)
            nodes[target] = summary["nodes"]
            self.assertLess(abs(summary["final"]["pressure_gate_Pa"] / PRESSURE - 1), 3 * target)
            self.assertIn("target_error", log)
        self.assertGreater(nodes[0.002], 2 * nodes[0.03])

    def test_what_was_chosen_is_written_and_runs_again(self):
        self.mesh(8)
        _, first = self.fill("out", "accuracy.target_error=0.01")
        text = (self.folder / "out" / "case.resolved.ini").read_text()
        for key in ("size_factor", "level"):
            self.assertRegex(text, rf"(?m)^{key} = .*; chosen for the targets of \[accuracy\]$")
        _, second = self.fill("again", case="out/case.resolved.ini")
        self.assertEqual(first["nodes"], second["nodes"])
        self.assertEqual(first["final"]["pressure_gate_Pa"], second["final"]["pressure_gate_Pa"])

    def test_a_factor_of_sizes_scales_the_count_of_nodes(self):
        self.mesh(8)
        _, plain = self.fill("plain")
        for factor in (0.5, 2):
            _, scaled = self.fill("scaled", f"accuracy.size_factor={factor}", ranks=2)
            measured = math.sqrt(plain["elements"] / scaled["elements"])
            self.assertAlmostEqual(measured / factor, 1, delta=0.2)

    def test_a_mesh_too_coarse_to_try_is_refused_with_the_remedy(self):
        self.mesh(2)
        finished = run([BINARIES / "inject", self.folder / "steady.ini", "-o", self.folder / "out", "-D", "accuracy.target_error=0.01",
                        "-D", "accuracy.size_factor=10", "--check"])
        self.assertEqual(finished.returncode, 2, finished.stdout)
        self.assertIn("size_factor", finished.stderr)


class Sweep(Folder):
    def sweep(self, *arguments):
        return run([SOURCE / "scripts" / "sweep", self.folder / "steady.ini", "--bin", BINARIES, "-o", self.folder / "study", *arguments])

    def table(self):
        with open(self.folder / "study" / "sweep.csv", newline="") as file:
            return list(csv.DictReader(file))

    def test_every_combination_is_a_row_and_is_run_once(self):
        self.mesh(3)
        axes = ["fluid.polymer.viscosity=500 Pa.s,1000 Pa.s", "solver.linear_tolerance=1e-6,1e-8"]
        finished = self.sweep(*axes)
        self.assertEqual(finished.returncode, 0, finished.stderr)
        rows = self.table()
        self.assertEqual(len(rows), 4)
        pressures = [float(row["final.pressure_gate_Pa"]) for row in rows]
        self.assertAlmostEqual(pressures[2] / pressures[0], 2, places=4)
        stamps = {path: path.stat().st_mtime_ns for path in (self.folder / "study").glob("*/summary.json")}
        self.assertEqual(len(stamps), 4)
        self.assertEqual(self.sweep(*axes).returncode, 0)
        self.assertEqual(stamps, {path: path.stat().st_mtime_ns for path in stamps})

    def test_a_run_that_fails_is_a_row_with_its_message(self):
        self.mesh(3)
        finished = self.sweep("fluid.polymer.viscosity=-1 Pa.s,1000 Pa.s")
        self.assertEqual(finished.returncode, 1)
        self.assertEqual([row["exit_code"] for row in self.table()], ["2", "0"])
        self.assertIn("viscosity", self.table()[0]["message"])

    def test_tasks_of_an_array_are_gathered(self):
        self.mesh(3)
        axis = "solver.linear_tolerance=1e-5,1e-7"
        for task in (1, 0):
            self.assertEqual(self.sweep(axis, "--task", task).returncode, 0)
        self.assertEqual(self.sweep(axis, "--gather").returncode, 0)
        self.assertEqual(len(self.table()), 2)
        self.assertNotEqual(self.sweep(axis, "--task", 2).returncode, 0)


class Tradeoff(Folder):
    def test_levels_and_knobs_are_measured_against_the_reference_level(self):
        self.mesh(6)
        study = self.folder / "study"
        finished = run([SOURCE / "scripts" / "tradeoff", self.folder / "steady.ini", "--bin", BINARIES, "-o", study, "--knob",
                        "linear_tolerance"])
        self.assertEqual(finished.returncode, 0, finished.stderr)
        with open(study / "tradeoff.csv", newline="") as file:
            rows = {row["setting"]: row for row in csv.DictReader(file)}
        self.assertLess({"level draft", "level standard", "level fine", "level reference", "standard, the case's mesh"}, rows.keys())
        self.assertGreater(float(rows["level draft"]["error"]), float(rows["level fine"]["error"]))
        self.assertEqual(rows["level reference"]["error"], "")
        text = (study / "tradeoff.md").read_text()
        self.assertIn("solver.linear_tolerance = 1e-05", text)
        self.assertGreater((study / "tradeoff.png").stat().st_size, 10000)


if __name__ == "__main__":
    unittest.main()
