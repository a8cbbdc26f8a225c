"""Rows of scripts/extremes: bodies far stiffer than others, next to each other; viscosities that are cut off."""
import re

import numpy as np
from box_msh import BoxMesh
from extreme_scenes import CASES, ended_well, failure, first_error, row, upsetting, verdict

CONSISTENCY = 1e6


def body(name, m=0.3):
    return f"[body.{name}]\ngroup = {name}\nlaw = norton-hoff\nconsistency = {CONSISTENCY}\nrate_sensitivity = {m}\n"


@row("dies 1e4 times as stiff as the billet (m = 0.3: at one stress rates apart by 1e13), press", "the force of rigid dies within 1e-3")
def stiff_dies(bench):
    text, mesh, forces = (CASES / "press" / "case.ini").read_text(), bench.mesh("press", "--size", "5", "--die-size", "10"), []
    rigid = re.sub(r"(\[body\.(?:upper|lower)\]\ngroup = \w+\n)law = .*\nconsistency = .*\nrate_sensitivity = .*\n", r"\1law = rigid\n", text)
    for case in (text.replace("consistency = 17920 MPa", "consistency = 1792000 MPa"), rigid):
        finished, run = bench.run_text(case, mesh, "time.increments=2", "accuracy.two_meshes=no")
        if not ended_well(finished):
            return failure(finished)
        forces.append(abs(run.history["force_lower_z_N"][-1]))
    return f"force {forces[0] / forces[1] - 1:+.1e}", verdict(abs(forces[0] / forces[1] - 1) < 1e-3)


@row("two blocks 1e-6 of their height apart, touching, overlapping by as much", "the force of the closed form within 0.5 %")
def near_bodies(bench):
    errors = []
    for distance in (1e-6, 0.0, -1e-6):
        boxes = BoxMesh(2)
        boxes.add("lower", [0, 0], [1, 1], (4, 4))
        boxes.add("upper", [0, 1 + distance], [1, 2 + distance], (6, 6))
        text = "[mesh]\nfile = near.msh\n[time]\nincrements = 2\nstep = 0.01\n" + body("lower") + body("upper")
        text += "".join(f"[boundary.{name}_x]\ngroup = {name}_x_low\ntype = symmetry\n" for name in ("lower", "upper"))
        text += ("[boundary.top]\ngroup = upper_y_high\nvelocity = free -2\n[boundary.bottom]\ngroup = lower_y_low\nvelocity = free 0\n"
                 "[contact.middle]\nslave = upper\nmaster = lower\n")
        finished, run = bench.run_text(text, boxes.write(bench.folder / "near.msh"), "accuracy.two_meshes=no")
        if not ended_well(finished):
            return failure(finished)
        height = 2 - 2 * 0.01
        known = 2 * CONSISTENCY * (2 * 2 / height) ** 0.3 * 2 / height
        errors.append(abs(run.history["force_top_y_N"][-1]) / known - 1)
    return "force " + ", ".join(f"{e:+.1e}" for e in errors), verdict(max(map(abs, errors)) < 5e-3)


@row("cut-off of the strain rate 1e-3 to 1e-1 of the mean rate", "the force changes as its square, by 0.4 % at 1e-1")
def cut_offs(bench):
    forces = []
    for cut_off in (1e-4, 1e-3, 1e-2, 1e-1):
        finished, history, _ = upsetting(bench, f"solver.cutoff_strain_rate={cut_off}", "time.increments=1", "solver.newton_tolerance=1e-8",
                                         "solver.linear_tolerance=1e-10", "penalty.penalty=1e6")
        if not ended_well(finished):
            return failure(finished)
        forces.append(abs(history["force_upper_y_N"][0]))
    changes = np.array(forces[1:]) / forces[0] - 1
    return ", ".join(f"{c:+.1e}" for c in changes), verdict(abs(changes[0]) < 2e-6 and abs(changes[1]) < 6e-5 and abs(changes[2]) < 4e-3)


def closed_die(press):
    """A block with walls 2 % away on one side, in a die that is full after a stroke of 2 %."""
    text = "[mesh]\nfile = die.msh\n[time]\nend = 0.05\nstep = 0.005\n" + body("billet")
    text += f"[tool.upper]\nshape = plane\npoint = 0 1\nnormal = 0 -1\nvelocity = 0 -1\n{press}"
    for name, point, normal in (("lower", "0 0", "0 1"), ("wall", "1.02 0", "-1 0")):
        text += f"[tool.{name}]\nshape = plane\npoint = {point}\nnormal = {normal}\n"
    return text + "[boundary.middle]\ngroup = billet_x_low\ntype = symmetry\n"


@row("a die full to its corners, under a hydraulic press and under a tool of given speed",
     "the force stays at its limit within 0.2 %; the tool of given speed is refused")
def full_die(bench):
    boxes = BoxMesh(2)
    boxes.add("billet", [0, 0], [1, 1], (4, 4))
    mesh, limit = boxes.write(bench.folder / "die.msh"), 40 * CONSISTENCY
    finished, run = bench.run_text(closed_die(f"press = hydraulic\nforce_limit = {limit}\n"), mesh, "accuracy.two_meshes=no")
    if not ended_well(finished):
        return failure(finished)
    off = run.history["force_upper_y_N"][-3:] / limit - 1
    finished, _ = bench.run_text(closed_die(""), mesh, "accuracy.two_meshes=no")
    return f"force {abs(off).max():.1e} off; {first_error(finished)[:80]}", \
        verdict(abs(off).max() < 2e-3 and finished.returncode == 3 and "die is full" in finished.stderr)


@row("a tool that leaves and comes back five times", "contact is found and lost once a stroke, the force never pulls and is that of the closed form")
def hammering(bench):
    boxes, m, speed = BoxMesh(2), 0.3, "-0.2 - 2*sin(2*pi*t/0.02)"
    boxes.add("billet", [0, 0], [1, 1], (6, 6))
    text = "[mesh]\nfile = billet.msh\n[time]\nend = 0.1\nstep = 5e-4\n" + body("billet", m)
    text += f'[tool.upper]\nshape = plane\npoint = 0 1\nnormal = 0 -1\nvelocity_y = "{speed}"\n[tool.lower]\nshape = plane\npoint = 0 0\nnormal = 0 1\n'
    finished, run = bench.run_text(text, boxes.write(bench.folder / "billet.msh"), "accuracy.two_meshes=no")
    if not ended_well(finished):
        return failure(finished)
    time, step, force, volume = (run.history[name] for name in ("time_s", "dt_s", "force_upper_y_N", "volume_m3"))
    start = time - step  # the force is that at the start of an increment

    def place(at):
        return 1 - 0.2 * at - 2 * 0.02 / (2 * np.pi) * (1 - np.cos(2 * np.pi * at / 0.02))

    rate = 0.2 + 2 * np.sin(2 * np.pi * start / 0.02)
    known = 2 * CONSISTENCY * (2 * abs(rate) / place(start)) ** m * volume / place(start)
    touches = abs(force) > 1e-3 * abs(force).max()
    rounds = np.count_nonzero(np.diff(touches.astype(int)) == 1) + touches[0]
    lowest = np.minimum.accumulate(np.append(1.0, place(time)))[:-1]
    pressed = touches & (rate > 1) & (place(start) < lowest + 1e-9)  # from the start of the increment on
    errors = abs(force)[pressed] / known[pressed] - 1
    sign = np.sign(force[np.argmax(abs(force))])
    return f"{rounds} contacts, force {abs(errors).max():.1%} off in {errors.size} increments", \
        verdict(rounds == 5 and np.all(sign * force >= -1e-6 * abs(force).max()) and abs(errors).max() < 0.03)
