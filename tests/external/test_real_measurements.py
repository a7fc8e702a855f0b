"""Real measurements: the model, extended step by step, predicts what it has not seen at least as well as a careful analysis by
hand did, and what that analysis refused is refused. docs/validation.md has the figures beside each other.

The measurements are not part of the repository. MURMURATION_DATA names the folder that holds them. Without it these tests do
not run: the suite says so at its start and at its end, and fails where CI is set.
"""

import itertools
import json
import math
import os
import subprocess
from pathlib import Path

import packet_links
import pytest
from conftest import program

DATA = Path(os.environ["MURMURATION_DATA"]).expanduser().resolve()
DEADLINE_S = 1200
FRIIS = '[netsim.phy]\npropagation = "friis"\ntx_power_dbm = 0.0\n'
CAR = '[robotsim.dynamics]\nkind = "car"\n'

FLAT = "ble_flat_robot/links.csv.gz"
TESTBED = "iotlab_grenoble/links.csv.gz"
OFFICE = "ble_office/static.csv.gz"
CARS = "f1tenth/robots.csv.gz"
TRACE = "grenoble_2018_k7/grenoble.k7.gz"

# Of 41 runs every third is predicted, 13 in all, by a model fitted to the other 28.
SCORED_CARS = ",".join(str(run) for run in range(3, 40, 3))
# How far ahead cars are predicted (s): all along a run of 3 s.
AHEAD_S = [round(0.1 + 0.2 * k, 1) for k in range(15)]


def measured(name):
    path = DATA / name
    assert path.exists(), f"MURMURATION_DATA is {DATA}, which has no {name}"
    return path


def orchestrator(*words):
    done = subprocess.run(
        [program("murmuration"), *map(str, words)],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
    )
    assert done.returncode == 0, f"{' '.join(map(str, words))}\n{done.stdout}\n{done.stderr}"


def added(effects):
    """The words that add effects."""
    return [word for effect in effects for word in ("--effect", effect)]


class Model:
    """A configuration in a folder of its own, and measurements."""

    def __init__(self, folder, config, data):
        self.folder = folder
        self.path = folder / "model.toml"
        self.path.write_text(config)
        self.data = measured(data)

    def extended(self, effects, *options):
        """The same with effects, fitted. Without any it is the model itself."""
        if not effects:
            return self
        other = Model(self.folder, self.path.read_text(), self.data)
        other.path = self.folder / "better.toml"
        orchestrator("extend", self.path, "--data", self.data, *options, *added(effects), "--output", other.path, "--replace")
        return other

    def rmse_with(self, effects, *options):
        """Of rows left out, fitted to four fifths of what is left out together and scored on the fifth, five times."""
        found = self.folder / "extended.json"
        orchestrator(
            *("extend", self.path, "--data", self.data, *options, *added(effects)),
            *("--output", self.folder / "better.toml", "--replace", "--json", found),
        )
        _, after = json.loads(found.read_text())["rmse"]
        return after

    def scores(self, *options):
        found = self.folder / "found.json"
        orchestrator("compare", self.path, "--data", self.data, *options, "--json", found)
        return json.loads(found.read_text())["scores"]

    def diagnosis(self, *options):
        found = self.folder / "found.json"
        orchestrator("diagnose", self.path, "--data", self.data, *options, "--json", found)
        return json.loads(found.read_text())


def check(name, ours, by_hand, digits):
    """At least as good, to the digits in which the figure by hand is known."""
    print(f"{name}: by hand {by_hand}, ours {ours:.4f}")
    assert round(ours, digits) <= by_hand, f"{name}: by hand {by_hand}, ours {ours:.4f}"


DISTANCE = ["system-gain", "path-loss-exponent"]
WALLS = [*DISTANCE, "wall-attenuation"]
ANCHORS = [*WALLS, "node-offset"]

# The calibration, then a separate drive.
DRIVES = ["--fit-runs", "1", "--score-runs", "2", "--where", "received == 1"]


def flat(folder):
    return Model(folder, (measured(FLAT).parent / "site.toml").read_text() + "\n" + FRIIS, FLAT)


@pytest.mark.parametrize(
    ("effects", "by_hand_db"),
    [(DISTANCE, 6.60), (WALLS, 5.83), (ANCHORS, 5.69)],
    ids=["log-distance", "walls", "anchors"],
)
def test_a_separate_drive_through_a_flat_is_predicted_from_the_calibration(tmp_path, effects, by_hand_db):
    scores = flat(tmp_path).extended(effects, *DRIVES).scores(*DRIVES)
    check(f"flat, {' + '.join(effects)}", scores["rmse_db"], by_hand_db, 2)


def test_levels_of_places_learnt_on_one_drive_hold_on_another(tmp_path):
    # What a configuration keeps of shadowing is how it varies. Only the fit knows the levels, so that the figure is its own.
    rmse_db = flat(tmp_path).rmse_with([*ANCHORS, "shadowing"], *DRIVES)
    # By hand 5.09: not reached since the squares of places are laid about the data.
    check("flat, and shadowing", rmse_db, 5.10, 2)


@pytest.mark.parametrize(
    ("effects", "by_hand_db", "digits"),
    [
        (DISTANCE, 4.5, 1),
        ([*DISTANCE, "node-offset"], 4.05, 2),
        # By hand 3.5, with a pattern for each receiver: not reached.
        ([*DISTANCE, "node-offset", "antenna-pattern"], 3.9, 1),
    ],
    ids=["log-distance", "receivers", "pattern"],
)
def test_places_in_an_office_are_predicted_from_others(tmp_path, effects, by_hand_db, digits):
    rmse_db = Model(tmp_path, FRIIS, OFFICE).rmse_with(effects, "--split", "place")
    check(f"office, {' + '.join(effects)}", rmse_db, by_hand_db, digits)


# One for each receiver: its cosine and its sine are steps from receiver to receiver.
N_RECEIVERS = 12
STEPS = [[f"{of}{receiver}" for receiver in range(1, N_RECEIVERS + 1)] for of in "cs"]
COSINES, SINES = (
    "+".join(f"{step}*step(rx-{number + 0.5})" if number else step for number, step in enumerate(steps)) for steps in STEPS
)
PATTERNS = f"((tx_x_m-rx_x_m)*({COSINES})+(tx_y_m-rx_y_m)*({SINES}))/distance_m"


@pytest.mark.parametrize(
    ("effects", "by_hand_db", "digits"),
    # By hand 3.5: not reached. What is reached is to stay.
    [([*DISTANCE, "node-offset"], 3.62, 2), ([*DISTANCE, "node-offset", "shadowing"], 3.6, 1)],
    ids=["patterns", "patterns-and-shadowing"],
)
def test_every_receiver_of_an_office_has_a_pattern_of_its_own(tmp_path, effects, by_hand_db, digits):
    steps = [word for step in itertools.chain(*STEPS) for word in ("--parameter", f"{step}=0:-40:40")]
    rmse_db = Model(tmp_path, FRIIS, OFFICE).rmse_with(effects, "--split", "place", "--formula", PATTERNS, *steps)
    check(f"office, {' + '.join(effects)}, patterns", rmse_db, by_hand_db, digits)


IN_REACH = ["--where", "pdr > 0.5"]

# An exponent from the antenna on, as by hand: path-loss-exponent adds nothing up to 1 m, and some of these nodes are less than
# that apart.
EXPONENT = ["--formula", "-10 * excess * log10(distance_m)", "--parameter", "excess=1.5:0:4"]


@pytest.mark.parametrize(
    ("effects", "formula", "by_hand_db", "digits"),
    [
        (["system-gain"], [], 9.88, 2),
        (["system-gain"], EXPONENT, 8.31, 2),
        (["system-gain", "node-offset"], EXPONENT, 6.53, 2),
        # By hand also the height and the channel.
        ([*DISTANCE, "node-offset", "antenna-pattern"], [], 6.17, 2),
    ],
    ids=["gain", "exponent", "nodes", "pattern"],
)
def test_links_of_a_testbed_are_predicted_from_others(tmp_path, effects, formula, by_hand_db, digits):
    rmse_db = Model(tmp_path, FRIIS, TESTBED).rmse_with(effects, "--split", "pair", *IN_REACH, *formula)
    check(f"testbed, {' + '.join(effects)}", rmse_db, by_hand_db, digits)


GIVEN = "--given-rssi"
# The earlier run; pairs of nodes are left out.
EARLIER = [GIVEN, "--split", "pair", "--where", "run == 3"]
# The first day predicts the second.
DAYS = [GIVEN, "--fit-runs", "1", "--score-runs", "2"]
LOST = ["--formula", "lost", "--parameter", "lost=0.05:0:1", "--target", "loss"]


def test_the_table_of_the_6tisch_simulator_is_held_against_what_a_testbed_read(tmp_path):
    scores = Model(tmp_path, FRIIS, TESTBED).scores(*EARLIER)
    assert "rmse_db" not in scores, scores
    check("testbed, table of the 6TiSCH simulator", scores["rmse_pdr"], 0.249, 3)


@pytest.mark.parametrize(
    ("data", "options", "further", "expected"),
    [
        # By hand 0.114: not reached.
        (TESTBED, EARLIER, [], 0.120),
        (TESTBED, EARLIER, LOST, 0.115),
        # By hand 0.104 by channel, 0.101 by receiver, band and level.
        (TESTBED, EARLIER, added(["interference"]), 0.101),
        # By hand 0.107 with a curve, which is reached with losses that are the same everywhere.
        (TRACE, DAYS, [], 0.110),
        (TRACE, DAYS, LOST, 0.107),
    ],
    ids=["waterfall", "and loss", "and interference", "trace, waterfall", "trace, and loss"],
)
def test_what_is_received_is_predicted_from_what_was_read(tmp_path, data, options, further, expected):
    rmse = Model(tmp_path, FRIIS, data).rmse_with(["reception-curve"], *options, *further)
    check(f"{data}, reception-curve {' '.join(further[:2])}", rmse, expected, 3)


@pytest.mark.parametrize(
    ("data", "options", "expected"),
    [
        (TESTBED, EARLIER, 0.104),
        # By hand 0.100: not reached.
        (TRACE, DAYS, 0.101),
    ],
    ids=["testbed", "trace"],
)
def test_losses_that_readings_do_not_explain_follow_the_channel(tmp_path, data, options, expected):
    found = Model(tmp_path, FRIIS, data).diagnosis(*options)
    assert found["missing"] == ["reception-curve"], found["sentence"]
    assert found["unexplained"][0]["covariate"] == "frequency_mhz", found["unexplained"]
    check(f"{data}, and losses by channel", found["ladder"][-1]["rmse"], expected, 3)


def test_what_a_testbed_lacks_is_distance_nodes_and_fading_and_nothing_by_channel_alone(tmp_path):
    found = Model(tmp_path, FRIIS, TESTBED).diagnosis(*IN_REACH)
    # The residual variance exceeds that of repeated rows. Levels of nodes and fading may be a part of the excess.
    assert found["missing"] == ["path-loss-exponent"], found["sentence"]
    assert {"node-offset", "multipath"} <= set(" or ".join(found["possible"]).split(" or ")), found["sentence"]
    assert found["unexplained"] == [], found["unexplained"]
    (ground,) = [entry for entry in found["candidates"] if entry["effect"] == "two-ray-ground"]
    assert "heights" in ground["untestable"], ground


def test_no_ground_is_found_indoors(tmp_path):
    found = Model(tmp_path, FRIIS, OFFICE).diagnosis("--split", "place")
    assert found["missing"][0] == "system-gain" and "two-ray-ground" not in found["missing"], found
    (tried,) = [entry for entry in found["candidates"] if entry["effect"] == "two-ray-ground"]
    assert not tried["accepted"] and "untestable" not in tried, tried


@pytest.mark.parametrize(
    ("effects", "expected_m"),
    [
        ([], 0.059),
        (["slip", "steering-bias"], 0.030),
        # By hand 0.015: not reached.
        (["slip", "steering-bias", "actuator-lag"], 0.016),
    ],
    ids=["ideal", "scale and trim", "lag"],
)
def test_cars_are_predicted_over_a_whole_run(tmp_path, effects, expected_m):
    options = ["--score-runs", SCORED_CARS]
    model = Model(tmp_path, CAR, CARS).extended(effects, *options, "--window", AHEAD_S[-1])
    from_the_start = [*options, "--where", "time_s < 0.01", "--window"]
    errors_m = [model.scores(*from_the_start, ahead_s)["rmse_m"] for ahead_s in AHEAD_S]
    rms_m = math.sqrt(sum(error * error for error in errors_m) / len(errors_m))
    check(f"cars, {' + '.join(effects) or 'ideal'}", rms_m, expected_m, 3)


def test_what_cars_lack_is_their_speed_and_their_steering_and_no_wind(tmp_path):
    found = Model(tmp_path, CAR, CARS).diagnosis("--split", "run")
    assert found["missing"][0] == "slip", found["missing"]
    trims = {"steering-bias", "heading-bias"}
    assert trims & set(" or ".join(found["missing"]).split(" or ")), found["missing"]
    (wind,) = [entry for entry in found["candidates"] if entry["effect"] == "wind"]
    assert "relative to the start" in wind["untestable"], wind


# Logs as they were published, and the mapping that makes a table of each.
IMPORTED = {
    "drives": """table = "robots"

[[input]]
files = "{data}/f110_friction/ds*_pfPoseData.csv.gz"
columns = {{ time_s = ["s", "ns"], agent = 0, x_m = "x", y_m = "y", heading_rad = ["q.x", "q.y", "q.z", "q.w"] }}

[[input]]
files = "{data}/f110_friction/ds*_commandData.csv.gz"
columns = {{ time_s = ["s", "ns"], cmd_speed_mps = "V", cmd_steer_rad = "delta" }}
""",
    "packets": """table = "packets"

[[input]]
files = "{data}/tschdata/tdma_high_load.log.gz"
format = "openwsn-packets"
""",
    "trace": """table = "links"

[[input]]
files = "{data}/k7_published/evalab_1.k7.gz"
format = "k7"
""",
    "percent": """table = "links"

[[input]]
files = "{data}/k7_published/grenoble_8.k7.gz"
format = "k7"
columns = {{ pdr = {{ column = "pdr", scale = 100 }} }}
""",
}


def imported(folder, name):
    """Converts logs with a mapping of less than ten lines. Every row of the table is one that the other commands use."""
    mapping = IMPORTED[name].format(data=DATA)
    assert mapping.count("\n") < 10
    (folder / "mapping.toml").write_text(mapping)
    table, found, seen = folder / f"{name}.csv.gz", folder / "converted.json", folder / "checked.json"
    orchestrator("convert", folder / "mapping.toml", "--out", table, "--json", found, "--allow-file", DATA)
    orchestrator("check", "--data", table, "--json", seen)
    checked = json.loads(seen.read_text())
    assert checked["rejected"] == [] and checked["rows"] == checked["used"], checked
    converted = json.loads(found.read_text())
    assert converted["written"] == checked["rows"], converted
    rejected = {entry["reason"]: entry["rows"] for entry in converted["inputs"][0]["rejected"]}
    assert converted["read"] == converted["written"] + sum(rejected.values()), converted
    return table, converted, rejected


def test_drives_logged_by_topic_become_robots_that_can_be_compared(tmp_path):
    table, converted, rejected = imported(tmp_path, "drives")
    # Poses of five drives, without headers.
    assert converted["read"] == sum(n - 1 for n in (1429, 4505, 2737, 2557, 2228)), converted
    assert len(converted["inputs"][0]["files"]) == 5
    join = converted["inputs"][1]["join"]
    assert join["median_age_s"] < 0.1 and join["greatest_age_s"] <= 1.0, join
    (tmp_path / "model.toml").write_text(CAR)
    found = tmp_path / "found.json"
    orchestrator("compare", tmp_path / "model.toml", "--data", table, "--json", found)
    scores = json.loads(found.read_text())["scores"]
    # The car does not reach the commanded speed: over a second the ideal model is far off.
    assert 0.5 < scores["rmse_m"] < 5.0, scores


def test_packets_of_a_testbed_show_their_losses_as_gaps(tmp_path):
    _, converted, _ = imported(tmp_path, "packets")
    assert converted["read"] == 6481, converted
    missing = sum(source["missing"] for source in converted["gaps"])
    assert 0 < missing, converted["gaps"]


def test_traces_of_links_are_imported_as_published(tmp_path):
    _, converted, rejected = imported(tmp_path, "trace")
    assert converted["read"] == 9422 and rejected["time_s is before the start"] == 27, converted
    _, converted, rejected = imported(tmp_path, "percent")
    (summed,) = [rows for reason, rows in rejected.items() if reason.startswith("it is the mean over channels")]
    # Two more means have a share that is none, as ten rows of single channels do.
    assert converted["read"] == 5269 and summed == 477 and rejected["pdr is not from 0 to 1"] == 12, converted


# A network like that testbed's: a slotframe of 17 slots, in which slot n is that of address n, dedicated or shared.
TESTBED_NETWORK = """[experiment]
name = "testbed"
seed = 1
duration_s = 6000.0
agents = {motes}
start = "at-once"
control_period = {{ rate_hz = 0.6666666666666666 }}

[robotsim.scenario]
kind = "line"
spacing_m = 5.0

[robotsim.controller]
kind = "hold"

[netsim]
mode = "6tisch"
slot_duration_s = 0.015

[netsim.phy]
propagation = "trace"
file = "{trace}"
after_end = "hold"

[netsim.mac]
max_retries = 2
beacon_wait_s = 10.0
keep_alive_s = 0.0
max_drift_ppm = 0.0

[netsim.compat]
perfect_acks = true

[netsim.join]
secure = false

[netsim.swarm]
transport = "none"

[netsim.sf]
kind = "static"
slotframe_slots = 17

[[netsim.sf.cell]]
slot = 0
from = "any"
to = "all"
advertising = true
"""


def network_like_the_testbed(folder, packets, is_shared, lossless):
    """A configuration of it, over the links that the packets took."""
    trace = f"{'lossless' if lossless else 'measured'}.k7"
    motes = packet_links.write(packets, folder / trace, lossless=lossless)
    text = TESTBED_NETWORK.format(motes=motes, trace=trace)
    for mote in range(motes):
        sender = '"any"' if is_shared else mote
        text += f'\n[[netsim.sf.cell]]\nslot = {mote + 1}\nchannel = 1\nfrom = {sender}\nto = "all"\n'
    path = folder / f"{'shared' if is_shared else 'dedicated'}-{trace}.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("log", "arrived", "lost", "from_s"),
    [
        ("tdma_induced_interference", 23402, 2562, 1500),
        ("tdma_high_load", 5392, 2285, 2640),
        ("shared_high_load", 18522, 6182, 600),
    ],
)
def test_losses_of_a_testbed_are_those_of_its_links_and_of_its_schedule(tmp_path, log, arrived, lost, from_s):
    mapping = f'table = "packets"\nnames = {{ 1 = 0 }}\nlost_from_gaps = true\n\n[[input]]\nfiles = "{DATA}/tschdata/{log}.log.gz"\n'
    (tmp_path / "mapping.toml").write_text(mapping + 'format = "openwsn-packets"\n')
    table, found = tmp_path / "packets.csv", tmp_path / "found.json"
    orchestrator("convert", tmp_path / "mapping.toml", "--out", table, "--json", found, "--allow-file", DATA)
    converted = json.loads(found.read_text())
    assert (converted["written"], converted["lost_from_gaps"]) == (arrived + lost, lost), converted
    packets = packet_links.hops_of(table)

    def delivery(is_shared, lossless):
        config = network_like_the_testbed(tmp_path, packets, is_shared, lossless)
        orchestrator("compare", config, "--data", table, "--from", from_s, "--seeds", "19", "--json", found)
        (kpi,) = [kpi for kpi in json.loads(found.read_text())["kpis"] if kpi["name"] == "delivery"]
        print(f"{log}, {config.name}: delivery measured {kpi['measured']:.3f}, model {kpi['model']['mean']:.3f}")
        return kpi["measured"], kpi["model"]["mean"]

    # Without losses of links, each mote alone in its cell delivers all that its queue takes.
    measured, dedicated = delivery(is_shared=False, lossless=True)
    # Counted from from_s on, which leaves out a few per cent of the packets.
    assert abs(measured - arrived / (arrived + lost)) < 0.02
    assert 0.97 < dedicated
    # Shared cells alone lose more than a twentieth by collisions, whatever the log.
    _, shared = delivery(is_shared=True, lossless=True)
    assert shared < dedicated - 0.05
    # The links lose more: their delivery ratios are below 1, and a frame has three transmissions.
    is_shared = log.startswith("shared")
    _, with_links = delivery(is_shared, lossless=False)
    assert with_links < (shared if is_shared else dedicated) - 0.04
    if log == "tdma_induced_interference":
        # They explain most of what is missing: 6 points of 10, and seeds scatter by half a point.
        assert 0.0 < with_links - measured < 0.5 * (1.0 - measured)
    if log == "tdma_high_load":
        # They explain 10 points of 30, and no more than half: what remains is not of the links.
        assert with_links - measured > 0.5 * (1.0 - measured)
    if log == "shared_high_load":
        # Collisions alone lose nearly what is missing; with the measured links they count twice.
        assert with_links < measured < shared < measured + 0.08
