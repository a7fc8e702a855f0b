"""Logs of PX4 as tables of robot samples."""

import re
import warnings

import numpy as np
import pytest
from ulogs import ULogWriter

import murmuration
from murmuration import importers

GPS_S = 1_700_000_000.25


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def columns_of(frame, *names):
    return np.column_stack([frame[name].to_numpy() for name in names])


def refusal(*arguments, **options):
    with pytest.raises(murmuration.InvalidInput) as error:
        importers.read_ulog(*arguments, **options)
    return str(error.value)


def turned(roll, pitch, yaw):
    """The matrix of a rotation by roll, then pitch, then yaw."""
    (a, b, c), (d, e, f) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    of_roll = np.array([[1, 0, 0], [0, a, -d], [0, d, a]])
    of_pitch = np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]])
    of_yaw = np.array([[c, -f, 0], [f, c, 0], [0, 0, 1]])
    return of_yaw @ of_pitch @ of_roll


def quaternion(matrix):
    """The quaternion (w, x, y, z) of a rotation whose angle is below half a turn."""
    w = np.sqrt(1 + np.trace(matrix)) / 2
    return [w, *((matrix[[2, 0, 1], [1, 2, 0]] - matrix[[1, 2, 0], [2, 0, 1]]) / (4 * w))]


def straight(n=100, start_s=20.0, **options):
    """Positions every 0.1 s: north at 1 m/s, east at 2 m/s, down at -0.5 m/s; setpoints every 0.25 s, first 0.05 s before."""
    log = ULogWriter(**options)
    for k in range(n):
        log.add_position(start_s + 0.1 * k, 0.1 * k, 0.2 * k, -0.05 * k, yaw=0.3)
    for k in range(n * 2 // 5):
        log.add_setpoint(start_s + 0.25 * k - 0.05, (1.0 + k, 2.0, -0.5), (0.1, 0.2 + k, -0.3))
    return log


def test_positions_and_velocities_are_east_north_up(tmp_path):
    frame = importers.read_ulog(straight().write(tmp_path / "flight.ulg"))
    names = ["time_s", "agent", "x_m", "y_m", "z_m", "heading_rad", "cmd_vx_mps", "cmd_vy_mps", "cmd_vz_mps"]
    assert list(frame.columns) == names
    k = np.arange(100)
    # The command of a row is the last one sent before it: number floor((0.1 k + 0.05) / 0.25).
    held = (100 * k + 50) // 250
    of_all = np.ones(100)
    want = [0.1 * k, 0 * k, 0.2 * k, 0.1 * k, 0.05 * k, (np.pi / 2 - 0.3) * of_all, 2 * of_all, 1.0 + held, 0.5 * of_all]
    # ULog has positions as floats of 32 bits.
    assert np.allclose(columns_of(frame, *names), np.column_stack(want), rtol=0, atol=2e-6)


def test_accelerations_are_taken_where_they_are_asked_for_or_velocities_are_not_set(tmp_path):
    names = ("cmd_ax_mps2", "cmd_ay_mps2", "cmd_az_mps2")
    path = straight().write(tmp_path / "flight.ulg")
    held = (100 * np.arange(100) + 50) // 250
    want = np.column_stack([0.2 + held, np.full(100, 0.1), np.full(100, 0.3)])
    assert np.allclose(columns_of(importers.read_ulog(path, command="acceleration"), *names), want, atol=1e-6)
    unset = straight()
    unset.rows = [(t, n, (*v[:3], *3 * [np.nan], *v[6:])) if n.endswith("_setpoint") else (t, n, v) for t, n, v in unset.rows]
    assert np.allclose(columns_of(importers.read_ulog(unset.write(tmp_path / "unset.ulg")), *names), want, atol=1e-6)
    said = refusal(tmp_path / "unset.ulg", command="velocity")
    assert "has no commands of velocity" in said and "vehicle_local_position_setpoint  40 messages, with acceleration" in said
    # One table holds one kind of command.
    said = refusal([path, tmp_path / "unset.ulg"])
    assert "commanded by acceleration and velocity" in said and 'command="velocity"' in said


def test_trajectory_setpoints_count_where_there_are_no_others(tmp_path):
    log = straight()
    log.rows = [row for row in log.rows if not row[1].endswith("_setpoint")]
    for k in range(100):
        log.add("trajectory_setpoint", 20.0 + 0.1 * k, *3 * [np.nan], 1.0, 2.0, -0.5, *3 * [np.nan])
    frame = importers.read_ulog(log.write(tmp_path / "flight.ulg"))
    assert np.allclose(columns_of(frame, "cmd_vx_mps", "cmd_vy_mps", "cmd_vz_mps"), [2.0, 1.0, 0.5])


def test_thrust_needs_its_full_scale_and_attitudes_turn_with_the_axes(tmp_path):
    rng = np.random.default_rng(5)
    angles = rng.uniform([-0.7, -0.7, -3.0], [0.7, 0.7, 3.0], (50, 3))
    log = straight(50)
    log.rows = [row for row in log.rows if not row[1].endswith("_setpoint")]
    for k, own in enumerate(angles):
        log.add("vehicle_attitude_setpoint", 20.0 + 0.1 * k, *quaternion(turned(*own)), 0.0, 0.0, -0.4 - 0.01 * k)
    path = log.write(tmp_path / "flight.ulg")
    said = refusal(path)
    # The median of 0.40, 0.41 … 0.89.
    for text in ("attitude and thrust setpoints", "no other commands", "not newtons: give thrust_n", "thrust_n is about mass (kg) * 9.81 / 0.645"):
        assert text in said, said
    # On the ground, motors idle.
    for k in range(60):
        log.add("vehicle_attitude_setpoint", 10.0 + 0.1 * k, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.001)
    for time_s, landed in ((9.0, True), (19.0, False)):
        log.add("vehicle_land_detected", time_s, landed, landed)
    assert "9.81 / 0.645" in refusal(log.write(path))
    frame = importers.read_ulog(path, thrust_n=20.0)
    found = columns_of(frame, "cmd_thrust_n", "cmd_roll_rad", "cmd_pitch_rad", "cmd_yaw_rad")
    assert np.allclose(found[:, 0], 20.0 * (0.4 + 0.01 * np.arange(50)), atol=1e-5)
    # From north, east, down to east, north, up, and from forward, right, down of the body to forward, left, up.
    world, body = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.diag([1, -1, -1])
    for own, (_, roll, pitch, yaw) in zip(angles, found, strict=True):
        assert np.allclose(turned(roll, pitch, yaw), world @ turned(*own) @ body, atol=1e-5)
    forward = straight(50)
    for k in range(50):
        forward.add("vehicle_attitude_setpoint", 20.0 + 0.1 * k, 1.0, 0.0, 0.0, 0.0, 0.3, 0.0, -0.4)
    assert "up to 0.3 of the full thrust along the x or y axis" in refusal(forward.write(tmp_path / "wing.ulg"), command="thrust", thrust_n=9.0)
    assert "not newtons: give thrust_n" in refusal(path, command="thrust")
    assert 'thrust_n belongs to command="thrust"' in refusal(path, command="velocity", thrust_n=9.0)
    assert "commands no thrust" in refusal(straight().write(tmp_path / "without.ulg"), thrust_n=9.0)


def test_commands_end_where_they_are_not_set_or_too_old(tmp_path):
    log = straight()
    log.rows = [row for row in log.rows if not row[1].endswith("_setpoint")]
    log.add_setpoint(20.0, (1.0, 0.0, 0.0))
    log.add_setpoint(20.5, (np.nan, 0.0, 0.0))
    log.add_setpoint(22.0, (2.0, 0.0, 0.0))
    path = log.write(tmp_path / "flight.ulg")
    with pytest.warns(importers.RowsLeftOut) as notes:
        frame = importers.read_ulog(path)
    # From 20.0 to 20.4 s, and from 22.0 to 23.0 s; 11 rows follow the command that is not set.
    assert np.allclose(frame["time_s"].to_numpy(), [*np.arange(5) / 10, *(2 + np.arange(11) / 10)])
    (text,) = [str(note.message) for note in notes]
    assert "73 of 100 rows without a command on vehicle_local_position_setpoint in the 1 s before" in text
    assert "11 of 100 rows whose command on vehicle_local_position_setpoint is not set (NaN)" in text
    with pytest.warns(importers.RowsLeftOut):
        assert len(importers.read_ulog(path, within_s=3.0)) == 5 + 31


def test_rows_on_the_ground_and_without_a_valid_position_are_left_out(tmp_path):
    log = straight()
    for time_s, landed, contact in ((19.0, True, True), (21.0, False, True), (22.0, False, False), (29.0, True, True)):
        log.add("vehicle_land_detected", time_s, landed, contact)
    log.rows = [(t, n, v if t != 23_000_000 or n != "vehicle_local_position" else (np.nan, *v[1:7], False, *v[8:])) for t, n, v in log.rows]
    with pytest.warns(importers.RowsLeftOut) as notes:
        frame = importers.read_ulog(log.write(tmp_path / "flight.ulg"))
    (text,) = [str(note.message) for note in notes]
    assert "1 of 100 messages without a valid position" in text and "30 of 99 rows while the vehicle was on the ground" in text
    assert np.allclose(frame["y_m"].to_numpy(), 0.1 * np.array([k for k in range(20, 90) if k != 30]), atol=1e-6)
    # A rover has contact at all times.
    rover = straight()
    rover.add("vehicle_land_detected", 19.0, False, True)
    assert len(importers.read_ulog(rover.write(tmp_path / "rover.ulg"))) == 100


def test_no_position_is_an_error_and_not_a_robot_at_the_origin(tmp_path):
    for name, change, text in (
        ("invalid", lambda v: (*v[:7], False, *v[8:]), "xy_valid is 0 in all 100 messages: the vehicle had no estimate of its horizontal"),
        ("flat", lambda v: (*v[:8], False, *v[9:]), "z_valid is 0 in all 100 messages: the vehicle had no estimate of its height"),
        ("still", lambda v: (0.0, 0.0, *v[2:]), "x and y are 0 and 0 m in all 100 valid messages"),
    ):
        log = straight()
        log.rows = [(t, n, change(v) if n == "vehicle_local_position" else v) for t, n, v in log.rows]
        assert text in refusal(log.write(tmp_path / f"{name}.ulg"))


def test_a_log_without_commands_is_refused_with_what_it_has(tmp_path):
    log = straight()
    log.rows = [row for row in log.rows if not row[1].endswith("_setpoint")]
    log.add("cpuload", 20.0, 0.5)
    log.add("trajectory_setpoint", 20.0, *9 * [np.nan])
    log.add("vehicle_attitude_setpoint", 20.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    said = refusal(log.write(tmp_path / "flight.ulg"))
    for text in (
        "has no commands: commands are velocities or accelerations of vehicle_local_position_setpoint or trajectory_setpoint",
        "\n    trajectory_setpoint  1 messages, with no usable command",
        "\n    vehicle_attitude_setpoint  1 messages, with no usable command",
        "\n    cpuload, vehicle_local_position",
    ):
        assert text in said, said
    without = ULogWriter()
    without.add("cpuload", 20.0, 0.5)
    said = refusal(without.write(tmp_path / "without.ulg"))
    assert "has no vehicle_local_position, from which positions are taken. It has\n    cpuload" in said


def test_gps_dates_the_first_row(tmp_path):
    log = straight(start_s=40.0)
    # The receiver knows no time at first. Then its time is that of 0.02 s before the message.
    for k in range(8):
        log.add("vehicle_gps_position", 40.0 + 0.1 * k, 0, 0)
    for k in range(5):
        log.add("vehicle_gps_position", 41.02 + k, round((GPS_S + 1 + k) * 1e6), -20_000)
    # Whether the vehicle is on the ground is in the time of the log.
    log.add("vehicle_land_detected", 39.0, False, False)
    log.add("vehicle_land_detected", 60.0, True, True)
    frame = importers.read_ulog(log.write(tmp_path / "flight.ulg"))
    assert list(frame.columns)[:2] == ["time_s", "start_epoch_s"]
    assert np.allclose(frame["time_s"].to_numpy(), 0.1 * np.arange(100), atol=1e-6)
    assert np.allclose(frame["start_epoch_s"].to_numpy(), GPS_S, rtol=0, atol=1e-5)


def test_logs_are_runs_and_vehicles_are_agents(tmp_path):
    logs = [("one", "a", 1), ("two", "b", 1), ("three", "a", 1), ("four", "a", 2)]
    paths = [straight(start_s=20.0 + k, uuid=uuid, system=system).write(tmp_path / f"{name}.ulg") for k, (name, uuid, system) in enumerate(logs)]
    frame = importers.read_ulog(paths)
    assert np.unique(columns_of(frame, "run", "agent"), axis=0).tolist() == [[1, 0], [2, 1], [3, 0], [4, 2]]
    assert frame["time_s"].to_numpy().max() < 10
    # One vehicle is agent 0.
    assert set(importers.read_ulog(paths[1])["agent"].to_list()) == {0}


def test_rows_after_a_reset_of_the_estimator_are_a_run_of_their_own(tmp_path):
    log = ULogWriter()
    for k in range(100):
        moved = 3.0 if k >= 40 else 0.0
        log.add_position(20.0 + 0.1 * k, 0.1 * k + moved, 0.0, -1.0, resets=(int(k >= 40), 0), delta=(moved, 0.0, 0.0))
        log.add_setpoint(20.0 + 0.1 * k, (1.0, 0.0, 0.0))
    path = log.write(tmp_path / "flight.ulg")
    with pytest.warns(UserWarning, match=r"moved its position 1 times \(by 3.00 m at most, first 4.0 s after the first position\)"):
        frame = importers.read_ulog(path)
    assert np.unique(frame["run"].to_numpy(), return_counts=True)[1].tolist() == [40, 60]
    # Nothing is interpolated across it.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fine = importers.read_ulog(path, rate_hz=40.0)
    assert len(fine) == 40 * 3.9 + 1 + 40 * 5.9 + 1
    for run in (1, 2):
        own = fine["run"].to_numpy() == run
        north, time_s = fine["y_m"].to_numpy()[own], fine["time_s"].to_numpy()[own]
        assert np.allclose(north - north[0], time_s, atol=1e-5)


def test_bad_messages_and_damaged_logs(tmp_path):
    log = straight()
    log.rows = [(t, n, (np.nan, *v[1:]) if t == 21_000_000 and n == "vehicle_local_position" else v) for t, n, v in log.rows]
    path = log.write(tmp_path / "flight.ulg")
    assert "numbers that are not finite in 1 of 100 messages, first in message 10" in refusal(path)
    with pytest.warns(importers.RowsLeftOut, match="not finite in 1 of 100"):
        assert len(importers.read_ulog(path, bad="drop")) == 99
    whole = straight().write(tmp_path / "whole.ulg").read_bytes()
    # A log that ends in the middle of a message was cut by a loss of power: what is there is good.
    (tmp_path / "cut.ulg").write_bytes(whole[:-2000])
    assert 0 < len(importers.read_ulog(tmp_path / "cut.ulg")) < 100
    (tmp_path / "text.ulg").write_text("a,b\n1,2\n")
    assert "text.ulg cannot be read as ULog" in refusal(tmp_path / "text.ulg")
    # A message of data whose size is wrong.
    (tmp_path / "damaged.ulg").write_bytes(whole + b"\x04\x00D\x00\x00ab")
    assert "damaged.ulg is damaged" in refusal(tmp_path / "damaged.ulg")
    with pytest.warns(importers.RowsLeftOut, match="is damaged"):
        assert len(importers.read_ulog(tmp_path / "damaged.ulg", bad="drop")) == 100
    said = refusal([tmp_path / "text.ulg", tmp_path / "absent.ulg"])
    assert "for 2 reasons" in said and "absent.ulg does not exist" in said


def test_the_first_instance_of_a_topic_counts_and_dropouts_are_named(tmp_path):
    log = straight()
    for k in range(100):
        log.add("vehicle_local_position#1", 20.0 + 0.1 * k, *3 * [9.0], *4 * [0.0], True, True, 0, 0)
    log.dropouts_ms = [30, 0, 170]
    with pytest.warns(importers.RowsLeftOut, match=r"the logger lost all messages for 0.2 s in 2 dropouts, the longest 0.17 s"):
        frame = importers.read_ulog(log.write(tmp_path / "flight.ulg"))
    assert np.allclose(frame["y_m"].to_numpy(), 0.1 * np.arange(100), atol=1e-6)


def test_commands_of_another_time_and_wrong_options(tmp_path):
    late = straight()
    late.rows = [(t + 60_000_000 if n.endswith("_setpoint") else t, n, v) for t, n, v in late.rows]
    said = refusal(late.write(tmp_path / "late.ulg"))
    assert "no pose of vehicle_local_position (20.000 to 29.900 s) has a command of vehicle_local_position_setpoint (79.950 to 89.700 s)" in said
    path = straight().write(tmp_path / "flight.ulg")
    for options, text in (
        ({"command": "position"}, "command must be one of None, 'velocity', 'acceleration', 'thrust', got 'position'"),
        ({"thrust_n": -1}, "thrust_n must be greater than 0 and at most 1e6, got -1"),
        ({"within_s": 0}, "within_s must be greater than 0"),
        ({"bad": "ignore"}, "bad must be one of"),
    ):
        assert text in refusal(path, **options)
    assert refusal([]) == "read_ulog needs at least one log"


def test_a_lost_share_of_the_velocity_is_found_in_a_log(tmp_path):
    """The whole way: logs of a vehicle that reaches four fifths of the commanded velocity, to the name of the effect."""
    rng = np.random.default_rng(8)
    paths = []
    for flight in range(3):
        log, at, command = ULogWriter(), np.zeros(3), np.zeros(3)
        for k in range(300):
            if k % 10 == 0:
                command = rng.uniform(-1.5, 1.5, 3) * [1, 1, 0]
            log.add_setpoint(20.0 + 0.1 * k, command)
            log.add_position(20.0 + 0.1 * k, *(at + rng.normal(0, 0.01, 3)))
            at = at + 0.8 * 0.1 * command
        paths.append(log.write(tmp_path / f"flight-{flight}.ulg"))
    frame = importers.read_ulog(paths)
    found = murmuration.diagnose({"robotsim": {"dynamics": {"kind": "point-mass"}}}, frame)
    assert found["verdict"] == "missing-effects" and found["missing"] == ["slip"]
    (scale,) = re.findall(r"slip: .* scale = ([0-9.]+)", found.printed)
    assert abs(float(scale) - 0.8) < 0.01
