"""The paper's filling in small: a coarse mesh refined in parallel, one Stokes solve, the front carried or traced."""
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

from runs import BIN, history, run, summary

CASE = pathlib.Path(os.environ["MALLEUS_SOURCE"]) / "cases" / "paper-filling"


class PaperFilling(unittest.TestCase):
    def test_one_solve_fills_a_part_that_was_refined_in_parallel(self):
        with tempfile.TemporaryDirectory() as scratch:
            mesh = pathlib.Path(scratch) / "part.msh"
            made = subprocess.run([CASE / "mesh", "--size", "14", "--smallest", "5", "--rounds", "1", "--ranks", "2", "--bin", BIN,
                                   "-o", mesh], check=True, capture_output=True, text=True)
            coarse = int(re.search(r"(\d+) tetrahedra", made.stdout).group(1))
            for name, ranks, options in (("carried", 1, ()), ("traced", 2, ("-D", "front.transport=trace"))):
                output = pathlib.Path(scratch) / name
                run("inject", CASE / "case.ini", output, "-D", f"mesh.file={mesh}", "-D", "time.increments=3", "-D",
                    "time.step=20 ms", *options, ranks=ranks)
                rows = history(output)
                self.assertEqual(rows[-1]["elements"], 8 * coarse)
                self.assertEqual(sum(row["flow_updated"] for row in rows), 1)
                self.assertLess(max(abs(row["volume_error"]) for row in rows), 1e-9)
                self.assertEqual(summary(output)["status"], "done")
                steps = [int(n) for n in re.findall(r"\| (\d+) substeps", (output / "run.log").read_text())]
                self.assertEqual(name == "traced", max(steps) == 1)


if __name__ == "__main__":
    unittest.main()
