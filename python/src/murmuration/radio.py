"""The radio network alone, driven from Python: say where robots are and what they say, and learn who heard what.

    from murmuration import Radio

    with Radio({"phy": {"propagation": "friis"}}, n=10, seed=1, period_s=0.1) as radio:
        for _ in range(100):
            heard = radio.step(0.1, position_m)
            position_m += 0.1 * (heard.mean_position_m(position_m) - position_m)

The network is a child process, which ends with this one. Nothing is recorded: this is for training and for programs that have
a loop of their own. `murmuration.run` and `murmuration.env.evaluate` record.
"""

from __future__ import annotations

import dataclasses
import math
import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import tomli_w

from murmuration import _serving, robots
from murmuration._child import CALL_S, Child
from murmuration._contract import common_pb2, netsim_pb2
from murmuration._files import plain
from murmuration._program import InvalidInput, MurmurationError
from murmuration._terms import whole_number

# Largest number of control periods that one step may cover: the contract's.
MOST_PERIODS = 1000
# Largest number of motes: the contract's numbers have 32 bits.
MOST_MOTES = 2**32 - 1
# How often it is looked at whether the network has formed (s of simulated time).
LOOK_S = 5.0


__all__ = ["Formation", "Radio", "Snapshot"]


def __dir__() -> list[str]:
    return sorted(__all__)


@dataclasses.dataclass(frozen=True)
class Formation:
    """Whether a network with protocols has formed, that is, whether every mote that is to take part does.

    Attributes
    ----------
    formed : bool
        Whether it has formed at least once.
    formed_s : float or None
        When it had formed (s after the network started); None while it has not.
    missing : dict
        Motes that do not take part yet by number, and what each lacks.
    """

    formed: bool
    formed_s: float | None
    missing: dict[int, str]


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """The whole state of a network, to be given to `Radio.restore`. Valid for the version of the program that made it.

    Attributes
    ----------
    state : bytes
        State of the network simulator.
    n : int
        Number of motes.
    period_ns : int
        The control period (ns).
    step : int
        Number of steps so far.
    time_ns : int
        Simulated time since the network started (ns).
    formation : Formation or None
        How far the network had formed.
    motes : murmuration.robots.Motes or None
        How each mote stood in the network.
    position_m : numpy.ndarray or None
        Positions of the last step (m): one row of x, y, z for each robot.
    says_state : bool
        Whether all payloads so far were positions and velocities.
    """

    state: bytes
    n: int
    period_ns: int
    step: int
    time_ns: int
    formation: Formation | None
    motes: robots.Motes | None
    position_m: np.ndarray | None
    says_state: bool


class Radio:
    """A network of motes without robots, driven by a loop of your own.

    The network is a child process. Errors of it are `murmuration.InvalidInput` or `murmuration.MurmurationError`, with its text. If
    it has died, the next call says so.

    Parameters
    ----------
    netsim : Mapping or str, optional
        The section [netsim] of an experiment, as a dictionary or as TOML text with its keys at top level.
    n : int
        Number of motes, at least 1. Mote i is the radio of robot i.
    seed : int
        Seed of all random draws, from 0 to 2^64 - 1: the same seed, configuration and motion give the same deliveries.
    period_s : float
        The control period (s), whole slots of the network: in each, every robot says what it has to say once.
    site : Mapping or str, optional
        The section [site]: walls, obstacles, ground.
    files : Mapping, optional
        Contents (bytes) of the files that `netsim` names, by their names. Those left out are read from `folder`.
    folder : str or os.PathLike
        Folder of the files that `netsim` names.
    threads : int, optional
        Threads of the simulator; results do not depend on it. By default one for each core.
    deadline_s : float
        How long a call may take (s of real time) before the simulator counts as hanging.

    Attributes
    ----------
    n : int
        Number of motes.
    period_ns : int
        The control period (ns).
    can_reseed : bool
        Whether `restore` takes a seed.
    warnings : list of str
        What should be checked before results are trusted.

    Raises
    ------
    InvalidInput
        The configuration or an argument is invalid.
    MurmurationError
        The simulator cannot be started.

    Examples
    --------
    >>> with murmuration.Radio({"phy": {"propagation": "friis"}}, n=10, seed=1, period_s=0.1) as radio:
    ...     heard = radio.step(0.1, position_m)
    """

    def __init__(
        self, netsim: Mapping[str, Any] | str | None = None, *, n: int, seed: int, period_s: float, site: Mapping[str, Any] | str | None = None,
        files: Mapping[str, bytes] | None = None, folder: str | os.PathLike[str] = ".", threads: int | None = None, deadline_s: float = CALL_S,
    ) -> None:  # fmt: skip
        self.n = 0
        self._files = dict(files or {})
        self._folder = Path(folder)
        self._child = Child("netsim", netsim_pb2, threads=threads, deadline_s=deadline_s)
        try:
            self.can_reseed = bool(self._child.call("Describe", netsim_pb2.NetSimServiceDescribeRequest()).reseed)
            self.configure(netsim, n=n, seed=seed, period_s=period_s, site=site)
        except BaseException:
            self._child.close()
            raise

    def configure(
        self, netsim: Mapping[str, Any] | str | None = None, *, n: int, seed: int, period_s: float, site: Mapping[str, Any] | str | None = None
    ) -> None:  # fmt: skip
        """Begins anew on the same process, in less than a millisecond.

        Parameters
        ----------
        netsim : Mapping or str, optional
            The section [netsim] of an experiment, as a dictionary or as TOML text with its keys at top level.
        n : int
            Number of motes, at least 1.
        seed : int
            Seed of all random draws, from 0 to 2^64 - 1.
        period_s : float
            The control period (s), whole slots of the network.
        site : Mapping or str, optional
            The section [site]: walls, obstacles, ground.

        Raises
        ------
        InvalidInput
            The configuration or an argument is invalid; the network is as it was.
        """
        text, table = _toml(netsim, "netsim")
        site_text, _ = _toml(site, "site")
        period_ns = round(period_s * 1e9) if np.isfinite(period_s) else 0
        if period_ns < 1:
            raise InvalidInput(f"period_s: must be positive and finite, got {period_s}")
        seed, n = whole_number("seed", seed, 0, 2**64 - 1), whole_number("n", n, 1, MOST_MOTES)
        request = netsim_pb2.NetSimServiceConfigureRequest(
            seed=seed, agent_count=n, step_ns=period_ns, coupling=common_pb2.COUPLING_SEQUENTIAL, site_toml=site_text, config_toml=text,
            columns=[common_pb2.DELIVERY_COLUMN_RSSI_DBM], files=read_files(table, self._folder, self._files),
        )  # fmt: skip
        reply = self._child.call("Configure", request)
        self.n = n
        self.period_ns = period_ns
        self.warnings: list[str] = list(reply.warnings)
        self._step, self._time_ns = 0, 0
        self._formation = _formation(reply)
        self._motes: robots.Motes | None = None
        self._motes_message = b""
        self._motes = self._read_motes(reply)
        self._before_m: np.ndarray | None = None
        self._says_state = True
        self._alive = _serving.all_alive(n)

    @property
    def time_s(self) -> float:
        """Simulated time since the network started (s).

        Returns
        -------
        float
            The time (s).
        """
        return self._time_ns / 1e9

    @property
    def formation(self) -> Formation | None:
        """How far the network has formed.

        Returns
        -------
        Formation or None
            None where there is nothing to form, as in a propagation-only network.
        """
        return self._formation

    @property
    def formed(self) -> bool:
        """Whether robots are heard: the network has formed, or has nothing to form.

        Returns
        -------
        bool
            True once it has formed.
        """
        return self._formation is None or self._formation.formed

    @property
    def motes(self) -> robots.Motes | None:
        """How each mote stands in the network at the end of the last step.

        Returns
        -------
        murmuration.robots.Motes or None
            None before the first step of a network that does not tell.
        """
        return self._motes

    def step(
        self, dt_s: float, position_m: np.ndarray, payloads: Sequence[bytes] | None = None, *, velocity_mps: np.ndarray | None = None
    ) -> robots.Heard:
        """Runs the network while robots are at given positions.

        Parameters
        ----------
        dt_s : float
            Duration of the step (s), at most 1000 control periods.
        position_m : numpy.ndarray
            Positions (m): n rows of x, y or x, y, z.
        payloads : sequence of bytes, optional
            The bytes that each robot says; one with empty bytes says nothing. By default robots say their position and velocity, as the
            built-in ones do.
        velocity_mps : numpy.ndarray, optional
            Velocities that robots say (m/s): n rows. By default the displacement since the last step over `dt_s`, zero in the first.

        Returns
        -------
        murmuration.robots.Heard
            What was heard in the step.

        Raises
        ------
        InvalidInput
            An argument has the wrong form; nothing has moved.
        MurmurationError
            The simulator has failed.
        """
        dt_ns = round(dt_s * 1e9) if np.isfinite(dt_s) else 0
        if not 1 <= dt_ns <= MOST_PERIODS * self.period_ns:
            raise InvalidInput(f"dt_s: must be positive and at most {MOST_PERIODS} periods of {self.period_ns / 1e9:g} s, got {dt_s}")
        position_m = rows(position_m, self.n, "position_m")
        if payloads is not None:
            if len(payloads) != self.n:
                raise InvalidInput(f"payloads: must be one for each of {self.n} robots, got {len(payloads)}")
            said = common_pb2.Payloads(length_bytes=[len(one) for one in payloads], data=b"".join(payloads))
        else:
            if velocity_mps is not None:
                velocity_mps = rows(velocity_mps, self.n, "velocity_mps")
            elif self._before_m is None:
                velocity_mps = np.zeros((self.n, 3))
            else:
                velocity_mps = (position_m - self._before_m) / (dt_ns / 1e9)
            said = robots.said_states(position_m, velocity_mps)
        # A payload that is heard now may have been said in an earlier period: one that was not a state ends that all are.
        self._says_state = self._says_state and payloads is None
        return self._advance(dt_ns, position_m, said)

    def form(self, position_m: np.ndarray, *, limit_s: float = 3600.0) -> float:
        """Waits until the network has formed, while robots stand still and say nothing.

        It looks every 5 s of simulated time, or after each period if that is longer.

        Parameters
        ----------
        position_m : numpy.ndarray
            Positions (m): n rows of x, y or x, y, z.
        limit_s : float
            Simulated time after which it gives up (s).

        Returns
        -------
        float
            The time it took (s of simulated time).

        Raises
        ------
        MurmurationError
            The network has not formed within `limit_s`. The text names the missing motes and what each lacks.
        """
        position_m = rows(position_m, self.n, "position_m")
        begin_ns, silence = self._time_ns, common_pb2.Payloads(length_bytes=[0] * self.n)
        periods = max(1, min(MOST_PERIODS, round(LOOK_S * 1e9 / self.period_ns)))
        while not self.formed:
            if limit_s * 1e9 <= self._time_ns - begin_ns:
                raise MurmurationError(f"the network had not formed after {limit_s:g} s of simulated time{_missing(self._formation)}")
            self._advance(periods * self.period_ns, position_m, silence)
        return (self._time_ns - begin_ns) / 1e9

    def snapshot(self) -> Snapshot:
        """Returns the whole state.

        Returns
        -------
        Snapshot
            The state, to be given to `restore`.
        """
        state = self._child.call("Snapshot", netsim_pb2.NetSimServiceSnapshotRequest()).state
        return Snapshot(
            state, self.n, self.period_ns, self._step, self._time_ns, self._formation, self._motes, self._before_m, self._says_state
        )

    def restore(self, snapshot: Snapshot, seed: int | None = None) -> None:
        """Puts a state back, in a few milliseconds.

        Parameters
        ----------
        snapshot : Snapshot
            The state.
        seed : int, optional
            Seed of all random draws from here on. What was drawn once for the whole experiment (shadowing, offsets of transmitters,
            rates of clocks) stays that of the snapshot. By default draws go on as from the snapshot.

        Raises
        ------
        MurmurationError
            The state is not of this simulator, or the simulator does not take another seed.
        """
        request = netsim_pb2.NetSimServiceRestoreRequest(state=snapshot.state)
        if seed is not None:
            if not self.can_reseed:
                raise MurmurationError("netsim does not restore with another seed (it does not announce reseed): use a newer program")
            request.seed = seed
        reply = self._child.call("Restore", request)
        self._step, self._time_ns = reply.step, reply.time_ns
        self.n, self.period_ns = snapshot.n, snapshot.period_ns
        self._formation, self._motes, self._before_m = snapshot.formation, snapshot.motes, snapshot.position_m
        self._motes_message = b""
        self._says_state = snapshot.says_state
        self._alive = _serving.all_alive(self.n)

    def close(self) -> None:
        """Ends the simulator."""
        self._child.close()

    def __enter__(self) -> Radio:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _advance(self, dt_ns: int, position_m: np.ndarray, said: Any) -> robots.Heard:
        states = common_pb2.AgentStates(alive=self._alive)
        for name, column in zip(("x_m", "y_m", "z_m"), position_m.T.tolist()):
            getattr(states, name).extend(column)
        request = netsim_pb2.NetSimServiceStepRequest(step=self._step + 1, until_ns=self._time_ns + dt_ns, states=states, payloads=said)
        reply = self._child.call("Step", request)
        self._step, self._time_ns, self._before_m = reply.step, reply.time_ns, position_m
        self._formation = _formation(reply)
        self._motes = self._read_motes(reply)
        deliveries = reply.deliveries
        try:
            columns = _serving.Columns(deliveries)
            return robots.decoded(self.n, columns, deliveries.rssi_dbm, self._time_ns, says_state=self._says_state)
        except _serving.Refused as refused:
            raise MurmurationError(f"netsim: Step: its reply is not valid: {refused}") from None

    def _read_motes(self, reply: Any) -> robots.Motes | None:
        """The motes of a reply; the same object as before where nothing has changed."""
        if not reply.HasField("motes"):
            return None
        message = reply.motes.SerializeToString()
        if message != self._motes_message or self._motes is None:
            self._motes_message = message
            return robots.mote_states(reply.motes, self.n)
        return self._motes


def rows(values: Any, n: int, name: str) -> np.ndarray:
    """Values of n robots as n rows of x, y, z; a copy. z is 0 where it is left out."""
    array = np.asarray(values, dtype=float)
    if array.ndim != 2 or array.shape[0] != n or array.shape[1] not in (2, 3):
        raise InvalidInput(f"{name}: must have the shape ({n}, 2) or ({n}, 3), got {array.shape}")
    whole = np.zeros((n, 3))
    whole[:, : array.shape[1]] = array
    # A sum is finite only if all terms are, and quicker than a look at each.
    if not math.isfinite(np.add.reduce(whole, axis=None)) and not np.isfinite(whole).all():
        robot = int(np.flatnonzero(~np.isfinite(whole).all(axis=1))[0])
        raise InvalidInput(f"{name}: must be finite, got {array[robot].tolist()} for robot {robot}")
    return whole


def read_files(table: Any, folder: Path, known: Mapping[str, bytes]) -> list[Any]:
    """The files that a section names under keys called `file`, as the contract sends them."""
    found: dict[str, bytes] = {}

    def visit(value: Any) -> None:
        if isinstance(value, Mapping):
            for key, item in value.items():
                if key == "file" and isinstance(item, str):
                    if item in known:
                        found[item] = known[item]
                    else:
                        try:
                            found[item] = (folder / item).read_bytes()
                        except OSError as error:
                            raise InvalidInput(f"{item}: cannot be read: {error.strerror}") from None
                else:
                    visit(item)
        elif isinstance(value, list):
            for item in value:
                visit(item)

    visit(table)
    return [common_pb2.File(path=path, content=content) for path, content in sorted(found.items())]


def _toml(section: Mapping[str, Any] | str | None, name: str) -> tuple[str, dict[str, Any]]:
    """A section as text and as a dictionary."""
    if section is None:
        return "", {}
    if isinstance(section, str):
        try:
            return section, tomllib.loads(section)
        except tomllib.TOMLDecodeError as error:
            raise InvalidInput(f"{name}: {error}") from None
    table = plain(section)
    return tomli_w.dumps(table), table


def _formation(reply: Any) -> Formation | None:
    if not reply.HasField("formation"):
        return None
    formation = reply.formation
    reasons = list(formation.reasons)
    missing = {mote: reasons[reason] for mote, reason in zip(formation.missing, formation.reason)}
    return Formation(formation.formed, formation.formed_ns / 1e9 if formation.formed else None, missing)


def _missing(formation: Formation | None) -> str:
    if formation is None or not formation.missing:
        return ""
    lacks: dict[str, list[str]] = {}
    for mote, reason in formation.missing.items():
        lacks.setdefault(reason, []).append(str(mote))
    return "".join(f"\n  {reason}: {', '.join(motes)}" for reason, motes in lacks.items())
