"""A Slurm of one node on the loopback, without systemd and cgroups, for tests as root."""
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import time

DAEMONS = ("munged", "slurmctld", "slurmd")


def reason_to_skip():
    """Why there can be no Slurm here; None where there can."""
    missing = [name for name in (*DAEMONS, "sbatch") if shutil.which(name, path=search_path()) is None]
    if missing:
        return f"{', '.join(missing)} not installed (apt-get install slurm-wlm munge)"
    return None if os.geteuid() == 0 else "its daemons are started as root"


def search_path():
    return os.environ.get("PATH", "") + ":/usr/sbin:/sbin"


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class MiniSlurm:
    def __init__(self, directory):
        self.directory = pathlib.Path(directory)
        self.environment = {**os.environ, "PATH": search_path(), "SLURM_CONF": str(self.directory / "slurm.conf")}
        self.daemons = []

    def configure(self):
        for name in ("state", "spool", "munge"):
            (self.directory / name).mkdir(mode=0o755)
        self.directory.chmod(0o755)
        key = self.directory / "munge" / "key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o600)
        host = socket.gethostname().split(".")[0]
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2 ** 20 * 8 // 10
        here = self.directory
        (here / "slurm.conf").write_text(f"""ClusterName=mini
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={free_port()}
SlurmdPort={free_port()}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={here}/munge/socket
CryptoType=crypto/munge
StateSaveLocation={here}/state
SlurmdSpoolDir={here}/spool
SlurmctldPidFile={here}/slurmctld.pid
SlurmdPidFile={here}/slurmd.pid
SlurmctldLogFile={here}/slurmctld.log
SlurmdLogFile={here}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/builtin
MpiDefault=none
ReturnToService=2
MinJobAge=3600
InactiveLimit=0
AccountingStorageType=accounting_storage/none
NodeName={host} NodeAddr=127.0.0.1 CPUs={os.cpu_count()} RealMemory={memory} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP OverSubscribe=FORCE:4
""")

    def start(self):
        self.configure()
        munge = self.directory / "munge"
        self.spawn(["munged", "--foreground", "--force", f"--key-file={munge}/key", f"--socket={munge}/socket",
                    f"--pid-file={munge}/pid", f"--log-file={munge}/log", f"--seed-file={munge}/seed"])
        self.wait_for(lambda: (munge / "socket").exists(), "munged")
        self.spawn(["slurmctld", "-D"])
        self.spawn(["slurmd", "-D"])
        self.wait_for(lambda: "idle" in self.say("sinfo", "-h", "-o", "%t"), "an idle node")

    def spawn(self, command):
        log = open(self.directory / f"{command[0]}.out", "w")
        with log:
            self.daemons.append(subprocess.Popen(command, env=self.environment, stdout=log, stderr=log))

    def wait_for(self, condition, what, seconds=60):
        limit = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > limit:
                logs = "".join(path.read_text(errors="replace")[-1500:] for path in sorted(self.directory.glob("*.out")))
                raise AssertionError(f"Slurm: {what} did not come within {seconds} s\n{logs}")
            time.sleep(0.3)

    def say(self, *words, **options):
        result = subprocess.run(words, env=self.environment, capture_output=True, text=True, **options)
        return result.stdout.strip() + result.stderr.strip()

    def submit(self, *words, cwd, **environment):
        """The number of the job."""
        result = subprocess.run(["sbatch", "--parsable", *map(str, words)], env={**self.environment, **environment}, cwd=cwd,
                                capture_output=True, text=True)
        if result.returncode != 0:
            raise AssertionError(result.stdout + result.stderr)
        return result.stdout.strip()

    def state(self, job):
        """Of all its tasks: "RUNNING", "COMPLETED FAILED", ..."""
        shown = self.say("scontrol", "-o", "show", "job", job)
        return " ".join(sorted({word[9:] for word in shown.split() if word.startswith("JobState=")}))

    def wait_to_end(self, job, seconds, is_done=lambda: True):
        """The state in which it ends; a job that waits to begin again may at once.

        A leg that goes back to the queue is told as failed for a while: what is over without being done has to stay so."""
        limit, over_since = time.monotonic() + seconds, None
        while time.monotonic() < limit:
            state = self.state(job)
            if "PENDING" in state:
                self.say("scontrol", "update", f"JobId={job}", "StartTime=now")
            if {"PENDING", "RUNNING", "SIGNALING", "COMPLETING", "REQUEUED"} & set(state.split()):
                over_since = None
            elif over_since is None:
                over_since = time.monotonic()
            elif time.monotonic() - over_since > (3 if is_done() else 60):
                return state
            time.sleep(0.5)
        raise AssertionError(f"job {job} is {self.state(job)} after {seconds} s")

    def stop(self):
        self.say("scancel", "--full", "--user=root")
        time.sleep(0.5)
        for daemon in reversed(self.daemons):
            daemon.send_signal(signal.SIGTERM)
            try:
                daemon.wait(15)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
