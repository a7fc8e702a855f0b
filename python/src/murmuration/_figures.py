"""Figures as the program makes them, drawn with matplotlib: the same numbers, intervals and captions as its own files have."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any

from murmuration._program import call

# Okabe and Ito's colours, which people with colour-blindness can tell apart.
_COLOURS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442"]
_MARKERS = ["o", "s", "^", "D"]
_DASHES: list[Any] = ["-", (0, (4, 2)), (0, (1.5, 1.5)), (0, (7, 2))]
_TEXT = "#1b1f24"
# Widths of journals (mm).
_WIDTHS = {"column": 88.0, "page": 180.0}
_MM_PER_INCH = 25.4
# Letters as journals print them (points).
_SIZES = {
    "font.size": 8, "axes.labelsize": 8, "xtick.labelsize": 7, "ytick.labelsize": 7, "legend.fontsize": 7, "legend.title_fontsize": 7,
    "axes.linewidth": 0.7, "pdf.fonttype": 42, "svg.fonttype": "none",
}  # fmt: skip
# Lines with more points than this are many lines, and thin.
_MANY_POINTS = 2000
_MOST_NAMES = 60
# Longer names of categories stand upright.
_MOST_LETTERS = 40
# How far trials stand beside their median (points).
_BESIDE = 3.5


def content(result: str | os.PathLike[str], kinds: Sequence[str], options: Sequence[str] = ()) -> dict[str, Any]:
    """What a figure of a folder of results, or of an answer in a file, holds: the program's JSON."""
    return dict(json.loads(call(["figure", result, *kinds, *options, "--json", "-"], False)))


def option(name: str, value: Any) -> list[str]:
    """An option of the command line, if it has a value."""
    return [] if value is None else [name, str(value)]


def draw(figure: dict[str, Any], axes: Any = None, width: str | float | None = None) -> Any:
    """Draws a figure; returns its axes, an array of them if it has several panels.

    `axes`: those of matplotlib to draw a figure of one panel on. `width`: "column" (88 mm), "page" (180 mm) or millimetres, with letters
    of 8 points; None for matplotlib's own sizes.
    """
    try:
        import matplotlib
        from matplotlib import pyplot
    except ImportError:
        raise ImportError("plot needs matplotlib: pip install matplotlib") from None
    panels = figure["panels"]
    if axes is not None:
        if len(panels) != 1:
            raise ValueError(f"axes: the figure has {len(panels)} panels, so that it needs a figure of its own")
        _panel(axes, panels[0])
        return axes
    sizes = {} if width is None else _SIZES
    with matplotlib.rc_context(sizes):
        shape = (len(panels), 1) if width is not None and _width_mm(width) <= 120 else (1, len(panels))
        size = None if width is None else _size(width, shape, panels)
        drawn, grid = pyplot.subplots(*shape, figsize=size, squeeze=False, layout="constrained")
        flat = grid.ravel()
        for own, panel in zip(flat, panels, strict=True):
            _panel(own, panel)
        if len(panels) > 1:
            for own, letter in zip(flat, "abcdefghijklmnopqrstuvwxyz", strict=False):
                own.set_title(f"({letter})", loc="left", fontsize="medium")
        drawn.set_label(figure["title"])
    return flat[0] if len(panels) == 1 else flat


def _width_mm(width: str | float) -> float:
    if isinstance(width, str) and width in _WIDTHS:
        return _WIDTHS[width]
    if isinstance(width, int | float) and 40 <= width <= 400:
        return float(width)
    raise ValueError(f'width must be "column", "page", or a number of millimetres from 40 to 400, got {width!r}')


def _size(width: str | float, shape: tuple[int, int], panels: list[dict[str, Any]]) -> tuple[float, float]:
    """Width and height in inches. A map is as high as it needs."""
    inches = _width_mm(width) / _MM_PER_INCH
    own = inches / shape[1]
    if panels[0]["is_map"]:
        (left, right), (bottom, top) = (panels[0][name]["range"] for name in ("x", "y"))
        return inches, shape[0] * (0.8 * own * min(max((top - bottom) / (right - left), 0.1), 1.2) + 0.8)
    return inches, shape[0] * 0.66 * own


def _panel(axes: Any, panel: dict[str, Any]) -> None:
    """Draws a panel on axes."""
    _axis(axes, "x", panel["x"])
    _axis(axes, "y", panel["y"])
    axes.grid(visible=True, axis="y" if panel["x"]["scale"] == "category" else "both", linewidth=0.5, alpha=0.3)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for series in panel["series"]:
        _series(axes, series, panel)
    axes.set_xlim(panel["x"]["range"])
    axes.set_ylim(panel["y"]["range"])
    if panel["is_map"]:
        axes.set_aspect("equal", adjustable="box")
    if any(series["name"] for series in panel["series"]):
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False, borderaxespad=0.2)


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
        if sum(map(len, axis["categories"])) > _MOST_LETTERS:
            axes.tick_params(axis=name, labelrotation=90)
    elif axis["ticks"]:
        own.set_ticks(axis["ticks"])
    if axis["is_share"]:
        own.set_major_formatter(ticker.FuncFormatter(_percent))


def _percent(share: float, _: Any = None) -> str:
    return f"{100 * share:.6g} %"


def _series(axes: Any, series: dict[str, Any], panel: dict[str, Any]) -> None:
    points = series["points"]
    if not points:
        return
    group, mark = series["group"], series["mark"]
    colour = _TEXT if group is None else _COLOURS[group % len(_COLOURS)]
    dash = "-" if group is None else _DASHES[group % len(_DASHES)]
    marker = _MARKERS[(group or 0) % len(_MARKERS)]
    label = series["name"] or None
    nan = float("nan")
    xs = [point["x"] for point in points]
    ys = [nan if point["y"] is None else point["y"] for point in points]
    low, high = ([point.get(end, nan) for point in points] for end in ("low", "high"))
    if mark in ("line", "band"):
        width = 0.6 if len(points) > _MANY_POINTS else 1.2
        axes.plot(xs, ys, color=colour, linestyle=dash if mark == "line" else "-", linewidth=width, label=label)
        if mark == "band":
            axes.fill_between(xs, low, high, color=colour, alpha=0.2, linewidth=0)
    elif mark == "interval":
        errors = [[max(y - end, 0.0) for y, end in zip(ys, low, strict=True)], [max(end - y, 0.0) for y, end in zip(ys, high, strict=True)]]
        line = "none" if panel["x"]["scale"] == "category" else dash
        axes.errorbar(
            xs, ys, yerr=errors, color=colour, linestyle=line, linewidth=0.9, marker=marker, markersize=4, capsize=2.5, label=label
        )  # fmt: skip
    elif mark == "bar":
        axes.bar(xs, ys, width=0.6, color=colour, label=label)
    elif mark in ("dot", "faint-dot"):
        is_faint = mark == "faint-dot"
        size, alpha = (2.2, 0.45) if is_faint else (4, 1)
        (drawn,) = axes.plot(xs, ys, linestyle="none", marker=marker, color=colour, markersize=size, alpha=alpha, markeredgewidth=0, label=label)
        if is_faint and not panel["is_map"]:
            from matplotlib.transforms import ScaledTranslation

            drawn.set_transform(axes.transData + ScaledTranslation(-_BESIDE / 72, 0, axes.figure.dpi_scale_trans))
        if mark == "dot" and len(points) <= _MOST_NAMES:
            for point, x, y in zip(points, xs, ys, strict=True):
                if point.get("name"):
                    axes.annotate(point["name"], (x, y), xytext=(3, 2), textcoords="offset points", fontsize=6)
    elif mark == "segment":
        from matplotlib.collections import LineCollection

        lines = [((point["x"], point["y"]), tuple(point["end"])) for point in points]
        axes.add_collection(LineCollection(lines, colors=colour, linewidths=1.6 if group is None else 0.8, label=label))
    elif mark == "arrow":
        _arrows(axes, points, colour, panel["colour"])


def _arrows(axes: Any, points: list[dict[str, Any]], colour: str, scale: dict[str, Any] | None) -> None:
    """Arrows from senders to receivers, both directions of a pair beside each other."""
    from matplotlib import cm, colors

    shades = None if scale is None else cm.ScalarMappable(colors.Normalize(*scale["range"]), "viridis")
    for point in sorted(points, key=lambda point: point.get("value") or 0.0):
        value = point.get("value")
        own = colour if shades is None or value is None else shades.to_rgba(value)
        style = {"arrowstyle": "-|>", "color": own, "linewidth": 0.7, "shrinkA": 3, "shrinkB": 3, "connectionstyle": "arc3,rad=0.06", "mutation_scale": 6}
        axes.annotate("", xy=point["end"], xytext=(point["x"], point["y"]), arrowprops=style)
    if shades is not None and scale is not None:
        from matplotlib import ticker

        form = ticker.FuncFormatter(_percent) if scale["is_share"] else None
        axes.figure.colorbar(shades, ax=axes, label=scale["label"], format=form)
