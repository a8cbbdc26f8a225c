"""scripts/slurm against a Slurm of one node: a run outlives its time limits, arrays run each line of a list."""
import json
import pathlib
import os
import shutil
import signal
import tempfile
import time
import unittest

import mini_slurm
from long_runs import check_sound, digits, finish, rows_so_far, start, write_case
from runs import PATIENCE

SOURCE = pathlib.Path(os.environ["MALLEUS_SOURCE"])
SCRIPTS = SOURCE / "scripts" / "slurm"


def runs_in(process, program, directory):
    """Whether the process of a folder of /proc runs the program in the directory."""
    try:
        return (pathlib.Path(os.readlink(process / "exe")).name == program
                and pathlib.Path(os.readlink(process / "cwd")).samefile(directory))
    except OSError:
        return False  # it ended meanwhile


def is_done(output):
    summary = output / "summary.json"
    return summary.exists() and json.loads(summary.read_text())["status"] == "done"


def has_pending(process, number):
    """Whether a signal waits for the process to go on."""
    status = (pathlib.Path("/proc") / str(process) / "status").read_text()
    masks = [int(line.split()[1], 16) for line in status.splitlines() if line.startswith(("SigPnd", "ShdPnd"))]
    return any(mask >> (number - 1) & 1 for mask in masks)


def wait_until(condition, what, seconds):
    limit = time.monotonic() + seconds * PATIENCE
    while not condition():
        if time.monotonic() > limit:
            raise AssertionError(f"{what}: did not come within {seconds} s")
        time.sleep(0.02)


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
        case = write_case("forge", self.scratch, 200)
        whole = pathlib.Path(self.scratch) / "whole"
        code, said = finish(start("forge", case, whole, ranks=2), 400)
        self.assertEqual(code, 0, said)
        # The signal is due when the job begins, and comes with the scheduler's next look: at most half a minute later.
        # The first leg is held that long, however fast this machine is.
        output = pathlib.Path(self.scratch) / "out"
        job = self.submit("--ntasks=2", "--time=10", "--signal=B:USR1@595", SCRIPTS / "job.sh", "forge", case, "-o", "out",
                          "-D", "output.every=1")
        ranks = self.hold_ranks(output)
        wait_until(lambda: any(has_pending(rank, signal.SIGUSR1) for rank in ranks), "the signal before the limit", 200)
        for rank in ranks:
            os.kill(rank, signal.SIGCONT)
        self.assertEqual(self.slurm.wait_to_end(job, 400, lambda: is_done(output)), "COMPLETED", self.logs())
        self.assertIn("leg 1 stopped before the time limit; back to the queue", self.logs())
        self.assertTrue(is_done(output))
        check_sound(output, "forge", every=1)
        self.assertEqual(digits(output), digits(whole))

    def hold_ranks(self, output):
        """Stops both ranks of the running job after some increments; their process ids."""
        wait_until(lambda: rows_so_far(output) >= 20, "twenty increments", 200)
        ranks = [int(entry.name) for entry in pathlib.Path("/proc").glob("[0-9]*") if runs_in(entry, "forge", self.scratch)]
        self.assertEqual(len(ranks), 2)
        for rank in ranks:
            os.kill(rank, signal.SIGSTOP)
        return ranks

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
