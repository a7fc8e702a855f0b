"""The tutorial docs/robots-in-python.md: do its files work, and do its commands print the numbers on the page?"""

import os
import re
import sys
from pathlib import Path

from conftest import PROGRAMS, ROOT, program, succeed

PAGE = ROOT / "docs" / "robots-in-python.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?!\w)")


def numbers(line):
    """The numbers of a line; how long a run took is none."""
    return NUMBER.findall(line.partition(" simulated in ")[0])


def test_the_files_of_the_tutorial_print_the_numbers_of_the_page(tmp_path):
    path = f"{Path(sys.executable).parent}:{PROGRAMS}:{os.environ['PATH']}"
    environment = {
        **os.environ, "PATH": path, "PYTHONPATH": str(ROOT / "python" / "src"),
        "MURMURATION_PROGRAM": program("murmuration"), "PYTHONDONTWRITEBYTECODE": "1",
    }  # fmt: skip
    text, n_commands, n_numbers = PAGE.read_text(encoding="utf-8"), 0, 0
    for block in BLOCK.finditer(text):
        kind, body = block.groups()
        if kind in ("python", "toml"):
            # The words before a file name it.
            before = text[: block.start()].rstrip().rpartition("\n\n")[2]
            names = re.findall(rf"`(\w+\.{'py' if kind == 'python' else 'toml'})`", before)
            (tmp_path / names[-1]).write_text(body, encoding="utf-8")
        if kind == "text":
            command, *lines = body.splitlines()
            printed = succeed(command.removeprefix("$ ").split(), cwd=tmp_path, env=environment)
            n_commands += 1
            for line in lines:
                n_numbers += len(numbers(line))
                assert not numbers(line) or numbers(line) in map(numbers, printed.splitlines()), f"{line}\n{printed}"
    assert n_commands == 3 and n_numbers > 10
