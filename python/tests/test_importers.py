"""Bags, logs and data frames as tables of measurements, and runs as bags."""

import re
import sys
import warnings

import numpy as np
import pytest
from bags import START_NS, START_S, BagWriter
from rosbags.rosbag2 import StoragePlugin

import murmuration
from murmuration import importers

S = 1_000_000_000


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def columns_of(frame, *names):
    return np.column_stack([frame[name].to_numpy() for name in names])


def two_robots(**options):
    """Two robots with poses every 0.1 s and commands every 0.25 s, from 0.05 s before the first pose on."""
    bag = BagWriter(**options)
    for robot in range(2):
        for k in range(100):
            bag.add_odometry(f"/robot_{robot}/odom", START_NS + k * S // 10, k * 0.1, robot, 0.01 * k)
        for k in range(40):
            bag.add_twist(f"/robot_{robot}/cmd_vel", START_NS + k * S // 4 - S // 20, 0.5 + k, turn=0.1 * robot)
    return bag


def refusal(*arguments, **options):
    with pytest.raises(murmuration.InvalidInput) as error:
        importers.read_bag(*arguments, **options)
    return str(error.value)


@pytest.mark.parametrize("storage", ["ros1", StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_every_kind_of_bag_gives_the_same_table(tmp_path, storage):
    bag = two_robots(ros1=storage == "ros1").write(tmp_path / "bag", storage)
    assert importers.find_robots(bag) == {
        f"robot_{robot}": {"pose": f"/robot_{robot}/odom", "command": f"/robot_{robot}/cmd_vel"} for robot in range(2)
    }
    topics = importers.bag_topics(bag)
    assert topics["topic"].to_list() == ["/robot_0/cmd_vel", "/robot_0/odom", "/robot_1/cmd_vel", "/robot_1/odom"]
    assert topics["messages"].to_list() == [40, 100, 40, 100]
    frame = importers.read_bag(bag)
    assert list(frame.columns) == [
        "time_s", "start_epoch_s", "agent", "x_m", "y_m", "z_m", "heading_rad", "cmd_speed_mps", "cmd_yaw_rate_radps",
    ]  # fmt: skip
    k = np.tile(np.arange(100), 2)
    robot = np.repeat([0, 1], 100)
    # The command of a row is the last one sent before it: number floor((0.1 k + 0.05) / 0.25).
    held = (100 * k + 50) // 250
    want = np.column_stack([0.1 * k, robot, 0.1 * k, robot, 0.01 * k, 0.5 + held, 0.1 * robot])
    got = columns_of(frame, "time_s", "agent", "x_m", "y_m", "heading_rad", "cmd_speed_mps", "cmd_yaw_rate_radps")
    assert np.allclose(got, want, rtol=0, atol=1e-9)
    assert set(frame["start_epoch_s"].to_list()) == {START_S}
    # A file of a bag is a bag as well.
    if storage == StoragePlugin.MCAP:
        (file,) = bag.glob("*.mcap")
        assert importers.read_bag(file).equals(frame)


def test_a_bag_gives_the_table_that_convert_makes_of_the_same_logs(tmp_path):
    """Commands in force, their age, headings, time base: one meaning, two programs."""
    import polars

    rng = np.random.default_rng(3)
    bag, poses, commands = BagWriter(), [], []
    for robot in ("alpha", "beta"):
        time_ns = START_NS + np.cumsum(rng.integers(20_000_000, 400_000_000, 200))
        for t in time_ns.tolist():
            quaternion = rng.normal(size=4)
            quaternion /= np.linalg.norm(quaternion)
            x, y, z = rng.uniform(-5, 5, 3)
            bag.add_pose(f"/{robot}/pose", t, x, y, z=z, quaternion=tuple(quaternion))
            poses.append((t // S, t % S, robot, x, y, z, *quaternion))
        for t in (START_NS + np.cumsum(rng.integers(100_000_000, 1_500_000_000, 45))).tolist():
            speed, turn = rng.uniform(-1, 1, 2)
            bag.add_twist(f"/{robot}/cmd_vel", t, speed, turn=turn, frame="base_link")
            commands.append((t // S, t % S, robot, speed, turn))
    with pytest.warns(importers.RowsLeftOut, match=r"rows without a command on /alpha/cmd_vel in the 1 s before"):
        imported = importers.read_bag(bag.write(tmp_path / "bag"))
    pose_columns = {"time_s": ["s", "ns"], "agent": "name", "x_m": "x", "y_m": "y", "z_m": "z", "heading_rad": ["qx", "qy", "qz", "qw"]}
    command_columns = {"time_s": ["s", "ns"], "agent": "name", "cmd_speed_mps": "v", "cmd_yaw_rate_radps": "w"}
    names = (["s", "ns", "name", "x", "y", "z", "qx", "qy", "qz", "qw"], ["s", "ns", "name", "v", "w"])
    frames = [polars.DataFrame(rows, schema=own, orient="row") for rows, own in zip((poses, commands), names, strict=True)]
    inputs = [{"files": frame, "columns": own} for frame, own in zip(frames, (pose_columns, command_columns), strict=True)]
    converted = importers.convert({"table": "robots", "input": inputs})
    assert imported.columns == converted.columns and 200 < len(imported) < 400
    order = ["agent", "time_s"]
    one, other = (frame.sort(order).to_numpy() for frame in (imported, converted))
    assert np.allclose(one, other, rtol=0, atol=1e-9)


def test_cars_and_localization_beside_odometry(tmp_path):
    bag = BagWriter()
    for k in range(50):
        bag.add_pose("/pf/pose", START_NS + k * S // 10, 0.2 * k, 0.0, 3.0, covariance=True)
        bag.add_odometry("/odom", START_NS + k * S // 10, 9.0, 9.0)
        bag.add_drive("/drive", START_NS + k * S // 10, 2.0, 0.1)
    path = bag.write(tmp_path / "bag")
    with pytest.raises(murmuration.InvalidInput) as error:
        importers.find_robots(path)
    for line in ("/drive  ackermann_msgs/msg/AckermannDriveStamped  50 messages", "/odom  nav_msgs/msg/Odometry", "robots="):
        assert line in str(error.value)
    frame = importers.read_bag(path, {"car": {"pose": "/pf/pose", "command": "/drive"}})
    assert np.allclose(columns_of(frame, "x_m", "heading_rad", "cmd_speed_mps")[-1], [9.8, 3.0, 2.0])
    assert np.allclose(frame["cmd_steer_rad"].to_numpy(), 0.1)
    without_commands = BagWriter()
    without_commands.messages = [one for one in bag.messages if one[1] != "/drive"]
    assert "which topics of" in refusal(without_commands.write(tmp_path / "without"))
    unstamped = BagWriter()
    unstamped.messages = [one for one in bag.messages if one[1] == "/pf/pose"]
    unstamped.add_drive("/drive", START_NS, 2.0, 0.1, stamped=False)
    with pytest.warns(importers.RowsLeftOut, match=r"39 of 50 rows without a command on /drive in the 1 s before"):
        assert len(importers.read_bag(unstamped.write(tmp_path / "unstamped"))) == 11


def test_transforms_are_robots_by_child_frame(tmp_path):
    bag = BagWriter()
    for k in range(20):
        time_ns = START_NS + k * S // 10
        bag.add_transforms("/tf", time_ns, [bag.transform(f"robot_{r}", time_ns, k, r, 0.5) for r in (2, 10)])
        for r in (2, 10):
            bag.add_twist(f"/robot_{r}/cmd_vel", time_ns, r)
    bag.add_transforms("/tf_static", START_NS, [bag.transform("camera", START_NS, 0, 0, parent="robot_2")])
    path = bag.write(tmp_path / "bag")
    frame = importers.read_bag(path)
    # In natural order, robot_2 is before robot_10.
    want = [[0, 2, 2], [1, 10, 10]]
    assert np.unique(columns_of(frame, "agent", "y_m", "cmd_speed_mps"), axis=0).tolist() == want
    one = importers.read_bag(path, {7: {"pose": "/tf", "frame": "robot_10", "command": "/robot_10/cmd_vel"}})
    assert set(one["agent"].to_list()) == {7} and set(one["y_m"].to_list()) == {10.0}
    said = refusal(path, {7: {"pose": "/tf", "frame": "robot_1"}})
    assert "has no child frame robot_1; the nearest is robot_10. Its child frames: robot_10, robot_2" in said


def test_velocities_are_turned_into_the_world(tmp_path):
    bag = BagWriter()
    for k in range(20):
        time_ns = START_NS + k * S // 10
        bag.add_odometry("/odom", time_ns, k, 0, np.pi / 2)
        bag.add_twist("/cmd_vel", time_ns, 1.0, 0.25, 0.5)
    path = bag.write(tmp_path / "bag")
    assert 'commands up to 0.5 m/s along linear.y or linear.z, where a unicycle cannot move: write twist="velocity"' in refusal(path)
    names = ("cmd_vx_mps", "cmd_vy_mps", "cmd_vz_mps")
    assert np.allclose(columns_of(importers.read_bag(path, twist="velocity"), *names), [-0.25, 1.0, 0.5])
    world = importers.read_bag(path, twist="velocity", command_frame="world")
    assert np.allclose(columns_of(world, *names), [1.0, 0.25, 0.5])
    for frame, want in (("odom", [1.0, 0.25, 0.5]), ("base_link", [-0.25, 1.0, 0.5])):
        stamped = BagWriter()
        stamped.messages = [one for one in bag.messages if one[1] == "/odom"]
        for k in range(20):
            stamped.add_twist("/cmd_vel", START_NS + k * S // 10, 1.0, 0.25, 0.5, frame=frame)
        found = importers.read_bag(stamped.write(tmp_path / frame), twist="velocity")
        assert np.allclose(columns_of(found, *names), want)


def test_several_bags_are_runs(tmp_path):
    paths = []
    for name in ("first", "second"):
        bag = BagWriter()
        shift_ns = 3600 * S * len(paths)
        for k in range(30):
            bag.add_odometry("/odom", START_NS + shift_ns + k * S // 10, k, len(paths))
            bag.add_twist("/cmd_vel", START_NS + shift_ns + k * S // 10, 1.0)
        paths.append(bag.write(tmp_path / name))
    frame = importers.read_bag(paths)
    assert list(frame.columns)[:3] == ["run", "time_s", "start_epoch_s"]
    starts = np.unique(columns_of(frame, "run", "start_epoch_s", "y_m"), axis=0)
    assert starts.tolist() == [[1, START_S, 0], [2, START_S + 3600, 1]]
    assert frame["time_s"].to_numpy().max() < 3


def test_poses_at_a_rate_are_interpolated_and_gaps_are_not(tmp_path):
    bag = BagWriter()
    for k in (*range(10), *range(40, 50)):
        # The heading passes from pi to -pi.
        bag.add_odometry("/odom", START_NS + k * S // 10, 0.3 * k, 1.0, 3.0 + 0.05 * k)
        bag.add_twist("/cmd_vel", START_NS + k * S // 10, k)
    frame = importers.read_bag(bag.write(tmp_path / "bag"), rate_hz=20.0)
    time_s = frame["time_s"].to_numpy()
    assert np.allclose(time_s, np.concatenate([np.arange(0, 0.91, 0.05), np.arange(4.0, 4.91, 0.05)]))
    assert np.allclose(frame["x_m"].to_numpy(), 3.0 * time_s, atol=1e-9)
    turned = frame["heading_rad"].to_numpy() - (3.0 + 0.5 * time_s)
    assert np.allclose(np.sin(turned / 2), 0, atol=1e-9)
    # Commands are held.
    assert np.array_equal(frame["cmd_speed_mps"].to_numpy(), np.floor(np.round(time_s / 0.1, 6)))


def test_times_of_the_bag_where_headers_have_another_clock_or_none(tmp_path):
    bag = BagWriter()
    for k in range(30):
        bag.add_odometry("/odom", 5 * S + k * S // 10, k, 0, recorded_ns=START_NS + k * S // 10)
        bag.add_twist("/cmd_vel", 0, 1.0, recorded_ns=START_NS + k * S // 10)
    path = bag.write(tmp_path / "bag")
    said = refusal(path)
    assert "no pose of /odom (5.000 to 7.900 s) has a command of /cmd_vel" in said and 'time="recorded"' in said
    frame = importers.read_bag(path, time="recorded")
    assert len(frame) == 30 and frame["start_epoch_s"].to_list()[0] == START_S
    zero = BagWriter()
    for k in range(30):
        zero.add_odometry("/odom", 0, k, 0, recorded_ns=START_NS + k * S // 10)
        zero.add_twist("/cmd_vel", 0, 1.0, frame="base_link", recorded_ns=START_NS + k * S // 10)
    assert np.allclose(importers.read_bag(zero.write(tmp_path / "zero"))["time_s"].to_numpy(), 0.1 * np.arange(30))


def test_all_mistakes_are_named_at_once(tmp_path):
    bag = BagWriter(silent=[("/d/odom", "nav_msgs/msg/Odometry")])
    for k in range(30):
        time_ns = START_NS + k * S // 10
        bag.add_odometry("/a/odom", time_ns - (S if k in (12, 13) else 0), k, 0, recorded_ns=time_ns)
        bag.add_odometry("/b/odom", time_ns, np.nan if k == 7 else k, 0)
        bag.add_odometry("/c/odom", time_ns, k, 0, quaternion=(0.0, 0.0, 0.0, 0.0))
        bag.add_twist("/cmd_vel", time_ns, 1.0)
    path = bag.write(tmp_path / "bag")
    robots = {name: {"pose": f"/{name}/odom", "command": "/cmd_vel"} for name in "abcd"}
    robots |= {"e": {"pose": "/a/odmo"}, "f": {"pose": "/cmd_vel"}, "g": {"command": "/cmd_vel"}, "h": "/nowhere"}
    said = refusal([path, tmp_path / "absent"], robots)
    for text in (
        "/a/odom (robot a of ",
        "times that go back in 2 of 30 messages, first in message 12 (by 0.900 s, to 1700000000.450 s)",
        "/b/odom (robot b of ",
        "numbers that are not finite in 1 of 30 messages, first in message 7",
        "the orientation is no rotation, or points up, in 30 of 30 messages",
        "robot d: the topic /d/odom",
        "has no messages",
        "has no topic /a/odmo; the nearest name is /a/odom",
        "the topic /cmd_vel of",
        "is of type geometry_msgs/msg/Twist; it must be one of nav_msgs/msg/Odometry",
        "robot g: must be a namespace or a mapping",
        "has no poses below /nowhere/",
        "absent does not exist",
    ):
        assert text in said, said
    kept = {name: robots[name] for name in "ab"}
    with pytest.warns(importers.RowsLeftOut) as notes:
        frame = importers.read_bag(path, kept, bad="drop")
    (text,) = [str(note.message) for note in notes]
    assert "times that go back in 2 of 30" in text and "not finite in 1 of 30" in text
    assert len(frame) == 28 + 29


def test_damaged_bags_and_wrong_options_are_refused(tmp_path):
    path = two_robots().write(tmp_path / "bag")
    (file,) = path.glob("*.mcap")
    whole = file.read_bytes()
    cut = tmp_path / "cut.mcap"
    for length in (0, 5, 200, len(whole) // 2, len(whole) - 3):
        cut.write_bytes(whole[:length])
        assert "cut.mcap" in refusal(cut)
    (tmp_path / "text.csv").write_text("a,b\n1,2\n")
    assert "cannot be opened as a folder with a bag of ROS 2" in refusal(tmp_path / "text.csv")
    for options, text in (
        ({"twist": "car"}, "twist must be one of 'unicycle', 'velocity', got 'car'"),
        ({"command_frame": "map"}, "command_frame must be one of None, 'robot', 'world', got 'map'"),
        ({"time": "now"}, "time must be one of"),
        ({"bad": "ignore"}, "bad must be one of"),
        ({"within_s": 0}, "within_s must be greater than 0 and at most 1e9, got 0"),
        ({"rate_hz": float("nan")}, "rate_hz must be greater than 0"),
    ):
        assert text in refusal(path, **options)
    assert refusal([]) == "read_bag needs at least one log"


def test_robots_that_are_commanded_in_two_ways_do_not_share_a_table(tmp_path):
    bag = BagWriter()
    for k in range(30):
        for name in "abc":
            bag.add_odometry(f"/{name}/odom", START_NS + k * S // 10, k, 0)
        bag.add_twist("/a/cmd_vel", START_NS + k * S // 10, 1.0)
        bag.add_drive("/b/drive", START_NS + k * S // 10, 1.0, 0.1)
    path = bag.write(tmp_path / "bag")
    said = refusal(path)
    assert "one table holds one kind of command" in said and "has no commands for c" in said
    assert len(importers.read_bag(path, {0: "/a"})) == 30


def test_tables_are_of_pandas_where_there_is_no_polars(tmp_path, monkeypatch):
    import pandas

    path = two_robots().write(tmp_path / "bag")
    wanted = importers.read_bag(path)
    monkeypatch.setitem(sys.modules, "polars", None)
    frame = importers.read_bag(path)
    assert isinstance(frame, pandas.DataFrame) and list(frame.columns) == wanted.columns
    assert np.array_equal(frame.to_numpy(), wanted.to_numpy())
    again = importers.convert({"table": "robots", "input": [{"files": frame, "columns": {name: name for name in frame.columns}}]})
    assert isinstance(again, pandas.DataFrame) and np.allclose(again[frame.columns].to_numpy(), frame.to_numpy(), rtol=0, atol=1e-9)


def test_a_slip_in_a_bag_is_found(tmp_path):
    """The whole way: a bag of unicycles that lose a fifth of their speed, to the name of the effect and its size."""
    rng = np.random.default_rng(8)
    bag, step_s = BagWriter(), 0.1
    for robot in range(2):
        at, heading = np.array([0.0, 5.0 * robot]), 0.3 * robot
        for k in range(300):
            time_ns = START_NS + k * S // 10
            if k % 10 == 0:
                speed, turn = rng.uniform(0.3, 1.5), rng.uniform(-0.6, 0.6)
                bag.add_twist(f"/robot_{robot}/cmd_vel", time_ns, speed, turn=turn)
            measured = at + rng.normal(0, 0.01, 2)
            bag.add_odometry(f"/robot_{robot}/odom", time_ns, *measured, heading + rng.normal(0, 0.005))
            middle = heading + turn * step_s / 2
            at = at + 0.8 * speed * step_s * np.array([np.cos(middle), np.sin(middle)])
            heading += turn * step_s
    frame = importers.read_bag(bag.write(tmp_path / "bag"))
    found = murmuration.diagnose({"robotsim": {"dynamics": {"kind": "unicycle"}}}, frame)
    assert found["verdict"] == "missing-effects" and found["missing"] == ["slip"]
    (scale,) = re.findall(r"slip: .* scale = ([0-9.]+)", found.printed)
    assert abs(float(scale) - 0.8) < 0.005


RUN = {
    "experiment": {"name": "small", "seed": 4, "duration_s": 5.0, "agents": 4, "control_period": {"rate_hz": 10.0}},
    "robotsim": {"scenario": {"kind": "line"}, "controller": {"kind": "flocking", "flock_radius_m": 10.0}},
    "netsim": {"phy": {"propagation": "unit-disk", "radius_m": 20.0}},
    "output": {"report": False},
}


def test_a_run_becomes_a_bag_and_the_bag_its_positions(tmp_path):
    run = murmuration.run(RUN, out=tmp_path)
    folder = murmuration.export.rosbag2(run)
    assert folder == tmp_path / "small-rosbag2"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frame = importers.read_bag(folder)
    assert list(frame.columns) == ["time_s", "agent", "x_m", "y_m", "z_m", "heading_rad"]
    steps = run.steps.sort(["agent", "time_ns"])
    assert np.array_equal(columns_of(frame, "agent", "x_m", "y_m", "z_m"), columns_of(steps, "agent", "x_m", "y_m", "z_m"))
    assert np.array_equal(np.round(frame["time_s"].to_numpy() * 1e9), steps["time_ns"].to_numpy())
    # Transforms are the other half of the bag.
    transforms = importers.read_bag(folder, {agent: {"pose": "/tf", "frame": f"robot_{agent}"} for agent in range(4)})
    assert transforms.equals(frame)
    with pytest.raises(murmuration.InvalidInput, match="exists"):
        murmuration.export.rosbag2(run)


def test_a_run_becomes_csv(tmp_path):
    import polars

    run = murmuration.run(RUN, out=tmp_path)
    folder = murmuration.export.csv(run.folder, tmp_path / "tables")
    assert polars.read_csv(folder / "steps.csv")["x_m"].to_list() == run.steps["x_m"].to_list()
    assert {path.stem for path in folder.iterdir()} == {path.stem for path in run.folder.glob("*.parquet")}


def test_mappings_are_refused_with_the_text_of_the_program(tmp_path):
    with pytest.raises(murmuration.InvalidInput, match='nearest valid: "robots"'):
        importers.convert({"table": "robot", "input": [{"files": "a.csv", "columns": {}}]})
    assert not list(tmp_path.iterdir())


def test_packet_logs_become_packets_and_links(tmp_path):
    """A log as the root of an OpenWSN network prints it: two packets over one hop, one that arrived twice, a line that is damaged."""

    def line(arrived, created, sequence, hops):
        asn = [[number >> 8 * byte & 0xFF for byte in range(5)] for number in (arrived, created)]
        given = [hops[-1][0], *asn[0], *asn[1], sequence & 0xFF, sequence >> 8, 0]
        own = given + [number for hop in hops for number in hop]
        return f"{own + [0] * (38 - len(own))}\t0:00:01.5\n"

    first = line(258, 200, 3, [(7, 3, 26, 84)])
    # As few packets as a table may have.
    others = "".join(line(658 + 200 * k, 600 + 200 * k, 6 + k, [(7, 2, 11, 60)]) for k in range(18))
    (tmp_path / "root.log").write_text(first + line(458, 400, 5, [(7, 2, 11, 60)]) + first + "[1, 2]\n" + others)
    log = {"files": tmp_path / "root.log", "format": "openwsn-packets"}
    packets = importers.convert({"table": "packets", "input": [log]})
    names = ("time_s", "received_s", "source", "destination", "sequence", "hops")
    assert len(packets) == 20 and columns_of(packets, *names)[:2].tolist() == [[3.0, 3.87, 7, 1, 3, 1], [6.0, 6.87, 7, 1, 5, 1]]
    with_lost = importers.convert({"table": "packets", "lost_from_gaps": True, "input": [log]})
    assert sorted(with_lost["sequence"].to_list()) == list(range(3, 24)) and with_lost["received_s"].null_count() == 1
