"""What the program answers: recorded runs, sweeps, and reports about measurements."""

from __future__ import annotations

import contextlib
import difflib
import functools
import hashlib
import html
import importlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from murmuration import _figures
from murmuration._files import DataFrame, private_folder
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


class _Files:
    """The files of a result. Each is read only if it is what was written, by its SHA-256 in provenance.json, or if `unverified`."""

    def __init__(self, folder: Path, unverified: bool) -> None:
        self._folder = folder
        self._unverified = unverified

    @property
    def options(self) -> list[str]:
        """The option of the command line for files that are read unchecked."""
        return ["--unverified"] if self._unverified else []

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
        >>> run.plot("delivery", width="column").figure.savefig("delivery.pdf")
        """
        options = [*_figures.option("--from", from_s), *_figures.option("--until", until_s), *self._files.options]
        return _figures.draw(_figures.content(self.folder, [kind], options), axes, width)

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

    @functools.cached_property
    def summary(self) -> dict[str, Any]:
        """Figures of each setting over its trials: the content of summary.json.

        Returns
        -------
        dict
            The settings under "settings": the values of the keys that vary, and of each metric n, median and interval.
        """
        return json.loads(self._files.path("summary.json").read_text())

    @in_python_terms
    def plot(
        self, x: str, y: str | Sequence[str], *, by: str | None = None, width: str | float | None = None, axes: Axes | None = None
    ) -> Axes:
        """Draws metrics over what varies: a dot for each trial, and the median of each setting with its interval. Needs matplotlib.

        The medians and intervals are those of the report, of the terminal and of summary.json.

        Parameters
        ----------
        x : str
            What lies along the horizontal axis: a key that varies, such as "netsim.phy.radius_m", its last word, or "case". Any other
            column of `trials` draws a dot for each trial over it.
        y : str or list of str
            Metric, such as "pdr" or "network.delivery_ratio", or several, each in a panel of its own.
        by : str, optional
            What colours and marks tell apart. By default everything else that varies.
        width : str or float, optional
            Width for print: "column" (88 mm), "page" (180 mm), or millimetres from 40 to 400. By default matplotlib's own size.
        axes : matplotlib.axes.Axes, optional
            Axes to draw on. By default new ones.

        Returns
        -------
        matplotlib.axes.Axes
            The axes; an array of them of several metrics.

        Raises
        ------
        ValueError
            The trials have no such column. The text has the nearest.

        Examples
        --------
        >>> sweep.plot("netsim.sf.kind", ["pdr", "latency"], width="page")[0].figure.savefig("figure.pdf")
        """
        names = [y] if isinstance(y, str) else list(y)
        if not self._varies(x):
            columns = [self._column(name) for name in names]
            return self._dots(self._column(x), columns, None if by is None else self._column(by), width, axes)
        options = ["--x", x, *_figures.option("--by", by), *self._files.options]
        return _figures.draw(_figures.content(self.folder, names, options), axes, width)

    def _varies(self, name: str) -> bool:
        """Whether settings differ in this key, given whole or by its last word, or in their case."""
        keys = ["case", *(key for setting in self.summary["settings"] for key in setting["values"])]
        return any(name in (key, key.rsplit(".", 1)[-1]) for key in keys)

    def _dots(self, x: str, ys: list[str], by: str | None, width: str | float | None, axes: Axes | None) -> Axes:
        """A dot for each trial over a column that is no setting."""
        columns = {name: self.trials[name].to_numpy().astype(float).tolist() for name in (x, *ys)}
        groups = [""] * len(columns[x]) if by is None else [str(value) for value in self.trials[by].to_numpy().tolist()]

        def axis(name: str) -> dict[str, Any]:
            known = [value for value in columns[name] if value == value]
            low, high = (min(known), max(known)) if known else (0.0, 1.0)
            margin = 0.05 * (high - low) or 0.5
            return {"label": name, "scale": "linear", "range": [low - margin, high + margin], "ticks": [], "is_share": False, "categories": []}

        def panel(y: str) -> dict[str, Any]:
            rows = list(zip(groups, columns[x], columns[y], strict=True))
            series = [
                {"name": group, "mark": "dot", "group": n, "points": [{"x": a, "y": b} for own, a, b in rows if own == group]}
                for n, group in enumerate(dict.fromkeys(groups))
            ]
            return {"x": axis(x), "y": axis(y), "is_map": False, "colour": None, "series": series}

        return _figures.draw({"title": "", "panels": [panel(y) for y in ys]}, axes, width)

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


# The figure of an answer that says most.
_KINDS = {"diagnose": "ladder", "compare": "errors", "power": "power"}


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
    def plot(self, kind: str | None = None, *, width: str | float | None = None, axes: Axes | None = None) -> Axes:
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
        command, _, _ = str(self.content.get("schema", "")).partition("/")
        kinds = [kind or _KINDS.get(command, command)]
        with private_folder() as folder:
            file = folder / "answer.json"
            file.write_text(json.dumps(self.content))
            return _figures.draw(_figures.content(file, kinds), axes, width)

    def __repr__(self) -> str:
        return self.printed.rstrip()

    def _repr_html_(self) -> str:
        return _pre(self.printed)


def _pre(text: str) -> str:
    return f"<pre>{html.escape(text.strip())}</pre>"
