"""The .proto files, by programs that know protobuf and not us."""

import importlib

from conftest import ROOT, succeed


def test_the_contract_keeps_the_standard_rules_of_buf():
    succeed(["buf", "lint"], cwd=ROOT / "proto")


def test_the_linter_would_have_found_a_breach(tmp_path):
    # Guards the test above: a linter that reads no files, or no rules, is content with everything.
    contract = tmp_path / "cosim" / "v1"
    contract.mkdir(parents=True)
    (tmp_path / "buf.yaml").write_text((ROOT / "proto" / "buf.yaml").read_text())
    (contract / "common.proto").write_text(
        'syntax = "proto3";\npackage cosim.v1;\n// A message.\nmessage wrongName {}\n'
    )
    try:
        succeed(["buf", "lint"], cwd=tmp_path)
    except AssertionError as error:
        assert "wrongName" in str(error)
    else:
        raise AssertionError("buf lint accepted a message called wrongName")


def test_the_contract_compiles_for_python_and_names_both_services(stubs):
    for side, service, more in (("netsim", "NetSimService", []), ("robotsim", "RobotSimService", ["Predict"])):
        module = importlib.import_module(f"cosim.v1.{side}_pb2")
        calls = [m.name for m in module.DESCRIPTOR.services_by_name[service].methods]
        assert calls == [
            "Describe", "Configure", "Step", "Barrier", "Session", "Snapshot", "Restore", "Command", *more,
        ]
        importlib.import_module(f"cosim.v1.{side}_pb2_grpc")


def test_the_worked_example_of_the_digest_is_right(stubs):
    from recording import digest

    common = importlib.import_module("cosim.v1.common_pb2")
    states = common.AgentStates(alive=b"\x03", x_m=[0, 1.5], y_m=[0, -2], z_m=[0, 0])
    example = digest(1, 100_000_000, states, None).hex()
    text = (ROOT / "proto/cosim/v1/common.proto").read_text()
    assert example in text, f"common.proto gives another digest for its example than {example}"
