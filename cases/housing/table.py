"""Rows of the table in README.md."""
COLUMNS = ["filled", "gate pressure, MPa", "volume error"]
ROWS = [{"setting": level, "case": "case.ini", "set": [f"accuracy.level={level}"]} for level in ("draft", "standard")]


def measure(run, row):
    last = run.summary["final"]
    return [f"{last['fill_fraction']:.1%}", f"{last['pressure_gate_Pa'] / 1e6:.2f}", f"{last['volume_error']:+.1e}"]
