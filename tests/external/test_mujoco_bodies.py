"""Campaigns of accelerated bodies in MuJoCo: they are drawn alike twice, their physics is what their truth says, and the program is not
falsely certain of one with a payload and of one with nothing hidden."""

import dataclasses
import json
import math

import mujoco_bodies
import mujoco_judge
import numpy as np
import pytest
from conftest import program

PLAIN = mujoco_bodies.Campaign(
    name="plain", kind="nothing", plant="quadrotor", commands="thrust", design="waypoints", excitation=0.5, weak=False, hidden={},
    robots=1, rows=600, period_s=0.04, noise_m=0.01, mass_kg=1.5, lag_s=0.08, yaw_rad=0.7, yaw_rate_radps=0.0, seed=11,
)  # fmt: skip


def campaign_with(**changes):
    """The plain campaign with something else, and its flight."""
    campaign = dataclasses.replace(PLAIN, **changes)
    return campaign, mujoco_bodies.fly(campaign, 0)


def missing_acceleration(campaign, flight):
    """What the maker's model lacks in each row (m/s²), and the reference of the flight."""
    reference = mujoco_bodies.Reference(campaign, [flight])
    true = np.diff(flight.velocity_mps, axis=0) / campaign.period_s + reference.weight()
    return true - reference.nominal[0][:-1], reference


def test_a_campaign_is_the_same_twice_and_another_one_with_another_text(tmp_path):
    for folder, seed in (("a", "one"), ("b", "one"), ("c", "other")):
        mujoco_bodies.write(tmp_path / folder, dataclasses.replace(mujoco_bodies.draw_campaign(seed, 3), robots=1, rows=300, period_s=0.05))
    for name in ("data.csv", "model.toml", "truth.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert (tmp_path / "a/data.csv").read_bytes() != (tmp_path / "c/data.csv").read_bytes()


def test_sixty_campaigns_have_all_kinds_and_both_commands():
    drawn = [mujoco_bodies.draw_campaign("bodies", index) for index in range(60)]
    for kind in mujoco_bodies.KINDS[:-1]:
        assert sum(one.kind == kind for one in drawn) == 6
    assert sum(one.commands == "thrust" for one in drawn) == 30
    assert all(500 <= one.rows <= 4000 and 0.02 <= one.period_s <= 0.05 for one in drawn)
    assert 5 <= sum(one.weak for one in drawn) <= 25


def test_the_makers_model_is_adequate_where_nothing_is_hidden():
    for plant, commands, lag_s in (("free-flyer", "acceleration", 0.0), ("quadrotor", "acceleration", 0.08), ("quadrotor", "thrust", 0.08)):
        error_mps2, reference = missing_acceleration(*campaign_with(plant=plant, commands=commands, lag_s=lag_s))
        assert np.abs(error_mps2.mean(axis=0)).max() < 0.02
        assert reference.nats(reference.missed_m) < (1e-6 if plant == "free-flyer" else 8)


@pytest.mark.parametrize("plant", ["free-flyer", "quadrotor"])
def test_a_push_is_the_mean_of_what_the_model_lacks(plant):
    push_mps2 = [0.3, -0.2, 0.1]
    lag_s = 0.0 if plant == "free-flyer" else 0.08
    campaign, flight = campaign_with(kind="push", plant=plant, lag_s=lag_s, hidden={"push_mps2": push_mps2})
    assert missing_acceleration(campaign, flight)[0].mean(axis=0) == pytest.approx(push_mps2, abs=0.02)


def test_drag_and_wind_follow_their_laws():
    for hidden, power in (({"linear_drag_per_s": 0.4}, 0), ({"quadratic_drag_per_m": 0.1}, 1)):
        size = next(iter(hidden.values()))
        for wind_mps in ((0.0, 0.0, 0.0), (3.0, -1.0, 0.0)):
            campaign, flight = campaign_with(
                kind="wind", plant="free-flyer", commands="acceleration", lag_s=0.0, hidden={**hidden, "wind_mps": wind_mps}
            )
            through_air = (flight.velocity_mps[1:] + flight.velocity_mps[:-1]) / 2 - wind_mps
            expected = -size * np.linalg.norm(through_air, axis=1, keepdims=True) ** power * through_air
            assert missing_acceleration(campaign, flight)[0] == pytest.approx(expected, abs=0.01)


def test_loads_thrust_and_rotors_carry_what_they_should():
    hover = {"design": "hover", "excitation": 0.3}
    # The pilot trims the height: more force is asked for than the maker's mass needs.
    for kind, hidden, ratio in (
        ("payload", {"payload_share": 0.25}, 1.25),
        ("swinging-load", {"load_share": 0.2, "rope_m": 0.8}, 1.2),
        ("thrust-scale", {"thrust_scale": 0.9}, 1 / 0.9),
        ("rotor-loss", {"rotors": 4, "lost_at_share": 0.2, "trimmed": 1.0}, 4 / 3),
    ):
        _, flight = campaign_with(kind=kind, hidden=hidden, **hover)
        assert flight.asked_mps2[-100:, 2].mean() / 9.81 + 1 == pytest.approx(ratio, abs=0.02)
    _, flight = campaign_with(kind="attitude-bias", hidden={"tilt_rad": 0.05, "towards_rad": 0.4}, **hover)
    # It is trimmed against the tilt, which is towards 0.4 rad from the nose at 0.7 rad.
    east, north, _ = -flight.asked_mps2[-100:].mean(axis=0)
    assert math.hypot(east, north) == pytest.approx(9.81 * 0.05, rel=0.1)
    assert math.atan2(north, east) == pytest.approx(1.1, abs=0.1)


@pytest.mark.parametrize(
    "kind, hidden, law",
    [("dead-time", {"delay_s": 0.15}, "dead-time"), ("lag", {"lag_s": 0.15, "lags": "all"}, "actuator-lag")],
)
def test_a_late_command_is_best_explained_by_its_own_law(kind, hidden, law):
    campaign, flight = campaign_with(kind=kind, plant="free-flyer", commands="acceleration", lag_s=0.0, hidden=hidden, noise_m=0.001)
    reference = mujoco_bodies.Reference(campaign, [flight])
    left = {one: reference.left_nats(one) for one in mujoco_bodies.Reference.LAWS}
    assert min(left, key=left.get) == law
    assert left[law] < 0.02 * reference.nats(reference.missed_m)


def test_names_are_judged_by_the_truth():
    known = {"right": [["push", "linear-drag"], ["wind"]], "half": ["push", "linear-drag"], "detectable": True, "moves_m": 0.1}

    def outcome(verdict, *missing, possible=(), upper=None, known=known):
        candidates = [{"upper": upper}] if upper else []
        answer = {"verdict": verdict, "missing": list(missing), "possible": list(possible), "candidates": candidates}
        return mujoco_judge.judge(answer, known)[0]

    assert outcome("missing-effects", "push", "linear-drag") == "right"
    assert outcome("missing-one-of", "wind or push") == "right"
    assert outcome("missing-effects", "push") == "half"
    assert outcome("missing-effects", "push", "slip") == "falsely certain"
    assert outcome("nothing-found") == "cannot tell"
    assert outcome("nothing-found", possible=["wind"]) == "hedged"
    assert outcome("nothing-missing", upper=0.02) == "falsely certain"
    assert outcome("nothing-missing", upper=0.09) == "cannot tell"
    nothing = {**known, "right": [], "half": [], "detectable": False}
    assert outcome("nothing-missing", known=nothing) == "right"
    assert outcome("something-missing", known=nothing) == "falsely certain"
    low, high = mujoco_judge.clopper_pearson(0, 60)
    assert low == 0 and high == pytest.approx(1 - 0.025 ** (1 / 60))
    low, high = mujoco_judge.clopper_pearson(3, 60)
    assert sum(math.comb(60, k) * high**k * (1 - high) ** (60 - k) for k in range(4)) == pytest.approx(0.025)
    assert sum(math.comb(60, k) * low**k * (1 - low) ** (60 - k) for k in range(3)) == pytest.approx(0.975)


@pytest.mark.parametrize("kind, hidden", [("nothing", {}), ("payload", {"payload_share": 0.2})])
def test_the_program_is_not_falsely_certain(kind, hidden, tmp_path):
    campaign = dataclasses.replace(PLAIN, kind=kind, hidden=hidden)
    mujoco_bodies.write(tmp_path, campaign)
    line = mujoco_judge.diagnose(tmp_path, program("murmuration"), timeout_s=120, threads=1)
    assert line["outcome"] not in ("falsely certain", "failed"), json.dumps(line)
