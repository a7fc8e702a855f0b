"""Spelling: are there known misspellings in the README, the guide, the Python package, or the help texts?

`tests/external/run --spelling` runs these tests alone. They need no built program.
"""

import subprocess
import sys

from conftest import ROOT

IGNORED = ROOT / "tests" / "external" / "spelling_ignored.txt"
SKIPPED = "*.csv,*.gz,*.k7,*.png,*.svg,*_pb2*,*.ipynb"
PAGES = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs", "python", "configs", "tests/external/README.md"]
# Help texts are the comments of the arguments.
HELP_TEXTS = ["src/cli.rs", "src/cli", "bench/src/lib.rs", "export/src/lib.rs", "demo/src/starters.rs"]


def misspelt(*arguments):
    done = subprocess.run(
        [sys.executable, "-m", "codespell_lib", "--ignore-words", IGNORED, "--skip", SKIPPED, *arguments],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    return done.stdout + done.stderr


def test_texts_have_no_known_misspelling():
    assert misspelt(*PAGES) == ""


def test_help_texts_have_no_known_misspelling():
    assert misspelt(*(f"orchestrator/{name}" for name in HELP_TEXTS)) == ""


def test_a_misspelling_is_found(tmp_path):
    # Put together here, so that this file has none.
    (tmp_path / "page.md").write_text("Robots rec" + "ieve frames.\n", encoding="utf-8")
    assert "receive" in misspelt(tmp_path / "page.md")
