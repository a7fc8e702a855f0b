"""robotsim/examples/ros2: robots of ROS 2 as the swarm, over stand-ins of ROS 2's classes. ROS 2 itself is not here."""

import json
import subprocess
import sys
import threading
import time

import numpy as np
import pyarrow.parquet as pq
import pytest
import stand_in_ros
from conftest import ROOT, only_directory, program, succeed

sys.path[:0] = [str(ROOT / "python/src"), str(ROOT / "robotsim/examples/ros2")]
stand_in_ros.install()
import bridge  # noqa: E402
import murmuration.robots  # noqa: E402
import node  # noqa: E402

N = 8
SETTLE_NS = node.SETTLE_STEPS * 1_000_000


def serving(world, step_service="/world/default/control"):
    """The bridge over that world: its server."""
    ros = node.RosWorld(stand_in_ros.Node(world), step_service, world.physics_step_ns / 1e9, "/robot{}")
    return murmuration.robots.serve(bridge.Bridge(ros), "127.0.0.1:0", block=False)


@pytest.fixture
def stepped():
    """A world that is stepped, and the address of its bridge."""
    world = stand_in_ros.World(N)
    server = serving(world)
    yield world, f"http://{server.murmuration_address}"
    server.stop(None)


def run(url, out, *options):
    command = [program("murmuration"), "run", ROOT / "configs/external-robots.toml", "--robotsim", url, "--out", out]
    return subprocess.run([*command, *options], capture_output=True, text=True, timeout=100)


def table(out):
    steps = pq.read_table(only_directory(out) / "steps.parquet")
    return {name: steps[name].to_numpy() for name in ("step", "agent", "x_m", "y_m", "heading_rad")}


def test_it_keeps_the_contract(stepped):
    said = succeed([program("murmuration"), "conformance", "robotsim", stepped[1]])
    assert "0 failed" in said and "BROKEN" not in said, said


def test_robots_gather_and_every_step_is_one_period(stepped, tmp_path):
    world, url = stepped
    options = ["--set", "experiment.duration_s=60.0", "--set", "netsim.phy.radius_m=30.0"]
    done = run(url, tmp_path / "out", *options)
    assert done.returncode == 0, done.stderr
    assert world.stepped_ns == [SETTLE_NS] + [100_000_000] * 600
    steps = table(tmp_path / "out")
    first, last = (steps["x_m"][steps["step"] == at] for at in (steps["step"].min(), steps["step"].max()))
    assert np.ptp(first) > 18.0 and np.ptp(last) < 3.0, (first, last)
    # The recording ends where the world stands, up to the age of its odometry at 0.5 m/s.
    assert np.abs(last - [pose[0] for pose in world.pose]).max() < 0.05


def test_a_robot_is_told_what_the_network_delivered(stepped, tmp_path):
    world, url = stepped
    assert run(url, tmp_path / "out", "--set", "netsim.phy.radius_m=4.0", "--set", "robotsim.law=none").returncode == 0
    assert len(world.heard[0]) == 100 and json.loads(world.heard[0][0]) == []
    # Robots stand 3 m apart: within 4 m are the neighbours alone.
    for robot in range(N):
        entries = json.loads(world.heard[robot][-1])
        assert [entry["from"] for entry in entries] == [other for other in (robot - 1, robot + 1) if 0 <= other < N]
        for entry in entries:
            assert entry["position_m"] == pytest.approx([3.0 * entry["from"], 0.0, 0.0])
            assert 0.0 < entry["age_s"] <= 0.1 and entry["rssi_dbm"] < 0.0


def test_odometry_frames_are_joined(stepped, tmp_path):
    origin = "[" + ", ".join("[1.0, 2.0, 1.5707963267948966]" for _ in range(N)) + "]"
    done = run(stepped[1], tmp_path / "out", "--set", f"robotsim.origin={origin}", "--set", "robotsim.law=none")
    assert done.returncode == 0, done.stderr
    steps = table(tmp_path / "out")
    assert steps["x_m"] == pytest.approx(np.ones(len(steps["x_m"])))
    assert steps["y_m"] == pytest.approx(2.0 + 3.0 * steps["agent"])
    assert np.abs(np.abs(steps["heading_rad"]) - np.pi).max() < 1e-9


def test_a_robot_without_odometry_is_named(tmp_path):
    server = serving(stand_in_ros.World(N, silent=[5]))
    done = run(f"http://{server.murmuration_address}", tmp_path / "out", "--set", "robotsim.deadline_s=3")
    server.stop(None)
    assert done.returncode != 0 and "odometry of robot 5" in done.stderr and "robot 4" not in done.stderr, done.stderr


def test_a_simulation_that_runs_by_itself_is_waited_for(tmp_path):
    world, ended = stand_in_ros.World(N), threading.Event()

    def run_by_itself():
        while not ended.is_set():
            world.step(10)
            time.sleep(0.001)

    server = serving(world, step_service=None)
    threading.Thread(target=run_by_itself, daemon=True).start()
    done = run(f"http://{server.murmuration_address}", tmp_path / "out", "--set", "experiment.duration_s=5.0")
    ended.set()
    server.stop(None)
    assert done.returncode == 0, done.stderr
    assert world.stepped_ns == []
    lag_s = json.loads((only_directory(tmp_path / "out") / "summary.json").read_text())["task"]["lag_s"]
    assert 0.0 <= lag_s < 5.0 and world.time_ns >= 5_000_000_000


def test_a_period_that_is_no_multiple_of_the_physics_step_is_refused(tmp_path):
    server = serving(stand_in_ros.World(N, physics_step_ns=3_000_000))
    done = run(f"http://{server.murmuration_address}", tmp_path / "out")
    server.stop(None)
    assert done.returncode != 0 and "100000000 ns is no multiple of the physics step of 3000000 ns" in done.stderr, done.stderr


@pytest.mark.parametrize("heading", [-3.0, -1.0, 0.0, 0.5, 3.0])
def test_yaw(heading):
    assert bridge.yaw_rad(0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2)) == pytest.approx(heading)
