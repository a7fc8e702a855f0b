"""Robots that live in ROS 2 as a robot simulator of Murmuration: everything but ROS itself. node.py has that.

In each step the bridge publishes what each robot heard, and its velocity if the bridge has a control law, and lets the simulation
that moves the robots run for the period. Then it reads their poses from their odometry.
"""

import dataclasses
import json
import math
import threading
from typing import Protocol

import numpy as np

import murmuration.robots


@dataclasses.dataclass(frozen=True)
class Pose:
    """Where odometry has a robot, in its own odometry frame."""

    stamp_ns: int
    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float


def yaw_rad(x, y, z, w):
    """Heading of a unit quaternion, from +x towards +y."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


class Mirror:
    """The latest clock and odometry. ROS's thread writes them, and the bridge waits for them."""

    def __init__(self):
        self._changed = threading.Condition()
        self._clock_ns, self._poses = None, {}

    def clear(self):
        with self._changed:
            self._clock_ns, self._poses = None, {}

    def set_clock(self, clock_ns):
        with self._changed:
            self._clock_ns = clock_ns
            self._changed.notify_all()

    def set_pose(self, robot, pose):
        with self._changed:
            self._poses[robot] = pose
            self._changed.notify_all()

    def wait(self, n, clock_ns, odometry_ns, deadline_s):
        """Clock and poses of `n` robots, once the clock is at `clock_ns` and no odometry is older than `odometry_ns`.

        Raises TimeoutError, with what is missing, after `deadline_s` of wall time.
        """

        def missing():
            found = [] if self._clock_ns is not None and self._clock_ns >= clock_ns else [f"/clock at {clock_ns / 1e9:.3f} s (is at {self._clock_ns} ns)"]
            late = [robot for robot in range(n) if robot not in self._poses or self._poses[robot].stamp_ns < odometry_ns]
            return found + [f"odometry of robot {robot} from {odometry_ns / 1e9:.3f} s on" for robot in late]

        with self._changed:
            if not self._changed.wait_for(lambda: not missing(), deadline_s):
                raise TimeoutError(f"after {deadline_s:g} s there is no {'; no '.join(missing()[:5])}")
            return self._clock_ns, [self._poses[robot] for robot in range(n)]


class World(Protocol):
    """What the bridge needs of ROS, or of a test."""

    mirror: Mirror

    def begin(self, n: int) -> int:
        """Connects `n` robots and puts the simulation back to its start if it can.

        Returns the time (ns) up to which the simulation then runs, in which clock and odometry are published; 0 if it runs by itself.
        """

    def advance(self, dt_ns: int) -> None:
        """Lets the simulation run for that long, or does nothing where it runs by itself."""

    def say(self, robot: int, text: str) -> None:
        """Publishes what a robot heard."""

    def drive(self, robot: int, speed_mps: float, yaw_rate_radps: float) -> None:
        """Publishes a robot's velocity command."""


# Keys of [robotsim] and their defaults.
KEYS = {
    "law": "gather",  # "gather": to within keep_m of the middle of those heard; "none": other nodes publish cmd_vel
    "speed_mps": 0.5,
    "keep_m": 1.0,
    "deadline_s": 30.0,  # wall time to wait for clock and odometry
    "odometry_age_s": 0.1,  # odometry may be that much older than the clock
    "origin": [],  # x (m), y (m) and yaw (rad) of each robot's odometry frame; empty: all have one frame
}
TURN_GAIN_PER_S = 2.0


class Bridge(murmuration.robots.Robots):
    name = "ros2-bridge"

    def __init__(self, world):
        self.world = world

    def reset(self, seed, n):
        # The seed is the simulation's own affair: this one draws nothing.
        unknown = sorted(set(self.config) - set(KEYS) - {"url"})
        if unknown:
            raise ValueError(f"unknown keys in [robotsim]: {', '.join(unknown)}; known are {', '.join(KEYS)}")
        self.settings = KEYS | self.config
        if self.settings["law"] not in ("gather", "none"):
            raise ValueError(f'law: must be "gather" or "none", got {self.settings["law"]!r}')
        self.origin = np.array(self.settings["origin"] or [[0.0, 0.0, 0.0]] * n, dtype=float)
        if self.origin.shape != (n, 3):
            raise ValueError(f"origin: must have x, y and yaw for each of {n} robots")
        self.n, self.lag_s = n, 0.0
        self.target_ns, poses = self.world.mirror.wait(n, self.world.begin(n), 0, self.settings["deadline_s"])
        return self._place(poses)

    def step(self, dt_s, heard):
        for robot in range(self.n):
            own = heard.of(robot)
            self.world.say(robot, heard_json(own))
            if self.settings["law"] == "gather":
                self.world.drive(robot, *self._gather(robot, own))
        dt_ns = round(dt_s * 1e9)
        self.target_ns += dt_ns
        self.world.advance(dt_ns)
        oldest_ns = self.target_ns - round(self.settings["odometry_age_s"] * 1e9)
        clock_ns, poses = self.world.mirror.wait(self.n, self.target_ns, oldest_ns, self.settings["deadline_s"])
        self.lag_s = max(self.lag_s, (clock_ns - self.target_ns) / 1e9)
        return self._place(poses)

    def figures(self):
        """How far a simulation that runs by itself got beyond the end of a step, at most."""
        return {"lag_s": self.lag_s}

    def _place(self, poses):
        """Positions in the common frame; sets headings."""
        x, y, yaw = self.origin.T
        x_m, y_m = np.array([pose.x_m for pose in poses]), np.array([pose.y_m for pose in poses])
        self.heading_rad = yaw + np.array([pose.yaw_rad for pose in poses])
        self.position_m = np.column_stack(
            [x + np.cos(yaw) * x_m - np.sin(yaw) * y_m, y + np.sin(yaw) * x_m + np.cos(yaw) * y_m, [pose.z_m for pose in poses]]
        )
        return self.position_m

    def _gather(self, robot, own):
        """Speed (m/s) and yaw rate (rad/s) towards the middle of those heard."""
        if len(own.sender) == 0:
            return 0.0, 0.0
        way_m = own.position_m.mean(axis=0)[:2] - self.position_m[robot, :2]
        away_m = math.hypot(*way_m) - self.settings["keep_m"]
        if away_m <= 0.0:
            return 0.0, 0.0
        error_rad = math.remainder(math.atan2(way_m[1], way_m[0]) - self.heading_rad[robot], 2.0 * math.pi)
        return min(self.settings["speed_mps"], away_m) * max(0.0, math.cos(error_rad)), TURN_GAIN_PER_S * error_rad


def heard_json(own):
    """What one robot heard, as the text that its nodes receive: a list, one entry for each message."""
    entries = [
        {"from": int(sender), "position_m": place.tolist(), "velocity_mps": velocity.tolist(), "age_s": float(age_s),
         "rssi_dbm": None if math.isnan(rssi_dbm) else float(rssi_dbm)}
        for sender, place, velocity, age_s, rssi_dbm in zip(own.sender, own.position_m, own.velocity_mps, own.age_s, own.rssi_dbm)
    ]  # fmt: skip
    return json.dumps(entries)
