"""run.mcap through the `mcap` package: is everything there, in order, and do the digests follow from the messages?"""

import json
import tomllib

import pytest
from conftest import ROOT, only_directory, program, succeed
from full_digest import exchange_digest
from recording import by_topic, heard_by, same_recording

TYPES = {
    "/robotsim/configure/request": "cosim.v1.RobotSimServiceConfigureRequest",
    "/robotsim/configure/response": "cosim.v1.RobotSimServiceConfigureResponse",
    "/netsim/configure/request": "cosim.v1.NetSimServiceConfigureRequest",
    "/netsim/configure/response": "cosim.v1.NetSimServiceConfigureResponse",
    "/robotsim/step": "cosim.v1.RobotSimServiceStepResponse",
    "/netsim/step": "cosim.v1.NetSimServiceStepResponse",
    "/barrier": "cosim.v1.RobotSimServiceBarrierResponse",
}


@pytest.fixture(scope="module")
def topics(flocking):
    return by_topic(flocking / "run.mcap")


def only(topics, topic):
    assert len(topics[topic]) == 1
    return topics[topic][0].message


def test_every_topic_is_there_with_its_type(topics):
    assert {topic: {entry.type for entry in found} for topic, found in topics.items()} == {
        topic: {name} for topic, name in TYPES.items()
    }


def test_the_recording_has_one_configuration_and_every_step_once(topics):
    request = only(topics, "/netsim/configure/request")
    config = tomllib.loads((ROOT / "configs/flocking.toml").read_text())
    expected = config["experiment"]["duration_s"] * 1e9 / request.step_ns
    assert expected == round(expected), "the ready experiment is a whole number of periods"
    for topic in ("/robotsim/step", "/netsim/step", "/barrier"):
        messages = [entry.message for entry in topics[topic]]
        assert [message.step for message in messages] == list(range(1, round(expected) + 1)), topic
        assert [message.time_ns for message in messages] == [
            step * request.step_ns for step in range(1, len(messages) + 1)
        ], topic


def test_log_times_are_simulated_times_and_never_go_back(topics):
    for topic, found in topics.items():
        times = [entry.log_time for entry in found]
        assert times == sorted(times), topic
        for entry in found:
            assert entry.publish_time == entry.log_time
            assert entry.log_time == getattr(entry.message, "time_ns", 0), topic


def test_both_sides_were_told_the_same_experiment(topics):
    robots = only(topics, "/robotsim/configure/request")
    network = only(topics, "/netsim/configure/request")
    for name in ("seed", "agent_count", "step_ns", "coupling", "site_toml"):
        assert getattr(robots, name) == getattr(network, name), name
    tomllib.loads(only(topics, "/robotsim/configure/response").effective_config_toml)
    tomllib.loads(only(topics, "/netsim/configure/response").effective_config_toml)


# So few hear each other here that lists of indices are shorter than bitmaps.
SPARSE = ("experiment.agents=200", "netsim.phy.propagation=unit-disk", "netsim.phy.radius_m=3.0")


@pytest.mark.parametrize(
    ("coupling", "is_bitmap", "experiment"),
    [
        # Numbers of couplings as in the contract.
        (1, True, ("flocking",)),
        (2, True, ("shadowing",)),
        (3, True, ("packet-control",)),
        (1, False, ("flocking", *SPARSE)),
        (2, False, ("flocking", *SPARSE, "experiment.coupling=parallel")),
    ],
)
def test_every_digest_follows_from_the_messages_by_the_rule_in_the_contract(
    result_of, coupling, is_bitmap, experiment
):
    topics = by_topic(result_of(*experiment) / "run.mcap")
    assert only(topics, "/netsim/configure/request").coupling == coupling
    heard = [entry.message.deliveries for entry in topics["/netsim/step"]]
    assert any(deliveries.heard_bitmap for deliveries in heard) == is_bitmap
    assert any(deliveries.heard for deliveries in heard) != is_bitmap
    ordered = {entry.message.SerializeToString() for entry in topics.get("/netsim/command", [])}
    assert not ordered, "no experiment here has a timeline"
    for robots, network, barrier in zip(
        topics["/robotsim/step"], topics["/netsim/step"], topics["/barrier"], strict=True
    ):
        at = barrier.message
        assert exchange_digest(robots.message, network.message, []) == at.digest, f"step {at.step}"


def test_columns_have_one_entry_per_agent_and_deliveries_point_at_transmissions(topics):
    n = only(topics, "/netsim/configure/request").agent_count
    heard_anything = 0
    for entry in topics["/robotsim/step"]:
        states = entry.message.states
        assert len(states.alive) == (n + 7) // 8
        assert len(states.x_m) == len(states.y_m) == len(states.z_m) == n
        assert len(entry.message.payloads.length_bytes) == n
        assert sum(entry.message.payloads.length_bytes) == len(entry.message.payloads.data)
    for entry in topics["/netsim/step"]:
        deliveries = entry.message.deliveries
        sent = deliveries.transmissions
        assert len(sent.sender) == len(sent.sent_ns) == len(sent.end_ns) == len(sent.payloads.length_bytes)
        order = list(zip(sent.sent_ns, sent.sender, strict=True))
        assert order == sorted(order)
        for receiver in range(n):
            heard = heard_by(deliveries, receiver, n)
            assert heard == sorted(set(heard))
            assert all(index < len(sent.sender) for index in heard)
            assert all(sent.sender[index] != receiver for index in heard), "nobody hears itself"
            heard_anything += len(heard)
    assert heard_anything > 0


def test_the_payloads_on_the_air_are_those_the_robots_gave(topics):
    for robots, network in zip(topics["/robotsim/step"], topics["/netsim/step"], strict=True):
        said = split(robots.message.payloads)
        sent = network.message.deliveries.transmissions
        for sender, payload in zip(sent.sender, split(sent.payloads), strict=True):
            assert payload == said[sender], f"step {robots.message.step}, agent {sender}"


def split(payloads):
    """The payloads, one by one."""
    parts, start = [], 0
    for length in payloads.length_bytes:
        parts.append(payloads.data[start : start + length])
        start += length
    return parts


def test_the_summary_agrees_with_the_recording(flocking, topics):
    summary = json.loads((flocking / "summary.json").read_text(), parse_constant=refuse_constant)
    assert summary["name"] == "flocking"
    assert summary["status"] == "complete"
    assert summary["steps"] == len(topics["/barrier"])
    assert summary["seed"] == only(topics, "/netsim/configure/request").seed
    assert summary["simulated_s"] == pytest.approx(topics["/barrier"][-1].message.time_ns / 1e9, abs=1e-9)


def refuse_constant(name):
    raise AssertionError(f"summary.json holds {name}, which is not JSON")


def test_provenance_is_json_and_the_effective_configuration_toml(flocking):
    json.loads((flocking / "provenance.json").read_text(), parse_constant=refuse_constant)
    effective = tomllib.loads((flocking / "config.toml").read_text())
    assert {"experiment", "netsim", "robotsim", "output"} <= effective.keys()


def test_the_effective_configuration_repeats_the_run(flocking, tmp_path):
    succeed([program("murmuration"), "run", flocking / "config.toml", "--out", tmp_path], cwd=tmp_path)
    again = only_directory(tmp_path)

    same_recording(flocking, again)
    assert (again / "config.toml").read_bytes() == (flocking / "config.toml").read_bytes()


def test_another_seed_gives_another_recording(flocking, tmp_path):
    command = [program("murmuration"), "run", "configs/flocking.toml", "--seed", "2", "--out", tmp_path]
    succeed(command, cwd=ROOT)
    ours, theirs = (by_topic(path / "run.mcap")["/barrier"] for path in (flocking, only_directory(tmp_path)))
    assert len(ours) == len(theirs)
    assert all(one.message.digest != other.message.digest for one, other in zip(ours, theirs, strict=True))
