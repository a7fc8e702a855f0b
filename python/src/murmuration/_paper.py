"""Parts of figures that derive from matplotlib's classes. Imported only when something is drawn."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Bbox, IdentityTransform

# Publishers refuse Type 3 fonts, matplotlib's default. Type 42 is TrueType.
FONTS = {"pdf.fonttype": 42, "ps.fonttype": 42}
# Of arrows (points): width of the line, length of the head and half its width, and how far they are to the right.
_LINE, _HEAD, _ASIDE = 0.7, (4.0, 1.5), 1.3


class PaperFigure(Figure):
    """A figure whose PDF and PostScript files embed fonts as TrueType, whatever the user's settings for other figures are."""

    def __repr__(self) -> str:
        return super().__repr__().replace(type(self).__name__, "Figure", 1)

    def savefig(self, *args: Any, **kwargs: Any) -> None:
        """Saves the figure as matplotlib does."""
        with matplotlib.rc_context(FONTS):
            super().savefig(*args, **kwargs)


class Arrows(Artist):
    """Arrows from place to place, each a little to the right of the line between them, so that both directions of a pair are seen."""

    zorder = 2

    def __init__(self, arrows: list[tuple[Any, Any, Any]], gap: float) -> None:
        super().__init__()
        self.arrows, self.gap = arrows, gap

    def draw(self, renderer: Any) -> None:
        axes = self.axes
        if axes is None or not self.get_visible() or not self.arrows:
            return
        unit = renderer.points_to_pixels(1.0)
        ends = axes.transData.transform([place for begin, end, _ in self.arrows for place in (begin, end)]).reshape(-1, 2, 2)
        style = renderer.new_gc()
        self._set_gc_clip(style)  # type: ignore[attr-defined]
        for (begin, end), (_, _, colour) in zip(ends, self.arrows, strict=True):
            along = end - begin
            length = float(np.hypot(*along))
            if length < (2 * self.gap + _HEAD[0]) * unit:
                continue
            ahead = along / length * unit
            right = np.array([ahead[1], -ahead[0]])
            tail, tip = begin + self.gap * ahead + _ASIDE * right, end - self.gap * ahead + _ASIDE * right
            foot = tip - _HEAD[0] * ahead
            style.set_foreground(colour)
            style.set_linewidth(_LINE)
            renderer.draw_path(style, Path([tail, foot]), IdentityTransform())
            style.set_linewidth(0.0)
            head = Path([tip, foot + _HEAD[1] * right, foot - _HEAD[1] * right, tip], closed=True)
            renderer.draw_path(style, head, IdentityTransform(), colour)
        style.restore()

    def get_tightbbox(self, renderer: Any = None) -> None:
        """Arrows are inside of the axes and need no room."""
        return None


class Names(Artist):
    """Names beside dots. Each stands where it covers no other name and no dot; one that has no such place is left out.

    Places are chosen at each drawing, so that they fit whatever the size and the zoom of the axes are.
    """

    zorder = 5

    def __init__(self, points: list[tuple[float, float, str]], size: float, colour: str, radius: float) -> None:
        super().__init__()
        self.points, self.radius = points, radius
        self.text = Text(fontsize=size, color=colour, path_effects=[withStroke(linewidth=1.5, foreground="white")])

    def draw(self, renderer: Any) -> None:
        axes = self.axes
        if axes is None or not self.get_visible():
            return
        unit = renderer.points_to_pixels(1.0)
        area = axes.get_window_extent(renderer)
        at = axes.transData.transform([(x, y) for x, y, _ in self.points])
        room = self.radius * unit
        taken = [Bbox.from_extents(x - room, y - room, x + room, y + room) for x, y in at]
        self.text.set_figure(axes.figure)
        for place, (_, _, name) in enumerate(self.points):
            self.text.set_text(name)
            for right, up in ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1.3), (0, -1.3), (1.3, 0), (-1.3, 0)):
                self._put(at[place], right * (room + unit), up * (room + unit))
                box = self.text.get_window_extent(renderer)
                others = taken[:place] + taken[place + 1 :]
                is_inside = area.x0 <= box.x0 and box.x1 <= area.x1 and area.y0 <= box.y0 and box.y1 <= area.y1
                if is_inside and not any(box.overlaps(other) for other in others):
                    taken.append(box)
                    self.text.draw(renderer)
                    break

    def _put(self, centre: Any, right: float, up: float) -> None:
        """Puts the text beside a point (pixels)."""
        self.text.set_position((centre[0] + right, centre[1] + up))
        self.text.set_horizontalalignment("left" if right > 0 else "right" if right < 0 else "center")
        self.text.set_verticalalignment("bottom" if up > 0 else "top" if up < 0 else "center")

    def get_tightbbox(self, renderer: Any = None) -> None:
        """Names are inside of the axes and need no room."""
        return None
