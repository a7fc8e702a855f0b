"""Figures as the program makes them, drawn with matplotlib: the same numbers, intervals and captions as its own files have."""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from murmuration import _marks
from murmuration._program import InvalidInput, call

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes

# Widths of journals (mm).
_WIDTHS = {"column": 88.0, "page": 180.0}
_MM_PER_INCH = 25.4
# Figures wider than this have panels beside each other (mm), at most so many.
_WIDE_MM, _MOST_COLUMNS = 120.0, 3
# Columns for numbers of panels that leave gaps otherwise.
_EVEN = {4: 2}
# Letters as journals print them (points).
_SIZES = {
    "font.size": 8, "axes.labelsize": 8, "xtick.labelsize": 7, "ytick.labelsize": 7, "legend.fontsize": 7, "legend.title_fontsize": 7,
    "axes.linewidth": 0.7,
}  # fmt: skip
# Height of a panel of its width, the more the narrower. Maps are as high as they need, between these.
_ASPECTS = {1: 0.62, 2: 0.66, 3: 0.85}
_WIDE_ASPECT = 0.42
_FLATTEST, _TALLEST = 0.35, 1.1
# Mean width of a letter, of its size.
_LETTER = 0.6
# Marks at the end of an axis are this far from it, of its length.
_SPARE = 0.03
# The smallest letters of labels that are longer than their axis, of their size.
_SMALLEST = 0.6
# Where axes keep the caption of what is drawn on them.
_CAPTION = "murmuration_caption"


def content(result: str | os.PathLike[str], kinds: Sequence[str], options: Sequence[str] = ()) -> dict[str, Any]:
    """What a figure of a folder of results, or of an answer in a file, holds: the program's JSON."""
    return dict(json.loads(call(["figure", result, *kinds, *options, "--json", "-"], False)))


def option(name: str, value: Any) -> list[str]:
    """An option of the command line, if it has a value."""
    return [] if value is None else [f"{name}={value}"]


def need_matplotlib() -> None:
    """Raises an error that says how to install matplotlib, if it is not."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise ImportError("plot needs matplotlib: pip install matplotlib") from None


def check(problems: list[str], width: Any) -> None:
    """Raises an error with all problems of a figure, also with its width, or that matplotlib is not there."""
    need_matplotlib()
    if width is not None:
        try:
            _width_mm(width)
        except InvalidInput as error:
            problems = [*problems, str(error)]
    if problems:
        raise InvalidInput("\n".join(problems))


def draw(figure: dict[str, Any], axes: Any = None, width: str | float | None = None) -> Any:
    """Draws a figure; returns an array of its axes, one for each panel.

    `axes`: those of matplotlib to draw a figure of one panel on. `width`: "column" (88 mm), "page" (180 mm) or millimetres, with letters
    of 8 points; None for matplotlib's own sizes.
    """
    need_matplotlib()
    import matplotlib
    import numpy as np
    from matplotlib import pyplot

    panels = figure["panels"]
    if axes is not None:
        if len(panels) != 1:
            raise InvalidInput(f"axes: the figure has {len(panels)} panels and needs a figure of its own; leave out axes")
        _legend_of_axes(axes, _panel(axes, panels[0]))
        flat = np.array([axes], dtype=object)
    else:
        from murmuration._paper import PaperFigure

        is_wide = width is None or _width_mm(width) > _WIDE_MM
        n_columns = (_EVEN.get(len(panels)) or min(len(panels), _MOST_COLUMNS)) if is_wide else 1
        shape = (-(-len(panels) // n_columns), n_columns)
        with matplotlib.rc_context({} if width is None else _SIZES):
            size = _size(width, shape, panels)
            drawn, grid = pyplot.subplots(*shape, figsize=size, squeeze=False, layout="constrained", FigureClass=PaperFigure)
            flat = grid.ravel()
            for unused in flat[len(panels) :]:
                unused.remove()
            flat = flat[: len(panels)]
            entries: dict[str, Any] = {}
            for own, panel in zip(flat, panels, strict=True):
                entries |= _panel(own, panel)
            if len(panels) > 1:
                for own, letter in zip(flat, "abcdefghijklmnopqrstuvwxyz", strict=False):
                    own.set_title(f"({letter})", loc="left", fontsize="medium")
            _legend_of_figure(drawn, entries)
            drawn.set_label(figure["title"])
            _fit_labels(drawn, flat)
    for own in flat:
        setattr(own, _CAPTION, figure.get("caption", ""))
    return flat


def caption(axes: Axes | np.ndarray) -> str:
    """Returns the caption of a figure that `plot` drew, for the text below it in a paper.

    Parameters
    ----------
    axes : matplotlib.axes.Axes or numpy.ndarray
        What `plot` returned.

    Returns
    -------
    str
        What is shown, with medians, intervals and numbers of trials, as `murmuration figure` prints it.

    Raises
    ------
    InvalidInput
        They are no axes that `plot` drew on.

    Examples
    --------
    >>> print(murmuration.caption(sweep.plot("netsim.sf.kind", "pdr")))
    """
    text = getattr(_first(axes), _CAPTION, None)
    if not isinstance(text, str):
        raise InvalidInput("axes must be what a plot of murmuration returned")
    return text


def save_figure(axes: Axes | np.ndarray, path: str | os.PathLike[str], *, dpi: float = 300.0) -> Path:
    """Saves the figure that axes belong to. Fonts of a PDF or EPS file are embedded as TrueType (Type 42).

    Parameters
    ----------
    axes : matplotlib.axes.Axes or numpy.ndarray
        What `plot` returned, or other axes of matplotlib.
    path : str or os.PathLike
        File to write: its ending decides on the format, such as `.pdf`, `.svg`, `.png` or `.eps`.
    dpi : float
        Pixels per inch, for formats with pixels.

    Returns
    -------
    pathlib.Path
        The file.

    Examples
    --------
    >>> murmuration.save_figure(sweep.plot("netsim.sf.kind", "pdr", width="column"), "pdr.pdf")
    """
    import matplotlib

    from murmuration._paper import FONTS

    figure = getattr(_first(axes), "figure", None)
    if figure is None:
        raise InvalidInput(f"axes must be axes of matplotlib, got {type(axes).__name__}")
    # A subfigure is saved with the figure that it is part of.
    figure = getattr(figure, "figure", None) or figure
    with matplotlib.rc_context(FONTS):
        figure.savefig(path, dpi=dpi)
    return Path(path)


def _first(axes: Any) -> Any:
    """The axes, or the first of an array of them."""
    flat = getattr(axes, "flat", None)
    return axes if flat is None else next(iter(flat), None)


def _width_mm(width: str | float) -> float:
    if isinstance(width, str) and width in _WIDTHS:
        return _WIDTHS[width]
    if isinstance(width, int | float) and 40 <= width <= 400:
        return float(width)
    raise InvalidInput(f'width must be "column", "page", or a number of millimetres from 40 to 400, got {width!r}')


def _size(width: str | float | None, shape: tuple[int, int], panels: list[dict[str, Any]]) -> tuple[float, float] | None:
    """Width and height in inches; None for matplotlib's own."""
    n_rows, n_columns = shape
    is_map, has_bar = panels[0]["is_map"], panels[0]["colour"] is not None
    if width is None and len(panels) == 1 and not is_map:
        return None
    inches = 4.4 * n_columns if width is None else _width_mm(width) / _MM_PER_INCH
    if not is_map:
        is_wide = n_columns == 1 and width is not None and _width_mm(width) > _WIDE_MM
        return inches, n_rows * (_WIDE_ASPECT if is_wide else _ASPECTS[n_columns]) * inches / n_columns
    inches = 6.4 if width is None else inches
    (left, right), (bottom, top) = (panels[0][name]["range"] for name in ("x", "y"))
    plane = 0.85 * inches * min(max((top - bottom) / (right - left), _FLATTEST), _TALLEST)
    return inches, plane + 0.5 + (0.35 if has_bar else 0.0)


def _panel(axes: Any, panel: dict[str, Any]) -> dict[str, Any]:
    """Draws a panel on axes; returns the entries of a legend by name."""
    _axis(axes, "x", panel["x"])
    _axis(axes, "y", panel["y"])
    axes.grid(visible=True, axis="y" if panel["x"]["scale"] == "category" else "both", linewidth=0.5, alpha=0.3)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    low, high = panel["y"]["range"]
    if low < 0 < high and any(series["mark"] == "interval" for series in panel["series"]):
        axes.axhline(0.0, color=_marks.TEXT, linewidth=0.6, alpha=0.6, zorder=1)
    entries: dict[str, Any] = {}
    for series in panel["series"]:
        drawn = _marks.draw(axes, series, panel)
        if series["name"] and drawn is not None:
            entries.setdefault(series["name"], drawn)
    # A map fills its axes: matplotlib widens one of its ranges, which it may do where ranges are not fixed.
    is_map = panel["is_map"]
    axes.set_xlim(_with_spare(panel, "x"), auto=is_map)
    axes.set_ylim(_with_spare(panel, "y"), auto=is_map)
    if is_map:
        axes.set_aspect("equal", adjustable="datalim")
    return entries


def _with_spare(panel: dict[str, Any], name: str) -> list[float]:
    """The range of an even axis, wider where a mark at its end would be cut in half."""
    axis = panel[name]
    low, high = axis["range"]
    marked = [series for series in panel["series"] if series["mark"] in ("interval", "dot", "faint-dot")]
    places = [point[name] for series in marked for point in series["points"] if point[name] is not None]
    if axis["scale"] != "linear" or panel["is_map"] or not places:
        return [low, high]
    spare = _SPARE * (high - low)
    return [min(low, min(places) - spare), max(high, max(places) + spare)]


def _legend_of_figure(figure: Any, entries: dict[str, Any]) -> None:
    """One legend for all panels above these, in as many rows as it needs. The figure becomes higher by it."""
    if not entries:
        return
    room = figure.bbox.width - 0.1 * figure.dpi
    drawn = _in_rows(functools.partial(figure.legend, loc="outside upper left", **_LEGEND), entries, room, figure)
    height = drawn.get_window_extent(_renderer(figure)).height / figure.dpi
    figure.set_size_inches(figure.get_figwidth(), figure.get_figheight() + height)


def _legend_of_axes(axes: Any, entries: dict[str, Any]) -> None:
    """A legend above axes of the user, and above their colour bar, no wider than these."""
    if not entries:
        return
    renderer, top = _renderer(axes.figure), axes.get_window_extent().y1
    high = max([0.0, *(child.get_tightbbox(renderer).y1 - top for child in axes.child_axes)]) / axes.figure.dpi
    place = {"loc": "lower left", "bbox_to_anchor": (0.0, high), "bbox_transform": _marks.above(axes)}
    _in_rows(functools.partial(axes.legend, **place, **_LEGEND), entries, axes.get_window_extent().width, axes.figure)


_LEGEND = {"frameon": False, "borderaxespad": 0.4, "borderpad": 0.2, "columnspacing": 1.2, "handletextpad": 0.5, "handlelength": 1.8}


def _in_rows(legend: Any, entries: dict[str, Any], room: float, figure: Any) -> Any:
    """The legend with the most columns that fit into a width (pixels), read along its rows; with one column, if none do."""
    names, n = list(entries), len(entries)
    for n_columns in range(n, 0, -1):
        # matplotlib fills one column after the other.
        order = [names[place] for column in range(n_columns) for place in range(column, n, n_columns)]
        drawn = legend([entries[name] for name in order], order, ncols=n_columns)
        if n_columns == 1 or drawn.get_window_extent(_renderer(figure)).width <= room:
            return drawn
        drawn.remove()
    raise AssertionError("a legend has at least one column")


def _fit_labels(figure: Any, all_axes: Any) -> None:
    """Makes labels of vertical axes smaller that are longer than their axis."""
    figure.draw_without_rendering()
    for axes in all_axes:
        label = axes.yaxis.label
        length, room = label.get_window_extent().height, axes.get_window_extent().height
        if length > room > 0:
            label.set_fontsize(label.get_fontsize() * max(room / length, _SMALLEST))


def _renderer(figure: Any) -> Any:
    """What measures text."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = figure.canvas
    return canvas.get_renderer() if hasattr(canvas, "get_renderer") else FigureCanvasAgg(figure).get_renderer()


def _axis(axes: Any, name: str, axis: dict[str, Any]) -> None:
    from matplotlib import ticker

    getattr(axes, f"set_{name}label")(axis["label"])
    own = getattr(axes, f"{name}axis")
    if axis["scale"] == "log":
        getattr(axes, f"set_{name}scale")("log")
        own.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        low, high = axis["range"]
        if high < 100 * low:
            own.set_minor_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}" if f"{value:g}".strip("0.")[:1] in "25" else ""))
    if axis["scale"] == "category":
        own.set_ticks(range(len(axis["categories"])), axis["categories"])
        size_inches = max([label.get_fontsize() for label in own.get_ticklabels()], default=8) / 72
        room = axes.get_window_extent().width / axes.figure.dpi / len(axis["categories"])
        if max(len(text) + 2 for text in axis["categories"]) * _LETTER * size_inches > room:
            axes.tick_params(axis=name, labelrotation=90)
    elif axis["ticks"]:
        own.set_ticks(axis["ticks"])
    if axis["is_share"]:
        own.set_major_formatter(ticker.FuncFormatter(_marks.per_cent))
