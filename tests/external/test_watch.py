"""`run --watch` in a terminal: what a terminal emulator shows of it."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import termios
import time

import pyte
import pytest
from conftest import ROOT, program

ARROWS = set("→↗↑↖←↙↓↘")
COLUMNS, LINES = 140, 44


class Terminal:
    """A program in a terminal of its own."""

    def __init__(self, *arguments):
        self.screen = pyte.Screen(COLUMNS, LINES)
        self.stream = pyte.ByteStream(self.screen)
        self.said = b""
        self.process, self.descriptor = pty.fork()
        if self.process == 0:
            os.chdir(ROOT)
            os.environ["TERM"] = "xterm-256color"
            os.execv(program("orchestrator"), ["orchestrator", *map(str, arguments)])
        fcntl.ioctl(self.descriptor, termios.TIOCSWINSZ, struct.pack("HHHH", LINES, COLUMNS, 0, 0))

    def read(self, seconds):
        """Takes in what comes for so long. Returns whether the program still runs."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            if select.select([self.descriptor], [], [], 0.05)[0]:
                try:
                    part = os.read(self.descriptor, 1 << 16)
                except OSError:
                    return False
                if not part:
                    return False
                self.said += part
                self.stream.feed(part)
        return True

    def until(self, pattern, seconds=20):
        """Until the screen shows it. Returns the match."""
        deadline = time.monotonic() + seconds
        while True:
            found = re.search(pattern, "\n".join(self.screen.display))
            if found:
                return found
            assert time.monotonic() < deadline, "\n".join(self.screen.display)
            self.read(0.1)

    def type(self, keys):
        os.write(self.descriptor, keys)

    def end(self):
        """Waits for the end. Returns the exit status."""
        deadline = time.monotonic() + 60
        while self.read(1):
            if deadline < time.monotonic():
                os.kill(self.process, signal.SIGKILL)
        return os.waitstatus_to_exitcode(os.waitpid(self.process, 0)[1])


def watched(tmp_path, *more):
    return Terminal("run", "configs/flocking.toml", "--out", tmp_path, "--watch", "--live-speed", "10", *more)


def test_the_swarm_moves_pauses_and_steps_in_a_terminal(tmp_path):
    terminal = watched(tmp_path)
    terminal.until(r"flocking, seed 1")
    first = int(terminal.until(r"step (\d+)").group(1))
    terminal.until(r"10 of 10 robots alive")
    arrows = sum(cell in ARROWS for line in terminal.screen.display for cell in line)
    # Robots may share a cell, and while a picture is written one may be on the screen twice.
    assert 1 <= arrows <= 20
    terminal.read(0.5)
    terminal.type(b" ")
    terminal.until("paused")
    terminal.read(0.5)
    paused = int(terminal.until(r"step (\d+)").group(1))
    assert first < paused
    terminal.read(0.7)
    assert int(terminal.until(r"step (\d+)").group(1)) == paused
    terminal.type(b"\x1b[C")
    terminal.until(rf"step {paused + 1}\b")
    terminal.type(b" ")
    assert terminal.end() == 0
    # The terminal is as it was, and the results follow.
    assert b"\x1b[?1049l" in terminal.said
    assert b"results in" in terminal.said.split(b"\x1b[?1049l")[-1]


@pytest.mark.parametrize("keys", [b"", b" "])
def test_ctrl_c_stops_a_run_even_if_it_is_paused_and_keeps_what_was_recorded(tmp_path, keys):
    terminal = watched(tmp_path)
    terminal.until(r"step \d+")
    terminal.type(keys)
    terminal.read(0.5)
    begun = time.monotonic()
    terminal.type(b"\x03")
    assert terminal.end() == 1
    assert time.monotonic() - begun < 5
    assert b"interrupted after step" in terminal.said
    assert (tmp_path / "flocking" / "summary.json").exists()
