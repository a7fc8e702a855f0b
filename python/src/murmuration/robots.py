"""A robot simulator of your own: say where robots start and how they move, by what they heard.

    import murmuration.robots

    class Gather(murmuration.robots.Robots):
        def reset(self, seed, n):
            self.position_m = numpy.random.default_rng(seed).uniform(-6, 6, (n, 2))
            return self.position_m

        def step(self, dt_s, heard):
            self.position_m += 0.1 * dt_s * (heard.mean_position_m(self.position_m) - self.position_m)
            return self.position_m

    murmuration.robots.serve(Gather(), "127.0.0.1:50061")
"""

from __future__ import annotations

import dataclasses
import threading
from typing import Any

import grpc
import numpy as np

from murmuration import _digest, _faults, _serving
from murmuration._contract import common_pb2, robotsim_pb2, robotsim_pb2_grpc

__all__ = ["Heard", "Motes", "Robots", "Unsupported", "Window", "serve"]

# What a robot says unless `payloads` is overridden: position and velocity, six little-endian f64.
STATE_BYTES = 48
# No agent, in columns that name one.
NOBODY = 0xFFFFFFFF


def __dir__() -> list[str]:
    return sorted(__all__)


@dataclasses.dataclass(frozen=True)
class Heard:
    """What all robots heard since the last step: one entry for each delivery, by receiver and then by sender's time.

    Positions and velocities are those of the senders' payloads. A class with `payloads` of its own finds the bytes in
    `payload`, and `position_m` and `velocity_mps` are not numbers.

    Attributes
    ----------
    n : int
        Number of robots.
    receiver : numpy.ndarray
        Number of the robot that heard it.
    sender : numpy.ndarray
        Number of the robot that said it.
    position_m : numpy.ndarray
        Where the sender was (m): one row of x, y, z for each delivery.
    velocity_mps : numpy.ndarray
        How the sender moved (m/s): one row for each delivery.
    age_s : numpy.ndarray
        How long ago its transmission began (s).
    rssi_dbm : numpy.ndarray
        Received signal strength (dBm); not a number where the network does not tell.
    payload : list of bytes
        What was said; empty where robots say their position and velocity.
    """

    n: int
    receiver: np.ndarray
    sender: np.ndarray
    position_m: np.ndarray
    velocity_mps: np.ndarray
    age_s: np.ndarray
    rssi_dbm: np.ndarray
    payload: list[bytes]

    def of(self, robot: int) -> Heard:
        """Returns what one robot heard.

        Parameters
        ----------
        robot : int
            Number of the robot.

        Returns
        -------
        Heard
            Its deliveries.
        """
        first, last = np.searchsorted(self.receiver, [robot, robot + 1])
        own = slice(first, last)
        columns = {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name != "n"}
        short = {name: column[own] for name, column in columns.items()}
        return Heard(n=self.n, **short)

    def count(self) -> np.ndarray:
        """Counts the transmissions that each robot heard.

        Returns
        -------
        numpy.ndarray
            One number for each robot.
        """
        return np.bincount(self.receiver, minlength=self.n)

    def mean_position_m(self, otherwise_m: np.ndarray) -> np.ndarray:
        """Returns the mean of the positions that each robot heard.

        Parameters
        ----------
        otherwise_m : numpy.ndarray
            Positions (m) for robots that heard nobody: n rows of x, y or x, y, z.

        Returns
        -------
        numpy.ndarray
            Positions (m), with the shape of `otherwise_m`.

        Raises
        ------
        ValueError
            The robots say payloads of their own, which the package cannot read.
        """
        if self.payload:
            raise ValueError("mean_position_m needs positions, but these robots override payloads: decode heard.payload instead")
        otherwise_m = np.asarray(otherwise_m, dtype=float)
        total, counts = np.zeros_like(otherwise_m), self.count()
        np.add.at(total, self.receiver, self.position_m[:, : otherwise_m.shape[1]])
        mean = total / np.maximum(counts, 1)[:, None]
        return np.where(counts[:, None] > 0, mean, otherwise_m)


class Unsupported(_serving.Refused):
    """Raise it in `reset` or `predict` for a configuration or for commands that your robots do not execute.

    The user is shown its text, and the run or the comparison ends.

    Parameters
    ----------
    text : str
        What is not supported, and what is.
    """

    def __init__(self, text: str) -> None:
        super().__init__(grpc.StatusCode.INVALID_ARGUMENT, text)


# Names of what a recorded robot was commanded, by the contract's numbers.
COMMANDS = {
    robotsim_pb2.MOTION_COMMAND_KIND_VELOCITY: "velocity",
    robotsim_pb2.MOTION_COMMAND_KIND_SPEED_AND_YAW_RATE: "speed and yaw rate",
    robotsim_pb2.MOTION_COMMAND_KIND_SPEED_AND_STEERING: "speed and steering",
}
# Most commands and most time (ns) of all windows of a request.
MOST_COMMANDS, MOST_TIME_NS = 20_000, 100_000_000_000_000
LATEST_START_NS, LARGEST_NUMBER = 10**18, 1e12


@dataclasses.dataclass(frozen=True)
class Window:
    """A recorded robot that starts in a known state and executes known commands, one after the other.

    Attributes
    ----------
    robot : int
        Its number in the recording.
    start_s : float
        Time of the experiment at which it starts (s).
    position_m : numpy.ndarray
        Where it starts (m): x, y, z.
    heading_rad : float
        Which way it faces at the start (rad, from x towards y); 0 where that was not measured.
    velocity_mps : numpy.ndarray or None
        How it moves at the start (m/s), or None: it has executed the first command for long.
    commands : str
        What the columns of `command` are: "velocity" (m/s: east, north, up), "speed and yaw rate" (m/s, rad/s, 0) or "speed and
        steering" (m/s, rad, 0).
    duration_s : numpy.ndarray
        How long each command holds (s).
    command : numpy.ndarray
        One row of three numbers for each command.
    config : dict
        The section [robotsim] that is compared.
    site : dict
        The section [site].
    """

    robot: int
    start_s: float
    position_m: np.ndarray
    heading_rad: float
    velocity_mps: np.ndarray | None
    commands: str
    duration_s: np.ndarray
    command: np.ndarray
    config: dict[str, Any]
    site: dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Motes:
    """How the motes of all robots stand in the network. Each column has one entry for each robot.

    Attributes
    ----------
    alive : numpy.ndarray
        Whose radio works.
    synced : numpy.ndarray
        Who is synchronised; all of those whose radio works where the network has no such state.
    joined : numpy.ndarray
        Who has joined; all of those whose radio works where the network has no such state.
    rank : numpy.ndarray or None
        Routing rank (RFC 6550); None where the network has no routing.
    parent : numpy.ndarray or None
        Preferred parent, -1 where there is none; None where the network has no routing.
    queue_length : numpy.ndarray or None
        Packets waiting; None where the network has no queues.
    """

    alive: np.ndarray
    synced: np.ndarray
    joined: np.ndarray
    rank: np.ndarray | None
    parent: np.ndarray | None
    queue_length: np.ndarray | None


def mote_states(motes: Any, n: int) -> Motes:
    """The motes' states of a message of the contract."""
    alive = _serving.flags(motes.alive, n, "motes.alive")
    synced = _serving.flags(motes.synced, n, "motes.synced") if motes.synced else alive
    joined = _serving.flags(motes.joined, n, "motes.joined") if motes.joined else alive
    columns = {}
    for name, kind in (("rank", "<u4"), ("parent", "<u4"), ("queue_length", "<u4")):
        column = np.array(getattr(motes, name), dtype=kind).astype(np.int64)
        if len(column) not in (0, n):
            raise _serving.invalid(f"motes.{name}: must have {n} entries, got {len(column)}")
        columns[name] = column if len(column) else None
    if columns["parent"] is not None:
        columns["parent"][columns["parent"] == NOBODY] = -1
    return Motes(alive, synced, joined, **columns)


def decoded(n: int, columns: _serving.Columns | None, rssi_dbm: Any, now_ns: int, *, says_state: bool) -> Heard:
    """What `n` robots heard, from the columns of a message of the contract; ages are those at `now_ns`.

    With `says_state` payloads are positions and velocities, and others are left out.
    """
    if columns is None or len(columns.sender) == 0:
        nobody, none = np.zeros(0, dtype=np.int64), np.zeros(0)
        return Heard(n, nobody, nobody, none.reshape(0, 3), none.reshape(0, 3), none, none, [])
    receivers, which = columns.pairs(n)
    strength_dbm = np.array(rssi_dbm, dtype=float)
    if len(strength_dbm) not in (0, len(which)):
        raise _serving.invalid(f"rssi_dbm: must have {len(which)} entries, got {len(strength_dbm)}")
    if len(strength_dbm) == 0:
        strength_dbm = np.full(len(which), np.nan)
    lengths, data, said = columns.length_bytes, columns.data, []
    if not says_state:
        ends = np.cumsum(lengths, dtype=np.int64).tolist()
        each = [data[end - length : end] for end, length in zip(ends, lengths.tolist())]
        said, states = [each[place] for place in which.tolist()], np.full((len(which), 6), np.nan)
    elif len(data) == STATE_BYTES * len(lengths) and np.all(lengths == STATE_BYTES):
        states = np.frombuffer(data, dtype="<f8").reshape(-1, 6).take(which, axis=0)
    else:
        # Robots that say where they are hear nothing else: what has another form is of no use to them.
        of_form = lengths == STATE_BYTES
        all_bytes = np.frombuffer(data, dtype=np.uint8)[np.repeat(of_form, lengths)]
        states = np.full((len(lengths), 6), np.nan)
        states[of_form] = np.frombuffer(all_bytes.tobytes(), dtype="<f8").reshape(-1, 6)
        kept = of_form[which]
        receivers, which, strength_dbm = receivers[kept], which[kept], strength_dbm[kept]
        states = states[which]
    age_s = (now_ns - columns.sent_ns.astype(np.int64)[which]) / 1e9
    senders = columns.sender.astype(np.int64)[which]
    return Heard(n, receivers, senders, states[:, :3], states[:, 3:], age_s, strength_dbm, said)


def said_states(positions_m: np.ndarray, velocities_mps: np.ndarray) -> Any:
    """Payloads in which all robots say their position and velocity (three columns each)."""
    data = np.hstack([positions_m, velocities_mps]).astype("<f8", copy=False).tobytes()
    return common_pb2.Payloads(length_bytes=[STATE_BYTES] * len(positions_m), data=data)


class Robots:
    """Base class of a robot simulator. Override `reset` and `step`.

    Everything random must come from the seed of `reset`: then the same seed gives the same recording.

    Attributes
    ----------
    name : str or None
        Name in messages and records; else that of the class.
    version : str
        Version in records.
    config : dict
        The section [robotsim] of the experiment, before `reset` is called.
    site : dict
        The section [site]: walls, obstacles, ground.
    time_s : float
        Time of the experiment at the beginning of the present step (s).
    task_complete : bool
        Set to true when the task is done.
    motes : Motes or None
        How the motes stood in the network when the present step began; None in the first step, and where the network does not tell.
    heading_rad : numpy.ndarray or None
        Direction that each body faces (rad, from x towards y), if bodies have one.
    """

    name: str | None = None
    version = "1"
    config: dict[str, Any] = {}
    site: dict[str, Any] = {}
    time_s = 0.0
    task_complete = False
    motes: Motes | None = None
    heading_rad: np.ndarray | None = None

    def reset(self, seed: int, n: int) -> np.ndarray:
        """Begins an experiment.

        Parameters
        ----------
        seed : int
            Seed of all random draws.
        n : int
            Number of robots.

        Returns
        -------
        numpy.ndarray
            Their positions (m): n rows of x, y or x, y, z.
        """
        raise NotImplementedError

    def step(self, dt_s: float, heard: Heard) -> np.ndarray:
        """Moves all robots for a control period.

        Parameters
        ----------
        dt_s : float
            Duration of the period (s).
        heard : Heard
            What the robots have just heard.

        Returns
        -------
        numpy.ndarray
            Their positions at its end (m): n rows of x, y or x, y, z.
        """
        raise NotImplementedError

    def payloads(self) -> list[bytes] | None:
        """Returns what each robot says from now on. Optional.

        Returns
        -------
        list of bytes or None
            One entry for each robot; None: its position and velocity.
        """
        return None

    def figures(self) -> dict[str, float]:
        """Returns how far the task is. Optional.

        Returns
        -------
        dict
            Figures by name, in lower case with the unit as suffix. Those of the last step are in summary.json.
        """
        return {}

    def predict(self, window: Window) -> tuple[np.ndarray, np.ndarray | None]:
        """Predicts where the robot of a window gets to. Optional.

        With it `murmuration compare`, `diagnose` and `extend` compare this simulator with recorded tracks (`--robotsim URL`). The same
        window must give the same answer at any time: it may depend on nothing but the window, and must leave the running experiment
        as it is.

        Parameters
        ----------
        window : Window
            The robot's start, and its commands.

        Returns
        -------
        position_m : numpy.ndarray
            Positions at the end of each command (m): rows of x, y or x, y, z.
        heading_rad : numpy.ndarray or None
            Headings at the end of each command (rad). None where commands are velocities.

        Raises
        ------
        Unsupported
            These robots do not execute this configuration or these commands.
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
        """Puts a state back. `reset` has been called before with the seed and number of that experiment.

        Parameters
        ----------
        state : bytes
            What `snapshot` returned.
        """
        raise NotImplementedError


class _Service(_serving.Service, robotsim_pb2_grpc.RobotSimServiceServicer):
    """Serves `Robots` as the contract has it."""

    BASE = Robots
    CONFIGURE_REQUEST = robotsim_pb2.RobotSimServiceConfigureRequest
    STEP_REQUEST = robotsim_pb2.RobotSimServiceStepRequest
    STEP_RESPONSE = robotsim_pb2.RobotSimServiceStepResponse
    BARRIER_RESPONSE = robotsim_pb2.RobotSimServiceBarrierResponse
    SESSION_RESPONSE = robotsim_pb2.RobotSimServiceSessionResponse
    SNAPSHOT_RESPONSE = robotsim_pb2.RobotSimServiceSnapshotResponse
    RESTORE_RESPONSE = robotsim_pb2.RobotSimServiceRestoreResponse
    START_DIGEST = staticmethod(_digest.robots_start)
    STEP_DIGEST = staticmethod(_digest.robots_step)

    def __init__(self, robots: Robots) -> None:
        super().__init__(robots)
        self._predicting = threading.Lock()

    def Describe(self, request: Any, context: Any) -> Any:
        predictions = self.overrides("predict")
        return robotsim_pb2.RobotSimServiceDescribeResponse(**self.identity(), hold=True, predictions=predictions)

    def Predict(self, request: Any, context: Any) -> Any:
        return _serving.answered(context, self._predict, request)

    def start(self, request: Any) -> Any:
        robots = self.simulator
        robots.task_complete, robots.heading_rad, robots.motes = False, None, None
        self.positions_m = _faults.positions(robots.reset, robots.reset(request.seed, self.n), self.n)
        self.velocities_mps = np.zeros((self.n, 3))
        self._says_state = True
        columns = [common_pb2.DELIVERY_COLUMN_RSSI_DBM]
        return robotsim_pb2.RobotSimServiceConfigureResponse(states=self._states(), columns=columns)

    def advance(self, request: Any, dt_s: float) -> tuple[Any, bytes]:
        columns = _serving.Columns(request.deliveries) if request.HasField("deliveries") else None
        robots = self.simulator
        if request.hold:
            self.velocities_mps = np.zeros((self.n, 3))
        else:
            heard = decoded(self.n, columns, request.deliveries.rssi_dbm, self.time_ns, says_state=self._says_state)
            robots.motes = mote_states(request.motes, self.n) if request.HasField("motes") else None
            before_m = self.positions_m
            self.positions_m = _faults.positions(robots.step, robots.step(dt_s, heard), self.n)
            self.velocities_mps = (self.positions_m - before_m) / dt_s
        states = self._states()
        numbers = _faults.figures(robots.figures, robots.figures())
        figures = [common_pb2.TaskFigure(name=name, value=value) for name, value in numbers.items()]
        reply = robotsim_pb2.RobotSimServiceStepResponse(
            states=states, payloads=self._payloads(), held=request.hold,
            task_complete=bool(robots.task_complete) and not request.hold, figures=figures,
        )  # fmt: skip
        return reply, _serving.digest_bytes(request.step, request.until_ns, states.alive, self.positions_m, columns)

    def kept(self) -> list[bytes]:
        robots = self.simulator
        headings = b"" if robots.heading_rad is None else np.asarray(robots.heading_rad, dtype="<f8").tobytes()
        flags = bytes([self._says_state, bool(robots.task_complete), robots.heading_rad is not None])
        return [self.positions_m.astype("<f8").tobytes(), self.velocities_mps.astype("<f8").tobytes(), headings, flags]

    def resume(self, kept: list[bytes]) -> None:
        positions, velocities, headings, flags = kept
        self.positions_m = np.frombuffer(positions, dtype="<f8").reshape(self.n, 3).copy()
        self.velocities_mps = np.frombuffer(velocities, dtype="<f8").reshape(self.n, 3).copy()
        self._says_state, self.simulator.task_complete = bool(flags[0]), bool(flags[1])
        self.simulator.heading_rad = np.frombuffer(headings, dtype="<f8").copy() if flags[2] else None

    def _predict(self, request: Any) -> Any:
        """Asks `predict` for one window after the other."""
        if not self.overrides("predict"):
            raise _serving.Refused(grpc.StatusCode.UNIMPLEMENTED, "predictions are not announced")
        windows = _windows(request)
        with self._predicting:
            predicted = [self._predicted(window, agent) for window, agent in zip(windows, request.windows)]
        return robotsim_pb2.RobotSimServicePredictResponse(windows=predicted)

    def _predicted(self, window: Window, message: Any) -> Any:
        predict = self.simulator.predict
        returned = predict(window)
        if not isinstance(returned, tuple) or len(returned) != 2:
            raise _faults.WrongResult(predict, f"two arrays, positions and headings (or None), got {type(returned).__name__}")
        position_m, heading_rad = returned
        n = len(window.command)
        position_m = np.array(position_m, dtype=float)
        if position_m.ndim != 2 or position_m.shape[0] != n or position_m.shape[1] not in (2, 3):
            raise _faults.WrongResult(predict, f"positions of shape ({n}, 2) or ({n}, 3), got {position_m.shape}")
        if position_m.shape[1] == 2:
            position_m = np.column_stack([position_m, np.full(n, window.position_m[2])])
        if heading_rad is None and window.commands != "velocity":
            raise _faults.WrongResult(predict, f"headings for commands of {window.commands}, got None")
        headings = np.zeros(0) if heading_rad is None else np.array(heading_rad, dtype=float)
        if heading_rad is not None and headings.shape != (n,):
            raise _faults.WrongResult(predict, f"{n} headings, got shape {headings.shape}")
        if not (np.all(np.isfinite(position_m)) and np.all(np.isfinite(headings))):
            raise _faults.WrongResult(predict, f"finite numbers, for robot {window.robot} from {window.start_s} s on it did not")
        x_m, y_m, z_m = position_m.T.tolist()
        return robotsim_pb2.PredictedWindow(agent=message.agent, x_m=x_m, y_m=y_m, z_m=z_m, heading_rad=headings.tolist())

    def _states(self) -> Any:
        headings = self.simulator.heading_rad
        if headings is not None and len(headings) != self.n:
            raise ValueError(f"heading_rad must have {self.n} entries, got {len(headings)}")
        return _serving.agent_states(self.positions_m, self.velocities_mps, headings)

    def _payloads(self) -> Any:
        said = self.simulator.payloads()
        self._says_state = said is None
        if said is None:
            return said_states(self.positions_m, self.velocities_mps)
        said = _faults.payloads(self.simulator.payloads, said, self.n)
        return common_pb2.Payloads(length_bytes=[len(one) for one in said], data=b"".join(said))


def _windows(request: Any) -> list[Window]:
    """The windows of a request to predict, in its order."""
    n_commands = sum(len(window.duration_ns) for window in request.windows)
    if n_commands > MOST_COMMANDS:
        raise _serving.Refused(grpc.StatusCode.RESOURCE_EXHAUSTED, f"windows: must have at most {MOST_COMMANDS} commands, got {n_commands}")
    time_ns = sum(sum(window.duration_ns) for window in request.windows)
    if time_ns > MOST_TIME_NS:
        raise _serving.Refused(grpc.StatusCode.RESOURCE_EXHAUSTED, f"windows: must last at most {MOST_TIME_NS} ns, got {time_ns} ns")
    if request.command_kind not in COMMANDS:
        raise _serving.invalid(f"command_kind: must be 1, 2 or 3, got {request.command_kind}")
    if not request.windows:
        raise _serving.invalid("windows: must have at least 1 entry, got 0")
    config, site = _serving.sections(request)
    return [_window(message, index, COMMANDS[request.command_kind], config, site) for index, message in enumerate(request.windows)]


def _window(message: Any, index: int, commands: str, config: dict[str, Any], site: dict[str, Any]) -> Window:
    durations_ns = np.array(message.duration_ns, dtype=np.uint64)
    if len(durations_ns) == 0 or np.any(durations_ns == 0):
        raise _serving.invalid(f"windows[{index}].duration_ns: must have at least one entry, all at least 1")
    columns = [message.command_first, message.command_second, message.command_third]
    if any(len(column) != len(durations_ns) for column in columns):
        raise _serving.invalid(f"windows[{index}]: command_first, _second and _third must have {len(durations_ns)} entries each")
    if message.start_ns > LATEST_START_NS:
        raise _serving.invalid(f"windows[{index}].start_ns: must be at most {LATEST_START_NS}, got {message.start_ns}")
    position_m = np.array([message.x_m, message.y_m, message.z_m])
    command = np.array(columns, dtype=float).T
    velocity = message.velocity
    velocity_mps = np.array([velocity.vx_mps, velocity.vy_mps, velocity.vz_mps]) if message.HasField("velocity") else None
    numbers = [position_m, [message.heading_rad], command.ravel(), [] if velocity_mps is None else velocity_mps]
    # Not a number is not smaller than anything.
    if not np.all(np.abs(np.concatenate(numbers)) <= LARGEST_NUMBER):
        raise _serving.invalid(f"windows[{index}]: numbers must be finite and at most {LARGEST_NUMBER:.0e} in magnitude")
    return Window(
        robot=message.agent, start_s=message.start_ns / 1e9, position_m=position_m, heading_rad=message.heading_rad,
        velocity_mps=velocity_mps, commands=commands, duration_s=durations_ns / 1e9, command=command, config=config, site=site,
    )  # fmt: skip


def serve(robots: Robots, address: str | None = None, *, block: bool = True) -> grpc.Server:
    """Serves a robot simulator until Ctrl-C.

    The variable MURMURATION_LISTEN takes precedence over `address`: the orchestrator sets it when `command` of an experiment
    file starts the program, and then ends the program with the run.

    Parameters
    ----------
    robots : Robots
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
    return _serving.serve(robotsim_pb2_grpc.add_RobotSimServiceServicer_to_server, _Service(robots), address, block=block)
