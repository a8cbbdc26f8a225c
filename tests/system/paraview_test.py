"""Every output opens in ParaView, in serial, in parallel and through a server, with the right counts at each time."""
import os
import pathlib
import subprocess
import tempfile
import unittest

import paraview_open
import virtual_display

BIN = pathlib.Path(os.environ["MALLEUS_BIN"])
CASES = pathlib.Path(os.environ["MALLEUS_SOURCE"]) / "cases"


def run_case(program, case, mesh_arguments, settings, ranks, folder):
    """Meshes and runs a shipped case with small numbers; returns its .xdmf."""
    subprocess.run([CASES / case / "mesh", *mesh_arguments, "-o", folder / "small.msh"], check=True, capture_output=True)
    overrides = [word for setting in [f"mesh.file={folder}/small.msh", *settings] for word in ("-D", setting)]
    finished = subprocess.run(["mpiexec", "-n", str(ranks), BIN / program, "-o", folder / "out", *overrides,
                               CASES / case / "case.ini"], capture_output=True, text=True)
    if finished.returncode != 0:
        raise AssertionError(f"{program} {case}: exit {finished.returncode}\n{finished.stdout[-2000:]}{finished.stderr}")
    xdmf, = (folder / "out").glob("*.xdmf")
    return xdmf


class Opening:
    """The checks of one run's output; `run` is the arguments of run_case."""
    job = None
    fields_at_nodes = set()

    @classmethod
    def setUpClass(cls):
        if not paraview_open.installed():
            raise unittest.SkipTest("ParaView is not installed")
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.enterClassContext(virtual_display.started())
        cls.xdmf = run_case(*cls.job, pathlib.Path(cls.folder.name))
        cls.expected = paraview_open.expected(cls.xdmf.parent)

    def check(self, found):
        self.assertGreaterEqual(len(self.expected), 3)
        self.assertEqual(len(found), len(self.expected))
        for seen, state in zip(found, self.expected):
            self.assertAlmostEqual(seen["time"], state.time, places=12)
            self.assertEqual(seen["points"], len(state.points))
            self.assertEqual(seen["cells"], len(state.elements))
            for k in range(3):
                self.assertAlmostEqual(seen["bounds"][2 * k], state.points[:, k].min(), places=7)
                self.assertAlmostEqual(seen["bounds"][2 * k + 1], state.points[:, k].max(), places=7)
            self.assertLessEqual(self.fields_at_nodes, set(seen["nodes"]))
            self.assertEqual(seen["elements"]["partition"], [0, self.job[-1] - 1])

    def test_serial(self):
        self.check(paraview_open.open_serial(self.xdmf))

    def test_two_processes(self):
        self.check(paraview_open.open_in_parallel(self.xdmf, 2))


class Filling(Opening, unittest.TestCase):
    job = ("inject", "channel", ["--across", "4"], ["time.end=0.1 s", "time.step=10 ms"], 3)
    fields_at_nodes = {"velocity", "pressure", "level_set"}

    def test_through_a_server(self):
        self.check(paraview_open.open_through_server(self.xdmf, 1))

    def test_through_a_server_on_two_processes(self):
        self.check(paraview_open.open_through_server(self.xdmf, 2))

    def test_render_draws_a_picture(self):
        picture = self.xdmf.with_suffix(".png")
        render = pathlib.Path(os.environ["MALLEUS_SOURCE"]) / "scripts" / "render"
        subprocess.run([render, self.xdmf, "--field", "pressure", "--contour", "level_set=0", "-o", picture], check=True,
                       capture_output=True, timeout=paraview_open.SECONDS)
        self.assertEqual(picture.read_bytes()[:4], b"\x89PNG")


class Forging(Opening, unittest.TestCase):
    job = ("forge", "upsetting", ["--size", "5"], ["time.stroke=1 mm", "output.every=1"], 3)
    fields_at_nodes = {"velocity", "pressure"}


if __name__ == "__main__":
    unittest.main()
