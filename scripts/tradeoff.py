"""What scripts/tradeoff turns, and how it measures what came out."""
import importlib.util
import pathlib
import re

import numpy as np

LEVELS = ["draft", "standard", "fine", "reference"]
# Mean element size of each level over that of the case's mesh: with steps and tolerances, so that none of them is wasted.
LEVEL_SIZES = {"draft": 1.6, "standard": 1.0, "fine": 0.63, "reference": 0.5}

# Section, key, and what is tried around the value in force: factors of a number, or other words.
NUMBERS = [("accuracy", "size_factor", (1.4, 0.7)), ("time", "step", (2, 0.5)), ("motion", "strain", (2, 0.5)), ("solver", "newton_tolerance", (10, 0.1)),
           ("solver", "linear_tolerance", (100, 10, 0.1)), ("penalty", "penalty", (0.1, 10)), ("front", "cfl", (2, 0.5)),
           ("front", "thickness", (2,)), ("flow", "update_distance", (4, 2, 0.5)), ("remesh", "size", (1.4, 0.7)),
           ("remesh", "nodes", (0.5, 2)), ("solver", "cutoff_strain_rate", (10, 0.1))]
WORDS = [("penalty", "augmented", ("yes", "no")), ("front", "mixture", ("fraction", "heaviside", "sharp", "harmonic")),
         ("front", "transport", ("crank-nicolson", "residual-free-bubbles", "trace")), ("flow", "update", ("auto", "once", "every 1")),
         ("remesh", "every", ("auto", "1", "5")), ("remesh", "anisotropic", ("yes", "no")), ("remesh", "active", ("yes", "no")),
         ("motion", "scheme", ("adams-bashforth-2", "runge-kutta-2", "euler")),
         ("solver", "linear_method", ("block-triangular", "gmres-ilu", "conjugate-residual"))]


def resolved(path):
    """{section: {key: value}} of a case.resolved.ini."""
    sections, current = {}, {}
    for line in pathlib.Path(path).read_text().splitlines():
        if heading := re.match(r"\s*\[([^\]]+)\]", line):
            current = sections.setdefault(heading[1], {})
        elif pair := re.match(r"\s*([A-Za-z_0-9]+)\s*=\s*(.*?)\s*(?:;.*)?$", line):
            current[pair[1]] = pair[2]
    return sections


def times(value, factor):
    """A number with its unit, multiplied; None where it is no number."""
    number = re.match(r"([-+0-9.eE]+)(.*)$", value)
    try:
        return f"{float(number[1]) * factor:.6g}{number[2]}"
    except (TypeError, ValueError):
        return None


NEEDS = {"front": "front", "flow": "front", "motion": "motion"}  # section: the component without which it is idle


def knobs(sections, components):
    """(name, setting) of every change of one knob that the scene has."""
    touches = any(name.startswith(("tool.", "contact.")) for name in sections)
    sections = {name: keys for name, keys in sections.items()
                if (name not in NEEDS or NEEDS[name] in components) and (name != "penalty" or touches)}
    changes = []
    for section, key, factors in NUMBERS:
        value = sections.get(section, {}).get(key)
        for factor in factors if value else ():
            if changed := times(value, factor):
                changes.append((f"{section}.{key}", f"{section}.{key}={changed}"))
    for section, key, words in WORDS:
        value = sections.get(section, {}).get(key)
        changes += [(f"{section}.{key}", f"{section}.{key}={word}") for word in words if value and word != value]
    for section, keys in sections.items():
        if "front" in components and section == "fluid." + sections.get("initial", {}).get("fluid", ""):
            if keys.get("law") != "void":
                changes.append((f"{section}.law", f"{section}.law=void"))
    return changes


def curves(run):
    """Main results over time: forces on tools and bodies, or pressures of gates."""
    history = run.history
    names = [name for name in history if re.match(r"force_.*_N$|pressure_.*_Pa$", name)]
    return history["time_s"], {name: history[name] for name in names}


class AgainstRun:
    """Root mean square distance of the main results' curves from those of a reference run, relative to their own."""
    basis = "the reference level"

    def __init__(self, run):
        self.time, self.known = curves(run)

    def __call__(self, run):
        time, found = curves(run)
        start, end = max(self.time[0], time[0]), min(self.time[-1], time[-1])
        grid = np.linspace(start, end, 400) if end > start else np.array([start])
        off, size = 0.0, 0.0
        for name, known in self.known.items():
            if name not in found:
                continue
            reference = np.interp(grid, self.time, known)
            off += np.nansum((np.interp(grid, time, found[name]) - reference) ** 2)
            size += np.nansum(reference ** 2)
        return float(np.sqrt(off / size)) if size > 0 else None


class AgainstFormula:
    """Relative error against the [reference] of the case: of the velocity, else of the first that it knows."""
    basis = "[reference]"

    def __call__(self, run):
        errors = run.summary["accuracy"].get("errors", {})
        names = ["velocity_l2_relative", "pressure_l2_relative", "level_set_l1_relative"]
        return next((errors[name] for name in names if errors.get(name) is not None), None)


class AgainstClosedForm:
    """The error that the case's table.py measures against a closed form."""
    basis = "the closed form of the case"

    def __init__(self, table, row):
        self.table, self.row = table, row

    def __call__(self, run):
        cell = str(self.table.measure(run, self.row)[0])
        number = re.match(r"([-+0-9.eE]+)\s*(%?)", cell)
        return abs(float(number[1])) * (0.01 if number[2] else 1) if number else None


def table_of(case):
    """table.py beside the case and its row for it, where it measures errors against a closed form."""
    path = case.parent / "table.py"
    if not path.exists():
        return None
    spec = importlib.util.spec_from_file_location("table", path)
    table = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(table)
    rows = [row for row in table.ROWS if row["case"] == case.name]
    return (table, rows[0]) if rows and getattr(table, "CLOSED_FORM", False) else None


def judge_of(case):
    """How errors are measured, where no reference run is needed."""
    if table := table_of(case):
        return AgainstClosedForm(*table)
    if re.search(r"^\s*\[reference\]", case.read_text(), re.MULTILINE):
        return AgainstFormula()
    return None


def pareto(points):
    """Those of (name, seconds, error) that no other one beats in both."""
    return [p for p in points if not any(q[1] <= p[1] and q[2] <= p[2] and q is not p for q in points)]


def sentence(knob, setting, seconds, error, standard):
    """What the change buys and what it costs."""
    value = setting.partition("=")[2]
    speed = standard[0] / seconds
    pace = f"{speed:.2g} times faster" if speed > 1.05 else f"{1 / speed:.2g} times slower" if speed < 0.95 else "as fast"
    if error is None or standard[1] is None:
        return f"{knob} = {value}: {pace}"
    if f"{error:.2g}" == f"{standard[1]:.2g}":
        return f"{knob} = {value}: {pace}, the same error"
    return f"{knob} = {value}: {pace}, error {100 * error:.2g} % instead of {100 * standard[1]:.2g} %"
