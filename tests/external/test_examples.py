"""Simulators in Python that come as examples: they keep the contract, and do what they say."""

import json
import os
import re
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from conftest import ROOT, only_directory, program, succeed
from hosts import Server

ROBOTS = ROOT / "robotsim/examples/python"
NETWORKS = ROOT / "netsim/examples/python"
LINES = 75


def serving(example, tmp_path_factory, address):
    log = tmp_path_factory.mktemp(example.stem) / "log"
    package = f"PYTHONPATH={ROOT / 'python/src'}"
    return Server(["env", package, sys.executable, example, address], log, cwd="/")


@pytest.fixture(scope="module")
def wheeled(tmp_path_factory):
    """MuJoCo's robots, running: their address."""
    with serving(ROBOTS / "mujoco_swarm.py", tmp_path_factory, "127.0.0.1:0") as server:
        yield server.address


@pytest.fixture(scope="module")
def flying(tmp_path_factory):
    """PyBullet's robots, running: their address."""
    with serving(ROBOTS / "pybullet_swarm.py", tmp_path_factory, "127.0.0.1:0") as server:
        yield server.address


@pytest.fixture(scope="module")
def gathering(tmp_path_factory):
    """The robots over the package, running: their address."""
    with serving(ROBOTS / "gather.py", tmp_path_factory, "127.0.0.1:0") as server:
        yield server.address


@pytest.fixture(scope="module")
def disk(tmp_path_factory):
    """The network of about sixty lines, running: its address."""
    with serving(NETWORKS / "minimal.py", tmp_path_factory, "0") as server:
        yield server.address


def run(config, out, *options):
    succeed([program("murmuration"), "run", ROOT / "configs" / config, "--out", out, *options])
    return only_directory(out)


def test_all_keep_the_contract(wheeled, flying, gathering, disk):
    for side, address in (("robotsim", wheeled), ("robotsim", flying), ("robotsim", gathering), ("netsim", disk)):
        said = succeed([program("murmuration"), "conformance", side, f"http://{address}"])
        assert "0 failed" in said and "BROKEN" not in said, said


def test_the_robots_of_mujoco_announce_predictions_and_keep_what_they_promise_of_them(wheeled, flying):
    kept = {address: succeed([program("murmuration"), "conformance", "robotsim", f"http://{address}"]) for address in (wheeled, flying)}
    assert kept[wheeled].count("kept    Predict ") == 2 and "kept    when asked for the full digest" in kept[wheeled]
    # What a class does not override is not announced.
    assert kept[flying].count("–       Predict ") == 2


def test_the_network_is_short_and_equals_the_built_in_one(disk, tmp_path):
    code = [line for line in (NETWORKS / "minimal.py").read_text().splitlines() if line.strip()]
    assert len(code) <= LINES, f"{len(code)} lines that are not blank"
    own = run("external-network.toml", tmp_path / "own", "--netsim", f"http://{disk}")
    text = (ROOT / "configs/external-network.toml").read_text()
    built_in = tmp_path / "built-in.toml"
    built_in.write_text(text[: text.index("[netsim]")] + '[netsim.phy]\npropagation = "unit-disk"\nradius_m = 8.0\n')
    ours = run(built_in, tmp_path / "ours")
    columns = ["step", "agent", "n_heard"]
    heard = [pq.read_table(folder / "steps.parquet", columns=columns).to_pydict() for folder in (own, ours)]
    assert heard[0] == heard[1]
    places = [
        np.array([pq.read_table(folder / "steps.parquet")[axis].to_numpy() for axis in ("x_m", "y_m")]) for folder in (own, ours)
    ]
    # The order of transmissions may change the last bits of sums.
    assert np.abs(places[0] - places[1]).max() < 1e-6


def test_gathering_robots_come_together(gathering, tmp_path):
    table = pq.read_table(run("external-robots.toml", tmp_path, "--robotsim", f"http://{gathering}") / "steps.parquet")
    step = table["step"].to_numpy()
    spread_m = [np.hypot(*(np.std(table[axis].to_numpy()[step == at]) for axis in ("x_m", "y_m"))) for at in (step.min(), step.max())]
    # A disk of 1 m around the middle, or less; they begin in a square of 12 m.
    assert 3.0 < spread_m[0] and spread_m[1] < 1.2, spread_m


def over(network):
    """Options of a run over a network, of 20 s."""
    options = ["--set", "experiment.duration_s=20.0", "--set", f"netsim.mode={network}"]
    return [*options, "--set", "netsim.sf.kind=rrsf"] if network == "6tisch" else options


@pytest.mark.parametrize("network", ["propagation-only", "6tisch"])
def test_quadrotors_agree_on_a_height_by_what_they_hear(flying, tmp_path, network):
    folder = run("external-robots.toml", tmp_path / "heard", "--robotsim", f"http://{flying}", *over(network))
    heard = heights_m(folder)
    assert heard[0].std() > 1.0 and heard[-1].std() < 0.05, heard[-1]
    # To the mean, which each finds by itself.
    assert abs(heard[-1].mean() - heard[0].mean()) < 0.2
    summary = json.loads((folder / "summary.json").read_text())
    assert abs(summary["task"]["height_spread_m"] - heard[-1].std()) < 1e-9 and summary["task"]["contacts"] == 0


def test_quadrotors_that_hear_nobody_hover_where_they_are(flying, tmp_path):
    options = ["--robotsim", f"http://{flying}", "--set", "netsim.phy.radius_m=0.1"]
    unheard = heights_m(run("external-robots.toml", tmp_path, *options))
    assert np.abs(unheard - unheard[0]).max() < 0.01


def heights_m(folder):
    """Heights of the robots of a run, a row for each step."""
    table = pq.read_table(folder / "steps.parquet", columns=["step", "agent", "z_m"]).sort_by([("step", "ascending"), ("agent", "ascending")])
    return table["z_m"].to_numpy().reshape(-1, len(set(table["agent"].to_pylist())))
def by_command(*words):
    """The program with the package and this Python first on the path, as where the wheel is installed."""
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    command = ["env", f"PYTHONPATH={ROOT / 'python/src'}", f"PATH={path}", program("murmuration"), *words]
    return [*command, "--allow-command"]


def test_robots_started_by_command_leave_the_recording_of_those_at_a_url(gathering, tmp_path):
    started, reached = tmp_path / "started", tmp_path / "reached"
    config = ROOT / "configs/python-robots.toml"
    succeed(by_command("run", config, "--out", started), cwd=tmp_path)
    by_url = run("python-robots.toml", reached, "--robotsim", f"http://{gathering}")
    for table in ("steps.parquet", "links.parquet", "summary.json"):
        assert (only_directory(started) / table).read_bytes() == (by_url / table).read_bytes(), table


def test_minimal_simulators_are_started_by_command_as_well(disk, tmp_path):
    by_url = run("external-network.toml", tmp_path / "reached", "--netsim", f"http://{disk}")
    text = (ROOT / "configs/external-network.toml").read_text()
    own = tmp_path / "own.toml"
    own.write_text(text.replace('url = "http://127.0.0.1:50051"', f'command = ["python3", "{NETWORKS / "minimal.py"}"]'))
    succeed(by_command("run", own, "--out", tmp_path / "started"), cwd=tmp_path)
    started = only_directory(tmp_path / "started")
    assert (started / "steps.parquet").read_bytes() == (by_url / "steps.parquet").read_bytes()


def test_a_sweep_of_robots_in_python_does_not_depend_on_the_number_of_jobs(tmp_path):
    config = tmp_path / "swept.toml"
    text = (ROOT / "configs/python-robots.toml").read_text()
    text = text.replace("../robotsim/examples/python/gather.py", str(ROBOTS / "gather.py")).replace("duration_s = 10.0", "duration_s = 2.0")
    config.write_text(text + '\n[sweep]\nseeds = 3\n[sweep.vary]\nnetsim.phy.radius_m = [4.0, 8.0]\n')
    for jobs in ("1", "2"):
        said = succeed(by_command("sweep", config, "--jobs", jobs, "--out", tmp_path / jobs), cwd=tmp_path)
        assert f"{jobs} pair" in said, said
    one, two = (only_directory(tmp_path / jobs) / "trials.parquet" for jobs in ("1", "2"))
    assert one.read_bytes() == two.read_bytes()


@pytest.mark.parametrize("network", ["propagation-only", "6tisch"])
def test_wheeled_robots_turn_the_same_way_over_both_networks(wheeled, tmp_path, network):
    options = ["--robotsim", f"http://{wheeled}", *over(network)]
    table = pq.read_table(run("external-robots.toml", tmp_path, *options) / "steps.parquet")
    step, heading_rad = table["step"].to_numpy(), table["heading_rad"].to_numpy()

    def order(at):
        """Length of the mean of all directions: 1 where all agree."""
        return abs(np.exp(1j * heading_rad[step == at]).mean())

    # They begin with directions at random; the engine's wheels stay on the ground.
    assert order(step.min()) < 0.8 and 0.95 < order(step.max())
    speed_mps = np.hypot(*(table[axis].to_numpy()[step == step.max()] for axis in ("vx_mps", "vy_mps")))
    assert np.all((0.3 < speed_mps) & (speed_mps < 0.6)), speed_mps
    z_m = table["z_m"].to_numpy()
    assert np.all(np.abs(z_m - 0.05) < 0.01)


def test_what_is_learnt_under_one_radio_is_flown_under_both(tmp_path):
    """Seconds of training teach little: that it works, and that the same seed gives the same table."""
    variables = {**os.environ, "PYTHONPATH": str(ROOT / "python/src"), "MURMURATION_PROGRAM": program("murmuration")}
    command = [sys.executable, ROOT / "robotsim/examples/python/train_flocking.py", "--quick"]
    said, again = (succeed(command, deadline_s=600, env=variables, cwd=tmp_path) for _ in range(2))
    assert said == again
    lines = said.splitlines()
    assert [line.split(":")[0] for line in lines[:2]] == ["trained under perfect", "trained under 6tisch"]
    for line in lines[-2:]:
        cells = re.findall(r"(-?\d+\.\d+) \((-?\d+\.\d+) to (-?\d+\.\d+)\)", line)
        assert len(cells) == 2 and all(float(low) <= float(mean) <= float(high) for mean, low, high in cells), said
    assert not list(tmp_path.iterdir())
