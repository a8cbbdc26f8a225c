"""The rules of the source tree hold here, and the checkers refuse what breaks them."""
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

SOURCE = pathlib.Path(os.environ["MALLEUS_SOURCE"])


def run(script, *arguments):
    return subprocess.run([SOURCE / "scripts" / script, *arguments], capture_output=True, text=True)


def write_tree(root, files):
    for name, text in files.items():
        path = pathlib.Path(root) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


# A tree that keeps the rule; each forbidden sample below adds one file to it.
SOUND = {
    "libcore/base/error.hpp": "#include <string>\n",
    "libcore/mesh/mesh.hpp": '#include "base/error.hpp"\n',
    "libcore/fem/assembly.hpp": '#include "mesh/mesh.hpp"\n#include <petscmat.h>\n',
    "libcore/storage/writer.hpp": '#include "mesh/mesh.hpp"\n#include <hdf5.h>\n',
    "libcore/partition/balance.hpp": '#include "mesh/mesh.hpp"\n',
    "forge/contact.hpp": '#include "fem/assembly.hpp"\n#include "forge/tool.hpp"\n',
    "forge/tool.hpp": "",
    "inject/front.hpp": '#include "fem/assembly.hpp"\n',
    "apps/forge.cpp": '#include "forge/contact.hpp"\n',
    "tests/unit/mesh/mesh_test.cpp": '#include "mesh/mesh.hpp"\n#include "forge/contact.hpp"\n',
}
FORBIDDEN = {
    "a lower layer includes a higher one": {"libcore/mesh/bad.cpp": '#include "fem/assembly.hpp"\n'},
    "by a relative path": {"libcore/mesh/bad.cpp": '#include "../fem/assembly.hpp"\n'},
    "in angle brackets": {"libcore/mesh/bad.cpp": "#  include <fem/assembly.hpp>\n"},
    "layers of one row": {"libcore/storage/bad.cpp": '#include "partition/balance.hpp"\n'},
    "the core includes a process": {"libcore/engine/bad.cpp": '#include "forge/contact.hpp"\n'},
    "one process includes another": {"inject/bad.cpp": '#include "forge/contact.hpp"\n'},
    "a process includes an application": {"forge/bad.cpp": '#include "apps/main.hpp"\n', "apps/main.hpp": ""},
    "code includes a test": {"forge/bad.cpp": '#include "tests/world.hpp"\n', "tests/world.hpp": ""},
    "HDF5 outside storage": {"forge/bad.cpp": "#include <hdf5.h>\n"},
    "PETSc in the mesh": {"libcore/mesh/bad.cpp": "#include <petscmat.h>\n"},
    "an unknown layer": {"libcore/extra/bad.cpp": "\n"},
}


class Layers(unittest.TestCase):
    def test_this_tree_keeps_the_rule(self):
        result = run("check_layers")
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_a_sound_tree_passes(self):
        with tempfile.TemporaryDirectory() as root:
            write_tree(root, SOUND)
            result = run("check_layers", root)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn(f"{len(SOUND)} files", result.stdout)

    def test_each_forbidden_include_is_refused(self):
        for why, files in FORBIDDEN.items():
            with self.subTest(why), tempfile.TemporaryDirectory() as root:
                write_tree(root, SOUND | files)
                result = run("check_layers", root)
                self.assertEqual(result.returncode, 1)
                self.assertIn("bad.cpp", result.stderr)
                self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)

    def test_an_empty_tree_does_not_pass(self):
        with tempfile.TemporaryDirectory() as root:
            self.assertEqual(run("check_layers", root).returncode, 1)


class Sizes(unittest.TestCase):
    def test_this_tree_keeps_the_limit(self):
        result = run("check_sizes")
        self.assertEqual(result.returncode, 0, result.stdout)

    def test_a_long_file_is_refused(self):
        with tempfile.TemporaryDirectory() as root:
            write_tree(root, {"forge/long.cpp": "\n" * 601, "forge/short.cpp": "\n" * 600})
            result = run("check_sizes", root)
            self.assertEqual(result.returncode, 1)
            self.assertIn("forge/long.cpp: 601 lines", result.stdout)


class Scripts(unittest.TestCase):
    def test_each_script_is_executable_and_has_a_usage_text(self):
        for script in sorted((SOURCE / "scripts").iterdir()):
            if script.is_dir() or script.suffix == ".py" or script.name == "environment":
                continue
            with self.subTest(script.name):
                result = run(script.name, "--help")
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertIn("usage: scripts/" + script.name, result.stdout)

    def test_shell_scripts_stop_at_the_first_error(self):
        for script in sorted((SOURCE / "scripts").iterdir()):
            if script.is_file() and script.read_bytes().startswith(b"#!/bin/bash"):
                self.assertIn("\nset -euo pipefail\n", script.read_text(), script.name)


class Pages(unittest.TestCase):
    def test_links_lead_to_files(self):
        pages = [SOURCE / "README.md", *SOURCE.glob("docs/*.md"), *SOURCE.glob("cases/**/*.md")]
        links = [(page, link) for page in pages for link in re.findall(r"\]\(([^)#]+)", page.read_text())]
        self.assertGreater(len(links), 20)
        for page, link in links:
            if "://" not in link:
                self.assertTrue((page.parent / link).exists(), f"{page.relative_to(SOURCE)}: {link}")


if __name__ == "__main__":
    unittest.main()
