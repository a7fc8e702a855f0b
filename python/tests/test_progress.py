"""Progress: which lines of the program count, and what is shown where."""

import os
import pty
import select
import signal
import subprocess
import sys
import time

import pytest

import murmuration
from murmuration import _progress

LONG = {
    "experiment": {"name": "long", "seed": 1, "duration_s": 1e6, "agents": 5, "control_period": {"rate_hz": 10.0}},
    "robotsim": {"scenario": {"kind": "line"}, "controller": {"kind": "flocking", "flock_radius_m": 10.0}},
    "netsim": {"phy": {"propagation": "unit-disk", "radius_m": 20.0}},
    "output": {"report": False},
}

# A program that reports progress, warns, and answers.
PROGRAM = """#!{python}
import sys, time
for k in range(1, 9):
    print(f"step {{16 * k}}/128  {{1.6 * k:.1f}} s simulated  9 steps/s  {{8 - k}} s left", file=sys.stderr, flush=True)
    time.sleep(0.3)
print("warning: something to check", file=sys.stderr)
print("the answer")
"""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def reporting(tmp_path, monkeypatch):
    """That program in place of the real one."""
    path = tmp_path / "reporting"
    path.write_text(PROGRAM.format(python=sys.executable))
    path.chmod(0o755)
    monkeypatch.setenv("MURMURATION_PROGRAM", str(path))
    return path


@pytest.mark.parametrize(
    "line, share",
    [
        ("step 160/1333  48.0 s simulated  32 steps/s  36 s left\n", 160 / 1333),
        ("3 of 12 trials  0.6 a second  15 s left\n", 0.25),
        ("network formation: 7 of 10 motes ready  60.0 s simulated of at most 1800 s; not joined: 3\n", 0.7),
        (" INFO orchestrator::cli::search_log: round 2: 30 of 40 candidates fitted, about 3 s left\n", 0.75),
        (" INFO orchestrator::cli::search_log: + slip\n", None),
    ],
)
def test_lines_of_the_program_are_progress(line, share):
    progress = _progress.read_line(line)
    assert progress is not None and progress.share == share and "INFO" not in progress.text


@pytest.mark.parametrize(
    "line",
    ["warning: 3 of 12 trials failed\n", "note: step 1/2  is a name\n", " INFO netsim::mac: 3 of 4 trials\n", "results in runs/a\n", "\n"],
)
def test_other_lines_are_not(line):
    assert _progress.read_line(line) is None


def test_warnings_are_printed_and_progress_only_on_request(reporting, capfd):
    for progress, n_lines in ((None, 0), (False, 0), (True, 8)):
        assert murmuration._program.call(["run"], progress) == "the answer\n"
        said = capfd.readouterr().err.splitlines()
        assert said[-1] == "warning: something to check" and len(said) == n_lines + 1
        assert all(line.startswith("run: ") and "steps/s" in line for line in said[:-1])


def test_a_terminal_shows_a_bar_that_is_removed(reporting):
    script = 'import sys, murmuration._program as p; sys.stdout.write("answer: " + p.call(["run"]))'
    ours, theirs = pty.openpty()
    child = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=theirs)
    os.close(theirs)
    drawn = b""
    while True:
        try:
            part = os.read(ours, 4096)
        except OSError:
            break
        if not part:
            break
        drawn += part
    assert child.communicate(timeout=60)[0] == b"answer: the answer\n"
    os.close(ours)
    frames = drawn.decode().split("\r\x1b[K")
    bars = [frame for frame in frames if frame.startswith("[")]
    assert bars and all("] run: " in bar and " s, step " in bar and len(bar) < 80 for bar in bars)
    assert len(set(bar.count("#") for bar in bars)) > 1
    # The last frame holds what stays: the warning alone.
    assert frames[-1].split() == "warning: something to check".split()


def test_a_run_and_a_search_report_their_progress(tmp_path):
    """With the real program: the lines that it prints are those that are read."""
    script = f"import murmuration\nmurmuration.run({LONG!r}, out={str(tmp_path)!r}, progress=True)\n"
    child = subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + 60
    assert select.select([child.stderr], [], [], deadline - time.monotonic())[0], "no progress within a minute"
    said = child.stderr.readline()
    os.kill(child.pid, signal.SIGINT)
    child.communicate(timeout=60)
    assert said.startswith("run: ") and " s, step " in said


def test_a_search_reports_its_rounds(capfd):
    import numpy
    import polars

    rng = numpy.random.default_rng(5)
    n = 300
    distance_m = rng.uniform(2.0, 60.0, n)
    zero, one = numpy.zeros(n), numpy.ones(n)
    data = polars.DataFrame({
        "time_s": numpy.arange(n) * 1.0, "tx": zero, "rx": one, "tx_x_m": zero, "tx_y_m": zero, "rx_x_m": distance_m, "rx_y_m": zero,
        "rssi_dbm": -46.2 - 20.0 * numpy.log10(distance_m) + rng.normal(0.0, 1.0, n), "received": one,
    })  # fmt: skip
    murmuration.diagnose({"netsim": {"phy": {"propagation": "friis"}}}, data, progress=True)
    said = capfd.readouterr().err
    assert "diagnose: " in said and "round 1: fitting candidate effects" in said and "INFO" not in said
