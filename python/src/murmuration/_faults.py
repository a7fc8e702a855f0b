"""Faults of classes that users write: what their methods must return, and how a fault is shown."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

_PACKAGE = Path(__file__).parent
# Exceptions of a chain that are shown.
_MOST_CAUSES = 3


class WrongResult(ValueError):
    """A method of a user's class returned something else than it must. The text begins with the name of the method."""

    def __init__(self, method: Callable[..., Any], text: str) -> None:
        super().__init__(f"{method.__name__} must return {text}")
        code = getattr(method, "__code__", None)
        if code is not None:
            self.add_note(f'  File "{code.co_filename}", line {code.co_firstlineno}, in {method.__qualname__}')


def shown(error: BaseException) -> str:
    """An exception as its author needs it: its text, the lines of the author's own code that led to it, and its causes."""
    parts: list[str] = []
    one: BaseException | None = error
    while one is not None and len(parts) < _MOST_CAUSES:
        text = "".join(traceback.format_exception_only(one)).strip()
        if isinstance(one, WrongResult):
            text = text.removeprefix(f"{__name__}.WrongResult: ")
        parts.append("\n".join([text, *(line.rstrip() for line in _frames(one))]))
        one = one.__cause__ or (None if one.__suppress_context__ else one.__context__)
    return "\ncaused by ".join(parts)


def _frames(error: BaseException) -> list[str]:
    """The frames of an exception without those of this package, unless it has no others."""
    if isinstance(error, WrongResult):
        return []
    frames = list(traceback.extract_tb(error.__traceback__))
    own = [frame for frame in frames if _PACKAGE not in Path(frame.filename).parents]
    # Without columns, there are no lines of carets.
    plain = [traceback.FrameSummary(frame.filename, frame.lineno, frame.name) for frame in own or frames]
    return traceback.StackSummary.from_list(plain).format()


def positions(method: Callable[..., Any], returned: Any, n: int) -> np.ndarray:
    """Positions that a method returned for `n` robots (m), as a new array with the columns x, y, z."""
    shape = f"positions of shape ({n}, 2) or ({n}, 3)"
    if returned is None:
        raise WrongResult(method, f"{shape}, got None; end it with a return statement")
    try:
        positions_m = np.array(returned, dtype=float)
    except (TypeError, ValueError):
        raise WrongResult(method, f"{shape}, got {_short(returned)}") from None
    if positions_m.ndim != 2 or positions_m.shape[0] != n or positions_m.shape[1] not in (2, 3):
        raise WrongResult(method, f"{shape}, got {positions_m.shape}")
    if not np.all(np.isfinite(positions_m)):
        robot = int(np.flatnonzero(~np.isfinite(positions_m).all(axis=1))[0])
        raise WrongResult(method, f"finite positions, got {positions_m[robot]} for robot {robot}")
    if positions_m.shape[1] == 2:
        positions_m = np.column_stack([positions_m, np.zeros(n)])
    return positions_m


def payloads(method: Callable[..., Any], returned: Any, n: int) -> list[bytes]:
    """What `n` robots say, as a method returned it."""
    wanted = f"a list of {n} bytes objects, one for each robot"
    if isinstance(returned, (str, bytes)) or not hasattr(returned, "__len__"):
        raise WrongResult(method, f"{wanted}, or None, got {_short(returned)}")
    if len(returned) != n:
        raise WrongResult(method, f"{wanted}, got {len(returned)}")
    for robot, payload in enumerate(returned):
        if not isinstance(payload, (bytes, bytearray, memoryview)):
            hint = "; use its method encode()" if isinstance(payload, str) else ""
            raise WrongResult(method, f"{wanted}, got {_short(payload)} for robot {robot}{hint}")
    return [bytes(payload) for payload in returned]


def figures(method: Callable[..., Any], returned: Any) -> dict[str, float]:
    """Figures of a task, as a method returned them."""
    if not isinstance(returned, dict):
        raise WrongResult(method, f"a dictionary of numbers by name, got {_short(returned)}")
    numbers: dict[str, float] = {}
    for name, value in returned.items():
        try:
            if isinstance(value, str):
                raise TypeError
            numbers[str(name)] = float(value)
        except (TypeError, ValueError):
            raise WrongResult(method, f"numbers, got {_short(value)} for {name!r}") from None
    return numbers


def _short(value: Any) -> str:
    """A value and its type, on one line."""
    text = " ".join(repr(value).split())
    return f"{text if len(text) <= 60 else text[:59] + '…'} ({type(value).__name__})"
