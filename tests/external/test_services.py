"""Each simulator alone, called by Python's gRPC: health, reflection and what the contract promises about steps."""

import functools
import importlib
import math
import struct

import grpc
import pytest
from conftest import program
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase
from hosts import Server
from recording import digest

SERVICES = {"netsim": "cosim.v1.NetSimService", "robotsim": "cosim.v1.RobotSimService"}
CONFIG = {
    # `full` hears everything: the one model whose answer needs no table.
    "netsim": '[phy]\npropagation = "full"\n',
    "robotsim": '[scenario]\nkind = "line"\n[controller]\nkind = "flocking"\nflock_radius_m = 10.0\n',
}
CALL_DEADLINE_S = 60
PERIOD_NS = 100_000_000


@pytest.fixture(params=SERVICES)
def side(request):
    return request.param


@pytest.fixture
def channel(side, tmp_path):
    with Server([program(side), "--listen", "127.0.0.1:0"], tmp_path / "log") as server:
        with grpc.insecure_channel(server.address) as channel:
            yield channel


@pytest.fixture
def client(side, channel, stubs):
    return Client(side, channel)


class Client:
    """The calls of one side, named as in the contract, with requests given as keyword arguments."""

    def __init__(self, side, channel):
        self.common = importlib.import_module("cosim.v1.common_pb2")
        self.messages = importlib.import_module(f"cosim.v1.{side}_pb2")
        self.service = SERVICES[side].rsplit(".", 1)[1]
        calls = importlib.import_module(f"cosim.v1.{side}_pb2_grpc")
        self.stub = getattr(calls, f"{self.service}Stub")(channel)
        self.side = side

    def call(self, name, **fields):
        request = getattr(self.messages, f"{self.service}{name}Request")(**fields)
        return getattr(self.stub, name)(request, timeout=CALL_DEADLINE_S)

    def configure(self, **changes):
        """Two agents and the shortest configuration that there is."""
        fields = {"seed": 7, "agent_count": 2, "step_ns": PERIOD_NS, "config_toml": CONFIG[self.side]}
        return self.call("Configure", **{**fields, **changes})

    def states(self, **changes):
        columns = {"alive": b"\x03", "x_m": [0, 1], "y_m": [0, 0], "z_m": [0, 0], **changes}
        return self.common.AgentStates(**columns)

    def step(self, number, **changes):
        fields = {"step": number, "until_ns": number * PERIOD_NS}
        if self.side == "netsim":
            fields["states"] = self.states()
            fields["payloads"] = self.common.Payloads(length_bytes=[2, 3], data=b"ababc")
        return self.call("Step", **{**fields, **changes})


def test_health_is_reported_by_the_standard_service(side, channel):
    health = health_pb2_grpc.HealthStub(channel)
    for service in ("", SERVICES[side]):
        request = health_pb2.HealthCheckRequest(service=service)
        assert health.Check(request, timeout=CALL_DEADLINE_S).status == health_pb2.HealthCheckResponse.SERVING


def test_reflection_tells_what_is_served_and_how(side, channel):
    database = ProtoReflectionDescriptorDatabase(channel)
    assert {SERVICES[side], "grpc.health.v1.Health"} <= set(database.get_services())
    file = database.FindFileContainingSymbol(SERVICES[side])
    assert file.name == f"cosim/v1/{side}.proto"


def test_a_description_says_who_it_is_and_what_it_takes(client):
    told = client.call("Describe")
    assert told.name and told.version and told.contract_version == 1
    assert told.limits.max_message_bytes >= 4 << 20 and told.session


def test_steps_reach_their_time_and_barriers_confirm_them(client):
    client.configure()
    for number in (1, 2, 3):
        reply = client.step(number)
        assert (reply.step, reply.time_ns) == (number, number * PERIOD_NS)
        barrier = client.call("Barrier", step=number, time_ns=number * PERIOD_NS)
        assert (barrier.step, barrier.time_ns) == (number, number * PERIOD_NS)
        if number == 1:
            states = client.states() if client.side == "netsim" else reply.states
            assert barrier.digest == digest(1, PERIOD_NS, states, None)


def test_a_repeated_step_gets_the_same_reply_and_changes_nothing(client):
    client.configure()
    client.step(1)
    once, again = client.step(2), client.step(2)
    assert once == again
    client.step(3)
    refuses(grpc.StatusCode.FAILED_PRECONDITION, "step", lambda: client.step(2))


def test_the_same_seed_gives_the_same_replies_and_configuring_again_starts_afresh(client):
    def replies():
        client.configure()
        return [client.step(number) for number in (1, 2, 3)]

    assert replies() == replies()


def test_what_is_out_of_order_is_refused_and_changes_nothing(client):
    refuses(grpc.StatusCode.FAILED_PRECONDITION, "configure", lambda: client.step(1))
    client.configure()
    first = client.step(1)
    for number, until_ns in ((3, 3 * PERIOD_NS), (0, PERIOD_NS), (2, PERIOD_NS), (2, 1), (2**64 - 1, 2**63)):
        step = functools.partial(client.step, number, until_ns=until_ns)
        refuses(grpc.StatusCode.FAILED_PRECONDITION, "", step)
    assert client.step(1) == first
    assert client.step(2).step == 2


@pytest.mark.parametrize(
    ("field", "value"), [("agent_count", 0), ("step_ns", 0), ("coupling", 99), ("agent_count", 2**32 - 1)]
)
def test_an_impossible_experiment_is_refused_by_the_name_of_its_field(client, field, value):
    code = grpc.StatusCode.RESOURCE_EXHAUSTED if value == 2**32 - 1 else grpc.StatusCode.INVALID_ARGUMENT
    refuses(code, field, lambda: client.configure(**{field: value}))


def test_a_configuration_that_makes_no_sense_is_refused_with_every_problem(client):
    toml = 'no_such_key = 1\n[no_such_table]\nkey = "x"\n'
    refuses(grpc.StatusCode.INVALID_ARGUMENT, "no_such_key", lambda: client.configure(config_toml=toml))
    refuses(grpc.StatusCode.INVALID_ARGUMENT, "no_such_table", lambda: client.configure(config_toml=toml))


@pytest.mark.parametrize("side", ["netsim"], indirect=True)
@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"x_m": [0, math.nan]}, "x_m"),
        ({"y_m": [0, math.inf]}, "y_m"),
        ({"z_m": [0]}, "z_m"),
        ({"x_m": [0, 1, 2]}, "x_m"),
        ({"alive": b""}, "alive"),
        ({"alive": b"\xff"}, "alive"),
        ({"vx_mps": [0]}, "vx_mps"),
    ],
)
def test_impossible_states_are_refused_by_the_name_of_their_column(client, changes, field):
    client.configure()
    wrong = client.states(**changes)
    refuses(grpc.StatusCode.INVALID_ARGUMENT, field, lambda: client.step(1, states=wrong))
    assert client.step(1).step == 1, "the simulation stands where it stood"


@pytest.mark.parametrize("side", ["robotsim"], indirect=True)
def test_impossible_deliveries_are_refused(client):
    client.configure()
    client.step(1)
    sent = client.common.Transmissions(
        sender=[0], sent_ns=[1], end_ns=[2], payloads=client.common.Payloads(length_bytes=[1], data=b"x")
    )
    # The index points beyond the one transmission there was.
    wrong = client.common.Deliveries(transmissions=sent, heard_end=[0, 1], heard=[1])
    refuses(grpc.StatusCode.INVALID_ARGUMENT, "heard", lambda: client.step(2, deliveries=wrong))
    assert client.step(2).step == 2


@pytest.mark.parametrize("side", ["netsim"], indirect=True)
def test_two_motes_a_metre_apart_hear_each_others_payload(client):
    client.configure()
    deliveries = client.step(1).deliveries
    assert list(deliveries.transmissions.sender) == [0, 1]
    assert deliveries.transmissions.payloads.data == b"ababc"
    if deliveries.heard_bitmap:
        assert deliveries.heard_bitmap == struct.pack("BB", 0b10, 0b01)
    else:
        assert (list(deliveries.heard_end), list(deliveries.heard)) == ([1, 2], [1, 0])


def refuses(code, word, call):
    """The call fails with this status, and its message has the word."""
    with pytest.raises(grpc.RpcError) as caught:
        call()
    assert caught.value.code() == code, caught.value.details()
    assert word in caught.value.details().lower(), caught.value.details()
