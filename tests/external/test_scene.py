"""scene.mcap against the schemas of those who defined them, the package `foxglove-schemas-protobuf`, and against the tables of the run."""

import json
import math

import pyarrow.parquet as pq
import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from conftest import ROOT
from mcap.reader import make_reader

SCHEMAS = {
    "foxglove.FrameTransforms": FrameTransforms,
    "foxglove.Log": Log,
    "foxglove.PosesInFrame": PosesInFrame,
    "foxglove.SceneUpdate": SceneUpdate,
}


def read(path):
    """Messages by topic, decoded by the package's own classes, with their times (ns); and the schemas of the file."""
    topics, schemas = {}, {}
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            schemas[schema.name] = schema
            if schema.name in SCHEMAS:
                decoded = SCHEMAS[schema.name].FromString(message.data)
            else:
                decoded = json.loads(message.data)
            topics.setdefault(channel.topic, []).append((message.log_time, decoded))
    return topics, schemas


@pytest.fixture(scope="module")
def scene(flocking):
    return read(flocking / "scene.mcap")


def test_every_schema_has_the_fields_of_the_package(scene):
    _, schemas = scene
    assert {"foxglove.SceneUpdate", "foxglove.PosesInFrame", "foxglove.FrameTransforms"} <= set(schemas)
    for name, schema in schemas.items():
        if name not in SCHEMAS:
            continue
        messages = {}
        for file in FileDescriptorSet.FromString(schema.data).file:
            messages.update({f"{file.package}.{message.name}": message for message in file.message_type})
        todo, done = [SCHEMAS[name].DESCRIPTOR], set()
        while todo:
            theirs = todo.pop()
            if theirs.full_name in done or theirs.full_name.startswith("google."):
                continue
            done.add(theirs.full_name)
            ours = {field.name: (field.number, field.type) for field in messages[theirs.full_name].field}
            assert ours == {field.name: (field.number, field.type) for field in theirs.fields}
            todo += [field.message_type for field in theirs.fields if field.message_type]


def test_robots_stand_where_the_table_says(scene, flocking):
    topics, _ = scene
    steps = pq.read_table(flocking / "steps.parquet").to_pylist()
    for time_ns, poses in topics["/robots"][::50]:
        rows = [row for row in steps if row["time_ns"] == time_ns and row["alive"]]
        assert len(rows) == len(poses.poses) and poses.frame_id == "world"
        for row, pose in zip(rows, poses.poses):
            assert (pose.position.x, pose.position.y, pose.position.z) == (row["x_m"], row["y_m"], row["z_m"])
            turn = math.hypot(pose.orientation.z, pose.orientation.w)
            assert turn == pytest.approx(1.0) and pose.orientation.x == pose.orientation.y == 0.0
        assert poses.timestamp.seconds * 10**9 + poses.timestamp.nanos == time_ns


def test_lines_join_those_who_heard_each_other(scene, flocking):
    topics, _ = scene
    links = pq.read_table(flocking / "links.parquet").to_pylist()
    heard = {}
    for row in links:
        pair = tuple(sorted((row["sender"], row["receiver"])))
        heard.setdefault(row["time_ns"], set()).add(pair)
    for time_ns, update in topics["/links"][::50]:
        found = [
            tuple(line.indices[k : k + 2])
            for line in update.entities[0].lines
            for k in range(0, len(line.indices), 2)
        ]
        assert len(found) == len(set(found))
        assert set(found) == heard.get(time_ns, set())


def test_metrics_are_those_of_the_table(scene, flocking):
    topics, _ = scene
    sent, delivered = {}, {}
    steps = {row["step"]: row["time_ns"] for row in pq.read_table(flocking / "steps.parquet").to_pylist()}
    for row in pq.read_table(flocking / "transmissions.parquet").to_pylist():
        time_ns = steps[row["step"]]
        sent[time_ns] = sent.get(time_ns, 0) + 1
        delivered[time_ns] = delivered.get(time_ns, 0) + row["n_receivers"]
    for time_ns, metrics in topics["/metrics"]:
        assert metrics["time_s"] == time_ns / 1e9
        assert (metrics["n_sent"], metrics["n_deliveries"]) == (sent.get(time_ns, 0), delivered.get(time_ns, 0))


def test_the_layout_for_foxglove_refers_to_topics_frames_and_fields_of_the_file(scene, flocking):
    topics, _ = scene
    layout = json.loads((ROOT / "docs" / "swarm-layout.json").read_text())
    panels = layout["configById"]

    def arranged(part):
        return [part] if isinstance(part, str) else arranged(part["first"]) + arranged(part["second"])

    assert sorted(arranged(layout["layout"])) == sorted(panels)
    frames = {name for _, message in topics["/tf"] for t in message.transforms for name in (t.parent_frame_id, t.child_frame_id)}
    drawn = panels["3D!swarm"]
    assert drawn["followTf"] in frames
    assert all(layer["frameId"] in frames for layer in drawn["layers"].values())
    # All that a 3-D panel can draw is visible.
    with_shapes = {topic for topic, messages in topics.items() if isinstance(messages[0][1], (PosesInFrame, SceneUpdate))}
    assert {topic for topic, shown in drawn["topics"].items() if shown["visible"]} == with_shapes == {"/robots", "/links", "/site"}
    for path in panels["Plot!neighbours"]["paths"]:
        topic, field = path["value"].rsplit(".", 1)
        assert all(field in message for _, message in topics[topic]), path["value"]
    # A quiet run has no event; the file has their topic all the same.
    with open(flocking / "scene.mcap", "rb") as file:
        channels = {channel.topic for channel in make_reader(file).get_summary().channels.values()}
    assert panels["RosOut!events"]["topicToRender"] in channels
