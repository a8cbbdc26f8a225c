"""meshtool as a user runs it: the same answers on 1 to 4 ranks, names kept by every conversion, unsound meshes refused."""
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import h5py

import small_meshes
from runs import PATIENCE

MESHTOOL = pathlib.Path(os.environ["MALLEUS_BIN"]) / "meshtool"


def meshtool(*words, ranks=1):
    launch = ["mpiexec", "-n", str(ranks)] if ranks > 1 else []
    return subprocess.run([*launch, MESHTOOL, *map(str, words)], capture_output=True, text=True, timeout=120 * PATIENCE)


class Files(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def put(self, text, name="mesh.msh"):
        path = self.folder / name
        path.write_text(text)
        return path

    def info(self, path, ranks=1):
        result = meshtool("info", path, "--json", ranks=ranks)
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def assert_refused(self, result, *texts):
        """Exit 2, nothing but one error, with the texts in it."""
        self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
        self.assertEqual(result.stderr.count("error: "), 1, result.stderr)
        for text in texts:
            self.assertIn(text, result.stderr)


class Info(Files):
    def test_a_cube_is_described_alike_on_any_rank_count(self):
        path = self.put(small_meshes.box(3, 3, size=2.0).msh())
        for ranks in (1, 2, 3, 4):
            with self.subTest(ranks=ranks):
                info = self.info(path, ranks)
                self.assertEqual((info["dimension"], info["nodes"], info["elements"]), (3, 64, 162))
                self.assertEqual((info["boundary_facets"], info["unnamed_boundary_facets"]), (108, 0))
                self.assertEqual(info["bounding_box"], {"low": [0, 0, 0], "high": [2, 2, 2]})
                self.assertAlmostEqual(info["volume"], 8, places=12)
                self.assertEqual([g["name"] for g in info["groups"]], ["low", "high", "side"])
                self.assertEqual([g["facets"] for g in info["groups"]], [18, 18, 72])
                self.assertAlmostEqual(info["groups"][2]["area"], 16, places=12)
                self.assertEqual(sum(info["quality"]["bins"]), 162)
                self.assertAlmostEqual(info["edges"]["min"], 2 / 3, places=12)

    def test_lengths_have_a_unit_and_text_names_the_groups(self):
        path = self.put(small_meshes.box(2, 4).msh())
        result = meshtool("info", path, "--length-unit", "1e-3")
        self.assertEqual(result.returncode, 0, result.stderr)
        for text in ("32 triangles, 25 nodes, 16 boundary facets", "volume 1e-06 m2, boundary 0.004 m", "side", "body"):
            self.assertIn(text, result.stdout)

    def test_more_ranks_than_elements(self):
        mesh = small_meshes.box(2, 1)
        self.assertEqual(self.info(self.put(mesh.msh()), ranks=4)["elements"], 2)


class Convert(Files):
    ENDINGS = ("a.msh", "b.mesh", "c.meshb", "d.h5", "e.msh")

    def test_names_and_numbers_survive_every_format(self):
        for dim, ranks in ((2, 2), (3, 3)):
            original = self.put(small_meshes.box(dim, 3).msh())
            expected = self.info(original)
            previous = original
            for name in self.ENDINGS:
                with self.subTest(dim=dim, name=name):
                    result = meshtool("convert", previous, self.folder / name, ranks=ranks)
                    self.assertEqual(result.returncode, 0, result.stderr)
                    previous = self.folder / name
                    self.assert_same(self.info(previous), expected)

    def assert_same(self, info, expected):
        for key in ("dimension", "nodes", "elements", "boundary_facets", "unnamed_boundary_facets", "bounding_box"):
            self.assertEqual(info[key], expected[key], key)
        for key, size in (("regions", "volume"), ("groups", "area")):
            sizes = lambda entries: {entry["name"]: round(entry[size], 12) for entry in entries}
            self.assertEqual(sizes(info[key]), sizes(expected[key]))

    def test_every_form_of_msh_is_written(self):
        original = self.put(small_meshes.box(3, 2).msh())
        expected = self.info(original)
        for version in ("2.2", "4.1"):
            for form in (["--ascii"], []):
                with self.subTest(version=version, form=form):
                    out = self.folder / "out.msh"
                    self.assertEqual(meshtool("convert", original, out, "--msh-version", version, *form, ranks=2).returncode, 0)
                    head = out.read_bytes().split(b"\n")[1]
                    self.assertEqual(head, f"{version} {0 if form else 1} 8".encode())
                    self.assert_same(self.info(out), expected)

    def test_the_partitioned_file_holds_each_element_once(self):
        out = self.folder / "out.h5"
        meshtool("convert", self.put(small_meshes.box(3, 3).msh()), out, ranks=3)
        with h5py.File(out) as file:
            self.assertEqual(sum(len(file[name]["cells"]) for name in file if name.startswith("p")), 162)
        self.assertTrue(out.with_suffix(".xdmf").exists())

    def test_cad_is_meshed_and_named(self):
        cad = self.put('SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 2, 1, 1};\n', "box.geo")
        out = self.folder / "out.msh"
        result = meshtool("convert", cad, out, "--size", "0.5", "--length-unit", "0.1", ranks=2)
        self.assertEqual(result.returncode, 0, result.stderr)
        info = self.info(out)
        self.assertAlmostEqual(info["volume"], 2e-3, places=12)
        self.assertEqual([r["name"] for r in info["regions"]], ["volume"])
        self.assertEqual([g["name"] for g in info["groups"]], ["surface"])
        self.assertEqual(meshtool("check", out, ranks=2).returncode, 0)

    def test_the_names_of_a_cad_file_are_kept(self):
        cad = self.put('SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 2, 1};\n'
                       'Physical Surface("plate") = {1}; Physical Curve("left") = {4};\n', "plate.geo")
        out = self.folder / "out.h5"
        self.assertEqual(meshtool("convert", cad, out, "--size", "0.3").returncode, 0)
        info = self.info(out)
        self.assertEqual([r["name"] for r in info["regions"]], ["plate"])
        self.assertEqual([(g["name"], round(g["area"], 12)) for g in info["groups"]], [("left", 1.0)])

    def test_what_cannot_be_converted_is_refused(self):
        mesh = self.put(small_meshes.box(2, 1).msh())
        cad = self.put("Point(1) = {0,0,0}; nonsense(\n", "bad.geo")
        out = self.folder / "out.msh"
        self.assert_refused(meshtool("convert", mesh, self.folder / "out.foo", ranks=2), "out.foo", ".msh, .h5")
        self.assert_refused(meshtool("convert", cad, out), "--size")
        self.assert_refused(meshtool("convert", cad, out, "--size", "1", ranks=2), "bad.geo", "line 1")
        self.assert_refused(meshtool("convert", mesh, out, "--size", "1"), "--size is for CAD files")
        self.assert_refused(meshtool("convert", self.folder / "no.step", out, "--size", "1"), "no.step")
        self.assertFalse(out.exists())

    def test_a_place_that_cannot_be_written_is_exit_code_4(self):
        mesh = self.put(small_meshes.box(2, 1).msh())
        for name in ("out.msh", "out.h5", "out.mesh"):
            result = meshtool("convert", mesh, self.folder / "nowhere" / name, ranks=2)
            self.assertEqual(result.returncode, 4, result.stderr)
            self.assertIn(name, result.stderr)


class Check(Files):
    def test_sound_meshes_pass(self):
        for dim in (2, 3):
            path = self.put(small_meshes.box(dim, 3).msh())
            for ranks in (1, 3):
                result = meshtool("check", path, ranks=ranks)
                self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
                self.assertIn("sound", result.stdout)

    def assert_unsound(self, mesh, *kinds):
        result = meshtool("check", self.put(mesh.msh()), ranks=2)
        self.assert_refused(result, "mesh.msh: the mesh is not sound")
        found = [line.split(": ")[1] for line in result.stdout.splitlines()]
        self.assertEqual(found, list(kinds), result.stdout)

    def test_orientation(self):
        mesh = small_meshes.box(3, 2)
        kind, tag, nodes = mesh.elements[-1]
        mesh.elements[-1] = (kind, tag, [nodes[1], nodes[0], *nodes[2:]])
        self.assert_unsound(mesh, "inverted elements")

    def test_unused_and_coincident_nodes(self):
        mesh = small_meshes.box(2, 3)
        mesh.nodes[900] = (0.3, 0.2, 0.0)
        self.assert_unsound(mesh, "unused nodes")
        # The last triangle gets a corner of its own at the old place: a crack, and a named edge that is gone.
        mesh = small_meshes.box(2, 3)
        kind, tag, nodes = mesh.elements[-1]
        mesh.nodes[900] = mesh.nodes[nodes[2]]
        mesh.elements[-1] = (kind, tag, [*nodes[:2], 900])
        path = self.put(mesh.msh())
        result = meshtool("check", path)
        self.assertEqual(result.returncode, 2)
        self.assertIn("coincident nodes: 1 ", result.stdout)

    def test_untagged_boundary(self):
        mesh = small_meshes.box(3, 2)
        mesh.elements = [e for e in mesh.elements if e[:2] != (2, 2)]
        self.assert_unsound(mesh, "untagged boundary")

    def test_a_face_of_three_elements_and_a_hanging_node(self):
        mesh = small_meshes.box(2, 2)
        # One more triangle on an inner edge, and one whose corner hangs in the edge x = 1.
        inner = [n for n, (x, y, z) in mesh.nodes.items() if x == 0.5 and y <= 0.5]
        mesh.nodes.update({901: (2.0, 3.5, 0.0), 902: (1.0, 0.25, 0.0), 903: (2.0, 0.0, 0.0), 904: (2.0, 0.5, 0.0)})
        mesh.elements += [(2, 1, [*inner, 901]), (2, 1, [902, 903, 904])]
        result = meshtool("check", self.put(mesh.msh()), ranks=2)
        self.assertEqual(result.returncode, 2)
        for text in ("crowded faces: 1 ", "hanging nodes: 1 ", "at 1 0.25 0 m", "untagged boundary: 5 of 13"):
            self.assertIn(text, result.stdout)

    def test_elements_given_twice_and_flat_ones(self):
        mesh = small_meshes.box(2, 2)
        mesh.elements.append(mesh.elements[-1])
        self.assert_unsound(mesh, "repeated elements")
        mesh = small_meshes.box(2, 2)
        mesh.nodes.update({901: (2.0, 0.0, 0.0), 902: (3.0, 0.0, 0.0), 903: (4.0, 0.0, 0.0)})
        mesh.elements += [(2, 1, [901, 902, 903])] + [(1, 3, pair) for pair in ([901, 902], [902, 903], [903, 901])]
        self.assert_unsound(mesh, "flat elements", "hanging nodes")

    def test_bodies_may_touch_without_sharing_nodes(self):
        mesh = small_meshes.box(3, 1)
        other = small_meshes.box(3, 2)
        mesh.nodes.update({n + 100: (x, y, z + 1.0) for n, (x, y, z) in other.nodes.items()})
        mesh.elements += [(kind, 2 if kind == 4 else tag, [n + 100 for n in nodes]) for kind, tag, nodes in other.elements]
        mesh.names[(3, 2)] = "upper"
        path = self.put(mesh.msh())
        result = meshtool("check", path, ranks=2)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)


class CommandLine(Files):
    def test_a_misspelt_command_is_suggested(self):
        self.assert_refused(meshtool("inof", "x", ranks=2), "unknown command 'inof'", "did you mean 'info'", "convert")

    def test_words_that_do_not_fit_are_refused(self):
        self.assert_refused(meshtool(), "a command is missing")
        self.assert_refused(meshtool("info"), "MESH is required", "meshtool info --help")
        self.assert_refused(meshtool("info", "a.msh", "--jsn"), "--jsn")
        self.assert_refused(meshtool("check", "a.msh", "--length-unit", "-1"), "--length-unit")

    def test_help_and_version(self):
        for words in (["--help"], ["help"], ["info", "--help"], ["check", "--help"], ["convert", "-h"], ["--version"]):
            result = meshtool(*words)
            self.assertEqual((result.returncode, result.stderr), (0, ""), words)
            self.assertIn("meshtool", result.stdout)

    def test_a_damaged_file_is_one_message_on_any_rank_count(self):
        text = small_meshes.box(3, 2).msh()
        path = self.put(text[:len(text) // 2])
        for command in ("info", "check"):
            for ranks in (1, 3):
                self.assert_refused(meshtool(command, path, ranks=ranks), "mesh.msh:")
        self.assert_refused(meshtool("info", self.folder / "absent.msh", ranks=3), "absent.msh: cannot be opened")
        self.assert_refused(meshtool("info", self.put("no hdf5", "a.h5"), ranks=2), "a.h5")
        self.assert_refused(meshtool("info", self.put("no medit", "a.mesh"), ranks=2), "a.mesh")


if __name__ == "__main__":
    unittest.main()
