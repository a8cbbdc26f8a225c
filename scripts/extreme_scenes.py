"""Scenes at their extremes: rows of the table that scripts/extremes prints.

A row is a function of a Bench; it returns (seen, verdict): what came out in words, and one of RIGHT, REFUSED or WRONG.
"""
import importlib.util
import math
import pathlib
import random
import re
import subprocess
import tempfile

import numpy as np
import results
import trials

RIGHT, REFUSED, WRONG = "right", "refused with a message", "WRONG"
CASES = trials.ROOT / "cases"
ROWS = []


def row(what, expected):
    """Registers a function as a row of the table."""
    def register(function):
        ROWS.append((what, expected, function))
        return function
    return register


def verdict(is_right):
    return RIGHT if is_right else WRONG


class Bench:
    """Makes meshes and runs the programs in a scratch folder."""

    def __init__(self, binaries, ranks):
        self.binaries, self.ranks = pathlib.Path(binaries), ranks
        self._folder = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self._folder.name)
        self.environment = trials.environment()
        self.number = 0

    def call(self, *words, ranks=1):
        start = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        try:
            return subprocess.run([*start, *map(str, words)], capture_output=True, text=True, env=self.environment, timeout=300)
        except subprocess.TimeoutExpired as late:
            return subprocess.CompletedProcess(late.cmd, -1, "", "no end within 300 s")

    def mesh(self, case, *options):
        path = self.folder / f"{case}-{'-'.join(options).replace('-', '')}.msh"
        if not path.exists():
            subprocess.run([CASES / case / "mesh", *options, "-o", path], check=True, capture_output=True)
        return path

    def run(self, case, mesh, *settings, ranks=None):
        """(finished process, Run) of a shipped case on a mesh."""
        return self.run_case(CASES / case, mesh, *settings, ranks=ranks)

    def run_text(self, text, mesh, *settings, ranks=None):
        """The same of a case of which this is the text."""
        path = self.folder / f"case-{self.number}.ini"
        path.write_text(text)
        return self.run_case(path, mesh, *settings, ranks=ranks)

    def run_case(self, path, mesh, *settings, ranks=None):
        program = self.binaries / trials.program_of(path.read_text())
        self.number += 1
        output = self.folder / f"out-{self.number}"
        changes = [word for setting in (f"mesh.file={mesh}", *settings) for word in ("-D", setting)]
        finished = self.call(program, path, "-o", output, *changes, ranks=ranks or self.ranks)
        return finished, results.Run(output)

    def text_mesh(self, mesh, name):
        """The mesh as lines of MSH 2.2, and where its nodes and elements stand: (lines, first node, nodes, first element, elements)."""
        path = self.folder / name
        done = self.call(self.binaries / "meshtool", "convert", mesh, path, "--ascii", "--msh-version", "2.2")
        if done.returncode != 0:
            raise RuntimeError(done.stderr)
        return path, path.read_text().splitlines()


def ended_well(finished):
    return finished.returncode == 0


def refused(finished):
    """Whether it ended with a message and a code of the contract, not by a signal or a hang."""
    return finished.returncode in (2, 3) and "error" in finished.stderr


def first_error(finished):
    line = next((line for line in finished.stderr.splitlines() if "error" in line), f"exit {finished.returncode}")
    return re.sub(r"/\S*/", "", line).removeprefix("error: ")[:140]


def failure(finished):
    """(seen, verdict) of a run that did not end well."""
    return first_error(finished), REFUSED if refused(finished) else WRONG


def closed_form():
    spec = importlib.util.spec_from_file_location("upsetting", CASES / "upsetting" / "table.py")
    table = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(table)
    return table


def upsetting(bench, *settings, m=0.3, ranks=None, mesh=None):
    """Frictionless upsetting of a revolved cylinder: (finished, history, relative error of the first force)."""
    finished, run = bench.run("upsetting/axisymmetric.ini", mesh or bench.mesh("upsetting", "--dimension", "2", "--size", "2"),
                              f"body.billet.rate_sensitivity={m}", "accuracy.two_meshes=no", *settings, ranks=ranks)
    if not ended_well(finished):
        return finished, None, math.inf
    table, history = closed_form(), run.history
    known = table.force({"case": "axisymmetric.ini", "m": m}, history["volume_m3"][0], table.HEIGHT)
    return finished, history, abs(history["force_upper_y_N"][0]) / known - 1


STICKING = ("tool.upper.friction_law=norton", "tool.upper.friction=1e4", "tool.lower.friction=1e4", "time.increments=2")


@row("m = 1, 0.5, 0.3, 0.1, 0.05, 0.02, upsetting between rough planes, cold start", "at most 20 Newton iterations, one at m = 1 apart from "
     "those that find the contact; never an unconverged step")
def rate_sensitivities(bench):
    counts = []
    for m in (1, 0.5, 0.3, 0.1, 0.05, 0.02):
        exponent = [f"tool.{name}.friction_exponent={m}" for name in ("upper", "lower")]
        finished, history, _ = upsetting(bench, *STICKING, *exponent, m=m)
        if not ended_well(finished):
            return f"m = {m}: {first_error(finished)}", REFUSED if refused(finished) else WRONG
        counts.append(int(history["newton_iterations"][0]))
    return f"{', '.join(map(str, counts))} iterations", verdict(max(counts) <= 20)


@row("m = 0.01", "converges, or stops and says so")
def lowest_rate_sensitivity(bench):
    finished, history, error = upsetting(bench, "time.increments=2", m=0.01)
    if not ended_well(finished):
        return failure(finished)
    return f"{int(history['newton_iterations'][0])} iterations, force {error:+.1e}", verdict(abs(error) < 1e-2)


@row("a tool that does not touch yet (gap of 1 mm)", "no singular solve: the gap closes, then the force is that of the closed form")
def gap(bench):
    finished, history, _ = upsetting(bench, "tool.upper.point=0 21 mm", "time.stroke=3 mm")
    if not ended_well(finished):
        return failure(finished)
    table, force = closed_form(), np.abs(history["force_upper_y_N"])
    height = table.HEIGHT - np.maximum(history["stroke_upper_m"] - table.SPEED * history["dt_s"] - 1e-3, 0)
    pressed = np.nonzero(force > 0)[0]
    known = [table.force({"case": "axisymmetric.ini"}, history["volume_m3"][0], height[k]) for k in pressed]
    error = np.max(np.abs(force[pressed][1:] / known[1:] - 1))
    return f"free at first, then within {error:.1e}", verdict(force[0] == 0 and error < 5e-3)


@row("friction 0 to 1e6 (q = m)", "the force grows with it and stays below that of sticking tools")
def friction(bench):
    forces = []
    for f in (0, 1e-3, 1e-1, 1, 1e2, 1e4, 1e6):
        finished, history, _ = upsetting(bench, *[f"tool.{t}.friction{k}" for t in ("upper", "lower") for k in (f"={f}", "_exponent=0.3")],
                                         "time.increments=2")
        if not ended_well(finished):
            return f"friction {f}: {first_error(finished)}", REFUSED if refused(finished) else WRONG
        forces.append(abs(history["force_upper_y_N"][0]))
    rises = all(b >= a * (1 - 1e-4) for a, b in zip(forces, forces[1:]))
    return f"force times 1 to {forces[-1] / forces[0]:.3f}, last step {forces[-1] / forces[-2] - 1:+.1e}", \
        verdict(rises and abs(forces[-1] / forces[-2] - 1) < 1e-2)


@row("penalty 10 to 1e9", "the error falls as 1/c to a plateau; an error, not garbage, beyond")
def penalty(bench):
    errors = []
    for c in (1e1, 1e3, 1e5, 1e7, 1e9):
        finished, _, error = upsetting(bench, f"penalty.penalty={c:g}", "time.increments=2", m=1)
        if not ended_well(finished) and not refused(finished):
            return f"c = {c:g}: {first_error(finished)}", WRONG
        errors.append(error if ended_well(finished) else None)
    known = [abs(e) for e in errors if e is not None]
    return ", ".join("refused" if e is None else f"{e:+.1e}" for e in errors), verdict(known[1] < known[0] and max(known[1:]) < 5e-3)


@row("steps ten times as long", "volume kept, no element turned over, force at the end within 1 %")
def long_steps(bench):
    finished, history, _ = upsetting(bench, "time.step=100 ms")
    if not ended_well(finished):
        return failure(finished)
    table = closed_form()
    height = table.HEIGHT - table.SPEED * (history["time_s"][-1] - history["dt_s"][-1])
    error = abs(history["force_upper_y_N"][-1]) / table.force({"case": "axisymmetric.ini"}, history["volume_m3"][0], height) - 1
    change = history["volume_change"][-1]
    return f"force {error:+.1e}, volume {change:+.1e} in {len(history['time_s'])} steps", verdict(abs(error) < 1e-2 and abs(change) < 1e-3)


@row("units: the same case in mm, MPa and in m, Pa", "the same digits")
def units(bench):
    forces = []
    for settings in ((), ("tool.upper.velocity=0 -0.02 m/s", "tool.upper.point=0 0.02 m", "body.billet.consistency=1.792e8 Pa.s^m",
                          "time.stroke=0.006 m", "time.step=0.01 s")):
        finished, history, _ = upsetting(bench, "time.increments=3", *settings)
        if not ended_well(finished):
            return first_error(finished), WRONG
        forces.append(abs(history["force_upper_y_N"][-1]))
    return f"forces differ by {abs(forces[1] / forces[0] - 1):.1e}", verdict(abs(forces[1] / forces[0] - 1) < 1e-8)


@row("16 ranks on 23 elements", "the force of one rank")
def many_ranks(bench):
    mesh = bench.mesh("upsetting", "--dimension", "2", "--size", "7")
    forces = []
    for ranks in (1, 16):
        finished, history, _ = upsetting(bench, "time.increments=2", "solver.newton_tolerance=1e-8", "solver.linear_tolerance=1e-10", mesh=mesh,
                                         ranks=ranks)
        if not ended_well(finished):
            return first_error(finished), WRONG
        forces.append(abs(history["force_upper_y_N"][-1]))
    return f"forces differ by {abs(forces[1] / forces[0] - 1):.1e}", verdict(abs(forces[1] / forces[0] - 1) < 1e-7)


def flattened(lines, dim, quality):
    """One node inside the mesh moved to the opposite facet of one of its elements, but for a share of its distance."""
    nodes, elements = lines.index("$Nodes"), lines.index("$Elements")
    points = {words[0]: np.array(words[1:4], float) for words in (line.split() for line in lines[nodes + 2:nodes + 2 + int(lines[nodes + 1])])}
    cells, surface = [], set()
    for words in (line.split() for line in lines[elements + 2:elements + 2 + int(lines[elements + 1])]):
        corners = words[3 + int(words[2]):]
        if len(corners) == dim + 1:
            cells.append(corners)
        else:
            surface.update(corners)
    cell = next(c for c in cells if sum(n not in surface for n in c) >= 1)
    node = next(n for n in cell if n not in surface)
    others = [points[n] for n in cell if n != node]
    foot = sum(others) / len(others)
    moved = foot + quality * (points[node] - foot)
    line = next(k for k in range(nodes + 2, elements) if lines[k].split()[0] == node)
    lines[line] = f"{node} {moved[0]:.12g} {moved[1]:.12g} {moved[2]:.12g}"
    return lines


@row("a sliver of height 1e-4 in the mesh", "forces within 1 % of those of the mesh without it")
def sliver(bench):
    path, lines = bench.text_mesh(bench.mesh("upsetting", "--size", "4"), "sliver.msh")
    path.write_text("\n".join(flattened(lines, 3, 1e-4)) + "\n")
    finished, run = bench.run("upsetting/case.ini", path, "time.increments=3", "accuracy.two_meshes=no")
    if not ended_well(finished):
        return failure(finished)
    table, history = closed_form(), run.history
    error = abs(history["force_upper_z_N"][0]) / table.force({"case": "case.ini"}, history["volume_m3"][0], table.HEIGHT) - 1
    return f"force {error:+.1e}, {int(history['newton_iterations'][0])} Newton iterations", verdict(abs(error) < 0.01)


@row("a mesh of which half of the inner nodes were thrown about by 4 mm (elements turned over)", "refused by the simulators, repaired by meshtool refine")
def tangled(bench):
    path, lines = bench.text_mesh(bench.mesh("upsetting", "--size", "4"), "tangled.msh")
    chance, nodes, elements = random.Random(1), lines.index("$Nodes"), lines.index("$Elements")
    corners = [line.split() for line in lines[elements + 2:elements + 2 + int(lines[elements + 1])]]
    surface = {n for words in corners for n in words[3 + int(words[2]):] if words[1] == "2"}
    for k in range(nodes + 2, nodes + 2 + int(lines[nodes + 1])):
        words = lines[k].split()
        if words[0] not in surface and chance.random() < 0.5:
            lines[k] = " ".join([words[0], *(f"{float(w) + chance.uniform(-4, 4):.9g}" for w in words[1:])])
    path.write_text("\n".join(lines) + "\n")
    finished, _ = bench.run("upsetting/case.ini", path, "time.increments=1")
    repaired = bench.call(bench.binaries / "meshtool", "refine", path, bench.folder / "repaired.msh", "--size", "4")
    checked = bench.call(bench.binaries / "meshtool", "check", bench.folder / "repaired.msh")
    is_right = refused(finished) and ended_well(repaired) and ended_well(checked)
    return f"simulator: {first_error(finished)}; after refine: {'sound' if ended_well(checked) else 'not sound'}", verdict(is_right)


def filling(bench, *settings, across=6, ranks=None, end="time.end=0.8 s"):
    """(finished, run, slope of the gate's pressure over its closed form - 1)"""
    finished, run = bench.run("channel/case.ini", bench.mesh("channel", "--across", str(across)), "accuracy.two_meshes=no", end, *settings,
                              ranks=ranks)
    if not ended_well(finished):
        return finished, run, math.inf
    time, pressure = run.history["time_s"], run.history["pressure_gate_Pa"]
    settled = time > 0.3
    slope = np.polyfit(time[settled], pressure[settled], 1)[0]
    return finished, run, slope / (12 * 1000 * 0.02 / 0.004 ** 2 * 0.02) - 1


@row("viscosity ratio 1e1 to 1e8 of polymer and air", "the same gate pressure from 1e2 on, within 5 %")
def viscosity_ratios(bench):
    slopes = []
    for ratio in (1e1, 1e2, 1e4, 1e6, 1e8):
        finished, _, error = filling(bench, f"fluid.air.viscosity={1000 / ratio:g} Pa.s", "front.contrast=1e8")
        if not ended_well(finished):
            return f"1e{math.log10(ratio):g}: {first_error(finished)}", REFUSED if refused(finished) else WRONG
        slopes.append(error)
    return ", ".join(f"{s:+.1%}" for s in slopes), verdict(max(abs(s) for s in slopes[1:]) < 0.05)


@row("front CFL 0.05 to 2", "volume to 1e-10, gate pressure within 10 %")
def front_steps(bench):
    seen = []
    for cfl in (0.05, 0.5, 2):
        finished, run, error = filling(bench, f"front.cfl={cfl}")
        if not ended_well(finished):
            return f"{cfl}: {first_error(finished)}", REFUSED if refused(finished) else WRONG
        seen.append((error, abs(run.summary["accuracy"]["volume_error"])))
    return ", ".join(f"{e:+.1%}" for e, _ in seen) + f"; volume {max(v for _, v in seen):.0e}", \
        verdict(all(abs(e) < 0.1 and v < 1e-10 for e, v in seen))


@row("front CFL 50", "refused, or sub-cycled")
def impossible_step(bench):
    finished, _, _ = filling(bench, "front.cfl=50")
    return failure(finished)


@row("steps of 50 elements asked for (flow kept for 50 elements)", "the front goes in sub-steps: volume exact, pressure bounded")
def long_flow(bench):
    finished, run, _ = filling(bench, "flow.update_distance=50")
    if not ended_well(finished):
        return failure(finished)
    volume = abs(run.summary["accuracy"]["volume_error"])
    pressure = np.max(np.abs(run.history["pressure_gate_Pa"]))
    return f"volume {volume:.0e}, freezing error {run.summary['accuracy']['flow_freezing_error_elements']:.2g} elements told", \
        verdict(volume < 1e-10 and np.isfinite(pressure) and pressure < 2e6)


@row("a flow rate that jumps by 100 in the middle of the filling", "as much came in as was asked for; pressure over flow rate goes on as before within 10 %")
def flow_jump(bench):
    finished, run, _ = filling(bench, "inlet.gate.flow_rate=t < 0.4 ? 8e-5 : 8e-3", end="time.end=0.404 s")
    if not ended_well(finished):
        return failure(finished)
    history, volume = run.history, abs(run.summary["accuracy"]["volume_error"])
    time, is_slow = history["time_s"], history["time_s"] <= 0.4
    resistance = history["pressure_gate_Pa"] / np.where(is_slow, 8e-5, 8e-3)
    settled = is_slow & (time > 0.2)
    way = 8e-5 * np.minimum(time, 0.4) + 8e-3 * np.maximum(time - 0.4, 0)
    line = np.polyfit(way[settled], resistance[settled], 1)
    off = resistance[~is_slow][1:] / np.polyval(line, way[~is_slow][1:]) - 1
    return f"volume {volume:.0e}, pressure over flow rate within {abs(off).max():.1%}, {np.count_nonzero(~is_slow)} increments after the jump", \
        verdict(volume < 1e-10 and abs(off).max() < 0.1)


@row("power law n = 0.1, 8 elements across", "pressure gradient within 5 % of the closed form")
def shear_thinning(bench):
    finished, run = bench.run("channel/power-law.ini", bench.mesh("channel", "--across", "8"), "fluid.polymer.exponent=0.1",
                              "accuracy.two_meshes=no")
    if not ended_well(finished):
        return failure(finished)
    fall = run.probe("first")["pressure"][-1] - run.probe("second")["pressure"][-1]
    error = fall / 0.02 / (2 * 1000 / 0.004 * (2 * 1.2 / 0.1 * 0.02 / 0.004) ** 0.1) - 1
    return f"pressure gradient {error:+.1%}", verdict(abs(error) < 0.05)


@row("density ratio 1e3 without gravity", "the same digits as without densities")
def densities(bench):
    rows = [filling(bench, *settings, end="time.end=0.6 s") for settings in ((), ("fluid.polymer.density=1000 kg/m^3", "fluid.air.density=1 kg/m^3"))]
    if not all(ended_well(finished) for finished, _, _ in rows):
        return failure(rows[1][0])
    same = all(np.array_equal(rows[0][1].history[name], rows[1][1].history[name]) for name in ("pressure_gate_Pa", "fill_fraction"))
    return "equal to the last digit" if same else "different", verdict(same)


@row("sections 1, 2 and 3 elements across", "a warning, and no claim below 2")
def thin_sections(bench):
    seen = []
    for across in (1, 2, 3):
        finished, run = bench.run("channel/steady.ini", bench.mesh("channel", "--across", str(across)), "accuracy.two_meshes=no")
        if refused(finished):
            seen.append("refused")
            continue
        if not ended_well(finished):
            return first_error(finished), WRONG
        seen.append("warned" if any(re.search("across|thin", text) for text in run.summary["warnings"]) else "silent")
    return ", ".join(seen), verdict("silent" not in seen)


@row("16 ranks on a channel of 2 elements across", "the pressures of one rank")
def more_ranks_than_sense(bench):
    values = []
    for ranks in (1, 16):
        finished, run = bench.run("channel/steady.ini", bench.mesh("channel", "--across", "2"), "accuracy.two_meshes=no", ranks=ranks)
        if not ended_well(finished):
            return failure(finished)
        values.append(run.summary["final"]["pressure_gate_Pa"])
    return f"differ by {abs(values[1] / values[0] - 1):.1e}", verdict(abs(values[1] / values[0] - 1) < 1e-5)


@row("viscosity that varies by 1e8 within the domain", "converges to the true residual")
def contrast(bench):
    finished, run = bench.run("manufactured/variable.ini", bench.mesh("manufactured", "--dimension", "2", "--across", "16"),
                              "fluid.test.viscosity=\"exp(18.42*x)\"", "accuracy.two_meshes=no")
    if not ended_well(finished):
        return failure(finished)
    linear = run.summary["linear"]
    return f"{linear['iterations']} iterations in {linear['solves']} solves", verdict(linear["failures"] == 0 and linear["iterations"] < 200)
