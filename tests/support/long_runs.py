"""Small runs of many increments, for tests of what happens to long ones: a remeshed upsetting and a filling."""
import os
import pathlib
import re
import signal
import subprocess
import time

import h5py
import small_meshes
from channel_case import AIR, CHANNEL, channel_mesh
from runs import BIN, LAUNCH, PATIENCE

UPSETTING = """[mesh]
file = box.msh
[time]
stroke = 0.5 m
step = {step}
[body.billet]
group = body
law = norton-hoff
consistency = 1e6
rate_sensitivity = 0.5
[tool.upper]
shape = plane
point = 0 1
normal = 0 -1
velocity = 0 -1
friction = 0.5
[tool.lower]
shape = plane
point = 0 0
normal = 0 1
friction = 0.5
[remesh]
size = 0.12
every = 7
"""

FILLING = CHANNEL + AIR + """[time]
end = 0.6 s
step = {step}
"""
OFTEN = """[accuracy]
two_meshes = no
[output]
every = 3
[checkpoint]
every = 2
"""
PROGRAMS = ("forge", "inject")
TEXTS = {"forge": UPSETTING, "inject": FILLING}
# With every kind of component that a scene of one body, or one of two fluids, can have.
EVERYTHING = {
    "forge": """density = 7800
conductivity = 30
heat_capacity = 600
[thermal]
initial = 1300
[gravity]
acceleration = 0 -9.81
[partition]
method = cost
[probe.middle]
point = 0.5 0.4
fields = velocity temperature
moves = with-material
""",
    "inject": """[gravity]
acceleration = 0 -9.81
[remesh]
size = 1 mm
min_size = 0.7 mm
[partition]
method = cost
[probe.middle]
point = 0.005 0.002
fields = velocity pressure
""",
}


def write_case(program, directory, increments=60, extra=""):
    """A case of about so many increments in the directory, with more sections behind it; its path."""
    directory = pathlib.Path(directory)
    if program == "forge":
        (directory / "box.msh").write_text(small_meshes.box(2, 5).msh())
    else:
        channel_mesh(directory / "channel.msh", 4)
    whole = 0.5 if program == "forge" else 0.6
    case = directory / f"{program}.ini"
    case.write_text(TEXTS[program].format(step=whole / increments) + OFTEN + extra)
    return case


def write_full_case(program, directory, increments=60):
    """A case of about so many increments that has all kinds of components; its path."""
    case = write_case(program, directory, increments)
    if program == "forge":
        body, rest = EVERYTHING["forge"].split("[thermal]")
        text = case.read_text().replace("rate_sensitivity = 0.5\n", "rate_sensitivity = 0.5\n" + body) + "[thermal]" + rest
    else:
        text = case.read_text().replace("viscosity = 1000.0\n", "viscosity = 1000.0\ndensity = 900\n")
        text = text.replace("viscosity = 0.1\n", "viscosity = 0.1\ndensity = 1\n") + EVERYTHING["inject"]
    case.write_text(text.replace("two_meshes = no\n", ""))
    return case


def command(program, case, output, *options, ranks=1):
    return [str(word) for word in ([*LAUNCH, str(ranks)] if ranks > 1 else [])
            + [BIN / program, "--quiet", case, "-o", output, *options]]


def start(program, case, output, *options, ranks=1, **popen):
    """The running process; its output goes to pipes."""
    return subprocess.Popen(command(program, case, output, *options, ranks=ranks), text=True, stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, **popen)


def ranks_of(process, program):
    """Process ids of the ranks below a started process (itself, where there is no mpirun)."""
    if pathlib.Path(os.readlink(f"/proc/{process.pid}/exe")).name == program:
        return [process.pid]
    children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    found = []
    for child in children:
        try:
            if pathlib.Path(os.readlink(f"/proc/{child}/exe")).name == program:
                found.append(int(child))
        except OSError:
            pass  # it ended meanwhile
    return found


def rows_so_far(output):
    try:
        return max(0, (pathlib.Path(output) / "history.csv").read_text().count("\n") - 1)
    except OSError:
        return 0


def wait_for_rows(process, output, rows, seconds=120):
    """Until history.csv has so many rows; False where the process ended before."""
    limit = time.monotonic() + seconds * PATIENCE
    while rows_so_far(output) < rows:
        if process.poll() is not None:
            return False
        if time.monotonic() > limit:
            process.send_signal(signal.SIGKILL)
            raise AssertionError(f"{output}: {rows} rows were not reached within {seconds} s")
        time.sleep(0.005)
    return True


def finish(process, seconds=240):
    """Exit code and what was said; a process that hangs is an error."""
    try:
        said, complaints = process.communicate(timeout=seconds * PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        raise AssertionError(f"{process.args} did not end within {seconds} s") from None
    return process.returncode, said + complaints


def digits(output):
    """The rows of history.csv as text, without the wall time and the number of ranks."""
    lines = (pathlib.Path(output) / "history.csv").read_text().splitlines()
    left_out = {lines[0].split(",").index(name) for name in ("wall_s", "ranks")}
    return [[cell for i, cell in enumerate(line.split(",")) if i not in left_out] for line in lines]


def steps(output, name):
    """Increments that the .xdmf names, with the files of each."""
    text = (pathlib.Path(output) / f"{name}.xdmf").read_text()
    found = {}
    for part in text.split("<!-- increment ")[1:]:
        number = int(part.split(" ", 1)[0])
        if number in found:
            raise AssertionError(f"{output}: increment {number} stands twice in the .xdmf")
        found[number] = sorted(set(re.findall(r">([^<>:]+\.h5):", part)))
    return found


def check_sound(output, name, every=3):
    """A finished run: no gap and no repeat in its rows and outputs, and every file can be read to its last value."""
    numbers = [int(row[0]) for row in digits(output)[1:]]
    if numbers != list(range(1, len(numbers) + 1)):
        raise AssertionError(f"{output}: rows {numbers}")
    written = steps(output, name)
    missing = [n for n in range(0, len(numbers) + 1, every) if n not in written]
    if missing or list(written) != sorted(written) or max(written) != len(numbers):
        raise AssertionError(f"{output}: outputs {list(written)}, missing {missing}")
    for files in written.values():
        for file in files:
            read_all(pathlib.Path(output) / file)
    left = [p.name for p in (pathlib.Path(output) / "checkpoints").iterdir() if not p.name.isdigit()]
    if left:
        raise AssertionError(f"{output}: left over: {left}")


def read_all(path):
    """Reads every value of an HDF5 file."""
    with h5py.File(path, "r") as file:
        file.visititems(lambda _, item: item[()] if isinstance(item, h5py.Dataset) else None)


def kill(process, program, which, random):
    """SIGKILL of all ranks at once, or of one of them."""
    ranks = ranks_of(process, program)
    for pid in ranks if which == "all" else [random.choice(ranks)] if ranks else []:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
    if not ranks:
        process.kill()


def wait_for_writing(process, output, seconds=60):
    """Until a checkpoint is being written; False where the process ended before."""
    directory = pathlib.Path(output) / "checkpoints"
    limit = time.monotonic() + seconds * PATIENCE
    while process.poll() is None and time.monotonic() < limit:
        try:
            if any(name.startswith("unfinished") for name in os.listdir(directory)):
                return True
        except OSError:
            pass
        time.sleep(0.0005)
    return False
