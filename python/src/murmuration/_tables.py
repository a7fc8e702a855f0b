"""Tables and other files of results."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import html
import importlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from murmuration._files import DataFrame
from murmuration._program import InvalidInput, MurmurationError

if TYPE_CHECKING:
    import polars


def read_table(path: Path) -> DataFrame:
    """A Parquet file as a data frame of polars, or of pandas where polars is not installed."""
    _check_table(path)
    library = _table_library()
    return library.read_parquet(path)


def scan_table(path: Path) -> polars.LazyFrame:
    """A Parquet file as a lazy frame of polars, which reads the columns and rows that a query needs."""
    _check_table(path)
    try:
        import polars
    except ImportError:
        raise ImportError("lazy tables need polars: pip install polars") from None
    return polars.scan_parquet(path)


def table_of(columns: Mapping[str, Any]) -> DataFrame:
    """A data frame of polars, or of pandas where polars is not installed, from its columns."""
    return _table_library().DataFrame(dict(columns))


def _table_library() -> Any:
    """polars, or pandas where polars is not installed."""
    for name in ("polars", "pandas"):
        with contextlib.suppress(ImportError):
            return importlib.import_module(name)
    raise ImportError("tables need polars or pandas: pip install polars")


def _check_table(path: Path) -> None:
    """Raises an error that names the tables that are there, if this one is not."""
    if path.is_file():
        return
    there = ", ".join(sorted(file.stem for file in path.parent.glob("*.parquet")))
    raise FileNotFoundError(
        f"{path} is not there: the configuration's section [output] says which tables a run leaves. This one left: {there or 'none'}"
    )


class ResultFiles:
    """The files of a result. Each is read only if it is what was written, by its SHA-256 in provenance.json, or if `unverified`."""

    def __init__(self, folder: Path, unverified: bool) -> None:
        self._folder = folder
        self._unverified = unverified

    @property
    def options(self) -> list[str]:
        """The option of the command line for files that are read unchecked."""
        return ["--unverified"] if self._unverified else []

    @functools.cached_property
    def _listed(self) -> dict[str, Any]:
        path = self._folder / "provenance.json"
        try:
            files = json.loads(path.read_bytes())["files"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise MurmurationError(f"{path} lists no files ({error!r}): give unverified=True to read them unchecked") from None
        return dict(files)

    def path(self, name: str) -> Path:
        """The path of a file that is what was written."""
        path = self._folder / name
        if self._unverified or not path.is_file():
            return path
        expected = self._listed.get(name)
        if expected is None:
            raise MurmurationError(f"{path}: provenance.json does not list it; give unverified=True to read it unchecked")
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
        if found != expected.get("sha256"):
            raise MurmurationError(
                f"{path}: its content is not what was written, by the SHA-256 in provenance.json; `murmuration verify` tells where; "
                "give unverified=True to read it as it is"
            )
        return path

    def table(self, name: str) -> DataFrame:
        return read_table(self.path(f"{name}.parquet"))

    def scan(self, name: str) -> polars.LazyFrame:
        return scan_table(self.path(f"{name}.parquet"))

    def tables(self) -> list[str]:
        """The names of the tables that there are."""
        return sorted(file.stem for file in self._folder.glob("*.parquet"))


def summary_of(folder: Path, kind: str) -> dict[str, Any]:
    """The summary of a folder of results, unchecked.

    Raises: FileNotFoundError if it is no such folder; InvalidInput if it is that of a result of another kind than "run" or "sweep".
    """
    path = folder / "summary.json"
    wanted = "a recorded run" if kind == "run" else "a finished sweep"
    if not path.is_file():
        raise FileNotFoundError(f"{folder} is not the folder of {wanted}: it has no summary.json")
    try:
        summary = dict(json.loads(path.read_bytes()))
    except (ValueError, TypeError):
        # It was changed, as whoever reads it is going to be told.
        return {}
    is_sweep = str(summary.get("schema", "")).startswith("murmuration/sweep/")
    if is_sweep != (kind == "sweep"):
        found, name = ("a sweep", "Sweep") if is_sweep else ("a run", "Run")
        raise InvalidInput(f"{folder} is the folder of {found}; open it with murmuration.{name}({str(folder)!r})")
    return summary


def preformatted(text: str) -> str:
    """A text as notebooks show it."""
    return f"<pre>{html.escape(text.strip())}</pre>"
