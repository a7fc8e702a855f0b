"""What the program answers: recorded runs, sweeps, and reports about measurements."""

from __future__ import annotations

import functools
import html
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any


def read_table(path: Path) -> Any:
    """A Parquet file as a data frame of polars, or of pandas where polars is not installed."""
    if not path.is_file():
        raise FileNotFoundError(f"{path} is not there: the configuration's section [output] says which tables a run leaves")
    try:
        import polars
    except ImportError:
        pass
    else:
        return polars.read_parquet(path)
    try:
        import pandas
    except ImportError:
        raise ImportError("tables need polars or pandas: pip install polars") from None
    return pandas.read_parquet(path)


class Run:
    """A recorded run: its folder, and its tables, each read when it is first asked for.

    docs/outputs.md lists the columns of every table with their units.
    """

    def __init__(self, folder: str | Path, printed: str = "") -> None:
        self.folder = Path(folder)
        self.printed = printed
        if not (self.folder / "summary.json").is_file():
            raise FileNotFoundError(f"{self.folder} is not the folder of a recorded run: it has no summary.json")

    @functools.cached_property
    def summary(self) -> dict[str, Any]:
        """Figures of the whole run: summary.json."""
        return json.loads((self.folder / "summary.json").read_text())

    @functools.cached_property
    def steps(self) -> Any:
        """Positions and velocities: one row for each agent and recorded step."""
        return read_table(self.folder / "steps.parquet")

    @functools.cached_property
    def links(self) -> Any:
        """Who heard whom, and how strongly."""
        return read_table(self.folder / "links.parquet")

    @functools.cached_property
    def motes(self) -> Any:
        """State and counters of every mote."""
        return read_table(self.folder / "motes.parquet")

    @functools.cached_property
    def packets(self) -> Any:
        """Every packet and what became of it. Only a run with mode = "6tisch" has this table."""
        return read_table(self.folder / "packets.parquet")

    @property
    def report(self) -> Path:
        """The page about the run."""
        return self.folder / "report.html"

    def plot(self, *, axes: Any = None) -> Any:
        """Draws the way of each agent, seen from above; returns the axes. Needs matplotlib."""
        try:
            from matplotlib import pyplot
        except ImportError:
            raise ImportError("plot needs matplotlib: pip install matplotlib") from None
        if axes is None:
            axes = pyplot.subplots()[1]
        columns = {name: self.steps[name].to_numpy() for name in ("agent", "x_m", "y_m")}
        for agent in sorted(set(columns["agent"].tolist())):
            own = columns["agent"] == agent
            axes.plot(columns["x_m"][own], columns["y_m"][own], linewidth=0.8)
            axes.plot(columns["x_m"][own][-1:], columns["y_m"][own][-1:], "k.", markersize=4)
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        axes.set_aspect("equal")
        axes.set_title(self.summary["name"])
        return axes

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r})\n{self.printed}".rstrip()

    def _repr_html_(self) -> str:
        return _pre(f"{self.printed}\n{self.folder}")


class Sweep:
    """A finished sweep: its folder, its table of trials, and its summary."""

    def __init__(self, folder: str | Path, printed: str = "") -> None:
        self.folder = Path(folder)
        self.printed = printed

    @functools.cached_property
    def trials(self) -> Any:
        """One row for each trial: its settings, its seed and its figures."""
        return read_table(self.folder / "trials.parquet")

    @property
    def report(self) -> Path:
        """The page about the sweep."""
        return self.folder / "report.html"

    def __repr__(self) -> str:
        return f"Sweep({str(self.folder)!r})\n{self.printed}".rstrip()

    def _repr_html_(self) -> str:
        return _pre(self.printed)


class Answer(Mapping[str, Any]):
    """What a command found: the program's JSON as a mapping, and its report as text."""

    def __init__(self, content: dict[str, Any], printed: str) -> None:
        self.content = content
        self.printed = printed

    def __getitem__(self, key: str) -> Any:
        return self.content[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self.content)

    def __len__(self) -> int:
        return len(self.content)

    def __repr__(self) -> str:
        return self.printed.rstrip()

    def _repr_html_(self) -> str:
        return _pre(self.printed)


def _pre(text: str) -> str:
    return f"<pre>{html.escape(text.strip())}</pre>"
