"""The notebooks of docs/notebooks: executed in a kernel, and their printed outputs compared with those in the files."""

import nbformat
import pytest
from conftest import ROOT, program
from notebooks import NOTEBOOKS, execute, texts


@pytest.fixture(autouse=True)
def package(monkeypatch):
    """What a kernel needs to import the package of the work tree, with the program that was built."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "python" / "src"))
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setenv("MURMURATION_PROGRAM", program("murmuration"))


def n_pictures(notebook):
    return sum("image/png" in output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", []))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_executes_and_prints_what_it_shows(path, tmp_path):
    shown = nbformat.read(path, as_version=4)
    executed = execute(path, tmp_path)
    assert texts(executed) == texts(shown), "run tests/external/notebooks.py: the outputs have changed"
    assert n_pictures(executed) == n_pictures(shown) > 0


def test_there_is_one_for_each_way_to_begin():
    assert {path.stem for path in NOTEBOOKS} == {"first-run", "missing-link-physics", "robot-from-a-bag", "sweep-figure"}




# A program that reports progress for three seconds.
REPORTING = """#!/usr/bin/env python3
import sys, time
for k in range(1, 6):
    print(f"step {16 * k}/80  1.0 s simulated", file=sys.stderr, flush=True)
    time.sleep(0.6)
"""
# A cell keeps the last state of its output only, so the states before are noted where they are sent.
WATCHING = """
import os
os.environ["MURMURATION_PROGRAM"] = {program!r}
from murmuration import _program, _progress

drawn, show = [], _progress.Notebook._show

def note(self, plain, rich):
    drawn.append((plain, rich))
    show(self, plain, rich)

_progress.Notebook._show = note
_program.call(["run"])
print(len(drawn) > 2, drawn[0][0].startswith("run: "), "<progress max" in drawn[-2][1], drawn[-1])
"""


def test_progress_is_shown_in_a_notebook_and_removed(tmp_path):
    reporting = tmp_path / "reporting"
    reporting.write_text(REPORTING)
    reporting.chmod(0o755)
    path = tmp_path / "progress.ipynb"
    cells = [nbformat.v4.new_code_cell(WATCHING.format(program=str(reporting)))]
    nbformat.write(nbformat.v4.new_notebook(cells=cells), path)
    (cell,) = execute(path, tmp_path).cells
    # Nothing else is left of the bar.
    assert [output.text for output in cell.outputs] == ["True True True ('', '')\n"]
