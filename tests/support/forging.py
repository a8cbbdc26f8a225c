"""Scenes of forging tests: a box that is pressed along an axis, and its closed forms."""
import math
import pathlib
import tempfile
import unittest

from box_msh import BoxMesh
from runs import history, run

K = 179.2e6


def flow_stress(dim, rate, m):
    factor = math.sqrt(3) if dim == 3 else 2
    return factor * K * (factor * rate) ** m


def box_mesh(path, dim, size=(1.0, 1.0, 1.0), cells=(3, 3, 3)):
    mesh = BoxMesh(dim)
    mesh.add("billet", [0.0] * dim, list(size[:dim]), cells[:dim])
    mesh.write(path)


def vector(dim, axis, value):
    return " ".join(repr(value) if a == axis else "0" for a in range(dim))


def symmetries(dim, axis):
    """Planes of symmetry of the faces at 0 across the axis."""
    text = ""
    for other in range(dim):
        if other != axis:
            text += f"[boundary.plane_{'xyz'[other]}]\ngroup = billet_{'xyz'[other]}_low\ntype = symmetry\n"
    return text


def case_text(m, dim, axis, pressing, time="increments = 1\nstep = 1e-3", extra=""):
    """pressing: 'tools' (planes), or 'boundaries' (the velocity is imposed)."""
    x = "xyz"[axis]
    law = f"law = norton-hoff\nconsistency = {K!r}\nrate_sensitivity = {m}"
    text = f"[mesh]\nfile = box.msh\n[time]\n{time}\n[body.billet]\ngroup = billet\n{law}\n" + symmetries(dim, axis)
    if pressing == "tools":
        text += (f"[tool.upper]\nshape = plane\npoint = {vector(dim, axis, 1.0)}\nnormal = {vector(dim, axis, -1.0)}\n"
                 f"velocity = {vector(dim, axis, -1.0)}\n"
                 f"[tool.lower]\nshape = plane\npoint = {vector(dim, axis, 0.0)}\nnormal = {vector(dim, axis, 1.0)}\n")
    else:
        for side, speed in (("high", -1.0), ("low", 0.0)):
            velocity = " ".join(repr(speed) if a == axis else "free" for a in range(dim))
            text += f"[boundary.{side}]\ngroup = billet_{x}_{side}\nvelocity = {velocity}\n"
    return text + extra


class Forging(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def forge(self, text, *options, ranks=1, name="out"):
        (self.directory / "case.ini").write_text(text)
        output = self.directory / name
        run("forge", self.directory / "case.ini", output, *options, ranks=ranks)
        return history(output)
