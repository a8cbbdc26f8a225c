"""Rows of the table in README.md."""
PROGRAM = "forge"
COLUMNS = ["nodes at the end", "Newton iterations an increment", "remeshing / solve", "output / whole", "core-ms a node and iteration",
           "force on the upper die, kN"]
ROWS = [{"setting": f"billet {size} mm, dies {2 * size} mm, {count} increments", "case": "case.ini",
         "mesh": ["--size", str(size), "--die-size", str(2 * size)], "set": [f"time.increments={count}"]}
        for size, count in ((4, 5), (3, 5))]


def measure(run, row):
    last, components = run.summary["final"], run.summary["components"]
    seconds = {name: times["wall_s"]["max"] for name, times in components.items()}
    iterations = run.summary["accuracy"]["newton_iterations"]
    solve = seconds["flow"]
    a_node = 1e3 * solve * run.summary["ranks"] / (last["nodes"] * iterations)
    output = sum(value for name, value in seconds.items() if "output" in name or "checkpoint" in name)
    return [str(int(last["nodes"])), f"{iterations / run.summary['increments']:.1f}", f"{seconds['remeshing'] / solve:.2f}",
            f"{output / run.summary['wall_s']:.3f}", f"{a_node:.3f}", f"{abs(last['force_upper_z_N']) / 1e3:.2f}"]
