"""A display for ParaView where there is none."""
import contextlib
import os
import shutil
import subprocess


def available():
    return bool(os.environ.get("DISPLAY")) or shutil.which("Xvfb") is not None


@contextlib.contextmanager
def started():
    """Sets DISPLAY for the time of the context. The server picks a free number by itself, so several may run at once."""
    if os.environ.get("DISPLAY"):
        yield
        return
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-noreset", "-nolisten", "tcp", "-screen", "0", "1280x1024x24"]
    server = subprocess.Popen(command, pass_fds=[writing], stderr=subprocess.DEVNULL)
    os.close(writing)
    try:
        number = os.read(reading, 16).decode().strip()
        if not number:
            raise RuntimeError("Xvfb did not start")
        os.environ["DISPLAY"] = ":" + number
        yield
    finally:
        os.environ.pop("DISPLAY", None)
        os.close(reading)
        server.terminate()
        server.wait()
