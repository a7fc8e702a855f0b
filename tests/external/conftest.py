"""What the tests share: the built programs, one recorded run, Python modules made from the contract."""

import atexit
import functools
import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILT = ROOT / (os.environ.get("CARGO_TARGET_DIR") or "target") / "release"
COPIES = "MURMURATION_TESTED_PROGRAMS"


def copies():
    """The folder with copies of the built programs. A test that builds something, such as the wheel, may move or replace the
    originals while others run. Workers of pytest inherit the folder of the process that started them."""
    if COPIES not in os.environ:
        folder = tempfile.mkdtemp(prefix="murmuration-programs-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        for path in BUILT.glob("*"):
            if path.is_file() and os.access(path, os.X_OK):
                shutil.copy2(path, folder)
        os.environ[COPIES] = folder
    return Path(os.environ[COPIES])


PROGRAMS = copies()

# Real measurements are not part of the repository: the tests that need them run where this variable names their folder.
REAL = "MURMURATION_DATA"
REAL_TESTS = "test_real_measurements.py"
REAL_MISSING = f"real measurements were not found: {REAL_TESTS} does not run. Set {REAL} to their folder (tests/external/README.md)"
HAS_REAL = bool(os.environ.get(REAL))
# So are those that somebody else made up.
STRANGE_TESTS = ["test_strange_measurements.py", "test_real_flight.py"]
HAS_STRANGE = bool(os.environ.get("MURMURATION_CASES"))
collect_ignore = ([] if HAS_REAL else [REAL_TESTS]) + ([] if HAS_STRANGE else STRANGE_TESTS)

# A run of a ready experiment takes seconds; a hang must not take the whole of CI with it.
RUN_DEADLINE_S = 120


def program(name):
    """The path of a built program. Tests of something that is not there fail here, with the command that builds it."""
    path = PROGRAMS / name
    assert path.exists(), f"{path} is missing: cargo build --release --workspace --bins"
    return str(path)


def succeed(command, deadline_s=RUN_DEADLINE_S, **options):
    """Runs a command to its end, demands exit status 0, returns what it printed."""
    done = subprocess.run(
        [str(word) for word in command],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=deadline_s,
        **options,
    )
    said = f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}"
    assert done.returncode == 0, f"exit status {done.returncode}: {said}"
    return done.stdout


def only_directory(parent):
    """The one directory that a run left below --out."""
    found = [path for path in parent.iterdir() if path.is_dir()]
    assert len(found) == 1, f"expected one result below {parent}, found {sorted(parent.iterdir())}"
    return found[0]


@pytest.fixture(scope="session")
def result_of(tmp_path_factory):
    """The directory that `run configs/NAME.toml --set ...` left. Each is run once."""

    @functools.cache
    def run(name, *settings):
        out = tmp_path_factory.mktemp(name)
        command = [program("murmuration"), "run", f"configs/{name}.toml", "--out", out]
        succeed([*command, *(word for setting in settings for word in ("--set", setting))], cwd=ROOT)
        return only_directory(out)

    return run


@pytest.fixture(scope="session")
def flocking(result_of):
    """The directory that the run of README.md left."""
    return result_of("flocking")


@pytest.fixture(scope="session")
def stubs(tmp_path_factory):
    """Puts modules made from the .proto files by grpcio-tools on the path, as a stranger would make them."""
    out = tmp_path_factory.mktemp("stubs")
    protos = sorted((ROOT / "proto").glob("cosim/v1/*.proto"))
    make = [sys.executable, "-m", "grpc_tools.protoc", f"-I{ROOT / 'proto'}"]
    succeed([*make, f"--python_out={out}", f"--grpc_python_out={out}", *protos])
    sys.path.insert(0, str(out))
    return out


@pytest.fixture(scope="session")
def captures(tmp_path_factory):
    """The captures of all audited networks, dissected, by name."""
    from audited_frames import read_capture
    from audited_networks import NETWORKS, capture_of

    folder = tmp_path_factory.mktemp("audit")
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        read = pool.map(lambda name: read_capture(NETWORKS[name], capture_of(name, folder)), NETWORKS)
        return dict(zip(NETWORKS, read, strict=True))


@pytest.fixture(scope="session")
def audited(request, captures):
    """One of them."""
    return captures[request.param]


def pytest_generate_tests(metafunc):
    """Tests of `audited` are asked for every audited network."""
    if "audited" in metafunc.fixturenames:
        from audited_networks import NETWORKS

        metafunc.parametrize("audited", NETWORKS, indirect=True, scope="session")


# The files that take longest, the longest first. They begin first, so that no worker of pytest waits for another at the end.
LONGEST = ("test_real_measurements", "test_python_package", "test_page", "test_scheduling_function", "test_audits", "test_documented")


def pytest_collection_modifyitems(items):
    order = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: order.get(item.path.stem, len(LONGEST)))


def pytest_configure(config):
    """CI without the real measurements fails before the first test, rather than pass without them."""
    if not HAS_REAL and os.environ.get("CI"):
        raise pytest.UsageError(f"{REAL_MISSING}. In CI this is an error.")


def pytest_report_header(config):
    """Says before the first test whether real measurements are there."""
    return f"{REAL}: {os.environ[REAL]}" if HAS_REAL else f"WARNING: {REAL_MISSING}"


def pytest_terminal_summary(terminalreporter):
    """The last lines of the suite: which tests passed and which did not. A skipped test has not passed."""
    outcomes = terminalreporter.stats
    failed = sum(len(outcomes.get(kind, [])) for kind in ("failed", "error", "skipped", "xfailed"))
    if not HAS_REAL:
        terminalreporter.write_sep("!", "real measurements NOT RUN", red=True)
        terminalreporter.write_line(REAL_MISSING, red=True)
    terminalreporter.write_line(f"external: {len(outcomes.get('passed', []))} passed, {failed} failed")


def pytest_sessionfinish(session, exitstatus):
    """A suite that skipped something is not a suite that passed."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    # Processes that run a part of the suite have no reporter: the one that gathers what they say has.
    if reporter is not None and exitstatus == 0 and any(reporter.stats.get(kind) for kind in ("skipped", "xfailed")):
        session.exitstatus = 1
