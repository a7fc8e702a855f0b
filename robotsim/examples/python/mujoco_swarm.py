"""Wheeled robots in MuJoCo, with mass, motors and contacts, that flock by what they hear. mujoco_swarm.py [ADDRESS]

Needs the package murmuration (python/README.md) and mujoco.
"""

import sys

import mujoco
import numpy as np

import murmuration.robots

WHEEL_RADIUS_M, TRACK_M, TIMESTEP_S = 0.05, 0.2, 0.005
ROBOT = """
<body name="robot{i}" pos="{x} {y} {z}" euler="0 0 {yaw}"> <freejoint/>
  <geom type="box" size="0.12 0.08 0.03" mass="1.5"/>
  <geom type="sphere" size="0.02" pos="0.09 0 -0.03" mass="0.05" friction="0.01" priority="1"/>
  <body pos="-0.04 0.1 0"> <joint name="left{i}" axis="0 1 0" damping="0.01" armature="0.001"/>
    <geom type="ellipsoid" size="0.05 0.015 0.05" mass="0.1" friction="1.0"/> </body>
  <body pos="-0.04 -0.1 0"> <joint name="right{i}" axis="0 1 0" damping="0.01" armature="0.001"/>
    <geom type="ellipsoid" size="0.05 0.015 0.05" mass="0.1" friction="1.0"/> </body>
</body>"""
MOTORS = '<velocity joint="left{i}" kv="0.2"/> <velocity joint="right{i}" kv="0.2"/>'
WORLD = """
<mujoco> <compiler angle="radian"/> <option timestep="{timestep}" integrator="implicitfast"/>
  <worldbody> <geom type="plane" size="100 100 1" friction="1.0"/> {robots} </worldbody>
  <actuator> {motors} </actuator>
</mujoco>"""


class Wheeled(murmuration.robots.Robots):
    """Keys of [robotsim]: speed_mps (0.5), spacing_m (1.5), spread_m (6), mass_kg (1.5)."""

    def reset(self, seed, n):
        random = np.random.default_rng(seed)
        spread_m = self.config.get("spread_m", 6.0)
        # Places of a grid, so that no two robots begin inside each other.
        side = int(np.ceil(np.sqrt(n)))
        places = random.permutation(side * side)[:n]
        start_m = (np.column_stack([places % side, places // side]) / max(side - 1, 1) - 0.5) * max(spread_m, 0.5 * side)
        self.model, self.data, self.body = world(start_m, random.uniform(-np.pi, np.pi, n), self.config)
        self.steps_due = 0.0
        return self.positions()

    def step(self, dt_s, heard):
        turning = self.steer(heard)
        speed_mps = self.config.get("speed_mps", 0.5)
        wheels_mps = np.column_stack([speed_mps - turning * TRACK_M / 2, speed_mps + turning * TRACK_M / 2])
        self.data.ctrl[:] = (wheels_mps / WHEEL_RADIUS_M).ravel()
        # A control period need not be a multiple of MuJoCo's timestep: the fraction is carried over to the next period.
        self.steps_due += dt_s / TIMESTEP_S
        mujoco.mj_step(self.model, self.data, nstep=int(self.steps_due))
        self.steps_due -= int(self.steps_due)
        if self.data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            raise ArithmeticError("the simulation of MuJoCo has become unstable")
        return self.positions()

    def steer(self, heard):
        """Turning rates (rad/s): towards those who are far, away from those who are near, and along with all."""
        n, spacing_m = len(self.body), self.config.get("spacing_m", 1.5)
        wanted = np.zeros((n, 2))
        if len(heard.sender):
            way_m = heard.position_m[:, :2] - self.positions()[heard.receiver, :2]
            away_m = np.linalg.norm(way_m, axis=1, keepdims=True) + 1e-9
            pull = way_m / away_m * np.tanh(away_m - spacing_m) + heard.velocity_mps[:, :2]
            np.add.at(wanted, heard.receiver, pull)
        yaw = self.heading_rad
        error = np.arctan2(wanted[:, 1], wanted[:, 0]) - yaw
        error = np.where(np.any(wanted != 0, axis=1), np.arctan2(np.sin(error), np.cos(error)), 0.0)
        return np.clip(2.0 * error, -3.0, 3.0)

    def positions(self):
        # A step leaves places of bodies as they were at its beginning.
        mujoco.mj_kinematics(self.model, self.data)
        forward = self.data.xmat[self.body].reshape(-1, 3, 3)[:, :, 0]
        self.heading_rad = np.arctan2(forward[:, 1], forward[:, 0])
        return self.data.xpos[self.body]

    def snapshot(self):
        state = np.empty(mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_INTEGRATION))
        mujoco.mj_getState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        return np.append(state, self.steps_due).tobytes()

    def restore(self, state):
        *state, self.steps_due = np.frombuffer(state)
        mujoco.mj_setState(self.model, self.data, np.array(state), mujoco.mjtState.mjSTATE_INTEGRATION)

    def predict(self, window):
        """One robot that executes recorded speeds and yaw rates, alone. Keys of [robotsim]: mass_kg; others have no influence."""
        if window.commands != "speed and yaw rate":
            raise murmuration.robots.Unsupported(f"these robots execute speed and yaw rate, not {window.commands}")
        model, data, (body,) = world(window.position_m[None, :2], [window.heading_rad], window.config)
        wheels_radps = (window.command[:, :1] + window.command[:, 1:2] * [-TRACK_M / 2, TRACK_M / 2]) / WHEEL_RADIUS_M
        # It has executed the first command for long: it moves, and its wheels turn.
        speed_mps, yaw_rate_radps = window.command[0, :2]
        forward = np.array([np.cos(window.heading_rad), np.sin(window.heading_rad)])
        data.qvel[:] = [*(speed_mps * forward), 0, 0, 0, yaw_rate_radps, *wheels_radps[0]]
        places, headings = [], []
        for duration_s, data.ctrl[:] in zip(window.duration_s, wheels_radps):
            mujoco.mj_step(model, data, nstep=round(duration_s / TIMESTEP_S))
            mujoco.mj_kinematics(model, data)
            x, y, _ = data.xmat[body].reshape(3, 3)[:, 0]
            places.append([*data.xpos[body, :2], window.position_m[2]])
            headings.append(np.arctan2(y, x))
        return np.array(places), np.unwrap(headings)


def world(start_m, yaws, config):
    """A world with a robot at each place: model, data, and the number of each robot's body."""
    robots = list(enumerate(zip(start_m, yaws)))
    bodies = [ROBOT.format(i=i, x=x, y=y, z=WHEEL_RADIUS_M, yaw=yaw) for i, ((x, y), yaw) in robots]
    text = WORLD.format(timestep=TIMESTEP_S, robots="".join(bodies), motors="".join(MOTORS.format(i=i) for i, _ in robots))
    model = mujoco.MjModel.from_xml_string(text)
    body = np.array([model.body(f"robot{i}").id for i, _ in robots])
    model.body_mass[body] *= config.get("mass_kg", 1.5) / 1.5
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data, body


if __name__ == "__main__":
    murmuration.robots.serve(Wheeled(), sys.argv[1] if sys.argv[1:] else "127.0.0.1:50061")
