"""Rows and errors of the table in README.md."""
import numpy as np

CLOSED_FORM = True  # the first column is an error against it
COLUMNS = ["error of the pressure gradient"]
ROWS = [{"setting": f"steady, Newtonian, {n} elements across", "case": "steady.ini", "mesh": ["--across", str(n)]}
        for n in (2, 3, 4, 6, 8, 16)]
ROWS += [{"setting": f"steady, power law 0.3, {n} elements across", "case": "power-law.ini", "mesh": ["--across", str(n)]}
         for n in (4, 8, 16)]
ROWS += [{"setting": f"steady slab in 3D, {n} elements across", "case": "slab.ini",
          "mesh": ["--dimension", "3", "--across", str(n)]} for n in (4, 6)]
ROWS += [{"setting": f"filling, {n} elements across", "case": "case.ini", "mesh": ["--across", str(n)]} for n in (8, 16)]

HEIGHT, VELOCITY, CONSISTENCY = 4e-3, 20e-3, 1000.0


def pressure_gradient(exponent):
    """Pa/m, of a power-law fluid between plates; exponent 1 is Newtonian."""
    shear_rate = 2 * (2 * exponent + 1) / exponent * VELOCITY / HEIGHT
    return 2 * CONSISTENCY / HEIGHT * shear_rate ** exponent


def measure(run, row):
    if row["case"] == "case.ini":
        # The gate's pressure grows with the filled length: the slope, once the front has its shape.
        time, pressure = run.history["time_s"], run.history["pressure_gate_Pa"]
        settled = time > 0.5
        gradient, exact = np.polyfit(time[settled], pressure[settled], 1)[0] / VELOCITY, pressure_gradient(1)
    else:
        fall = run.probe("first")["pressure"][-1] - run.probe("second")["pressure"][-1]
        gradient, exact = fall / 20e-3, pressure_gradient(0.3 if row["case"] == "power-law.ini" else 1)
    return [f"{gradient / exact - 1:+.2%}"]
