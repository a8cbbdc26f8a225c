"""Rows and errors of the table in README.md."""
CLOSED_FORM = True  # the first column is an error against it
COLUMNS = ["velocity L2", "velocity H1", "pressure L2"]
ROWS = [{"setting": f"{name}, {n} elements along an edge", "case": case, "mesh": ["--dimension", str(dim), "--across", str(n)]}
        for name, case, dim, across in (("square", "case.ini", 2, (8, 16, 32, 64)),
                                        ("square, variable viscosity", "variable.ini", 2, (8, 16, 32, 64)),
                                        ("cube", "cube.ini", 3, (8, 16, 24)),
                                        ("cube, variable viscosity", "cube-variable.ini", 3, (8, 16, 24))) for n in across]


def measure(run, row):
    errors = run.summary["accuracy"]["errors"]
    return [f"{errors[name + '_relative']:.2e}" for name in ("velocity_l2", "velocity_h1", "pressure_l2")]
