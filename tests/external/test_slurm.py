"""`sweep --engine slurm` on a real Slurm, with two nodes on this machine."""

import signal
import subprocess
import time
from pathlib import Path

import pytest
from conftest import program, succeed
from slurm_cluster import Cluster

RESULTS = ("sweep.toml", "trials.parquet", "summary.json", "report.html")
# Twenty settings, ten seeds: 200 trials.
SWEEP = """
[experiment]
name = "s"
seed = 1
duration_s = {duration_s}
agents = 10

[robotsim.scenario]
kind = "line"
spacing_m = 2.0

[robotsim.controller]
kind = "flocking"
flock_radius_m = 10.0

[netsim.phy]
propagation = "experimental-randomness"

[sweep]
seeds = 10

[sweep.vary]
robotsim.controller.flock_radius_m = [{radii}]

[sweep.slurm]
partition = "main"
memory_mib = 400
time_limit_min = 10
options = ["--comment=\\"a\\" #b\\\\ c"]
commands = ["echo cores $SLURM_CPUS_PER_TASK, $(nproc) on $SLURMD_NODENAME"]
"""
DEADLINE_S = 240


@pytest.fixture
def cluster(tmp_path):
    with Cluster(tmp_path / "cluster") as cluster:
        yield cluster


class Sweep:
    """A sweep in a folder whose name no shell and no script should take apart."""

    def __init__(self, tmp_path, cluster, n_settings, duration_s):
        self.cluster, self.folder = cluster, tmp_path / "it's 100 %j \"$HOME\""
        self.folder.mkdir()
        radii = ", ".join(f"{5.0 + setting}" for setting in range(n_settings))
        (self.folder / "s.toml").write_text(SWEEP.format(radii=radii, duration_s=duration_s))
        self.said = self.folder / "said"

    def start(self, *options):
        command = [program("murmuration"), "sweep", "s.toml", *options]
        with open(self.said, "wb") as said:
            return subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=said, stderr=said, cwd=self.folder, env=self.cluster.environment
            )

    def end(self, process, status=0):
        try:
            found = process.wait(timeout=DEADLINE_S)
        finally:
            process.kill()
        said = self.said.read_text()
        assert found == status, f"exit status {found}: {said}\n{self.cluster.logs()}"
        return said

    def n_rows(self):
        return sum(path.read_bytes().count(b"\n") for path in self.folder.glob("runs/s/trials-*.jsonl"))

    def wait_for_rows(self, n, process):
        deadline = time.monotonic() + DEADLINE_S
        while self.n_rows() < n:
            assert process.poll() is None and time.monotonic() < deadline, self.said.read_text() + self.cluster.logs()
            time.sleep(0.02)

    def results(self, out):
        return {name: (self.folder / out / "s" / name).read_bytes() for name in RESULTS}

    def run_on_one_machine(self):
        succeed([program("murmuration"), "sweep", "s.toml", "--out", "one"], cwd=self.folder)
        return self.results("one")


def test_a_sweep_survives_the_failure_of_a_node_and_leaves_the_bytes_of_one_machine(tmp_path, cluster):
    sweep = Sweep(tmp_path, cluster, n_settings=20, duration_s=15.0)
    process = sweep.start("--allow-command", "--engine", "slurm", "--shards", "4")
    sweep.wait_for_rows(20, process)
    cluster.fail("n1")
    assert sweep.n_rows() < 180, "the node was to fail in the middle of the sweep"
    said = sweep.end(process)
    lost = [line for line in said.splitlines() if "was lost: NODE_FAIL" in line]
    assert len(lost) == 1 and " on n1; submitted again as Slurm job " in lost[0], said
    assert "s: 200 trials of 4 shards merged" in said
    assert sweep.results("runs") == sweep.run_on_one_machine()
    # Each task had one core, whatever the machine has, and ran one trial at a time.
    logs = "".join(path.read_text() for path in sweep.folder.glob("runs/s/cluster/slurm-*.log"))
    assert logs.count("cores 1, ") == 5 and logs.count(" on n1\n") >= 1, logs
    run_log = (sweep.folder / "runs/s/run.log").read_text()
    assert run_log.count(" of a sweep of 200 trials, 1 at a time") == 5, run_log
    # Nothing is left to do, and nothing is submitted.
    jobs = (sweep.folder / "runs/s/cluster/submission.json").read_bytes()
    said = sweep.end(sweep.start("--allow-command", "--engine", "slurm"))
    assert "200 trials of 4 shards merged" in said and "submitted" not in said, said
    assert (sweep.folder / "runs/s/cluster/submission.json").read_bytes() == jobs


def test_the_same_command_follows_jobs_that_an_interrupted_one_left(tmp_path, cluster):
    sweep = Sweep(tmp_path, cluster, n_settings=6, duration_s=40.0)
    process = sweep.start("--allow-command", "--engine=slurm", "--shards=3")
    sweep.wait_for_rows(3, process)
    process.send_signal(signal.SIGINT)
    said = sweep.end(process, status=1)
    job = said.split("Slurm job ")[1].split(":")[0]
    assert f"Slurm job {job} is in progress and not affected. Run the same command again to follow" in said, said
    assert f"cancel with: scancel {job}" in said, said
    # Another one with other trials does not mix with it.
    said = sweep.end(sweep.start("--allow-command", "--engine", "slurm", "--set", "sweep.seeds=9"), status=2)
    assert f"Slurm job {job} is in progress, of another file or other options" in said, said
    # The controller is away for a while; tasks go on without it.
    process = sweep.start("--allow-command", "--engine", "slurm")
    n_rows = sweep.n_rows()
    cluster.stop("controller")
    sweep.wait_for_rows(n_rows + 3, process)
    time.sleep(3)
    cluster.start("controller")
    said = sweep.end(process)
    assert "s: 60 trials of 3 shards merged" in said and "was lost" not in said, said
    assert sweep.results("runs") == sweep.run_on_one_machine()


def test_cancelled_shards_are_named_and_submitted_again_by_the_same_command(tmp_path, cluster):
    sweep = Sweep(tmp_path, cluster, n_settings=2, duration_s=40.0)
    process = sweep.start("--allow-command", "--engine", "slurm", "--shards", "2")
    sweep.wait_for_rows(2, process)
    job = sweep.said.read_text().split("Slurm job ")[1].split(":")[0]
    cluster.command("scancel", f"{job}_2")
    said = sweep.end(process, status=1)
    assert "Slurm: the tasks of shard 2/2 were cancelled" in said, said
    said = sweep.end(sweep.start("--allow-command", "--engine", "slurm"))
    assert "20 trials of 2 shards merged" in said, said
    assert sweep.results("runs") == sweep.run_on_one_machine()


def test_an_emitted_script_is_what_sbatch_runs(tmp_path, cluster):
    sweep = Sweep(tmp_path, cluster, n_settings=2, duration_s=1.0)
    command = [program("murmuration"), "sweep", "s.toml", "--engine", "slurm", "--shards", "2", "--emit", "script"]
    script = succeed(command, cwd=sweep.folder)
    assert not (sweep.folder / "runs").exists()
    path = Path(sweep.folder / "job.sh")
    path.write_text(script)
    cluster.command("sbatch", "--wait", str(path))
    succeed([program("murmuration"), "sweep", "s.toml", "--merge"], cwd=sweep.folder)
    assert sweep.results("runs") == sweep.run_on_one_machine()
