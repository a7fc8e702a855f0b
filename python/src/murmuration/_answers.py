"""What the program answers: recorded runs, sweeps, and reports about measurements."""

from __future__ import annotations

import contextlib
import difflib
import functools
import hashlib
import html
import importlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy

from murmuration._files import DataFrame
from murmuration._names import one_of, path_of
from murmuration._program import MurmurationError, call
from murmuration._terms import in_python_terms

if TYPE_CHECKING:
    import polars
    from matplotlib.axes import Axes


def read_table(path: Path) -> DataFrame:
    """A Parquet file as a data frame of polars, or of pandas where polars is not installed."""
    _check_table(path)
    library = _table_library()
    return library.read_parquet(path)


def scan_table(path: Path) -> polars.LazyFrame:
    """A Parquet file as a lazy frame of polars, which reads the columns and rows that a query needs."""
    _check_table(path)
    try:
        import polars
    except ImportError:
        raise ImportError("lazy tables need polars: pip install polars") from None
    return polars.scan_parquet(path)


def table_of(columns: Mapping[str, Any]) -> DataFrame:
    """A data frame of polars, or of pandas where polars is not installed, from its columns."""
    return _table_library().DataFrame(dict(columns))


def _table_library() -> Any:
    """polars, or pandas where polars is not installed."""
    for name in ("polars", "pandas"):
        with contextlib.suppress(ImportError):
            return importlib.import_module(name)
    raise ImportError("tables need polars or pandas: pip install polars")


def _check_table(path: Path) -> None:
    """Raises an error that names the tables that are there, if this one is not."""
    if path.is_file():
        return
    there = ", ".join(sorted(file.stem for file in path.parent.glob("*.parquet")))
    raise FileNotFoundError(
        f"{path} is not there: the configuration's section [output] says which tables a run leaves. This one left: {there or 'none'}"
    )


def _axes(axes: Any) -> Any:
    """The axes to draw on: those given, or new ones."""
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ImportError("plot needs matplotlib: pip install matplotlib") from None
    return pyplot.subplots()[1] if axes is None else axes


class _Files:
    """The files of a result. Each is read only if it is what was written, by its SHA-256 in provenance.json, or if `unverified`."""

    def __init__(self, folder: Path, unverified: bool) -> None:
        self._folder = folder
        self._unverified = unverified

    @functools.cached_property
    def _listed(self) -> dict[str, Any]:
        path = self._folder / "provenance.json"
        try:
            files = json.loads(path.read_bytes())["files"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise MurmurationError(f"{path} lists no files ({error!r}): give unverified=True to read them unchecked") from None
        return dict(files)

    def path(self, name: str) -> Path:
        """The path of a file that is what was written."""
        path = self._folder / name
        if self._unverified or not path.is_file():
            return path
        expected = self._listed.get(name)
        if expected is None:
            raise MurmurationError(f"{path}: provenance.json does not list it; give unverified=True to read it unchecked")
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
        if found != expected.get("sha256"):
            raise MurmurationError(
                f"{path}: its content is not what was written, by the SHA-256 in provenance.json; `murmuration verify` tells where; "
                "give unverified=True to read it as it is"
            )
        return path

    def table(self, name: str) -> DataFrame:
        return read_table(self.path(f"{name}.parquet"))

    def scan(self, name: str) -> polars.LazyFrame:
        return scan_table(self.path(f"{name}.parquet"))


class Run:
    """A recorded run: its folder, and its tables, each read when it is first asked for.

    A file is read only if it is what the run wrote. docs/outputs.md lists the columns of every table with their units.

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

    Examples
    --------
    >>> run = murmuration.Run("runs/flocking")
    >>> run.steps.columns
    """

    def __init__(self, folder: str | Path, printed: str = "", *, unverified: bool = False) -> None:
        self.folder = Path(folder)
        self.printed = printed
        self._files = _Files(self.folder, unverified)
        if not (self.folder / "summary.json").is_file():
            raise FileNotFoundError(f"{self.folder} is not the folder of a recorded run: it has no summary.json")

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

    def plot(self, *, axes: Axes | None = None) -> Axes:
        """Draws the way of each agent, seen from above. Needs matplotlib.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Axes to draw on. By default new ones.

        Returns
        -------
        matplotlib.axes.Axes
            The axes, in metres.
        """
        axes = _axes(axes)
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
    """A finished sweep: its folder and its table of trials.

    Parameters
    ----------
    folder : str or pathlib.Path
        Folder of the sweep.
    printed : str
        What the program printed about the sweep.
    unverified : bool
        Reads files although they were changed after the sweep.

    Attributes
    ----------
    folder : pathlib.Path
        Folder of the sweep.
    printed : str
        What the program printed about the sweep.
    """

    def __init__(self, folder: str | Path, printed: str = "", *, unverified: bool = False) -> None:
        self.folder = Path(folder)
        self.printed = printed
        self._files = _Files(self.folder, unverified)

    @functools.cached_property
    def trials(self) -> DataFrame:
        """One row for each trial: its settings, its seed and its figures.

        Returns
        -------
        polars.DataFrame or pandas.DataFrame
            The table; of polars if it is installed.
        """
        return self._files.table("trials")

    def scan(self, table: str = "trials") -> polars.LazyFrame:
        """Returns a table as a lazy frame, for tables that are larger than the memory.

        Parameters
        ----------
        table : str
            Name of the table.

        Returns
        -------
        polars.LazyFrame
            The table. A query reads the columns and rows that it needs.
        """
        return self._files.scan(table)

    def plot(self, x: str, y: str, *, by: str | None = None, axes: Axes | None = None) -> Axes:
        """Draws a figure of all trials over a setting: a dot for each, and the mean at each value. Needs matplotlib.

        Parameters
        ----------
        x : str
            Column of `trials` along the horizontal axis, such as "netsim.phy.radius_m".
        y : str
            Column of `trials` along the vertical axis, such as "network.delivery_ratio", or a metric by either of its names, such as "pdr".
        by : str, optional
            Column of `trials`, such as "case". Each of its values gets a colour.
        axes : matplotlib.axes.Axes, optional
            Axes to draw on. By default new ones.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.

        Raises
        ------
        ValueError
            The trials have no such column. The text has the nearest.
        """
        column = {name: self._column(name) for name in (x, y, by) if name is not None}
        axes = _axes(axes)
        settings, figures = self.trials[column[x]].to_numpy(), self.trials[column[y]].to_numpy().astype(float)
        groups = numpy.full(len(settings), "") if by is None else self.trials[column[by]].to_numpy()
        for group in dict.fromkeys(groups.tolist()):
            own = groups == group
            values = sorted(set(settings[own].tolist()))
            means = [numpy.nanmean(figures[own & (settings == value)]) for value in values]
            (line,) = axes.plot(values, means, "-", label=group)
            axes.plot(settings[own], figures[own], ".", alpha=0.5, color=line.get_color())
        axes.set_xlabel(x)
        axes.set_ylabel(y)
        if by is not None:
            axes.legend(title=by)
        return axes

    def _column(self, name: str) -> str:
        """The column of this name, or of the metric that has this name."""
        column = one_of(list(self.trials.columns), name)
        if column is None:
            near = difflib.get_close_matches(name, self.trials.columns, n=3, cutoff=0.0)
            raise ValueError(f"the trials have no column {name}; the nearest are {', '.join(near)}")
        return column

    @property
    def report(self) -> Path:
        """Path of the page about the sweep.

        Returns
        -------
        pathlib.Path
            The page (HTML).
        """
        return self.folder / "report.html"

    def __repr__(self) -> str:
        return f"Sweep({str(self.folder)!r})\n{self.printed}".rstrip()

    def _repr_html_(self) -> str:
        return _pre(self.printed)


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

    def __repr__(self) -> str:
        return self.printed.rstrip()

    def _repr_html_(self) -> str:
        return _pre(self.printed)


def _pre(text: str) -> str:
    return f"<pre>{html.escape(text.strip())}</pre>"
