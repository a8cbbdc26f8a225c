"""Rows of the table in README.md."""
PROGRAM = "forge"
COLUMNS = ["force on the upper die, kN", "volume change", "penetration, µm", "least quality"]
ROWS = [{"setting": f"billet {size} mm, dies {2 * size} mm, stroke 2 mm", "case": "case.ini",
         "mesh": ["--size", str(size), "--die-size", str(2 * size)], "set": ["time.stroke=2 mm"]} for size in (4, 3, 2)]


def measure(run, row):
    last = run.summary["final"]
    return [f"{abs(last['force_upper_z_N']) / 1e3:.2f}", f"{last['volume_change']:+.1e}",
            f"{last['max_penetration_m'] * 1e6:.2f}", f"{last['min_quality']:.2f}"]
