"""The command `python -m murmuration.importers`."""

import gzip
import json
import os
import re
import subprocess
import sys

import numpy as np
import polars
import pytest
from bags import START_NS, BagWriter
from rosbags.rosbag2 import StoragePlugin
from ulogs import ULogWriter

import murmuration
from murmuration import importers
from murmuration.importers import __main__ as command

S = 1_000_000_000


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def drive(path, storage=StoragePlugin.MCAP, **options):
    """A bag of one robot with poses and commands every 0.1 s."""
    bag = BagWriter(**options)
    for k in range(50):
        bag.add_odometry("/odom", START_NS + k * S // 10, 0.1 * k, 0.0)
        bag.add_twist("/cmd_vel", START_NS + k * S // 10, 1.0)
    return bag.write(path, storage)


def flight(path, **options):
    """A log of one vehicle that flies as it is commanded, with attitude setpoints."""
    log = ULogWriter(**options)
    for k in range(50):
        log.add_position(20.0 + 0.1 * k, 0.1 * k, 0.0, -1.0)
        log.add_setpoint(20.0 + 0.1 * k, (1.0, 0.0, 0.0))
        log.add("vehicle_attitude_setpoint", 20.0 + 0.1 * k, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5)
    return log.write(path)


def printed(capsys, *words, status=0):
    """What the command prints on standard output and on standard error."""
    assert command.main([str(word) for word in words]) == status
    answer = capsys.readouterr()
    return answer.out, answer.err


def test_it_writes_the_table_and_prints_what_is_in_it_and_the_next_command(tmp_path):
    flight(tmp_path / "flight.ulg")
    words = [sys.executable, "-m", "murmuration.importers", "flight.ulg", "--output", "my table.csv"]
    answer = subprocess.run(words, capture_output=True, text=True, env={**os.environ, "PYTHONWARNINGS": "error"})
    assert (answer.returncode, answer.stderr) == (0, "")
    assert answer.stdout.splitlines() == [
        "my table.csv: 50 rows of robots from 1 log",
        "  columns   time_s, agent, x_m, y_m, z_m, heading_rad, cmd_vx_mps, cmd_vy_mps, cmd_vz_mps",
        "  run 1     flight.ulg",
        "            agent 0: 50 rows",
        "              poses     vehicle_local_position (50 messages)",
        "              commands  velocity of vehicle_local_position_setpoint (50 messages); also in the log: acceleration and thrust",
        "next: murmuration compare MODEL --data 'my table.csv'",
        '  MODEL is a configuration with [robotsim.dynamics] kind = "point-mass"',
    ]
    frame = polars.read_csv("my table.csv")
    wanted = importers.read_ulog("flight.ulg")
    assert frame.columns == wanted.columns and np.array_equal(frame.to_numpy(), wanted.to_numpy())
    assert sorted(os.listdir()) == ["flight.ulg", "my table.csv"]


def test_a_closed_standard_output_is_no_error(tmp_path):
    flight(tmp_path / "flight.ulg")
    reading, writing = os.pipe()
    os.close(reading)
    words = [sys.executable, "-m", "murmuration.importers", "flight.ulg", "--output", "a.csv"]
    answer = subprocess.run(words, stdout=writing, stderr=subprocess.PIPE, text=True)
    os.close(writing)
    assert (answer.returncode, answer.stderr) == (0, "") and len(polars.read_csv("a.csv")) == 50


def test_the_next_command_reads_the_table(tmp_path, capsys):
    drive(tmp_path / "drive")
    said, _ = printed(capsys, "drive", "--output", "drive.csv")
    body = re.search(r'kind = (".*")', said)[1]
    (tmp_path / "robot.toml").write_text(f"[robotsim.dynamics]\nkind = {body}\n")
    scores = murmuration.compare("robot.toml", "drive.csv")["scores"]
    # The robot goes exactly as it is commanded.
    assert scores["rmse_m"] < 1e-3


def test_the_ending_selects_the_format(tmp_path, capsys):
    drive(tmp_path / "drive")
    wanted = importers.read_bag("drive")
    for name, read in (
        ("a.csv", polars.read_csv),
        ("a.csv.gz", lambda path: polars.read_csv(gzip.open(path).read())),
        ("a.parquet", polars.read_parquet),
    ):
        printed(capsys, "drive", "--output", name)
        assert read(name).equals(wanted)
    _, said = printed(capsys, "drive", "--output", "a.txt", status=2)
    assert said == "error: --output a.txt: the file name must end in .csv, .csv.gz or .parquet; use a.csv\n"
    assert "the folder no does not exist" in printed(capsys, "drive", "--output", "no/a.csv", status=2)[1]


def test_a_number_that_is_absent_is_an_empty_field(tmp_path, capsys):
    log = ULogWriter()
    for k in range(3):
        log.add_position(20.0 + k, k, 0.0, -1.0, yaw=np.nan if k == 1 else np.pi / 2)
        log.add_setpoint(20.0 + k, (1.0, 0.0, 0.0))
    log.write(tmp_path / "flight.ulg")
    printed(capsys, "flight.ulg", "--output", "a.csv")
    rows = [line.split(",") for line in (tmp_path / "a.csv").read_text().splitlines()]
    assert [row[rows[0].index("heading_rad")] for row in rows[1:]][1] == ""
    assert polars.read_csv("a.csv")["heading_rad"].null_count() == 1


def test_an_existing_file_is_kept_without_replace(tmp_path, capsys):
    drive(tmp_path / "drive")
    (tmp_path / "a.csv").write_text("mine")
    _, said = printed(capsys, "drive", "--output", "a.csv", status=2)
    assert said == "error: --output a.csv: the file exists; give another name, or --replace\n"
    # A log that is not usable leaves the file as it is, too.
    (tmp_path / "cut.mcap").write_bytes(b"")
    printed(capsys, "cut.mcap", "--output", "a.csv", "--replace", status=1)
    assert (tmp_path / "a.csv").read_text() == "mine"
    printed(capsys, "drive", "--output", "a.csv", "--replace")
    assert len(polars.read_csv("a.csv")) == 50


def test_every_log_in_a_folder_is_a_run(tmp_path, capsys):
    folder = tmp_path / "drives"
    folder.mkdir()
    drive(folder / "drive_10")
    drive(folder / "drive_2", StoragePlugin.SQLITE3)
    drive(folder / "drive_3", ros1=True)
    # A file of a bag without the bag's folder.
    (file,) = drive(tmp_path / "other").glob("*.mcap")
    file.rename(folder / "drive_4.mcap")
    (folder / "notes.txt").write_text("windy")
    said, _ = printed(capsys, "drives", "--output", "a.csv")
    assert re.findall(r"run \d +(.*)", said) == [f"drives/drive_{name}" for name in ("2", "3.bag", "4.mcap", "10")]
    assert polars.read_csv("a.csv")["run"].value_counts()["count"].to_list() == [50] * 4
    # By its first bytes a ULog file is recognised whatever its name is.
    flight(tmp_path / "log_7")
    assert "agent 0: 50 rows" in printed(capsys, "log_7", "--output", "b.csv")[0]
    (tmp_path / "empty").mkdir()
    _, said = printed(capsys, "empty", "absent", "--output", "c.csv", status=2)
    assert "empty is no bag and has no bag in it" in said and "absent does not exist" in said
    _, said = printed(capsys, "log_7", "drives", "--output", "c.csv", status=2)
    assert "log_7 is a ULog file and drives/drive_2 is not; import them into tables of their own" in said


def test_errors_name_the_options_of_the_command(tmp_path, capsys):
    bag = BagWriter()
    for k in range(50):
        for name in ("/odom", "/pf/odom"):
            bag.add_odometry(name, START_NS + k * S // 10, 0.1 * k, 0.0)
        bag.add_twist("/cmd_vel", START_NS + k * S // 10, 1.0, 0.5)
    bag.write(tmp_path / "drive")
    _, said = printed(capsys, "drive", "--output", "a.csv", status=1)
    assert """Name them, --robots '{"car": {"pose": "/odom", "command": "/cmd_vel"}}'""" in said
    assert "/pf/odom  nav_msgs/msg/Odometry  50 messages" in said
    robots = json.dumps({"car": {"pose": "/pf/odom", "command": "/cmd_vel"}})
    _, said = printed(capsys, "drive", "--output", "a.csv", "--robots", robots, status=1)
    assert "write --twist velocity for robots" in said
    said, _ = printed(capsys, "drive", "--output", "a.csv", "--robots", robots, "--twist", "velocity", "--command-frame", "world")
    assert "agent 0 (car): 50 rows" in said and "/pf/odom (nav_msgs/msg/Odometry, 50 messages)" in said
    assert "--robots: not JSON" in printed(capsys, "drive", "--output", "b.csv", "--robots", "{car", status=2)[1]
    assert "--within-s must be greater than 0" in printed(capsys, "drive", "--output", "b.csv", "--within-s", "0", status=2)[1]
    assert "--thrust-n: only for ULog files" in printed(capsys, "drive", "--output", "b.csv", "--thrust-n", "9", status=2)[1]
    flight(tmp_path / "flight.ulg")
    _, said = printed(capsys, "flight.ulg", "--output", "b.csv", "--command", "thrust", status=1)
    assert "give --thrust-n, the thrust (N)" in said
    said, _ = printed(capsys, "flight.ulg", "--output", "b.csv", "--thrust-n", "20")
    assert 'kind = "quadrotor" and its mass_kg' in said
    assert "--twist: only for bags and MCAP files" in printed(capsys, "flight.ulg", "--output", "c.csv", "--twist", "velocity", status=2)[1]


def test_rows_that_are_left_out_are_a_warning_and_a_table_without_commands_is_said_to_be(tmp_path, capsys):
    bag = BagWriter()
    for k in range(50):
        bag.add_odometry("/odom", START_NS + k * S // 10, 0.1 * k, 0.0)
    bag.write(tmp_path / "still")
    said, _ = printed(capsys, "still", "--output", "a.csv")
    assert "next: this table has no commands, which a comparison with a model needs" in said and "compare MODEL" not in said
    bag.add_twist("/cmd_vel", START_NS, 1.0)
    bag.write(tmp_path / "drive")
    _, said = printed(capsys, "drive", "--output", "b.csv")
    assert said.startswith("warning: left out: ") and "39 of 50 rows without a command on /cmd_vel in the 1 s before" in said
