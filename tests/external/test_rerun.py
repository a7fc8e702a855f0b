"""Runs in rerun: scene.mcap as its own importer reads it, and the recordings that `murmuration.export.rerun` writes, against the tables."""

import math
import re
import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from conftest import ROOT
from rerun.chunk import RrdReader

sys.path.insert(0, str(ROOT / "python" / "src"))
import murmuration.export  # noqa: E402

RERUN = Path(sys.executable).with_name("rerun")
FRAME = re.compile(r"\[robot_(\d+)\]")
TIME = re.compile(r"1970-01-01T\d\d:\d\d:\d\d(?:\.\d+)?")
VECTOR = re.compile(r"\[\[([^\[\]]+)\]\]")


def rerun(*arguments):
    done = subprocess.run([RERUN, *map(str, arguments)], check=True, capture_output=True, text=True, timeout=120)
    return done.stdout


@pytest.fixture(scope="module")
def loaded(flocking, tmp_path_factory):
    """The recording as rerun has it."""
    path = tmp_path_factory.mktemp("rerun") / "scene.rrd"
    rerun("mcap", "convert", flocking / "scene.mcap", "-o", path)
    return path


def time_ns(text):
    whole, _, fraction = text.partition(".")
    at = datetime.fromisoformat(whole).replace(tzinfo=timezone.utc)
    return int(at.timestamp()) * 10**9 + int(fraction.ljust(9, "0") or 0)


def test_rerun_lists_the_poses_of_the_tables(loaded, flocking):
    read = {}
    for line in rerun("rrd", "print", "-vvv", "--entity", "/tf", loaded).splitlines():
        frame, time, vectors = FRAME.search(line), TIME.search(line), VECTOR.findall(line)
        if frame and time and vectors:
            assert "[world]" in line
            place = [float(number) for number in vectors[-1].split(",")]
            read[time_ns(time.group()), int(frame.group(1))] = place
    steps = [row for row in pq.read_table(flocking / "steps.parquet").to_pylist() if row["alive"]]
    assert len(read) == len(steps) > 2000
    for row in steps:
        x, y, _ = read[row["time_ns"], row["agent"]]
        assert math.dist((x, y), (row["x_m"], row["y_m"])) < 1e-3


def test_rerun_knows_the_entities_and_their_frame(loaded):
    text = rerun("rrd", "print", loaded)
    for entity, component in [("/robots", "InstancePoses3D:translations"), ("/tf", "Transform3D:translation"), ("/links", "SceneUpdate")]:
        assert any(f" {entity} " in line and component in line for line in text.splitlines()), entity


@pytest.fixture(scope="module")
def exported(flocking, tmp_path_factory):
    """The recording that the Python package writes."""
    return murmuration.export.rerun(flocking, tmp_path_factory.mktemp("rerun") / "flocking.rrd")


def logged(path, entity, component):
    """The values of a component by time (ns); of what does not change by None."""
    found = {}
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path != entity or component not in chunk.to_record_batch().schema.names:
            continue
        batch = chunk.to_record_batch()
        times = batch.column("time").cast("int64").to_pylist() if "time" in batch.schema.names else [None] * batch.num_rows
        found.update(zip(times, batch.column(component).to_pylist()))
    return found


def test_links_are_lines_between_those_who_heard_each_other(exported, flocking):
    strips = logged(exported, "/links", "LineStrips3D:strips")
    places, heard = {}, {}
    for row in pq.read_table(flocking / "steps.parquet").to_pylist():
        places.setdefault(row["time_ns"], {})[row["agent"]] = (row["x_m"], row["y_m"], row["z_m"])
    for row in pq.read_table(flocking / "links.parquet").to_pylist():
        heard.setdefault(row["time_ns"], set()).add(frozenset((row["sender"], row["receiver"])))
    assert set(strips) == set(places) - {0} and sum(map(len, strips.values())) > 5000
    for time_ns, lines in strips.items():
        found = [frozenset(nearest(places[time_ns], end) for end in line) for line in lines]
        assert len(found) == len(set(found))
        assert set(found) == heard.get(time_ns, set()), time_ns


def nearest(places, point):
    """The robot at a place, which is given in single precision."""
    robot = min(places, key=lambda robot: math.dist(places[robot], point))
    assert math.dist(places[robot], point) < 1e-4
    return robot


def test_links_have_the_colours_of_their_signal(exported, flocking):
    colours = logged(exported, "/links", "LineStrips3D:colors")
    strongest = {}
    for row in pq.read_table(flocking / "links.parquet").to_pylist():
        link = (row["time_ns"], frozenset((row["sender"], row["receiver"])))
        strongest[link] = max(row["rssi_dbm"], strongest.get(link, -math.inf))
    # As docs/outputs.md says: blue from -70 dBm on, orange from -85 dBm on, else red.
    classes = {(0, 115, 178, 230): 0, (230, 158, 0, 230): 0, (214, 94, 0, 230): 0}
    for found in colours.values():
        for colour in found:
            classes[tuple(colour.to_bytes(4, "big"))] += 1
    want = [0, 0, 0]
    for rssi_dbm in strongest.values():
        want[0 if rssi_dbm >= -70 else 1 if rssi_dbm >= -85 else 2] += 1
    assert list(classes.values()) == want and min(want[:2]) > 0


def test_robots_and_figures_are_those_of_the_tables(exported, flocking):
    drawn = logged(exported, "/robots", "Points3D:positions")
    names = logged(exported, "/robots", "Points3D:labels")
    steps = {}
    for row in pq.read_table(flocking / "steps.parquet").to_pylist():
        if row["alive"]:
            steps.setdefault(row["time_ns"], {})[f"robot {row['agent']}"] = (row["x_m"], row["y_m"], row["z_m"])
    assert set(drawn) == set(steps)
    for time_ns, want in steps.items():
        found = dict(zip(names[time_ns], drawn[time_ns]))
        assert found.keys() == want.keys()
        assert all(math.dist(found[robot], want[robot]) < 1e-4 for robot in want)
    sent = logged(exported, "/metrics/n_sent", "Scalars:scalars")
    assert len(sent) == len(steps) - 1


def test_walls_and_obstacles_are_where_the_site_has_them(result_of, tmp_path):
    path = murmuration.export.rerun(result_of("walls"), tmp_path / "walls.rrd")
    (walls,) = logged(path, "/site/walls", "Boxes3D:centers").values()
    assert [wall[:2] for wall in walls] == [[10.0, -13.5], [25.0, 13.5]]
    (silo,) = logged(path, "/site/obstacles", "Cylinders3D:radii").values()
    assert silo == [3.0]


def test_the_layout_shows_entities_that_the_recording_has(exported):
    (layout,) = RrdReader(exported).blueprints()
    found = {"ViewContents:query": [], "ViewBlueprint:space_origin": [], "TimePanelBlueprint:timeline": []}
    for chunk in RrdReader(exported).stream(store=layout).to_chunks():
        batch = chunk.to_record_batch()
        for name in found.keys() & set(batch.schema.names):
            found[name] += [value for values in batch.column(name).to_pylist() for value in values]
    queries, origins, timelines = found.values()
    assert timelines == ["time"] and sorted(origins) == ["/", "/events", "/metrics"]
    assert {"+ /links/**", "+ /robots/**"} <= set(queries)
    entities = {chunk.entity_path for chunk in RrdReader(exported).stream().to_chunks()}
    # This run has neither walls nor events.
    known = {"/site", "$origin"} | {entity[:end] for entity in entities for end in range(1, len(entity) + 1) if entity[end : end + 1] in ("", "/")}
    assert {rule.removeprefix("+ ").removesuffix("/**") for rule in queries} <= known


def test_a_run_without_a_scene_is_refused(tmp_path):
    with pytest.raises(murmuration.InvalidInput, match="output.scene = true"):
        murmuration.export.rerun(tmp_path)
    assert list(tmp_path.iterdir()) == []
