"""Refusals in the terms of Python: keyword arguments in place of options and dotted keys, and one short traceback."""

from __future__ import annotations

import difflib
import functools
import inspect
import json
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ParamSpec, TypeVar

from murmuration._program import InvalidInput, MurmurationError, call
from murmuration._wording import keyword_of

P = ParamSpec("P")
R = TypeVar("R")


def in_python_terms(function: Callable[P, R]) -> Callable[P, R]:
    """The function, whose refusals speak of its keyword arguments. Their traceback ends here, where the text is all that matters."""
    own = [name for name, one in inspect.signature(function).parameters.items() if one.kind is not one.VAR_KEYWORD]

    @functools.wraps(function)
    def speaking(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except MurmurationError as error:
            overrides = {name: value for name, value in kwargs.items() if name not in own}
            kind = InvalidInput if isinstance(error, InvalidInput) else MurmurationError
            refusal = kind(translated(str(error), overrides, own))
        raise refusal

    return speaking


def whole_number(name: str, value: Any, least: int, most: int) -> int:
    """An argument that must be a whole number; of numpy's, too."""
    try:
        # Truth values are no numbers of anything.
        number = None if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = None
    if number is None or not least <= number <= most:
        raise InvalidInput(f"{name} must be an int from {least} to {most}, got {value!r}")
    return number


def translated(text: str, overrides: Mapping[str, Any], parameters: list[str]) -> str:
    """The text of the program for a call with these overrides of keys, to a function with these parameters."""
    return "\n".join(_line(line, overrides, parameters) for line in text.splitlines())


def _line(line: str, overrides: Mapping[str, Any], parameters: list[str]) -> str:
    """A line about an override, without the configuration that has no part in it; any other line as it is."""
    for name in sorted(overrides, key=len, reverse=True):
        dotted = name.replace("__", ".")
        key = "|".join([rf"{re.escape(dotted)}(?:[.\[][^:\s]*)?", *(re.escape(path) for path in _above(dotted))])
        found = re.search(rf"(?:^|: )(?P<key>{key}): (?P<problem>.*) \((?:set on the command line|in a keyword argument .*)\)$", line)
        if found is None:
            continue
        # Where a table above the key does not exist, the key as it was given.
        keyword, problem = name if found["key"] in _above(dotted) else keyword_of(found["key"]), found["problem"]
        if problem.startswith("is not a known"):
            return _unknown(keyword, problem, overrides, parameters)
        return f"{keyword} {problem}" if problem.startswith("must ") else f"{keyword}: {problem}"
    return line


def _above(dotted: str) -> list[str]:
    """The tables that a key is in, by their own dotted keys."""
    *tables, _ = dotted.split(".")
    return [".".join(tables[: n + 1]) for n in range(len(tables))]


def _unknown(keyword: str, problem: str, overrides: Mapping[str, Any], parameters: list[str]) -> str:
    """A key that does not exist, and the nearest that does."""
    said = re.search(r"\(nearest valid: (.*)\)$", problem)
    before, _, _ = keyword.rpartition("__")
    if said is not None and before and problem.startswith("is not a known key"):
        near = [f"{before}__{said[1]}"]
    else:
        near = _nearest(keyword, parameters)
    if not near:
        _, _, known = problem.partition("; ")
        return f"there is no key {keyword}" + (f"; {known}" if known else "")
    value = f"={overrides[keyword]!r}" if keyword in overrides else ""
    if len(near) == 1:
        return f"there is no key {keyword}; the nearest is {near[0]}{value}"
    return f"there is no key {keyword}; the nearest are {', '.join(near)}"


def _nearest(keyword: str, parameters: list[str]) -> list[str]:
    """The arguments and keys that are as near as any to a keyword: by the whole name, or by its last part."""
    *_, last = keyword.split("__")
    nearness = {name: _likeness(keyword, name) for name in parameters}
    for key in _keys():
        *_, end = key.split("__")
        nearness.setdefault(key, max(_likeness(keyword, key), _likeness(last, end)))
    best = max(nearness.values())
    if best < 0.6:
        return []
    near = [name for name, likeness in nearness.items() if likeness == best]
    # Arguments rather than keys, and keys near the top first.
    near = [name for name in near if name in parameters] or near
    return sorted(near, key=lambda name: (name.count("__"), name))[:3]


def _likeness(one: str, other: str) -> float:
    return difflib.SequenceMatcher(None, one, other).ratio()


@functools.cache
def _keys() -> tuple[str, ...]:
    """All keys of an experiment as keyword arguments."""

    def below(schema: Mapping[str, Any], path: str) -> Iterator[str]:
        for kind in ("anyOf", "oneOf", "allOf"):
            for one in schema.get(kind, ()):
                yield from below(one, path)
        for key, value in schema.get("properties", {}).items():
            name = f"{path}__{key}" if path else key
            yield name
            yield from below(value, name)

    return tuple(dict.fromkeys(below(json.loads(call(["schema"], False, quiet=True)), "")))
