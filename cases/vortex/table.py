"""Rows and errors of the table in README.md."""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
import results  # noqa: E402

CLOSED_FORM = True  # the first column is an error against it
COLUMNS = ["misplaced area", "area change"]
ROWS = [{"setting": f"{moment}, 1/{n}", "case": "case.ini", "mesh": ["--across", str(n)], "set": [f"time.end={end}"], "end": end}
        for moment, end in (("half time, t = 4", 4.0), ("full reversal, t = 8", 8.0)) for n in (32, 64, 128)]

AREA = np.pi * 0.15 ** 2


def velocity(points, time):
    x, y = np.pi * points.T
    swirl = np.cos(np.pi * time / 8)
    return np.stack([-np.sin(x) ** 2 * np.sin(2 * y), np.sin(y) ** 2 * np.sin(2 * x)], axis=1) * swirl


def exact_level_set(points, time, steps=200):
    """The disc's distance at the place from which each point has come: traced back by Runge-Kutta 4."""
    dt, p = -time / steps, points.copy()
    for k in range(steps):
        t = time + k * dt
        a = velocity(p, t)
        b = velocity(p + dt / 2 * a, t + dt / 2)
        c = velocity(p + dt / 2 * b, t + dt / 2)
        d = velocity(p + dt * c, t + dt)
        p = p + dt / 6 * (a + 2 * b + 2 * c + d)
    return 0.15 - np.hypot(p[:, 0] - 0.5, p[:, 1] - 0.75)


def measure(run, row):
    """Misplaced: where the signs of the computed and of the exact label differ, sampled at 36 points of each triangle."""
    state = run.snapshot(-1)
    n = 8
    weights = np.array([[i + 1 / 3, j + 1 / 3, n - i - j - 2 / 3] for i in range(n) for j in range(n - i)]) / n
    points = np.einsum("sc,ecd->esd", weights, state.points[state.elements][:, :, :2])
    computed = np.einsum("sc,ec->es", weights, state.nodes["level_set"][state.elements])
    exact = exact_level_set(points.reshape(-1, 2), row["end"]).reshape(computed.shape)
    area = abs(state.volumes())
    misplaced = (area * ((computed > 0) != (exact > 0)).mean(axis=1)).sum()
    filled = (area * results.positive_share(state.nodes["level_set"][state.elements])).sum()
    return [f"{misplaced / AREA:.1%}", f"{filled / AREA - 1:+.2%}"]
