"""Robot swarms that communicate over a radio mesh: run experiments, and find the physics that a model lacks.

    import murmuration

    run = murmuration.run("flocking.toml", seed=3, netsim__phy__propagation="friis")
    run.summary["task"], run.steps, run.plot()

Configurations are files or dictionaries of the same form; docs/configuration.md lists their keys. Keyword arguments override
keys, with two underscores in place of a dot. What is wrong with an input is raised as `InvalidInput`.

`progress`: by default, commands show their progress in a notebook and on a terminal; False never, True elsewhere, too.
"""

import importlib as _importlib
import typing as _typing

from murmuration import export, importers
from murmuration._answers import Answer, Run
from murmuration._commands import compare, diagnose, extend, metrics, power, run, simulate, sweep
from murmuration._figures import caption, save_figure
from murmuration._files import Config, DataFrame, Table
from murmuration._program import InvalidInput, MurmurationError, program
from murmuration._sweeps import Sweep

__all__ = [
    "Answer", "Config", "DataFrame", "InvalidInput", "MurmurationError", "Radio", "Run", "Sweep", "Table", "__version__",
    "caption", "compare", "diagnose", "env", "export", "extend", "importers", "metrics", "network", "power", "program", "radio", "robots",
    "run", "save_figure", "simulate", "sweep",
]  # fmt: skip

if _typing.TYPE_CHECKING:
    from murmuration import env, network, radio, robots
    from murmuration.radio import Radio

    __version__: str


def __getattr__(name: str) -> _typing.Any:
    # Runs and sweeps need neither gRPC nor gymnasium, which take a while to import.
    if name in ("env", "network", "radio", "robots"):
        return _importlib.import_module(f"murmuration.{name}")
    if name == "Radio":
        return _importlib.import_module("murmuration.radio").Radio
    if name == "__version__":
        return _importlib.import_module("importlib.metadata").version("murmuration-sim")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
