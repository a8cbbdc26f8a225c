"""Runs in legs of one increment: whatever a scene remembers, they come to the digits of the run that did not stop."""
import tempfile
import unittest

import long_scenes


class Restarts(unittest.TestCase):
    def test_each_increment_may_be_the_last_of_a_leg(self):
        for number, name in enumerate(long_scenes.SCENES):
            with self.subTest(name), tempfile.TemporaryDirectory() as directory:
                ranks = 1 + number % 2
                self.assertEqual(long_scenes.in_legs(name, directory, 4, ranks, 3 - ranks)[0], [])

    def test_other_ranks_go_on_to_the_same_values_on_one_mesh(self):
        for number, name in enumerate(long_scenes.SCENES):
            with self.subTest(name), tempfile.TemporaryDirectory() as directory:
                here, elsewhere = ((1, 3), (2, 1), (3, 2), (2, 4))[number % 4]
                self.assertEqual(long_scenes.on_one_mesh(name, directory, 4, here, [elsewhere])[0], [])


if __name__ == "__main__":
    unittest.main()
