"""Rows and errors of the table in README.md."""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
import results  # noqa: E402

COLUMNS = ["wide, mm", "narrow, mm", "ratio, error", "volume, error"]
ROWS = [{"setting": f"{n} elements across the narrow channel", "case": "case.ini", "mesh": ["--across", str(n)]}
        for n in (4, 8, 12)]
ROWS += [{"setting": f"flow solved {text}, 8 across", "case": "case.ini", "mesh": ["--across", "8"], "set": settings}
         for text, settings in (("once", ["flow.update=once"]), ("when the front moved 2 h", ["flow.update_distance=2"]),
                                ("when the front moved 4 h", ["flow.update_distance=4"]))]


def filled_lengths(run):
    """How far the polymer has come in the wide and in the narrow channel, m."""
    state = run.snapshot(-1)
    middle = state.points[state.elements].mean(axis=1)
    filled = abs(state.volumes()) * results.positive_share(state.nodes["level_set"][state.elements])
    in_channel = middle[:, 0] > 0
    return filled[in_channel & (middle[:, 1] < 0)].sum() / 4e-3, filled[in_channel & (middle[:, 1] > 0)].sum() / 2e-3


def measure(run, row):
    wide, narrow = filled_lengths(run)
    return [f"{wide * 1e3:.2f}", f"{narrow * 1e3:.2f}", f"{wide / narrow / 2 - 1:+.2%}",
            f"{run.summary['accuracy']['volume_error']:+.1e}"]
