"""Rows of the table in README.md."""
PROGRAM = "forge"
COLUMNS = ["force on the upper tool, kN", "volume change", "penetration, µm", "least quality"]
ROWS = [{"setting": f"elements of {size} mm, stroke 4 mm", "case": "case.ini",
         "mesh": ["--size", str(size)], "set": ["time.stroke=4 mm"]} for size in (5, 4, 3)]


def measure(run, row):
    last = run.summary["final"]
    return [f"{abs(last['force_upper_z_N']) / 1e3:.2f}", f"{last['volume_change']:+.1e}",
            f"{last['max_penetration_m'] * 1e6:.2f}", f"{last['min_quality']:.2f}"]
