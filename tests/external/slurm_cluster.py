"""A Slurm cluster on this machine: munge, one controller, two nodes of one CPU each. Needs root. Nothing is left behind."""

import os
import secrets
import signal
import socket
import subprocess
import time
from pathlib import Path

from conftest import succeed

START_DEADLINE_S = 120
NODES = ("n1", "n2")

# No accounting, no cgroups: jobs run as plain processes of this machine. A node that is silent for five seconds has failed.
CONFIGURATION = """\
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
SlurmctldPort={controller_port}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CryptoType=crypto/munge
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmctldPidFile={folder}/controller.pid
SlurmdPidFile={folder}/%n.pid
SlurmdSpoolDir={folder}/spool-%n
SlurmctldLogFile={folder}/controller.log
SlurmdLogFile={folder}/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_interval=1,batch_sched_delay=0
SlurmdTimeout=5
SlurmctldTimeout=5
MessageTimeout=5
KillWait=1
ReturnToService=2
{nodes}
PartitionName=main Nodes={names} Default=YES MaxTime=INFINITE State=UP
"""


class Cluster:
    """Slurm from the start of the `with` until its end; `environment` is what its commands need."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.configuration = self.folder / "slurm.conf"
        self.environment = {**os.environ, "SLURM_CONF": str(self.configuration)}
        self.daemons = {}

    def __enter__(self):
        try:
            self.write_configuration()
            self.start("munged")
            self.wait_for("munge to listen", (self.folder / "munge.socket").exists)
            self.start("controller")
            for node in NODES:
                self.start(node)
            self.wait_for("both nodes to be idle", lambda: self.node_states() == ["idle", "idle"])
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        # What runs in jobs first, so that no node starts anything more.
        for name in [*NODES, "controller", "munged"]:
            self.kill(name)
        self.kill_jobs(lambda _: True)

    def write_configuration(self):
        (self.folder / "state").mkdir(parents=True)
        for node in NODES:
            (self.folder / f"spool-{node}").mkdir()
        key = self.folder / "munge.key"
        key.touch(mode=0o400)
        key.write_bytes(secrets.token_bytes(128))
        host = socket.gethostname().split(".")[0]
        controller_port, *ports = free_ports(1 + len(NODES))
        nodes = [
            f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=1 RealMemory=500 State=UNKNOWN"
            for node, port in zip(NODES, ports, strict=True)
        ]
        self.configuration.write_text(
            CONFIGURATION.format(
                host=host,
                folder=self.folder,
                controller_port=controller_port,
                nodes="\n".join(nodes),
                names=",".join(NODES),
            )
        )

    def start(self, name):
        """Starts a daemon in the foreground, as a child of this process."""
        if name == "munged":
            folder = self.folder
            command = ["munged", "--foreground", "--force", f"--key-file={folder}/munge.key", f"--socket={folder}/munge.socket"]
            command += [f"--pid-file={folder}/munged.pid", f"--seed-file={folder}/munge.seed", f"--log-file={folder}/munged.log"]
        elif name == "controller":
            command = ["slurmctld", "-D"]
        else:
            command = ["slurmd", "-D", "-N", name]
        with open(self.folder / f"{name}.out", "ab") as out:
            self.daemons[name] = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=out, stderr=out, env=self.environment, start_new_session=True
            )

    def kill(self, name):
        daemon = self.daemons.pop(name, None)
        if daemon is not None:
            daemon.kill()
            daemon.wait()

    def stop(self, name):
        """Ends a daemon in order: the controller saves what it knows of its jobs."""
        daemon = self.daemons.pop(name)
        daemon.terminate()
        daemon.wait(timeout=START_DEADLINE_S)

    def fail(self, node):
        """The machine fails: its daemon and everything that runs on it end at once, without a message to the controller."""
        self.kill(node)
        self.kill_jobs(lambda name: name == node)

    def kill_jobs(self, is_on):
        """Kills the processes of jobs on nodes, each after the process of Slurm that would report its end."""
        for _ in range(100):
            found = [process for process, node in self.job_processes() if is_on(node)]
            if not found:
                return
            for process in sorted(found, key=lambda process: not is_step_daemon(process)):
                try:
                    os.kill(process, signal.SIGKILL)
                except ProcessLookupError:
                    pass
            time.sleep(0.05)
        raise AssertionError(f"processes of jobs do not end: {found}")

    def job_processes(self):
        """Process ids of everything that runs in jobs of this cluster, and of what watches it, with the node."""
        for entry in Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            try:
                environment = (entry / "environ").read_bytes().split(b"\0")
                parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            except (OSError, ValueError, IndexError):
                continue
            if f"SLURM_CONF={self.configuration}".encode() not in environment:
                continue
            nodes = [word.split(b"=", 1)[1].decode() for word in environment if word.startswith(b"SLURMD_NODENAME=")]
            if nodes:
                yield int(entry.name), nodes[0]
                if is_step_daemon(parent):
                    yield parent, nodes[0]

    def command(self, *words):
        return succeed(words, env=self.environment)

    def node_states(self):
        done = subprocess.run(
            ["sinfo", "--noheader", "--Node", "--format=%T"], capture_output=True, text=True, env=self.environment, check=False
        )
        return done.stdout.split()

    def wait_for(self, what, is_there):
        deadline = time.monotonic() + START_DEADLINE_S
        while not is_there():
            assert time.monotonic() < deadline, f"waited {START_DEADLINE_S} s for {what}\n{self.logs()}"
            time.sleep(0.1)

    def logs(self):
        """The end of each daemon's log."""
        paths = [*sorted(self.folder.glob("*.log")), *sorted(self.folder.glob("*.out"))]
        return "\n".join(f"== {path.name}\n{path.read_text(errors='replace')[-2000:]}" for path in paths)


def is_step_daemon(process):
    """Whether it is what Slurm starts for each step of a job, which watches its processes."""
    try:
        return Path(f"/proc/{process}/cmdline").read_bytes().startswith(b"slurmstepd")
    except OSError:
        return False


def free_ports(n):
    """Ports that nobody uses now."""
    sockets = [socket.socket() for _ in range(n)]
    try:
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]
    finally:
        for each in sockets:
            each.close()
