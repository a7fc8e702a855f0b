"""Draws campaigns of accelerated bodies with one hidden effect, whose physics is MuJoCo's. Nothing here shares code with robotsim.

    mujoco_bodies.py --out FOLDER [--seed TEXT] [--count 60]    writes campaigns: data.csv, model.toml, truth.json
    mujoco_judge.py --out FOLDER --program PATH                 diagnoses them, and prints a table of outcomes

The truth of a campaign is fixed when it is drawn. Names that are right follow from what was put into MuJoCo. Names that are half right
say a part of it, or follow a law that these measurements do not distinguish from it, by the true accelerations and the noise (`Reference`).

A quadrotor here has its attitude controlled by servos about its axes. Moments of rotors, propeller drag and the ground are left out.
"""

import argparse
import csv
import dataclasses
import json
import math
import random
from pathlib import Path

import mujoco
import numpy as np

GRAVITY_MPS2 = 9.81
TIMESTEP_S = 0.005
SETTLE_S = 6.0
"""Before the first row: the pilot settles on its course."""
WINDOW_S = 1.0
"""The horizon over which `murmuration diagnose` predicts bodies, by default."""
ATTITUDE_RATE_S = 0.01
"""Time constant of the inner loop of attitude control."""
ARM_M = 0.25
BALL_M = 0.05
"""Radius of the ball that has all of a body's drag."""
AIR_KGPM3 = 1.2
APART_M = 40.0
HIGHEST_ACCELERATION_MPS2 = (3.0, 6.0)
"""What the pilot commands at most, in the plane and vertically, where it has to carry loads as well."""
JERK_MPS3 = 8.0
"""How fast commanded accelerations change at most, as those of a pilot who spares the rotors."""

KINDS = ("nothing", "push", "wind", "drag", "payload", "swinging-load", "dead-time", "lag", "attitude-bias", "rotor")
FREE_FLYERS = {"nothing", "push", "wind", "drag", "dead-time", "lag", "thrust-scale"}
"""What can be hidden in a body without gravity and attitude as well."""
WEAK_SHARE, HOVER_SHARE, SHORT_SHARE = 0.25, 0.12, 0.15
DESIGNS = ("waypoints", "sines", "cruise", "vertical")
MODEL_NATS = 2.0
INDISTINGUISHABLE_NATS = 3.0
DETECTABLE_NATS = 15.0
"""Log likelihood ratio against the configured model: the level of 0.5 %, with Holm's correction for 15 candidates, and then some."""


@dataclasses.dataclass(frozen=True)
class Campaign:
    """What is flown, and what is hidden in it. Lengths in m, times in s, masses in kg, angles in rad."""

    name: str
    kind: str
    plant: str
    """`free-flyer`: a force on a mass without weight. `quadrotor`: rotors and attitude control."""
    commands: str
    """`acceleration`, or `thrust` with attitude."""
    design: str
    excitation: float
    """Share of the greatest amplitudes of the design, 0 to 1."""
    weak: bool
    """The effect is drawn so small that it may not show."""
    hidden: dict
    """Size by key, with its unit."""
    robots: int
    rows: int
    """Of all robots together."""
    period_s: float
    noise_m: float
    """Standard deviation of each measured coordinate."""
    mass_kg: float
    """The robot's, as its maker believes."""
    lag_s: float
    """Time constant of thrust and attitude, as the maker believes. 0 of free flyers."""
    yaw_rad: float
    yaw_rate_radps: float
    seed: int

    def toml(self):
        """The maker's model, for `murmuration diagnose`."""
        if self.plant == "free-flyer":
            return '[robotsim.dynamics]\nkind = "double-integrator"\nacceleration_cap_mps2 = 20.0\n'
        keys = {"mass_kg": self.mass_kg, "attitude_lag_s": self.lag_s, "tilt_cap_rad": 1.2, "thrust_cap_weights": 5.0}
        return "\n".join(['[robotsim.dynamics]\nkind = "quadrotor"', *(f"{key} = {value}" for key, value in keys.items())]) + "\n"


def draw_campaign(seed, index):
    """Campaign number `index` of the set that a text names. All its numbers follow from a hash of both."""
    rng = random.Random(f"{seed} {index}")
    kind = KINDS[index % len(KINDS)]
    round_ = index // len(KINDS)
    if kind == "rotor":
        kind = ("rotor-loss", "thrust-scale")[round_ % 2]
    commands = ("acceleration", "thrust")[(round_ + index) % 2]
    is_free = commands == "acceleration" and kind in FREE_FLYERS and rng.random() < 0.6
    weak = kind != "nothing" and rng.random() < WEAK_SHARE
    period_s = rng.choice((0.02, 0.025, 0.04, 0.05))
    # A short campaign may be too little to tell anything. Others last for 40 s of all robots together.
    fewest_rows = 500 if rng.random() < SHORT_SHARE else 40 / period_s
    is_turning = commands == "thrust" and rng.random() < 0.5
    return Campaign(
        name=f"{index:02}-{kind}", kind=kind, plant="free-flyer" if is_free else "quadrotor", commands=commands,
        design="hover" if rng.random() < HOVER_SHARE else rng.choice(DESIGNS), excitation=round(rng.uniform(0.25, 1.0), 2),
        weak=weak, hidden=draw_sizes(kind, weak, is_free, rng), robots=rng.choice((1, 1, 2, 3)),
        rows=round(math.exp(rng.uniform(math.log(fewest_rows), math.log(4000)))), period_s=period_s,
        noise_m=round(math.exp(rng.uniform(math.log(0.002), math.log(0.02))), 4), mass_kg=round(rng.uniform(0.5, 3.0), 2),
        lag_s=0.0 if is_free else round(rng.uniform(0.05, 0.15), 3),
        yaw_rad=round(rng.uniform(-3, 3), 2) if commands == "thrust" else 0.0,
        yaw_rate_radps=round(rng.choice((-1, 1)) * rng.uniform(0.1, 0.6), 2) if is_turning else 0.0,
        seed=rng.getrandbits(63),
    )  # fmt: skip


def draw_sizes(kind, weak, is_free, rng):
    """What is hidden: keys with units, and sizes. Weak ones are a tenth to a thirtieth of the others; a rotor stops late, and wind
    is as strong but has less drag."""

    def size(low, high, digits=4):
        return round(rng.uniform(low, high) / (rng.uniform(10, 30) if weak else 1), digits)

    def drag():
        return {"linear_drag_per_s": size(0.08, 0.5)} if rng.random() < 0.5 else {"quadratic_drag_per_m": size(0.03, 0.15, 5)}

    angle_rad = round(rng.uniform(-3.1, 3.1), 3)
    if kind == "push":
        push_mps2 = size(0.15, 0.8)
        up_mps2 = round(rng.uniform(-0.5, 0.5) * push_mps2, 4)
        return {"push_mps2": [round(push_mps2 * math.cos(angle_rad), 4), round(push_mps2 * math.sin(angle_rad), 4), up_mps2]}
    if kind == "wind":
        speed_mps = rng.uniform(1.5, 6.0)
        return {"wind_mps": [round(speed_mps * math.cos(angle_rad), 3), round(speed_mps * math.sin(angle_rad), 3), 0.0], **drag()}
    if kind == "rotor-loss":
        # Of so many rotors, one stops after a share of the flight; control trims a share of the moment that this leaves.
        lost_at = rng.uniform(0.95, 0.98) if weak else rng.uniform(0.3, 0.7)
        return {"rotors": rng.choice((4, 6, 8)), "lost_at_share": round(lost_at, 3), "trimmed": round(rng.uniform(0.8, 1.0), 2)}
    if kind == "thrust-scale":
        return {"thrust_scale": round(1 + rng.choice((-1, -1, 1)) * size(0.05, 0.25), 4)}
    if kind == "lag":
        return {"lag_s": size(0.06, 0.3), "lags": "all" if is_free else rng.choice(("all", "thrust"))}
    return {
        "nothing": lambda: {},
        "drag": drag,
        "payload": lambda: {"payload_share": size(0.05, 0.4)},
        "swinging-load": lambda: {"load_share": size(0.1, 0.4), "rope_m": round(rng.uniform(0.4, 1.5), 2)},
        "dead-time": lambda: {"delay_s": size(0.04, 0.25)},
        "attitude-bias": lambda: {"tilt_rad": size(0.02, 0.09), "towards_rad": angle_rad},
    }[kind]()


SLIDES = "".join(f'<joint name="{axis}" type="slide" axis="{way}"/>' for axis, way in zip("xyz", ("1 0 0", "0 1 0", "0 0 1")))
HINGES = "".join(f'<joint name="{axis}" axis="{way}"/>' for axis, way in zip(("yaw", "pitch", "roll"), ("0 0 1", "0 1 0", "1 0 0")))


def mjcf(campaign):
    """The robot of a campaign as MuJoCo's XML, with everything that is hidden in it except pushes."""
    get, mass_kg = campaign.hidden.get, campaign.mass_kg
    is_free = campaign.plant == "free-flyer"
    option = {"timestep": TIMESTEP_S, "integrator": "RK4", "gravity": f"0 0 {0.0 if is_free else -GRAVITY_MPS2}"}
    # MuJoCo's drag of an ellipsoid: 6 pi r viscosity v, and density coefficient area v².
    blunt = get("quadratic_drag_per_m", 0.0) * mass_kg / (AIR_KGPM3 * math.pi * BALL_M**2)
    option["density"] = AIR_KGPM3 if blunt else 0.0
    option["viscosity"] = get("linear_drag_per_s", 0.0) * mass_kg / (6 * math.pi * BALL_M)
    option["wind"] = " ".join(map(str, get("wind_mps", (0, 0, 0))))
    delay_s = get("delay_s", 0.0)
    delay = f'delay="{delay_s}" nsample="{math.ceil(delay_s / TIMESTEP_S) + 2}"' if delay_s else ""
    lag_s = campaign.lag_s + get("lag_s", 0.0)
    filtered = f'dyntype="filter" dynprm="{lag_s}"' if lag_s else ""
    parts, scale = "", get("thrust_scale", 1.0)
    if "payload_share" in campaign.hidden:
        parts += f'<body> <geom type="sphere" size="0.01" mass="{get("payload_share") * mass_kg}"/> </body>'
    if "load_share" in campaign.hidden:
        load_kg, rope_m = get("load_share") * mass_kg, get("rope_m")
        # A rope that swings and does not spin. Its swing decays by a factor of e in ten seconds.
        hinges = "".join(f'<joint axis="{axis}" damping="{0.2 * load_kg * rope_m**2}"/>' for axis in ("1 0 0", "0 1 0"))
        parts += f"""<body> {hinges}
            <geom type="sphere" size="0.03" pos="0 0 -{rope_m}" mass="{load_kg}" contype="0" conaffinity="0"/> </body>"""
    if is_free:
        motors = "".join(f'<general joint="{axis}" gainprm="{scale}" {filtered} {delay}/>' for axis in "xyz")
    else:
        rotors, rotor_sites, motors = get("rotors", 4), "", ""
        tilt_rad, towards_rad = get("tilt_rad", 0.0), get("towards_rad", 0.0)
        axis = f"{-math.sin(towards_rad)} {math.cos(towards_rad)} 0 {tilt_rad}"
        for k in range(rotors):
            place = f"{ARM_M * math.cos(2 * math.pi * k / rotors)} {ARM_M * math.sin(2 * math.pi * k / rotors)} 0"
            rotor_sites += f'<site name="rotor{k}" pos="{place}" axisangle="{axis}"/>'
            motors += f'<general site="rotor{k}" gear="0 0 1 0 0 0" gainprm="{scale}" {filtered} {delay}/>'
        parts += rotor_sites
        inertia_kgm2 = inertia(campaign)
        attitude_s = campaign.lag_s + (get("lag_s", 0.0) if get("lags") == "all" else 0.0)
        kp, kv = inertia_kgm2 / (attitude_s * ATTITUDE_RATE_S), inertia_kgm2 / ATTITUDE_RATE_S
        for joint in ("yaw", "pitch", "roll"):
            motors += f'<general joint="{joint}" gainprm="{kp}" biastype="affine" biasprm="0 -{kp} -{kv}" {delay}/>'
    body_inertia = inertia(campaign)
    options = " ".join(f'{key}="{value}"' for key, value in option.items())
    return f"""<mujoco> <compiler angle="radian"/> <option {options}/> <worldbody>
      <body name="robot"> {SLIDES} {"" if is_free else HINGES}
        <inertial pos="0 0 0" mass="{mass_kg}" diaginertia="{body_inertia} {body_inertia} {body_inertia}"/>
        <geom type="sphere" size="{BALL_M}" mass="0" contype="0" conaffinity="0" fluidshape="ellipsoid" fluidcoef="{blunt} 0 0 0 0"/>
        {parts} </body>
      </worldbody> <actuator> {motors} </actuator> </mujoco>"""


def inertia(campaign):
    """The moment of inertia about each axis (kg m²)."""
    return 0.02 * campaign.mass_kg


class Pilot:
    """Commands accelerations that follow the course of a design, with feedback of its own noisy estimate of position and speed."""

    def __init__(self, campaign, rng):
        self.campaign, self.rng = campaign, rng
        size = campaign.excitation
        self.box_m = size * np.array([4.0, 4.0, 2.0])
        self.cruise_mps = size * rng.uniform(3.0, 7.0)
        self.rates = rng.uniform(0.8, 2.5, (2, 3))
        self.phases = rng.uniform(0, 2 * math.pi, (2, 3))
        self.amplitudes_m = size * np.array([1.2, 1.2, 0.8]) / self.rates**2
        self.goal_m, self.until_s = np.zeros(3), 0.0
        self.sum_m, self.asked_mps2 = np.zeros(3), np.zeros(3)

    def command(self, time_s, place_m, velocity_mps):
        """The acceleration from a place, relative to the course's middle (m/s², east, north, up)."""
        seen_m = place_m + self.rng.normal(0, 0.005, 3)
        seen_mps = velocity_mps + self.rng.normal(0, 0.02, 3)
        goal_m, goal_mps, forward_mps2 = self.course(time_s, seen_m)
        off_m = np.clip(goal_m - seen_m, -3.0, 3.0)
        self.sum_m = np.clip(self.sum_m + off_m * self.campaign.period_s, -20.0, 20.0)
        wanted = forward_mps2 + 1.6 * off_m + 1.8 * (goal_mps - seen_mps) + 0.3 * self.sum_m
        level_mps2, upright_mps2 = HIGHEST_ACCELERATION_MPS2
        wanted[:2] *= min(1.0, level_mps2 / max(1e-9, np.hypot(*wanted[:2])))
        wanted[2] = np.clip(wanted[2], -upright_mps2, upright_mps2)
        change_mps2 = wanted - self.asked_mps2
        self.asked_mps2 += change_mps2 * min(1.0, JERK_MPS3 * self.campaign.period_s / max(1e-9, np.linalg.norm(change_mps2)))
        return self.asked_mps2

    def course(self, time_s, seen_m):
        """Place, velocity and acceleration that the design demands now."""
        design = self.campaign.design
        if design == "sines":
            angles = self.rates * time_s + self.phases
            waves = (np.sin(angles), self.rates * np.cos(angles), -(self.rates**2) * np.sin(angles))
            return tuple((self.amplitudes_m * wave).sum(axis=0) for wave in waves)
        if design in ("waypoints", "vertical") and time_s >= self.until_s:
            self.until_s = time_s + self.rng.uniform(1.5, 4.0)
            self.goal_m = self.rng.uniform(-1, 1, 3) * self.box_m * ((0, 0, 2) if design == "vertical" else 1)
        if design == "cruise":
            if time_s >= self.until_s or np.linalg.norm(self.goal_m - seen_m) < self.cruise_mps:
                self.until_s = time_s + self.rng.uniform(6.0, 12.0)
                self.goal_m = self.rng.uniform(-1, 1, 3) * (30.0, 30.0, 3.0)
            way_m = self.goal_m - seen_m
            velocity_mps = self.cruise_mps * way_m / max(1e-9, np.linalg.norm(way_m))
            return seen_m, velocity_mps, np.zeros(3)
        return self.goal_m, np.zeros(3), np.zeros(3)


def attitude(acceleration_mps2, yaw_rad):
    """Thrust per mass (m/s²), roll and pitch (rad) that give an acceleration: yaw, then pitch nose down, then roll right side down."""
    force = np.asarray(acceleration_mps2) + (0, 0, GRAVITY_MPS2)
    thrust_mps2 = np.linalg.norm(force)
    east, north, up = force / thrust_mps2
    ahead, left = east * math.cos(yaw_rad) + north * math.sin(yaw_rad), north * math.cos(yaw_rad) - east * math.sin(yaw_rad)
    return thrust_mps2, -math.asin(left), math.atan2(ahead, up)


@dataclasses.dataclass
class Flight:
    """A flight of one robot, one row each sampling period, without noise of measurement."""

    time_s: np.ndarray
    place_m: np.ndarray
    velocity_mps: np.ndarray
    commands: np.ndarray
    """As in the columns of the file."""
    asked_mps2: np.ndarray
    """The acceleration that the commands ask for."""
    yaw_rad: np.ndarray


def fly(campaign, robot):
    """The flight of a robot, numbered from 0."""
    rng = np.random.default_rng([campaign.seed, robot])
    model = mujoco.MjModel.from_xml_string(mjcf(campaign))
    data = mujoco.MjData(model)
    is_free, get = campaign.plant == "free-flyer", campaign.hidden.get
    data.xfrc_applied[model.body("robot").id, :3] = campaign.mass_kg * np.array(get("push_mps2", (0, 0, 0)))
    n_rotors = model.nu - 3
    if not is_free:
        data.act[:] = campaign.mass_kg * GRAVITY_MPS2 / n_rotors
        data.ctrl[:n_rotors] = data.act
        data.qpos[3] = campaign.yaw_rad
    middle_m = np.array([APART_M * robot, rng.uniform(-5, 5), 40.0])
    pilot, period_s = Pilot(campaign, rng), campaign.period_s
    n_settle, n_rows = round(SETTLE_S / period_s), campaign.rows // campaign.robots
    lost_row = n_settle + get("lost_at_share", 2.0) * n_rows
    steps, log = round(period_s / TIMESTEP_S), []
    for row in range(n_settle + n_rows):
        now_s = row * period_s
        place_m, velocity_mps = data.qpos[:3].copy(), data.qvel[:3].copy()
        asked_mps2 = np.round(pilot.command(now_s, place_m, velocity_mps), 5)
        yaw_rad = round(campaign.yaw_rad + campaign.yaw_rate_radps * now_s, 5)
        thrust_mps2, roll_rad, pitch_rad = attitude(asked_mps2, yaw_rad)
        commands = np.round((campaign.mass_kg * thrust_mps2, roll_rad, pitch_rad, math.remainder(yaw_rad, 2 * math.pi)), 5)
        logged = asked_mps2 if campaign.commands == "acceleration" else commands
        log.append((now_s, place_m + middle_m, velocity_mps, logged, asked_mps2, yaw_rad))
        if is_free:
            data.ctrl[:] = campaign.mass_kg * asked_mps2
        else:
            data.ctrl[:n_rotors] = commands[0] / n_rotors
            data.ctrl[n_rotors:] = yaw_rad, pitch_rad, roll_rad
            if row >= lost_row:
                # The first rotor, ahead, stops: the nose goes down. A trim holds against most of it.
                data.ctrl[0] = 0.0
                stiffness = -model.actuator_biasprm[n_rotors + 1, 1]
                data.ctrl[n_rotors + 1] -= get("trimmed") * ARM_M * commands[0] / n_rotors / stiffness
        mujoco.mj_step(model, data, nstep=steps)
    columns = [np.array(column) for column in zip(*log[n_settle:])]
    assert columns[1][:, 2].min() > 3.0 and np.isfinite(columns[1]).all(), f"{campaign.name}: a robot fell"
    return Flight(columns[0] - columns[0][0], *columns[1:])


class Reference:
    """What a reader who knew the true accelerations could tell of a campaign, and which laws fit them as well as what is hidden.

    All is in displacements over windows that follow on each other (m): what an unmodelled acceleration moves a body by.
    """

    LAWS = ("push", "wind", "linear-drag", "quadratic-drag", "thrust-scale", "attitude-bias", "dead-time", "actuator-lag")

    def __init__(self, campaign, flights):
        self.campaign, self.flights = campaign, flights
        # Noise of both ends of a window, and of the velocity at its start.
        self.noise_m = 2 * campaign.noise_m
        self.nominal = [self.with_lag(flight.asked_mps2 + self.weight(), campaign.lag_s) for flight in flights]
        true = [np.diff(flight.velocity_mps, axis=0) / campaign.period_s + self.weight() for flight in flights]
        self.missed_m = self.displacement([one - force[:-1] for one, force in zip(true, self.nominal)])

    def weight(self):
        """What thrust carries beside the commanded acceleration (m/s²)."""
        return np.array([0, 0, 0.0 if self.campaign.plant == "free-flyer" else GRAVITY_MPS2])

    def with_lag(self, force_mps2, lag_s):
        """Means over each row of a force that follows its command, constant over a row, with a first-order lag."""
        if lag_s == 0:
            return force_mps2
        share, out, state = self.campaign.period_s / lag_s, np.empty_like(force_mps2), force_mps2[0]
        for row, asked in enumerate(force_mps2):
            out[row] = asked + (state - asked) * (1 - math.exp(-share)) / share
            state = asked + (state - asked) * math.exp(-share)
        return out

    def with_delay(self, force_mps2, delay_s):
        """Means over each row of a force that comes later."""
        sums = np.vstack([np.zeros(3), np.cumsum(force_mps2, axis=0)])
        rows = np.arange(len(sums)) - delay_s / self.campaign.period_s
        # Before the first row the first command holds.
        shifted = np.array([np.interp(rows, np.arange(len(sums)), column) for column in sums.T]).T
        return np.diff(shifted + np.minimum(rows, 0)[:, None] * force_mps2[0], axis=0)

    def displacement(self, accelerations_mps2):
        """The displacement by accelerations of all flights, window after window up to the last row, as one vector (m)."""
        n, period_s = round(WINDOW_S / self.campaign.period_s), self.campaign.period_s
        weights = period_s**2 * (n - np.arange(n) - 0.5)
        windows = [one[len(one) % n :].reshape(-1, n, 3) for one in accelerations_mps2]
        return np.concatenate([np.einsum("wnc,n->wc", one, weights) for one in windows]).ravel()

    def nats(self, displacement_m):
        """The log likelihood ratio by which noise rules a displacement out."""
        return float((displacement_m**2).sum() / (2 * self.noise_m**2))

    def regressors(self, law):
        """Sets of accelerations, each linear in numbers of a law: for each set and number, one array a flight."""
        flights, nominal = self.flights, self.nominal
        velocities = [(flight.velocity_mps[:-1] + flight.velocity_mps[1:]) / 2 for flight in flights]
        pushes = [[np.tile(axis, (len(one), 1)) for one in velocities] for axis in np.eye(3)]
        if law == "push":
            return [pushes]
        if law == "linear-drag":
            return [[[-one for one in velocities]]]
        if law == "quadratic-drag":
            return [[[-one * np.linalg.norm(one, axis=1, keepdims=True) for one in velocities]]]
        if law == "thrust-scale":
            return [[[force[:-1] for force in nominal]]]
        if law == "attitude-bias":
            return [[[tilt_gain(force[:-1], flight.yaw_rad[:-1], way) for force, flight in zip(nominal, flights)] for way in (0, 1)]]
        change = self.with_delay if law == "dead-time" else self.with_lag
        return [[[(change(force, late_s) - force)[:-1] for force in nominal]] for late_s in np.geomspace(0.002, 0.5, 40)]

    def left_nats(self, law):
        """What the best numbers of a law leave to be ruled out."""
        if law == "wind":
            # Air that blows moves a body by its drag. Drag that is weaker than this is no explanation.
            drag = self.displacement(self.regressors("linear-drag")[0][0])
            return min(self.left_of(self.missed_m - k_per_s * drag, self.regressors("push")[0]) for k_per_s in np.geomspace(0.03, 1.0, 15))
        if law in ("dead-time", "actuator-lag"):
            return min(self.nats(self.missed_m - self.displacement(one[0])) for one in self.regressors(law))
        return self.left_of(self.missed_m, self.regressors(law)[0], is_positive="drag" in law)

    def left_of(self, displacement_m, columns, is_positive=False):
        """What least squares over some columns leaves of a displacement, in nats; with `is_positive` the numbers are at least 0."""
        matrix = np.array([self.displacement(one) for one in columns]).T
        numbers = np.linalg.lstsq(matrix, displacement_m, rcond=None)[0]
        return self.nats(displacement_m - matrix @ (np.maximum(numbers, 0) if is_positive else numbers))


def tilt_gain(force_mps2, yaw_rad, way):
    """The acceleration that a thrust gains by a small tilt ahead (0) or to the left (1) of the body, per rad."""
    ahead = np.stack([np.cos(yaw_rad), np.sin(yaw_rad), 0 * yaw_rad], axis=1)
    left = np.stack([-np.sin(yaw_rad), np.cos(yaw_rad), 0 * yaw_rad], axis=1)
    size = np.linalg.norm(force_mps2, axis=1, keepdims=True)
    up = force_mps2 / size
    # Axes of the body, nearly: those of its yaw at right angles to the thrust.
    axis = (ahead, left)[way]
    axis = axis - (axis * up).sum(axis=1, keepdims=True) * up
    return size * axis / np.linalg.norm(axis, axis=1, keepdims=True)


def truth(campaign, flights):
    """What is right, half right and false of a campaign, fixed from its physics (the object in truth.json).

    `right`: sets of names each of which says all that is hidden. `half`: names that say a part, or are indistinguishable by these
    measurements. Every other name that an answer is certain of is false. Of a campaign that is not `detectable` silence is all that one
    can ask.
    """
    reference = Reference(campaign, flights)
    kind, hidden = campaign.kind, campaign.hidden
    drag = "linear-drag" if "linear_drag_per_s" in hidden else "quadratic-drag"
    own = {"nothing": None, "drag": drag, "payload": "payload-mass", "lag": "actuator-lag"}.get(kind, kind)
    right = [[own]] if own else []
    parts = {
        "wind": {"push", "linear-drag", "quadratic-drag"},
        # A lighter thrust, a heavier robot and a rotor that never turned are one law.
        "payload": {"thrust-scale", "rotor-loss"},
        "thrust-scale": {"payload-mass", "rotor-loss"} if hidden.get("thrust_scale", 1) < 1 else set(),
        # Its weight.
        "swinging-load": {"payload-mass", "thrust-scale"},
        # From then on.
        "rotor-loss": {"thrust-scale", "payload-mass", "attitude-bias"},
    }.get(kind, set())
    if kind == "wind":
        # Linear drag against moving air is a push and drag in still air.
        if drag == "linear-drag":
            right.append(["push", drag])
    left = {law: round(reference.left_nats(law), 2) for law in Reference.LAWS}
    # Of the law of what is hidden, what the maker's model of control leaves; nothing where no law is written down here.
    own_law = {"payload-mass": "thrust-scale"}.get(own, own)
    floor = left.get(own_law, 0.0)
    missed_nats = reference.nats(reference.missed_m)
    close = floor + max(INDISTINGUISHABLE_NATS, 0.1 * floor)
    aliases = {law for law in left if own and left[law] < min(close, missed_nats - DETECTABLE_NATS)}
    if "thrust-scale" in aliases:
        aliases |= {"payload-mass"}
    if kind == "drag":
        # Still air is a special case of wind, not an alias of it.
        aliases -= {"wind"}
    return {
        **dataclasses.asdict(campaign),
        "right": right,
        "half": sorted((parts | aliases) - {own}),
        "moves_m": round(float(np.sqrt((reference.missed_m**2).reshape(-1, 3).sum(axis=1).mean())), 5),
        "nats": round(missed_nats, 2),
        "nats_left": left,
        "detectable": own is not None and missed_nats - floor >= DETECTABLE_NATS,
    }


COLUMNS = {
    "acceleration": ("cmd_ax_mps2", "cmd_ay_mps2", "cmd_az_mps2"),
    "thrust": ("cmd_thrust_n", "cmd_roll_rad", "cmd_pitch_rad", "cmd_yaw_rad"),
}


def with_adequate_model(campaign):
    """The campaign with so much noise that the same flights, with nothing hidden, are within `MODEL_NATS` of the maker's model, which is
    spread over all windows, and that no law explains more than one nat of it.

    Thrust and attitude that follow with a lag each are not quite the maker's thrust vector with one lag.
    """
    twin = dataclasses.replace(campaign, kind="nothing", hidden={})
    reference = Reference(twin, [fly(twin, robot) for robot in range(twin.robots)])
    missed_nats = reference.nats(reference.missed_m)
    excess = max(missed_nats / MODEL_NATS, missed_nats - min(map(reference.left_nats, Reference.LAWS)))
    return dataclasses.replace(campaign, noise_m=round(campaign.noise_m * max(1.0, math.sqrt(excess)), 4))


def write(folder, campaign):
    """Flies a campaign and writes data.csv, model.toml and truth.json; the truth is returned."""
    if campaign.plant == "quadrotor":
        campaign = with_adequate_model(campaign)
    flights = [fly(campaign, robot) for robot in range(campaign.robots)]
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([campaign.seed, 1000])
    with open(folder / "data.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["time_s", "agent", "x_m", "y_m", "z_m", *COLUMNS[campaign.commands]])
        for agent, flight in enumerate(flights):
            measured_m = flight.place_m + rng.normal(0, campaign.noise_m, flight.place_m.shape)
            for time_s, place_m, commands in zip(flight.time_s, measured_m, flight.commands):
                table.writerow([f"{time_s:.3f}", agent, *(f"{one:.5f}" for one in place_m), *(f"{one:.5f}" for one in commands)])
    (folder / "model.toml").write_text(campaign.toml())
    known = truth(campaign, flights)
    (folder / "truth.json").write_text(json.dumps(known, indent=1) + "\n")
    return known


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder of the campaigns")
    parser.add_argument("--seed", default="bodies", help="text from which all parameters follow")
    parser.add_argument("--count", type=int, default=60, help="number of campaigns")
    options = parser.parse_args()
    for index in range(options.count):
        campaign = draw_campaign(options.seed, index)
        known = write(options.out / campaign.name, campaign)
        flown_with = f"{campaign.plant}, {campaign.commands}, {campaign.design}, noise {known['noise_m']} m"
        print(f"{campaign.name}: {flown_with}, {known['nats']:.0f} nats, half right {known['half']}", flush=True)


if __name__ == "__main__":
    main()
