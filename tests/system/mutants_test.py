"""Some mutants of case files through --check; scripts/mutate-cases tries as many as one likes."""
import tempfile
import unittest

from mutants import Checker
from wrong_input_test import MESH


class Mutants(unittest.TestCase):
    def test_mutants_are_read_or_refused(self):
        for ranks, count in ((1, 40), (3, 4)):
            for program in ("forge", "inject"):
                with self.subTest(program, ranks=ranks), tempfile.TemporaryDirectory() as directory:
                    checker = Checker(directory, MESH, f"{program} {ranks}")
                    for _ in range(count):
                        self.assertIsNone(checker.try_one(program, ranks))
                    self.assertGreater(checker.codes[2], count // 4)


if __name__ == "__main__":
    unittest.main()
