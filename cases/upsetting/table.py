"""Rows and errors of the table in README.md."""
import math

PROGRAM = "forge"
CLOSED_FORM = True  # the first column is an error against it
COLUMNS = ["error of the force at first", "at the end", "volume change"]
ROWS = [{"setting": "cylinder, rate sensitivity 0.3", "case": "case.ini", "mesh": []}]
ROWS += [{"setting": f"cylinder, rate sensitivity {m}", "case": "case.ini", "mesh": [],
          "set": [f"body.billet.rate_sensitivity={m}"], "m": m} for m in (1.0, 0.5, 0.1)]
ROWS += [{"setting": f"cylinder, step {ms} ms", "case": "case.ini", "mesh": [], "set": [f"time.step={ms} ms"]} for ms in (5, 20, 40)]
ROWS += [{"setting": "plane strain", "case": "plane-strain.ini", "mesh": ["--dimension", "2", "--size", "1"]},
         {"setting": "axisymmetric", "case": "axisymmetric.ini", "mesh": ["--dimension", "2", "--size", "1"]}]

CONSISTENCY, HEIGHT, SPEED = 179.2e6, 20e-3, 20e-3


def force(row, volume, height):
    """N, of a frictionless press on a body of that volume and height (README.md)."""
    m, rate, area = row.get("m", 0.3), SPEED / height, volume / height
    if row["case"] == "plane-strain.ini":
        return area * 2 * CONSISTENCY * (2 * rate) ** m
    return area * math.sqrt(3) * CONSISTENCY * (math.sqrt(3) * rate) ** m


def measure(run, row):
    history, axis = run.history, "z" if row["case"] == "case.ini" else "y"
    pressed = abs(history[f"force_upper_{axis}_N"])
    # The force of a row belongs to the height at the start of its increment.
    heights = HEIGHT - SPEED * (history["time_s"] - history["dt_s"])
    volume = history["volume_m3"][0]
    errors = [pressed[k] / force(row, volume, heights[k]) - 1 for k in (0, -1)]
    return [f"{error:+.1e}" for error in errors] + [f"{history['volume_change'][-1]:+.1e}"]
