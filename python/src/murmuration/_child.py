"""A simulator as a child process of this one, which ends with it, and the calls of the contract to it."""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import subprocess
import tempfile
import time
import weakref
from pathlib import Path
from typing import Any

import grpc

from murmuration import _program
from murmuration._files import hold
from murmuration._program import InvalidInput, MurmurationError

# How long a simulator may take until it listens (s).
START_S = 30.0
# How long a single call may take (s of real time).
CALL_S = 60.0
# How much of what a simulator wrote to standard error an exception quotes (bytes).
QUOTED_BYTES = 4_000
LARGEST_MESSAGE_BYTES = 1 << 28

_SERVICES = {"netsim": "cosim.v1.NetSimService", "robotsim": "cosim.v1.RobotSimService"}


class Child:
    """`murmuration netsim` or `murmuration robotsim`, reached over a Unix socket in a folder that only this user may enter.

    It holds the reading end of a pipe as its standard input and ends when this process does, however that ends.
    """

    def __init__(self, side: str, messages: Any, *, threads: int | None = None, deadline_s: float = CALL_S) -> None:
        self.side = side
        self.deadline_s = deadline_s
        self._messages = messages
        self._service = _SERVICES[side]
        self._calls: dict[str, Any] = {}
        self._channel: grpc.Channel | None = None
        self._folder = tempfile.mkdtemp(prefix="murmuration-")
        lock = hold(self._folder)
        address = self._address = f"unix:{self._folder}/{side}"
        self._errors = Path(self._folder) / "stderr"
        command = [str(_program.program()), side, "--listen", address, "--exit-with-parent", "--refuse-orders"]
        command += [] if threads is None else ["--threads", str(threads)]
        try:
            with self._errors.open("wb") as errors:
                # A group of its own: Ctrl-C in a terminal is for this process, which ends the child.
                pipe = subprocess.PIPE
                self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=errors, process_group=0)
            self._wait_until_it_listens()
        except BaseException:
            if hasattr(self, "process"):
                _end(self.process, self._folder, lock, os.getpid())
            else:
                shutil.rmtree(self._folder, ignore_errors=True)
                os.close(lock)
            raise
        self._finalizer = weakref.finalize(self, _end, self.process, self._folder, lock, os.getpid())

    def call(self, name: str, request: Any) -> Any:
        """Makes a call of the contract; returns the response. A refusal of the input is `InvalidInput`, with the simulator's text."""
        if not self._finalizer.alive:
            raise MurmurationError(f"{self.side} is closed")
        if self._channel is None:
            options = [
                ("grpc.default_authority", "localhost"), ("grpc.max_receive_message_length", LARGEST_MESSAGE_BYTES),
                ("grpc.max_send_message_length", LARGEST_MESSAGE_BYTES), ("grpc.use_local_subchannel_pool", 1),
            ]  # fmt: skip
            self._channel = grpc.insecure_channel(self._address, options=options)
        call = self._calls.get(name)
        if call is None:
            response = getattr(self._messages, f"{self._service.rsplit('.', 1)[1]}{name}Response")
            call = self._channel.unary_unary(
                f"/{self._service}/{name}",
                request_serializer=lambda message: message.SerializeToString(),
                response_deserializer=response.FromString,
            )
            self._calls[name] = call
        try:
            return call(request, timeout=self.deadline_s)
        except grpc.RpcError as error:
            raise self._failure(name, error) from None

    def close(self) -> None:
        """Ends the process. Calls after that are refused."""
        if self._channel is not None:
            self._channel.close()
            self._channel = None
            self._calls.clear()
        self._finalizer()

    def _wait_until_it_listens(self) -> None:
        output = self.process.stdout
        assert output is not None
        deadline, line = time.monotonic() + START_S, b""
        while not line.endswith(b"\n"):
            ready, _, _ = select.select([output], [], [], max(0.0, deadline - time.monotonic()))
            if not ready:
                raise MurmurationError(f"{self.side} did not start to listen within {START_S:.0f} s{self._quoted()}")
            part = os.read(output.fileno(), 4096)
            if not part:
                self.process.wait()
                raise MurmurationError(f"{self.side} ended before it listened ({_ending(self.process)}){self._quoted()}")
            line += part

    def _failure(self, name: str, error: Any) -> MurmurationError:
        code, text = error.code(), error.details() or "no reason was given"
        if code == grpc.StatusCode.INVALID_ARGUMENT:
            return InvalidInput(f"{self.side}: {text}")
        if code == grpc.StatusCode.DEADLINE_EXCEEDED:
            return MurmurationError(f"{self.side} did not answer {name} within {self.deadline_s:g} s (process {self.process.pid})")
        if code in (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED, grpc.StatusCode.UNKNOWN):
            # The socket closes a moment before the process can be waited for.
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(timeout=2.0)
            if self.process.poll() is not None:
                ending = _ending(self.process)
                return MurmurationError(f"{self.side} (process {self.process.pid}) ended during {name}: {ending}{self._quoted()}")
        return MurmurationError(f"{self.side}: {name}: {text} ({code.name}){self._quoted()}")

    def _quoted(self) -> str:
        try:
            said = self._errors.read_bytes()[-QUOTED_BYTES:].decode(errors="replace").strip()
        except OSError:
            return ""
        return f"\n{said}" if said else ""


def _ending(process: subprocess.Popen[bytes]) -> str:
    status = process.returncode
    return f"killed by signal {-status}" if status is not None and status < 0 else f"exit status {status}"


def _end(process: subprocess.Popen[bytes], folder: str, lock: int, owner: int) -> None:
    """Ends the process and removes its folder; in a process that was forked from its owner, does nothing."""
    if os.getpid() != owner:
        return
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            pipe.close()
    try:
        process.wait(timeout=2.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    shutil.rmtree(folder, ignore_errors=True)
    os.close(lock)
