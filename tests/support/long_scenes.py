"""Small scenes of all that a run remembers from increment to increment: contacts, presses, heat, gas, inertia, traced fronts.

    program, case = write_scene("heat", directory, increments=6)
"""
import math
import pathlib
import re
import shutil

import long_runs
from box_msh import BoxMesh
from channel_case import CHANNEL, ETA, H, U, channel_mesh

K = 1e6
# of history.csv, where the scene has them, with what they may differ between runs whose new meshes are others, since what is
# inside a rank is made anew first. The pressure at the gate is that of the filled length, in
# which an element at the front, a sixth of it, counts.
COMPARED = {"time_s": 1e-2, "volume_m3": 1e-2, "force_upper_y_N": 1e-2, "stroke_upper_m": 1e-2, "temperature_billet_K": 1e-2,
            "fill_fraction": 1e-2, "trapped_air_Pa": 1e-2, "pressure_gate_Pa": 2e-1}
# Columns that may differ between runs on one mesh: counts, and what is nothing but the rest of a difference.
COUNTS = ("linear_iterations", "newton_iterations", "volume_change", "volume_error")
ALIKE = 1e-6
OFTEN = """[accuracy]
two_meshes = no
[checkpoint]
every = 1
"""
TIGHT = "[solver]\nnewton_tolerance = 1e-10\nlinear_tolerance = 1e-12\n"
BODY = "group = {name}\nconsistency = {k}\nrate_sensitivity = 0.3\n"
MIDDLE = "[probe.middle]\npoint = {point}\nfields = {fields}\n"


def contact(directory):
    """Two blocks that stick to each other and are made anew every second increment: what is known of contacts must stay."""
    mesh = BoxMesh(2)
    mesh.add("lower", [0.0, 0.0], [1.0, 1.0], (4, 4))
    mesh.add("upper", [0.0, 1.0], [1.0, 2.0], (5, 5))
    mesh.write(directory / "scene.msh")
    text = ""
    for name, k, edge, speed in (("lower", 3 * K, "y_low", 0.0), ("upper", K, "y_high", -2.0)):
        text += f"[body.{name}]\n" + BODY.format(name=name, k=k)
        text += f"[boundary.{name}_side]\ngroup = {name}_x_low\ntype = symmetry\n"
        text += f"[boundary.{name}_press]\ngroup = {name}_{edge}\nvelocity = free {speed}\n"
    return text + """[contact.middle]
slave = upper
master = lower
friction = 1
[remesh]
every = 2
[time]
increments = {increments}
step = 0.02
[partition]
method = cost
"""


def press(directory):
    """A hammer on a block of three dimensions, whose energy is spent bit by bit, and a flow to compare with."""
    return upsetting(directory, 3, "press = hammer\nenergy = 8e5\nmass = 1.6e6\n") + "[remesh]\nevery = 3\n[reference]\nvelocity_z = \"-z\"\n"


def heat(directory):
    """A hot block, revolved, between cold tools; its softening couples the temperature to the force."""
    text = upsetting(directory, 2, "temperature = 450\nheat_transfer = 3000\n").replace(
        "rate_sensitivity = 0.3\n", 'rate_sensitivity = 0.3\ndensity = 7800\nconductivity = 30\nheat_capacity = 600\n'
        'softening = "exp(3000*(1/T - 1/1250))"\n')
    return ("[case]\ngeometry = axisymmetric\n" + text + "[thermal]\ninitial = \"1200+100*y\"\nemissivity = 0.7\n[remesh]\nevery = 2\n"
            + MIDDLE.format(point="0.5 0.4", fields="velocity temperature") + "moves = with-material\n")


def upsetting(directory, dim, of_the_upper_tool):
    mesh = BoxMesh(dim)
    mesh.add("billet", [0.0] * dim, [1.0] * dim, (3,) * dim)
    mesh.write(directory / "scene.msh")
    text = "[body.billet]\n" + BODY.format(name="billet", k=K)
    for axis in "xz"[:dim - 1]:
        text += f"[boundary.{axis}]\ngroup = billet_{axis}_low\ntype = symmetry\n"
    sides = (("upper", 1.0, -1, f"velocity = 0 -1{' 0' * (dim - 2)}\n" + of_the_upper_tool), ("lower", 0.0, 1, ""))
    for name, height, normal, more in sides:
        text += (f"[tool.{name}]\nshape = plane\nfriction = 0.3\npoint = 0 {height}{' 0' * (dim - 2)}\n"
                 f"normal = 0 {normal}{' 0' * (dim - 2)}\n{more}")
    return text + "[time]\nincrements = {increments}\nstep = 0.02\n"


def inertia(directory):
    """A column of water that falls: speeds and front of the increment before count."""
    mesh = BoxMesh(2)
    mesh.add("cavity", [0.0, 0.0], [0.4, 0.3], (12, 9))
    mesh.write(directory / "scene.msh")
    walls = "".join(f"[wall.{side}]\ngroup = cavity_{side}\ncondition = slip\n" for side in ("y_low", "x_low", "x_high"))
    return ("[fluid.water]\nviscosity = 1e-3\ndensity = 1000\n[fluid.air]\nviscosity = 1.8e-5\ndensity = 1.2\n[initial]\nfluid = air\n"
            "[initial.column]\nfluid = water\nshape = box\ncenter = 0.4 0\nsize = 0.2 0.4\n[vent.top]\ngroup = cavity_y_high\n" + walls +
            "[inertia]\n[gravity]\nacceleration = 0 -9.81\n[time]\nincrements = {increments}\nstep = 0.01\n"
            + MIDDLE.format(point="0.35 0.01", fields="velocity pressure"))


def filling(directory, cells=4):
    channel_mesh(directory / "scene.msh", cells)
    return CHANNEL.replace("[mesh]\nfile = channel.msh\n", "") + "[time]\nincrements = {increments}\nstep = 0.02\nend = 1\n"


def trace(directory):
    """A front that is traced back along a flow solved once."""
    return filling(directory, 6) + ("[fluid.air]\nviscosity = 0.1\n[initial]\nfluid = air\n[flow]\nupdate = once\n[front]\ntransport = trace\n"
                                    + MIDDLE.format(point="0.005 0.002", fields="velocity fill_time"))


def gas(directory):
    """Void that is compressed in a closed channel, by a gate that switches over."""
    text = filling(directory).replace("[vent.outlet]", "[wall.outlet]\ncondition = slip")
    text = text.replace("fluid = polymer\n", "fluid = polymer\nswitch_fill = 0.3\nthen_pressure = 1 MPa\n", 1)
    return text + ("[fluid.air]\nlaw = void\n[initial]\nfluid = air\n[initial.start]\nfluid = polymer\nlevel_set = \"0.004 - x\"\n"
                   "[air]\ntrapped = gas\n")


def front(directory):
    """A shear-thinning fluid against air on a mesh that follows the front and shares that are made even."""
    law = "law = carreau-yasuda\nviscosity = 1000\ninfinite_viscosity = 1\ntime_constant = 0.1\nexponent = 0.4"
    return filling(directory).replace(f"viscosity = {ETA}", law) + (
        "[fluid.air]\nviscosity = 0.1\n[initial]\nfluid = air\n[initial.start]\nfluid = polymer\nlevel_set = \"0.004 - x\"\n"
        "[remesh]\nsize = 1 mm\nmin_size = 0.7 mm\n[partition]\nmethod = cost\n"
        + MIDDLE.format(point=f"{2 * H} {H / 2}", fields="velocity viscosity"))


SCENES = {"contact": ("forge", contact), "press": ("forge", press), "heat": ("forge", heat), "inertia": ("inject", inertia),
          "trace": ("inject", trace), "gas": ("inject", gas), "front": ("inject", front)}


def write_scene(name, directory, increments=6):
    """The program of the scene, and the path of its case."""
    program, text_of = SCENES[name]
    directory = pathlib.Path(directory) / name
    directory.mkdir(exist_ok=True)
    case = directory / f"{name}.ini"
    case.write_text("[mesh]\nfile = scene.msh\n" + text_of(directory).replace("{increments}", str(increments)) + OFTEN)
    return program, case


def in_legs(name, directory, increments, ranks, elsewhere):
    """Whether a run that is stopped after each increment, and one that goes on elsewhere (on so many ranks) from the middle, come
    to the rows and probes of the whole run: what is wrong, in words; empty where nothing is. And how far the latter is from it:
    the name of the column of COMPARED that differs most, and its difference."""
    program, case = write_scene(name, directory, increments)
    whole, legs, other = (case.parent / part for part in ("whole", "legs", "other"))
    complete(program, case, whole, ranks=ranks)
    rows = long_runs.rows_so_far(whole)
    for leg in range(rows):
        complete(program, case, legs, "--restart", "--steps", "1", ranks=ranks)
        if leg == rows // 2:
            shutil.copytree(legs, other)
    complete(program, case, legs, "--restart", ranks=ranks)  # nothing is left to do
    complete(program, case, other, "--restart", ranks=elsewhere)
    faults = [] if rows >= min(4, increments) else [f"{rows} increments only"]
    if long_runs.digits(legs) != long_runs.digits(whole):
        faults.append("legs of one increment come to other digits")
    if probes(legs) != probes(whole):
        faults.append("legs of one increment come to other values at the probes")
    apart = differences(long_runs.digits(other), long_runs.digits(whole), last=True)
    compared = {column: apart[column] for column in COMPARED if column in apart}
    faults += [f"elsewhere {column} differs by {d:.1e}" for column, d in compared.items() if not d <= COMPARED[column]]
    return faults, max(compared.items(), key=lambda item: item[1])


def on_one_mesh(name, directory, increments, ranks, elsewhere):
    """Whether runs that never remesh and go on elsewhere (on each of so many ranks) from the middle come to all values of the
    run that stays on so many ranks: what is wrong, in words, and the column that differs most with its difference."""
    program, case = write_scene(name, directory, increments)
    text = case.read_text()
    case.write_text(re.sub(r"\[remesh\]\n(\w+ = .*\n)*", "", text) + TIGHT)
    stays = case.parent / "stays"
    complete(program, case, stays, "--steps", str(increments // 2), ranks=ranks)
    goes = [(other, shutil.copytree(stays, case.parent / f"on_{other}")) for other in elsewhere]
    complete(program, case, stays, "--restart", ranks=ranks)
    faults, worst = [], ("no column", 0.0)
    for other, output in goes:
        complete(program, case, output, "--restart", ranks=other)
        apart = differences(long_runs.digits(output), long_runs.digits(stays))
        faults += [f"on {other} rank(s) {column} differs by {d:.1e}" for column, d in apart.items() if not d <= ALIKE]
        worst = max(worst, *apart.items(), key=lambda item: item[1])
    return faults, worst


def complete(program, case, output, *options, ranks):
    code, said = long_runs.finish(long_runs.start(program, case, output, *options, ranks=ranks))
    if code != 0:
        raise AssertionError(f"{case} ended with {code}: {said}")


def probes(output):
    return [path.read_text() for path in sorted(output.glob("probe-*.csv"))]


def differences(one, other, last=False):
    """Of the columns of two runs' rows, or of their last rows: the largest difference relative to the column's largest value, or
    of a force, to the largest along any axis. Infinite where the runs have not as many rows, or values at other places."""
    if len(one) != len(other):
        return {"increment": math.inf}
    columns = {name: [(row[i], so[i]) for row, so in zip(one[1:], other[1:])][-1 if last else 0:]
               for i, name in enumerate(other[0]) if name not in COUNTS}
    sizes = {name: max((abs(float(b)) for _, b in cells if b), default=0.0) for name, cells in columns.items()}
    found = {}
    for name, cells in columns.items():
        along = re.sub(r"_[xyz]_N$", "_._N$", name)
        size = max(size for other_name, size in sizes.items() if other_name == name or re.fullmatch(along, other_name))
        found[name] = max(math.inf if bool(a) != bool(b) else abs(float(a or 0) - float(b or 0)) / max(size, 1e-300) for a, b in cells)
    return found
