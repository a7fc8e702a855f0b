"""Robots of MuJoCo, an engine that shares nothing with ours, are measured and diagnosed: effects hidden in their MJCF are named, one
that no catalogue has is called structure, and MuJoCo with the truth lacks nothing of what it measured itself.

docs/validation.md has the outcomes of many seeds; mujoco_loop.py reproduces them.
"""

import json

import numpy as np
import pytest
from conftest import program, succeed
from mujoco_loop import OWN, diagnosed, judged, served, write
from mujoco_truth import PLATFORM_KG, PLATFORM_KV, Robot, Truth, drawn

NOTHING = ("nothing-missing", "nothing-found")


@pytest.fixture(scope="module")
def mujoco(tmp_path_factory):
    """The robots of mujoco_truth.py as a simulator that predicts: its URL."""
    with served(tmp_path_factory.mktemp("mujoco") / "log") as server:
        yield f"http://{server.address}"


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Writes the campaign of a truth; returns its folder."""

    def written(truth, seed):
        folder = tmp_path_factory.mktemp(truth.robot)
        write(folder, truth, seed)
        return folder

    return written


def fitted(answer, effect, parameter):
    """The value of a parameter of an accepted effect."""
    (found,) = [one for one in answer["candidates"] if one["effect"] == effect and one["accepted"]]
    return found["parameters"][parameter]["value"]


def test_it_keeps_the_promises_about_predictions(mujoco, tmp_path):
    (tmp_path / "truth.toml").write_text(drawn("rover", 1).toml().replace("[robotsim]\n", ""))
    command = [program("murmuration"), "conformance", "robotsim", mujoco, "--config", "truth.toml", "--json", "found.json"]
    succeed(command, cwd=tmp_path)
    found = json.loads((tmp_path / "found.json").read_text())
    about = [one for one in found["findings"] if "Predict " in one["promise"] or "window whose start" in one["promise"]]
    assert [one["verdict"] for one in about] == ["kept"] * 3, found


def test_a_rover_with_nothing_hidden_has_the_lag_and_the_creep_of_its_mjcf(campaign):
    """A unicycle has neither motors nor tyres; both numbers are held against the state of MuJoCo."""
    answer = diagnosed(campaign(Truth("rover", {}, {}, ""), 1), "built-in")
    # A lag and a dead time look alike in turns, and what no effect of the catalogue has is left: not all of it is certain.
    own = OWN["rover"]
    assert answer["missing"] and all(own & set(names.split(" or ")) for names in answer["missing"]), answer["sentence"]
    assert own <= set(" or ".join(answer["missing"] + answer.get("possible", [])).split(" or ")), answer["sentence"]
    robot = Robot({"robot": "rover"})
    # From rest: the time in which a speed that is asked for is reached but for a part of 1 / e.
    robot.begin((0, 0, 0), (0, 0), (0, 0))
    robot.command((0.2, 0.0))
    begun_s = robot.data.time
    while robot.data.qvel[0] < 0.2 * (1 - np.exp(-1)):
        robot.run(0.004)
    lag_s = robot.data.time - begun_s
    value = fitted(answer, "actuator-lag", "tau_s")
    assert abs(value - lag_s) < 0.01, (value, lag_s)
    # In a turn: sideways velocity per speed times yaw rate.
    robot.begin((0, 0, 0), (1.0, 1.0), (0, 0))
    heading_rad = robot.pose()[2]
    sideways_mps = robot.data.qvel[1] * np.cos(heading_rad) - robot.data.qvel[0] * np.sin(heading_rad)
    value = fitted(answer, "yaw-coupling", "gain")
    assert sideways_mps < -0.01 and abs(value - sideways_mps) < 0.001, (value, sideways_mps)


def test_the_lag_of_a_platform_is_its_mass_by_the_gain_of_its_motors(campaign):
    answer = diagnosed(campaign(Truth("platform", {}, {}, ""), 1), "built-in")
    assert answer["missing"] == ["actuator-lag"], answer["sentence"]
    value = fitted(answer, "actuator-lag", "tau_s")
    assert abs(value - PLATFORM_KG / PLATFORM_KV) < 0.001


@pytest.mark.parametrize("seed, structure", [(2, ("x_m", "y_m")), (1, None)])
def test_what_is_hidden_in_a_platform_is_named_and_nothing_else(campaign, mujoco, seed, structure):
    """Seed 2: a top speed and a delay, beside a spring to the middle, which is structure over the place. Seed 1: drag of bearings and of
    water, beside a load that sloshes."""
    truth = drawn("platform", seed)
    folder = campaign(truth, seed)
    found = judged(diagnosed(folder, "built-in"), truth, OWN["platform"])
    assert found["right"] and not found["wrong"], found
    if structure:
        assert not found["missed"] and set(found["structure"]) & set(structure), found
    # The same campaign, held against MuJoCo with the truth.
    truthful = diagnosed(folder, "truth", "--robotsim", mujoco)
    assert truthful["verdict"] in NOTHING and not truthful["missing"] and not truthful["unexplained"], truthful["sentence"]


def test_mujoco_lacks_the_drag_of_bearings_that_it_was_not_told_of(campaign, mujoco):
    """The base model is MuJoCo itself, with mass and motors, in place of a point mass."""
    truth = Truth("platform", {"bearing_drag": 0.15}, {"bearing_drag": {"slip"}}, "")
    folder = campaign(truth, 3)
    nominal = diagnosed(folder, "nominal", "--robotsim", mujoco)
    assert nominal["missing"][0] == "slip", nominal["sentence"]
    # The servo gives way to the drag: gain / (gain + drag).
    assert abs(fitted(nominal, "slip", "scale") - 1 / 1.15) < 0.005
    assert diagnosed(folder, "truth", "--robotsim", mujoco)["verdict"] in NOTHING


def test_mujoco_lacks_nothing_of_a_rover_that_it_simulates_as_it_was(campaign, mujoco):
    truth = drawn("rover", 1)
    answer = diagnosed(campaign(truth, 1), "truth", "--robotsim", mujoco)
    assert answer["verdict"] in NOTHING and not answer["missing"] and not answer["unexplained"], answer["sentence"]
