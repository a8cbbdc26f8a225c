"""Some mutants of case files through --check; scripts/mutate-cases tries as many as one likes."""
import tempfile
import unittest

import mutants
from wrong_input_test import MESH


class Mutants(unittest.TestCase):
    def test_mutants_are_read_or_refused(self):
        for ranks, count in ((1, 40), (3, 4)):
            for program in ("forge", "inject"):
                with self.subTest(program, ranks=ranks), tempfile.TemporaryDirectory() as directory:
                    checker, answers = mutants.Checker(directory, MESH), mutants.Answers()
                    for number in range(count):
                        text, is_wrong = mutants.mutant(program, ranks, number)
                        self.assertIsNone(checker.judge(program, text, is_wrong, answers, ranks))
                    self.assertGreater(answers.codes[2], count // 4)

    def test_scenes_that_overflow_are_answered(self):
        """--check runs them ahead on a mesh of some cells; what is not finite there is no defect."""
        for program, key, huge in (("inject", "acceleration = 0 -9.81", "acceleration = 1e300 -9.81"),
                                   ("forge", "consistency = 10 Pa.s^m", "consistency = 1e300 Pa.s^m")):
            with self.subTest(program), tempfile.TemporaryDirectory() as directory:
                answers = mutants.Answers()
                text = mutants.CASES[program].replace(key, huge)
                self.assertIn(huge, text)
                self.assertIsNone(mutants.Checker(directory, mutants.square(8)).judge(program, text, False, answers))

    def test_what_is_not_mutated_is_accepted(self):
        """Else nothing would be learnt from mutants that are refused."""
        for program in ("forge", "inject"):
            with self.subTest(program), tempfile.TemporaryDirectory() as directory:
                answers = mutants.Answers()
                self.assertIsNone(mutants.Checker(directory, MESH).judge(program, mutants.CASES[program], False, answers))
                self.assertEqual(answers.codes[0], 1)


if __name__ == "__main__":
    unittest.main()
