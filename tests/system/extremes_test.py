"""Every row of scripts/extremes ends right or refused, none wrong."""
import os
import pathlib
import subprocess
import unittest

SOURCE = pathlib.Path(os.environ["MALLEUS_SOURCE"])


class Extremes(unittest.TestCase):
    def test_no_row_is_wrong(self):
        finished = subprocess.run([SOURCE / "scripts" / "extremes", "--bin", os.environ["MALLEUS_BIN"]], capture_output=True, text=True)
        self.assertEqual(finished.returncode, 0, finished.stdout + finished.stderr)
        self.assertIn(" 0 wrong", finished.stdout)

    def test_a_row_that_cannot_be_judged_is_wrong(self):
        finished = subprocess.run([SOURCE / "scripts" / "extremes", "--bin", "/nowhere", "--row", "m = 0.01"], capture_output=True, text=True)
        self.assertEqual(finished.returncode, 1)
        self.assertIn("1 wrong", finished.stdout)


if __name__ == "__main__":
    unittest.main()
