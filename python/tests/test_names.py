"""What users see of the package: its names, their documentation and types, and its refusals."""

import ast
import dataclasses
import importlib
import importlib.metadata
import inspect
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import murmuration
from murmuration._wording import with_keywords

MODULES = ("murmuration", "murmuration.env", "murmuration.export", "murmuration.importers", "murmuration.network", "murmuration.radio", "murmuration.robots")

CONFIG = {
    "experiment": {"name": "small", "seed": 1, "duration_s": 2.0, "agents": 5, "control_period": {"rate_hz": 10.0}},
    "robotsim": {"scenario": {"kind": "line"}, "controller": {"kind": "flocking", "flock_radius_m": 10.0}},
    "netsim": {"phy": {"propagation": "unit-disk", "radius_m": 20.0}},
}


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def public(module):
    """The public classes and functions of a module, and the public members of its classes, by name."""
    found = {}
    for name in dir(importlib.import_module(module)):
        value = getattr(importlib.import_module(module), name)
        if inspect.isclass(value) and value.__module__.startswith("murmuration"):
            found[f"{module}.{name}"] = value
            for member, part in vars(value).items():
                if not member.startswith("_") and (callable(part) or isinstance(part, property) or hasattr(part, "func")):
                    found[f"{module}.{name}.{member}"] = part
        elif inspect.isfunction(value):
            found[f"{module}.{name}"] = value
    return found


PUBLIC = {name: value for module in MODULES for name, value in public(module).items()}


def test_names_are_the_public_ones_and_exist():
    for module in map(importlib.import_module, MODULES):
        assert dir(module) == sorted(module.__all__)
        assert all(hasattr(module, name) for name in module.__all__)
    assert {"Radio", "env", "robots", "run"} < set(dir(murmuration)) and not {"annotations", "os", "re", "json"} & set(dir(murmuration))
    with pytest.raises(AttributeError, match="has no attribute 'Radios'"):
        murmuration.Radios  # noqa: B018
    assert len(PUBLIC) > 60


def test_the_version_is_that_of_the_program():
    said = subprocess.run([murmuration.program(), "--version"], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["murmuration", murmuration.__version__]


def test_all_but_tables_plots_and_rerun_comes_with_the_package():
    """Extras of earlier versions remain, so that commands with their names work. rerun-sdk has 90 MB."""
    metadata = importlib.metadata.metadata("murmuration-sim")
    assert set(metadata.get_all("Provides-Extra")) == {"polars", "pandas", "plot", "rerun", "rosbags", "ulog", "env"}
    optional = {re.match(r"[\w-]+", line)[0] for line in metadata.get_all("Requires-Dist") if "extra ==" in line}
    assert optional == {"polars", "pandas", "pyarrow", "matplotlib", "rerun-sdk", "mcap"}


def test_ipython_completes_the_public_names_alone():
    from IPython.core.completer import provisionalcompleter
    from IPython.core.interactiveshell import InteractiveShell

    shell = InteractiveShell.instance()
    shell.run_cell("import murmuration, murmuration.robots")
    for uses_jedi in (True, False):
        shell.Completer.use_jedi = uses_jedi
        for text, module in (("murmuration.", murmuration), ("murmuration.robots.", murmuration.robots)):
            with provisionalcompleter():
                names = {one.text.removeprefix(".") for one in shell.Completer.completions(text, len(text))}
            public = {name for name in dir(module) if not name.startswith("_")}
            assert {name for name in names if not name.startswith("_")} == public


def sections(documentation):
    """The sections of a numpydoc text: for each the text below its heading."""
    parts = re.split(r"^(\w+)\n-{3,}\n", inspect.cleandoc(documentation), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2]))


def entries(section):
    """The entries of a section, `name : type` with a text below, by name."""
    found = {}
    for heading, text in re.findall(r"^(\S.*)\n((?:[ \n].*\n?)*)", section, flags=re.MULTILINE):
        names, _, kind = heading.partition(" : ")
        found |= {name: (kind, text.strip()) for name in names.split(", ")}
    return found


def parameters(value):
    """The parameters that users give, as numpydoc names them."""
    if inspect.isclass(value) and issubclass(value, Exception) and "__init__" not in vars(value):
        return {}
    stars = {inspect.Parameter.VAR_KEYWORD: "**", inspect.Parameter.VAR_POSITIONAL: "*"}
    found = inspect.signature(value).parameters.values()
    return {stars.get(one.kind, "") + one.name for one in found if one.name != "self"}


# Classes that users get, and do not make: their documentation lists attributes.
NOT_MADE = {name for name, value in PUBLIC.items() if inspect.isclass(value) and (dataclasses.is_dataclass(value) or name.endswith(".SwarmEnv"))}
UNITS = {"m": "(m", "s": "(s", "hz": "(Hz", "n": "(N", "rad": "(rad", "mps": "(m/s", "dbm": "(dBm", "ns": "(ns"}


@pytest.mark.parametrize("name", PUBLIC)
def test_every_parameter_is_documented(name):
    value = PUBLIC[name]
    text = value.__doc__
    assert text and text.splitlines()[0].endswith("."), f"{name} has no summary"
    found = sections(text)
    if not callable(value):
        assert "Returns" in found
        return
    given, attributes = (entries(found.get(section, "")) for section in ("Parameters", "Attributes"))
    if name in NOT_MADE:
        assert not given and attributes
    else:
        assert set(given) == set(parameters(value))
    if dataclasses.is_dataclass(value):
        assert set(attributes) == {field.name for field in dataclasses.fields(value)}
    for parameter, (kind, meaning) in (given | attributes).items():
        assert (kind or parameter.startswith("*")) and meaning.endswith("."), parameter
        unit = re.search(rf"_({'|'.join(UNITS)})$", parameter)
        assert unit is None or UNITS[unit[1]] in meaning, f"{parameter} has no unit"
    if not inspect.isclass(value) and inspect.signature(value).return_annotation not in ("None", inspect.Signature.empty):
        assert "Returns" in found


def test_tables_are_typed_as_data_frames():
    text = """
    import murmuration
    from murmuration.robots import Robots

    run = murmuration.run("a.toml", seed=3)
    reveal_type(run)
    reveal_type(run.steps)
    reveal_type(run.scan("steps"))
    reveal_type(murmuration.sweep("a.toml").trials)
    reveal_type(murmuration.importers.read_bag("drive"))
    reveal_type(murmuration.__version__)
    reveal_type(murmuration.Radio(n=3, seed=1, period_s=0.1).step(0.1, [[0.0, 0.0]]).count())  # type: ignore[arg-type]
    sweep = murmuration.Sweep("runs/a")
    reveal_type(sweep.plot("agents", "pdr"))
    reveal_type(sweep.plot("agents", ["pdr", "latency"]))
    sweep.plot("agents", ["pdr", "latency"])[0].set_title("delivery")
    murmuration.save_figure(run.plot("delivery", width="column"), "delivery.pdf")
    murmuration.save_figure(sweep.plot("agents", ["pdr"]), murmuration.caption(run.plot_links()))

    def steps(config: murmuration.Config) -> murmuration.DataFrame:
        return murmuration.run(config).steps

    murmuration.run("a.toml", seed="three")
    """
    Path("user.py").write_text(textwrap.dedent(text))
    said = subprocess.run([sys.executable, "-m", "mypy", "--strict", "user.py"], capture_output=True, text=True).stdout
    revealed = re.findall(r'Revealed type is "(.*)"', said)
    frame = "polars.dataframe.frame.DataFrame | "
    assert revealed[0].endswith("Run") and all(kind.startswith(frame) for kind in (revealed[1], revealed[3], revealed[4])), said
    assert "LazyFrame" in revealed[2] and "str" in revealed[5] and "ndarray" in revealed[6]
    assert revealed[7].endswith("Axes") and "ndarray" in revealed[8], said
    errors = [line for line in said.splitlines() if ": error:" in line]
    assert len(errors) == 1 and 'Argument "seed" to "run" has incompatible type "str"' in errors[0], said


REFUSED = [
    ({"seed": "three"}, "seed must be an int from 0 to 9223372036854775807, got 'three'"),
    ({"seed": True}, "seed must be an int from 0 to 9223372036854775807, got True"),
    ({"threads": 0}, "threads must be an int from 1 to 65535, got 0"),
    ({"duration_s": 3}, "there is no key duration_s; the nearest is experiment__duration_s=3"),
    ({"experiment__duraton_s": 3}, "there is no key experiment__duraton_s; the nearest is experiment__duration_s=3"),
    ({"foo__duration_s": 3}, "there is no key foo__duration_s; the nearest is experiment__duration_s=3"),
    ({"progressx": True}, "there is no key progressx; the nearest is progress=True"),
    ({"sed": 3}, "there is no key sed; the nearest is seed=3"),
    ({"radius_m": 3.0}, "there is no key radius_m; the nearest are netsim__phy__radius_m, robotsim__controller__radius_m, "),
    ({"xyzzy": 1}, "there is no key xyzzy; the sections are experiment, site, robotsim, netsim"),
    ({"netsim": {"phy": {}}}, "netsim must be the URL of a simulator, got {'phy': {}}; keys are overridden one by one: netsim__KEY=VALUE"),
    ({"experiment__duration_s": -3}, "experiment__duration_s must be greater than 0 and at most 1000000000, got -3 (nearest valid: 3)"),
    ({"netsim__phy": {"propagation": "unit-disk", "radius_m": -1}}, "netsim__phy__radius_m must be "),
]


@pytest.mark.parametrize("arguments, text", REFUSED)
def test_refusals_speak_of_keyword_arguments(arguments, text):
    with pytest.raises(murmuration.InvalidInput) as error:
        murmuration.run(CONFIG, **arguments)
    assert str(error.value).startswith(text) and "command line" not in str(error.value) and "--" not in str(error.value)


def test_all_problems_of_arguments_and_keys_are_named_at_once():
    with pytest.raises(murmuration.InvalidInput) as error:
        murmuration.run(CONFIG, seed="three", threads=0, duration_s=3, foo=2)
    assert [line.split(",")[0].split(";")[0] for line in str(error.value).splitlines()] == [
        "seed must be an int from 0 to 9223372036854775807",
        "threads must be an int from 1 to 65535",
        "there is no key duration_s",
        "there is no key foo",
    ]
    with pytest.raises(murmuration.InvalidInput, match="foo must not be None; leave it out"):
        murmuration.run(CONFIG, foo=None)


def test_problems_of_dictionaries_and_data_frames_name_no_temporary_file():
    import polars

    started = {**CONFIG, "robotsim": {"command": ["python", "x.py"]}}
    for call in (lambda: murmuration.run(started), lambda: murmuration.compare(CONFIG, polars.DataFrame({"a": [1]}))):
        with pytest.raises(murmuration.InvalidInput) as error:
            call()
        said = str(error.value)
        assert re.match(r"the (configuration|data frame): ", said) and not re.search(r"murmuration-|/data\.csv|^ +\d+ \|", said, flags=re.MULTILINE), said


def test_numbers_of_numpy_are_numbers():
    import numpy

    assert murmuration.run(CONFIG, seed=numpy.int64(4)).summary["seed"] == 4


@pytest.mark.parametrize(
    "text, expected",
    [
        (
            "error: invalid value '-1' for '--budget <S>': must be a number of seconds greater than 0\n\nFor more information, try '--help'.\n",
            "budget_s must be a number of seconds greater than 0, got -1",
        ),
        (
            "error: the argument '--effect <NAME>' cannot be used with '--all'\n\nUsage: murmuration extend --data <FILE>\n\n"
            "For more information, try '--help'.\n",
            "the argument effect cannot be used with all",
        ),
        ("give --replace, or with --allow-file 'a b'", "give replace=True, or with allow_file='a b'"),
        ("--out runs: too small; allow more with --memory-budget", "out='runs': too small; allow more with memory_budget"),
        ("needs --allow-url http://127.0.0.1:1.", "needs allow_url='http://127.0.0.1:1'."),
        ("x is varied, so --set cannot set it", "x is varied, so a keyword argument cannot set it"),
        ("nothing varies; use murmuration run for one run", "nothing varies; use murmuration.run for one run"),
        ("go on with murmuration run --resume runs/a", "go on with murmuration run --resume runs/a"),
        # The words of a user's own simulator stay.
        ("RuntimeError: Usage: mine\n\nUsage: mine", "RuntimeError: Usage: mine\n\nUsage: mine"),
    ],
)
def test_texts_of_the_program_name_arguments(text, expected):
    assert with_keywords(text) == expected


def test_the_interpreter_shows_one_short_traceback():
    for call in ('run({"experiment": {}}, seed="three")', 'run({"experiment": {}})', 'importers.read_bag("none")', 'importers.bag_topics("none")'):
        script = f"import murmuration\nmurmuration.{call}\n"
        said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True).stderr
        assert said.count("Traceback") == 1 and said.count("File ") == 2, said
        assert re.search(r"^murmuration\.InvalidInput: ", said, flags=re.MULTILINE), said


def test_a_notebook_shows_one_short_traceback(capsys):
    from IPython.core.interactiveshell import InteractiveShell

    shell = InteractiveShell.instance()
    result = shell.run_cell("import murmuration\nmurmuration.run({'experiment': {}}, seed='three')")
    said = re.sub(r"\x1b\[[\d;]*m", "", capsys.readouterr().out)
    assert isinstance(result.error_in_exec, murmuration.InvalidInput)
    assert said.count("Traceback") == 1 and "During handling" not in said and said.count("File ") + said.count("Cell In") == 2, said


def test_only_arguments_that_exist_are_in_examples():
    """Examples are valid Python, and name public names."""
    for name, value in PUBLIC.items():
        for example in re.findall(r"^\s*(?:>>>|\.\.\.) (.*)$", value.__doc__ or "", flags=re.MULTILINE):
            ast.parse(example + " pass" if example.endswith(":") else example.strip())
            for used in re.findall(r"\bmurmuration\.(\w+)", example):
                assert used in dir(murmuration), name
