"""The package as its users have it: run against whatever `import murmuration` finds."""

import json
import os
import pickle
import re
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

import murmuration
from murmuration import _digest, _faults, network, robots
from murmuration._contract import common_pb2, robotsim_pb2
from murmuration._serving import Columns, Refused

CONFIG = {
    "experiment": {"name": "small", "seed": 1, "duration_s": 2.0, "agents": 5, "control_period": {"rate_hz": 10.0}},
    "robotsim": {"scenario": {"kind": "line"}, "controller": {"kind": "flocking", "flock_radius_m": 10.0}},
    "netsim": {"phy": {"propagation": "unit-disk", "radius_m": 20.0}},
    "output": {"report": False},
}

GATHER = """
import sys, numpy, murmuration.robots

class Gather(murmuration.robots.Robots):
    def reset(self, seed, n):
        self.position_m = numpy.random.default_rng(seed).uniform(-6, 6, (n, 2))
        return self.position_m

    def step(self, dt_s, heard):
        if self.config.get("fails_at_s", numpy.inf) <= self.time_s:
            raise RuntimeError("a wheel came off")
        way_m = heard.mean_position_m(self.position_m) - self.position_m
        away_m = numpy.linalg.norm(way_m, axis=1, keepdims=True)
        self.position_m += way_m * numpy.clip(away_m - 1, 0, dt_s) / numpy.maximum(away_m, 1e-9)
        return self.position_m

murmuration.robots.serve(Gather())
"""

DISK = """
import numpy, murmuration.network

class Disk(murmuration.network.Network):
    def step(self, dt_s, position_m, says):
        away_m = numpy.linalg.norm(position_m[:, None] - position_m, axis=2)
        self.rssi_dbm = -40.0 - away_m
        return away_m <= self.config["radius_m"]

murmuration.network.serve(Disk())
"""


@pytest.fixture
def serving(tmp_path):
    """Starts programs that serve a simulator; gives their URLs, and ends them."""
    children = []

    def start(text):
        path = tmp_path / f"served_{len(children)}.py"
        path.write_text(textwrap.dedent(text))
        child = subprocess.Popen([sys.executable, path], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        children.append(child)
        said = child.stdout.readline()
        assert said.startswith("listening on 127.0.0.1:"), said + child.stderr.read()
        return "http://" + said.split()[-1], child

    yield start
    for child in children:
        child.kill()
        child.wait()


def test_a_dictionary_runs_and_gives_tables(tmp_path):
    run = murmuration.run(CONFIG, seed=7, out=tmp_path, netsim__phy__radius_m=15.0)
    assert run.summary["seed"] == 7 and run.summary["agent_count"] == 5
    assert "radius_m = 15.0" in (run.folder / "config.toml").read_text()
    assert {"agent", "x_m", "y_m"} <= set(run.steps.columns)
    assert len(run.steps) == 5 * len(set(run.steps["step"].to_list()))
    assert "frames delivered" in run.printed and "frames delivered" in run._repr_html_()


def test_a_file_and_the_same_dictionary_give_the_same_run(tmp_path):
    import tomli_w

    path = tmp_path / "small.toml"
    path.write_text(tomli_w.dumps(CONFIG))
    one = murmuration.run(path, out=tmp_path / "one")
    other = murmuration.run(CONFIG, out=tmp_path / "other")
    assert one.summary["final_digest"] == other.summary["final_digest"]


def test_invalid_input_is_an_exception_with_all_problems(tmp_path):
    with pytest.raises(murmuration.InvalidInput) as error:
        murmuration.run(CONFIG, out=tmp_path, netsim__phy__propagaton="friis", experiment__duration_s=-1.0)
    assert str(error.value).splitlines() == [
        "the configuration: 2 problems",
        "experiment__duration_s must be greater than 0 and at most 1000000000, got -1.0 (nearest valid: 1)",
        "there is no key netsim__phy__propagaton; the nearest is netsim__phy__propagation='friis'",
    ]
    assert [path.name for path in tmp_path.iterdir()] == ["work"]
    assert not list(Path.cwd().iterdir())


def test_a_table_that_a_run_did_not_leave_is_named(tmp_path):
    run = murmuration.run(CONFIG, out=tmp_path)
    with pytest.raises(FileNotFoundError, match=r"packets\.parquet is not there"):
        run.packets


def test_a_sweep_has_its_trials(tmp_path):
    sweep = murmuration.sweep({**CONFIG, "sweep": {"seeds": 2, "vary": {"netsim.phy.radius_m": [5.0, 20.0]}}}, out=tmp_path)
    assert len(sweep.trials) == 4


def test_the_loop_of_measurements_takes_data_frames(tmp_path):
    import polars

    rng = np.random.default_rng(5)
    n = 400
    distance_m = rng.uniform(2.0, 60.0, n)
    # Free space at 2.4 GHz with 6 dB of loss that the model does not have.
    rssi_dbm = -40.2 - 20.0 * np.log10(distance_m) - 6.0 + rng.normal(0.0, 1.0, n)
    zero = np.zeros(n)
    data = polars.DataFrame({
        "time_s": np.arange(n) * 1.0, "tx": np.zeros(n, dtype=int), "rx": np.ones(n, dtype=int),
        "tx_x_m": zero, "tx_y_m": zero, "rx_x_m": distance_m, "rx_y_m": zero, "rssi_dbm": rssi_dbm, "received": np.ones(n, dtype=int),
    })  # fmt: skip
    model = {**CONFIG, "netsim": {"phy": {"propagation": "friis"}}}
    with pytest.raises(murmuration.InvalidInput, match="needs more than 10 kB of memory for"):
        murmuration.compare(model, data, memory_budget="10kB")
    compared = murmuration.compare(model, data)
    assert "rssi" in json.dumps(compared.content) and compared._repr_html_().startswith("<pre>")
    found = murmuration.diagnose(model, data)
    # Of one pair of nodes on one line, an obstacle or a pattern may be the same constant.
    assert found["verdict"] == "missing-one-of" and found["missing"][0].split(" or ")[0] == "system-gain"
    extended = tmp_path / "extended.toml"
    murmuration.extend(model, data, extended, effect="system-gain")
    assert 'kind = "system-gain"' in extended.read_text()
    assert murmuration.power(model, data, "system-gain", campaigns=2).content
    output = tmp_path / "campaign.csv"
    murmuration.simulate(model, data, output, seed=3)
    assert output.read_text().count("\n") == n + 1


def test_ctrl_c_ends_the_program_as_well(tmp_path):
    script = tmp_path / "long.py"
    script.write_text(f"import murmuration\nmurmuration.run({CONFIG!r}, out={str(tmp_path)!r}, experiment__duration_s=1e6)\n")
    child = subprocess.Popen([sys.executable, script], stderr=subprocess.PIPE, text=True, start_new_session=True)
    children = Path(f"/proc/{child.pid}/task/{child.pid}/children")
    deadline = time.monotonic() + 60
    while not children.read_text().split() and time.monotonic() < deadline:
        time.sleep(0.05)
    grandchild = children.read_text().split()[0]
    time.sleep(0.5)
    # A notebook interrupts its own process only, not the processes it has started.
    os.kill(child.pid, signal.SIGINT)
    assert "KeyboardInterrupt" in child.communicate(timeout=60)[1]
    assert not Path(f"/proc/{grandchild}").exists()


def test_robots_and_network_of_ones_own_keep_the_contract(serving):
    for side, text in (("robotsim", GATHER), ("netsim", DISK)):
        url, _ = serving(text)
        command = [murmuration.program(), "conformance", side, url]
        if side == "netsim":
            config = Path("radius.toml").resolve()
            config.write_text("radius_m = 20.0\n")
            command += ["--config", config]
        answer = subprocess.run(command, capture_output=True, text=True)
        assert answer.returncode == 0, answer.stdout + answer.stderr
        assert "0 failed" in answer.stdout and "lax" not in answer.stdout, answer.stdout


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)


EXTERNAL = {
    "experiment": {"name": "external", "seed": 1, "duration_s": 5.0, "agents": 8, "control_period": {"rate_hz": 10.0}},
    "netsim": {"phy": {"propagation": "unit-disk", "radius_m": 8.0}},
}


def test_a_network_of_ones_own_equals_the_built_in_one(serving, tmp_path):
    robots_url, _ = serving(GATHER)
    network_url, _ = serving(DISK)
    own = {**EXTERNAL, "netsim": {"radius_m": 8.0}}
    one = murmuration.run(EXTERNAL, out=tmp_path / "one", robotsim=robots_url)
    other = murmuration.run(own, out=tmp_path / "other", robotsim=robots_url, netsim=network_url)
    for run in (one, other):
        assert run.summary["steps"] == 50
    first, second = (run.steps.select(["step", "agent", "x_m", "y_m"]).to_numpy() for run in (one, other))
    # The order of transmissions changes the last bits of sums.
    assert np.allclose(first, second, rtol=0, atol=1e-9)
    again = murmuration.run(own, out=tmp_path / "again", robotsim=robots_url, netsim=network_url)
    assert again.summary["final_digest"] == other.summary["final_digest"]


def by_command(text, **own):
    """A configuration whose robots are this program."""
    Path("my_robots.py").write_text(textwrap.dedent(text))
    return {**EXTERNAL, "robotsim": {"command": ["python", "my_robots.py"], **own}}


def test_a_configuration_starts_its_simulator_only_if_that_is_allowed(serving, tmp_path):
    url, _ = serving(GATHER)
    config = by_command(GATHER)
    with pytest.raises(murmuration.InvalidInput, match="python my_robots.py") as error:
        murmuration.run(config, out=tmp_path / "refused")
    assert "with allow_command=True" in str(error.value) and not (tmp_path / "refused").exists()
    started = murmuration.run(config, out=tmp_path / "started", allow_command=True)
    reached = murmuration.run(EXTERNAL, out=tmp_path / "reached", robotsim=url)
    for table in ("steps.parquet", "links.parquet"):
        assert (started.folder / table).read_bytes() == (reached.folder / table).read_bytes()
    assert started.summary["final_digest"] == reached.summary["final_digest"]


def test_a_sweep_starts_a_simulator_for_each_job(tmp_path):
    text = f"import os\nopen('started', 'a').write(f'{{os.getpid()}}\\n')\n{GATHER}"
    config = {**by_command(text), "sweep": {"seeds": 4}, "experiment": {**EXTERNAL["experiment"], "duration_s": 1.0}}
    one = murmuration.sweep(config, out=tmp_path / "one", jobs=1, allow_command=True)
    two = murmuration.sweep(config, out=tmp_path / "two", jobs=2, allow_command=True)
    assert one.trials.equals(two.trials) and len(one.trials) == 4
    pids = Path("started").read_text().split()
    assert len(pids) == 3 and not any(Path(f"/proc/{pid}").exists() for pid in pids)


FAILS = {
    "raise RuntimeError('a wheel came off')": ["failed in step 2", "line 6, in step", "RuntimeError: a wheel came off"],
    "sys.exit('out of battery')": ["failed in step 2", "SystemExit: out of battery"],
    "ctypes.string_at(0)": ["ended during step 2: killed by SIGSEGV", "Segmentation fault", "line 6 in step"],
    "os._exit(9)": ["ended during step 2: exit status 9"],
}


@pytest.mark.parametrize("fault", FAILS)
def test_a_fault_of_a_started_simulator_shows_its_traceback(fault, tmp_path):
    text = f"""
    import ctypes, os, sys, numpy, murmuration.robots
    class Faulty(murmuration.robots.Robots):
        def reset(self, seed, n): return numpy.zeros((n, 2))
        def step(self, dt_s, heard):
            if self.time_s > 0: {fault}
            return numpy.zeros((heard.n, 2))
    murmuration.robots.serve(Faulty(), "127.0.0.1:1")
    """
    with pytest.raises(murmuration.MurmurationError) as error:
        murmuration.run(by_command(text), out=tmp_path, allow_command=True)
    for expected in FAILS[fault]:
        assert expected in str(error.value), str(error.value)
    # Once, and without the package's own code and its way of sending it, which only the dump of a crash has.
    assert str(error.value).count(FAILS[fault][-1]) == 1
    assert fault.startswith("ctypes") or not re.search(r"_serving\.py|Traceback|Internal", str(error.value)), str(error.value)


def test_equal_failures_of_trials_are_listed_once(tmp_path):
    text = """
    import numpy, murmuration.robots
    class Faulty(murmuration.robots.Robots):
        def reset(self, seed, n): return numpy.zeros((n, 2))
        def step(self, dt_s, heard): raise RuntimeError("a wheel came off")
    murmuration.robots.serve(Faulty())
    """
    with pytest.raises(murmuration.MurmurationError) as error:
        murmuration.sweep({**by_command(text), "sweep": {"seeds": 3}}, out=tmp_path, jobs=1, allow_command=True)
    said = str(error.value)
    assert said.startswith("3 of 3 trials failed") and "3 trials, setting-0-seed-1 the first of them: robotsim: failed in step 1" in said, said
    assert said.count("a wheel came off") == 2 and said.count("RuntimeError: ") == 1, said


def test_a_failed_run_says_so_when_it_is_opened(tmp_path):
    text = """
    import numpy, murmuration.robots
    class Faulty(murmuration.robots.Robots):
        def reset(self, seed, n): return numpy.zeros((n, 2))
        def step(self, dt_s, heard): return numpy.zeros((heard.n, 2)) if self.time_s < 1 else None
    murmuration.robots.serve(Faulty())
    """
    for folder, replace in (("external", False), ("external-2", False), ("external", True)):
        with pytest.raises(murmuration.MurmurationError, match=rf"the partial recording is in {re.escape(str(tmp_path / folder))}(\n|$)"):
            murmuration.run(by_command(text), out=tmp_path, allow_command=True, replace=replace)
    with pytest.warns(UserWarning, match="is a run that failed after 1.0 s: robotsim: failed in step 11: step must return positions") as warned:
        run = murmuration.Run(tmp_path / "external")
    assert warned[0].filename == __file__ and "failed" in repr(run) and "tables: links, " in repr(run)


def test_folders_of_the_wrong_kind_are_refused(tmp_path):
    run = murmuration.run(CONFIG, out=tmp_path)
    sweep = murmuration.sweep({**CONFIG, "experiment": {**CONFIG["experiment"], "name": "many"}, "sweep": {"seeds": 2}}, out=tmp_path)
    with pytest.raises(murmuration.InvalidInput, match="is the folder of a run; open it with murmuration.Run"):
        murmuration.Sweep(run.folder)
    with pytest.raises(murmuration.InvalidInput, match="is the folder of a sweep; open it with murmuration.Sweep"):
        murmuration.Run(sweep.folder)
    for kind in (murmuration.Run, murmuration.Sweep):
        with pytest.raises(FileNotFoundError, match="it has no summary.json"):
            kind(tmp_path)
    assert "small: 5 robots, seed 1, 20 steps" in repr(murmuration.Run(run.folder))
    assert "many: 1 settings, 2 trials" in repr(murmuration.Sweep(sweep.folder))
    assert not [name for name in dir(murmuration.Sweep) if name.startswith("_") and not name.startswith("__") and name not in ("_repr_html_", "_keys", "_resolved", "_described")]


def test_a_program_that_cannot_be_imported_shows_why(tmp_path):
    with pytest.raises(murmuration.MurmurationError, match="ended before it served") as error:
        murmuration.run(by_command("import numpie"), out=tmp_path, allow_command=True)
    assert "exit status 1" in str(error.value) and "No module named 'numpie'" in str(error.value)


def test_a_simulator_ends_when_its_standard_input_closes(tmp_path):
    path = tmp_path / "gather.py"
    path.write_text(GATHER)
    variables = {**os.environ, "MURMURATION_LISTEN": f"unix:{tmp_path}/socket", "MURMURATION_EXIT_WITH_STDIN": "1"}
    child = subprocess.Popen([sys.executable, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=variables)
    deadline = time.monotonic() + 60
    while not (tmp_path / "socket").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert child.poll() is None
    assert child.communicate(timeout=60)[0] == b"" and child.returncode == 0


def test_a_fault_of_user_code_shows_its_traceback(serving, tmp_path):
    url, child = serving(GATHER)
    with pytest.raises(murmuration.MurmurationError) as error:
        murmuration.run({**EXTERNAL, "robotsim": {"fails_at_s": 1.0}}, out=tmp_path, robotsim=url)
    assert 'raise RuntimeError("a wheel came off")' in str(error.value)
    # It can be asked again.
    assert murmuration.run(EXTERNAL, out=tmp_path, robotsim=url).summary["steps"] == 50


TELLS = """
import numpy, murmuration.robots

class Tells(murmuration.robots.Robots):
    def reset(self, seed, n):
        self.n, self.words = n, set()
        return numpy.column_stack([numpy.arange(n), numpy.zeros(n)])

    def step(self, dt_s, heard):
        self.words |= set(heard.payload)
        self.task_complete = len(self.words) == self.n
        return numpy.column_stack([numpy.arange(self.n), numpy.zeros(self.n)])

    def payloads(self):
        return [b"I am %d" % robot for robot in range(self.n)]

    def figures(self):
        return {"words": len(self.words)}

murmuration.robots.serve(Tells())
"""


def test_payloads_and_figures_of_ones_own_arrive(serving, tmp_path):
    url, _ = serving(TELLS)
    run = murmuration.run(EXTERNAL, out=tmp_path, robotsim=url)
    assert run.summary["task"]["words"] == 8 and run.summary["task"]["complete"]


def test_the_full_digest_is_that_of_the_worked_example():
    """common.proto states both digests."""
    begin = robotsim_pb2.RobotSimServiceConfigureRequest(
        seed=7, agent_count=2, step_ns=100_000_000, coupling=common_pb2.COUPLING_SEQUENTIAL, config_toml="a = 1"
    )
    states = common_pb2.AgentStates(alive=b"\x03", x_m=[0.0, 1.5], y_m=[0.0, -2.0], z_m=[0.0, 0.0])
    start = _digest.robots_start(begin, robotsim_pb2.RobotSimServiceConfigureResponse(states=states))
    assert start.hex() == "8fd3c53194e1883b21b3469f8265fe35b3a881a51f823d5f6dc1ffb9c9b87435"
    reply = robotsim_pb2.RobotSimServiceStepResponse(
        step=1, time_ns=100_000_000, states=states, payloads=common_pb2.Payloads(length_bytes=[0, 0])
    )
    digest = _digest.robots_step(start, robotsim_pb2.RobotSimServiceStepRequest(step=1, until_ns=100_000_000), reply, 2)
    assert digest.hex() == "c75d951f98d6a67057b618cabf70595cc4cee49eea6d1b30beae0e99a80d94e3"


class Drifting(robots.Robots):
    """Every robot drifts by a random amount in each step, and predicts arcs."""

    def reset(self, seed, n):
        self.random = np.random.default_rng(seed)
        self.position_m = self.random.uniform(-1, 1, (n, 2))
        self.heading_rad = np.zeros(n)
        return self.position_m

    def step(self, dt_s, heard):
        self.position_m += self.random.normal(0, dt_s, self.position_m.shape)
        self.heading_rad = self.heading_rad + dt_s
        return self.position_m

    def predict(self, window):
        if window.commands != "speed and yaw rate":
            raise robots.Unsupported(f"these robots execute speed and yaw rate, not {window.commands}")
        heading_rad = window.heading_rad + np.cumsum(window.command[:, 1] * window.duration_s)
        way_m = window.config.get("scale", 1.0) * window.command[:, 0] * window.duration_s
        steps_m = way_m[:, None] * np.column_stack([np.cos(heading_rad), np.sin(heading_rad)])
        return window.position_m[:2] + np.cumsum(steps_m, axis=0), heading_rad

    def snapshot(self):
        return pickle.dumps((self.random, self.position_m))

    def restore(self, state):
        self.random, self.position_m = pickle.loads(state)


def steps(service, first, last):
    """Replies to steps of 0.1 s, as bytes."""
    requests = (robotsim_pb2.RobotSimServiceStepRequest(step=k, until_ns=k * 100_000_000) for k in range(first, last + 1))
    return [service._step(request).SerializeToString() for request in requests]


@pytest.mark.parametrize("full_digest", [False, True])
def test_a_restored_simulator_goes_on_as_if_it_had_never_stopped(full_digest):
    begin = robotsim_pb2.RobotSimServiceConfigureRequest(seed=5, agent_count=3, config_toml="a = 2", full_digest=full_digest)
    one, other = robots._Service(Drifting()), robots._Service(Drifting())
    one._configure(begin)
    steps(one, 1, 4)
    state = one._snapshot(None).state
    restored = other._restore(robotsim_pb2.RobotSimServiceRestoreRequest(state=state))
    assert (restored.step, restored.time_ns) == (4, 400_000_000)
    assert other.simulator.config == {"a": 2} and other.simulator.time_s == 0.4
    # The latest step may be repeated, and all others follow.
    assert steps(one, 4, 9) == steps(other, 4, 9)
    spoilt = state[:50] + bytes([state[50] ^ 1]) + state[51:]
    for bad in (b"", b"x" * 100, spoilt):
        with pytest.raises(Refused, match="damaged"):
            other._restore(robotsim_pb2.RobotSimServiceRestoreRequest(state=bad))
    other.simulator.version = "2"
    with pytest.raises(Refused, match=re.escape("Drifting 1', but this is 'murmuration-python/1 Drifting 2'")):
        other._restore(robotsim_pb2.RobotSimServiceRestoreRequest(state=state))


def test_what_a_class_does_not_have_is_not_announced():
    for simulator, has in ((Drifting(), True), (Two(), False)):
        said = robots._Service(simulator).Describe(None, None)
        assert (said.predictions, said.snapshots, said.full_digest) == (has, has, True)

    class Half(Two):
        def snapshot(self):
            return b""

    with pytest.raises(ValueError, match="Half must have both snapshot and restore"):
        robots._Service(Half()).Describe(None, None)


def window(**fields):
    columns = {"duration_ns": [500_000_000] * 2, "command_first": [1.0, 2.0], "command_second": [0.0] * 2, "command_third": [0.0] * 2}
    return robotsim_pb2.PredictionWindow(**{"agent": 4, "z_m": 0.5, **columns, **fields})


def predicted(*windows, kind=2, config=""):
    request = robotsim_pb2.RobotSimServicePredictRequest(command_kind=kind, config_toml=config, windows=windows)
    return robots._Service(Drifting())._predict(request).windows


def test_windows_are_predicted_as_the_class_says():
    straight, turned = predicted(window(), window(heading_rad=np.pi / 2), config="scale = 0.5")
    assert straight.agent == 4 and list(straight.x_m) == [0.25, 0.75] and list(straight.z_m) == [0.5, 0.5]
    assert np.allclose(turned.y_m, [0.25, 0.75], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "windows, options, text",
    [
        ([window()], {"kind": 1}, "these robots execute speed and yaw rate, not velocity"),
        ([window()], {"kind": 7}, "command_kind: must be 1, 2 or 3, got 7"),
        ([window()], {"config": "a ="}, "config_toml: "),
        ([], {}, "windows: must have at least 1 entry"),
        ([window(), window(x_m=np.nan)], {}, "windows[1]: numbers must be finite"),
        ([window(command_first=[1.0])], {}, "must have 2 entries each"),
        ([window(duration_ns=[1, 0])], {}, "windows[0].duration_ns"),
        ([window(start_ns=2 * 10**18)], {}, "windows[0].start_ns"),
        ([window(duration_ns=[10**14, 1])], {}, "windows: must last at most"),
        ([window(duration_ns=[1] * 20_001)], {}, "windows: must have at most 20000 commands, got 20001"),
    ],
)
def test_requests_to_predict_that_make_no_sense_are_refused(windows, options, text):
    with pytest.raises(Refused, match=re.escape(text)):
        predicted(*windows, **options)


class Two(robots.Robots):
    positions = np.zeros((2, 2))
    said: object = None
    told: object = {}

    def reset(self, seed, n):
        return self.positions

    def step(self, dt_s, heard):
        return self.positions

    def payloads(self):
        return self.said

    def figures(self):
        return self.told


@pytest.mark.parametrize(
    "positions, text",
    [
        (np.zeros((3, 2)), "reset must return positions of shape (2, 2) or (2, 3), got (3, 2)"),
        (np.zeros((2, 4)), "reset must return positions of shape (2, 2) or (2, 3), got (2, 4)"),
        (np.array([[0.0, 0.0], [np.nan, 1.0]]), "for robot 1"),
        (None, "(2, 3), got None; end it with a return statement"),
        ("here", "(2, 3), got 'here' (str)"),
        ([[1.0, 2.0], [3.0]], "(2, 3), got [[1.0, 2.0], [3.0]] (list)"),
    ],
)
def test_positions_of_the_wrong_form_are_named(positions, text):
    service = robots._Service(Two())
    service.simulator.positions = positions
    with pytest.raises(ValueError, match=re.escape(text)):
        service._configure(robots.robotsim_pb2.RobotSimServiceConfigureRequest(seed=1, agent_count=2))


@pytest.mark.parametrize(
    "answer, text",
    [
        ({"said": [b"a"]}, "payloads must return a list of 2 bytes objects, one for each robot, got 1"),
        ({"said": ["a", "b"]}, "got 'a' (str) for robot 0; use its method encode()"),
        ({"said": b"ab"}, "one for each robot, or None, got b'ab' (bytes)"),
        ({"told": {"words": "many"}}, "figures must return numbers, got 'many' (str) for 'words'"),
        ({"told": 3}, "figures must return a dictionary of numbers by name, got 3 (int)"),
    ],
)
def test_payloads_and_figures_of_the_wrong_form_are_named(answer, text):
    service = robots._Service(Two())
    service._configure(robotsim_pb2.RobotSimServiceConfigureRequest(seed=1, agent_count=2))
    for name, value in answer.items():
        setattr(service.simulator, name, value)
    with pytest.raises(ValueError, match=re.escape(text)) as error:
        steps(service, 1, 1)
    # Where the method is.
    assert re.search(rf'{re.escape(__file__)}", line \d+, in Two\.(payloads|figures)$', error.value.__notes__[0])


def test_causes_of_an_exception_are_shown():
    def fails():
        try:
            {}["wheel"]
        except KeyError as error:
            raise RuntimeError("no wheel") from error

    with pytest.raises(RuntimeError) as error:
        fails()
    first, *others = _faults.shown(error.value).splitlines()
    assert first == "RuntimeError: no wheel" and "caused by KeyError: 'wheel'" in others
    assert [line.strip() for line in others if "wheel" in line] == ['raise RuntimeError("no wheel") from error', "caused by KeyError: 'wheel'", '{}["wheel"]']


def test_positions_are_not_averaged_over_payloads_without_positions():
    heard = robots.Heard(1, *(np.zeros(1, dtype=int),) * 2, *(np.full((1, 3), np.nan),) * 2, *(np.zeros(1),) * 2, [b"word"])
    with pytest.raises(ValueError, match="decode heard.payload instead"):
        heard.mean_position_m(np.zeros((1, 2)))


def deliveries(n_sent, **columns):
    air = common_pb2.Transmissions(sender=range(n_sent), sent_ns=[0] * n_sent, end_ns=[1] * n_sent,
                                      payloads=common_pb2.Payloads(length_bytes=[0] * n_sent))
    return common_pb2.Deliveries(transmissions=air, **columns)


def test_lists_and_bitmaps_say_the_same():
    rng = np.random.default_rng(1)
    for n, n_sent in ((1, 1), (3, 8), (5, 9), (7, 30)):
        matrix = rng.random((n, n_sent)) < 0.4
        ends = np.cumsum(matrix.sum(axis=1)).tolist()
        lists = deliveries(n_sent, heard_end=ends, heard=np.nonzero(matrix)[1].tolist())
        bits = deliveries(n_sent, heard_bitmap=np.packbits(matrix, axis=1, bitorder="little").tobytes())
        for one in (lists, bits):
            receivers, heard = Columns(one).pairs(n)
            again = np.zeros_like(matrix)
            again[receivers, heard] = True
            assert np.array_equal(again, matrix)


@pytest.mark.parametrize(
    "columns, text",
    [
        ({"heard_end": [1, 2], "heard": [0, 5]}, "heard: must be less than 3"),
        ({"heard_end": [2, 1], "heard": [0]}, "heard_end"),
        ({"heard_end": [1], "heard": [0]}, "heard_end"),
        ({"heard_bitmap": b"\x01"}, "heard_bitmap"),
        ({"heard_bitmap": b"\x01\x08"}, "beyond the 3"),
    ],
)
def test_deliveries_that_contradict_themselves_are_refused(columns, text):
    with pytest.raises(Refused, match=text):
        Columns(deliveries(3, **columns)).pairs(2)


def test_only_this_machine_is_listened_on():
    for serve, simulator in ((robots.serve, Two()), (network.serve, network.Network())):
        with pytest.raises(ValueError, match="must be of this machine"):
            serve(simulator, "0.0.0.0:50061")
