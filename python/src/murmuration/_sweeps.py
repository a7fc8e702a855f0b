"""Finished sweeps: their trials, and figures of metrics over what varies."""

from __future__ import annotations

import difflib
import functools
import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from murmuration import _figures
from murmuration._files import DataFrame
from murmuration._names import is_name, one_of, short_names
from murmuration._tables import ResultFiles, preformatted, summary_of
from murmuration._terms import in_python_terms

if TYPE_CHECKING:
    import numpy as np
    import polars
    from matplotlib.axes import Axes

# Names that a message lists, at most, and how alike they must be.
_MOST_NAMES, _LEAST_LIKENESS = 3, 0.55


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

    Raises
    ------
    FileNotFoundError
        The folder has no `summary.json`.
    InvalidInput
        It is the folder of a run.

    Examples
    --------
    >>> sweep = murmuration.Sweep("runs/sweep-radius")
    >>> sweep.trials.columns
    """

    def __init__(self, folder: str | Path, printed: str = "", *, unverified: bool = False) -> None:
        self.folder = Path(folder)
        self.printed = printed
        self._files = ResultFiles(self.folder, unverified)
        summary_of(self.folder, "sweep")

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

    @overload
    def plot(
        self, x: str, y: str, *, by: str | None = None, width: str | float | None = None, axes: Axes | None = None
    ) -> Axes: ...

    @overload
    def plot(
        self, x: str, y: list[str] | tuple[str, ...], *, by: str | None = None, width: str | float | None = None, axes: Axes | None = None
    ) -> np.ndarray: ...

    @in_python_terms
    def plot(
        self, x: str, y: str | list[str] | tuple[str, ...], *, by: str | None = None, width: str | float | None = None,
        axes: Axes | None = None,
    ) -> Axes | np.ndarray:  # fmt: skip
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
        matplotlib.axes.Axes or numpy.ndarray
            The axes; of a list of metrics an array of axes, one for each metric.

        Raises
        ------
        InvalidInput
            Nothing has such a name. The text names all problems, and the nearest names.

        Examples
        --------
        >>> axes = sweep.plot("netsim.sf.kind", ["pdr", "latency"], width="page")
        >>> murmuration.save_figure(axes, "figure.pdf")
        """
        problems: list[str] = []
        axis, metrics, group = self._resolved(x, y, by, problems)
        _figures.check(problems, width)
        if axis in self._keys():
            options = ["--x", axis, *_figures.option("--by", group), *self._files.options]
            figure = _figures.content(self.folder, metrics, options)
        else:
            figure = _dots(self.trials, axis, metrics, group)
        drawn = _figures.draw(figure, axes, width)
        return drawn[0] if isinstance(y, str) else drawn

    def _keys(self) -> list[str]:
        """What differs between settings: keys, and "case" if settings are cases."""
        settings = self.summary["settings"]
        values: dict[str, set[str]] = {}
        for setting in settings:
            for key, value in ({"case": setting.get("case")} | setting["values"]).items():
                values.setdefault(key, set()).add(json.dumps(value))
        return [key for key, known in values.items() if len(known) > 1]

    def _resolved(self, x: Any, y: Any, by: Any, problems: list[str]) -> tuple[str, list[str], str | None]:
        """Keys and columns of these names, in full. Names of nothing are added to the problems."""
        keys, columns = self._keys(), list(self.trials.columns)
        varies = f"what varies: {', '.join(keys) or 'nothing'}"

        def found(argument: str, name: Any, names: list[str], what: str, otherwise: str) -> str:
            if not isinstance(name, str):
                problems.append(f"{argument} must be a str, got {name!r}")
                return ""
            own = _full_name(name, names)
            if own is None:
                near = _nearest(name, [*names, *(short_names(names) if argument == "y" else ())])
                hint = f"the nearest {'is' if len(near) == 1 else 'are'} {', '.join(near)}" if near else otherwise
                problems.append(f"{argument}: {name!r} {what}; {hint}")
            return own or ""

        axis = found("x", x, [*keys, *columns], "is neither a key that varies nor a column of the trials", varies)
        names = [y] if isinstance(y, str) else list(y) if isinstance(y, list | tuple) else []
        if not names:
            problems.append(f"y must be the name of a metric, or a list of names, got {y!r}")
        figures = columns[columns.index("status") + 1 :] if "status" in columns else columns
        metrics = []
        for name in names:
            is_metric = isinstance(name, str) and is_name(name)
            what = "is a metric that these trials do not have" if is_metric else "is no metric of the trials"
            metrics.append(found("y", name, figures if axis in keys else columns, what, "murmuration.metrics() lists all names"))
        group = None
        if by is not None:
            known = keys if axis in keys else columns
            group = found("by", by, known, "does not vary" if axis in keys else "is no column of the trials", varies)
        if axis and axis == group:
            problems.append(f"by must name something else than x, got {by!r} for both; leave out by")
        return axis, metrics, group

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
        return f"Sweep({str(self.folder)!r})\n{self._described()}".rstrip()

    def _repr_html_(self) -> str:
        return preformatted(f"{self._described()}\n{self.folder}")

    def _described(self) -> str:
        """What the program printed; of a sweep that was opened, what it was."""
        if self.printed:
            return self.printed
        summary, settings = self.summary, self.summary["settings"]
        n_failed = sum(setting.get("failed", 0) for setting in settings)
        failed = f", {n_failed} of them failed" if n_failed else ""
        metrics = dict.fromkeys(name for setting in settings for name in setting["metrics"])
        return (
            f"{summary['name']}: {len(settings)} settings, {summary['trials']} trials{failed}\n"
            f"varies: {', '.join(self._keys()) or 'nothing'}\nmetrics: {', '.join(metrics)}"
        )


def _full_name(name: str, names: list[str]) -> str | None:
    """The one of these names that is meant: by itself, by another name of the same metric, or by its last word."""
    if name in names:
        return name
    short = dict.fromkeys(full for full in names if full.rsplit(".", 1)[-1] == name)
    return one_of(names, name) or (next(iter(short)) if len(short) == 1 else None)


def _nearest(name: str, names: Iterable[str]) -> list[str]:
    """The names that are most alike, as a whole or by their last word, the nearest first."""

    def likeness(full: str) -> float:
        alike = max(difflib.SequenceMatcher(None, name, part).ratio() for part in (full, full.rsplit(".", 1)[-1]))
        return max(alike, 0.8) if name in full else alike

    near = sorted(dict.fromkeys(names), key=likeness, reverse=True)
    best = likeness(near[0]) if near else 0.0
    return [full for full in near[:_MOST_NAMES] if likeness(full) >= max(_LEAST_LIKENESS, best - 0.15)]


def _dots(trials: DataFrame, x: str, ys: list[str], by: str | None) -> dict[str, Any]:
    """A figure with a dot for each trial over a column that is no setting."""
    columns = {name: trials[name].to_numpy().astype(float).tolist() for name in (x, *ys)}
    groups = [""] * len(columns[x]) if by is None else [str(value) for value in trials[by].to_numpy().tolist()]

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

    title = f"{', '.join(ys)} over {x}"
    return {"title": title, "caption": f"{title}: a dot for each of {len(groups)} trials.", "panels": [panel(y) for y in ys]}
