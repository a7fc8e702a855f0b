"""robotsim/examples/python/minimal.py, a robot simulator that shares no code with ours, drives a run."""

import importlib
import struct
import sys

import grpc
import pytest
from conftest import ROOT, only_directory, program, succeed
from hosts import Server
from recording import by_topic, digest, heard_by

EXAMPLE = ROOT / "robotsim/examples/python/minimal.py"
LINES = 70  # "about sixty"; the contract is too hard if this does not do


@pytest.fixture(scope="module")
def stranger(tmp_path_factory):
    """The example, running: its address."""
    log = tmp_path_factory.mktemp("stranger") / "log"
    with Server([sys.executable, "-u", EXAMPLE, "0"], log, cwd="/") as server:
        yield server.address


@pytest.fixture(scope="module")
def topics(stranger, tmp_path_factory):
    """The recording of a run of the ready experiment against it."""
    return by_topic(run(stranger, tmp_path_factory.mktemp("out")) / "run.mcap")


def run(address, out):
    command = [program("orchestrator"), "run", "configs/external-robots.toml"]
    succeed([*command, "--robotsim", f"http://{address}", "--out", out], cwd=ROOT)
    return only_directory(out)


def test_the_example_is_about_sixty_lines_and_needs_grpc_alone():
    code = [line for line in EXAMPLE.read_text().splitlines() if line.strip()]
    assert len(code) <= LINES, f"{len(code)} lines that are not blank"
    required = (EXAMPLE.parent / "requirements.txt").read_text().split()
    assert {name.split("=")[0].split(">")[0] for name in required} == {"grpcio", "grpcio-tools"}


def test_every_digest_follows_from_the_messages(topics):
    given = None
    for robots, network, barrier in zip(
        topics["/robotsim/step"], topics["/netsim/step"], topics["/barrier"], strict=True
    ):
        at = barrier.message
        assert digest(at.step, at.time_ns, robots.message.states, given) == at.digest, f"step {at.step}"
        given = network.message.deliveries
    assert given is not None


def test_a_second_run_against_the_same_process_is_the_same(stranger, topics, tmp_path):
    again = by_topic(run(stranger, tmp_path) / "run.mcap")
    assert {topic: [entry.data for entry in found] for topic, found in again.items()} == {
        topic: [entry.data for entry in found] for topic, found in topics.items()
    }
