"""What `murmuration export` writes, read by the programs that it is for, against the tables of the run."""

import csv
import math
import subprocess

import pyarrow.parquet as pq
import pytest
from conftest import program, succeed
from rosbags.highlevel import AnyReader


@pytest.fixture(scope="module")
def network(result_of):
    return result_of("flocking-rrsf")


def exported(run, form, folder):
    output = folder / form
    said = succeed([program("murmuration"), "export", run, "--format", form, "--out", output])
    return output, said


def test_every_table_is_there_as_csv_with_every_value(network, tmp_path):
    output, said = exported(network, "csv", tmp_path)
    tables = sorted(network.glob("*.parquet"))
    assert sorted(path.stem for path in output.iterdir()) == [path.stem for path in tables]
    for table in tables:
        want = pq.read_table(table)
        assert f"{table.stem}.csv: {want.num_rows} rows" in said
        with open(output / f"{table.stem}.csv", newline="") as file:
            rows = list(csv.reader(file))
        if want.num_rows == 0:
            continue
        assert rows[0] == want.column_names
        for name, column in zip(rows[0], zip(*rows[1:], strict=True), strict=True):
            for text, value in zip(column, want[name].to_pylist(), strict=True):
                if value is None:
                    assert text == ""
                elif isinstance(value, bool):
                    assert text == str(value).lower()
                elif isinstance(value, float) and want.schema.field(name).type == "double":
                    assert float(text) == value
                elif isinstance(value, float):
                    assert math.isclose(float(text), value, rel_tol=1e-7)
                else:
                    assert text == str(value)


def test_a_bag_holds_where_every_robot_was(flocking, tmp_path):
    output, said = exported(flocking, "rosbag2", tmp_path)
    states = {(row["time_ns"], row["agent"]): row for row in pq.read_table(flocking / "steps.parquet").to_pylist()}
    seen = set()
    with AnyReader([output]) as bag:
        topics = {connection.topic: connection.msgtype for connection in bag.connections}
        assert topics.pop("/tf") == "tf2_msgs/msg/TFMessage"
        assert topics == {f"/robot_{agent}/odom": "nav_msgs/msg/Odometry" for agent in range(10)}
        assert f"{bag.message_count} messages" in said
        for connection, time_ns, data in bag.messages():
            message = bag.deserialize(data, connection.msgtype)
            if connection.topic == "/tf":
                for transform in message.transforms:
                    agent = int(transform.child_frame_id.removeprefix("robot_"))
                    place, at = transform.transform.translation, states[time_ns, agent]
                    assert (place.x, place.y, place.z) == (at["x_m"], at["y_m"], at["z_m"])
                    assert transform.header.frame_id == "world"
                continue
            agent = int(connection.topic.split("/")[1].removeprefix("robot_"))
            at = states[time_ns, agent]
            seen.add((time_ns, agent))
            stamp = message.header.stamp
            assert stamp.sec * 1_000_000_000 + stamp.nanosec == time_ns
            assert (message.header.frame_id, message.child_frame_id) == ("world", f"robot_{agent}")
            place, turn, speed = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist.linear
            assert (place.x, place.y, place.z) == (at["x_m"], at["y_m"], at["z_m"])
            heading = 2 * math.atan2(turn.z, turn.w)
            # Velocities are in the axes of the robot.
            east = speed.x * math.cos(heading) - speed.y * math.sin(heading)
            north = speed.x * math.sin(heading) + speed.y * math.cos(heading)
            assert math.isclose(east, at["vx_mps"], abs_tol=1e-9) and math.isclose(north, at["vy_mps"], abs_tol=1e-9)
    assert seen == set(states)


def test_nothing_is_overwritten_and_wrong_folders_are_refused(flocking, tmp_path):
    output, _ = exported(flocking, "csv", tmp_path)
    again = [program("murmuration"), "export", flocking, "--format", "csv", "--out", output]
    done = subprocess.run(list(map(str, again)), capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "exists" in done.stderr
    for form in ("csv", "rosbag2"):
        done = subprocess.run(
            [program("murmuration"), "export", str(tmp_path), "--format", form, "--out", str(tmp_path / f"of-{form}")],
            capture_output=True, text=True, check=False,
        )
        assert done.returncode == 2 and not (tmp_path / f"of-{form}").exists()
