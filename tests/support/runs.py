"""Runs of the executables in tests."""
import csv
import json
import os
import pathlib
import subprocess

BIN = pathlib.Path(os.environ["MALLEUS_BIN"])
PATIENCE = float(os.environ.get("MALLEUS_PATIENCE", 1))  # times the seconds that a run may take: sanitizers need more
LAUNCH = ["mpirun", "--allow-run-as-root", "--oversubscribe", "--bind-to", "none", "-n"]


def run(program, case, output, *options, ranks=1, check=True):
    """The finished process; with `check`, a run that does not end with 0 is an error that shows what was said."""
    command = ([*LAUNCH, str(ranks)] if ranks > 1 else []) + [BIN / program, case, "-o", output, *options]
    result = subprocess.run(command, capture_output=True, text=True, timeout=280 * PATIENCE)
    if check and result.returncode != 0:
        raise AssertionError(f"{program} ended with {result.returncode}:\n{result.stdout[-3000:]}{result.stderr[-3000:]}")
    return result


def history(output):
    """Rows of history.csv: column -> number."""
    with open(pathlib.Path(output) / "history.csv") as file:
        return [{name: float(cell) if cell else None for name, cell in row.items()} for row in csv.DictReader(file)]


def summary(output):
    return json.loads((pathlib.Path(output) / "summary.json").read_text())
