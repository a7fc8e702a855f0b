"""The program that does the work, and what it says when it cannot."""

from __future__ import annotations

import os
import queue
import shutil
import subprocess
import sys
import sysconfig
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from murmuration import _progress
from murmuration._wording import failure, with_keywords


class MurmurationError(RuntimeError):
    """The program failed while it worked. The text says why, in the words of the program."""

    # The name by which users know it, in tracebacks too.
    __module__ = "murmuration"


class InvalidInput(MurmurationError, ValueError):
    """A configuration, an argument or a table of measurements is invalid. The text names each place, value and valid choice."""

    __module__ = "murmuration"


def program() -> Path:
    """Returns the path of the program: of the variable MURMURATION_PROGRAM, else the one installed with the package, else on the PATH.

    Returns
    -------
    pathlib.Path
        The executable.

    Raises
    ------
    MurmurationError
        There is no such program.
    """
    named = os.environ.get("MURMURATION_PROGRAM")
    if named:
        if not Path(named).is_file():
            raise MurmurationError(f"MURMURATION_PROGRAM names no file: {named}")
        return Path(named)
    beside = [Path(sysconfig.get_path("scripts")), Path(sys.executable).parent]
    for folder in beside:
        if (folder / "murmuration").is_file():
            return folder / "murmuration"
    found = shutil.which("murmuration")
    if found is None:
        raise MurmurationError(
            "the program murmuration is not installed: install the wheel murmuration-sim, or name a program in MURMURATION_PROGRAM"
        )
    return Path(found)


def call(arguments: Sequence[str | os.PathLike[str]], progress: bool | None = None, *, quiet: bool = False) -> str:
    """Runs the program and returns what it printed. Ctrl-C ends the program as well.

    With `quiet`, warnings are not passed on. `progress`: see `_progress.display_for`. A `python` that the program starts is the one that runs this, since its folder
    comes first on the path.
    """
    display = _progress.display_for(str(arguments[0]), progress)
    command = [str(program()), *(os.fspath(argument) for argument in _progress.with_search_log(arguments))]
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, env={**os.environ, "PATH": path}, text=True, **streams) as child:
        try:
            printed, said = _follow(child, display)
        except BaseException:
            # In a terminal Ctrl-C reaches the program, too; in a notebook it reaches this process alone.
            child.terminate()
            child.wait()
            raise
        finally:
            display.close()
    if child.returncode != 0:
        kind = InvalidInput if child.returncode == 2 else MurmurationError
        raise kind(failure(said) or printed.strip() or f"{' '.join(command)} ended with exit status {child.returncode}")
    if said.strip() and not quiet:
        print(with_keywords(said), file=sys.stderr)
    return printed


def _follow(child: subprocess.Popen[str], display: _progress.Display) -> tuple[str, str]:
    """What the program prints on standard output and on standard error until it ends, without the progress, which is shown."""
    lines: queue.SimpleQueue[tuple[int, str | None]] = queue.SimpleQueue()

    def read(stream: IO[str], number: int) -> None:
        for line in stream:
            lines.put((number, line))
        lines.put((number, None))

    texts: tuple[list[str], list[str]] = ([], [])
    for number, stream in enumerate((child.stdout, child.stderr)):
        assert stream is not None
        threading.Thread(target=read, args=(stream, number), daemon=True).start()
    n_open = len(texts)
    while n_open:
        try:
            number, line = lines.get(timeout=_progress.DRAW_EVERY_S)
        except queue.Empty:
            display.tick()
            continue
        reported = _progress.read_line(line) if line is not None and number == 1 else None
        if line is None:
            n_open -= 1
        elif reported is not None:
            display.update(reported)
        else:
            texts[number].append(line)
    child.wait()
    return "".join(texts[0]), "".join(texts[1])


def main(name: str) -> None:
    """Becomes the program, under the name that was typed: its messages use it."""
    os.execv(program(), [name, *sys.argv[1:]])
