"""Damaged and spoilt case files for --check: none may crash, hang, or pass where it is wrong."""
import os
import pathlib
import random
import re
import subprocess
import tempfile
import threading

from runs import BIN, LAUNCH, PATIENCE
from small_meshes import SmallMesh

MOST_WORK = 10  # processor seconds of all ranks that an answer may take
MOST_SECONDS = 300  # seconds after which it is no answer, also where others keep the machine busy
PIECES = ["[", "]", "=", '"', ";", "#", "\n", "\r", "\t", ".", "^", "(", ")", "/", "-", "1e", "nan", "inf", "free", "\xff", "\0",
          "1e999", "-1", "0", "[body.", "[fluid.x]\n", "MPa", "s^m", "?:", "&&", "sin(", "x", "99999999999", " "]
VALUES = ["0", "-1", "1", "2", "3", "7", "0.5", "1e-3", "1e-9", "1e3", "1e9", "1e-300", "1e300", "2147483648", "yes", "no", "auto",
          "sharp", "trace", "measured", "fine", "draft", "tresca", "coulomb", "hammer", "void", "rigid", "newtonian", "cross"]
CASES = {
    "forge": """[mesh]
file = square.msh
[time]
end = 1 s
step = 0.1 s
[body.part]
group = part
law = norton-hoff
consistency = 10 Pa.s^m
rate_sensitivity = 0.4
density = 7800 kg/m3
conductivity = 25
heat_capacity = 600
[boundary.bottom]
group = bottom
velocity = free 0
[tool.die]
shape = plane
point = 0 1 m
normal = 0 -1
velocity = 0 -1 mm/s
friction = 0.3
friction_law = tresca
temperature = 300
heat_transfer = 1000
[tool.ball]
shape = sphere
point = 0.5 2 m
radius = 0.3 m
velocity = 0 -2 mm/s
[thermal]
initial = 1100
[gravity]
acceleration = 0 -9.81
[remesh]
size = 0.2 m
gradation = 1.4
[solver]
newton_tolerance = 1e-5
max_newton = 40
[penalty]
penalty = 1e4
[motion]
scheme = euler
[accuracy]
level = draft
[probe.middle]
point = 0.5 0.5
fields = velocity pressure
[output]
every = 2
precision = float64
[checkpoint]
every = 5
[limits]
memory = 4 GiB
[partition]
balance = counted
[body_force]
x = "sin(_pi*x)"
""",
    "inject": """[mesh]
file = square.msh
[time]
increments = 3
[fluid.melt]
law = power-law
consistency = 1000
exponent = 0.6
density = 900
[fluid.air]
viscosity = 0.1 Pa.s
density = 1.2
[initial]
fluid = air
[initial.drop]
fluid = melt
shape = sphere
center = 0.2 0.5
radius = 0.1
[inlet.gate]
group = left
fluid = melt
flow_rate = 1 cm3/s
switch_pressure = 1 MPa
then_pressure = 1 MPa
[vent.out]
group = right
pressure = 1 bar
[wall.bottom]
group = bottom
condition = slip
[wall.top]
group = top
[front]
mixture = fraction
cfl = 0.5
thickness = 1
[flow]
update = every 2
[gravity]
acceleration = 0 -9.81
[remesh]
size = 0.3
[reference]
velocity_x = "y*(1-y)"
at = end
[accuracy]
level = fine
[output]
fields = velocity level_set
[limits]
wall_time = 2 h
""",
}


def square(cells):
    """The unit square of wrong_input_test.MESH in cells x cells squares: fine enough for --check to run the scene ahead."""
    number = lambda i, j: 1 + i + j * (cells + 1)
    nodes = [(i / cells, j / cells) for j in range(cells + 1) for i in range(cells + 1)]
    elements = []
    for i in range(cells):
        elements += [(1, 1, (number(i, 0), number(i + 1, 0))), (1, 2, (number(cells, i), number(cells, i + 1))),
                     (1, 3, (number(i + 1, cells), number(i, cells))), (1, 4, (number(0, i + 1), number(0, i)))]
        for j in range(cells):
            elements += [(2, 5, (number(i, j), number(i + 1, j), number(i + 1, j + 1))),
                         (2, 5, (number(i, j), number(i + 1, j + 1), number(i, j + 1)))]
    names = {(1, 1): "bottom", (1, 2): "right", (1, 3): "top", (1, 4): "left", (2, 5): "part"}
    return SmallMesh({k: (x, y, 0.0) for k, (x, y) in enumerate(nodes, 1)}, elements, names).msh()


def damage(text, dice):
    """Some letters or stretches changed, taken out, put in or repeated. May still be a case."""
    for _ in range(dice.randint(1, 6)):
        at = dice.randrange(len(text) + 1)
        kind = dice.randrange(5)
        if kind == 0:
            text = text[:at] + chr(dice.randrange(256)) + text[at + 1:]
        elif kind == 1:
            text = text[:at] + text[at + dice.randint(1, 20):]
        elif kind == 2:
            text = text[:at] + dice.choice(PIECES) + text[at:]
        elif kind == 3:
            begin = dice.randrange(len(text) + 1)
            text = text[:at] + text[begin:begin + dice.randint(1, 60)] + text[at:]
        else:
            lines = text.split("\n")
            dice.shuffle(lines) if dice.random() < 0.2 else lines.pop(dice.randrange(len(lines)))
            text = "\n".join(lines)
    return text


def bend(text, dice):
    """Values, keys and sections of the right form that say something else: often still a case, and then a strange one."""
    for _ in range(dice.randint(1, 3)):
        lines = text.splitlines()
        titles = [i for i, line in enumerate(lines) if line.startswith("[")]
        keys = [i for i, line in enumerate(lines) if "=" in line]
        kind = dice.randrange(4)
        at = dice.choice(keys)
        if kind == 0:
            lines[at] = lines[at].split("=")[0] + "= " + dice.choice(VALUES)
        elif kind == 1:
            numbers = [i for i in keys if re.search(r"\d", lines[i])]
            at = dice.choice(numbers)
            lines[at] = re.sub(r"\d+(\.\d+)?", lambda _: dice.choice(VALUES[:14]), lines[at], count=1)
        elif kind == 2:
            begin = dice.choice(titles)
            end = next((i for i in titles if i > begin), len(lines))
            del lines[begin:end]
        else:
            del lines[at]
        text = "\n".join(lines) + "\n"
        if "=" not in text:
            break
    return text


def spoil(text, dice):
    """One mistake that makes the case wrong whatever else it says."""
    lines = text.splitlines()
    keys = [i for i, line in enumerate(lines) if "=" in line]
    at = dice.choice(keys)
    key, value = (part.strip() for part in lines[at].split("=", 1))
    kind = dice.randrange(5)
    if kind == 0:
        lines[at] = f"{key}{dice.choice('qz')} = {value}"
    elif kind == 1:
        lines.insert(at, lines[at])  # given twice
    elif kind == 2:
        titles = [i for i, line in enumerate(lines) if line.startswith("[")]
        at = dice.choice(titles)
        lines[at] = re.sub(r"^\[(\w+)", r"[\1qz", lines[at])
    elif kind == 3:
        lines[at] = f"{key} ="
    else:
        numbers = [i for i in keys if re.search(r"= *[\d.-]", lines[i])]
        at = dice.choice(numbers)
        lines[at] = re.sub(r"= *[-\d.e]+", "= " + dice.choice(["many", "nan", "1e999", "--3", "0x", "1,5"]), lines[at])
    return "\n".join(lines) + "\n"


def mutant(program, seed, number):
    """The text of a mutant, the same at each call, and whether it must be refused."""
    dice = random.Random(f"{program} {seed} {number}")
    how = dice.choice((spoil, damage, bend))
    return how(CASES[program], dice), how is spoil


def run(command, directory, sessions):
    """Exit code, what was said on standard error, and processor seconds; a signal's negative number as the exit code. Open MPI's
    files go to a directory of their own: runs at a time take one another's away."""
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said, cwd=directory,
                                   env={**os.environ, "OMPI_MCA_orte_tmpdir_base": str(sessions)})
        alarm = threading.Timer(MOST_SECONDS, process.kill)
        alarm.start()
        _, status, usage = os.wait4(process.pid, 0)
        alarm.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        return process.returncode, said.read().decode(errors="replace"), usage.ru_utime + usage.ru_stime


class Answers:
    """Exit codes of many answers, and the processor seconds of the longest."""

    def __init__(self):
        self.codes = {0: 0, 2: 0}
        self.slowest = 0.0

    def add(self, code, seconds):
        self.codes[code] = self.codes.get(code, 0) + 1
        self.slowest = max(self.slowest, seconds)


class Checker:
    """Runs --check on case texts in a directory of its own."""

    def __init__(self, directory, mesh):
        self.directory = pathlib.Path(directory) / "case"
        self.sessions = pathlib.Path(directory) / "sessions"
        for path in (self.directory, self.sessions):
            path.mkdir(exist_ok=True)
        (self.directory / "square.msh").write_text(mesh)

    def judge(self, program, text, is_wrong, answers, ranks=1):
        """What is wrong with the program's answer to the text; None where nothing is."""
        case = self.directory / "case.ini"
        case.write_bytes(text.encode("latin-1"))
        code, said, seconds = run(([*LAUNCH, str(ranks)] if ranks > 1 else []) + [BIN / program, "--check", case],
                                  self.directory, self.sessions)
        answers.add(code, seconds)
        if code not in (0, 2) or (is_wrong and code != 2):
            return f"{program} ended with {code} on {ranks} ranks:\n{said}\n{text}"
        if code == 2 and "error: " not in said:
            return f"{program} refused without a word on {ranks} ranks:\n{text}"
        if seconds > MOST_WORK * PATIENCE:
            return f"{program} worked for {seconds:.0f} s on {ranks} ranks:\n{text}"
        left = sorted(path.name for path in self.directory.iterdir() if path.name not in ("case.ini", "square.msh"))
        return f"{program} --check wrote {left}:\n{text}" if left else None


class Batch:
    """Mutants of consecutive numbers that one process answers, a file each."""

    def __init__(self, directory, mesh, program, seed, numbers):
        self.directory, self.program, self.numbers = pathlib.Path(directory), program, numbers
        self.reached = numbers.start  # the first that was not asked
        self.is_wrong = {}
        (self.directory / "square.msh").write_text(mesh)
        for number in numbers:
            text, self.is_wrong[number] = mutant(program, seed, number)
            self.path(number).write_bytes(text.encode("latin-1"))

    def path(self, number):
        return self.directory / f"{number}.ini"

    def judge(self, ranks, answers):
        """Asks as many as the process lives to answer; number -> what is wrong with the answer."""
        before = sorted(self.directory.iterdir())
        words = [*LAUNCH, ranks, BIN.parent / "tests" / "check_cases", self.program, self.directory, self.numbers.start, self.numbers.stop]
        ended = subprocess.run([str(word) for word in words], capture_output=True, cwd=self.directory)
        wrong = {}
        for line in ended.stdout.decode("latin-1").split("\n")[:-1]:
            number, code, said = line.split(" ", 2)
            if int(number) != self.reached:
                raise AssertionError(f"mutant {self.reached} is passed over: {line}")
            answers.add(int(code), 0.0)
            if int(code) not in (0, 2) or (self.is_wrong[self.reached] and int(code) != 2) or (int(code) == 2 and not said.strip()):
                wrong[self.reached] = f"answered with {code}: {said}\n{self.path(number).read_text(errors='replace')}"
            self.reached += 1
        if ended.returncode != 0 or self.reached == self.numbers.start:
            number = self.reached
            wrong[number] = f"ended with {ended.returncode}: {ended.stderr.decode('latin-1')}\n{self.path(number).read_text(errors='replace')}"
            self.reached += 1
        if sorted(self.directory.iterdir()) != before:
            wrong[self.numbers.start] = f"the batch wrote {set(self.directory.iterdir()) - set(before)}"
        return wrong
