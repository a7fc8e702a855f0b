"""How robots move in training: the laws of the built-in robot simulator.

Point masses and double integrators are computed here, by the equations of docs/robots.md. Everything else (vehicles, contacts,
effects) is asked of a robot simulator that runs as a child process, one call a step. In both cases that process says where
robots begin, so that they begin where a run of the same seed has them.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from murmuration._child import Child
from murmuration._contract import common_pb2, robotsim_pb2
from murmuration._files import plain
from murmuration._program import InvalidInput
from murmuration.radio import read_files

SOURCE = "policy"


class Bodies:
    """The robots of an experiment. `position_m` and `velocity_mps` have n rows of x, y, z; velocities are means over the last step."""

    def __init__(self, robotsim: Mapping[str, Any], site: Mapping[str, Any], *, n: int, step_ns: int, folder: Path, action: str) -> None:
        self.n, self.step_ns = n, step_ns
        section = without_controllers(robotsim)
        self._request = robotsim_pb2.RobotSimServiceConfigureRequest(
            agent_count=n, step_ns=step_ns, coupling=common_pb2.COUPLING_SEQUENTIAL, site_toml=tomli_w.dumps(plain(site)),
            config_toml=tomli_w.dumps(plain(section)), files=read_files(section, folder, {}),
        )  # fmt: skip
        refuse(robotsim)
        self._child = Child("robotsim", robotsim_pb2)
        try:
            effective = self._configure(0)
        except BaseException:
            self._child.close()
            raise
        self.diameter_m = float(effective["diameter_m"])
        self.law = law(effective, action)
        self.limit = self.law.limit
        """Largest action: of each component, or of the whole (m/s or m/s²)."""

    def reset(self, seed: int) -> None:
        """Puts all robots where the scenario has them under this seed, at rest."""
        self._configure(seed)

    def move(self, dt_s: float, action: np.ndarray) -> None:
        """Moves all robots, who are asked for these velocities or accelerations (n rows of x, y, z), for `dt_s`."""
        self.law.move(self, dt_s, action)

    def close(self) -> None:
        """Ends the child process."""
        self._child.close()

    def _configure(self, seed: int) -> dict[str, Any]:
        self._request.seed = seed
        reply = self._child.call("Configure", self._request)
        self._step, self._time_ns = 0, 0
        self._take(reply.states)
        self.own_mps = self.velocity_mps.copy()
        return tomllib.loads(reply.effective_config_toml) if reply.effective_config_toml else {}

    def _take(self, states: Any) -> None:
        self.position_m = np.stack([np.array(column, dtype=float) for column in (states.x_m, states.y_m, states.z_m)], axis=1)
        columns = [np.array(column, dtype=float) for column in (states.vx_mps, states.vy_mps, states.vz_mps)]
        self.velocity_mps = np.stack(columns, axis=1) if len(columns[0]) else np.zeros((self.n, 3))
        self.heading_rad = np.array(states.heading_rad, dtype=float) if len(states.heading_rad) else None

    def ask(self, dt_s: float, velocity_mps: np.ndarray) -> None:
        """Lets the child move the robots."""
        orders = [
            common_pb2.AgentCommand(agent=agent, source=SOURCE, velocity=common_pb2.AgentCommand.Velocity(vx_mps=x, vy_mps=y, vz_mps=z))
            for agent, (x, y, z) in enumerate(velocity_mps.tolist())
        ]
        self._step, self._time_ns = self._step + 1, self._time_ns + round(dt_s * 1e9)
        request = robotsim_pb2.RobotSimServiceStepRequest(step=self._step, until_ns=self._time_ns, commands=orders)
        if self._step > 1:
            request.deliveries.SetInParent()
        self._take(self._child.call("Step", request).states)


class PointMass:
    """A velocity, reached at once: x += v dt, where v is the command within the speed cap."""

    def __init__(self, table: Mapping[str, Any]) -> None:
        self.limit = float(table["speed_cap_mps"])
        self.by_axis = table.get("cap", "norm") == "axis"

    def move(self, bodies: Bodies, dt_s: float, action: np.ndarray) -> None:
        velocity_mps = np.clip(action, -self.limit, self.limit) if self.by_axis else within(action, self.limit)
        bodies.position_m = bodies.position_m + velocity_mps * dt_s
        bodies.velocity_mps = velocity_mps


class DoubleIntegrator:
    """An acceleration a, held over the step: x += v dt + a dt²/2, v += a dt. A velocity u is commanded as a = (u - v) / dt."""

    def __init__(self, table: Mapping[str, Any], action: str) -> None:
        self.speed_cap_mps, self.acceleration_cap_mps2 = float(table["speed_cap_mps"]), float(table["acceleration_cap_mps2"])
        self.by_velocity = action == "velocity"
        self.limit = self.speed_cap_mps if self.by_velocity else self.acceleration_cap_mps2

    def move(self, bodies: Bodies, dt_s: float, action: np.ndarray) -> None:
        asked_mps2 = (within(action, self.speed_cap_mps) - bodies.own_mps) / dt_s if self.by_velocity else action
        acceleration_mps2 = within(asked_mps2, self.acceleration_cap_mps2)
        bodies.velocity_mps = bodies.own_mps + 0.5 * acceleration_mps2 * dt_s
        bodies.position_m = bodies.position_m + bodies.velocity_mps * dt_s
        bodies.own_mps = bodies.own_mps + acceleration_mps2 * dt_s


class Simulated:
    """Whatever the robot simulator makes of a commanded velocity."""

    def __init__(self, limit_mps: float) -> None:
        self.limit = limit_mps

    def move(self, bodies: Bodies, dt_s: float, action: np.ndarray) -> None:
        bodies.ask(dt_s, action)


def law(effective: Mapping[str, Any], action: str) -> PointMass | DoubleIntegrator | Simulated:
    """How the robots of this section [robotsim], its defaults filled in, move."""
    table = effective["dynamics"]
    kind = table["kind"]
    contacts = effective.get("contacts") or {}
    is_plain = not table.get("effect") and not effective.get("group") and contacts.get("kind", "count") == "count"
    if action == "acceleration":
        if kind != "double-integrator" or not is_plain:
            raise InvalidInput(
                'action: "acceleration" needs robotsim.dynamics.kind = "double-integrator" without effects, contacts or groups, got'
                f' "{kind}"; or use action="velocity"'
            )
        return DoubleIntegrator(table, action)
    if action != "velocity":
        raise InvalidInput(f'action: must be "velocity" or "acceleration", got {action!r}')
    if is_plain and kind == "point-mass":
        return PointMass(table)
    if is_plain and kind == "double-integrator":
        return DoubleIntegrator(table, action)
    caps = [group["dynamics"]["speed_cap_mps"] for group in effective.get("group", []) if "dynamics" in group]
    return Simulated(float(max([table["speed_cap_mps"], *caps])))


def within(vectors: np.ndarray, most: float) -> np.ndarray:
    """Rows shortened to a length."""
    lengths = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    longer = lengths > most
    if not longer.any():
        return vectors
    shortened = vectors.copy()
    shortened[longer] = vectors[longer] / lengths[longer, None] * most
    return shortened


def without_controllers(robotsim: Mapping[str, Any]) -> dict[str, Any]:
    """The section with robots that stay where they are unless they are ordered otherwise: a policy decides."""
    section = {key: value for key, value in robotsim.items() if key not in ("url", "controller", "knowledge", "memory")}
    if "group" in section:
        section["group"] = [{key: value for key, value in group.items() if key != "controller"} for group in section["group"]]
    return {**section, "controller": {"kind": "hold"}}


def refuse(robotsim: Mapping[str, Any]) -> None:
    """What an environment cannot do."""
    for key, why in (
        ("absence", "robots of an environment are there from the beginning to the end"),
        ("obstacle", "obstacles of an environment do not move"),
        ("localization", "robots of an environment know where they are"),
    ):
        if robotsim.get(key):
            raise InvalidInput(f"robotsim.{key}: is not supported in an environment: {why}; leave it out")
    tables = [robotsim, *robotsim.get("group", [])]
    effects = [effect for table in tables for effect in table.get("dynamics", {}).get("effect", [])]
    if any(effect.get("kind") == "localization" for effect in effects) or any("localization_sd_m" in table for table in tables):
        raise InvalidInput("robotsim: noise of measured positions is not supported in an environment; leave it out")
    if robotsim.get("knowledge", "heard") != "heard":
        raise InvalidInput('robotsim.knowledge: must be "heard" in an environment: agents observe what they heard')
