"""Configurations and tables on their way to the program: files as they are, dictionaries and data frames through a temporary file."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import re
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import tomli_w

from murmuration._program import InvalidInput, MurmurationError

if TYPE_CHECKING:
    import pandas
    import polars

# What the program quotes of a file: the line of a problem, after its number.
_QUOTED_LINES = re.compile(r"\n +(?:\d+ )?\|(?: [^\n]*)?(?=\n|$)")

# A configuration: a file (TOML), or a dictionary of the same form.
Config = str | os.PathLike[str] | Mapping[str, Any]
# A data frame of the library that is installed; of polars, if both are.
DataFrame: TypeAlias = "polars.DataFrame | pandas.DataFrame"
# Measurements: a file, or a data frame.
Table: TypeAlias = "str | os.PathLike[str] | polars.DataFrame | pandas.DataFrame"


@contextlib.contextmanager
def config_file(config: Config) -> Iterator[Path]:
    """The file of a configuration. Files that a dictionary names are relative to the working directory."""
    if isinstance(config, (str, os.PathLike)):
        yield Path(config)
        return
    if not isinstance(config, Mapping):
        raise TypeError(f"config must be a path or a dictionary, got {type(config).__name__}")
    # In the working directory, because the program takes the paths in it as relative to the file.
    handle, name = tempfile.mkstemp(prefix=".murmuration-", suffix=".toml", dir=os.getcwd())
    path = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            tomli_w.dump(plain(config), file)
        yield path
    except MurmurationError as error:
        # Lines of a file that nobody wrote: the dictionary is what they stand for.
        text = re.sub(rf"{re.escape(name)}(:\d+(?=: ))?", "the configuration", str(error))
        raise type(error)(_QUOTED_LINES.sub("", text)) from None
    finally:
        path.unlink(missing_ok=True)


@contextlib.contextmanager
def private_folder() -> Iterator[Path]:
    """A temporary folder that only this user may enter."""
    with tempfile.TemporaryDirectory(prefix="murmuration-") as folder:
        lock = hold(folder)
        try:
            yield Path(folder)
        finally:
            os.close(lock)


def hold(folder: str) -> int:
    """Locks a temporary folder; returns the descriptor that holds the lock.

    As in the folders of the program: one whose lock nobody holds was left by a process that was killed, and is removed.
    """
    unlocked = os.path.join(folder, "lock.new")
    lock = os.open(unlocked, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    fcntl.flock(lock, fcntl.LOCK_EX)
    os.rename(unlocked, os.path.join(folder, "lock"))
    return lock


@contextlib.contextmanager
def table_file(table: Table) -> Iterator[Path]:
    """The file of a table of measurements: a path, or a data frame of polars or pandas."""
    if isinstance(table, (str, os.PathLike)):
        yield Path(table)
        return
    with private_folder() as folder:
        path = folder / "data.csv"
        if hasattr(table, "write_csv"):
            table.write_csv(path)
        elif hasattr(table, "to_csv"):
            table.to_csv(path, index=False)
        else:
            raise TypeError(f"data must be a path or a data frame of polars or pandas, got {type(table).__name__}")
        try:
            yield path
        except MurmurationError as error:
            raise type(error)(_of_data_frame(str(error), path)) from None


def _of_data_frame(text: str, path: Path) -> str:
    """A text about the file of a data frame as one about the data frame. The first row is on the second line."""
    text = re.sub(rf"murmuration import {re.escape(str(path))}( --\S+ \S+)*", "murmuration.importers.convert", text)
    text = text.replace(str(path), "the data frame")
    return re.sub(r"\bon line (\d+)", lambda found: f"in row {int(found[1]) - 2}", text)


def settings(overrides: Mapping[str, Any]) -> list[str]:
    """Options that override keys. Two underscores in a name stand for the dot between tables."""
    options = []
    for name, value in overrides.items():
        if value is None:
            raise InvalidInput(f"{name} must not be None; leave it out for the value of the configuration")
        options += ["--set", f"{name.replace('__', '.')}={_toml_value(value)}"]
    return options


def _toml_value(value: Any) -> str:
    """A value as TOML writes it on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(str(key))} = {_toml_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml_value(item) for item in value) + "]"
    return tomli_w.dumps({"value": plain(value)}).removeprefix("value = ").strip()


def plain(value: Any) -> Any:
    """Without numpy: its numbers and arrays become Python's."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items() if item is not None}
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value
