"""Runs that are killed, signalled, limited, slowed down: what they wrote stays readable, and --restart goes on as if nothing
had happened."""
import json
import os
import pathlib
import random
import resource
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

import long_runs
from long_runs import (PROGRAMS, check_sound, digits, finish, kill, rows_so_far, start, wait_for_rows, wait_for_writing, write_case)
from runs import PATIENCE

JUMPING_CLOCK = r"""
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
/* Every look at the time of day finds another day; the steady clock is left alone. */
static time_t jump(void) { static int n; return (n++ % 3 - 1) * 86400; }
int clock_gettime(clockid_t clock, struct timespec *at) {
  long result = syscall(SYS_clock_gettime, clock, at);
  if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) at->tv_sec += jump();
  return (int)result;
}
int gettimeofday(struct timeval *at, void *zone) {
  struct timespec now;
  syscall(SYS_clock_gettime, CLOCK_REALTIME, &now);
  at->tv_sec = now.tv_sec + jump();
  at->tv_usec = now.tv_nsec / 1000;
  (void)zone;
  return 0;
}
time_t time(time_t *at) {
  struct timespec now;
  syscall(SYS_clock_gettime, CLOCK_REALTIME, &now);
  now.tv_sec += jump();
  if (at) *at = now.tv_sec;
  return now.tv_sec;
}
"""


class LongRuns(unittest.TestCase):
    INCREMENTS = 24

    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def run_to_end(self, program, case, name, *options, ranks=1, **popen):
        output = self.directory / name
        code, said = finish(start(program, case, output, *options, ranks=ranks, **popen))
        self.assertEqual(code, 0, said)
        check_sound(output, program)
        return output

    def mounted(self, name, options):
        """A file system of its own in memory."""
        place = self.directory / name
        place.mkdir()
        if subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", place], capture_output=True).returncode != 0:
            self.skipTest("no file system can be mounted here")
        self.addCleanup(subprocess.run, ["umount", place], check=True)
        return place

    def assert_same_digits(self, one, other):
        self.assertEqual(digits(one), digits(other))

    def assert_near(self, one, other, tolerance=1e-2):
        """Rows of the same increment agree as far as they can: on other ranks the meshes that are made anew are others, and of the
        last steps of a filling one may be halved."""
        rows = digits(one), digits(other)
        last = min(map(len, rows)) - 4
        self.assertLessEqual(max(map(len, rows)), last + 6)
        a, b = (dict(zip(each[0], each[last])) for each in rows)
        for column in ("time_s", "volume_m3", "force_upper_y_N", "fill_fraction", "pressure_gate_Pa"):
            if column in a:
                self.assertAlmostEqual(float(a[column]) / float(b[column]), 1, delta=tolerance, msg=column)


class Kills(LongRuns):
    def test_killed_runs_go_on_to_the_same_digits(self):
        for program in PROGRAMS:
            dice = random.Random(program)  # the same moments, as far as a machine repeats them
            case = write_case(program, self.directory, self.INCREMENTS)
            whole = self.run_to_end(program, case, f"{program}-whole", ranks=2)
            output = self.directory / f"{program}-killed"
            for number, which in enumerate(("one", "all", "writing")):
                process = start(program, case, output, "--restart", ranks=2)
                wait_for_rows(process, output, 1 + dice.randrange(4) + 7 * number)
                if which == "writing":
                    wait_for_writing(process, output)
                kill(process, program, "all" if which == "all" else "one", dice)
                finish(process)
            with self.subTest(program):
                shutil.copytree(output, self.directory / f"{program}-elsewhere")
                self.assert_same_digits(self.run_to_end(program, case, output.name, "--restart", ranks=2), whole)
                other = self.run_to_end(program, case, f"{program}-elsewhere", "--restart", ranks=3)
                self.assert_near(other, whole)

    def test_checkpoints_change_no_digit(self):
        for program in PROGRAMS:
            with self.subTest(program):
                case = write_case(program, self.directory, self.INCREMENTS)
                often = self.run_to_end(program, case, f"{program}-often", "-D", "checkpoint.every=1")
                never = self.run_to_end(program, case, f"{program}-never", "-D", "checkpoint.every=1000")
                self.assert_same_digits(often, never)

    def test_the_older_checkpoint_serves_where_the_newest_is_damaged(self):
        case = write_case("forge", self.directory, self.INCREMENTS)
        whole = self.run_to_end("forge", case, "whole")
        for damage in ("flip", "truncate", "manifest", "lost"):
            with self.subTest(damage):
                output = self.directory / damage
                code, said = finish(start("forge", case, output, "--steps", "9"))
                self.assertEqual(code, 0, said)
                newest = max((output / "checkpoints").iterdir())
                victim = newest / ("manifest.json" if damage == "manifest" else "part-00000.h5")
                content = bytearray(victim.read_bytes())
                content[len(content) // 2] ^= 16
                if damage == "truncate":
                    content = content[:len(content) // 3]
                victim.write_bytes(content)
                if damage == "lost":
                    victim.unlink()
                process = start("forge", case, output, "--restart")
                code, said = finish(process)
                self.assertEqual(code, 0, said)
                self.assertIn(f"checkpoint {newest.name} is passed over", said)
                check_sound(output, "forge")
                self.assert_same_digits(output, whole)

    def test_a_state_of_another_case_is_refused(self):
        case = write_case("forge", self.directory, 6)
        output = self.run_to_end("forge", case, "out")
        before = (output / "case.resolved.ini").read_text()
        extra = "[tool.side]\nshape = plane\npoint = 9 0\nnormal = -1 0\n"
        (self.directory / "other.ini").write_text(case.read_text() + extra)
        filling = write_case("inject", self.directory, 6)
        for program, wrong in (("forge", self.directory / "other.ini"), ("inject", filling)):
            code, said = finish(start(program, wrong, output, "--restart"))
            self.assertEqual(code, 2, said)
            self.assertIn("--restart: ", said)
        self.assertEqual((output / "case.resolved.ini").read_text(), before)


class Stops(LongRuns):
    def stop_and_go_on(self, program, how, *options, ranks=1, rows=5):
        """Stops a run after some rows by how(process, output); its summary then. It is run to its end after that."""
        case = write_case(program, self.directory, self.INCREMENTS)
        output = self.directory / f"{program}-stopped"
        shutil.rmtree(output, ignore_errors=True)
        process = start(program, case, output, *options, ranks=ranks)
        self.assertTrue(wait_for_rows(process, output, rows))
        how(process, output)
        code, said = finish(process, 60)
        self.assertEqual(code, 85, said)
        summary = json.loads((output / "summary.json").read_text())
        self.assertEqual((summary["status"], summary["exit_code"]), ("stopped", 85))
        self.assertEqual(rows_so_far(output), summary["increments"])
        self.assertLess(summary["increments"], self.INCREMENTS)
        self.assertEqual(int(max((output / "checkpoints").iterdir()).name), summary["increments"])
        whole = self.run_to_end(program, case, f"{program}-whole", ranks=ranks)
        self.assert_same_digits(self.run_to_end(program, case, output.name, "--restart", ranks=ranks), whole)
        return summary

    def test_signals(self):
        for number, name in ((signal.SIGUSR1, "SIGUSR1"), (signal.SIGUSR2, "SIGUSR2"), (signal.SIGTERM, "SIGTERM"),
                             (signal.SIGINT, "SIGINT")):
            with self.subTest(name):
                summary = self.stop_and_go_on("forge", lambda process, _, n=number: process.send_signal(n))
                self.assertEqual(summary["reason"], f"signal {name}")

    def test_signals_through_mpirun(self):
        for program in PROGRAMS:
            with self.subTest(program):
                self.stop_and_go_on(program, lambda process, _: process.send_signal(signal.SIGUSR1), ranks=2)

    def test_one_wish_that_arrives_twice(self):
        def twice(process, _):
            process.send_signal(signal.SIGUSR1)
            time.sleep(0.01)
            if process.poll() is None:
                process.send_signal(signal.SIGUSR1)
        self.stop_and_go_on("inject", twice)

    def test_a_stop_file(self):
        summary = self.stop_and_go_on("inject", lambda _, output: (output / "stop").write_text(""), ranks=2)
        self.assertEqual(summary["reason"], "file 'stop' found")

    def test_wall_time(self):
        case = write_case("forge", self.directory, 4000)
        output = self.directory / "limited"
        for leg in range(2):
            began = time.monotonic()
            code, said = finish(start("forge", case, output, "--restart", "-D", "limits.wall_time=3", "-D",
                                      "output.every=1000"))
            self.assertEqual(code, 85, said)
            self.assertLess(time.monotonic() - began, 4 * PATIENCE)
            summary = json.loads((output / "summary.json").read_text())
            self.assertEqual(summary["reason"], "[limits] wall_time")
            self.assertEqual(rows_so_far(output), summary["increments"])

    def test_memory_says_what_it_takes_and_each_leg_gets_on(self):
        case = write_case("forge", self.directory, self.INCREMENTS)
        for leg in (1, 2):
            code, said = finish(start("forge", case, self.directory / "out", "--restart", "-D", "limits.memory=20 MiB"))
            self.assertEqual(code, 85, said)
            reason = json.loads((self.directory / "out" / "summary.json").read_text())["reason"]
            self.assertRegex(reason, rf"\[limits\] memory: increment {leg} took \d+ MiB over all ranks, 20 MiB are allowed; "
                                     r"give at least \d+ MiB")

    def test_a_reader_that_has_gone_ends_no_run(self):
        case = write_case("forge", self.directory, self.INCREMENTS)
        command = [word for word in long_runs.command("forge", case, self.directory / "out") if word != "--quiet"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        process.stdout.close()
        self.assertEqual(process.wait(120), 0)
        check_sound(self.directory / "out", "forge")


class Disks(LongRuns):
    """Where nothing more can be written a run ends with exit 4, and what stood there stays."""

    def test_a_full_disk(self):
        for program in PROGRAMS:
            case = write_case(program, self.directory, self.INCREMENTS)
            for kilobytes, ranks in ((40, 1), (100, 1), (160, 2), (300, 2)):
                with self.subTest(program=program, kilobytes=kilobytes, ranks=ranks):
                    place = self.mounted(f"disk-{program}-{kilobytes}", f"size={kilobytes}k")
                    code, said = finish(start(program, case, place / "out", ranks=ranks))
                    self.assertEqual(code, 4, said)
                    self.assertIn("No space left on device", said)

    def test_a_directory_that_vanishes(self):
        for program, ranks in zip(PROGRAMS, (1, 2)):
            with self.subTest(program):
                case = write_case(program, self.directory, 400)
                output = self.directory / f"{program}-out"
                process = start(program, case, output, ranks=ranks)
                self.assertTrue(wait_for_rows(process, output, 4))
                os.rename(output, self.directory / f"{program}-gone")
                code, said = finish(process, 60)
                self.assertEqual(code, 4, said)
                self.assertIn(f"{output.name}", said)

    def test_a_directory_that_may_no_longer_be_written(self):
        case = write_case("forge", self.directory, self.INCREMENTS)
        whole = self.run_to_end("forge", case, "whole", ranks=2)
        place = self.mounted("disk", "size=64m")
        code, said = finish(start("forge", case, place / "out", "--steps", "5", ranks=2))
        self.assertEqual(code, 0, said)
        subprocess.run(["mount", "-o", "remount,ro", place], check=True)
        code, said = finish(start("forge", case, place / "out", "--restart", ranks=2))
        self.assertEqual(code, 4, said)
        self.assertIn("Read-only file system", said)
        subprocess.run(["mount", "-o", "remount,rw", place], check=True)
        self.assert_same_digits(self.run_to_end("forge", case, place / "out", "--restart", ranks=2), whole)

    def test_files_that_may_grow_no_more(self):
        for program, ranks in zip(PROGRAMS, (2, 1)):
            with self.subTest(program):
                case = write_case(program, self.directory, 400)
                output = self.directory / f"{program}-limited"
                process = start(program, case, output, ranks=ranks)
                self.assertTrue(wait_for_rows(process, output, 4))
                for rank in long_runs.ranks_of(process, program):
                    resource.prlimit(rank, resource.RLIMIT_FSIZE, (4096, 4096))
                code, said = finish(process, 60)
                self.assertEqual(code, 4, said)
                self.assertIn("File too large", said)
                self.assertTrue(any((output / "checkpoints").iterdir()))

    def test_a_place_where_nothing_can_be_made(self):
        case = write_case("forge", self.directory, self.INCREMENTS)
        (self.directory / "file").write_text("")
        code, said = finish(start("forge", case, self.directory / "file" / "out"))
        self.assertEqual(code, 4, said)


class Odd(LongRuns):
    def test_a_rank_that_stands_still_for_a_while(self):
        case = write_case("forge", self.directory, self.INCREMENTS)
        whole = self.run_to_end("forge", case, "whole", ranks=2)
        process = start("forge", case, self.directory / "slow", ranks=2)
        self.assertTrue(wait_for_rows(process, self.directory / "slow", 4))
        slow = long_runs.ranks_of(process, "forge")[-1]
        for _ in range(20):
            os.kill(slow, signal.SIGSTOP)
            time.sleep(0.1)
            os.kill(slow, signal.SIGCONT)
            time.sleep(0.001)
            if process.poll() is not None:
                break
        code, said = finish(process)
        self.assertEqual(code, 0, said)
        self.assert_same_digits(self.directory / "slow", whole)

    @unittest.skipUnless(shutil.which("cc"), "no C compiler to make the jumping clock with")
    def test_clock_jumps(self):
        (self.directory / "clock.c").write_text(JUMPING_CLOCK)
        library = self.directory / "clock.so"
        subprocess.run(["cc", "-shared", "-fPIC", "-o", library, self.directory / "clock.c"], check=True)
        case = write_case("forge", self.directory, self.INCREMENTS)
        whole = self.run_to_end("forge", case, "whole")
        preloaded = ":".join(filter(None, [str(library), os.environ.get("LD_PRELOAD")]))
        jumping = self.run_to_end("forge", case, "jumping", env={**os.environ, "LD_PRELOAD": preloaded})
        self.assert_same_digits(jumping, whole)
        walls = [float(line.split(",")[8]) for line in (jumping / "history.csv").read_text().splitlines()[1:]]
        self.assertEqual(walls, sorted(walls))
        self.assertLess(walls[-1], 3600)

    @unittest.skipIf(PATIENCE > 1, "a build with sanitizers, which end a program without memory in their own way")
    def test_out_of_memory(self):
        case = write_case("forge", self.directory, self.INCREMENTS)
        output = self.directory / "out"
        process = start("forge", case, output, "-D", "remesh.size=0.004", "-D", "remesh.every=100", "-D",
                        "time.increments=3", ranks=2)
        victim = None
        while process.poll() is None and victim is None:
            if (output / "history.csv").exists():
                victim = long_runs.ranks_of(process, "forge")[-1]
                taken = 1024 * int(pathlib.Path(f"/proc/{victim}/statm").read_text().split()[0]) * 4
                resource.prlimit(victim, resource.RLIMIT_AS, (taken + (8 << 20), taken + (8 << 20)))
        code, said = finish(process, 120)
        self.assertNotIn(code, (0, 85, -11, 139), said)
        self.assertIn("out of memory", said)


if __name__ == "__main__":
    unittest.main()
