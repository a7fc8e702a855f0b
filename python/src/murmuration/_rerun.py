"""`scene.mcap` as a recording of rerun, which does not draw Foxglove's scene entities itself: each becomes a shape of rerun's."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from murmuration._program import InvalidInput

SCENE = "scene.mcap"
APPLICATION = "murmuration"
# The timeline: simulated time (s) from the start of the experiment.
TIMELINE = "time"
ROBOT_COLOUR = (0, 114, 178)
# Widths that do not change with the distance, in points of the screen.
ROBOT_POINTS, HEADING_POINTS, LINE_POINTS = 5.0, 1.5, 1.0
# Metres by which arrows show where robots face.
HEADING_M = 1.0
# Figures that the plot of the layout shows; the recording has all of them.
PLOTTED = ("mean_neighbours", "n_isolated")
# Levels of Foxglove's log messages, from their number.
LEVELS = ("INFO", "DEBUG", "INFO", "WARN", "ERROR", "CRITICAL")


def write(run: Path, target: Path) -> None:
    """Writes the scene of a run as `target`, with a layout. The file appears when it is complete."""
    rr, make_reader = _packages()
    scene = run / SCENE
    if not scene.is_file():
        raise InvalidInput(f"{scene}: no such file; record the run with output.scene = true (the default)")
    unfinished = target.with_name(f"{target.name}.part")
    try:
        with open(scene, "rb") as file, rr.RecordingStream(APPLICATION, recording_id=run.name) as stream:
            stream.save(unfinished, default_blueprint=blueprint())
            stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            messages = _Messages(rr, stream)
            for schema, channel, message in make_reader(file).iter_messages():
                stream.set_time(TIMELINE, duration=np.timedelta64(message.log_time, "ns"))
                messages.add(schema, channel.topic, message.data)
            stream.flush()
            stream.disconnect()
        os.replace(unfinished, target)
    finally:
        unfinished.unlink(missing_ok=True)


def blueprint() -> Any:
    """The layout: the swarm, and beside it figures over time and the events."""
    import rerun.blueprint as rrb

    swarm = rrb.Spatial3DView(origin="/", name="Swarm", contents=["+ /robots/**", "+ /links/**", "+ /site/**"])
    figures = rrb.TimeSeriesView(origin="/metrics", name="Neighbours", contents=[f"+ /metrics/{name}" for name in PLOTTED])
    events = rrb.TextLogView(origin="/events", name="Events")
    views = rrb.Horizontal(swarm, rrb.Vertical(figures, events, row_shares=[3, 2]), column_shares=[7, 3])
    return rrb.Blueprint(views, rrb.TimePanel(timeline=TIMELINE, state="collapsed"), rrb.SelectionPanel(state="collapsed"), rrb.BlueprintPanel(state="collapsed"))


def _packages() -> tuple[Any, Callable[..., Any]]:
    try:
        import rerun
        from mcap.reader import make_reader
    except ImportError:
        raise ImportError('recordings for rerun need rerun-sdk and mcap: pip install "murmuration-sim[rerun]"') from None
    return rerun, make_reader


class _Messages:
    """Logs the messages of a scene."""

    def __init__(self, rr: Any, stream: Any) -> None:
        self.rr, self.stream = rr, stream
        self.classes: dict[int, Any] = {}
        self.topics = {"/tf": self._robots, "/links": self._scene, "/site": self._scene, "/events": self._event}

    def add(self, schema: Any, topic: str, data: bytes) -> None:
        """Adds a message. `/robots` has the poses of `/tf` without the numbers of the robots."""
        if topic == "/metrics":
            for name, value in json.loads(data).items():
                self.stream.log(f"/metrics/{name}", self.rr.Scalars(value))
        elif topic in self.topics:
            self.topics[topic](topic, self._decoded(schema, data))

    def _decoded(self, schema: Any, data: bytes) -> Any:
        if schema.id not in self.classes:
            files = descriptor_pb2.FileDescriptorSet.FromString(schema.data).file
            pool = descriptor_pool.DescriptorPool()
            for file in files:
                pool.Add(file)
            self.classes[schema.id] = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
        return self.classes[schema.id].FromString(data)

    def _robots(self, _topic: str, message: Any) -> None:
        transforms = message.transforms
        labels = [transform.child_frame_id.replace("_", " ") for transform in transforms]
        at = np.array([_xyz(transform.translation) for transform in transforms]).reshape(-1, 3)
        # Robots turn about the vertical alone.
        half = np.array([[transform.rotation.z, transform.rotation.w] for transform in transforms]).reshape(-1, 2)
        facing = 2.0 * np.arctan2(half[:, 0], half[:, 1])
        ahead = HEADING_M * np.stack([np.cos(facing), np.sin(facing), np.zeros(len(facing))], axis=1)
        points = self.rr.Radius.ui_points
        self.stream.log(
            "/robots", self.rr.Points3D(at, radii=points(ROBOT_POINTS), colors=ROBOT_COLOUR, labels=labels, show_labels=False)
        )
        self.stream.log("/robots/heading", self.rr.Arrows3D(origins=at, vectors=ahead, radii=points(HEADING_POINTS), colors=ROBOT_COLOUR))

    def _event(self, topic: str, message: Any) -> None:
        self.stream.log(topic, self.rr.TextLog(message.message, level=LEVELS[message.level] if message.level < len(LEVELS) else "INFO"))

    def _scene(self, topic: str, message: Any) -> None:
        for entity in message.entities:
            path = topic if topic == "/links" else f"{topic}/{entity.id}"
            if entity.lines or topic == "/links":
                self._lines(path, entity.lines)
            if entity.cubes:
                self._cubes(path, entity.cubes)
            if entity.cylinders:
                self._cylinders(path, entity.cylinders)
            for triangles in entity.triangles:
                corners = np.array([_xyz(point) for point in triangles.points])
                indices = np.array(triangles.indices).reshape(-1, 3)
                mesh = self.rr.Mesh3D(vertex_positions=corners, triangle_indices=indices, albedo_factor=_rgba(triangles.color))
                self.stream.log(path, mesh)

    def _lines(self, path: str, lines: Any) -> None:
        """All lines of an entity, and none where it has none any more."""
        strips: list[np.ndarray] = []
        colours = []
        for line in lines:
            points = np.array([_xyz(point) for point in line.points])
            points = points[np.array(line.indices)] if line.indices else points
            if line.type == line.LINE_LIST:
                new = list(points.reshape(-1, 2, 3))
            else:
                new = [np.concatenate([points, points[:1]]) if line.type == line.LINE_LOOP else points]
            strips += new
            colours += [_rgba(line.color)] * len(new)
        radii = self.rr.Radius.ui_points(LINE_POINTS)
        self.stream.log(path, self.rr.LineStrips3D(strips, colors=colours, radii=radii))

    def _cubes(self, path: str, cubes: Any) -> None:
        boxes = self.rr.Boxes3D(
            centers=[_xyz(cube.pose.position) for cube in cubes],
            half_sizes=[[0.5 * length for length in _xyz(cube.size)] for cube in cubes],
            quaternions=[self.rr.Quaternion(xyzw=_xyzw(cube.pose.orientation)) for cube in cubes],
            colors=[_rgba(cube.color) for cube in cubes],
            fill_mode="solid",
        )
        self.stream.log(path, boxes)

    def _cylinders(self, path: str, cylinders: Any) -> None:
        drawn = self.rr.Cylinders3D(
            lengths=[cylinder.size.z for cylinder in cylinders],
            radii=[0.5 * cylinder.size.x for cylinder in cylinders],
            centers=[_xyz(cylinder.pose.position) for cylinder in cylinders],
            colors=[_rgba(cylinder.color) for cylinder in cylinders],
            fill_mode="solid",
        )
        self.stream.log(path, drawn)


def _xyz(vector: Any) -> list[float]:
    return [vector.x, vector.y, vector.z]


def _xyzw(turn: Any) -> list[float]:
    return [turn.x, turn.y, turn.z, turn.w]


def _rgba(colour: Any) -> list[int]:
    return [round(255 * part) for part in (colour.r, colour.g, colour.b, colour.a)]
