"""Measured robots whose physics is MuJoCo's: a rover with two driven wheels and an omnidirectional platform, each with three
effects hidden in its MJCF. Nothing here shares code with robotsim.

    mujoco_truth.py [ADDRESS]    serves the same robots as a robot simulator that predicts (robotsim contract)

The configuration of a served simulator is a truth of this module: `robot`, and the keys of hidden effects with their sizes.
"""

import dataclasses
import math
import random
import sys
from pathlib import Path

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python/src"))

import murmuration.robots

TIMESTEP_S = 0.004
SAMPLE_S = 0.1
WHEEL_RADIUS_M, TRACK_M, WHEEL_KV, ROVER_KG = 0.05, 0.2, 0.02, 1.0
# The ground gives way under the load: a wheel rolls as one of this radius.
ROLLING_RADIUS_M = 0.04977
PLATFORM_KV, PLATFORM_KG = 25.0, 1.0
SPEED_MPS, YAW_RATE_RADPS = 1.2, 1.2
# Commands of the rover change by at most this, so that its tyres hold: it accelerates by 4.3 m/s² at most.
SPEED_CHANGE_MPS, YAW_RATE_CHANGE_RADPS = 0.3, 0.8
# Robots are recorded one by one; their tracks begin this far apart (m).
APART_M = 20.0
NOISE_M, NOISE_RAD = 0.004, 0.003
SETTLE_S = 0.6

ROVER = """
<mujoco> <compiler angle="radian"/>
  <option timestep="{timestep}" integrator="implicitfast" gravity="{gravity_x} {gravity_y} {gravity_z}"/>
  <worldbody>
    <geom type="plane" size="1000 1000 1" friction="1"/>
    <site name="post" pos="0 0 {radius}"/>
    <body name="robot" pos="0 0 {radius}"> <freejoint/>
      <geom type="box" size="0.1 0.07 0.02" mass="{chassis_kg}"/>
      <geom type="sphere" size="0.02" pos="0.09 0 {skid_z}" mass="0.02" friction="{skid}" priority="1"/>
      <geom type="sphere" size="0.02" pos="-0.09 0 {skid_z}" mass="0.02" friction="0.001" priority="1"/>
      <site name="marker" pos="{marker} 0 0.05"/>
      {load}
      <body pos="0 {half_track} 0"> {left} </body>
      <body pos="0 -{half_track} 0"> {right} </body>
    </body>
  </worldbody>
  {tendon}
  <actuator> {motor_left} {motor_right} </actuator>
</mujoco>"""
WHEEL = """<joint name="{name}" axis="0 1 0" damping="{damping}" armature="0.0001"/>
  <geom type="ellipsoid" size="{radius} 0.02 {radius}" mass="0.06" friction="1"/>"""
GEARED = """<joint name="{name}" axis="0 1 0" damping="{damping}" armature="0.0001"/> <inertial pos="0 0 0" mass="0.01" diaginertia="1e-5 1e-5 1e-5"/>
  <body> <joint axis="0 1 0" limited="true" range="-{play} {play}" damping="0.00001"/>
    <geom type="ellipsoid" size="{radius} 0.02 {radius}" mass="0.06" friction="1"/> </body>"""
PLATFORM = """
<mujoco> <compiler angle="radian"/>
  <option timestep="{timestep}" integrator="implicitfast" gravity="{gravity_x} {gravity_y} {gravity_z}" density="{density}"/>
  <worldbody>
    <body name="robot">
      <joint name="x" type="slide" axis="{cos} {sin} 0" damping="{damping_x}" frictionloss="{rubbing}" stiffness="{stiffness}"/>
      <joint name="y" type="slide" axis="{minus_sin} {cos} 0" damping="{damping_y}" frictionloss="{rubbing}" stiffness="{stiffness}"/>
      <geom type="cylinder" size="0.15 0.1" mass="{chassis_kg}"/>
      <site name="marker"/>
      {load}
    </body>
  </worldbody>
  <actuator> {motor_left} {motor_right} </actuator>
</mujoco>"""
# A motor with a velocity servo, whose command passes a filter and a delay.
MOTOR = (
    '<general joint="{joint}" {filter} gainprm="{kv}" biastype="affine" biasprm="0 0 -{kv}" '
    'ctrllimited="true" ctrlrange="-{top} {top}" forcelimited="true" forcerange="-{force} {force}" {delay}/>'
)


@dataclasses.dataclass(frozen=True)
class Effect:
    """An effect that can be hidden in a robot: a key of its configuration, with sizes drawn uniformly from a range."""

    key: str
    low: float
    high: float
    names: frozenset
    """Effects of the catalogue that say this cause. Empty: no effect of the catalogue has its law."""
    signed: bool = False
    """The size has either sign."""


def effect(key, low, high, *names, signed=False):
    return Effect(key, low, high, frozenset(names), signed)


# Effects of the catalogue, and those that none of them describes. `mujoco_truth.py` decides what each is before anything is diagnosed.
CATALOGUED = {
    "rover": [
        effect("bearing_drag", 0.06, 0.2, "slip", "slip (turn)"),  # viscous, per gain of the servo
        effect("wheel_scale", 0.85, 0.96, "slip", "slip (turn)"),
        effect("track_scale", 1.06, 1.2, "slip (turn)"),
        effect("filter_s", 0.08, 0.3, "actuator-lag", "actuator-lag (turn)"),
        effect("delay_s", 0.08, 0.24, "dead-time", "dead-time (turn)"),
        effect("top_speed_mps", 0.7, 0.95, "speed-limit"),
        effect("grip_mps2", 0.8, 2.0, "acceleration-limit", "acceleration-limit (turn)"),  # by the motors' greatest torque
        effect("compass_rad", 0.04, 0.12, "heading-bias", signed=True),
        effect("unequal_wheels", 0.015, 0.04, "steering-bias", signed=True),
    ],
    "platform": [
        effect("bearing_drag", 0.06, 0.2, "slip"),
        effect("axes_rad", 0.04, 0.12, "heading-bias", signed=True),
        effect("filter_s", 0.08, 0.3, "actuator-lag"),
        effect("delay_s", 0.08, 0.24, "dead-time"),
        effect("tilt_rad", 0.05, 0.15, "wind"),
        effect("top_speed_mps", 0.6, 0.9, "speed-limit"),
        effect("grip_mps2", 0.8, 2.0, "acceleration-limit"),
        effect("water_kgpm3", 30.0, 90.0, "quadratic-drag"),
    ],
}
OUTSIDE = {
    "rover": [
        effect("marker_m", 0.05, 0.12),  # what is measured sits ahead of the axle: it swings out in turns
        effect("tilt_rad", 0.05, 0.12),  # drift along the heading alone, since tyres do not yield sideways
        effect("tether_npm", 0.1, 0.3),  # a spring to the place of the start
        effect("slosh_kg", 0.4, 1.0),  # a load on a spring, 1.3 Hz
        effect("play_rad", 0.1, 0.3),  # backlash between motor and wheel
        effect("skid", 0.2, 0.6),  # a skid that rubs on the ground in place of a caster
    ],
    "platform": [
        effect("stiffness_npm", 0.3, 1.0),  # a spring to the place of the start
        effect("slosh_kg", 0.4, 1.0),
        effect("rubbing_n", 1.5, 5.0, "dead-band"),  # dry friction: kin of the dead band, with another law
        effect("weak_axis", 0.08, 0.25),  # viscous, on one axis only
    ],
}


@dataclasses.dataclass(frozen=True)
class Truth:
    """A robot and what is hidden in it."""

    robot: str
    hidden: dict
    """Size by key."""
    names: dict
    """Names of the catalogue that say the cause, by key."""
    outside: str
    """The key that no effect of the catalogue describes."""

    def toml(self):
        """The configuration with which the robots of this module are those that were measured."""
        lines = ["[robotsim]", f'robot = "{self.robot}"', *(f"{key} = {size!r}" for key, size in self.hidden.items())]
        return "\n".join(lines) + "\n"


def drawn(robot, seed):
    """Two effects of the catalogue that share no name, and one from outside."""
    rng = random.Random(f"{robot} {seed}")
    first = rng.choice(CATALOGUED[robot])
    second = rng.choice([one for one in CATALOGUED[robot] if not one.names & first.names])
    outside = rng.choice([one for one in OUTSIDE[robot] if one.key not in (first.key, second.key)])
    chosen = (first, second, outside)
    sizes = {one.key: round(rng.uniform(one.low, one.high) * (rng.choice((-1, 1)) if one.signed else 1), 4) for one in chosen}
    if "tilt_rad" in sizes:
        sizes["downhill_rad"] = round(rng.uniform(-3.1, 3.1), 4)
    names = {one.key: set(one.names) for one in chosen}
    return Truth(robot, sizes, names, outside.key)


class Robot:
    """One robot of a configuration, alone in its world."""

    KEYS = {"robot", "downhill_rad"} | {one.key for lists in (CATALOGUED, OUTSIDE) for robot in lists.values() for one in robot}

    def __init__(self, config):
        unknown = sorted(set(config) - self.KEYS)
        if unknown or config.get("robot") not in ("rover", "platform"):
            raise murmuration.robots.Unsupported(f'robot: must be "rover" or "platform"; unknown keys: {", ".join(unknown) or "none"}')
        self.is_rover = config["robot"] == "rover"
        get = config.get
        kv, kg = (WHEEL_KV, ROVER_KG) if self.is_rover else (PLATFORM_KV, PLATFORM_KG)
        # Speed (m/s) per unit of the actuators' commands, as the robot's maker believes it.
        self.per_unit = ROLLING_RADIUS_M if self.is_rover else 1.0
        tilt_rad, downhill_rad = get("tilt_rad", 0.0), get("downhill_rad", 0.0)
        slosh_kg = min(get("slosh_kg", 0.0), 0.9 * kg) if self.is_rover else get("slosh_kg", 0.0)
        force = get("grip_mps2", 1e3) * (kg * WHEEL_RADIUS_M / 2 if self.is_rover else kg)
        settings = {
            "timestep": TIMESTEP_S,
            "gravity_x": 9.81 * math.sin(tilt_rad) * math.cos(downhill_rad),
            "gravity_y": 9.81 * math.sin(tilt_rad) * math.sin(downhill_rad),
            "gravity_z": -9.81 * math.cos(tilt_rad),
            "chassis_kg": kg - (0.16 if self.is_rover else 0.0),
            "density": get("water_kgpm3", 0.0),
            "load": self.loads(slosh_kg),
            "marker": get("marker_m", 0.0),
            "skid": get("skid", 0.001),
        }
        motors = {"kv": kv, "top": get("top_speed_mps", 1e3) / self.per_unit, "force": force}
        motors["filter"] = f'dyntype="filter" dynprm="{get("filter_s")}"' if "filter_s" in config else ""
        # The newest of so many commands is one step old.
        delay_s = get("delay_s", 0.0)
        motors["delay"] = f'delay="{delay_s}" nsample="{math.ceil(delay_s / TIMESTEP_S) + 2}"' if delay_s else ""
        if self.is_rover:
            text = self.rover(config, settings, kv)
            joints = ("left", "right")
        else:
            axes_rad = get("axes_rad", 0.0)
            drag = get("bearing_drag", 0.0) * kv
            text = PLATFORM.format(
                **settings, cos=math.cos(axes_rad), sin=math.sin(axes_rad), minus_sin=-math.sin(axes_rad), damping_x=drag, damping_y=drag + get("weak_axis", 0.0) * kv,
                rubbing=get("rubbing_n", 0.0), stiffness=get("stiffness_npm", 0.0),
                motor_left=MOTOR.format(joint="x", **motors), motor_right=MOTOR.format(joint="y", **motors),
            )  # fmt: skip
            joints = ("x", "y")
        if self.is_rover:
            text = text.replace("MOTORS", " ".join(MOTOR.format(joint=joint, **motors) for joint in joints))
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        self.site = self.model.site("marker").id
        self.compass_rad, self.marker_m = get("compass_rad", 0.0), get("marker_m", 0.0)
        # The post of a tether and the middle of a spring are where the robot of number i began.
        self.middle_m = np.zeros(2)

    @staticmethod
    def loads(slosh_kg):
        """A load that slides on springs, at 1.3 Hz and a tenth of the critical damping."""
        if not slosh_kg:
            return ""
        rate = 2 * math.pi * 1.3
        spring = f'stiffness="{slosh_kg * rate**2}" damping="{2 * 0.1 * slosh_kg * rate}"'
        joints = "".join(f'<joint type="slide" axis="{axis}" {spring}/>' for axis in ("1 0 0", "0 1 0"))
        geom = f'<geom type="sphere" size="0.02" mass="{slosh_kg}" contype="0" conaffinity="0"/>'
        return f'<body pos="0 0 0.02"> {joints} {geom} </body>'

    @staticmethod
    def rover(config, settings, kv):
        get = config.get
        radius = WHEEL_RADIUS_M * get("wheel_scale", 1.0)
        wheel = GEARED if "play_rad" in config else WHEEL
        common = {"damping": get("bearing_drag", 0.0) * kv, "play": get("play_rad", 0.0)}
        unequal = get("unequal_wheels", 0.0) / 2
        left, right = (
            wheel.format(name=name, radius=radius * (1 + share), **common) for name, share in (("left", -unequal), ("right", unequal))
        )
        tether = get("tether_npm")
        tendon = ""
        if tether:
            tendon = (
                f'<tendon> <spatial stiffness="{tether}" springlength="0"> <site site="post"/> <site site="tied"/> </spatial> </tendon>'
            )
            settings["load"] += '<site name="tied" pos="0 0 0"/>'
        return ROVER.format(
            **settings, radius=radius, half_track=TRACK_M / 2 * get("track_scale", 1.0), skid_z=0.02 - radius + 0.0005,
            left=left, right=right, tendon=tendon, motor_left="MOTORS", motor_right="",
        )  # fmt: skip

    def command(self, command):
        """Gives a command: speed and yaw rate, or a velocity."""
        first, second = command[0], command[1]
        if self.is_rover:
            turn = second * TRACK_M / 2
            self.data.ctrl[:] = (first - turn) / self.per_unit, (first + turn) / self.per_unit
        else:
            self.data.ctrl[:] = first, second

    def run(self, duration_s):
        """For a time that is rounded to a whole number of steps."""
        mujoco.mj_step(self.model, self.data, nstep=round(duration_s / TIMESTEP_S))
        # A step leaves places of bodies as they were at its beginning.
        mujoco.mj_kinematics(self.model, self.data)

    def pose(self):
        """Where the robot is measured, without noise (m, m, rad)."""
        if not self.is_rover:
            return np.array([*(self.data.xpos[1][:2] + self.middle_m), 0.0])
        forward = self.data.xmat[1].reshape(3, 3)[:, 0]
        heading_rad = math.atan2(forward[1], forward[0]) + self.compass_rad
        return np.array([*(self.data.site_xpos[self.site][:2] + self.middle_m), heading_rad])

    def begin(self, pose, command, middle_m):
        """At a measured pose, having executed a command for long."""
        mujoco.mj_resetData(self.model, self.data)
        self.middle_m = np.asarray(middle_m, dtype=float)
        self.command(command)
        self.put(pose)
        self.run(SETTLE_S)
        self.put(pose)

    def put(self, pose):
        """Moves the robot to a measured pose; its speeds in its own axes, its loads and its motors stay as they are."""
        x_m, y_m = np.asarray(pose[:2]) - self.middle_m
        data = self.data
        mujoco.mj_kinematics(self.model, data)
        if not self.is_rover:
            # Joints count along their own axes.
            axes = data.xaxis[:2, :2]
            data.qpos[:2] = axes @ (x_m, y_m)
        else:
            heading_rad = pose[2] - self.compass_rad
            forward = data.xmat[1].reshape(3, 3)[:, 0]
            turn_rad = heading_rad - math.atan2(forward[1], forward[0])
            cos, sin = math.cos(turn_rad), math.sin(turn_rad)
            turned = np.zeros(4)
            mujoco.mju_mulQuat(turned, np.array([math.cos(turn_rad / 2), 0, 0, math.sin(turn_rad / 2)]), data.qpos[3:7])
            data.qpos[3:7] = turned
            data.qpos[:2] = x_m - self.marker_m * math.cos(heading_rad), y_m - self.marker_m * math.sin(heading_rad)
            # Linear velocities of a free joint are in the axes of the world, angular ones in those of the body.
            data.qvel[:2] = cos * data.qvel[0] - sin * data.qvel[1], sin * data.qvel[0] + cos * data.qvel[1]
        mujoco.mj_forward(self.model, data)


def middle_m(number):
    """Where the robot of a number begins."""
    return np.array([APART_M * number, 0.0])


def tracks(truth, seed, n_robots=2, n_samples=750):
    """Robot samples as CSV: new commands every 0.5 to 2 s, positions and headings measured with noise."""
    rng = random.Random(f"tracks {truth.robot} {seed}")
    is_rover = truth.robot == "rover"
    lines = ["time_s,agent,x_m,y_m," + ("heading_rad,cmd_speed_mps,cmd_yaw_rate_radps" if is_rover else "cmd_vx_mps,cmd_vy_mps")]
    robot = Robot({"robot": truth.robot, **truth.hidden})
    for number in range(n_robots):
        start = (*middle_m(number), rng.uniform(-3, 3) if is_rover else 0.0)
        robot.begin(start, (0.0, 0.0), middle_m(number))
        until, command = 0, (0.0, 0.0)
        for sample in range(n_samples):
            if sample == until:
                command = drawn_command(rng, is_rover, command, robot.pose()[:2] - middle_m(number))
                until += rng.randrange(5, 21)
            pose = robot.pose() + [rng.gauss(0, NOISE_M), rng.gauss(0, NOISE_M), rng.gauss(0, NOISE_RAD)]
            pose[2] = math.atan2(math.sin(pose[2]), math.cos(pose[2]))
            shown = [*pose[: 3 if is_rover else 2], *command]
            lines.append(f"{sample * SAMPLE_S:.1f},{number}," + ",".join(f"{value:.5f}" for value in shown))
            robot.command(command)
            robot.run(SAMPLE_S)
    return "\n".join(lines) + "\n"


def drawn_command(rng, is_rover, last, away_m):
    """At random: the rover's by a bounded change, the platform's rather towards the middle, so that it stays within metres."""
    if is_rover:
        speed_mps = abs(last[0] + rng.uniform(-SPEED_CHANGE_MPS, SPEED_CHANGE_MPS))
        yaw_rate_radps = last[1] + rng.uniform(-YAW_RATE_CHANGE_RADPS, YAW_RATE_CHANGE_RADPS)
        yaw_rate_radps = max(-YAW_RATE_RADPS, min(YAW_RATE_RADPS, yaw_rate_radps))
        return round(min(speed_mps, 2 * SPEED_MPS - speed_mps), 4), round(yaw_rate_radps, 4)
    towards = math.atan2(-away_m[1], -away_m[0])
    spread = math.pi if math.hypot(*away_m) < 3.0 else 1.0
    angle, speed_mps = towards + rng.uniform(-spread, spread), 0.0 if rng.random() < 0.1 else rng.uniform(0.05, SPEED_MPS)
    return round(speed_mps * math.cos(angle), 4), round(speed_mps * math.sin(angle), 4)


class Truths(murmuration.robots.Robots):
    """The robots of this module as a robot simulator that predicts recorded motion."""

    name = "mujoco_truth.py"

    def __init__(self):
        self.robots = {}

    def reset(self, seed, n):
        self.at_m = np.column_stack([np.arange(n) * APART_M, np.zeros(n)])
        return self.at_m

    def step(self, dt_s, heard):
        return self.at_m

    def predict(self, window):
        config = window.config
        wanted = {"rover": "speed and yaw rate", "platform": "velocity"}.get(config.get("robot"), window.commands)
        if window.commands != wanted:
            raise murmuration.robots.Unsupported(f"a {config['robot']} executes commands of {wanted}, not of {window.commands}")
        key = repr(sorted(config.items()))
        if key not in self.robots:
            self.robots = {key: Robot(config)}
        robot = self.robots[key]
        robot.begin((*window.position_m[:2], window.heading_rad), window.command[0], middle_m(window.robot))
        poses = []
        for duration_s, command in zip(window.duration_s, window.command):
            robot.command(command)
            robot.run(duration_s)
            poses.append(robot.pose())
        poses = np.array(poses)
        return poses[:, :2], np.unwrap(poses[:, 2]) if robot.is_rover else None


if __name__ == "__main__":
    murmuration.robots.serve(Truths(), sys.argv[1] if sys.argv[1:] else None)
