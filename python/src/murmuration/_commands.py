"""The commands of the program as functions."""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from murmuration._answers import Answer, Run
from murmuration._files import Config, Table, config_file, private_folder, settings, table_file
from murmuration._program import InvalidInput, MurmurationError, call
from murmuration._sweeps import Sweep
from murmuration._terms import in_python_terms, whole_number

# Limits of the program's options.
MOST_SEED = 2**63 - 1
MOST_THREADS = 65_535
# The line above the problems of a configuration.
_N_PROBLEMS = re.compile(r": \d+ problems$")
FEWEST_CAMPAIGNS, MOST_CAMPAIGNS = 2, 2**63 - 1


@in_python_terms
def run(
    config: Config, seed: int | None = None, *, out: str | os.PathLike[str] = "runs", threads: int | None = None, robotsim: str | None = None,
    netsim: str | None = None, replace: bool = False, allow_command: bool = False,
    allow_file: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    allow_url: str | Sequence[str] = (), progress: bool | None = None, **overrides: Any,
) -> Run:  # fmt: skip
    """Runs an experiment and records it.

    Parameters
    ----------
    config : str, os.PathLike or Mapping
        The experiment: a file (TOML), or a dictionary of the same form.
    seed : int, optional
        Seed of all random draws, from 0 to 2^63 - 1. By default that of the configuration.
    out : str or os.PathLike
        Folder of results. The run gets a subfolder with the name of the experiment.
    threads : int, optional
        Threads of each simulator, from 1 to 65535; results do not depend on it. By default one for each core.
    robotsim, netsim : str, optional
        URL of a simulator to use in place of the built-in one, such as "http://127.0.0.1:50061".
    replace : bool
        Replaces an earlier result of another configuration. By default the new result gets a folder beside it.
    allow_command : bool
        Allows the configuration to start simulators by `command`. Give it only for configurations that you trust.
    allow_file : str, os.PathLike or a sequence of them
        Files outside of the configuration's folder that it may read, or folders with all that is in them.
    allow_url : str or a sequence of str
        URLs that the configuration may call.
    progress : bool, optional
        Whether to show the progress. By default in a notebook and on a terminal; True shows it elsewhere, too, as lines.
    **overrides
        Keys of the configuration with their values, two underscores in place of a dot: `netsim__phy__radius_m=15.0`.

    Returns
    -------
    Run
        The recorded run, with its summary and its tables.

    Raises
    ------
    InvalidInput
        The configuration or an argument is invalid. The text names all problems.
    MurmurationError
        The run failed.

    Examples
    --------
    >>> run = murmuration.run("configs/flocking.toml", seed=3, netsim__phy__propagation="friis")
    >>> run.summary["task"]["polarisation"]
    """
    options = _options(
        config, overrides, lambda: _seed(seed), lambda: _number("--threads", threads, 1, MOST_THREADS),
        lambda: _url("robotsim", robotsim), lambda: _url("netsim", netsim), lambda: _allowed(allow_command, allow_file, allow_url),
    )  # fmt: skip
    options += [*_flag("--replace", replace), "--out", os.fspath(out)]
    return record(config, options, overrides, progress=progress)


def record(config: Config, options: list[str], overrides: dict[str, Any], *, progress: bool | None = None, quiet: bool = False) -> Run:
    """Runs an experiment with options of the program."""
    with config_file(config) as path:
        printed = call(["run", path, *options, *settings(overrides)], progress, quiet=quiet)
    return Run(_folder(printed), printed)


@in_python_terms
def sweep(
    config: Config, seed: int | None = None, *, out: str | os.PathLike[str] = "runs", jobs: int | None = None, restart: bool = False,
    allow_command: bool = False,
    allow_file: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    allow_url: str | Sequence[str] = (), progress: bool | None = None,
    **overrides: Any,
) -> Sweep:  # fmt: skip
    """Runs an experiment under the settings and seeds of its section [sweep]. Trials that are in `out` already are not repeated.

    Parameters
    ----------
    config : str, os.PathLike or Mapping
        The experiment with a section [sweep]: a file (TOML), or a dictionary of the same form.
    seed : int, optional
        First seed, from 0 to 2^63 - 1. By default that of the configuration.
    out : str or os.PathLike
        Folder of results. The sweep gets a subfolder with the name of the experiment.
    jobs : int, optional
        Trials that run at a time, from 1 to 65535, each with simulators of its own. By default one for each core.
    restart : bool
        Runs all trials again.
    allow_command : bool
        Allows the configuration to start simulators by `command`. Give it only for configurations that you trust.
    allow_file : str, os.PathLike or a sequence of them
        Files outside of the configuration's folder that it may read, or folders with all that is in them.
    allow_url : str or a sequence of str
        URLs that the configuration may call.
    progress : bool, optional
        Whether to show the progress. By default in a notebook and on a terminal; True shows it elsewhere, too, as lines.
    **overrides
        Keys of the configuration with their values, two underscores in place of a dot: `experiment__duration_s=10.0`.

    Returns
    -------
    Sweep
        The sweep, with a table of its trials.

    Raises
    ------
    InvalidInput
        The configuration or an argument is invalid. The text names all problems.
    MurmurationError
        The sweep failed.

    Examples
    --------
    >>> config = {**experiment, "sweep": {"seeds": 5, "vary": {"netsim.phy.radius_m": [5.0, 10.0, 20.0]}}}
    >>> murmuration.sweep(config, jobs=4).plot("netsim.phy.radius_m", "broadcast_pdr")
    """
    options = _options(
        config, overrides, lambda: _seed(seed), lambda: _number("--jobs", jobs, 1, MOST_THREADS),
        lambda: _allowed(allow_command, allow_file, allow_url),
    )  # fmt: skip
    options += _flag("--restart", restart)
    with config_file(config) as path:
        printed = call(["sweep", path, "--out", out, *options, *settings(overrides)], progress)
    return Sweep(_folder(printed), printed)


@in_python_terms
def compare(
    config: Config, data: Table, seed: int | None = None, *, memory_budget: str | None = None,
    allow_file: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    unverified: bool = False, progress: bool | None = None, **overrides: Any,
) -> Answer:  # fmt: skip
    """Measures how large the error of a model is on measurements, and under which conditions.

    Parameters
    ----------
    config : str, os.PathLike or Mapping
        The model: a file (TOML), or a dictionary of the same form.
    data : str, os.PathLike, polars.DataFrame or pandas.DataFrame
        Measurements of links, robots or packets: a file, or a data frame with the same columns.
    seed : int, optional
        Seed of all random draws of a network that is compared with packets, from 0 to 2^63 - 1. Answers about links and robots do not
        depend on it. By default that of the configuration.
    memory_budget : str, optional
        How much memory the measurements may take while they are read, such as "2GiB". By default 1 GiB.
    allow_file : str, os.PathLike or a sequence of them
        Files outside of the configuration's folder that it may read, or folders with all that is in them.
    unverified : bool
        Reads measurements that are a result although their files were changed.
    progress : bool, optional
        Whether to show the progress. By default in a notebook and on a terminal; True shows it elsewhere, too, as lines.
    **overrides
        Keys of the configuration with their values, two underscores in place of a dot: `netsim__phy__propagation="friis"`.

    Returns
    -------
    Answer
        The comparison: the errors, and the conditions under which they deviate.

    Raises
    ------
    InvalidInput
        The configuration, the measurements or an argument is invalid. The text names all problems.
    """
    return _about("compare", config, data, [*_options(config, overrides, lambda: _seed(seed)), *_reading(memory_budget, allow_file, unverified)], overrides, progress)


@in_python_terms
def diagnose(
    config: Config, data: Table, seed: int | None = None, *, budget_s: float | None = None, memory_budget: str | None = None,
    allow_file: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    unverified: bool = False, progress: bool | None = None, **overrides: Any,
) -> Answer:  # fmt: skip
    """Finds the physical effects that a model lacks, from measurements.

    Parameters
    ----------
    config : str, os.PathLike or Mapping
        The model: a file (TOML), or a dictionary of the same form.
    data : str, os.PathLike, polars.DataFrame or pandas.DataFrame
        Measurements of links, robots or packets: a file, or a data frame with the same columns.
    seed : int, optional
        Seed of all random draws of a network that is compared with packets, from 0 to 2^63 - 1. Answers about links and robots do not
        depend on it. By default that of the configuration.
    budget_s : float, optional
        Time after which the search ends with what it has found (s), at most 31536000. By default it is not limited.
    memory_budget : str, optional
        How much memory the measurements may take while they are read, such as "2GiB". By default 1 GiB.
    allow_file : str, os.PathLike or a sequence of them
        Files outside of the configuration's folder that it may read, or folders with all that is in them.
    unverified : bool
        Reads measurements that are a result although their files were changed.
    progress : bool, optional
        Whether to show the progress. By default in a notebook and on a terminal; True shows it elsewhere, too, as lines.
    **overrides
        Keys of the configuration with their values, two underscores in place of a dot: `netsim__phy__propagation="friis"`.

    Returns
    -------
    Answer
        The diagnosis: under "missing" the effects that the model lacks, under "verdict" how sure that is.

    Raises
    ------
    InvalidInput
        The configuration, the measurements or an argument is invalid. The text names all problems.
    """
    options = [*_options(config, overrides, lambda: _seed(seed)), *_option("--budget", budget_s), *_reading(memory_budget, allow_file, unverified)]
    return _about("diagnose", config, data, options, overrides, progress)


@in_python_terms
def extend(
    config: Config, data: Table, output: str | os.PathLike[str], *, effect: str | None = None, all: bool = False,  # noqa: A002
    replace: bool = False, seed: int | None = None, memory_budget: str | None = None,
    allow_file: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    unverified: bool = False, progress: bool | None = None, **overrides: Any,
) -> Answer:  # fmt: skip
    """Fits a missing effect to measurements and writes the configuration with it.

    Parameters
    ----------
    config : str, os.PathLike or Mapping
        The model: a file (TOML), or a dictionary of the same form.
    data : str, os.PathLike, polars.DataFrame or pandas.DataFrame
        Measurements of links, robots or packets: a file, or a data frame with the same columns.
    output : str or os.PathLike
        str | os.PathLike[str] to which the extended configuration is written (TOML).
    effect : str, optional
        Name of the effect to add, such as "wall-attenuation". Give either `effect` or `all`.
    all : bool
        Adds all effects that `diagnose` finds.
    replace : bool
        Replaces the file `output` if it exists.
    seed : int, optional
        Seed of all random draws of a network that is compared with packets, from 0 to 2^63 - 1. Answers about links and robots do not
        depend on it. By default that of the configuration.
    memory_budget : str, optional
        How much memory the measurements may take while they are read, such as "2GiB". By default 1 GiB.
    allow_file : str, os.PathLike or a sequence of them
        Files outside of the configuration's folder that it may read, or folders with all that is in them.
    unverified : bool
        Reads measurements that are a result although their files were changed.
    progress : bool, optional
        Whether to show the progress. By default in a notebook and on a terminal; True shows it elsewhere, too, as lines.
    **overrides
        Keys of the configuration with their values, two underscores in place of a dot: `netsim__phy__propagation="friis"`.

    Returns
    -------
    Answer
        The fitted parameters, and the error before and after.

    Raises
    ------
    InvalidInput
        The configuration, the measurements or an argument is invalid. The text names all problems.
    """
    seeded = _options(config, overrides, lambda: _seed(seed))
    options = [*seeded, *_option("--effect", effect), *_flag("--all", all), *_flag("--replace", replace), "--output", os.fspath(output)]
    options += _reading(memory_budget, allow_file, unverified)
    return _about("extend", config, data, options, overrides, progress)


@in_python_terms
def simulate(
    config: Config, like: Table, output: str | os.PathLike[str], seed: int | None = None, *, memory_budget: str | None = None,
    allow_file: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    unverified: bool = False, progress: bool | None = None, **overrides: Any,
) -> Answer:  # fmt: skip
    """Simulates a measurement campaign with the times, places and commands of another, and writes it as CSV.

    Parameters
    ----------
    config : str, os.PathLike or Mapping
        The model: a file (TOML), or a dictionary of the same form.
    like : str, os.PathLike, polars.DataFrame or pandas.DataFrame
        Measurements with the times, places and commands to take: a file, or a data frame with the same columns.
    output : str or os.PathLike
        str | os.PathLike[str] to which the simulated measurements are written (CSV).
    seed : int, optional
        Seed of all random draws, from 0 to 2^63 - 1. By default 1.
    memory_budget : str, optional
        How much memory the measurements may take while they are read, such as "2GiB". By default 1 GiB.
    allow_file : str, os.PathLike or a sequence of them
        Files outside of the configuration's folder that it may read, or folders with all that is in them.
    unverified : bool
        Reads measurements that are a result although their files were changed.
    progress : bool, optional
        Whether to show the progress. By default in a notebook and on a terminal; True shows it elsewhere, too, as lines.
    **overrides
        Keys of the configuration with their values, two underscores in place of a dot: `netsim__phy__propagation="friis"`.

    Returns
    -------
    Answer
        What was simulated: the number of rows, and the effects of the model.

    Raises
    ------
    InvalidInput
        The configuration, the measurements or an argument is invalid. The text names all problems.
    """
    options = ["--output", output, *_options(config, overrides, lambda: _seed(seed)), *_reading(memory_budget, allow_file, unverified)]
    with config_file(config) as path, table_file(like) as table:
        return _answer(["simulate", path, "--like", table, *options, *settings(overrides)], progress)


@in_python_terms
def power(
    config: Config, like: Table, effect: str, *, campaigns: int | None = None, seed: int | None = None,
    memory_budget: str | None = None,
    allow_file: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    unverified: bool = False, progress: bool | None = None, **overrides: Any,
) -> Answer:  # fmt: skip
    """Estimates how large an effect must be for a measurement campaign to detect it.

    Parameters
    ----------
    config : str, os.PathLike or Mapping
        The model: a file (TOML), or a dictionary of the same form.
    like : str, os.PathLike, polars.DataFrame or pandas.DataFrame
        A campaign with the times, places and commands to take: a file, or a data frame with the same columns.
    effect : str
        Name of the effect, such as "temperature".
    campaigns : int, optional
        Number of campaigns to simulate for each size of the effect, at least 2. By default 10.
    seed : int, optional
        Seed of all random draws, from 0 to 2^63 - 1. By default 1.
    memory_budget : str, optional
        How much memory the measurements may take while they are read, such as "2GiB". By default 1 GiB.
    allow_file : str, os.PathLike or a sequence of them
        Files outside of the configuration's folder that it may read, or folders with all that is in them.
    unverified : bool
        Reads measurements that are a result although their files were changed.
    progress : bool, optional
        Whether to show the progress. By default in a notebook and on a terminal; True shows it elsewhere, too, as lines.
    **overrides
        Keys of the configuration with their values, two underscores in place of a dot: `netsim__phy__propagation="friis"`.

    Returns
    -------
    Answer
        The share of campaigns that detect the effect, by its size.

    Raises
    ------
    InvalidInput
        The configuration, the measurements or an argument is invalid. The text names all problems.
    """
    options = _options(
        config, overrides, lambda: _number("--campaigns", campaigns, FEWEST_CAMPAIGNS, MOST_CAMPAIGNS), lambda: _seed(seed),
    )  # fmt: skip
    options += ["--effect", effect, *_reading(memory_budget, allow_file, unverified)]
    with config_file(config) as path, table_file(like) as table:
        return _answer(["power", path, "--like", table, *options, *settings(overrides)], progress)


@in_python_terms
def metrics(name: str | None = None) -> Answer:
    """Lists the metrics of a run: meaning, unit, and whether higher or lower values are better.

    Parameters
    ----------
    name : str, optional
        Short name of a metric, such as "pdr", or its path. By default all metrics are listed.

    Returns
    -------
    Answer
        Under "metrics" a list of metrics.

    Raises
    ------
    InvalidInput
        There is no such metric. The text has the nearest.

    Examples
    --------
    >>> murmuration.metrics("pdr")["metrics"][0]["unit"]
    '0 to 1'
    """
    return _answer(["metrics", *(["--all"] if name is None else [name])], False)


def _options(config: Config, overrides: dict[str, Any], *arguments: Callable[[], list[str]]) -> list[str]:
    """The options of these arguments. If one is invalid, the error names all that are, and all problems of the configuration."""
    options: list[str] = []
    problems: list[str] = []
    for argument in arguments:
        try:
            options += argument()
        except InvalidInput as error:
            problems.append(str(error))
    if problems:
        try:
            with config_file(config) as path:
                call(["check", path, *settings(overrides)], False, quiet=True)
        except InvalidInput as error:
            problems += [line for line in str(error).splitlines() if not _N_PROBLEMS.search(line)]
        raise InvalidInput("\n".join(problems))
    return options


def _allowed(command: bool, files: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], urls: str | Sequence[str]) -> list[str]:
    files = [files] if isinstance(files, str | os.PathLike) else files
    urls = [urls] if isinstance(urls, str) else urls
    options = _flag("--allow-command", command)
    options += [word for file in files for word in ("--allow-file", os.fspath(file))]
    return options + [word for url in urls for word in ("--allow-url", url)]


def _reading(memory_budget: str | None, allow_file: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], unverified: bool) -> list[str]:
    options = [*_option("--memory-budget", memory_budget), *_flag("--unverified", unverified)]
    return options + _allowed(False, allow_file, ())


def _about(
    command: str, config: Config, data: Table, options: list[str], overrides: dict[str, Any], progress: bool | None
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
    return _number("--seed", seed, 0, MOST_SEED)


def _number(option: str, value: int | None, least: int, most: int) -> list[str]:
    return [] if value is None else _option(option, whole_number(option.removeprefix("--"), value, least, most))


def _url(side: str, url: str | None) -> list[str]:
    if not isinstance(url, str | None):
        raise InvalidInput(f"{side} must be the URL of a simulator, got {url!r}; keys are overridden one by one: {side}__KEY=VALUE")
    return _option(f"--{side}", url)


def _option(name: str, value: Any) -> list[str]:
    # One word, so that a value that begins with a dash is no option.
    return [] if value is None else [f"{name}={value}"]


def _flag(name: str, is_given: bool) -> list[str]:
    return [name] if is_given else []
