"""The progress of the program: from the lines that it prints on standard error to a bar in a notebook or a terminal."""

from __future__ import annotations

import html
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

# Commands that end sooner show no progress (s).
FIRST_AFTER_S = 0.7
# Time between two drawings (s), so that the time used goes on between two lines of the program.
DRAW_EVERY_S = 0.5
# Width of a bar in a terminal (characters).
WIDTH = 30

# The searches for missing effects report their progress in the log of this module, which is off by default.
SEARCHES = frozenset({"diagnose", "extend", "power"})
SEARCH_LOG = "orchestrator::cli::search_log"

_COUNTS = (
    re.compile(r"^step (?P<done>\d+)/(?P<total>\d+)  "),
    re.compile(r"^(?P<done>\d+) of (?P<total>\d+) (?:trials|campaigns|frames)\b"),
    re.compile(r"^network formation: (?P<done>\d+) of (?P<total>\d+) motes ready\b"),
    re.compile(r"^round \d+: (?P<done>\d+) of (?P<total>\d+) candidates\b"),
)
_LOGGED = re.compile(rf"^\s*INFO {re.escape(SEARCH_LOG)}: (?P<text>.*)$")


@dataclass(frozen=True)
class Progress:
    """How far the program is: its words, and a share from 0 to 1 where it counts."""

    text: str
    share: float | None = None


def read_line(line: str) -> Progress | None:
    """The progress that a line on standard error reports; None for every other line, such as a warning."""
    logged = _LOGGED.match(line)
    text = (logged["text"] if logged else line).strip()
    for pattern in _COUNTS:
        found = pattern.match(text)
        if found:
            total = int(found["total"])
            return Progress(text, min(1.0, int(found["done"]) / total) if total else None)
    return Progress(text) if logged else None


def with_search_log(arguments: Sequence[Any]) -> list[Any]:
    """The arguments with the log switched on in which a search reports its progress."""
    if arguments and arguments[0] in SEARCHES:
        return [*arguments, "--log", f"warn,{SEARCH_LOG}=info"]
    return list(arguments)


class Display:
    """Shows progress; this one shows nothing."""

    def __init__(self, title: str) -> None:
        self.title = title
        self.begun_s = self.drawn_s = time.monotonic()
        self.latest = Progress("")
        self.is_shown = False

    def update(self, progress: Progress) -> None:
        """Takes the latest progress."""
        self.latest = progress
        self.tick()

    def tick(self) -> None:
        """Draws, if it is time to."""
        now_s = time.monotonic()
        if now_s - self.begun_s < FIRST_AFTER_S or (self.is_shown and now_s - self.drawn_s < DRAW_EVERY_S):
            return
        self.drawn_s = now_s
        self.draw()
        self.is_shown = True

    def close(self) -> None:
        """Removes what is shown."""
        if self.is_shown:
            self.clear()

    def line(self) -> str:
        """Command, time used and the words of the program."""
        used = f"{self.title}: {time.monotonic() - self.begun_s:.0f} s"
        return f"{used}, {self.latest.text}" if self.latest.text else used

    def draw(self) -> None:
        """Draws the latest progress."""

    def clear(self) -> None:
        """Removes the drawing."""


class Terminal(Display):
    """A line of a terminal that is drawn again and again."""

    def draw(self) -> None:
        share = self.latest.share
        done = round(WIDTH * (share or 0.0))
        bar = "" if share is None else f"[{'#' * done}{'.' * (WIDTH - done)}] "
        # Cut, because a line that wraps is not drawn over.
        text = (bar + self.line())[: _columns() - 1]
        sys.stderr.write(f"\r\x1b[K{text}")
        sys.stderr.flush()

    def clear(self) -> None:
        sys.stderr.write("\r\x1b[K")
        sys.stderr.flush()


class Notebook(Display):
    """An output of a notebook that is replaced."""

    handle: Any = None

    def draw(self) -> None:
        share = self.latest.share
        bar = "" if share is None else f'<progress max="1" value="{share:.3f}"></progress> '
        self._show(self.line(), f"<div>{bar}<code>{html.escape(self.line())}</code></div>")

    def clear(self) -> None:
        self._show("", "")

    def _show(self, plain: str, rich: str) -> None:
        from IPython.display import display

        content = {"text/plain": plain, "text/html": rich}
        if self.handle is None:
            self.handle = display(content, raw=True, display_id=True)
        else:
            self.handle.update(content, raw=True)


class Lines(Display):
    """A line on standard error for each report of the program."""

    def update(self, progress: Progress) -> None:
        if progress != self.latest:
            self.latest = progress
            print(self.line(), file=sys.stderr, flush=True)

    def tick(self) -> None:
        pass


def display_for(title: str, progress: bool | None) -> Display:
    """The display for a command. None shows progress in a notebook and on a terminal; True elsewhere, too, as lines; False never."""
    if progress is False:
        return Display(title)
    if _is_notebook():
        return Notebook(title)
    if sys.stderr is not None and sys.stderr.isatty():
        return Terminal(title)
    return Lines(title) if progress else Display(title)


def _is_notebook() -> bool:
    """Whether a kernel of Jupyter runs this process. IPython in a terminal is a terminal."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and getattr(shell, "kernel", None) is not None


def _columns() -> int:
    import shutil

    return shutil.get_terminal_size().columns
