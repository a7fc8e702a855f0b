"""What the program answers: recorded runs, and reports about measurements."""

from __future__ import annotations

import difflib
import functools
import json
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from murmuration import _figures
from murmuration._files import DataFrame, private_folder
from murmuration._names import path_of
from murmuration._program import InvalidInput, MurmurationError, call
from murmuration._tables import ResultFiles, preformatted, summary_of
from murmuration._terms import in_python_terms

if TYPE_CHECKING:
    import polars
    from matplotlib.axes import Axes

# Figures of a run: the file that each needs, and what it shows.
_KINDS = {
    "trajectories": ("steps.parquet", "where the robots went, from above"),
    "links": ("links.parquet", "who heard whom, and how many of the frames"),
    "network": ("motes.parquet", "the parent of each mote at the end"),
    "speed": ("steps.parquet", "speed of the flock and of its robots over time"),
    "neighbours": ("steps.parquet", "how many others each robot hears over time"),
    "delivery": ("summary.json", "delivery ratio over distance"),
    "latency": ("packets.parquet", "latency of delivered packets, cumulative"),
}
# Files that some runs alone leave.
_LEFT_BY = {"packets.parquet": 'only a run with mode = "6tisch" leaves'}
# The latest time that a figure may begin or end at (s).
_LATEST_S = 1_000_000_000
# What became of runs that are not complete.
_ENDED = {"failed": "failed", "interrupted": "was interrupted"}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


class Run:
    """A recorded run: its folder, and its tables, each read when it is first asked for.

    A file is read only if it is what the run wrote. docs/outputs.md lists the columns of every table with their units.
    A run that failed or was interrupted is a folder of results, too: opening it warns of that, and `summary["reason"]` says why it ended.

    Parameters
    ----------
    folder : str or pathlib.Path
        Folder of the run, with its `summary.json`.
    printed : str
        What the program printed about the run.
    unverified : bool
        Reads files although they were changed after the run.

    Attributes
    ----------
    folder : pathlib.Path
        Folder of the run.
    printed : str
        What the program printed about the run.

    Raises
    ------
    FileNotFoundError
        The folder has no `summary.json`.
    InvalidInput
        It is the folder of a sweep.

    Examples
    --------
    >>> run = murmuration.Run("runs/flocking")
    >>> run.steps.columns
    """

    def __init__(self, folder: str | Path, printed: str = "", *, unverified: bool = False) -> None:
        self.folder = Path(folder)
        self.printed = printed
        self._files = ResultFiles(self.folder, unverified)
        summary = summary_of(self.folder, "run")
        if summary.get("status") in ("failed", "interrupted"):
            first_line, *_ = str(summary.get("reason") or "no reason was recorded").splitlines()
            text = f"{self.folder} is a run that {_ENDED[summary['status']]} after {summary.get('simulated_s')} s: {first_line}"
            warnings.warn(text, stacklevel=2)

    @functools.cached_property
    def summary(self) -> dict[str, Any]:
        """Figures of the whole run: the content of summary.json.

        Returns
        -------
        dict
            The figures by name; those of the task are under "task", those of the network under "kpis".
        """
        return json.loads(self._files.path("summary.json").read_text())

    @in_python_terms
    def metric(self, name: str) -> float | bool | None:
        """Returns a figure of the summary by name.

        Parameters
        ----------
        name : str
            Short name, such as "pdr", or path, such as "task.flock_speed_mps". `murmuration.metrics()` lists the names.

        Returns
        -------
        float or bool or None
            The figure in the unit of its metric; None if it is null or absent.

        Raises
        ------
        InvalidInput
            There is no such metric. The text has the nearest.
        """
        if not isinstance(name, str):
            raise InvalidInput(f"name must be a str, got {name!r}")
        value: Any = self.summary
        for part in path_of(name).split("."):
            value = value.get(part) if isinstance(value, dict) else None
        if not isinstance(value, bool | int | float):
            # Explains a figure that may be absent, and refuses a name that is none.
            call(["metrics", name], quiet=True)
            return None
        return value

    @functools.cached_property
    def steps(self) -> DataFrame:
        """Positions (m) and velocities (m/s): one row for each agent and recorded step.

        Returns
        -------
        polars.DataFrame or pandas.DataFrame
            The table; of polars if it is installed.

        Raises
        ------
        FileNotFoundError
            The run left no such table.
        """
        return self._files.table("steps")

    @functools.cached_property
    def links(self) -> DataFrame:
        """Who heard whom, and how strongly (dBm).

        Returns
        -------
        polars.DataFrame or pandas.DataFrame
            The table; of polars if it is installed.

        Raises
        ------
        FileNotFoundError
            The run left no such table.
        """
        return self._files.table("links")

    @functools.cached_property
    def motes(self) -> DataFrame:
        """State and counters of every mote.

        Returns
        -------
        polars.DataFrame or pandas.DataFrame
            The table; of polars if it is installed.

        Raises
        ------
        FileNotFoundError
            The run left no such table.
        """
        return self._files.table("motes")

    @functools.cached_property
    def packets(self) -> DataFrame:
        """Every packet and what became of it. Only a run with mode = "6tisch" has this table.

        Returns
        -------
        polars.DataFrame or pandas.DataFrame
            The table; of polars if it is installed.

        Raises
        ------
        FileNotFoundError
            The run left no such table.
        """
        return self._files.table("packets")

    def scan(self, table: str) -> polars.LazyFrame:
        """Returns a table as a lazy frame, for tables that are larger than the memory.

        Parameters
        ----------
        table : str
            Name of the table: "steps", "links", "motes" or "packets".

        Returns
        -------
        polars.LazyFrame
            The table. A query reads the columns and rows that it needs.

        Raises
        ------
        FileNotFoundError
            The run left no such table.

        Examples
        --------
        >>> run.scan("links").filter(polars.col("rssi_dbm") < -90).collect()
        """
        return self._files.scan(table)

    @property
    def report(self) -> Path:
        """Path of the page about the run.

        Returns
        -------
        pathlib.Path
            The page (HTML).
        """
        return self.folder / "report.html"

    @in_python_terms
    def plot(
        self, kind: str = "trajectories", *, from_s: float | None = None, until_s: float | None = None,
        width: str | float | None = None, axes: Axes | None = None,
    ) -> Axes:  # fmt: skip
        """Draws a figure of the run, with the numbers that `murmuration figure` draws. Needs matplotlib.

        Parameters
        ----------
        kind : str
            "trajectories", "links", "network", "speed", "neighbours", "delivery" or "latency".
        from_s : float, optional
            Simulated time (s) from which on the run is drawn. By default its beginning.
        until_s : float, optional
            Simulated time (s) until which the run is drawn. By default its end.
        width : str or float, optional
            Width for print: "column" (88 mm), "page" (180 mm), or millimetres from 40 to 400. By default matplotlib's own size.
        axes : matplotlib.axes.Axes, optional
            Axes to draw on. By default new ones.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.

        Raises
        ------
        InvalidInput
            There is no such kind, or the run left no table for it. The text lists the kinds that there are.

        Examples
        --------
        >>> murmuration.save_figure(run.plot("delivery", width="column"), "delivery.pdf")
        """
        _figures.check(self._plot_problems(kind, from_s, until_s), width)
        options = [*_figures.option("--from", from_s), *_figures.option("--until", until_s), *self._files.options]
        try:
            figure = _figures.content(self.folder, [kind], options)
        except InvalidInput as error:
            raise InvalidInput(f"{error}{self._span() if str(error).endswith('in that span of time') else ''}") from None
        return _figures.draw(figure, axes, width)[0]

    def _span(self) -> str:
        """When robots were released and when the run ended."""
        started_s, end_s = float(self.summary.get("robots_started_s") or 0.0), float(self.summary["simulated_s"])
        waited = f"; the network formed until {started_s:g} s, and robots started then" if started_s > 0 else ""
        return f"{waited}; the run ended at {end_s:g} s"

    def _plot_problems(self, kind: Any, from_s: Any, until_s: Any) -> list[str]:
        """What is wrong with the arguments of a figure."""
        problems = [] if isinstance(kind, str) and kind in _KINDS else [f"kind: {kind!r} is no kind of figure; {self._kinds(kind)}"]
        for name, time_s in (("from_s", from_s), ("until_s", until_s)):
            is_time = time_s is None or (_is_number(time_s) and 0 <= time_s <= _LATEST_S)
            problems += [] if is_time else [f"{name} must be a number of seconds from 0 to {_LATEST_S}, got {time_s!r}"]
        if problems:
            return problems
        end_s = float(self.summary["simulated_s"])
        if from_s is not None and until_s is not None and until_s <= from_s:
            problems.append(f"until_s must be later than from_s, got from_s={from_s:g} and until_s={until_s:g}")
        elif from_s is not None and end_s < from_s:
            problems.append(f"from_s must be at most {end_s:g}, the end of the run, got {from_s:g}")
        if kind in _KINDS and self._lacks(kind):
            problems.append(f"kind: {kind!r} {self._lacks(kind)}; {self._kinds(None)}")
        return problems

    def _lacks(self, kind: str) -> str:
        """Why the run has no such figure; empty: it has."""
        if kind == "network" and not self.summary.get("kpis"):
            return "needs a network with routes, and this run has none"
        file = _KINDS[kind][0]
        if (self.folder / file).is_file():
            return ""
        return f"needs {file}, which {_LEFT_BY.get(file, 'this run did not leave: see section [output] of its configuration')}"

    def _kinds(self, kind: Any) -> str:
        """The kinds that this run has, with the nearest first."""
        lines = [f"  {name:<13} {shows}" for name, (_, shows) in _KINDS.items() if not self._lacks(name)]
        near = difflib.get_close_matches(kind, _KINDS, n=1) if isinstance(kind, str) else []
        nearest = f"the nearest is {near[0]!r}; " if near else ""
        return "\n".join([f"{nearest}there are:", *lines])

    def plot_links(
        self, *, from_s: float | None = None, until_s: float | None = None, width: str | float | None = None, axes: Axes | None = None
    ) -> Axes:
        """Draws who heard whom: an arrow from each sender to each receiver, in the colour of the share of frames. Needs matplotlib.

        Parameters
        ----------
        from_s : float, optional
            Simulated time (s) from which on the run is drawn. By default its beginning.
        until_s : float, optional
            Simulated time (s) until which the run is drawn. By default its end.
        width : str or float, optional
            Width for print: "column" (88 mm), "page" (180 mm), or millimetres from 40 to 400. By default matplotlib's own size.
        axes : matplotlib.axes.Axes, optional
            Axes to draw on. By default new ones.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.

        Raises
        ------
        InvalidInput
            The run left no table of links, or nobody heard anybody.
        """
        return self.plot("links", from_s=from_s, until_s=until_s, width=width, axes=axes)

    def plot_network(self, *, until_s: float | None = None, width: str | float | None = None, axes: Axes | None = None) -> Axes:
        """Draws the parent of each mote. Needs matplotlib.

        Parameters
        ----------
        until_s : float, optional
            Simulated time (s) at which the network is drawn. By default the end of the run.
        width : str or float, optional
            Width for print: "column" (88 mm), "page" (180 mm), or millimetres from 40 to 400. By default matplotlib's own size.
        axes : matplotlib.axes.Axes, optional
            Axes to draw on. By default new ones.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.

        Raises
        ------
        InvalidInput
            The network has no routes.
        """
        return self.plot("network", until_s=until_s, width=width, axes=axes)

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r})\n{self._described()}".rstrip()

    def _repr_html_(self) -> str:
        return preformatted(f"{self._described()}\n{self.folder}")

    def _described(self) -> str:
        """What the program printed; of a run that was opened, what it was."""
        if self.printed:
            return self.printed
        summary = self.summary
        status = summary.get("status")
        ended = f", {_ENDED[status]}" if status in _ENDED else ""
        agents, steps = summary.get("agent_count"), summary.get("steps")
        return (
            f"{summary.get('name')}: {agents} robots, seed {summary.get('seed')}, {steps} steps, {summary.get('simulated_s'):g} s simulated{ended}\n"
            f"tables: {', '.join(self._files.tables()) or 'none'}"
        )


# Figures of answers, first the one that says most.
_KINDS_OF_ANSWERS = {"diagnose": ("ladder", "gains"), "compare": ("errors",), "power": ("power",)}


class Answer(Mapping[str, Any]):
    """What a command found: a mapping with the program's JSON. `print` shows it as the program's report.

    Parameters
    ----------
    content : dict
        The answer by the keys of the program's JSON.
    printed : str
        The program's report.

    Attributes
    ----------
    content : dict
        The answer by the keys of the program's JSON.
    printed : str
        The program's report.
    """

    def __init__(self, content: dict[str, Any], printed: str) -> None:
        self.content = content
        self.printed = printed

    def __getitem__(self, key: str) -> Any:
        return self.content[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self.content)

    def __len__(self) -> int:
        return len(self.content)

    @in_python_terms
    def plot(self, kind: str | None = None, *, width: str | float | None = None, axes: Axes | None = None) -> Any:
        """Draws a figure of an answer of `compare`, `diagnose` or `power`. Needs matplotlib.

        Parameters
        ----------
        kind : str, optional
            Of a diagnosis "ladder", the default, or "gains"; of a comparison "errors"; of `power` "power".
        width : str or float, optional
            Width for print: "column" (88 mm), "page" (180 mm), or millimetres from 40 to 400. By default matplotlib's own size.
        axes : matplotlib.axes.Axes, optional
            Axes to draw on. By default new ones.

        Returns
        -------
        matplotlib.axes.Axes
            The axes; an array of them of several panels.

        Raises
        ------
        InvalidInput
            There is no such figure. The text lists those that there are.
        """
        _figures.check([], width)
        command, _, _ = str(self.content.get("schema", "")).partition("/")
        if command not in _KINDS_OF_ANSWERS:
            raise InvalidInput(f"an answer of {command} has no figures; answers of {', '.join(_KINDS_OF_ANSWERS)} have")
        kinds = _KINDS_OF_ANSWERS[command]
        if kind is not None and kind not in kinds:
            raise InvalidInput(f"kind must be {' or '.join(map(repr, kinds))} for an answer of {command}, got {kind!r}")
        with private_folder() as folder:
            file = folder / "answer.json"
            file.write_text(json.dumps(self.content))
            try:
                figure = _figures.content(file, [kind or kinds[0]])
            except MurmurationError as error:
                raise type(error)(str(error).replace(f"{file}: ", "the answer ").replace(str(file), "the answer")) from None
        drawn = _figures.draw(figure, axes, width)
        return drawn[0] if len(drawn) == 1 else drawn

    def __repr__(self) -> str:
        return self.printed.rstrip()

    def _repr_html_(self) -> str:
        return preformatted(self.printed)
