"""Environments for learning policies, and their evaluation in recorded runs.

    from murmuration.env import evaluate, parallel_env

    env = parallel_env("configs/flocking.toml", reward={"polarisation": 1.0, "cohesion_m": -0.1})
    observations, infos = env.reset(seed=1)
    while env.agents:
        actions = policy(observations)
        observations, rewards, terminations, truncations, infos = env.step(actions)

    run = evaluate("configs/flocking.toml", policy, seed=1)

An environment is a `ParallelEnv` of PettingZoo. This process is the master of the network simulator and nothing is recorded;
`evaluate` runs the same policy under the orchestrator, with all that a run leaves. docs/training.md is the guide.
"""

from __future__ import annotations

import copy
import dataclasses
import json
import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pettingzoo

from murmuration import _program, _serving, robots
from murmuration._answers import Run
from murmuration._bodies import Bodies
from murmuration._commands import MOST_SEED, record
from murmuration._contract import robotsim_pb2_grpc
from murmuration._files import Config, config_file, private_folder, settings
from murmuration._metrics import FIGURES, Metrics, task_name
from murmuration._observation import Layout, Observer
from murmuration._program import InvalidInput, MurmurationError
from murmuration._terms import in_python_terms, whole_number
from murmuration.radio import Radio, Snapshot

__all__ = ["Layout", "Moment", "SwarmEnv", "evaluate", "parallel_env"]


def __dir__() -> list[str]:
    return sorted(__all__)


# Figures that the orchestrator does not measure with robots that are not its own: the robots say them.
OF_ROBOTS = ("collisions", "line_rms_m", "circle_rms_m")

Observations = dict[str, np.ndarray]
Policy = Callable[[Observations], Mapping[str, Any]]


@dataclasses.dataclass(frozen=True)
class Moment:
    """The end of a step, as a reward function sees it. Arrays have one row for each robot, of x, y, z.

    Attributes
    ----------
    time_s : float
        Time since the episode began (s).
    dt_s : float
        Duration of the step (s).
    position_m : numpy.ndarray
        Positions at the end of the step (m).
    velocity_mps : numpy.ndarray
        Mean velocities over the step (m/s).
    action : numpy.ndarray
        What was asked for (m/s or m/s²).
    heard : murmuration.robots.Heard
        Who heard whom in the step.
    motes : murmuration.robots.Motes or None
        How each mote stands in the network; None where it does not tell.
    figures : Mapping
        The figures that were asked for, by name. None: not defined in this step.
    """

    time_s: float
    dt_s: float
    position_m: np.ndarray
    velocity_mps: np.ndarray
    action: np.ndarray
    heard: robots.Heard
    motes: robots.Motes | None
    figures: Mapping[str, float | None]


Reward = Mapping[str, float] | str | Callable[[Moment], float | np.ndarray]


@in_python_terms
def parallel_env(
    config: Config, *, reward: Reward = "polarisation", figures: Sequence[str] = (), action: str = "velocity", neighbours: int = 8,
    dimensions: int = 2, **overrides: Any,
) -> SwarmEnv:  # fmt: skip
    """Makes an environment in which each robot of an experiment is an agent that observes what it heard.

    Parameters
    ----------
    config : str, os.PathLike or Mapping
        The experiment: a file (TOML), or a dictionary of the same form. `[robotsim.controller]` is not used: a policy acts.
    reward : str, Mapping or callable
        What all agents are given in each step: a figure of docs/metrics.md by name or by short name, a dictionary of figures and
        their weights, or a function of a `Moment` that returns a number or one for each robot.
    figures : sequence of str
        Further figures to measure. `infos` of the last step has all of the episode, under "task".
    action : {"velocity", "acceleration"}
        What actions are: velocities (m/s), or accelerations (m/s²) of double integrators. Limits are those of the body.
    neighbours : int
        For how many heard neighbours an observation has places, at least 1. The nearest take them.
    dimensions : {2, 3}
        Number of dimensions of positions, velocities and actions.
    **overrides
        Keys of the experiment with their values, two underscores in place of a dot: `experiment__agents=20`.

    Returns
    -------
    SwarmEnv
        The environment.

    Raises
    ------
    InvalidInput
        The experiment or an argument is invalid. The text names all problems.

    Examples
    --------
    >>> env = parallel_env("configs/flocking.toml", reward={"polarisation": 1.0, "cohesion_m": -0.1})
    >>> observations, infos = env.reset(seed=1)
    """
    return SwarmEnv(_Plan(config, overrides), reward, figures, action, neighbours, dimensions)


class SwarmEnv(pettingzoo.ParallelEnv):
    """The environment that `parallel_env` makes. Its simulators start with the first `reset` and end with `close`.

    Attributes
    ----------
    layout : Layout
        Where each quantity stands in an observation.
    dt_s : float
        The control period (s), which a step takes.
    possible_agents : list of str
        Names of all agents, "robot_0" and so on.
    agents : list of str
        Names of the agents of the present episode; none before `reset` and after its end.
    observation_spaces : dict
        The space of observations of each agent.
    action_spaces : dict
        The space of actions of each agent.
    """

    metadata = {"name": "murmuration_v0", "render_modes": [], "is_parallelizable": True}
    render_mode = None

    def __init__(
        self, plan: _Plan, reward: Reward, figures: Sequence[str], action: str, neighbours: int, dimensions: int
    ) -> None:  # fmt: skip
        self._plan = plan
        self.layout = plan.layout(neighbours, dimensions)
        self.dt_s = plan.step_ns / 1e9
        self._action = action
        self._weights, self._function = _reward(reward)
        self._figures = tuple(dict.fromkeys([*self._weights, *figures]))
        self._metrics = Metrics(self._figures, 0.0)
        self.possible_agents = [f"robot_{robot}" for robot in range(plan.n)]
        self.agents: list[str] = []
        self._bodies: Bodies | None = None
        self._radio: Radio | None = None
        self._formed: Snapshot | None = None
        limit = plan.limit(action)
        self._observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (self.layout.width,), np.float32)
        self._action_space = gymnasium.spaces.Box(-limit, limit, (dimensions,), np.float64)
        self.observation_spaces = {agent: copy.deepcopy(self._observation_space) for agent in self.possible_agents}
        self.action_spaces = {agent: copy.deepcopy(self._action_space) for agent in self.possible_agents}
        self._observer = plan.observer(self.layout)
        self._draws = np.random.default_rng(plan.seed)

    def observation_space(self, agent: str) -> gymnasium.Space:
        """Returns the space of an agent's observations.

        Parameters
        ----------
        agent : str
            Name of the agent.

        Returns
        -------
        gymnasium.Space
            Vectors of float32; `layout` says what is where.
        """
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.Space:
        """Returns the space of an agent's actions.

        Parameters
        ----------
        agent : str
            Name of the agent.

        Returns
        -------
        gymnasium.Space
            Vectors of float64 (m/s or m/s²) up to the limit of the body.
        """
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observations, dict[str, dict[str, Any]]]:
        """Begins an episode.

        Parameters
        ----------
        seed : int, optional
            Seed of all random draws: the same seed gives the same episode. By default each episode has another, drawn from the one
            before.
        options : dict, optional
            Not used.

        Returns
        -------
        observations : dict
            The observation of each agent.
        infos : dict
            An empty dictionary for each agent.
        """
        if seed is not None:
            self._draws = np.random.default_rng(seed)
        else:
            seed = int(self._draws.integers(1 << 63))
        bodies = self._started()
        bodies.reset(seed)
        self._begin_network(seed)
        self.agents = self.possible_agents[:]
        self._n_steps = 0
        self._metrics.reset()
        self._observer.reset()
        radio = self._radio
        seen = self._observer.observe(0.0, bodies.position_m, bodies.velocity_mps, None, radio.motes)
        return dict(zip(self.agents, seen)), {agent: {} for agent in self.agents}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[Observations, dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Moves all robots for a control period, then runs the network over their new positions.

        Parameters
        ----------
        actions : Mapping
            The action of each agent (m/s or m/s²).

        Returns
        -------
        observations : dict
            The observation of each agent.
        rewards : dict
            The reward of each agent.
        terminations : dict
            False for each agent.
        truncations : dict
            For each agent, whether the episode is over.
        infos : dict
            A dictionary for each agent; in the last step it has the figures of the episode under "task".

        Raises
        ------
        InvalidInput
            An action is missing or is not finite.
        MurmurationError
            No episode has begun, or it is over.
        """
        if not self.agents:
            raise MurmurationError("step: the episode is over, or none has begun: call reset")
        bodies, radio, agents = self._bodies, self._radio, self.agents
        asked = _asked(actions, agents, self.layout.dimensions)
        bodies.move(self.dt_s, asked)
        heard = radio.step(self.dt_s, bodies.position_m, velocity_mps=bodies.velocity_mps)
        self._n_steps += 1
        seen = self._observer.observe(self.dt_s, bodies.position_m, bodies.velocity_mps, heard, radio.motes)
        values = self._metrics.add(self.dt_s, bodies.position_m, bodies.velocity_mps, heard)
        rewards = self._rewards(values, asked, heard)
        is_over = self._n_steps >= self._plan.n_steps
        infos: dict[str, dict[str, Any]] = {agent: {} for agent in agents}
        if is_over:
            task = self._metrics.episode()
            infos = {agent: {"task": task} for agent in agents}
            self.agents = []
        return dict(zip(agents, seen)), rewards, dict.fromkeys(agents, False), dict.fromkeys(agents, is_over), infos

    def state(self) -> np.ndarray:
        """Returns positions and velocities of all robots, which no agent knows.

        Returns
        -------
        numpy.ndarray
            One row for each robot: x, y, z (m), then the velocity (m/s).
        """
        bodies = self._started()
        return np.hstack([bodies.position_m, bodies.velocity_mps])

    def figures(self) -> dict[str, float | None]:
        """Returns the figures of the episode so far.

        Returns
        -------
        dict
            Figures by name. None: not defined.
        """
        return self._metrics.episode()

    def close(self) -> None:
        """Ends the simulators."""
        for child in (self._bodies, self._radio):
            if child is not None:
                child.close()
        self._bodies = self._radio = self._formed = None
        self.agents = []

    def _started(self) -> Bodies:
        if self._bodies is None:
            self._bodies = self._plan.bodies(self._action)
        self._metrics.diameter_m = self._bodies.diameter_m
        return self._bodies

    def _begin_network(self, seed: int) -> None:
        """A network of this seed, formed if it is of a kind that forms."""
        plan, bodies = self._plan, self._bodies
        if self._formed is not None:
            self._radio.restore(self._formed, seed)
            return
        if self._radio is None:
            self._radio = plan.radio(seed)
        else:
            self._radio.configure(**plan.network(seed))
        radio = self._radio
        if radio.formed or not plan.waits:
            return
        if not radio.can_reseed:
            radio.form(bodies.position_m, limit_s=plan.formation_limit_s)
            return
        # Forming takes seconds: it is done once, under the experiment's seed and from its places whatever the episode's, and later
        # episodes go on from there.
        radio.configure(**plan.network(plan.seed))
        bodies.reset(plan.seed)
        radio.form(bodies.position_m, limit_s=plan.formation_limit_s)
        self._formed = radio.snapshot()
        bodies.reset(seed)
        radio.restore(self._formed, seed)

    def _rewards(self, values: Mapping[str, float | None], asked: np.ndarray, heard: robots.Heard) -> dict[str, float]:
        bodies, radio, agents = self._bodies, self._radio, self.agents
        if self._function is None:
            total = 0.0
            for name, weight in self._weights.items():
                value = values[name]
                total += 0.0 if value is None else weight * value
            return dict.fromkeys(agents, total)
        moment = Moment(
            self._n_steps * self.dt_s, self.dt_s, bodies.position_m, bodies.velocity_mps, asked, heard, radio.motes, values
        )
        given = np.asarray(self._function(moment), dtype=float)
        if given.shape not in ((), (len(agents),)):
            raise InvalidInput(f"reward: must return a number or {len(agents)} of them, got the shape {given.shape}")
        return dict(zip(agents, np.broadcast_to(given, len(agents)).tolist()))


@in_python_terms
def evaluate(
    config: Config, policy: Policy, seed: int | None = None, *, figures: Sequence[str] = (), action: str = "velocity", neighbours: int = 8,
    dimensions: int = 2, out: str | os.PathLike[str] = "runs", replace: bool = False, **overrides: Any,
) -> Run:  # fmt: skip
    """Runs an experiment whose robots follow a policy, and records it.

    The policy is called in a thread of this process. A fault in it ends the run, and its traceback is in the exception. Warnings are
    in the summary.

    Parameters
    ----------
    config : str, os.PathLike or Mapping
        The experiment: a file (TOML), or a dictionary of the same form. `[robotsim.controller]` is not used: the policy acts.
    policy : callable
        Takes the observations of all agents and returns their actions, as with `parallel_env`.
    seed : int, optional
        Seed of all random draws, from 0 to 2^63 - 1. By default that of the experiment.
    figures : sequence of str
        Figures for the summary's "task" beside those of motion: "collisions", "line_rms_m" or "circle_rms_m".
    action : {"velocity", "acceleration"}
        What actions are, as in `parallel_env`.
    neighbours : int
        For how many heard neighbours an observation has places, as in `parallel_env`.
    dimensions : {2, 3}
        Number of dimensions of positions, velocities and actions, as in `parallel_env`.
    out : str or os.PathLike
        Folder of results. The run gets a subfolder with the name of the experiment.
    replace : bool
        Replaces an earlier result of another configuration. By default the new result gets a folder beside it.
    **overrides
        Keys of the experiment with their values, two underscores in place of a dot.

    Returns
    -------
    Run
        The recorded run.

    Raises
    ------
    InvalidInput
        The experiment or an argument is invalid. The text names all problems.
    MurmurationError
        The run or the policy failed.
    """
    if seed is not None:
        seed = whole_number("seed", seed, 0, MOST_SEED)
    plan = _Plan(config, overrides)
    reported = {name: task_name(name) for name in figures}
    for name, figure in reported.items():
        if figure not in OF_ROBOTS:
            raise InvalidInput(f"figures: must be of {', '.join(OF_ROBOTS)}, got {name!r}; the summary has all others by itself")
    bodies = plan.bodies(action)
    metrics = Metrics(reported.values(), bodies.diameter_m)
    swarm = _Swarm(bodies, plan.observer(plan.layout(neighbours, dimensions)), metrics, policy)
    server = _serving.serve(
        robotsim_pb2_grpc.add_RobotSimServiceServicer_to_server, robots._Service(swarm), "127.0.0.1:0", block=False, quiet=True
    )
    try:
        options = ["--seed", str(plan.seed if seed is None else seed), "--robotsim", f"http://{server.murmuration_address}"]
        options += ["--out", os.fspath(out), *(["--replace"] if replace else [])]
        return record(config, options, overrides, progress=False, quiet=True)
    finally:
        server.stop(None)
        bodies.close()


class _Swarm(robots.Robots):
    """Robots that follow a policy."""

    name = "policy"

    def __init__(self, bodies: Bodies, observer: Observer, metrics: Metrics, policy: Policy) -> None:
        self._bodies, self._observer, self._metrics, self._policy = bodies, observer, metrics, policy
        self._agents = [f"robot_{robot}" for robot in range(bodies.n)]

    def reset(self, seed: int, n: int) -> np.ndarray:
        self._bodies.reset(seed)
        self._observer.reset()
        self._metrics.reset()
        self.heading_rad = self._bodies.heading_rad
        self._began = False
        return self._bodies.position_m

    def step(self, dt_s: float, heard: robots.Heard) -> np.ndarray:
        bodies = self._bodies
        # What is heard before the first step was heard while robots waited, and nobody said anything.
        given = heard if self._began else None
        seen = self._observer.observe(dt_s, bodies.position_m, bodies.velocity_mps, given, self.motes)
        self._began = True
        actions = self._policy(dict(zip(self._agents, seen)))
        bodies.move(dt_s, _asked(actions, self._agents, self._observer.layout.dimensions))
        self._metrics.add(dt_s, bodies.position_m, bodies.velocity_mps, heard)
        self.heading_rad = bodies.heading_rad
        return bodies.position_m

    def figures(self) -> dict[str, float]:
        return {name: value for name, value in self._metrics.episode().items() if value is not None}


def _asked(actions: Mapping[str, Any], agents: Sequence[str], dimensions: int) -> np.ndarray:
    """Actions as rows of x, y, z."""
    asked = np.zeros((len(agents), 3))
    try:
        asked[:, :dimensions] = [actions[agent] for agent in agents]
    except KeyError as error:
        raise InvalidInput(f"actions: there is none for {error.args[0]}") from None
    except ValueError as error:
        raise InvalidInput(f"actions: must be {dimensions} numbers for each agent: {error}") from None
    if not np.isfinite(asked).all():
        robot = int(np.flatnonzero(~np.isfinite(asked).all(axis=1))[0])
        raise InvalidInput(f"actions: must be finite, got {asked[robot, :dimensions].tolist()} for {agents[robot]}")
    return asked


def _reward(reward: Reward) -> tuple[dict[str, float], Callable[[Moment], float | np.ndarray] | None]:
    """Weights of figures, or a function."""
    if isinstance(reward, str):
        return {reward: 1.0}, None
    if isinstance(reward, Mapping):
        return {name: float(weight) for name, weight in reward.items()}, None
    if not callable(reward):
        raise InvalidInput(f"reward: must be the name of a figure, a dictionary of weights, or a function, got {reward!r}")
    return {}, reward


class _Plan:
    """An experiment as the program understands it."""

    def __init__(self, config: Config, overrides: Mapping[str, Any]) -> None:
        self.table = _merged(config, overrides)
        for key, why in (("timeline", "faults and traffic"), ("sweep", "several experiments")):
            if self.table.get(key):
                raise InvalidInput(f"{key}: {why} are not part of an environment; leave it out")
        experiment = self.table.get("experiment", {})
        if experiment.get("coupling", "sequential") != "sequential":
            raise InvalidInput('experiment.coupling: must be "sequential" in an environment')
        if experiment.get("control_period") == "packet":
            raise InvalidInput('experiment.control_period: must have a fixed length in an environment, got "packet"')
        self.netsim = dict(self.table.get("netsim", {}))
        if "url" in self.netsim:
            raise InvalidInput("netsim.url: an environment starts the built-in network; leave it out")
        self.robotsim = dict(self.table.get("robotsim", {}))
        self.folder = Path.cwd() if isinstance(config, Mapping) else Path(config).resolve().parent
        checked = _checked(config, overrides)
        self.n: int = checked["agents"]
        self.seed: int = checked["seed"]
        self.step_ns: int = checked["step_ns"]
        self.n_steps: int = checked["steps"]
        self.waits = experiment.get("start", "when-formed") == "when-formed"
        self.formation_limit_s = float(experiment.get("formation_limit_s", 3600.0))

    def bodies(self, action: str) -> Bodies:
        site = self.table.get("site", {})
        return Bodies(self.robotsim, site, n=self.n, step_ns=self.step_ns, folder=self.folder, action=action)

    def limit(self, action: str) -> float:
        """The largest action. The robot simulator alone knows it: it fills in defaults, and refuses what is wrong."""
        bodies = self.bodies(action)
        try:
            return bodies.limit
        finally:
            bodies.close()

    def network(self, seed: int) -> dict[str, Any]:
        """Arguments of `Radio.configure`."""
        return {"netsim": self.netsim, "n": self.n, "seed": seed, "period_s": self.step_ns / 1e9, "site": self.table.get("site")}

    def radio(self, seed: int) -> Radio:
        return Radio(**self.network(seed), folder=self.folder)

    def layout(self, neighbours: int, dimensions: int) -> Layout:
        if neighbours < 1:
            raise InvalidInput(f"neighbours: must be at least 1, got {neighbours}")
        if dimensions not in (2, 3):
            raise InvalidInput(f"dimensions: must be 2 or 3, got {dimensions}")
        return Layout(neighbours, dimensions)

    def observer(self, layout: Layout) -> Observer:
        memory = self.robotsim.get("memory") or {}
        return Observer(self.n, layout, float(memory.get("keep_s", 0.0)), bool(memory.get("extrapolate", True)))


def _merged(config: Config, overrides: Mapping[str, Any]) -> dict[str, Any]:
    """The experiment as a dictionary, with what is overridden."""
    if isinstance(config, Mapping):
        table = copy.deepcopy(dict(config))
    else:
        try:
            table = tomllib.loads(Path(config).read_text())
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise InvalidInput(f"{config}: {error}") from None
    for name, value in overrides.items():
        *path, last = name.split("__")
        at = table
        for key in path:
            at = at.setdefault(key, {})
            if not isinstance(at, dict):
                raise InvalidInput(f"{name.replace('__', '.')}: {key} is not a table")
        at[last] = value
    return table


def _checked(config: Config, overrides: Mapping[str, Any]) -> dict[str, Any]:
    """What `murmuration check` says of it; whatever is wrong with it is raised."""
    with config_file(config) as path, private_folder() as folder:
        file = folder / "check.json"
        # Whatever the controller is or lacks: a policy takes its place.
        hold = settings({"robotsim__controller": {"kind": "hold"}})
        _program.call(["check", path, "--json", file, *settings(overrides), *hold])
        return json.loads(file.read_text())
