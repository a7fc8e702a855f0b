"""robotsim/examples/python/predicting.py, a robot simulator that shares no code with ours, is compared with recorded tracks
in which a robot slips: the answers name the slip, and the simulator is given it."""

import json
import math
import random
import subprocess
import sys
import tomllib

import pytest
from conftest import ROOT, program, succeed
from hosts import Server

EXAMPLES = ROOT / "robotsim/examples/python"
STEP_S = 0.1
NOISE_M = 0.005
SCALE = 0.8  # the robots execute 80 % of the speed that is commanded: they slip by 20 %

MODEL = """[robotsim]
colour = "green" # keys are the simulator's own
"""


def tracks(scale, seed=1, n_robots=3, n_samples=900):
    """Robot samples of unicycles: new commands every 0.5 to 2 s, positions and headings measured with noise."""
    rng = random.Random(seed)
    lines = ["time_s,agent,x_m,y_m,heading_rad,cmd_speed_mps,cmd_yaw_rate_radps"]
    for robot in range(n_robots):
        x_m, y_m, heading_rad = 20.0 * robot, 0.0, 0.3
        until, speed_mps, yaw_rate_radps = 0, 0.0, 0.0
        for sample in range(n_samples):
            if sample == until:
                speed_mps, yaw_rate_radps = rng.uniform(0.0, 1.0), rng.uniform(-0.8, 0.8)
                until += rng.randrange(5, 21)
            noisy = [x_m + rng.gauss(0, NOISE_M), y_m + rng.gauss(0, NOISE_M), heading_rad + rng.gauss(0, 0.003)]
            shown = [f"{number:.5f}" for number in (*noisy, speed_mps, yaw_rate_radps)]
            lines.append(",".join([f"{sample * STEP_S:.1f}", str(robot), *shown]))
            speed_mps, yaw_rate_radps = round(speed_mps, 5), round(yaw_rate_radps, 5)
            # A hundred small steps of the equations of a unicycle.
            for _ in range(100):
                x_m += scale * speed_mps * math.cos(heading_rad) * STEP_S / 100
                y_m += scale * speed_mps * math.sin(heading_rad) * STEP_S / 100
                heading_rad += yaw_rate_radps * STEP_S / 100
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def stranger(tmp_path_factory):
    """The example, running: its URL."""
    log = tmp_path_factory.mktemp("predicting") / "log"
    with Server([sys.executable, EXAMPLES / "predicting.py", "0"], log, cwd="/") as server:
        yield f"http://{server.address}"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with the model, and with tracks that slip and tracks that do not."""
    folder = tmp_path_factory.mktemp("tracks")
    (folder / "model.toml").write_text(MODEL)
    (folder / "slipping.csv").write_text(tracks(SCALE))
    (folder / "sound.csv").write_text(tracks(1.0))
    return folder


def ask(folder, url, verb, data, *more):
    """The answer of a command about tracks, from its JSON."""
    command = [program("murmuration"), verb, "model.toml", "--data", data, "--robotsim", url, "--json", f"{verb}.json"]
    succeed([*command, *more], deadline_s=600, cwd=folder)
    return json.loads((folder / f"{verb}.json").read_text())


def test_it_keeps_the_promises_about_predictions(stranger, tmp_path):
    command = [program("murmuration"), "conformance", "robotsim", stranger, "--json", "found.json"]
    succeed(command, cwd=tmp_path)
    found = json.loads((tmp_path / "found.json").read_text())
    about = [f for f in found["findings"] if "Predict " in f["promise"] or "window whose start" in f["promise"]]
    assert [f["verdict"] for f in about] == ["kept"] * 3, found


def test_the_error_of_its_predictions_is_that_of_the_slip(stranger, files):
    """In a window of 1 s a robot that slips by 20 % is 0.2 v short, along its motion."""
    found = ask(files, stranger, "compare", "slipping.csv")
    assert found["predicted_by"] == "predicting.py 1"
    rows = [line.split(",") for line in tracks(SCALE).splitlines()[1:]]
    speeds = [float(row[5]) for row in rows]
    # Speeds hold for 0.5 to 2 s, so that the mean over a window scatters less than a single one: at most by this.
    rms_mps = math.sqrt(sum(speed * speed for speed in speeds) / len(speeds))
    rmse_m = found["scores"]["rmse_m"]
    assert 0.6 * 0.2 * rms_mps / math.sqrt(2) < rmse_m < 0.2 * rms_mps * 1.2, (rmse_m, rms_mps)


def test_the_slip_is_named_and_fitted(stranger, files):
    found = ask(files, stranger, "diagnose", "slipping.csv")
    assert found["missing"] == ["slip"], found["sentence"]
    slip = next(candidate for candidate in found["candidates"] if candidate["effect"] == "slip")
    assert abs(slip["parameters"]["scale"]["value"] - SCALE) < 0.005, slip


def test_nothing_is_missing_where_it_moves_as_they_did(stranger, files):
    found = ask(files, stranger, "diagnose", "sound.csv")
    assert found["verdict"] == "nothing-missing", found["sentence"]


def test_extend_writes_what_the_simulator_then_does(stranger, files):
    ask(files, stranger, "extend", "slipping.csv", "--effect", "slip", "--output", "better.toml")
    better = tomllib.loads((files / "better.toml").read_text())
    (effect,) = better["robotsim"]["dynamics"]["effect"]
    assert effect["kind"] == "slip" and abs(effect["scale"] - SCALE) < 0.005
    command = [program("murmuration"), "diagnose", "better.toml", "--data", "slipping.csv", "--robotsim", stranger]
    succeed([*command, "--json", "again.json"], deadline_s=600, cwd=files)
    assert json.loads((files / "again.json").read_text())["verdict"] == "nothing-missing"


def test_extend_refuses_what_the_simulator_does_not_do(stranger, files):
    command = [program("murmuration"), "extend", "model.toml", "--data", "slipping.csv", "--robotsim", stranger]
    command += ["--effect", "dead-time", "--output", "refused.toml"]
    done = subprocess.run(command, cwd=files, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 1, done.stderr
    assert "knows slip of the speed alone" in done.stderr and "nothing was written" in done.stderr
    assert not (files / "refused.toml").exists()
