"""What both kinds of simulator share: the calls of the contract, the form of requests, digests, and the server."""

from __future__ import annotations

import hashlib
import os
import struct
import sys
import tomllib
import traceback
from collections.abc import Iterator
from concurrent import futures
from typing import Any

import grpc
import numpy as np

from murmuration._contract import common_pb2

# The longest text of an error: details travel in HTTP/2 headers, which many clients limit to 16 KiB.
LONGEST_ERROR = 8_000
# More receivers times transmissions than this are no deliveries of a swarm (bytes of a matrix of one byte each).
MOST_PAIRS = 1 << 30


class Refused(Exception):
    """A request that is not taken, with the status that says why."""

    def __init__(self, status: grpc.StatusCode, text: str) -> None:
        super().__init__(text)
        self.status = status


def invalid(text: str) -> Refused:
    return Refused(grpc.StatusCode.INVALID_ARGUMENT, text)


def not_now(text: str) -> Refused:
    return Refused(grpc.StatusCode.FAILED_PRECONDITION, text)


class Service:
    """What both kinds of simulator do as the contract has it: begin an experiment, keep the order of steps, say where they stand.

    Subclasses serve one class of users: they set the two types of response, and override `start` and `advance`.
    """

    BARRIER_RESPONSE: Any
    SESSION_RESPONSE: Any

    def __init__(self, simulator: Any) -> None:
        self.simulator = simulator
        self.n = 0
        self.step: int | None = None
        self.time_ns = 0
        self._asked: Any = None
        self._reply: Any = None
        self._digest = b""

    def start(self, request: Any) -> Any:
        """Begins an experiment with `n` agents; returns the reply to Configure."""
        raise NotImplementedError

    def advance(self, request: Any, dt_s: float) -> tuple[Any, bytes]:
        """The reply to a step that may follow, and the bytes of which the digest is made."""
        raise NotImplementedError

    def identity(self) -> dict[str, Any]:
        """What every answer to Describe says."""
        simulator = self.simulator
        name = simulator.name or type(simulator).__name__
        return {"name": name, "version": simulator.version, "contract_version": 1, "session": True}

    def Configure(self, request: Any, context: Any) -> Any:
        return answered(context, self._configure, request)

    def Step(self, request: Any, context: Any) -> Any:
        return answered(context, self._step, request)

    def Barrier(self, request: Any, context: Any) -> Any:
        return answered(context, self._barrier, request)

    def Session(self, requests: Iterator[Any], context: Any) -> Iterator[Any]:
        for request in requests:
            which = request.WhichOneof("request")
            if which == "step":
                yield self.SESSION_RESPONSE(step=self.Step(request.step, context))
            elif which == "barrier":
                yield self.SESSION_RESPONSE(barrier=self.Barrier(request.barrier, context))
            else:
                context.abort(grpc.StatusCode.INVALID_ARGUMENT, "request: neither step nor barrier is set")

    def _configure(self, request: Any) -> Any:
        if request.agent_count < 1:
            raise invalid("agent_count: must be at least 1, got 0")
        if request.coupling not in (common_pb2.COUPLING_UNSPECIFIED, common_pb2.COUPLING_SEQUENTIAL):
            raise invalid('coupling: only sequential is served; set experiment.coupling = "sequential"')
        try:
            config, site = tomllib.loads(request.config_toml), tomllib.loads(request.site_toml)
        except tomllib.TOMLDecodeError as error:
            raise invalid(f"config_toml: {error}") from None
        # Not configured until `start` has succeeded.
        self.step, self.n = None, request.agent_count
        self.simulator.config, self.simulator.site, self.simulator.time_s = config, site, 0.0
        reply = self.start(request)
        self.step, self.time_ns, self._asked, self._reply, self._digest = 0, 0, None, None, b""
        return reply

    def _step(self, request: Any) -> Any:
        """A step: the next one, or the latest again."""
        if self.step is None:
            raise not_now("step: Configure comes first")
        if self._reply is not None and request.step == self.step:
            if request != self._asked:
                raise not_now(f"step {request.step} was taken with other content")
            return self._reply
        if request.step != self.step + 1:
            raise not_now(f"step {request.step} cannot follow step {self.step}")
        if request.until_ns <= self.time_ns:
            raise not_now(f"until_ns {request.until_ns} must be later than {self.time_ns}")
        if request.confirmed_digest and request.confirmed_digest != self._digest:
            raise not_now(f"confirmed_digest is not the digest of step {self.step}")
        reply, covered = self.advance(request, (request.until_ns - self.time_ns) / 1e9)
        self.step, self.time_ns = request.step, request.until_ns
        self.simulator.time_s = self.time_ns / 1e9
        self._digest = hashlib.sha256(covered).digest()
        reply.step, reply.time_ns, reply.digest = self.step, self.time_ns, self._digest
        self._asked, self._reply = request, reply
        return reply

    def _barrier(self, request: Any) -> Any:
        if self._reply is None:
            raise not_now("step: none was taken yet")
        return self.BARRIER_RESPONSE(step=self.step, time_ns=self.time_ns, digest=self._digest)


def answered(context: grpc.ServicerContext, work: Any, request: Any) -> Any:
    """Calls `work`; what goes wrong becomes a status with a text, and a fault of user code shows its traceback."""
    try:
        return work(request)
    except Refused as refused:
        context.abort(refused.status, str(refused)[:LONGEST_ERROR])
    except Exception:
        text = traceback.format_exc()
        print(text, file=sys.stderr, flush=True)
        context.abort(grpc.StatusCode.INTERNAL, text[-LONGEST_ERROR:])


class Columns:
    """The columns of deliveries as arrays, each made once."""

    def __init__(self, deliveries: Any) -> None:
        air = deliveries.transmissions
        self.sender = np.array(air.sender, dtype="<u4")
        self.sent_ns = np.array(air.sent_ns, dtype="<u8")
        self.end_ns = np.array(air.end_ns, dtype="<u8")
        self.length_bytes = np.array(air.payloads.length_bytes, dtype="<u4")
        self.data = air.payloads.data
        self.heard_end = np.array(deliveries.heard_end, dtype="<u4")
        self.heard = np.array(deliveries.heard, dtype="<u4")
        self.heard_bitmap = deliveries.heard_bitmap
        n_sent = len(self.sender)
        if not n_sent == len(self.sent_ns) == len(self.end_ns) == len(self.length_bytes):
            raise invalid("transmissions: all columns must have the same length")
        if self.length_bytes.sum(dtype=np.int64) != len(self.data):
            raise invalid(f"transmissions.payloads: must have as many bytes as length_bytes says, got {len(self.data)}")

    def pairs(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Receivers and transmissions of all deliveries to `n` agents, in the order of the contract: by receiver, then transmission."""
        n_sent, bits = len(self.sender), self.heard_bitmap
        ends, heard = self.heard_end.astype(np.int64), self.heard.astype(np.int64)
        if bits:
            width = (n_sent + 7) // 8
            if len(bits) != n * width or len(heard) or len(ends):
                raise invalid(f"heard_bitmap: must be alone and have {n} rows of {width} bytes, got {len(bits)} bytes")
            if n * n_sent > MOST_PAIRS:
                raise Refused(grpc.StatusCode.RESOURCE_EXHAUSTED, f"heard_bitmap: {n} receivers of {n_sent} transmissions are too many")
            rows = np.frombuffer(bits, dtype=np.uint8).reshape(n, width)
            if n_sent % 8 and np.any(rows[:, -1] >> (n_sent % 8)):
                raise invalid(f"heard_bitmap: names transmissions beyond the {n_sent} there are")
            receivers, transmissions = np.nonzero(np.unpackbits(rows, axis=1, count=n_sent, bitorder="little"))
            return receivers, transmissions
        if len(ends) == 0 and len(heard) == 0:
            return ends, heard
        lengths = np.diff(ends, prepend=0)
        if len(ends) != n or np.any(lengths < 0) or ends[-1] != len(heard):
            raise invalid(f"heard_end: must have {n} ascending entries, the last of them {len(heard)}")
        if np.any(heard >= n_sent):
            raise invalid(f"heard: must be less than {n_sent}, the number of transmissions, got {heard.max()}")
        return np.repeat(np.arange(n), lengths), heard

    def covered(self) -> bytes:
        """What a digest has of them."""
        return b"".join((
            self.sender.tobytes(), self.sent_ns.tobytes(), self.end_ns.tobytes(), self.length_bytes.tobytes(), self.data,
            self.heard_end.tobytes(), self.heard.tobytes(), self.heard_bitmap,
        ))  # fmt: skip


def digest_bytes(step: int, time_ns: int, alive: bytes, position_m: np.ndarray, deliveries: Columns | None) -> bytes:
    """What the digest of common.proto is made of."""
    text = struct.pack("<2Q", step, time_ns) + alive + np.ascontiguousarray(position_m.T, dtype="<f8").tobytes()
    return text if deliveries is None else text + deliveries.covered()


def all_alive(n: int) -> bytes:
    """The bitmap of `n` agents that all exist."""
    return np.packbits(np.ones(n, dtype=bool), bitorder="little").tobytes()


def flags(text: bytes, n: int, name: str) -> np.ndarray:
    """A bitmap of `n` entries."""
    if len(text) != (n + 7) // 8:
        raise invalid(f"{name}: must have {(n + 7) // 8} bytes for {n} agents, got {len(text)}")
    return np.unpackbits(np.frombuffer(text, dtype=np.uint8), count=n, bitorder="little").astype(bool)


def agent_states(positions_m: np.ndarray, velocities_mps: np.ndarray, headings_rad: np.ndarray | None) -> Any:
    """The message that says where all agents are, all of them alive."""
    states = common_pb2.AgentStates(alive=all_alive(len(positions_m)))
    for name, column in zip(("x_m", "y_m", "z_m"), positions_m.T):
        getattr(states, name).extend(column.tolist())
    for name, column in zip(("vx_mps", "vy_mps", "vz_mps"), velocities_mps.T):
        getattr(states, name).extend(column.tolist())
    if headings_rad is not None:
        states.heading_rad.extend(np.asarray(headings_rad, dtype=float).tolist())
    return states


def serve(register: Any, servicer: Any, address: str | None, *, block: bool) -> grpc.Server:
    """Serves until the process ends. `address`: else that of MURMURATION_LISTEN, else any free port of this machine."""
    address = address or os.environ.get("MURMURATION_LISTEN") or "127.0.0.1:0"
    is_local = address.startswith("unix:") or address.rsplit(":", 1)[0] in ("127.0.0.1", "localhost", "[::1]")
    if not is_local:
        raise ValueError(f"address must be of this machine, 127.0.0.1:PORT, [::1]:PORT or unix:PATH, got {address}")
    # Describe is answered while a step runs.
    limits = [("grpc.max_receive_message_length", 1 << 28), ("grpc.max_send_message_length", 1 << 28)]
    server = grpc.server(futures.ThreadPoolExecutor(max_workers=4), options=limits)
    register(servicer, server)
    port = server.add_insecure_port(address)
    if port == 0:
        raise OSError(f"cannot listen on {address}")
    server.start()
    shown = address if address.startswith("unix:") else f"{address.rsplit(':', 1)[0]}:{port}"
    server.murmuration_address = shown
    print(f"listening on {shown}", flush=True)
    if block:
        try:
            server.wait_for_termination()
        except KeyboardInterrupt:
            server.stop(None)
    return server
