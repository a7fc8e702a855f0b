"""Recorded runs in the formats of other programs (docs/viewing.md).

    murmuration.export.rosbag2(run)     # a bag that `ros2 bag play` and `importers.read_bag` read
    murmuration.export.csv(run)         # every table as CSV
    murmuration.export.rerun(run)       # robots, links and site as rerun draws them
"""

from __future__ import annotations

import os
from pathlib import Path

from murmuration import _rerun
from murmuration._answers import Run
from murmuration._program import call
from murmuration._terms import in_python_terms

__all__ = ["csv", "rerun", "rosbag2"]

Recorded = Run | str | os.PathLike[str]


def __dir__() -> list[str]:
    return sorted(__all__)


@in_python_terms
def rosbag2(run: Recorded, output: str | os.PathLike[str] | None = None) -> Path:
    """Writes a run as a bag of ROS 2 (MCAP): `/robot_N/odom` (nav_msgs/msg/Odometry) of each robot, and `/tf`.

    Parameters
    ----------
    run : Run, str or os.PathLike
        The run, or its folder.
    output : str or os.PathLike, optional
        Folder of the bag, which must not exist. By default RUN-rosbag2, beside the run.

    Returns
    -------
    pathlib.Path
        The folder of the bag.

    Raises
    ------
    InvalidInput
        `run` is no recorded run, or `output` exists.
    """
    return _export(run, "rosbag2", output)


@in_python_terms
def csv(run: Recorded, output: str | os.PathLike[str] | None = None) -> Path:
    """Writes every table of a run as CSV, a null as an empty field.

    Parameters
    ----------
    run : Run, str or os.PathLike
        The run, or its folder.
    output : str or os.PathLike, optional
        Folder of the files, which must not exist. By default RUN-csv, beside the run.

    Returns
    -------
    pathlib.Path
        The folder of the files.

    Raises
    ------
    InvalidInput
        `run` is no recorded run, or `output` exists.
    """
    return _export(run, "csv", output)


def rerun(run: Recorded, output: str | os.PathLike[str] | None = None) -> Path:
    """Writes the robots, links, walls, obstacles, figures and events of a run as a recording of rerun, with a layout.

    It is made of the run's scene.mcap, and needs rerun-sdk and mcap: `pip install "murmuration-sim[rerun]"`. The command
    `rerun RUN.rrd` shows it.

    Parameters
    ----------
    run : Run, str or os.PathLike
        The run, or its folder.
    output : str or os.PathLike, optional
        The file to write (.rrd). By default RUN.rrd beside the run; an earlier file of that name is replaced.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    ImportError
        rerun-sdk or mcap is not installed.

    Examples
    --------
    >>> murmuration.export.rerun(run)
    """
    folder = _folder(run)
    target = folder.with_name(f"{folder.name}.rrd") if output is None else Path(output)
    _rerun.write(folder, target)
    return target


def _folder(run: Recorded) -> Path:
    return Path(run.folder if isinstance(run, Run) else run)


def _export(run: Recorded, form: str, output: str | os.PathLike[str] | None) -> Path:
    folder = _folder(run)
    target = folder.with_name(f"{folder.name}-{form}") if output is None else Path(output)
    call(["export", folder, "--format", form, "--out", target])
    return target
