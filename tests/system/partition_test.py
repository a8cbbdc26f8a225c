"""meshtool partition and probe as a user runs them: any number of parts on any number of ranks, repairs, refusals."""
import collections
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import h5py

import small_meshes
from runs import PATIENCE, history, run

MESHTOOL = pathlib.Path(os.environ["MALLEUS_BIN"]) / "meshtool"


def meshtool(*words, ranks=1):
    launch = ["mpiexec", "-n", str(ranks)] if ranks > 1 else []
    return subprocess.run([*launch, MESHTOOL, *map(str, words)], capture_output=True, text=True, timeout=120 * PATIENCE)


class Partitions(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def put(self, name, text):
        path = self.folder / name
        path.write_text(text)
        return path

    def mesh(self, dim=3, cells=5):
        return self.put("mesh.msh", small_meshes.box(dim, cells).msh())

    def partition(self, mesh, parts, *options, ranks=1, output="out.h5"):
        report = self.folder / "report.json"
        result = meshtool("partition", mesh, self.folder / output, "--parts", parts, "--report", report, "--parts-file",
                          self.folder / "parts.txt", *options, ranks=ranks)
        self.assertEqual(result.returncode, 0, result.stderr)
        numbers = [int(line) for line in (self.folder / "parts.txt").read_text().split()]
        return json.loads(report.read_text()), numbers

    def assert_refused(self, result, *texts):
        self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
        for text in texts:
            self.assertIn(text, result.stderr)


class Command(Partitions):
    def test_any_number_of_parts_on_any_number_of_ranks(self):
        for dim, cells in ((2, 12), (3, 5)):
            mesh = self.mesh(dim, cells)
            elements = cells**dim * (2 if dim == 2 else 6)
            for parts, ranks in ((1, 2), (3, 1), (3, 3), (8, 3), (2, 4)):
                with self.subTest(dim=dim, parts=parts, ranks=ranks):
                    report, numbers = self.partition(mesh, parts, ranks=ranks)
                    self.assertEqual(len(numbers), elements)
                    self.assertEqual(set(numbers), set(range(parts)))
                    for key in ("parts", "imbalance", "cut", "communication_volume", "max_neighbours", "cost", "moved",
                                "seconds", "nodes", "elements", "wall_s", "peak_memory_bytes", "quality", "volume"):
                        self.assertIn(key, report)
                    self.assertEqual((report["parts"], report["elements"]), (parts, elements))
                    self.assertLess(report["imbalance"], 0.1)
                    with h5py.File(self.folder / "out.h5") as file:
                        sizes = [len(file[f"p{p:04d}/region"]) for p in range(parts)]
                        self.assertNotIn(f"p{parts:04d}", file)
                    self.assertEqual(sizes, [collections.Counter(numbers)[p] for p in range(parts)])
                    back = json.loads(meshtool("info", self.folder / "out.h5", "--json").stdout)
                    self.assertEqual((back["elements"], back["nodes"]), (elements, (cells + 1)**dim))
                    self.assertEqual(meshtool("check", self.folder / "out.h5").returncode, 0)

    def test_the_cut_is_what_the_parts_file_says(self):
        mesh = small_meshes.box(2, 8)
        report, numbers = self.partition(self.put("mesh.msh", mesh.msh()), 4, ranks=2)
        sides = collections.defaultdict(list)
        triangles = [corners for kind, _, corners in mesh.elements if kind == 2]
        for number, corners in zip(numbers, triangles):
            for i in range(3):
                sides[frozenset((corners[i], corners[i - 1]))].append(number)
        self.assertEqual(report["cut"], sum(len(set(around)) > 1 for around in sides.values()))
        around = collections.defaultdict(set)
        for number, corners in zip(numbers, triangles):
            for corner in corners:
                around[corner].add(number)
        self.assertEqual(report["communication_volume"], sum(len(parts) - 1 for parts in around.values()))

    def test_a_partition_comes_back_from_its_file_and_is_left_alone_or_repaired(self):
        mesh = self.mesh(3, 5)
        _, numbers = self.partition(mesh, 4)
        start = self.put("start.txt", "".join(f"{n}\n" for n in numbers))
        kept, again = self.partition(mesh, 4, "--from", start, "--method", "keep", ranks=3)
        self.assertEqual((again, kept["moved"]), (numbers, 0))
        heavy = self.put("weights.txt", "".join("5\n" if n == 0 else "1\n" for n in numbers))
        repaired, moved = self.partition(mesh, 4, "--from", start, "--weights", heavy, ranks=2)
        self.assertLess(repaired["cost"]["after"], repaired["cost"]["before"] - 0.5)
        self.assertGreater(repaired["moved"], 0.1)
        self.assertNotEqual(moved, numbers)

    def test_the_same_call_gives_the_same_bytes(self):
        mesh = self.mesh(3, 6)
        for ranks in (1, 3):
            first = self.partition(mesh, 5, ranks=ranks)[1]
            self.assertEqual(self.partition(mesh, 5, ranks=ranks)[1], first)

    def test_more_parts_than_elements(self):
        report, numbers = self.partition(self.mesh(2, 1), 7, ranks=3)
        self.assertEqual((len(numbers), report["parts"]), (2, 7))
        self.assertGreaterEqual(report["empty_parts"], 5)

    def test_faster_processors_get_more(self):
        machine = self.put("machine.ini", "[architecture]\nspeed = 1 3\nbandwidth = 1000\n")
        _, numbers = self.partition(self.mesh(3, 6), 2, "--architecture", machine)
        share = numbers.count(1) / len(numbers)
        self.assertGreater(share, 0.7)
        self.assertLess(share, 0.8)

    def test_what_makes_no_sense_is_refused(self):
        mesh, out = self.mesh(2, 3), self.folder / "out.h5"
        zero = self.put("zero.ini", "[architecture]\nspeed = 1 0\n")
        self.assert_refused(meshtool("partition", mesh, out, "--parts", 2, "--architecture", zero), "zero.ini:2", "speed")
        self.assert_refused(meshtool("partition", mesh, out, "--parts", 3, "--architecture", zero), "2 speeds for 3 parts")
        self.assert_refused(meshtool("partition", mesh, out, "--parts", 0), "--parts")
        self.assert_refused(meshtool("partition", mesh, out), "--parts")
        short = self.put("short.txt", "0\n1\n")
        self.assert_refused(meshtool("partition", mesh, out, "--parts", 2, "--from", short), "holds 2 numbers", "18 elements")
        large = self.put("large.txt", "2\n" * 18)
        self.assert_refused(meshtool("partition", mesh, out, "--parts", 2, "--from", large), "from 0 to 1")
        words = self.put("words.txt", "0\n" * 17 + "one\n")
        self.assert_refused(meshtool("partition", mesh, out, "--parts", 2, "--from", words, ranks=2), "'one' is no number")
        self.assert_refused(meshtool("partition", mesh, out, "--parts", 2, "--weights", "nothing"), "nothing")
        negative = self.put("negative.txt", "-1\n" * 18)
        self.assert_refused(meshtool("partition", mesh, out, "--parts", 2, "--weights", negative), ">= 0")
        nothing = self.put("nothing.txt", "0\n" * 18)
        self.assert_refused(meshtool("partition", mesh, out, "--parts", 2, "--weights", nothing), "no element weighs anything")


class Probe(Partitions):
    def test_what_it_writes_can_be_used(self):
        machine = self.folder / "machine.ini"
        result = meshtool("probe", machine, "--seconds", 0.05, ranks=3)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("[architecture]", machine.read_text())
        report, _ = self.partition(self.mesh(3, 4), 3, "--architecture", machine)
        self.assertEqual(report["parts"], 3)


class Runs(Partitions):
    """[partition] in a case: the same answer, shared otherwise."""

    CASE = """[mesh]
file = mesh.msh
[time]
increments = 2
step = 1e-3
[body.billet]
group = body
law = norton-hoff
consistency = 1e8
rate_sensitivity = 0.5
[tool.upper]
shape = plane
point = 0 0 1
normal = 0 0 -1
velocity = 0 0 -1
[tool.lower]
shape = plane
point = 0 0 0
normal = 0 0 1
"""

    def case(self, partition):
        self.mesh(3, 4)
        return self.put("case.ini", self.CASE + "[partition]\n" + partition + "\n")

    def test_shares_by_cost_give_the_same_force(self):
        forces = []
        for method, ranks in (("curve", 1), ("cost", 1), ("cost", 3), ("scotch", 3)):
            output = self.folder / f"{method}{ranks}"
            result = run("forge", self.case(f"method = {method}"), output, ranks=ranks)
            self.assertEqual("shares by" in result.stdout, method != "curve" and ranks > 1)
            forces.append(history(output)[-1]["force_upper_z_N"])
        for force in forces[1:]:
            self.assertAlmostEqual(force / forces[0], 1, places=4)

    def test_choices_that_are_not_there_are_refused(self):
        result = run("forge", self.case("method = metis"), self.folder / "out", check=False)
        self.assert_refused(result, "[partition]", "metis")

    def test_shares_by_measured_speeds_move_and_restart_without_a_trace_in_the_forces(self):
        case = self.case("balance = measured")
        whole, halves, one = (self.folder / name for name in ("whole", "halves", "one"))
        for _ in range(6):  # where the ranks happen to be as fast as their shares are large, there is nothing to gain
            result = run("forge", case, whole, ranks=3)
            self.assertIn("not repeatable", result.stdout)
            if "balance: in increment" in result.stdout:
                break
        self.assertIn("balance: in increment", result.stdout)
        run("forge", case, halves, "--steps", "1", ranks=3)
        run("forge", case, halves, "--restart", ranks=3)
        run("forge", case, one, ranks=1)
        for output in (halves, one):
            self.assertEqual(len(history(output)), len(history(whole)))
            self.assertAlmostEqual(history(output)[-1]["force_upper_z_N"] / history(whole)[-1]["force_upper_z_N"], 1,
                                   places=4)

    def test_shares_by_cost_are_made_again_after_a_restart_on_other_ranks(self):
        case = self.case("method = cost")
        output = self.folder / "out"
        run("forge", case, output, "--steps", "1", ranks=1)
        run("forge", case, output, "--restart", ranks=3)
        whole = self.folder / "whole"
        run("forge", case, whole, ranks=1)
        self.assertAlmostEqual(history(output)[-1]["force_upper_z_N"] / history(whole)[-1]["force_upper_z_N"], 1,
                               places=4)


if __name__ == "__main__":
    unittest.main()
