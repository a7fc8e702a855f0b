"""The radio alone, and environments over it: run against whatever `import murmuration` finds."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from pettingzoo.test import parallel_api_test, parallel_seed_test

import murmuration
from murmuration import Radio
from murmuration._bodies import Bodies
from murmuration._child import Child
from murmuration._contract import common_pb2, robotsim_pb2
from murmuration._metrics import FIGURES
from murmuration._observation import Layout, Observer
from murmuration.env import OF_ROBOTS, evaluate, parallel_env
from murmuration.robots import Heard

DISK = {"phy": {"propagation": "unit-disk", "radius_m": 5.0}}
EXPERIMENT = {"name": "small", "seed": 1, "agents": 5, "duration_s": 2.0, "control_period": {"rate_hz": 10.0}}
CONFIG = {
    "experiment": EXPERIMENT,
    "robotsim": {
        "scenario": {"kind": "square", "side_m": 8.0},
        "dynamics": {"kind": "double-integrator", "speed_cap_mps": 2.0, "acceleration_cap_mps2": 4.0},
    },
    "netsim": DISK,
    "output": {"report": False},
}
MESH = {
    "mode": "6tisch", "phy": {"propagation": "experimental-randomness"}, "sf": {"kind": "rrsf"}, "swarm": {"transport": "own-cell"},
    "join": {"secure": False}, "rpl": {"dao_ack": False},
}  # fmt: skip
OVER = {"propagation-only": CONFIG, "6tisch": {**CONFIG, "netsim": MESH}}


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)


def places(n, seed=1, side_m=8.0):
    return np.random.default_rng(seed).uniform(0.0, side_m, (n, 2))


def disk(n=6, **settings):
    return Radio(DISK, n=n, seed=1, period_s=0.1, **settings)


def drifting(env):
    """A policy without any randomness that uses all that an observation has."""

    def policy(observations):
        seen = env.layout.split(np.stack(list(observations.values())).astype(float))
        mask = seen["neighbour_mask"][:, :, None]
        way = 1.02 * seen["velocity_mps"] + 0.2 * (mask * seen["neighbour_position_m"]).sum(axis=1)
        way += 0.1 * (mask * seen["neighbour_velocity_mps"]).sum(axis=1) - 0.01 * seen["position_m"]
        way += (seen["neighbour_age_s"].sum(axis=1) - 1e-4 * seen["neighbour_rssi_dbm"].sum(axis=1) + seen["n_heard"])[:, None] / 20
        return dict(zip(observations, way))

    return policy


def flown(env, seed, policy=None):
    """Observations, and states, of an episode."""
    observations, _ = env.reset(seed=seed)
    policy, seen, states = policy or drifting(env), [], []
    while env.agents:
        seen.append(np.stack(list(observations.values())))
        observations, _, _, _, infos = env.step(policy(observations))
        states.append(env.state())
    return np.array(seen), np.array(states), infos["robot_0"]["task"]


# The radio.


def test_who_is_within_the_radius_is_heard_with_what_it_said():
    position_m = places(6)
    with disk() as radio:
        assert radio.formation is None and radio.formed
        radio.step(0.1, position_m)
        moved_m = position_m + [[0.1, -0.2]]
        heard = radio.step(0.1, moved_m)
        assert radio.time_s == pytest.approx(0.2)
    distance_m = np.linalg.norm(moved_m[:, None] - moved_m, axis=2)
    expected = (distance_m <= 5.0) & ~np.eye(6, dtype=bool)
    found = np.zeros((6, 6), dtype=bool)
    found[heard.receiver, heard.sender] = True
    assert np.array_equal(found, expected) and 0 < expected.sum() < 30
    assert np.allclose(heard.position_m[:, :2], moved_m[heard.sender], rtol=0, atol=0)
    assert np.allclose(heard.velocity_mps[:, :2], [[1.0, -2.0]], rtol=0, atol=1e-12)
    # Robot i sends in slot i of ten, each 10 ms.
    assert np.allclose(heard.age_s, 0.1 - 0.01 * heard.sender, rtol=0, atol=1e-12)
    assert np.all((heard.rssi_dbm < -20) & (heard.rssi_dbm > -120))


def test_payloads_of_ones_own_arrive_and_empty_ones_say_nothing():
    said = [b"", b"one", b"two", b"", b"four", b"five"]
    with disk() as radio:
        heard = radio.step(0.1, np.zeros((6, 3)) + np.arange(6)[:, None] * 0.1, said)
    assert {said[sender] for sender in heard.sender} == set(heard.payload) == {b"one", b"two", b"four", b"five"}
    assert heard.of(1).payload == [b"two", b"four", b"five"]


def test_a_snapshot_goes_on_as_if_it_had_never_stopped():
    config = {"phy": {"propagation": "experimental-randomness"}}
    position_m = places(8, side_m=60.0)
    with Radio(config, n=8, seed=3, period_s=0.1) as radio:
        radio.step(0.1, position_m)
        kept = radio.snapshot()
        first = [radio.step(0.1, position_m) for _ in range(5)]
        radio.configure(config, n=4, seed=9, period_s=0.2)
        radio.restore(kept)
        assert radio.time_s == pytest.approx(0.1)
        again = [radio.step(0.1, position_m) for _ in range(5)]
        radio.restore(kept, seed=4)
        other = [radio.step(0.1, position_m) for _ in range(5)]
    for one, two in zip(first, again):
        assert np.array_equal(one.receiver, two.receiver) and np.array_equal(one.rssi_dbm, two.rssi_dbm)
    assert [len(one.receiver) for one in first] != [len(two.receiver) for two in other]


@pytest.mark.parametrize(
    "config, text",
    [
        ({"phy": {"propagaton": "friis"}}, "is not a known key (nearest valid: propagation)"),
        ('phy = "friis', "netsim:"),
        ({"phy": {"propagation": "trace", "file": "nowhere.k7"}}, "nowhere.k7: cannot be read"),
    ],
)
def test_what_is_wrong_with_a_configuration_is_raised(config, text):
    with pytest.raises(murmuration.InvalidInput) as error:
        Radio(config, n=2, seed=1, period_s=0.1)
    assert text in str(error.value)


def test_what_is_wrong_with_a_step_is_raised_and_changes_nothing():
    with disk() as radio:
        for call, text in (
            (lambda: radio.step(0.1, np.zeros((5, 2))), "position_m: must have the shape (6, 2) or (6, 3), got (5, 2)"),
            (lambda: radio.step(0.1, np.full((6, 2), np.nan)), "for robot 0"),
            (lambda: radio.step(0.0, np.zeros((6, 2))), "dt_s: must be positive"),
            (lambda: radio.step(0.1, np.zeros((6, 2)), [b""]), "payloads: must be one for each of 6 robots, got 1"),
            (lambda: radio.step(0.1, np.full((6, 2), 1e300)), "x_m"),
        ):
            with pytest.raises(murmuration.InvalidInput) as error:
                call()
            assert text in str(error.value)
        assert radio.time_s == 0.0
        assert len(radio.step(0.1, places(6)).receiver) > 0


def test_a_simulator_that_dies_or_hangs_is_named_within_seconds():
    with disk() as radio:
        radio.step(0.1, places(6))
        radio._child.process.kill()
        begun = time.monotonic()
        with pytest.raises(murmuration.MurmurationError, match=r"netsim \(process \d+\) ended during Step: killed by signal 9"):
            radio.step(0.1, places(6))
        assert time.monotonic() - begun < 60.0
    with disk() as radio:
        radio.step(0.1, places(6))
        radio._child.deadline_s = 1.0
        os.kill(radio._child.process.pid, signal.SIGSTOP)
        try:
            with pytest.raises(murmuration.MurmurationError, match="did not answer Step within 1 s"):
                radio.step(0.1, places(6))
        finally:
            os.kill(radio._child.process.pid, signal.SIGCONT)
    with pytest.raises(murmuration.MurmurationError, match="netsim is closed"):
        radio.step(0.1, places(6))


def test_the_simulator_ends_with_a_killed_python(tmp_path):
    script = tmp_path / "killed.py"
    script.write_text(
        "import time, murmuration\n"
        "radio = murmuration.Radio(n=2, seed=1, period_s=0.1)\n"
        "print(radio._child.process.pid, radio._child._folder, flush=True)\ntime.sleep(60)\n"
    )
    child = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    pid, folder = child.stdout.readline().split()
    child.kill()
    child.wait()
    deadline = time.monotonic() + 60
    while Path(f"/proc/{pid}").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not Path(f"/proc/{pid}").exists()
    assert not (Path(folder) / "netsim").exists()


def test_a_network_that_does_not_form_names_the_missing_motes():
    with Radio({**MESH, "phy": {"propagation": "unit-disk", "radius_m": 5.0}}, n=3, seed=1, period_s=0.03) as radio:
        assert not radio.formed
        with pytest.raises(murmuration.MurmurationError, match="had not formed after 20 s") as error:
            radio.form(np.array([[0.0, 0.0], [1.0, 0.0], [500.0, 0.0]]), limit_s=20.0)
        assert "2" in str(error.value).splitlines()[-1]


# How robots move.


@pytest.mark.parametrize(
    "dynamics, action",
    [
        ({"kind": "point-mass", "speed_cap_mps": 1.5}, "velocity"),
        ({"kind": "point-mass", "speed_cap_mps": 1.5, "cap": "axis"}, "velocity"),
        ({"kind": "double-integrator", "speed_cap_mps": 2.0, "acceleration_cap_mps2": 3.0}, "velocity"),
        ({"kind": "double-integrator", "speed_cap_mps": 1e3, "acceleration_cap_mps2": 3.0}, "acceleration"),
        ({"kind": "unicycle", "speed_cap_mps": 2.0}, "velocity"),
    ],
)
def test_robots_move_as_the_robot_simulator_moves_them(dynamics, action):
    n, dt_s, draws = 7, 0.1, np.random.default_rng(2)
    section = {"scenario": {"kind": "disc", "density_per_m2": 0.2}, "dynamics": dynamics}
    bodies = Bodies(section, {}, n=n, step_ns=100_000_000, folder=Path(), action=action)
    judge = Child("robotsim", robotsim_pb2)
    try:
        bodies.reset(5)
        request = type(bodies._request).FromString(bodies._request.SerializeToString())
        judge.call("Configure", request)
        own_mps = np.zeros((n, 3))
        for step in range(1, 41):
            asked = draws.normal(0.0, 2.5, (n, 3)) * ([1.0, 1.0, 0.0] if dynamics["kind"] == "unicycle" else 1.0)
            bodies.move(dt_s, asked)
            # The contract orders velocities: an acceleration is the velocity that it leads to within the step.
            velocity_mps = asked if action == "velocity" else own_mps + asked * dt_s
            orders = [
                common_pb2.AgentCommand(agent=agent, source="test", velocity=common_pb2.AgentCommand.Velocity(vx_mps=x, vy_mps=y, vz_mps=z))
                for agent, (x, y, z) in enumerate(velocity_mps.tolist())
            ]
            until_ns = step * 100_000_000
            states = judge.call("Step", robotsim_pb2.RobotSimServiceStepRequest(step=step, until_ns=until_ns, commands=orders)).states
            reached_m = np.column_stack([states.x_m, states.y_m, states.z_m])
            moved_mps = np.column_stack([states.vx_mps, states.vy_mps, states.vz_mps])
            own_mps = 2.0 * moved_mps - own_mps
            assert np.abs(bodies.position_m - reached_m).max() < 1e-9
            assert np.abs(bodies.velocity_mps - moved_mps).max() < 1e-9
        assert np.linalg.norm(bodies.position_m, axis=1).max() > 1.0
    finally:
        judge.close()
        bodies.close()


@pytest.mark.parametrize(
    "robotsim, settings, text",
    [
        ({"dynamics": {"kind": "point-mass"}}, {"action": "acceleration"}, 'needs robotsim.dynamics.kind = "double-integrator"'),
        ({}, {"action": "force"}, 'must be "velocity" or "acceleration"'),
        ({"localization": {"sd_m": 0.1}}, {}, "robotsim.localization: is not supported in an environment"),
        ({"knowledge": "truth"}, {}, 'robotsim.knowledge: must be "heard"'),
        ({}, {"reward": "happiness"}, "'happiness' is not a figure of a task; there are flock_speed_mps"),
        ({}, {"neighbours": 0}, "neighbours: must be at least 1"),
        ({}, {"netsim__phy__propagaton": "friis"}, "there is no key netsim__phy__propagaton; the nearest is netsim__phy__propagation='friis'"),
        ({}, {"experiment__coupling": "parallel"}, 'must be "sequential"'),
    ],
)
def test_what_an_environment_cannot_do_is_raised(robotsim, settings, text):
    with pytest.raises(murmuration.InvalidInput) as error:
        parallel_env({**CONFIG, "robotsim": {**CONFIG["robotsim"], **robotsim}}, **settings)
    assert text in str(error.value)


def test_figures_have_short_names_and_paths_too():
    names = ["flock_speed_mps", "flock_speed", "task.flock_speed_mps"]
    env = parallel_env(CONFIG, reward="polarisation", figures=names)
    _, _, task = flown(env, seed=7)
    env.close()
    assert task["flock_speed"] == task["task.flock_speed_mps"] == task["flock_speed_mps"] > 0
    with pytest.raises(murmuration.InvalidInput, match="'pdr' is not a figure of a task"):
        parallel_env(CONFIG, figures=["pdr"])


# What agents observe.


def heard_of(n, pairs):
    """Deliveries by hand: receiver, sender, x, y, age."""
    receiver, sender, x_m, y_m, age_s = (np.array(column) for column in zip(*pairs))
    position_m = np.column_stack([x_m, y_m, 0.0 * x_m])
    return Heard(n, receiver, sender, position_m, 10.0 * position_m, age_s, -50.0 - age_s, [])


def test_the_nearest_take_the_places_and_the_last_message_counts():
    layout = Layout(2, 2)
    observer = Observer(4, layout)
    position_m = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    heard = heard_of(4, [(0, 1, 9.0, 0.0, 0.09), (0, 1, 3.0, 0.0, 0.03), (0, 2, 0.0, 2.0, 0.05), (0, 3, 4.0, 0.0, 0.01), (1, 0, 1.0, 0.0, 0.02)])
    seen = layout.split(observer.observe(0.1, position_m, np.ones((4, 3)), heard, None))
    assert seen["n_heard"].tolist() == [3, 1, 0, 0] and seen["joined"].tolist() == [1, 1, 1, 1]
    assert seen["neighbour_mask"].tolist() == [[1, 1], [1, 0], [0, 0], [0, 0]]
    assert seen["neighbour_position_m"].tolist()[:2] == [[[0, 2], [3, 0]], [[0, -1], [0, 0]]]
    assert seen["neighbour_velocity_mps"].tolist()[:2] == [[[0, 20], [30, 0]], [[10, 0], [0, 0]]]
    assert np.allclose(seen["neighbour_age_s"][:2], [[0.05, 0.03], [0.02, 0.0]])
    assert np.allclose(seen["neighbour_rssi_dbm"][:2], [[-50.05, -50.03], [-50.02, 0.0]])
    # Without memory nobody is known in a period of silence.
    assert not layout.split(observer.observe(0.1, position_m, np.ones((4, 3)), None, None))["neighbour_mask"].any()


def test_memory_keeps_those_who_were_heard_and_moves_them_on():
    layout = Layout(2, 2)
    observer = Observer(3, layout, keep_s=0.2)
    here_m, still = np.zeros((3, 3)), np.zeros((3, 3))
    observer.observe(0.1, here_m, still, heard_of(3, [(0, 1, 1.0, 0.0, 0.04)]), None)
    for k, heard in enumerate([heard_of(3, [(0, 2, 0.5, 0.0, 0.01)]), None]):
        seen = layout.split(observer.observe(0.1, here_m, still, heard, None))
    assert seen["neighbour_mask"].tolist() == [[1, 1], [0, 0], [0, 0]] and seen["n_heard"].tolist() == [0, 0, 0]
    # 2 was at 0.5 m with 5 m/s, 0.1 s ago; 1 at 1 m with 10 m/s, 0.2 s ago.
    assert np.allclose(seen["neighbour_position_m"][0], [[1.0, 0.0], [3.0, 0.0]])
    assert np.allclose(seen["neighbour_age_s"][0], [0.11, 0.24])
    seen = layout.split(observer.observe(0.1, here_m, still, heard_of(3, [(0, 2, 0.7, 0.0, 0.02)]), None))
    assert seen["neighbour_mask"][0].tolist() == [1, 0] and np.allclose(seen["neighbour_position_m"][0, 0], [0.7, 0.0])


def test_many_robots_are_sorted_as_few_are():
    draws = np.random.default_rng(3)
    n = 120
    receiver, sender = np.nonzero(draws.random((n, n)) < 0.5)
    position_m = np.column_stack([draws.uniform(0, 50, (n, 2)), np.zeros(n)])
    heard = Heard(n, receiver, sender, position_m[sender], position_m[sender], sender / 1e3, -sender / 1.0, [])
    layout = Layout(5, 2)
    seen = layout.split(Observer(n, layout).observe(0.1, position_m, position_m, heard, None))
    for robot in range(n):
        others = [one for one in sender[receiver == robot] if one != robot]
        nearest = sorted(others, key=lambda one: np.linalg.norm(position_m[one] - position_m[robot]))[:5]
        assert np.allclose(seen["neighbour_age_s"][robot], np.array(nearest) / 1e3)


# Environments.


@pytest.mark.parametrize("network", OVER)
def test_pettingzoo_accepts_it(network):
    env = parallel_env(OVER[network])
    parallel_api_test(env, num_cycles=50)
    env.close()
    made = []

    def make():
        made.append(parallel_env(OVER[network]))
        return made[-1]

    parallel_seed_test(make, num_cycles=10)
    for one in made:
        one.close()


@pytest.mark.parametrize("dynamics, action", [("point-mass", "velocity"), ("double-integrator", "acceleration"), ("unicycle", "velocity")])
def test_evaluation_is_the_same_flight_recorded(tmp_path, dynamics, action):
    robotsim = {**CONFIG["robotsim"], "dynamics": {"kind": dynamics, "speed_cap_mps": 2.0}, "memory": {"keep_s": 0.3}}
    config = {**CONFIG, "robotsim": robotsim}
    env = parallel_env(config, figures=list(FIGURES), action=action, neighbours=3)
    seen, states, task = flown(env, seed=7)
    observed, policy = [], drifting(env)

    def watched(observations):
        observed.append(np.stack(list(observations.values())))
        return policy(observations)

    run = evaluate(config, watched, seed=7, figures=OF_ROBOTS, action=action, neighbours=3, out=tmp_path)
    env.close()
    assert len(seen) == run.summary["steps"] == 20
    assert np.abs(seen - np.array(observed)).max() < 1e-9
    recorded = run.steps.filter(run.steps["step"] > 0).sort(["step", "agent"])
    columns = ["x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps"]
    assert np.abs(states.reshape(-1, 6) - recorded.select(columns).to_numpy()).max() < 1e-9
    assert states[-1, :, :2].std() > 0.5
    for name, value in task.items():
        assert run.summary["task"][name] == pytest.approx(value, rel=1e-9, abs=1e-12), name
    assert run.summary["seed"] == 7


def test_a_fault_of_the_policy_shows_its_traceback(tmp_path):
    def policy(observations):
        raise RuntimeError("no idea")

    with pytest.raises(murmuration.MurmurationError, match='raise RuntimeError\\("no idea"\\)'):
        evaluate(CONFIG, policy, out=tmp_path)


def test_resets_depend_on_their_seed_alone():
    config = {**CONFIG, "netsim": {"phy": {"propagation": "experimental-randomness"}}}
    env, other = parallel_env(config), parallel_env(config)
    first, _, _ = flown(env, seed=3)
    between, _, _ = flown(env, seed=4)
    again, _, _ = flown(env, seed=3)
    alone, _, _ = flown(other, seed=3)
    assert np.array_equal(first, again) and np.array_equal(first, alone) and not np.array_equal(first, between)
    # Without a seed every episode is another one, the same ones after the same seed.
    unseeded = [flown(env, seed=None)[0] for _ in range(2)]
    assert not np.array_equal(*unseeded)
    assert np.array_equal(flown(other, seed=None)[0], unseeded[0])
    env.close()
    other.close()


def test_a_formed_network_is_restored_with_another_seed():
    env = parallel_env(OVER["6tisch"])
    first, _, _ = flown(env, seed=3)
    formed_s = env._radio.time_s - 2.0
    assert env._radio.formed and formed_s > 10.0
    fields = env.layout.split(first)
    assert fields["joined"].all() and fields["n_heard"][1:].sum() > 0
    between, _, _ = flown(env, seed=4)
    again, _, _ = flown(env, seed=3)
    assert np.array_equal(first, again) and not np.array_equal(first, between)
    env.reset(seed=5)
    assert env._radio.time_s == pytest.approx(formed_s)
    env.close()
    other = parallel_env(OVER["6tisch"])
    assert np.array_equal(flown(other, seed=4)[0], between)
    other.close()


def test_rewards_are_figures_or_a_function():
    env = parallel_env(CONFIG, reward={"mean_speed_mps": 2.0, "cohesion_m": -1.0})
    env.reset(seed=1)
    _, rewards, *_ = env.step({agent: [1.0, 0.0] for agent in env.agents})
    position_m, velocity_mps = env.state()[:, :3], env.state()[:, 3:]
    cohesion_m = np.linalg.norm(position_m - position_m.mean(axis=0), axis=1).mean()
    # 4 m/s² for 0.1 s: 0.2 m/s in the mean of the step.
    assert np.allclose(velocity_mps, [[0.2, 0.0, 0.0]] * 5)
    assert rewards == {f"robot_{robot}": pytest.approx(0.4 - cohesion_m) for robot in range(5)}
    env.close()

    def own(moment):
        assert moment.figures["collisions"] is not None and moment.dt_s == 0.1
        return moment.position_m[:, 0] + moment.time_s

    env = parallel_env(CONFIG, reward=own, figures=["collisions"])
    env.reset(seed=1)
    _, rewards, *_ = env.step({agent: [0.0, 0.0] for agent in env.agents})
    assert list(rewards.values()) == pytest.approx(env.state()[:, 0] + 0.1)
    with pytest.raises(murmuration.InvalidInput, match="there is none for robot_4"):
        env.step({f"robot_{robot}": [0.0, 0.0] for robot in range(4)})
    with pytest.raises(murmuration.InvalidInput, match="must be finite, got .* for robot_0"):
        env.step({f"robot_{robot}": [np.nan, 0.0] for robot in range(5)})
    env.close()
    assert env.agents == []
