"""The tutorial docs/real-flight.md: do its commands print the numbers on the page?

The page downloads five public logs. They are not part of the repository, and the suite needs no network: MURMURATION_CASES names
a folder whose `wild/crazyflie-payload` has the tables that the page makes of these logs. The test writes logs of which the page
must make these tables, and puts a program `curl` on the path that hands them out. Samples that the page leaves out are made up.
"""

import csv
import gzip
import math
import os
import struct
import sys
import zlib
from itertools import groupby, pairwise
from pathlib import Path

import pytest
from conftest import program, succeed

TABLES = Path(os.environ["MURMURATION_CASES"]).expanduser().resolve() / "wild" / "crazyflie-payload"
PAGE = "docs/real-flight.md"
DEADLINE_S = 600

ADDRESS = (
    "https://raw.githubusercontent.com/AerialRoboticsUUST/CrazyPAD/5448265fa1bbb3ce983a73a9336cc6e887886360/data/controller_data"
)
# The logs from whose flights each table was made, two flights each.
LOGS = {
    "normal": [f"{ADDRESS}/normal_flight/E9_log{n}" for n in ("00", "01", "02")],
    "w3": [f"{ADDRESS}/add_weight_W3_near_M3/E9_log{n}" for n in ("01", "05")],
}
COLUMNS = [
    *(f"stateEstimate.{axis}" for axis in "xyz"),
    *(f"controller.{name}" for name in ("cmd_thrust", "roll", "pitch", "yaw")),
]
NEWTON_PER_STEP = 7.583e-6
# The tables were made with this factor for the pitch.
RAD_PER_DEG_OF_PITCH = 0.017453
PERIOD_US = 10_000
SAMPLES_PER_ROW, MARGIN = 4, 20

# Writes the log of the address that it is called with: curl -sSf -o FILE ADDRESS.
CURL = """#!{python}
import shutil, sys
_, options, output, path, address = sys.argv
assert (options, output) == ("-sSf", "-o"), sys.argv
shutil.copyfile({logs!r}[address], path)
"""


def logged(row):
    """A row of the table as the quadrotor logged it: microseconds, then single precision."""
    angle = {name: float(row[f"cmd_{name}_rad"]) for name in ("roll", "pitch", "yaw")}
    return (
        round(1e6 * float(row["time_s"])),
        *(float(row[f"{axis}_m"]) for axis in "xyz"),
        float(row["cmd_thrust_n"]) / NEWTON_PER_STEP,
        math.degrees(angle["roll"]),
        -angle["pitch"] / RAD_PER_DEG_OF_PITCH,
        math.degrees(angle["yaw"]),
    )


def flight_of(rows):
    """Samples at 100 Hz, of which the page keeps every fourth; before and after, margins that it cuts off, and the ground."""
    hover = rows[0][1:3] + (0.4,) + rows[0][4:]
    begin_us, end_us = rows[0][0], rows[-1][0]
    yield from ((begin_us - k * PERIOD_US, *hover) for k in range(MARGIN, 0, -1))
    for row, following in pairwise(rows):
        step_us = (following[0] - row[0]) // SAMPLES_PER_ROW
        yield from ((row[0] + k * step_us, *row[1:]) for k in range(SAMPLES_PER_ROW))
    yield rows[-1]
    yield from ((end_us + k * PERIOD_US, *hover) for k in range(1, MARGIN + 1))
    yield (end_us + (MARGIN + 1) * PERIOD_US, *hover[:2], 0.0, *hover[3:])


def log_of(flights):
    """Bytes of a log in version 2 of the format of Bitcraze's uSD deck, as its cfusdlog.py reads it."""
    names = b"".join(f"{name}(f)".encode() + b"\0" for name in COLUMNS)
    parts = [b"\xbc", struct.pack("<HHH", 2, 1, 0xFFFF), b"fixedFrequency\0", struct.pack("<H", len(COLUMNS)), names]
    for flight in flights:
        parts.extend(struct.pack(f"<HQ{len(COLUMNS)}f", 0xFFFF, *sample) for sample in flight_of(flight))
    data = b"".join(parts)
    return data + struct.pack("<I", zlib.crc32(data))


@pytest.fixture
def curl(tmp_path):
    """A folder with a program `curl` that knows the addresses on the page, and nothing else."""
    logs = {}
    for table, addresses in LOGS.items():
        with gzip.open(TABLES / f"{table}.csv.gz", "rt") as file:
            flights = [[logged(row) for row in rows] for _, rows in groupby(csv.DictReader(file), lambda row: row["run"])]
        assert len(flights) == 2 * len(addresses)
        for address, pair in zip(addresses, zip(flights[::2], flights[1::2], strict=True), strict=True):
            logs[address] = str(tmp_path / f"{table}-{len(logs)}")
            Path(logs[address]).write_bytes(log_of(pair))
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "curl").write_text(CURL.format(python=sys.executable, logs=logs))
    (folder / "curl").chmod(0o755)
    return folder


def test_a_real_flight_prints_the_numbers_of_the_page(curl, tmp_path):
    folder = tmp_path / "page"
    folder.mkdir()
    environment = {**os.environ, "PATH": f"{curl}:{os.environ['PATH']}"}
    succeed([program("documented"), PAGE, "--folder", folder], DEADLINE_S, env=environment)
    assert (folder / "better.toml").exists() and (folder / "runs" / "better" / "summary.json").exists()
