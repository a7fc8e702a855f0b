"""robotsim/examples/python/minimal.py, a robot simulator that shares no code with ours, drives a run."""

import math
import re
import struct
import subprocess
import sys

import pytest
from conftest import ROOT, only_directory, program, succeed
from hosts import Server
from full_digest import exchange_digest
from recording import by_topic, heard_by

EXAMPLE = ROOT / "robotsim/examples/python/minimal.py"
LINES = 70  # "about sixty"; the contract is too hard if this does not do


@pytest.fixture(scope="module")
def stranger(tmp_path_factory):
    """The example, running: its address."""
    log = tmp_path_factory.mktemp("stranger") / "log"
    with Server([sys.executable, EXAMPLE, "0"], log, cwd="/") as server:
        yield server.address


@pytest.fixture(scope="module")
def topics(stranger, tmp_path_factory):
    """The recording of a run of the ready experiment against it."""
    return by_topic(run(stranger, tmp_path_factory.mktemp("out")) / "run.mcap")


def run(address, out):
    command = [program("murmuration"), "run", "configs/external-robots.toml"]
    succeed([*command, "--robotsim", f"http://{address}", "--out", out], cwd=ROOT)
    return only_directory(out)


def test_the_example_is_about_sixty_lines_and_needs_grpc_alone():
    code = [line for line in EXAMPLE.read_text().splitlines() if line.strip()]
    assert len(code) <= LINES, f"{len(code)} lines that are not blank"
    required = (EXAMPLE.parent / "requirements.txt").read_text().split()
    assert {name.split("=")[0].split(">")[0] for name in required} == {"grpcio", "grpcio-tools"}


def test_the_robots_move_as_the_example_says(topics):
    """Towards the middle of those they heard, at 1 m/s, no nearer than 1 m. Payloads are positions, three f64."""
    begin = topics["/robotsim/configure/response"][0].message.states
    n = topics["/robotsim/configure/request"][0].message.agent_count
    at, time_ns, given, moved = list(zip(begin.x_m, begin.y_m, strict=True)), 0, None, 0
    for robots, network in zip(topics["/robotsim/step"], topics["/netsim/step"], strict=True):
        period_s = (robots.message.time_ns - time_ns) / 1e9
        reached = list(zip(robots.message.states.x_m, robots.message.states.y_m, strict=True))
        for robot, (was, now) in enumerate(zip(at, reached, strict=True)):
            expected = was
            if given is not None and (heard := heard_by(given, robot, n)):
                data = given.transmissions.payloads.data
                places = [struct.unpack_from("<3d", data, 24 * index) for index in heard]
                middle = [sum(place[axis] for place in places) / len(places) for axis in (0, 1)]
                away_m = math.dist(was, middle)
                way_m = min(period_s, max(0.0, away_m - 1.0))
                if way_m > 0.0:
                    expected = [w + (m - w) * way_m / away_m for w, m in zip(was, middle, strict=True)]
                    moved += 1
            # Rounding in f64 at tens of metres, in another order of operations: below 1e-13 m.
            assert math.dist(now, expected) < 1e-12, f"step {robots.message.step}, robot {robot}"
        at, time_ns, given = reached, robots.message.time_ns, network.message.deliveries
    assert moved > n, "nearly nobody moved, so this showed nothing"


def test_the_page_shows_what_the_run_prints(stranger, tmp_path):
    command = [program("murmuration"), "run", ROOT / "configs/external-robots.toml", "--robotsim", f"http://{stranger}"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    # A run that takes long shows its progress beside the warnings.
    warnings = "".join(line for line in done.stderr.splitlines(keepends=True) if line.startswith("warning: "))
    said = warnings + re.sub(r" simulated in .*", " simulated in …", done.stdout)
    assert f"```text\n{said}```" in (ROOT / "docs/own-simulator.md").read_text(), said


def test_every_digest_follows_from_the_messages(topics):
    for robots, network, barrier in zip(
        topics["/robotsim/step"], topics["/netsim/step"], topics["/barrier"], strict=True
    ):
        at = barrier.message
        assert exchange_digest(robots.message, network.message, []) == at.digest, f"step {at.step}"
    assert topics["/barrier"]


def test_a_second_run_against_the_same_process_is_the_same(stranger, topics, tmp_path):
    again = by_topic(run(stranger, tmp_path) / "run.mcap")
    assert {topic: [entry.data for entry in found] for topic, found in again.items()} == {
        topic: [entry.data for entry in found] for topic, found in topics.items()
    }
