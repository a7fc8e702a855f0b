"""Executes the notebooks of docs/notebooks in a kernel, and keeps what they print.

    python tests/external/notebooks.py      executes all of them, and writes their outputs into the files

The package `murmuration` must be importable and find its program.
"""

import re
import sys
import tempfile
from pathlib import Path

import nbformat
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))

# Greatest duration of a cell (s). Whole notebooks take under a minute on two cores with nothing else to do.
CELL_DEADLINE_S = 120


def execute(path, folder):
    """The notebook with its outputs, executed in `folder`. A cell that fails raises its error."""
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    with tempfile.TemporaryDirectory() as sockets:
        # No port is opened.
        kernel = AsyncKernelManager(kernel_name="python3", transport="ipc", ip=f"{sockets}/kernel")
        client = NotebookClient(notebook, km=kernel, timeout=CELL_DEADLINE_S, resources={"metadata": {"path": str(folder)}})
        client.execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            cell.outputs = [output for output in map(_plain, cell.outputs) if output is not None]
    notebook.metadata.pop("widgets", None)
    notebook.metadata["language_info"] = {"name": "python"}
    return notebook


def _plain(output):
    """An output without what is only for a page: None where a progress bar was removed."""
    if "data" not in output:
        return output
    kept = {kind: content for kind, content in output.data.items() if kind in ("text/plain", "image/png")}
    if not any(kept.values()):
        return None
    output.data = kept
    return output


def texts(notebook):
    """What each code cell prints: its text outputs, without pictures."""
    found = []
    for cell in notebook.cells:
        if cell.cell_type == "code":
            printed = [output.get("text") or output.get("data", {}).get("text/plain", "") for output in cell.outputs]
            found.append(same_on_all_machines("\n".join(printed)))
    return found


def same_on_all_machines(text):
    """A text without what depends on the processor: numpy's sine and cosine differ in the last digit, and so do a notebook's data, their
    digest, and the digits from the tenth on of a number fitted to them."""
    text = re.sub(r"<Figure size \S+ with", "<Figure with", text)
    text = re.sub(r"SHA-256 [0-9a-f]{64}", "SHA-256 of the data", text)
    return re.sub(r"\d+\.\d{10,}", lambda number: f"{float(number[0]):.9g}", text)


def main():
    for path in NOTEBOOKS:
        with tempfile.TemporaryDirectory() as folder:
            notebook = execute(path, folder)
        nbformat.write(notebook, path)
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1000:.0f} kB", file=sys.stderr)


if __name__ == "__main__":
    main()
