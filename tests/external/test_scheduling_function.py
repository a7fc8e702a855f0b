"""netsim/examples/scheduling-function, a crate as a user writes one, adds a scheduling function to the network simulator."""

import json
import shutil

import pytest
from conftest import ROOT, only_directory, program, succeed
from hosts import Server
from recording import by_topic

EXAMPLE = ROOT / "netsim/examples/scheduling-function"


@pytest.fixture(scope="module")
def crate(tmp_path_factory):
    """A copy of the example elsewhere, as a user has it. Its program is the one that the workspace has built."""
    folder = tmp_path_factory.mktemp("elsewhere") / "my-netsim"
    shutil.copytree(EXAMPLE, folder)
    manifest = folder / "Cargo.toml"
    text = manifest.read_text()
    for path in ("../../../proto/core", "../../../proto/host", "../.."):
        assert f'path = "{path}"' in text
        text = text.replace(f'path = "{path}"', f'path = "{(EXAMPLE / path).resolve()}"')
    manifest.write_text(text)
    return folder


def test_elsewhere_its_manifest_holds(crate):
    shutil.copy(ROOT / "Cargo.lock", crate)
    packages = json.loads(succeed(["cargo", "metadata", "--offline", "--format-version", "1"], cwd=crate))["packages"]
    assert {"my-netsim", "netsim", "proto", "proto-host"} <= {package["name"] for package in packages}


def run(crate, out, *words, command=True):
    given = ["--set", f'netsim.command=["{program("my-netsim")}"]'] if command else []
    return [program("murmuration"), "run", crate / "experiment.toml", *given, "--out", out, *words]


@pytest.fixture(scope="module")
def recorded(crate, tmp_path_factory):
    """A run of the example's experiment, which starts the program of the crate."""
    out = tmp_path_factory.mktemp("command")
    succeed(run(crate, out, "--allow-command"))
    return only_directory(out)


def test_check_accepts_the_kind_because_another_program_judges_it(crate):
    succeed([program("murmuration"), "check", crate / "experiment.toml"])


def test_the_network_forms_under_the_function_of_the_crate_and_delivers(recorded):
    summary = json.loads((recorded / "summary.json").read_text())
    assert summary["kpis"]["formation"]["formed"], summary["kpis"]["formation"]
    delivery = summary["kpis"]["delivery"]
    assert delivery["delivered"] > 100, delivery
    assert delivery["ratio"] > 0.95, delivery


def test_the_program_by_its_address_gives_the_same_recording(crate, recorded, tmp_path):
    with Server([program("my-netsim")], tmp_path / "log", cwd="/") as server:
        succeed(run(crate, tmp_path / "url", "--netsim", f"http://{server.address}", command=False))
    again = by_topic(only_directory(tmp_path / "url") / "run.mcap")
    first = by_topic(recorded / "run.mcap")
    for topic in ("/netsim/step", "/barrier"):
        assert [entry.data for entry in again[topic]] == [entry.data for entry in first[topic]], topic


def test_another_length_gives_another_network(crate, recorded, tmp_path):
    succeed(run(crate, tmp_path / "out", "--allow-command", "--set", "netsim.sf.slotframe_slots=101"))
    other = by_topic(only_directory(tmp_path / "out") / "run.mcap")
    first = by_topic(recorded / "run.mcap")
    assert [entry.data for entry in other["/netsim/step"]] != [entry.data for entry in first["/netsim/step"]]


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("netsim.sf.slotframe_slots=5000", "netsim.sf.slotframe_slots: must be a whole number from 2 to 1000, got 5000 (nearest valid: 1000)"),
        ("netsim.sf.slotframe_slots=31", "netsim.sf.slotframe_slots: must differ from minimal_slots"),
        ("netsim.sf.shared_slots=3", "netsim.sf.shared_slots: does not apply with kind = \"wandering-receiver\""),
    ],
)
def test_keys_of_the_function_are_checked_by_its_own_description(crate, tmp_path, setting, said):
    command = run(crate, tmp_path / "out", "--allow-command", "--set", setting)
    with pytest.raises(AssertionError, match="exit status") as refused:
        succeed(command)
    assert said in str(refused.value)


def test_the_built_in_network_refuses_the_kind(crate, tmp_path):
    text = (crate / "experiment.toml").read_text().replace('command = ["target/release/my-netsim"]\n', "")
    (tmp_path / "experiment.toml").write_text(text)
    with pytest.raises(AssertionError, match="exit status") as refused:
        succeed([program("murmuration"), "check", tmp_path / "experiment.toml"])
    assert 'netsim.sf.kind' in str(refused.value) and '"wandering-receiver"' in str(refused.value)
