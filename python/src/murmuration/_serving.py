"""What both kinds of simulator share: the calls of the contract, the form of requests, digests, and the server."""

from __future__ import annotations

import faulthandler
import hashlib
import os
import struct
import sys
import threading
import time
import tomllib
from collections.abc import Callable, Iterator
from concurrent import futures
from typing import Any

import grpc
import numpy as np

from murmuration import _faults
from murmuration._contract import common_pb2

# The longest text of an error: details travel in HTTP/2 headers, which many clients limit to 16 KiB.
LONGEST_ERROR = 8_000
# More receivers times transmissions than this are no deliveries of a swarm (bytes of a matrix of one byte each).
MOST_PAIRS = 1 << 30
# Where to listen: set by the orchestrator for the command of an experiment file, or by a user.
LISTEN = "MURMURATION_LISTEN"
# Set by the orchestrator: standard input closes when the process is to end.
EXIT_WITH_STDIN = "MURMURATION_EXIT_WITH_STDIN"
# How long the program may take to end by itself after that (s).
ENDS_WITHIN_S = 1.0


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

    Subclasses serve one class of users: they set the types of messages and the rules of the full digest, and override `start`,
    `advance`, `kept` and `resume`.
    """

    BASE: type
    """The class whose methods users override."""
    CONFIGURE_REQUEST: Any
    STEP_REQUEST: Any
    STEP_RESPONSE: Any
    BARRIER_RESPONSE: Any
    SESSION_RESPONSE: Any
    SNAPSHOT_RESPONSE: Any
    RESTORE_RESPONSE: Any
    START_DIGEST: Callable[[Any, Any], bytes]
    STEP_DIGEST: Callable[[bytes, Any, Any, int], bytes]

    def __init__(self, simulator: Any) -> None:
        self.simulator = simulator
        self.n = 0
        self.step: int | None = None
        self.time_ns = 0
        self._asked: Any = None
        self._reply: Any = None
        self._digest = b""
        self._configured: Any = None
        # ROBOTS' START or NETWORK'S START of the full digest; empty where the short one was asked for.
        self._start_digest = b""

    def start(self, request: Any) -> Any:
        """Begins an experiment with `n` agents; returns the reply to Configure."""
        raise NotImplementedError

    def advance(self, request: Any, dt_s: float) -> tuple[Any, bytes]:
        """The reply to a step that may follow, and the bytes of which the short digest is made."""
        raise NotImplementedError

    def kept(self) -> list[bytes]:
        """What a snapshot has beside the user's state, requests and replies."""
        raise NotImplementedError

    def resume(self, kept: list[bytes]) -> None:
        """Puts back what `kept` returned, after `start` and after the latest reply was put back."""
        raise NotImplementedError

    def identity(self) -> dict[str, Any]:
        """What every answer to Describe says."""
        simulator = self.simulator
        name = simulator.name or type(simulator).__name__
        said = {"name": name, "version": simulator.version, "contract_version": 1, "session": True, "full_digest": True}
        return {**said, "snapshots": self.has_snapshots()}

    def has_snapshots(self) -> bool:
        """Whether the user's class has `snapshot` and `restore`.

        Raises: ValueError if it has one of them alone.
        """
        has = [self.overrides(name) for name in ("snapshot", "restore")]
        if has[0] != has[1]:
            raise ValueError(f"{type(self.simulator).__name__} must have both snapshot and restore, or none of them")
        return has[0]

    def overrides(self, name: str) -> bool:
        """Whether the user's class has a method of its own in place of the base class's."""
        return getattr(type(self.simulator), name) is not getattr(self.BASE, name)

    def Configure(self, request: Any, context: Any) -> Any:
        return answered(context, self._configure, request)

    def Step(self, request: Any, context: Any) -> Any:
        return answered(context, self._step, request)

    def Barrier(self, request: Any, context: Any) -> Any:
        return answered(context, self._barrier, request)

    def Snapshot(self, request: Any, context: Any) -> Any:
        return answered(context, self._snapshot, request)

    def Restore(self, request: Any, context: Any) -> Any:
        return answered(context, self._restore, request)

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
        config, site = sections(request)
        # Not configured until `start` has succeeded.
        self.step, self.n = None, request.agent_count
        self.simulator.config, self.simulator.site, self.simulator.time_s = config, site, 0.0
        reply = self.start(request)
        self._start_digest = self.START_DIGEST(request, reply) if request.full_digest else b""
        self.step, self.time_ns, self._asked, self._reply, self._digest = 0, 0, None, None, b""
        self._configured = request
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
        reply.step, reply.time_ns = self.step, self.time_ns
        if self._start_digest:
            self._digest = self.STEP_DIGEST(self._start_digest, request, reply, self.n)
        else:
            self._digest = hashlib.sha256(covered).digest()
        reply.digest = self._digest
        self._asked, self._reply = request, reply
        return reply

    def _barrier(self, request: Any) -> Any:
        if self._reply is None:
            raise not_now("step: none was taken yet")
        return self.BARRIER_RESPONSE(step=self.step, time_ns=self.time_ns, digest=self._digest)

    def _snapshot(self, request: Any) -> Any:
        if not self.has_snapshots():
            raise Refused(grpc.StatusCode.UNIMPLEMENTED, "snapshots are not announced")
        if self.step is None:
            raise not_now("step: Configure comes first")
        latest = [b"", b""] if self._reply is None else [self._asked.SerializeToString(), self._reply.SerializeToString()]
        state = self.simulator.snapshot()
        if not isinstance(state, bytes):
            raise _faults.WrongResult(self.simulator.snapshot, f"bytes, got {type(state).__name__}")
        parts = [self._configured.SerializeToString(), self._start_digest, *latest, state, *self.kept()]
        return self.SNAPSHOT_RESPONSE(state=sealed(self._version(), parts))

    def _restore(self, request: Any) -> Any:
        if not self.has_snapshots():
            raise Refused(grpc.StatusCode.UNIMPLEMENTED, "snapshots are not announced")
        configured, start_digest, asked, reply, state, *kept = opened(self._version(), request.state)
        self._configure(self.CONFIGURE_REQUEST.FromString(configured))
        # Not configured until all is put back.
        self.step, step, self._start_digest = None, 0, start_digest
        if reply:
            self._asked, self._reply = self.STEP_REQUEST.FromString(asked), self.STEP_RESPONSE.FromString(reply)
            step, self.time_ns, self._digest = self._reply.step, self._reply.time_ns, self._reply.digest
        self.simulator.time_s = self.time_ns / 1e9
        self.resume(kept)
        self.simulator.restore(state)
        self.step = step
        return self.RESTORE_RESPONSE(step=self.step, time_ns=self.time_ns)

    def _version(self) -> str:
        """What a snapshot is valid for."""
        said = self.identity()
        return f"murmuration-python/1 {said['name']} {said['version']}"


def sealed(version: str, parts: list[bytes]) -> bytes:
    """A snapshot: version and parts, each after its length (u64), then SHA-256 of all that."""
    text = b"".join(struct.pack("<Q", len(part)) + part for part in (version.encode(), *parts))
    return text + hashlib.sha256(text).digest()


def opened(version: str, state: bytes) -> list[bytes]:
    """The parts of a snapshot of that version.

    Raises: Refused if it is damaged, or of another simulator or version.
    """
    text, check = state[:-32], state[-32:]
    if len(state) < 40 or hashlib.sha256(text).digest() != check:
        raise invalid("state: is damaged, or not a snapshot of this simulator")
    parts, at = [], 0
    while at < len(text):
        (length,) = struct.unpack_from("<Q", text, at)
        parts.append(text[at + 8 : at + 8 + length])
        at += 8 + length
    found = parts[0].decode(errors="replace")
    if found != version:
        raise invalid(f"state: is of {found[:200]!r}, but this is {version!r}")
    return parts[1:]


def sections(request: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """The user's own section and [site] of a request."""
    read = []
    for name in ("config_toml", "site_toml"):
        try:
            read.append(tomllib.loads(getattr(request, name)))
        except tomllib.TOMLDecodeError as error:
            raise invalid(f"{name}: {error}") from None
    return read[0], read[1]


def answered(context: grpc.ServicerContext, work: Any, request: Any) -> Any:
    """Calls `work`; what goes wrong becomes a status with a text, and a fault of user code shows its lines."""
    try:
        return work(request)
    except Refused as refused:
        context.abort(refused.status, str(refused)[:LONGEST_ERROR])
    except (Exception, SystemExit) as error:
        text = _faults.shown(error)
        # The orchestrator shows the text of the status to whoever let it start this process.
        if EXIT_WITH_STDIN not in os.environ:
            print(text, file=sys.stderr, flush=True)
        context.abort(grpc.StatusCode.INTERNAL, text[:LONGEST_ERROR])


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
        if np.add.reduce(self.length_bytes, dtype=np.int64) != len(self.data):
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


def serve(register: Any, servicer: Any, address: str | None, *, block: bool, quiet: bool = False) -> grpc.Server:
    """Serves until the process ends: where MURMURATION_LISTEN says, else at `address`, else at any free port of this machine.

    It prints where it listens, unless it is to be `quiet`.
    """
    address = os.environ.get(LISTEN) or address or "127.0.0.1:0"
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
    if EXIT_WITH_STDIN in os.environ:
        serve_as_child(server)
    elif not quiet:
        print(f"listening on {shown}", flush=True)
    if block:
        try:
            server.wait_for_termination()
        except KeyboardInterrupt:
            server.stop(None)
    return server


def serve_as_child(server: grpc.Server) -> None:
    """What a process does that the orchestrator has started: it ends with it, prints lines as they come, and names the line of a crash."""
    # A crash in compiled code, such as that of a physics engine, has no traceback otherwise.
    faulthandler.enable()
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(line_buffering=True)

    def watch() -> None:
        while os.read(0, 4096):
            pass
        server.stop(None)
        time.sleep(ENDS_WITHIN_S)
        os._exit(0)

    threading.Thread(target=watch, daemon=True, name="standard input").start()
