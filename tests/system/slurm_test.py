"""scripts/slurm against a Slurm of one node: a run outlives its time limits, arrays run each line of a list."""
import json
import pathlib
import os
import shutil
import tempfile
import unittest

import mini_slurm
from long_runs import check_sound, digits, finish, start, write_case

SOURCE = pathlib.Path(os.environ["MALLEUS_SOURCE"])
SCRIPTS = SOURCE / "scripts" / "slurm"


class Usage(unittest.TestCase):
    def test_each_script_tells_its_use(self):
        import subprocess
        for script in sorted(SCRIPTS.iterdir()):
            with self.subTest(script.name):
                told = subprocess.run([script, "--help"], capture_output=True, text=True)
                self.assertEqual(told.returncode, 0)
                self.assertIn(f"scripts/slurm/{script.name}", told.stdout)
                self.assertEqual(subprocess.run([script], capture_output=True).returncode, 2)


@unittest.skipIf(mini_slurm.reason_to_skip(), mini_slurm.reason_to_skip())
class Jobs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.mkdtemp()
        cls.slurm = mini_slurm.MiniSlurm(pathlib.Path(cls.scratch) / "slurm")
        cls.slurm.directory.mkdir()
        cls.addClassCleanup(shutil.rmtree, cls.scratch, ignore_errors=True)
        cls.addClassCleanup(cls.slurm.stop)
        cls.slurm.start()

    def submit(self, *words):
        return self.slurm.submit("--oversubscribe", *words, cwd=self.scratch,
                                 MALLEUS_BIN=os.environ["MALLEUS_BIN"], MALLEUS_SLURM=str(SCRIPTS))

    def logs(self):
        return "".join(path.read_text() for path in sorted(pathlib.Path(self.scratch).glob("slurm-*.out")))

    def test_limit_checkpoint_requeue_done(self):
        case = write_case("forge", self.scratch, 5000)  # some 50 s: the scheduler looks at limits every 30 s
        whole = pathlib.Path(self.scratch) / "whole"
        code, said = finish(start("forge", case, whole, ranks=2), 400)
        self.assertEqual(code, 0, said)
        # The signal is due when the job begins: it comes with the scheduler's next look, within seconds.
        slow = "-D", "output.every=1"
        job = self.submit("--ntasks=2", "--time=1", "--signal=B:USR1@55", SCRIPTS / "job.sh", "forge", case, "-o", "out",
                          *slow)
        self.assertEqual(self.slurm.wait_to_end(job, 400), "COMPLETED", self.logs())
        output = pathlib.Path(self.scratch) / "out"
        self.assertIn("leg 1 stopped before the time limit; back to the queue", self.logs())
        self.assertEqual(json.loads((output / "summary.json").read_text())["status"], "done")
        check_sound(output, "forge", every=1)
        self.assertEqual(digits(output), digits(whole))

    def test_arrays(self):
        case = write_case("inject", self.scratch, 6)
        (pathlib.Path(self.scratch) / "list").write_text("-D fluid.polymer.viscosity=500\n-D 'fluid.polymer.viscosity=2000 Pa.s'\n")
        job = self.submit("--array=1-2", "--ntasks=1", "--time=2", SCRIPTS / "array.sh", "inject", case, "list")
        self.assertEqual(self.slurm.wait_to_end(job, 120), "COMPLETED", self.logs())
        pressures = [json.loads((pathlib.Path(self.scratch) / "out" / f"inject-{i}" / "summary.json").read_text())["final"][
            "pressure_gate_Pa"] for i in (1, 2)]
        self.assertAlmostEqual(pressures[1] / pressures[0], 4, delta=0.1)

    def test_meshtool(self):
        write_case("forge", self.scratch)
        job = self.submit("--ntasks=2", "--time=2", SCRIPTS / "meshtool.sh", "refine", "box.msh", "fine.msh", "--size", "0.1")
        self.assertEqual(self.slurm.wait_to_end(job, 120), "COMPLETED", self.logs())
        self.assertTrue((pathlib.Path(self.scratch) / "fine.msh").exists())


if __name__ == "__main__":
    unittest.main()
