"""Rows of scripts/extremes: soft pockets, flattened and graded elements, slivers of a CAD part, ends of fillings, ranks without elements."""
import numpy as np
from box_msh import BoxMesh, evenly
from extreme_scenes import WRONG, ended_well, failure, row, verdict

CHANNEL = ("[mesh]\nfile = channel.msh\n[time]\nincrements = 0\n[fluid.melt]\nlaw = newtonian\nviscosity = 1000\n[initial]\nfluid = melt\n"
           "[inlet.gate]\ngroup = cavity_x_low\nfluid = melt\nflow_rate = 1\n[vent.out]\ngroup = cavity_x_high\n"
           "[wall.low]\ngroup = cavity_y_low\n[wall.high]\ngroup = cavity_y_high\n")


@row("30 soft pockets in a fluid, 1e4 and 1e8 times as soft", "converges to the true residual, none of the fallbacks")
def pockets(bench):
    mesh, counts = bench.mesh("manufactured", "--dimension", "2", "--across", "40"), []
    for ratio in (1, 1e4, 1e8):
        finished, run = bench.run("manufactured/case.ini", mesh, f'fluid.test.viscosity="abs(sin(5*pi*x)*sin(6*pi*y)) > 0.6 ? {1 / ratio:g} : 1"',
                                  "accuracy.two_meshes=no")
        if not ended_well(finished):
            return failure(finished)
        linear = run.summary["linear"]
        if linear["failures"]:
            return f"ratio {ratio:g}: {linear['failures']} solves failed", WRONG
        counts.append(linear["iterations"])
    return f"{', '.join(map(str, counts))} iterations at 1, 1e4, 1e8", verdict(counts[-1] < 300)


def channel_pressure(bench, xs, ys):
    boxes = BoxMesh(2)
    boxes.add_lines("cavity", [xs, ys])
    finished, run = bench.run_text(CHANNEL, boxes.write(bench.folder / "channel.msh"), "accuracy.two_meshes=no")
    if not ended_well(finished):
        return finished, None, 0
    known = 12 * 1000 * xs[-1]
    return finished, run.summary["final"]["pressure_gate_Pa"] / known - 1, run.summary["linear"]["iterations"]


@row("elements flattened to 1/10, 1/30, 1/100 of their length, channel 12 across", "pressure drop within 3 % of the closed form")
def flattened(bench):
    seen, worst = [], 0
    for aspect in (10, 30, 100):
        finished, error, iterations = channel_pressure(bench, evenly(0, aspect, 12), evenly(0, 1, 12))
        if error is None:
            return failure(finished)
        worst = max(worst, abs(error))
        seen.append(f"{error:+.1%} in {iterations} iterations")
    return ", ".join(seen), verdict(worst < 0.03)


@row("sizes graded by 100 across a channel", "pressure drop within 3 % of the closed form")
def graded(bench):
    half = np.cumsum(np.geomspace(1, 100, 12))
    half = half / half[-1] / 2
    ys = [0.0, *half, *(1 - half[-2::-1]), 1.0]
    finished, error, iterations = channel_pressure(bench, evenly(0, 2, 20), ys)
    if error is None:
        return failure(finished)
    return f"{error:+.1%} in {iterations} iterations", verdict(abs(error) < 0.03)


@row("slivers and thin walls of a CAD part's mesh (housing), one fluid", "converges to the true residual, without fallbacks")
def slivers(bench):
    mesh = bench.mesh("housing", "--size", "8", "--smallest", "2.4")
    finished, run = bench.run("housing/case.ini", mesh, "time.increments=0", "initial.fluid=polymer", "accuracy.two_meshes=no")
    if not ended_well(finished):
        return failure(finished)
    linear = run.summary["linear"]
    return f"{linear['iterations']} iterations in {linear['solves']} solves", verdict(linear["failures"] == 0 and linear["iterations"] < 150)


@row("a front that reaches the vent, and [time] end long after", "ends full, volume exact, no endless steps")
def full_cavity(bench):
    finished, run = bench.run("channel/case.ini", bench.mesh("channel", "--across", "4"), "time.end=10 s", "accuracy.level=draft",
                              "accuracy.two_meshes=no", "output.every=1000")
    if not ended_well(finished):
        return failure(finished)
    last, count = run.summary["final"], run.summary["increments"]
    return f"{last['fill_fraction']:.2%} full after {count} increments, volume {abs(last['volume_error']):.0e}", \
        verdict(last["fill_fraction"] > 0.995 and abs(last["volume_error"]) < 1e-9 and count < 200)


@row("meshtool refine and partition on 16 ranks of 23 elements", "sound meshes, every part named")
def meshtool_ranks(bench):
    mesh, refined, parts = bench.mesh("upsetting", "--dimension", "2", "--size", "7"), bench.folder / "refined.msh", bench.folder / "parts.txt"
    made = [bench.call(bench.binaries / "meshtool", "refine", mesh, refined, "--size", "3", ranks=16),
            bench.call(bench.binaries / "meshtool", "check", refined),
            bench.call(bench.binaries / "meshtool", "partition", mesh, bench.folder / "cut.h5", "--parts", "16", "--parts-file", parts, ranks=16)]
    for finished in made:
        if not ended_well(finished):
            return failure(finished)
    numbers = [int(line) for line in parts.read_text().split()]
    return f"sound; {len(set(numbers))} parts of {len(numbers)} elements", verdict(0 <= min(numbers) and max(numbers) < 16 and len(set(numbers)) > 8)
