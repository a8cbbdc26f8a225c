"""Rows of the table in README.md."""
import re

COLUMNS = ["nodes", "Stokes solves", "core-s a solve", "steps of the front", "core-us a node and step", "bytes a node",
           "25 million nodes: core-h", "GiB"]
PAPER = {"nodes": 25e6, "steps": 1250}


def row(setting, rounds, *settings):
    return {"setting": setting, "case": "case.ini", "mesh": ["--rounds", str(rounds)],
            "set": ["time.step=1.6 ms", *settings]}


ROWS = [row("1 round, one solve", 1, "time.increments=100"), row("1 round, solved as the front asks", 1, "time.increments=100",
                                                                "flow.update=auto"),
        row("1 round, traced", 1, "time.increments=100", "front.transport=trace"),
        row("1 round, 8 elements about the front", 1, "time.increments=100", "front.narrow_band=8"),
        row("2 rounds, one solve", 2, "time.increments=20"),
        row("2 rounds, 8 elements about the front", 2, "time.increments=20", "front.narrow_band=8")]


def measure(run, row):
    last, components, ranks = run.summary["final"], run.summary["components"], run.summary["ranks"]
    log = (run.directory / "run.log").read_text()
    steps = sum(int(n) for n in re.findall(r"\| (\d+) substeps", log))
    solves = int(re.search(r"(\d+) flow solves", log).group(1))
    solve = components["flow"]["wall_s"]["max"] * ranks / solves
    step = components["front"]["wall_s"]["max"] * ranks / steps
    a_node = run.summary["peak_memory_bytes"] / last["nodes"]
    growth = PAPER["nodes"] / last["nodes"]
    hours = growth * (solve * solves * (1 if solves == 1 else PAPER["steps"] / steps) + PAPER["steps"] * step) / 3600
    return [f"{last['nodes']:.0f}", str(solves), f"{solve:.1f}", str(steps), f"{1e6 * step / last['nodes']:.2f}", f"{a_node:.0f}",
            f"{hours:.1f}", f"{a_node * PAPER['nodes'] / 2 ** 30:.0f}"]
