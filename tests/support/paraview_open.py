"""Opens outputs in ParaView as users do and says what it finds there."""
import json
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(os.environ["MALLEUS_SOURCE"]) / "scripts"))
import results  # noqa: E402

COUNTS = pathlib.Path(__file__).resolve().parent / "paraview_counts.py"
SECONDS = 120  # a reader that hangs is a failure


def installed():
    return all(shutil.which(program) for program in ("pvpython", "pvbatch", "pvserver", "Xvfb"))


def launch(ranks, program):
    return ["mpiexec", "-n", str(ranks), program] if ranks > 1 else [program]


def found_by(command, folder):
    finished = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=SECONDS)
    lines = [line for line in finished.stdout.splitlines() if line.startswith("FOUND ")]
    if finished.returncode != 0 or not lines:
        raise AssertionError(f"{command}: exit {finished.returncode}\n{finished.stdout[-2000:]}{finished.stderr[-2000:]}")
    return json.loads(lines[0][len("FOUND "):])


def open_serial(xdmf):
    return found_by(["pvpython", COUNTS, "XDMFReader", xdmf.resolve()], "/")


def open_in_parallel(xdmf, ranks):
    return found_by(launch(ranks, "pvbatch") + [COUNTS, "Xdmf3ReaderT", "./" + xdmf.name], xdmf.parent)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def open_through_server(xdmf, ranks):
    """A pvserver on the loopback, on one or several ranks, and a client."""
    port = free_port()
    command = launch(ranks, "pvserver") + ["--server-port=%d" % port, "--hostname=127.0.0.1"]
    server = subprocess.Popen(command, cwd=xdmf.parent, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        wait_for_line(server, "Accepting connection")
        reader = "XDMFReader" if ranks == 1 else "Xdmf3ReaderT"
        return found_by(["pvpython", COUNTS, reader, xdmf.resolve(), "127.0.0.1", str(port)], xdmf.parent)
    finally:
        server.terminate()
        server.wait()
        server.stdout.close()


def wait_for_line(process, text):
    lines = []
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        line = process.stdout.readline()
        lines.append(line)
        if text in line:
            return
        if not line:
            break
    raise AssertionError("pvserver did not start:\n" + "".join(lines))


def expected(directory):
    """What the files themselves say, read without ParaView."""
    run = results.Run(directory)
    return [run.snapshot(k) for k in range(len(run.times))]
