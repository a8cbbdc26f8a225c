"""Damaged and spoilt case files for --check: none may crash, hang, or pass where it is wrong."""
import pathlib
import random
import re
import subprocess
import time

from runs import BIN, LAUNCH

PIECES = ["[", "]", "=", '"', ";", "#", "\n", "\r", "\t", ".", "^", "(", ")", "/", "-", "1e", "nan", "inf", "free", "\xff", "\0",
          "1e999", "-1", "0", "[body.", "[fluid.x]\n", "MPa", "s^m", "?:", "&&", "sin(", "x", "99999999999", " "]
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
[boundary.bottom]
group = bottom
velocity = free 0
[tool.die]
shape = plane
point = 0 1 m
normal = 0 -1
velocity = 0 -1 mm/s
friction = 0.3
[remesh]
size = 0.2 m
[solver]
newton_tolerance = 1e-5
[output]
every = 2
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
[fluid.air]
viscosity = 0.1 Pa.s
[initial]
fluid = air
[inlet.gate]
group = left
fluid = melt
flow_rate = 1 cm3/s
[vent.out]
group = right
[wall.bottom]
group = bottom
condition = slip
[wall.top]
group = top
[front]
mixture = fraction
cfl = 0.5
[limits]
wall_time = 2 h
""",
}


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


class Checker:
    """Writes mutants into a directory and runs --check on them."""

    def __init__(self, directory, mesh, seed):
        self.directory = pathlib.Path(directory)
        (self.directory / "square.msh").write_text(mesh)
        self.dice = random.Random(seed)
        self.slowest = 0.0
        self.codes = {0: 0, 2: 0}

    def try_one(self, program, ranks=1):
        """What is wrong with the program's answer to the next mutant; None where nothing is."""
        is_wrong = self.dice.random() < 0.3
        text = (spoil if is_wrong else damage)(CASES[program], self.dice)
        case = self.directory / "case.ini"
        case.write_bytes(text.encode("latin-1"))
        began = time.monotonic()
        try:
            result = subprocess.run(([*LAUNCH, str(ranks)] if ranks > 1 else []) + [BIN / program, "--check", case],
                                    capture_output=True, timeout=60, cwd=self.directory)
        except subprocess.TimeoutExpired:
            return f"{program} hangs on {ranks} ranks:\n{text}"
        self.slowest = max(self.slowest, time.monotonic() - began)
        self.codes[result.returncode] = self.codes.get(result.returncode, 0) + 1
        said = result.stderr.decode(errors="replace")
        if result.returncode not in (0, 2) or (is_wrong and result.returncode != 2):
            return f"{program} ended with {result.returncode} on {ranks} ranks:\n{said}\n{text}"
        if result.returncode == 2 and "error: " not in said:
            return f"{program} refused without a word on {ranks} ranks:\n{text}"
        left = sorted(path.name for path in self.directory.iterdir() if path.name not in ("case.ini", "square.msh"))
        return f"{program} --check wrote {left}:\n{text}" if left else None
