"""scene.mcap in rerun: the importer of its command-line program reads the poses that the tables of the run have."""

import math
import re
import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path

import pyarrow.parquet as pq
import pytest

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
