"""Scenes of filling tests: boxes whose faces are walls and gates, and the vortex that draws a disc out."""
import pathlib
import tempfile
import unittest

from box_msh import BoxMesh
from runs import run


def vortex(period):
    """A disc of radius 0.15 in the unit square, whole again after the period."""
    return f"""[fluid.polymer]
viscosity = 1
[fluid.air]
viscosity = 1
[initial]
fluid = air
[initial.disc]
fluid = polymer
shape = sphere
center = 0.5 0.75
radius = 0.15
[flow]
prescribed_x = "-sin(pi*x)^2*sin(2*pi*y)*cos(pi*t/{period})"
prescribed_y = "sin(pi*y)^2*sin(2*pi*x)*cos(pi*t/{period})"
[reference]
level_set = "0.15 - sqrt((x-0.5)^2 + (y-0.75)^2)"
"""


class Filling(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def box(self, name, size, cells):
        mesh = BoxMesh(len(size))
        mesh.add("cavity", [0.0] * len(size), size, cells)
        mesh.write(self.directory / f"{name}.msh")

    def solve(self, text, name="case", *options, ranks=1, check=True):
        case = self.directory / f"{name}.ini"
        case.write_text(text)
        output = self.directory / f"out-{name}"
        result = run("inject", case, output, *options, ranks=ranks, check=check)
        return output if check else result
