"""A network of your own: say who hears whom.

    import numpy
    import murmuration.network

    class Disk(murmuration.network.Network):
        def step(self, dt_s, position_m, says):
            away_m = numpy.linalg.norm(position_m[:, None] - position_m, axis=2)
            return away_m <= self.config.get("radius_m", 20.0)

    murmuration.network.serve(Disk(), "127.0.0.1:50051")
"""

from __future__ import annotations

from typing import Any

import grpc
import numpy as np

from murmuration import _digest, _faults, _serving
from murmuration._contract import common_pb2, netsim_pb2, netsim_pb2_grpc

__all__ = ["Network", "serve"]


def __dir__() -> list[str]:
    return sorted(__all__)


class Network:
    """Base class of a network simulator. Override `step`, and `reset` where there is anything to begin.

    Every robot that says something sends it once a period, from its beginning to its end. Everything random must come from
    the seed of `reset`: then the same seed gives the same recording.

    Attributes
    ----------
    name : str or None
        Name in messages and records; else that of the class.
    version : str
        Version in records.
    config : dict
        The section [netsim] of the experiment, before `reset` is called.
    site : dict
        The section [site]: walls, obstacles, ground.
    time_s : float
        Time of the experiment at the beginning of the present step (s).
    rssi_dbm : numpy.ndarray or None
        Received signal strength (dBm) by receiver and sender, if `step` sets it.
    """

    name: str | None = None
    version = "1"
    config: dict[str, Any] = {}
    site: dict[str, Any] = {}
    time_s = 0.0
    rssi_dbm: np.ndarray | None = None

    def reset(self, seed: int, n: int) -> None:
        """Begins an experiment. Optional.

        Parameters
        ----------
        seed : int
            Seed of all random draws.
        n : int
            Number of robots.
        """

    def step(self, dt_s: float, position_m: np.ndarray, says: np.ndarray) -> np.ndarray:
        """Decides who hears whom in a control period.

        Parameters
        ----------
        dt_s : float
            Duration of the period (s).
        position_m : numpy.ndarray
            Positions of the robots (m): n rows of x, y, z.
        says : numpy.ndarray
            Whether each robot says anything. Others are heard by nobody whatever is returned, and no robot hears itself.

        Returns
        -------
        numpy.ndarray
            A matrix of truth values by receiver and sender.
        """
        raise NotImplementedError

    def snapshot(self) -> bytes:
        """Returns all that has changed since `reset`, for long runs that go on after a failure. Optional, together with `restore`.

        Returns
        -------
        bytes
            The state in a form of your own.
        """
        raise NotImplementedError

    def restore(self, state: bytes) -> None:
        """Puts a state back. `reset` has been called before with the seed of that experiment.

        Parameters
        ----------
        state : bytes
            What `snapshot` returned.
        """
        raise NotImplementedError


class _Service(_serving.Service, netsim_pb2_grpc.NetSimServiceServicer):
    """Serves `Network` as the contract has it."""

    BASE = Network
    CONFIGURE_REQUEST = netsim_pb2.NetSimServiceConfigureRequest
    STEP_REQUEST = netsim_pb2.NetSimServiceStepRequest
    STEP_RESPONSE = netsim_pb2.NetSimServiceStepResponse
    BARRIER_RESPONSE = netsim_pb2.NetSimServiceBarrierResponse
    SESSION_RESPONSE = netsim_pb2.NetSimServiceSessionResponse
    SNAPSHOT_RESPONSE = netsim_pb2.NetSimServiceSnapshotResponse
    RESTORE_RESPONSE = netsim_pb2.NetSimServiceRestoreResponse
    START_DIGEST = staticmethod(_digest.network_start)
    STEP_DIGEST = staticmethod(_digest.network_step)

    def Describe(self, request: Any, context: Any) -> Any:
        columns = [common_pb2.DELIVERY_COLUMN_RSSI_DBM]
        return netsim_pb2.NetSimServiceDescribeResponse(**self.identity(), columns=columns)

    def start(self, request: Any) -> Any:
        self.wants_rssi = common_pb2.DELIVERY_COLUMN_RSSI_DBM in request.columns
        self.delivered: _serving.Columns | None = None
        self.simulator.rssi_dbm = None
        self.simulator.reset(request.seed, self.n)
        return netsim_pb2.NetSimServiceConfigureResponse(motes=self._motes())

    def advance(self, request: Any, dt_s: float) -> tuple[Any, bytes]:
        position_m, alive = self._positions(request.states)
        lengths = np.asarray(request.payloads.length_bytes, dtype=np.int64)
        data = request.payloads.data
        if len(lengths) not in (0, self.n) or lengths.sum() != len(data):
            raise _serving.invalid(f"payloads: must be one for each of {self.n} agents, and as long as their lengths say")
        says = alive & (lengths > 0) if len(lengths) else np.zeros(self.n, dtype=bool)
        step = self.simulator.step
        heard = np.array(step(dt_s, position_m, says.copy()), dtype=bool)
        if heard.shape != (self.n, self.n):
            raise _faults.WrongResult(step, f"a matrix of shape ({self.n}, {self.n}), got {heard.shape}")
        np.fill_diagonal(heard, False)
        heard = heard[:, says] & alive[:, None]
        deliveries = self._deliveries(request, heard, says, lengths)
        reply = netsim_pb2.NetSimServiceStepResponse(deliveries=deliveries, motes=self._motes())
        covered = _serving.digest_bytes(request.step, request.until_ns, request.states.alive, position_m, self.delivered)
        self.delivered = _serving.Columns(deliveries)
        return reply, covered

    def kept(self) -> list[bytes]:
        return []

    def resume(self, kept: list[bytes]) -> None:
        self.delivered = None if self._reply is None else _serving.Columns(self._reply.deliveries)

    def _positions(self, states: Any) -> tuple[np.ndarray, np.ndarray]:
        columns = [np.asarray(column, dtype=float) for column in (states.x_m, states.y_m, states.z_m)]
        if any(len(column) != self.n for column in columns):
            raise _serving.invalid(f"states: x_m, y_m and z_m must have {self.n} entries each")
        position_m = np.column_stack(columns)
        alive = _serving.flags(states.alive, self.n, "states.alive")
        if not np.all(np.isfinite(position_m)):
            raise _serving.invalid("states: positions must be finite")
        return position_m, alive

    def _deliveries(self, request: Any, heard: np.ndarray, says: np.ndarray, lengths: np.ndarray) -> Any:
        senders = np.flatnonzero(says)
        ends = np.cumsum(lengths)
        said = b"".join(request.payloads.data[ends[robot] - lengths[robot] : ends[robot]] for robot in senders)
        payloads = common_pb2.Payloads(length_bytes=[int(lengths[robot]) for robot in senders], data=said)
        air = common_pb2.Transmissions(
            sender=senders.tolist(), sent_ns=[self.time_ns] * len(senders), end_ns=[request.until_ns] * len(senders), payloads=payloads
        )
        deliveries = common_pb2.Deliveries(transmissions=air)
        if len(senders) == 0:
            return deliveries
        width = (len(senders) + 7) // 8
        if 4 * (self.n + heard.sum()) < self.n * width:
            deliveries.heard_end.extend(np.cumsum(heard.sum(axis=1)).tolist())
            deliveries.heard.extend(np.nonzero(heard)[1].tolist())
        else:
            deliveries.heard_bitmap = np.packbits(heard, axis=1, bitorder="little").tobytes()
        if self.wants_rssi and self.simulator.rssi_dbm is not None:
            deliveries.rssi_dbm.extend(np.asarray(self.simulator.rssi_dbm, dtype=float)[:, senders][heard].tolist())
        return deliveries

    def _motes(self) -> Any:
        return common_pb2.MoteStates(alive=_serving.all_alive(self.n))


def serve(network: Network, address: str | None = None, *, block: bool = True) -> grpc.Server:
    """Serves a network simulator until Ctrl-C.

    The variable MURMURATION_LISTEN takes precedence over `address`: the orchestrator sets it when `command` of an experiment
    file starts the program, and then ends the program with the run.

    Parameters
    ----------
    network : Network
        The simulator.
    address : str, optional
        Where to listen: 127.0.0.1:PORT or unix:PATH. By default at a free port, which is printed.
    block : bool
        Whether to return only at the end.

    Returns
    -------
    grpc.Server
        The server.

    Raises
    ------
    ValueError
        The address is not of this machine.
    OSError
        It is not possible to listen there.
    """
    return _serving.serve(netsim_pb2_grpc.add_NetSimServiceServicer_to_server, _Service(network), address, block=block)
