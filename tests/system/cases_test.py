"""The shipped cases: their meshes can be made, carry the groups that the case files name, and the known solutions are ones."""
import configparser
import math
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

CASES = pathlib.Path(os.environ["MALLEUS_SOURCE"]) / "cases"


def read_case(path):
    case = configparser.ConfigParser(comment_prefixes=(";", "#"), delimiters=("=",), interpolation=None)
    case.read(path)
    return case


def physical_names(path):
    """Names of the physical groups in a MSH file; the section is text in the binary format too."""
    section = path.read_bytes().split(b"$PhysicalNames")[1].split(b"$EndPhysicalNames")[0].decode()
    return set(re.findall(r'"([^"]*)"', section))


class Meshes(unittest.TestCase):
    def test_each_case_finds_its_mesh_and_groups(self):
        for script in sorted(CASES.glob("*/mesh")):
            with tempfile.TemporaryDirectory() as directory:
                made = subprocess.run([script, "--directory", directory], capture_output=True, text=True)
                self.assertEqual(made.returncode, 0, made.stderr)
                for path in sorted(script.parent.glob("*.ini")):
                    with self.subTest(path.relative_to(CASES)):
                        self.check_groups(read_case(path), pathlib.Path(directory))

    def check_groups(self, case, directory):
        names = physical_names(directory / case["mesh"]["file"])
        used = {case[section]["group"] for section in case.sections() if "group" in case[section]}
        self.assertEqual(used - names, set())
        # What a case leaves unnamed is a free surface of a forging, or the one domain of a cavity.
        self.assertLessEqual(names - used, {"cavity", "free", "side", "surface", "bottom", "top"})

    def test_the_same_call_makes_the_same_mesh(self):
        with tempfile.TemporaryDirectory() as directory:
            files = [pathlib.Path(directory) / name for name in ("first.msh", "second.msh")]
            for file in files:
                subprocess.run([CASES / "tube" / "mesh", "--across", "2", "-o", file], check=True, capture_output=True)
            self.assertEqual(files[0].read_bytes(), files[1].read_bytes())


def function(expression):
    """A formula of a case file as a function of x, y, z."""
    text = expression.strip('"').replace("^", "**").replace(" Pa.s", "")
    return eval("lambda x, y, z: " + text, {name: getattr(math, name) for name in ("sin", "cos", "exp", "pi")})


def derivative(f, axis):
    """The derivative of f along an axis by differences of fourth order."""
    h = 1e-3

    def at(point, shift):
        moved = list(point)
        moved[axis] += shift
        return f(*moved)

    def slope(*point):
        return (8 * (at(point, h) - at(point, -h)) - at(point, 2 * h) + at(point, -2 * h)) / (12 * h)

    return slope


class KnownSolutions(unittest.TestCase):
    POINTS = [(0.31, 0.57, 0.23), (0.83, 0.12, 0.64)]

    def test_force_balances_the_stress_and_volume_is_kept(self):
        for path in sorted((CASES / "manufactured").glob("*.ini")):
            with self.subTest(path.name):
                self.check(read_case(path))

    def check(self, case):
        axes = [k for k, name in enumerate("xyz") if "velocity_" + name in case["reference"]]
        velocity = [function(case["reference"]["velocity_" + "xyz"[k]]) for k in axes]
        pressure = function(case["reference"]["pressure"])
        viscosity = function(case["fluid.test"]["viscosity"])
        gradient = [[derivative(v, k) for k in axes] for v in velocity]
        for point in self.POINTS:
            self.assertAlmostEqual(sum(gradient[k][k](*point) for k in axes), 0, places=9)
            for i in axes:
                def stress(j):
                    return lambda *at: viscosity(*at) * (gradient[i][j](*at) + gradient[j][i](*at))

                force = derivative(pressure, i)(*point) - sum(derivative(stress(j), j)(*point) for j in axes)
                self.assertAlmostEqual(function(case["body_force"]["xyz"[i]])(*point), force, places=5)


if __name__ == "__main__":
    unittest.main()
