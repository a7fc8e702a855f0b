"""Robot swarms that communicate over a radio mesh: run experiments, and find the physics that a model lacks.

    import murmuration

    run = murmuration.run("flocking.toml", seed=3, netsim__phy__propagation="friis")
    run.summary["task"], run.steps, run.plot()

Configurations are files or dictionaries of the same form; docs/configuration.md lists their keys. Settings override keys, two
underscores in place of a dot. What is wrong with an input is raised as `InvalidInput`, with the program's text.

`progress`: by default, commands show their progress in a notebook and on a terminal; False never, True elsewhere, too.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from murmuration import export, importers
from murmuration._answers import Answer, Run, Sweep
from murmuration._files import Config, config_file, private_folder, settings, table_file
from murmuration._program import InvalidInput, MurmurationError, call, program

__all__ = [
    "Answer", "InvalidInput", "MurmurationError", "Radio", "Run", "Sweep",
    "compare", "diagnose", "export", "extend", "importers", "metrics", "power", "program", "run", "simulate", "sweep",
]  # fmt: skip

if TYPE_CHECKING:
    from collections.abc import Sequence

    from murmuration.radio import Radio

    Path_ = str | os.PathLike[str]
    Paths = Path_ | Sequence[Path_]


def __getattr__(name: str) -> Any:
    # Runs and sweeps need neither gRPC nor numpy, which take a while to import.
    if name == "Radio":
        from murmuration.radio import Radio

        return Radio
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def run(
    config: Config, seed: int | None = None, *, out: str | os.PathLike[str] = "runs", threads: int | None = None,
    robotsim: str | None = None, netsim: str | None = None, replace: bool = False, allow_command: bool = False,
    allow_file: Paths = (), allow_url: str | Sequence[str] = (), progress: bool | None = None, **overrides: Any,
) -> Run:  # fmt: skip
    """Runs an experiment and records it in a subfolder of `out`.

    `robotsim` and `netsim` are URLs of simulators to use in place of the built-in ones. `allow_command` allows the configuration
    to start simulators by `command`: give it only for configurations that you trust. `allow_file` are files outside of the
    configuration's folder that it may read, or folders with all that is in them; `allow_url` are URLs that it may call. `replace` replaces an earlier result of
    another configuration; without it the new one gets a folder beside it.
    """
    options = [*_seed(seed), *_option("--threads", threads), *_option("--robotsim", robotsim), *_option("--netsim", netsim)]
    options += [*_flag("--replace", replace), *_allowed(allow_command, allow_file, allow_url), "--out", os.fspath(out)]
    return _run(config, options, overrides, progress=progress)


def _allowed(command: bool, files: Paths, urls: str | Sequence[str]) -> list[str]:
    files = [files] if isinstance(files, str | os.PathLike) else files
    urls = [urls] if isinstance(urls, str) else urls
    options = _flag("--allow-command", command)
    options += [word for file in files for word in ("--allow-file", os.fspath(file))]
    return options + [word for url in urls for word in ("--allow-url", url)]


def _run(config: Config, options: list[str], overrides: dict[str, Any], *, progress: bool | None = None, quiet: bool = False) -> Run:
    with config_file(config) as path:
        printed = call(["run", path, *options, *settings(overrides)], progress, quiet=quiet)
    return Run(_folder(printed), printed)


def sweep(
    config: Config, seed: int | None = None, *, out: str | os.PathLike[str] = "runs", jobs: int | None = None, restart: bool = False,
    allow_command: bool = False, allow_file: Paths = (), allow_url: str | Sequence[str] = (),
    progress: bool | None = None, **overrides: Any,
) -> Sweep:  # fmt: skip
    """Runs an experiment under the settings and seeds of its section [sweep]; goes on with trials that are in `out` already.

    `allow_command`, `allow_file` and `allow_url` are those of `run`; each of the `jobs` trials that run at a time has simulators of its own.
    """
    options = [*_seed(seed), *_option("--jobs", jobs), *_flag("--restart", restart)]
    options += _allowed(allow_command, allow_file, allow_url)
    with config_file(config) as path:
        printed = call(["sweep", path, "--out", out, *options, *settings(overrides)], progress)
    return Sweep(_folder(printed), printed)


def compare(
    config: Config, data: Any, seed: int | None = None, *, memory_budget: str | None = None,
    allow_file: Paths = (), unverified: bool = False, progress: bool | None = None, **overrides: Any,
) -> Answer:  # fmt: skip
    """Measures how large the error of a model is on measurements, and under which conditions. `data`: a file or a data frame.

    `memory_budget` is how much memory the measurements may take while they are read, such as "2GiB"; 1 GiB by default. `allow_file`
    is that of `run`. `unverified` reads measurements that are a result although their files were changed.
    """
    return _about("compare", config, data, [*_seed(seed), *_reading(memory_budget, allow_file, unverified)], overrides, progress)


def diagnose(
    config: Config, data: Any, seed: int | None = None, *, budget_s: float | None = None, memory_budget: str | None = None,
    allow_file: Paths = (), unverified: bool = False, progress: bool | None = None, **overrides: Any,
) -> Answer:  # fmt: skip
    """Finds the physical effects that a model lacks, from measurements. `budget_s` limits the time it may take."""
    options = [*_seed(seed), *_option("--budget", budget_s), *_reading(memory_budget, allow_file, unverified)]
    return _about("diagnose", config, data, options, overrides, progress)


def extend(
    config: Config, data: Any, output: str | os.PathLike[str], *, effect: str | None = None, all: bool = False,  # noqa: A002
    replace: bool = False, seed: int | None = None, memory_budget: str | None = None, allow_file: Paths = (),
    unverified: bool = False, progress: bool | None = None, **overrides: Any,
) -> Answer:  # fmt: skip
    """Fits a missing effect to measurements and writes the configuration with it to `output`.

    `replace` replaces the file `output` if it exists.
    """
    options = [*_seed(seed), *_option("--effect", effect), *_flag("--all", all), *_flag("--replace", replace), "--output", os.fspath(output)]
    options += _reading(memory_budget, allow_file, unverified)
    return _about("extend", config, data, options, overrides, progress)


def simulate(
    config: Config, like: Any, output: str | os.PathLike[str], seed: int | None = None, *, memory_budget: str | None = None,
    allow_file: Paths = (), unverified: bool = False, progress: bool | None = None, **overrides: Any,
) -> Answer:  # fmt: skip
    """Simulates a measurement campaign with the times, places and commands of `like`, and writes it to `output` (CSV)."""
    options = ["--output", output, *_seed(seed), *_reading(memory_budget, allow_file, unverified)]
    with config_file(config) as path, table_file(like) as table:
        return _answer(["simulate", path, "--like", table, *options, *settings(overrides)], progress)


def power(
    config: Config, like: Any, effect: str, *, campaigns: int | None = None, seed: int | None = None,
    memory_budget: str | None = None, allow_file: Paths = (),
    unverified: bool = False, progress: bool | None = None, **overrides: Any,
) -> Answer:  # fmt: skip
    """Estimates how large an effect must be for a campaign like `like` to detect it."""
    options = ["--effect", effect, *_option("--campaigns", campaigns), *_seed(seed), *_reading(memory_budget, allow_file, unverified)]
    with config_file(config) as path, table_file(like) as table:
        return _answer(["power", path, "--like", table, *options, *settings(overrides)], progress)


def metrics(name: str | None = None) -> Answer:
    """All metrics of a run, or the one of this short name or path: meaning, unit, and whether higher or lower values are better."""
    return _answer(["metrics", *(["--all"] if name is None else [name])], False)


def _reading(memory_budget: str | None, allow_file: Paths, unverified: bool) -> list[str]:
    options = [*_option("--memory-budget", memory_budget), *_flag("--unverified", unverified)]
    return options + _allowed(False, allow_file, ())


def _about(
    command: str, config: Config, data: Any, options: list[str], overrides: dict[str, Any], progress: bool | None
) -> Answer:  # fmt: skip
    with contextlib.ExitStack() as stack:
        path = stack.enter_context(config_file(config))
        table = stack.enter_context(table_file(data))
        return _answer([command, path, "--data", table, *options, *settings(overrides)], progress)


def _answer(arguments: list[Any], progress: bool | None) -> Answer:
    with private_folder() as folder:
        file = folder / "answer.json"
        printed = call([*arguments, "--json", file], progress)
        return Answer(json.loads(file.read_text()), printed)


def _folder(printed: str) -> Path:
    found = re.findall(r"^results in (.+)$", printed, flags=re.MULTILINE)
    if not found:
        raise MurmurationError(f"the program named no folder of results:\n{printed}")
    return Path(found[-1])


def _seed(seed: int | None) -> list[str]:
    return _option("--seed", seed)


def _option(name: str, value: Any) -> list[str]:
    return [] if value is None else [name, str(value)]


def _flag(name: str, is_given: bool) -> list[str]:
    return [name] if is_given else []
