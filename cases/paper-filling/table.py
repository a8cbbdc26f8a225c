"""Rows of the table in README.md."""
import re

COLUMNS = ["nodes", "Stokes solves", "core-s a solve", "steps of the front", "core-us a node and step", "bytes a node",
           "25 million nodes: core-h", "GiB"]
PAPER = {"nodes": 25e6, "steps": 1250}


def row(setting, mesh, *settings):
    return {"setting": setting, "case": "case.ini", "mesh": mesh, "set": settings}


SMALL = ["--size", "14", "--smallest", "5", "--rounds", "1"]
STEPS = ("time.step=20 ms", "time.increments=8")
ROWS = [row("--size 14 --smallest 5, 1 round, one solve", SMALL, *STEPS),
        row("the same, solved as the front asks", SMALL, *STEPS, "flow.update=auto"),
        row("the same, traced", SMALL, *STEPS, "front.transport=trace")]


def measure(run, row):
    last, components, ranks = run.summary["final"], run.summary["components"], run.summary["ranks"]
    log = (run.directory / "run.log").read_text()
    steps = sum(int(n) for n in re.findall(r"\| (\d+) substeps", log))
    solves = int(re.search(r"(\d+) flow solves", log).group(1))
    solve = components["flow"]["wall_s"]["max"] * ranks / solves
    step = components["front"]["wall_s"]["max"] * ranks / steps
    a_node = run.summary["peak_memory_bytes"] / last["nodes"]
    growth = PAPER["nodes"] / last["nodes"]
    wanted = steps if "front.transport=trace" in row["set"] else PAPER["steps"]  # a trace needs no steps
    hours = growth * (solve * solves * (1 if solves == 1 else wanted / steps) + wanted * step) / 3600
    return [f"{last['nodes']:.0f}", str(solves), f"{solve:.1f}", str(steps), f"{1e6 * step / last['nodes']:.2f}", f"{a_node:.0f}",
            f"{hours:.1f}", f"{a_node * PAPER['nodes'] / 2 ** 30:.0f}"]
