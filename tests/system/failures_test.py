"""A failure of one rank, in any phase, ends all ranks with its message and its exit code."""
import json
import os
import pathlib
import tempfile
import time
import unittest

from long_runs import PROGRAMS, digits, finish, start, write_case, write_full_case
from runs import PATIENCE

RANKS = 2
CODES = {"storage": 4, "input": 2, "defect": 1, "memory": 1}
PHASES = ("flow", "output", "checkpoint", "history")


class Failures(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def fail_at(self, program, case, rank, phase, call, kind="storage"):
        """What was said by a run in which that rank fails; None where it never came to that call."""
        began = time.monotonic()
        environment = {**os.environ, "MALLEUS_FAIL_AT": f"{rank}:{phase}:{call}:{kind}"}
        code, said = finish(start(program, case, self.directory / "out", ranks=RANKS, env=environment), 120)
        if code == 0:
            return None
        self.assertEqual(code, CODES[kind], said)
        self.assertIn("out of memory" if kind == "memory" else f"MALLEUS_FAIL_AT: rank {rank}, {phase} {call}", said)
        self.assertLess(time.monotonic() - began, 60 * PATIENCE)
        return said

    def test_agreements(self):
        """From the first that the run passes to those of its end, in growing strides."""
        for program in PROGRAMS:
            case = write_case(program, self.directory, 4)
            call, passed = 1, 0
            while self.fail_at(program, case, call % RANKS, "agreement", call) is not None:
                passed += 1
                call += 1 + call // 2
            with self.subTest(program):
                self.assertGreater(passed, 6)

    def test_kinds_at_an_agreement_are_told_once(self):
        case = write_case("inject", self.directory, 4)
        for kind in CODES:
            with self.subTest(kind):
                said = self.fail_at("inject", case, 1, "agreement", 5, kind)
                if kind in ("storage", "input"):
                    self.assertEqual(said.count("MALLEUS_FAIL_AT: rank"), 1)

    def test_phases_without_an_agreement(self):
        """The others wait in a collective for the one that failed: they are ended after some seconds of patience."""
        for number, phase in enumerate(PHASES):
            program = PROGRAMS[number % 2]
            with self.subTest(phase):
                case = write_case(program, self.directory, 4)
                self.assertIsNotNone(self.fail_at(program, case, 1, phase, 2, list(CODES)[number]))

    def test_a_failed_run_goes_on(self):
        case = write_case("forge", self.directory, 6)
        self.assertIsNotNone(self.fail_at("forge", case, 1, "flow", 5))
        code, said = finish(start("forge", case, self.directory / "out", "--restart", ranks=RANKS))
        self.assertEqual(code, 0, said)
        self.assertEqual(json.loads((self.directory / "out" / "summary.json").read_text())["status"], "done")

    def test_a_mesh_that_cannot_be_made_anew(self):
        """The run ends with the state before it, whole on disk, and can go on from there."""
        for program in PROGRAMS:
            with self.subTest(program):
                case = write_full_case(program, self.directory, 12)
                whole, output = self.directory / f"{program}-whole", self.directory / f"{program}-failed"
                code, said = finish(start(program, case, whole, ranks=RANKS))
                self.assertEqual(code, 0, said)
                environment = {**os.environ, "MALLEUS_FAIL_AT": "1:new_mesh:2:input"}
                code, said = finish(start(program, case, output, ranks=RANKS, env=environment))
                self.assertEqual(code, 3, said)
                self.assertIn("the mesh cannot be made anew: a failure asked for by MALLEUS_FAIL_AT: rank 1, new_mesh 2", said)
                self.assertIn("The last good state is that of increment", said)
                code, said = finish(start(program, case, output, "--restart", ranks=RANKS))
                self.assertEqual(code, 0, said)
                self.assertEqual(digits(output), digits(whole))


if __name__ == "__main__":
    unittest.main()
