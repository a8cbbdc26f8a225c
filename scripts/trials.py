"""Runs of one case under changed settings, each in a folder of its own and only once.

    import trials
    study = trials.Study("cases/channel/case.ini", "out/study", ranks=2)
    trial = study.run("cfl-1", ["front.cfl=1"])
    trial.seconds, trial.mebibytes, trial.run.history

A folder whose run came to its end under the same settings, with the same program, is not run again: a study that was cut off
goes on where it stopped.
"""
import dataclasses
import hashlib
import itertools
import json
import pathlib
import re
import resource
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))
import results  # noqa: E402

STAMP = "trial.json"


def environment():
    """What scripts/environment sets."""
    text = subprocess.run(["bash", "-c", f". '{ROOT}/scripts/environment' && env -0"], capture_output=True, check=True).stdout
    return dict(item.split("=", 1) for item in text.decode().split("\0") if "=" in item)


def processor_seconds():
    """Of all programs that this one has started and that ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def program_of(case_text):
    """forge or inject, by the sections of the case."""
    return "inject" if re.search(r"^\s*\[fluid\.", case_text, re.MULTILINE) else "forge"


@dataclasses.dataclass
class Trial:
    name: str
    settings: list          # of SECTION.KEY=VALUE
    directory: pathlib.Path
    exit_code: int
    message: str            # what the program said where it failed
    all_seconds: list       # of each repetition

    @property
    def done(self):
        return self.exit_code == 0

    @property
    def seconds(self):
        return statistics.median(self.all_seconds)

    @property
    def run(self):
        return results.Run(self.directory)

    @property
    def mebibytes(self):
        return self.run.summary["peak_memory_bytes"] / 2**20


class Study:
    """A case and the place of its trials."""

    def __init__(self, case, directory, ranks=1, binaries=None, repeat=1, settings=(), processor_time=False):
        """processor_time: seconds are those of the processor, of all ranks, not of the wall: for a machine with other work."""
        self.case = pathlib.Path(case).resolve()
        if not self.case.exists():
            sys.exit(f"{case}: there is no such case")
        self.directory = pathlib.Path(directory).resolve()
        self.ranks, self.repeat, self.common, self.processor_time = ranks, repeat, list(settings), processor_time
        self.program = pathlib.Path(binaries or ROOT / "build" / "bin") / program_of(self.case.read_text())
        if not self.program.exists():
            sys.exit(f"{self.program}: not built; run scripts/build first")

    def stamp(self, settings):
        """What decides whether a folder holds this very trial."""
        inputs = [self.case.read_bytes(), self.program.read_bytes()]
        return {"settings": sorted([*self.common, *settings]), "ranks": self.ranks, "repeat": self.repeat, "processor_time": self.processor_time,
                "inputs": hashlib.sha256(b"".join(inputs)).hexdigest()}

    def command(self, settings, output):
        start = ["mpirun", "-n", str(self.ranks)] if self.ranks > 1 else []
        changes = [word for setting in [*self.common, *settings] for word in ("-D", setting)]
        return [*start, str(self.program), *changes, "-o", str(output), str(self.case)]

    def find(self, name, settings):
        """The trial of an earlier study; None where it has to be run."""
        path = self.directory / name / STAMP
        if not path.exists():
            return None
        kept = json.loads(path.read_text())
        if kept["stamp"] != self.stamp(settings):
            return None
        return Trial(name, list(settings), self.directory / name, kept["exit_code"], kept["message"], kept["seconds"])

    def run(self, name, settings=()):
        known = self.find(name, settings)
        if known:
            return known
        output, seconds = self.directory / name, []
        for _ in range(self.repeat):
            before = processor_seconds()
            finished = subprocess.run(self.command(settings, output), capture_output=True, text=True, env=environment())
            if finished.returncode != 0:
                break
            spent = processor_seconds() - before
            seconds.append(spent if self.processor_time else results.Run(output).summary["wall_s"])
        lines = [line for line in finished.stderr.splitlines() if line.startswith("error")]
        trial = Trial(name, list(settings), output, finished.returncode, (lines or [""])[0], seconds)
        output.mkdir(parents=True, exist_ok=True)
        (output / STAMP).write_text(json.dumps({"stamp": self.stamp(settings), "exit_code": trial.exit_code,
                                                "message": trial.message, "seconds": seconds}, indent=2) + "\n")
        return trial


def combinations(axes):
    """Settings of every combination of 'SECTION.KEY=a,b,c', the last one varying fastest.

    Values with commas of their own stand apart by semicolons: 'vent.a.point=0 0 1;0 1 0'.
    """
    lists = []
    for axis in axes:
        key, equals, values = axis.partition("=")
        if not equals or not values or "." not in key:
            sys.exit(f"{axis}: give SECTION.KEY=a,b,c")
        lists.append([f"{key}={value.strip()}" for value in values.split(";" if ";" in values else ",")])
    return [list(combination) for combination in itertools.product(*lists)]


def folder_name(settings):
    """A readable folder name of its own for these settings."""
    text = "+".join(re.sub(r"[^A-Za-z0-9.=-]+", "_", setting.split(".", 1)[-1]) for setting in settings)
    return text if len(text) <= 100 else text[:80] + "-" + hashlib.sha256(text.encode()).hexdigest()[:12]


def write_csv(path, header, rows):
    import csv
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows([header, *rows])
