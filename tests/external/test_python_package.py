"""The Python package: its wheel is built, installed where there is no Rust, and its own tests are run against it."""

import json
import os
import subprocess
import sys
import time
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def call(*command, **settings):
    answer = subprocess.run([str(part) for part in command], capture_output=True, text=True, **settings)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    return answer.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A Python in a fresh environment with the wheel, and the variables of a shell without Rust."""
    folder = tmp_path_factory.mktemp("package")
    maturin = Path(sys.executable).parent / "maturin"
    call(maturin, "build", "--release", "--locked", "--out", folder / "built", cwd=ROOT / "python")
    call(sys.executable, ROOT / "docs" / "build.py", folder / "book")
    search = {**os.environ, "PATH": f"{maturin.parent}:{os.environ['PATH']}"}
    call(ROOT / "release" / "add-guide", *(folder / "built").glob("*.whl"), folder / "book", folder, env=search)
    (wheel,) = folder.glob("murmuration_sim-*.whl")
    venv.create(folder / "venv", with_pip=True)
    scripts = folder / "venv" / "bin"
    call(scripts / "pip", "install", "-q", "--disable-pip-version-check", f"{wheel}[polars,pandas,plot]", "ipython", "mypy", "pytest")
    return scripts, {"PATH": f"{scripts}:/usr/bin:/bin", "HOME": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}


def test_its_own_tests_pass_where_there_is_no_rust(installed, tmp_path):
    scripts, variables = installed
    said = call(scripts / "python", "-m", "pytest", "-q", "-p", "no:cacheprovider", ROOT / "python" / "tests", env=variables, cwd=tmp_path)
    assert " passed" in said and "skipped" not in said


def test_both_commands_are_the_program(installed, tmp_path):
    scripts, variables = installed
    # Each prints the name that it was called by.
    said = [call(scripts / name, "--version", env=variables, cwd=tmp_path).split() for name in ("murmuration", "orchestrator")]
    versions = {version for _, version in said}
    assert len(versions) == 1


def test_the_guide_comes_with_the_wheel(installed, tmp_path):
    scripts, variables = installed
    page = Path(call(scripts / "murmuration", "docs", "--print", env=variables, cwd=tmp_path).strip())
    assert page.is_relative_to(scripts.parent) and "Murmuration" in page.read_text()


def test_a_newcomer_has_the_first_figure_within_two_minutes(installed, tmp_path):
    """The first notebook, without Rust and without a checkout beside it."""
    scripts, variables = installed
    call(scripts / "pip", "install", "-q", "--disable-pip-version-check", "ipykernel", "nbclient")
    notebook = tmp_path / "first-run.ipynb"
    cells = json.loads((ROOT / "docs" / "notebooks" / "first-run.ipynb").read_text())
    for cell in cells["cells"]:
        if cell["cell_type"] == "code":
            cell["outputs"] = []
    notebook.write_text(json.dumps(cells))
    begun_s = time.monotonic()
    call(scripts / "jupyter", "execute", "--inplace", notebook, env=variables, cwd=tmp_path)
    took_s = time.monotonic() - begun_s
    assert "image/png" in notebook.read_text()
    assert took_s < 120, took_s


def test_a_newcomer_without_rust_installs_runs_and_sees_the_demo_within_five_minutes(installed, tmp_path):
    scripts, variables = installed
    (wheel,) = scripts.parents[1].glob("murmuration_sim-*.whl")
    begun_s = time.monotonic()
    venv.create(tmp_path / "own", with_pip=True)
    own = tmp_path / "own" / "bin"
    call(own / "pip", "install", "-q", "--disable-pip-version-check", wheel)
    variables = {**variables, "PATH": f"{own}:/usr/bin:/bin"}

    def murmuration(*words):
        return call(own / "murmuration", *words, env=variables, cwd=tmp_path)

    made = murmuration("new", "my-swarm")
    assert "murmuration run experiment.toml" in made
    murmuration("run", "my-swarm/experiment.toml")
    murmuration("demo")
    took_s = time.monotonic() - begun_s
    assert (tmp_path / "runs" / "my-swarm" / "report.html").stat().st_size > 0
    assert "wall-attenuation" in (tmp_path / "demo" / "story.html").read_text()
    assert took_s < 300, took_s


@pytest.mark.parametrize("protobuf", ["4.25.9", "5.29.6", "6.33.5"])
def test_its_stubs_import_under_older_versions_of_protobuf(installed, tmp_path, protobuf):
    _, variables = installed
    where = tmp_path / "older"
    call(sys.executable, "-m", "pip", "install", "-q", "--disable-pip-version-check", "--no-deps", "--target", where, f"protobuf=={protobuf}")
    text = f"import google.protobuf as p; assert p.__version__ == {protobuf!r}, p.__version__; import murmuration.robots, murmuration.network, murmuration.radio"
    call(installed[0] / "python", "-c", text, env={**variables, "PYTHONPATH": str(where)}, cwd=tmp_path)


def without_json_names(messages):
    """Stubs do not hold what follows from the names of fields."""
    for message in messages:
        for field in message.field:
            field.ClearField("json_name")
        without_json_names(message.nested_type)


def test_its_stubs_are_those_of_the_contract(tmp_path):
    """Every message, field and call of proto/ as the stubs in the package have them."""
    from google.protobuf import descriptor_pb2
    from grpc_tools import protoc

    folder = ROOT / "python" / "src" / "murmuration" / "_contract"
    for name in ("common", "robotsim", "netsim"):
        output = tmp_path / f"{name}.pb"
        file = f"cosim/v1/{name}.proto"
        assert protoc.main(["protoc", f"-I{ROOT / 'proto'}", f"--descriptor_set_out={output}", str(ROOT / "proto" / file)]) == 0
        (wanted,) = descriptor_pb2.FileDescriptorSet.FromString(output.read_bytes()).file
        without_json_names(wanted.message_type)
        text = f"import sys; from murmuration._contract import {name}_pb2 as p; sys.stdout.buffer.write(p.DESCRIPTOR.serialized_pb)"
        command = [sys.executable, "-c", text]
        variables = {**os.environ, "PYTHONPATH": str(folder.parents[1])}
        answer = subprocess.run(command, capture_output=True, env=variables, check=True)
        assert descriptor_pb2.FileDescriptorProto.FromString(answer.stdout) == wanted, f"run python/make_stubs.sh: {file} has changed"
