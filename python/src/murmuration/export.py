"""Recorded runs in the formats of other programs (docs/viewing.md).

    murmuration.export.rosbag2(run)     # a bag that `ros2 bag play` and `importers.read_bag` read
    murmuration.export.csv(run)         # every table as CSV
"""

from __future__ import annotations

import os
from pathlib import Path

from murmuration._answers import Run
from murmuration._program import call

__all__ = ["csv", "rosbag2"]

Recorded = Run | str | os.PathLike[str]


def rosbag2(run: Recorded, output: str | os.PathLike[str] | None = None) -> Path:
    """Writes a bag of ROS 2 (MCAP): `/robot_N/odom` (nav_msgs/msg/Odometry) of each robot, and `/tf`. Returns its folder.

    `run` is a `Run` or the folder of one. The folder `output` must not exist; by default it is RUN-rosbag2, beside the run.
    """
    return _export(run, "rosbag2", output)


def csv(run: Recorded, output: str | os.PathLike[str] | None = None) -> Path:
    """Writes every table of a run as CSV, a null as an empty field. Returns the folder, by default RUN-csv, beside the run."""
    return _export(run, "csv", output)


def _export(run: Recorded, form: str, output: str | os.PathLike[str] | None) -> Path:
    folder = Path(run.folder if isinstance(run, Run) else run)
    target = folder.with_name(f"{folder.name}-{form}") if output is None else Path(output)
    call(["export", folder, "--format", form, "--out", target])
    return target
