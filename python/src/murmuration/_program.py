"""The program that does the work, and what it says when it cannot."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path


class MurmurationError(RuntimeError):
    """The program failed while it worked: exit status 1. The text is the program's own."""


class InvalidInput(MurmurationError, ValueError):
    """A configuration, an option or a table of measurements is invalid: exit status 2. The text names each place."""


def program() -> Path:
    """The program: that of the variable MURMURATION_PROGRAM, else the one installed with the package, else the one on the path."""
    named = os.environ.get("MURMURATION_PROGRAM")
    if named:
        if not Path(named).is_file():
            raise MurmurationError(f"MURMURATION_PROGRAM names no file: {named}")
        return Path(named)
    beside = [Path(sysconfig.get_path("scripts")), Path(sys.executable).parent]
    for folder in beside:
        if (folder / "orchestrator").is_file():
            return folder / "orchestrator"
    found = shutil.which("orchestrator")
    if found is None:
        raise MurmurationError(
            "the program orchestrator is not installed: install the wheel murmuration-sim, or name a program in MURMURATION_PROGRAM"
        )
    return Path(found)


def call(arguments: Sequence[str | os.PathLike[str]]) -> str:
    """Runs the program and returns what it printed. Ctrl-C ends the program as well."""
    command = [str(program()), *(os.fspath(argument) for argument in arguments)]
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        try:
            printed, said = child.communicate()
        except BaseException:
            # In a terminal Ctrl-C reaches the program, too; in a notebook it reaches this process alone.
            child.terminate()
            child.wait()
            raise
    if child.returncode != 0:
        kind = InvalidInput if child.returncode == 2 else MurmurationError
        raise kind(said.strip() or printed.strip() or f"{' '.join(command)} ended with exit status {child.returncode}")
    if said.strip():
        print(said.strip(), file=sys.stderr)
    return printed


def main() -> None:
    """The command `murmuration`: becomes the program."""
    path = program()
    os.execv(path, [str(path), *sys.argv[1:]])
