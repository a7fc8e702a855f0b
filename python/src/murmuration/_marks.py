"""Marks of series, drawn with matplotlib: lines, dots, intervals, bars, arrows."""

from __future__ import annotations

import functools
from typing import Any

# Okabe and Ito's colours, which people with colour-blindness can tell apart.
COLOURS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442"]
MARKERS = ["o", "s", "^", "D"]
DASHES: list[Any] = ["-", (0, (4, 2)), (0, (1.5, 1.5)), (0, (7, 2))]
TEXT = "#1b1f24"
# Lines with more points than this are many lines, and thin.
_MANY_POINTS = 2000
_MOST_NAMES = 60
# How far trials stand beside their median (points).
_BESIDE = 3.5
# The part of viridis that the program's own figures have: the end is too light on white.
_SHADES = (0.0, 0.9)
# Diameter of a dot, and of a faint one (points).
_DOT, _FAINT = 4.0, 2.2
_NAME_SIZE = 6.0


def draw(axes: Any, series: dict[str, Any], panel: dict[str, Any]) -> Any:
    """Draws a series; returns what stands for it in a legend, or None."""
    points = series["points"]
    if not points:
        return None
    group, mark = series["group"], series["mark"]
    colour = TEXT if group is None else COLOURS[group % len(COLOURS)]
    dash = "-" if group is None else DASHES[group % len(DASHES)]
    marker = MARKERS[(group or 0) % len(MARKERS)]
    nan = float("nan")
    xs = [point["x"] for point in points]
    ys = [nan if point["y"] is None else point["y"] for point in points]
    low, high = ([point.get(end, nan) for point in points] for end in ("low", "high"))
    errors = [[max(y - end, 0.0) for y, end in zip(ys, low, strict=True)], [max(end - y, 0.0) for y, end in zip(ys, high, strict=True)]]
    if mark in ("line", "band"):
        width = 0.6 if len(points) > _MANY_POINTS else 1.2
        (line,) = axes.plot(xs, ys, color=colour, linestyle=dash if mark == "line" else "-", linewidth=width)
        if mark == "line":
            return line
        return line, axes.fill_between(xs, low, high, color=colour, alpha=0.2, linewidth=0)
    if mark == "interval":
        line = "none" if panel["x"]["scale"] == "category" else dash
        style = {"linestyle": line, "linewidth": 0.9, "marker": marker, "markersize": _DOT, "capsize": 2.5}
        return axes.errorbar(xs, ys, yerr=errors, color=colour, **style)
    if mark == "bar":
        bars = axes.bar(xs, ys, width=0.6, color=colour)
        if any(end == end for end in low + high):
            axes.errorbar(xs, ys, yerr=errors, color=TEXT, linestyle="none", linewidth=0.9, capsize=2.5)
        return bars
    if mark in ("dot", "faint-dot"):
        return _dots(axes, series, panel, {"color": colour, "marker": marker, "linestyle": "none", "markeredgewidth": 0})
    if mark == "segment":
        from matplotlib.collections import LineCollection

        lines = [((point["x"], point["y"]), tuple(point["end"])) for point in points]
        return axes.add_collection(LineCollection(lines, colors=colour, linewidths=1.6 if group is None else 0.8))
    if mark == "arrow":
        _arrows(axes, points, colour, panel["colour"])
    return None


def _dots(axes: Any, series: dict[str, Any], panel: dict[str, Any], style: dict[str, Any]) -> Any:
    points = [point for point in series["points"] if point["y"] is not None]
    is_faint = series["mark"] == "faint-dot"
    size, alpha = (_FAINT, 0.45) if is_faint else (_DOT, 1)
    xs, ys = [point["x"] for point in points], [point["y"] for point in points]
    # Above arrows and lines, but trials below their medians.
    (drawn,) = axes.plot(xs, ys, markersize=size, alpha=alpha, zorder=2 if is_faint else 3, **style)
    if is_faint and not panel["is_map"]:
        from matplotlib.transforms import ScaledTranslation

        drawn.set_transform(axes.transData + ScaledTranslation(-_BESIDE / 72, 0, axes.figure.dpi_scale_trans))
    named = [(x, y, point["name"]) for x, y, point in zip(xs, ys, points, strict=True) if point.get("name")]
    if not is_faint and named and len(points) <= _MOST_NAMES:
        from murmuration._paper import Names

        axes.add_artist(Names(named, _NAME_SIZE, TEXT, _DOT / 2))
    return drawn


def _arrows(axes: Any, points: list[dict[str, Any]], colour: str, scale: dict[str, Any] | None) -> None:
    """Arrows from senders to receivers, and the scale of their colours."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize, to_rgba

    from murmuration._paper import Arrows

    shades = None if scale is None else ScalarMappable(Normalize(*scale["range"]), _shades())
    arrows: list[tuple[Any, Any, Any]] = []
    for point in sorted(points, key=lambda point: point.get("value") or 0.0):
        value = point.get("value")
        own = to_rgba(colour, 0.6) if shades is None or value is None else shades.to_rgba(value)
        arrows.append(((point["x"], point["y"]), tuple(point["end"]), own))
    axes.add_artist(Arrows(arrows, _DOT / 2 + 0.5))
    if shades is not None and scale is not None:
        _colour_bar(axes, shades, scale)


@functools.cache
def _shades() -> Any:
    import matplotlib
    from matplotlib.colors import LinearSegmentedColormap

    n = 24
    low, high = _SHADES
    viridis = matplotlib.colormaps["viridis"]
    return LinearSegmentedColormap.from_list("links", [viridis(low + (high - low) * k / (n - 1)) for k in range(n)])


def _colour_bar(axes: Any, shades: Any, scale: dict[str, Any]) -> None:
    """What colours stand for, in a bar above the axes and as wide as these."""
    from matplotlib import ticker

    bar = axes.inset_axes((0.0, 0.06, 1.0, 0.07), transform=above(axes))
    form = ticker.FuncFormatter(per_cent) if scale["is_share"] else None
    drawn = axes.figure.colorbar(shades, cax=bar, orientation="horizontal", ticklocation="top", format=form)
    drawn.set_label(scale["label"])
    drawn.outline.set_visible(False)
    bar.xaxis.set_major_locator(ticker.MaxNLocator(4))


def above(axes: Any) -> Any:
    """The transformation of a place above axes: shares of their width, and inches from their upper edge."""
    from matplotlib.transforms import ScaledTranslation, blended_transform_factory

    upwards = axes.figure.dpi_scale_trans + ScaledTranslation(0.0, 1.0, axes.transAxes)
    return blended_transform_factory(axes.transAxes, upwards)


def per_cent(share: float, _: Any = None) -> str:
    """A share as text."""
    return f"{100 * share:.6g} %"
