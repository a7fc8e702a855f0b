"""Names of metrics: short names such as `pdr`, and paths of summary.json. The program has the list."""

from __future__ import annotations

import functools
import json
from collections.abc import Collection

from murmuration._program import call


@functools.cache
def _paths() -> dict[str, str]:
    """The path of each short name."""
    listed = json.loads(call(["metrics", "--json", "-"], quiet=True))["metrics"]
    return {metric["name"]: metric["path"] for metric in listed}


def path_of(name: str) -> str:
    """The path of a short name; any other name is returned as it is."""
    return _paths().get(name, name)


def short_names(paths: Collection[str]) -> list[str]:
    """The short names of these paths that have one."""
    return [name for name, path in _paths().items() if path in paths and name != path]


def is_name(name: str) -> bool:
    """Whether a metric has this short name or this path."""
    return name in _paths() or name in _paths().values()


def one_of(names: Collection[str], name: str) -> str | None:
    """The one of `names` that is this metric, under the same name or the other one; None if none is."""
    if name in names:
        return name
    path = path_of(name)
    return next((other for other in names if path_of(other) == path), None)
