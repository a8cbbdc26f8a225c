"""Rows and errors of the table in README.md."""
CLOSED_FORM = True  # the first column is an error against it
COLUMNS = ["error of the pressure gradient"]
ROWS = [{"setting": f"{law}, {n} elements across the radius", "case": case, "mesh": ["--across", str(n)]}
        for law, case in (("Newtonian", "case.ini"), ("power law 0.3", "power-law.ini")) for n in (2, 3, 4, 6, 8)]

RADIUS, VELOCITY, CONSISTENCY = 2e-3, 20e-3, 1000.0


def pressure_gradient(exponent):
    """Pa/m, of a power-law fluid in a round tube; exponent 1 is Newtonian."""
    shear_rate = (3 * exponent + 1) / exponent * VELOCITY / RADIUS
    return 2 * CONSISTENCY / RADIUS * shear_rate ** exponent


def measure(run, row):
    fall = run.probe("first")["pressure"][-1] - run.probe("second")["pressure"][-1]
    return [f"{fall / 8e-3 / pressure_gradient(0.3 if row['case'] == 'power-law.ini' else 1) - 1:+.2%}"]
