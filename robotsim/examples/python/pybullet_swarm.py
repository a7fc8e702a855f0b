"""Quadrotors in PyBullet, with thrust, attitude and collisions, that agree on a height by what they hear. pybullet_swarm.py [ADDRESS]

Needs the package murmuration (python/README.md) and pybullet.
"""

import sys

import numpy as np
import pybullet
from pybullet_utils import bullet_client

import murmuration.robots

TIMESTEP_S, GRAVITY_MPS2 = 1 / 240, 9.81
MASS_KG, RADIUS_M, HEIGHT_M = 0.5, 0.15, 0.05
# Inertia (kg m²) and drag (1/s) of a disc of that size with four rotors.
INERTIA_KGM2, DRAG_PER_S = (0.003, 0.003, 0.005), 0.2
TILT_CAP, THRUST_CAP_N, CLIMB_CAP_MPS = 0.5, 2.0 * MASS_KG * GRAVITY_MPS2, 1.0
# Angular acceleration (1/s²) per tilt and its damping (1/s): the attitude settles within about 0.2 s.
ATTITUDE_PER_S2, DAMPING_PER_S = 200.0, 25.0


class Quadrotors(murmuration.robots.Robots):
    """Keys of [robotsim]: speed_mps (1), spacing_m (1.5), spread_m (6), lowest_m (2), highest_m (8), mass_kg (0.5)."""

    def reset(self, seed, n):
        random = np.random.default_rng(seed)
        spread_m = self.config.get("spread_m", 6.0)
        # Places of a grid, so that no two robots begin inside each other.
        side = int(np.ceil(np.sqrt(n)))
        places = random.permutation(side * side)[:n]
        start_m = np.empty((n, 3))
        start_m[:, :2] = (np.column_stack([places % side, places // side]) / max(side - 1, 1) - 0.5) * max(spread_m, side)
        start_m[:, 2] = random.uniform(self.config.get("lowest_m", 2.0), self.config.get("highest_m", 8.0), n)
        self.mass_kg = self.config.get("mass_kg", MASS_KG)
        self.bullet = bullet = bullet_client.BulletClient(pybullet.DIRECT)
        bullet.setGravity(0, 0, -GRAVITY_MPS2)
        bullet.setTimeStep(TIMESTEP_S)
        bullet.createMultiBody(0, bullet.createCollisionShape(pybullet.GEOM_PLANE))
        shape = bullet.createCollisionShape(pybullet.GEOM_CYLINDER, radius=RADIUS_M, height=HEIGHT_M)
        self.body = [bullet.createMultiBody(self.mass_kg, shape, basePosition=place.tolist()) for place in start_m]
        for body in self.body:
            bullet.changeDynamics(body, -1, linearDamping=0, angularDamping=0, localInertiaDiagonal=INERTIA_KGM2, activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING)  # fmt: skip
        self.steps_due, self.contacts = 0.0, 0
        return self.look()[0]

    def step(self, dt_s, heard):
        wanted_mps = self.steer(heard)
        # A control period need not be a multiple of the engine's timestep: the fraction is carried over to the next period.
        self.steps_due += dt_s / TIMESTEP_S
        for _ in range(int(self.steps_due)):
            self.fly(wanted_mps)
            self.bullet.stepSimulation()
        self.steps_due -= int(self.steps_due)
        self.contacts += len(self.bullet.getContactPoints())
        return self.look()[0]

    def steer(self, heard):
        """Velocities (m/s): to the mean height of those heard, towards those who are far and away from those who are near."""
        position_m = self.look()[0]
        wanted = np.zeros_like(position_m)
        if len(heard.sender):
            way_m = heard.position_m - position_m[heard.receiver]
            away_m = np.linalg.norm(way_m[:, :2], axis=1, keepdims=True) + 1e-9
            pull = np.hstack([way_m[:, :2] / away_m * np.clip(away_m - self.config.get("spacing_m", 1.5), -1, 0.2), way_m[:, 2:]])
            np.add.at(wanted, heard.receiver, pull)
            wanted /= np.maximum(heard.count(), 1)[:, None]
        speed = np.linalg.norm(wanted[:, :2], axis=1, keepdims=True)
        wanted[:, :2] *= self.config.get("speed_mps", 1.0) / np.maximum(speed, self.config.get("speed_mps", 1.0))
        wanted[:, 2] = np.clip(wanted[:, 2], -CLIMB_CAP_MPS, CLIMB_CAP_MPS)
        return wanted

    def fly(self, wanted_mps):
        """Thrust and torque of one timestep: tilt for the acceleration that is wanted, level otherwise."""
        _, axes, velocity_mps, rate_radps = self.look()
        up = axes[:, :, 2]
        force = self.mass_kg * (2.0 * (wanted_mps - velocity_mps) + [0, 0, GRAVITY_MPS2])
        sideways = np.linalg.norm(force[:, :2], axis=1, keepdims=True)
        force[:, :2] *= np.minimum(1.0, TILT_CAP * np.abs(force[:, 2:]) / np.maximum(sideways, 1e-9))
        thrust_n = np.clip(np.sum(force * up, axis=1, keepdims=True), 0.0, THRUST_CAP_N)
        wanted_up = force / np.linalg.norm(force, axis=1, keepdims=True)
        # In the axes of the body, whose inertia differs from axis to axis.
        turn = np.einsum("nji,nj->ni", axes, ATTITUDE_PER_S2 * np.cross(up, wanted_up) - DAMPING_PER_S * rate_radps)
        torque_nm = np.einsum("nij,nj->ni", axes, INERTIA_KGM2 * turn)
        force_n = thrust_n * up - self.mass_kg * DRAG_PER_S * velocity_mps
        for body, force, torque, place in zip(self.body, force_n.tolist(), torque_nm.tolist(), self.place):
            self.bullet.applyExternalForce(body, -1, force, place, pybullet.WORLD_FRAME)
            self.bullet.applyExternalTorque(body, -1, torque, pybullet.WORLD_FRAME)

    def look(self):
        """Positions (m), axes of the bodies as columns, velocities (m/s) and turn rates (rad/s) of all."""
        poses = [self.bullet.getBasePositionAndOrientation(body) for body in self.body]
        speeds = np.array([self.bullet.getBaseVelocity(body) for body in self.body])
        self.place = [place for place, _ in poses]
        x, y, z, w = np.array([turned for _, turned in poses]).T
        axes = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                         [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                         [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])  # fmt: skip
        return np.array(self.place), axes.transpose(2, 0, 1), speeds[:, 0], speeds[:, 1]

    def figures(self):
        return {"height_spread_m": float(np.std(self.look()[0][:, 2])), "contacts": self.contacts}


if __name__ == "__main__":
    murmuration.robots.serve(Quadrotors(), sys.argv[1] if sys.argv[1:] else "127.0.0.1:50061")
