"""meshtool refine as a user runs it: sizes met, names kept, on 1 to 4 ranks and in every format; wrong words refused."""
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import small_meshes
from runs import PATIENCE

MESHTOOL = pathlib.Path(os.environ["MALLEUS_BIN"]) / "meshtool"


def meshtool(*words, ranks=1):
    launch = ["mpiexec", "-n", str(ranks)] if ranks > 1 else []
    return subprocess.run([*launch, MESHTOOL, *map(str, words)], capture_output=True, text=True, timeout=240 * PATIENCE)


class Refine(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def box(self, dim=3, cells=3, name="box.msh"):
        path = self.folder / name
        path.write_text(small_meshes.box(dim, cells).msh())
        return path

    def refine(self, source, name, *words, ranks=1):
        out, report = self.folder / name, self.folder / "report.json"
        result = meshtool("refine", source, out, "--report", report, *words, ranks=ranks)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assertEqual(meshtool("check", out).returncode, 0)
        return out, json.loads(report.read_text())

    def info(self, path):
        result = meshtool("info", path, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def assert_names_and_measures(self, path, dim):
        info = self.info(path)
        self.assertAlmostEqual(info["volume"], 1, places=11)
        self.assertEqual([r["name"] for r in info["regions"]], ["body"])
        areas = {g["name"]: round(g["area"], 10) for g in info["groups"]}
        self.assertEqual(areas, {"low": 1, "high": 1, "side": 2 if dim == 2 else 4})
        self.assertEqual(info["unnamed_boundary_facets"], 0)

    def test_a_size_is_met_on_any_rank_count_and_in_every_format(self):
        for dim, size, quality, mean in ((2, 0.03, 0.5, 0.92), (3, 0.1, 0.4, 0.84)):
            source = self.box(dim)
            for ranks, name in ((1, "a.msh"), (2, "b.meshb"), (3, "c.h5"), (4, "d.mesh")):
                with self.subTest(dim=dim, ranks=ranks):
                    out, report = self.refine(source, name, "--size", size, ranks=ranks)
                    self.assert_names_and_measures(out, dim)
                    self.assertEqual(report["ranks"], ranks)
                    self.assertEqual(report["nodes"], self.info(out)["nodes"])
                    self.assertGreater(report["quality"]["min"], quality)
                    self.assertGreater(report["quality"]["mean"], mean)
                    self.assertGreaterEqual(report["quality"]["p01"], report["quality"]["min"])
                    self.assertGreater(report["edges"]["fraction"], 0.9)
                    self.assertLess(report["edges"]["max"], 2.2)
                    self.assertAlmostEqual(report["volume"]["after"], report["volume"]["before"], places=11)
                    self.assertGreater(report["peak_memory_bytes"], 0)
                    self.assertGreater(report["wall_s"]["total"], 0)

    def test_the_same_command_gives_the_same_bytes(self):
        source = self.box()
        for ranks in (1, 3):
            first, _ = self.refine(source, "a.msh", "--size", 0.12, ranks=ranks)
            again, _ = self.refine(source, "b.msh", "--size", 0.12, ranks=ranks)
            self.assertEqual(first.read_bytes(), again.read_bytes())

    def test_halving_makes_eight_of_one(self):
        out, report = self.refine(self.box(), "a.msh", "--uniform", 2, ranks=2)
        self.assertEqual(report["elements"], 64 * 162)
        self.assertEqual(report["nodes"], 13**3)
        self.assert_names_and_measures(out, 3)

    def test_coarsening(self):
        _, report = self.refine(self.box(3, 12), "a.msh", "--size", 0.3, ranks=2)
        self.assertLess(report["nodes"], 200)

    def test_a_node_count_is_met(self):
        _, report = self.refine(self.box(3, 5), "a.msh", "--nodes", 3000, ranks=2)
        self.assertAlmostEqual(report["nodes"] / 3000, 1, delta=0.2)

    def test_sizes_and_tensors_from_a_file(self):
        medit = self.folder / "box.mesh"
        self.assertEqual(meshtool("convert", self.box(3, 6), medit).returncode, 0)
        lines = medit.read_text().splitlines()
        first = lines.index("Vertices")
        points = [[float(w) for w in line.split()[:3]] for line in lines[first + 2: first + 2 + int(lines[first + 1])]]
        sizes = "\n".join(str(0.05 + 0.2 * x) for x, _, _ in points)
        tensors = "\n".join("400 0 25 0 0 25" for _ in points)
        head = f"MeshVersionFormatted 2\nDimension 3\nSolAtVertices\n{len(points)}\n1 "
        for kind, values, conforming in ((1, sizes, 0.88), (3, tensors, 0.8)):
            for ranks in (1, 2):
                with self.subTest(kind=kind, ranks=ranks):
                    sol = self.folder / "metric.sol"
                    sol.write_text(f"{head}{kind}\n{values}\nEnd\n")
                    out, report = self.refine(medit, "out.msh", "--metric", sol, ranks=ranks)
                    self.assert_names_and_measures(out, 3)
                    self.assertGreater(report["edges"]["fraction"], conforming)

    def test_a_kept_surface(self):
        before = self.info(self.box(3, 4))
        out, _ = self.refine(self.box(3, 4), "a.msh", "--size", 0.15, "--keep-surface", ranks=2)
        after = self.info(out)
        self.assertEqual([g["facets"] for g in after["groups"]], [g["facets"] for g in before["groups"]])
        self.assertGreater(after["elements"], before["elements"])

    def test_what_cannot_be_done_is_refused(self):
        box, out = self.box(), self.folder / "out.msh"
        sol = self.folder / "short.sol"
        sol.write_text("MeshVersionFormatted 2\nDimension 3\nSolAtVertices\n2\n1 1\n0.1\n0.2\nEnd\n")
        for words, texts in (((), ("--size H",)),
                             (("--size", "0.1", "--uniform", "1"), ("give one of them",)),
                             (("--size", "-1"), ("--size",)),
                             (("--nodes", "100", "--error-of", "speed"), ("speed", "box.msh")),
                             (("--metric", sol), ("short.sol", "2 nodes")),
                             (("--metric", self.folder / "no.sol"), ("no.sol",))):
            with self.subTest(words=words):
                result = meshtool("refine", box, out, *words, ranks=2)
                self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                self.assertEqual(result.stderr.count("error: "), 1, result.stderr)
                for text in texts:
                    self.assertIn(text, result.stderr)
        self.assertFalse(out.exists())


if __name__ == "__main__":
    unittest.main()
