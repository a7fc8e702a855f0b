"""Spelling: are there known misspellings in the README, the guide, the Python package, or the help texts?"""

import re
import subprocess
import sys

from conftest import ROOT, program, succeed

IGNORED = ROOT / "tests" / "external" / "spelling_ignored.txt"
SKIPPED = "*.csv,*.gz,*.k7,*.png,*.svg,*_pb2*,*.ipynb"
READ = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs", "python", "configs", "tests/external/README.md"]


def misspelt(*arguments):
    done = subprocess.run(
        [sys.executable, "-m", "codespell_lib", "--ignore-words", IGNORED, "--skip", SKIPPED, *arguments],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    return done.stdout + done.stderr


def test_texts_have_no_known_misspelling():
    assert misspelt(*READ) == ""


def test_help_texts_have_no_known_misspelling(tmp_path):
    orchestrator = program("orchestrator")
    # Commands stand in groups, each with its words after at least two spaces.
    commands = re.findall(r"^  ([a-z][a-z-]*)  +\S", succeed([orchestrator, "--help"]), re.MULTILINE)
    assert len(commands) > 15
    helps = [succeed([orchestrator, command, "--help"]) for command in commands if command != "help"]
    (tmp_path / "help.txt").write_text("\n".join(helps), encoding="utf-8")
    assert misspelt(tmp_path / "help.txt") == ""


def test_a_misspelling_is_found(tmp_path):
    # Put together here, so that this file has none.
    (tmp_path / "page.md").write_text("Robots rec" + "ieve frames.\n", encoding="utf-8")
    assert "receive" in misspelt(tmp_path / "page.md")
