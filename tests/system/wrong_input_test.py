"""What the programs say about their case files: help, starter, documentation page, and every kind of wrong input."""
import os
import pathlib
import subprocess
import tempfile
import unittest

from runs import PATIENCE

BIN = pathlib.Path(os.environ["MALLEUS_BIN"])
SOURCE = pathlib.Path(os.environ["MALLEUS_SOURCE"])
PROGRAMS = [name for name in ("forge", "inject") if (BIN / name).exists()]

# A square of two triangles: one region, four named edges.
MESH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
5
1 1 "bottom"
1 2 "right"
1 3 "top"
1 4 "left"
2 5 "part"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
6
1 1 2 1 1 1 2
2 1 2 2 2 2 3
3 1 2 3 3 3 4
4 1 2 4 4 4 1
5 2 2 5 5 1 2 3
6 2 2 5 5 1 3 4
$EndElements
"""

CASES = {
    "forge": """[mesh]
file = square.msh
[time]
end = 1 s
step = 0.1 s
[body.part]
group = part
law = newtonian
consistency = 10 Pa.s
[boundary.bottom]
group = bottom
velocity = free 0
[tool.die]
shape = plane
point = 0 1 m
normal = 0 -1
velocity = 0 -1 mm/s
""",
    "inject": """[mesh]
file = square.msh
[time]
increments = 0
[fluid.melt]
viscosity = 10 Pa.s
[inlet.gate]
group = left
flow_rate = 1 cm3/s
[vent.out]
group = right
[wall.bottom]
group = bottom
condition = slip
[wall.top]
group = top
condition = slip
""",
}
BODY = {"forge": "body.part", "inject": "fluid.melt"}


def run(program, *arguments, ranks=1, cwd=None):
    command = [str(BIN / program), *map(str, arguments)]
    if ranks > 1:
        command = ["mpirun", "--oversubscribe", "--allow-run-as-root", "--bind-to", "none", "-n", str(ranks), *command]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=120 * PATIENCE)


def errors_of(result):
    """The program's own lines on standard error: mpirun adds a notice about the exit code."""
    return result.stderr.split("-" * 30)[0].strip()


class Texts(unittest.TestCase):
    def test_the_documentation_page_is_the_programs(self):
        for program in PROGRAMS:
            with self.subTest(program):
                page = SOURCE / "docs" / f"case-{program}.md"
                self.assertEqual(run(program, "--case-page").stdout.strip(), page.read_text().strip(),
                                 f"make it anew: build/bin/{program} --case-page > docs/case-{program}.md")

    def test_help_names_what_the_template_holds(self):
        for program in PROGRAMS:
            with self.subTest(program):
                everything = run(program, "--help-case")
                self.assertEqual(everything.returncode, 0, everything.stderr)
                for line in run(program, "--template").stdout.splitlines():
                    if "=" in line and not line.startswith("; "):
                        self.assertIn(f"\n  {line.strip(';').split(' = ')[0]} ", everything.stdout)
                section = run(program, "--help-case", "solver")
                self.assertIn("newton_tolerance", section.stdout)
                self.assertNotIn("[mesh]", section.stdout)
                unknown = run(program, "--help-case", "sovler")
                self.assertEqual(unknown.returncode, 2)
                self.assertIn("did you mean 'solver'?", unknown.stderr)

    def test_the_template_is_a_case_that_lacks_its_mesh_alone(self):
        for program in PROGRAMS:
            with self.subTest(program), tempfile.TemporaryDirectory() as directory:
                case = pathlib.Path(directory) / "case.ini"
                case.write_text(run(program, "--template").stdout)
                result = run(program, "--check", case)
                self.assertEqual(result.returncode, 2)
                self.assertRegex(result.stderr, r"case\.ini:\d+: \[mesh\] file: no such file or directory: .*part\.msh")
                self.assertEqual(len(errors_of(result).splitlines()), 1, result.stderr)


class WrongInput(unittest.TestCase):
    def check_refused(self, program, text, expected, arguments=(), ranks=1, before_the_run=True):
        """expected: texts that the message holds; {n}: the number of the line that starts with `>` in text."""
        lines = text.splitlines()
        marked = [i for i, line in enumerate(lines, 1) if line.startswith(">")]
        with tempfile.TemporaryDirectory() as directory:
            case = pathlib.Path(directory) / "case.ini"
            case.write_text("\n".join(line.lstrip(">") for line in lines) + "\n")
            (pathlib.Path(directory) / "square.msh").write_text(MESH)
            result = run(program, case, *arguments, ranks=ranks, cwd=directory)
            self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
            for part in expected:
                self.assertIn(part.format(n=marked[0] if marked else 0), result.stderr)
            if not before_the_run:
                return
            self.assertEqual(sorted(path.name for path in pathlib.Path(directory).iterdir()), ["case.ini", "square.msh"],
                             "a refused case writes nothing")

    def test_probes_of_unknown_fields(self):
        probe = "[probe.p]\npoint = 0.5 0.5 m\n>fields = presure\n"
        for program in PROGRAMS:
            for ranks in (1, 3):
                with self.subTest(program, ranks=ranks):
                    self.check_refused(program, CASES[program] + probe, ["case.ini:{n}: [probe.p] fields = presure", "no field",
                                                                         "did you mean 'pressure'?"], ranks=ranks)

    def test_overrides_of_misspelt_sections(self):
        for program in PROGRAMS:
            with self.subTest(program):
                title = BODY[program]
                self.check_refused(program, CASES[program], ["command line", f"did you mean '{title}'?"],
                                   arguments=["-D", f"{title}x.density=1"])

    def test_meshes_that_cover_a_place_twice(self):
        overlapping = MESH.replace("$Nodes\n4\n", "$Nodes\n5\n5 0.5 0.2 0\n").replace("$Elements\n6\n", "$Elements\n7\n")
        overlapping = overlapping.replace("$EndElements", "7 2 2 5 5 1 3 5\n$EndElements")
        for ranks in (1, 2):
            with self.subTest(ranks=ranks), tempfile.TemporaryDirectory() as directory:
                case = pathlib.Path(directory) / "case.ini"
                case.write_text(CASES["forge"])
                (pathlib.Path(directory) / "square.msh").write_text(overlapping)
                result = run("forge", case, cwd=directory, ranks=ranks)
                self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                self.assertRegex(result.stderr, r"square\.msh: the mesh is not sound: 1 faces belong to more than two elements")

    def test_probes_outside_and_unused_options_are_warned_of(self):
        with tempfile.TemporaryDirectory() as directory:
            case = pathlib.Path(directory) / "case.ini"
            case.write_text(CASES["forge"] + "[probe.far]\npoint = 5 5 m\n")
            (pathlib.Path(directory) / "square.msh").write_text(MESH)
            result = run("forge", case, "--", "-ksp_foo", "3", cwd=directory, ranks=2)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn("[probe.far]: outside the mesh: 1 of 1 points", result.stderr)
            self.assertIn("nothing asked for the PETSc option -ksp_foo 3", result.stderr)

    def test_the_sound_case_passes(self):
        for program in PROGRAMS:
            with self.subTest(program), tempfile.TemporaryDirectory() as directory:
                case = pathlib.Path(directory) / "case.ini"
                case.write_text(CASES[program])
                (pathlib.Path(directory) / "square.msh").write_text(MESH)
                result = run(program, "--check", case, cwd=directory)
                self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

    def test_each_mistake_is_named_with_its_line_and_remedy(self):
        for program in PROGRAMS:
            case, body = CASES[program], BODY[program]
            kind = body.split(".")[0]
            for lines, expected in {
                ">[solvr]": "case.ini:{n}: unknown section [solvr]; did you mean 'solver'?",
                "[solver]\n>max_newtn = 3": "case.ini:{n}: unknown key 'max_newtn' in [solver]; did you mean 'max_newton'?",
                "[solver]\n>precision = float32": "case.ini:{n}: unknown key 'precision' in [solver]; that key belongs to [output]",
                "[solver]\n>max_newton = many": "case.ini:{n}: [solver] max_newton = many: 'many' is not a finite number",
                "[solver]\n>newton_tolerance = nan": "case.ini:{n}: [solver] newton_tolerance = nan: 'nan' is not a finite number",
                "[solver]\n>newton_tolerance = 2": "case.ini:{n}: [solver] newton_tolerance = 2: 2 is outside (0, 1)",
                "[limits]\n>wall_time = 3 mm": "case.ini:{n}: [limits] wall_time = 3 mm: unit 'mm' (length) does not fit",
                "[limits]\n>memory = 2 Gb": "case.ini:{n}: [limits] memory = 2 Gb: unknown unit 'Gb'; did you mean 'GB'?",
                "[accuracy]\n>level = fin": "case.ini:{n}: [accuracy] level = fin: expected one of draft | standard | fine | "
                                            "reference; did you mean 'fine'?",
                ">[mesh]": "case.ini:{n}: section [mesh] is given twice, first at ",
                "[output]\nevery = 2\n>every = 3": "case.ini:{n}: [output] every is given twice, first at ",
                "[output\n": "the closing ']' is missing",
                "[output]\n>every": "case.ini:{n}: expected 'key = value' or '[section]', found 'every'",
                "[output]\n>every =": "case.ini:{n}: [output] every has no value",
                "[case]\n>title = \"open": "case.ini:{n}: [case] title has an unclosed quote",
                f">[{kind}]": f"case.ini:{{n}}: section [{kind}] needs a name: [{kind}.NAME]",
                ">[solver.x]": "case.ini:{n}: section [solver.x] takes no name: [solver]",
                ">[boundary.b]\nvelocity = 0 0": "case.ini:{n}: [boundary.b] needs 'group'",
                "[reference]\n>velocity_x = \"sin(w)\"": "not understood at letter 5: unknown 'w'",
                "[body_force]\n>x = 3 mm": "case.ini:{n}: [body_force] x = 3 mm: unit 'mm' (length) does not fit, expected "
                                           "a unit like 'N/m^3'",
                "[boundary.b]\n>group = botom\nvelocity = 0 0":
                    "case.ini:{n}: [boundary.b] group = botom: the mesh has no boundary group of that name; did you mean 'bottom'?",
                "[gravity]\n>acceleration = 0 0 -9.81": "case.ini:{n}: [gravity] acceleration: 3 components, but the mesh has 2 dimensions",
            }.items():
                with self.subTest(program=program, lines=lines):
                    text = case
                    if "acceleration" in lines:
                        text = case.replace(f"[{body}]", f"[{body}]\ndensity = 1 kg/m3")
                    self.check_refused(program, text + lines, [expected])

    def test_formulas_without_a_finite_value_are_refused_on_any_number_of_ranks(self):
        for program in PROGRAMS:
            cases = {"[body_force]\n>x = \"1/(x-x)\"": "case.ini:{n}: [body_force] x: expression '1/(x-x)' gives "}
            if program == "inject":
                viscosity = CASES[program].replace("viscosity = 10 Pa.s", ">viscosity = \"{}\"")
                cases[viscosity.format("sqrt(x-5)")] = "case.ini:{n}: [fluid.melt] viscosity: expression 'sqrt(x-5)' gives "
                cases[viscosity.format("x-5")] = "a viscosity is above zero"
            for lines, expected in cases.items():
                text = lines if "[mesh]" in lines else CASES[program] + lines
                for ranks in (1, 3):
                    with self.subTest(program=program, lines=lines, ranks=ranks):
                        self.check_refused(program, text, [expected], ranks=ranks, before_the_run=False)

    def test_command_line_mistakes(self):
        for program in PROGRAMS:
            case = CASES[program]
            for arguments, expected in (
                (["-D", "solver.max_newton"], "command line: -D solver.max_newton: expected SECTION.KEY=VALUE"),
                (["-D", "solver.max_newtn=3"], "command line: unknown key 'max_newtn' in [solver]; did you mean 'max_newton'?"),
                (["-D", "solver.max_newton=0"], "command line: [solver] max_newton = 0: 0 is outside [1, inf)"),
                (["-D", "mesh.file=absent.msh"], "command line: [mesh] file: no such file or directory"),
                (["--outptu", "x"], "did you mean '--output'?"),
                (["--steps", "many"], "--steps"),
            ):
                with self.subTest(program=program, arguments=arguments):
                    self.check_refused(program, case, [expected], arguments)
            with self.subTest(program=program), tempfile.TemporaryDirectory() as directory:
                self.assertEqual(run(program, "absent.ini", cwd=directory).returncode, 2)
                self.assertEqual(run(program, directory).returncode, 2)
                self.assertEqual(run(program).returncode, 2)

    def test_all_mistakes_come_together_on_any_number_of_ranks(self):
        for program in PROGRAMS:
            wrong = CASES[program].replace("square.msh", "absent.msh") + "[solver]\nmax_newton = 0\n[outptu]\n[limits]\nmemory = 1 m\n"
            for ranks in (1, 2, 3, 4):
                with self.subTest(program=program, ranks=ranks):
                    self.check_refused(program, wrong, ["4 mistakes in ", "absent.msh", "max_newton = 0", "[outptu]", "memory = 1 m"],
                                       ranks=ranks)

    def test_broken_meshes_are_refused_with_their_name(self):
        for program in PROGRAMS:
            for content in (b"", b"no mesh", MESH[: len(MESH) // 2].encode(), bytes(range(256)) * 8):
                with self.subTest(program=program, content=content[:20]), tempfile.TemporaryDirectory() as directory:
                    (pathlib.Path(directory) / "square.msh").write_bytes(content)
                    case = pathlib.Path(directory) / "case.ini"
                    case.write_text(CASES[program])
                    result = run(program, "--check", case, ranks=2, cwd=directory)
                    self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                    self.assertIn("square.msh", result.stderr)


if __name__ == "__main__":
    unittest.main()
