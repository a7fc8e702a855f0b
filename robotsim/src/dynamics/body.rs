//! Bodies: what a robot can be asked for, and how that moves it.

use super::inertial::{DoubleIntegrator, Inertial, Quadrotor, within};
use super::point_mass::PointMass;
use super::rigid::RigidBody;
use proto::config::{Choice, Section};
use serde::{Deserialize, Serialize};

/// What a robot is asked for, or does.
///
/// `Velocity` bodies: velocity east, north, up (m/s); those that keep their velocity are asked for an acceleration (m/s²). `Turning` bodies: speed along the heading (m/s), then the yaw rate
/// (rad/s, unicycle) or the steering angle (rad, car), then nothing.
pub type Drive = [f64; 3];

/// Which of a robot's actuators.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// Velocity, or speed along the heading.
    Speed,
    /// Yaw rate or steering.
    Turn,
}

/// How a body is commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// By a velocity.
    Velocity,
    /// By speed and yaw rate.
    Unicycle,
    /// By speed and steering angle.
    Car,
}

impl Shape {
    /// Whether the body has a heading along which it drives.
    #[must_use]
    pub fn is_turning(self) -> bool {
        self != Self::Velocity
    }
}

/// A body.
#[derive(Clone, Debug, PartialEq, Section)]
pub(super) enum Body {
    /// A point mass that takes the commanded velocity at once.
    PointMass(PointMass),
    /// A point mass with inertia and limited acceleration.
    DoubleIntegrator(DoubleIntegrator),
    /// A multicopter: accelerated by its thrust, whose direction follows with a lag.
    Quadrotor(Quadrotor),
    /// A rigid disc with mass, friction and spin, which pushes what it touches.
    RigidBody(RigidBody),
    /// A unicycle: drives along its heading and turns at the commanded yaw rate.
    Unicycle(Unicycle),
    /// A car: drives along its heading and turns with its steered front wheels.
    Car(Car),
}

/// A body with a heading that drives along it and turns at a commanded rate.
///
/// # Model
///
/// ẋ = v cos θ, ẏ = v sin θ, θ̇ = ω: the unicycle of the literature (e.g. Siciliano et al., Robotics: Modelling, Planning
/// and Control, § 11.2). Where a controller commands a velocity u, v = u · (cos θ, sin θ), at least 0, and ω turns the heading
/// towards u within the period, as far as `yaw_rate_cap_radps` allows.
///
/// # Validity
///
/// On a plane, z stays as it is; no inertia and no slip but what effects add.
#[derive(Clone, Debug, PartialEq, Section)]
pub(super) struct Unicycle {
    /// The cap (m/s).
    #[key(inherited)]
    speed_cap_mps: f64,
    /// Maximum yaw rate (rad/s).
    #[key(above = 0.0, most = 1e3, default = 10.0)]
    yaw_rate_cap_radps: f64,
}

/// A body with a steered front axle.
///
/// # Model
///
/// ẋ = v cos θ, ẏ = v sin θ, θ̇ = v tan δ / L, position that of the rear axle: the kinematic bicycle (e.g. Rajamani, Vehicle
/// Dynamics and Control, § 2.2). Where a controller commands a velocity u, v = |u| and δ turns the heading towards u
/// within the period, as far as `steer_cap_rad` allows.
///
/// # Validity
///
/// As the unicycle; lateral accelerations well below grip.
#[derive(Clone, Debug, PartialEq, Section)]
pub(super) struct Car {
    /// The cap (m/s).
    #[key(inherited)]
    speed_cap_mps: f64,
    /// Wheelbase (m). 0.33: a car of scale 1:10.
    #[key(above = 0.0, most = 100.0, default = 0.33)]
    wheelbase_m: f64,
    /// Maximum steering angle (rad).
    #[key(above = 0.0, most = 1.5, default = 0.6)]
    steer_cap_rad: f64,
}

impl Body {
    pub(super) fn shape(&self) -> Shape {
        match self {
            Self::PointMass(_)
            | Self::DoubleIntegrator(_)
            | Self::Quadrotor(_)
            | Self::RigidBody(_) => Shape::Velocity,
            Self::Unicycle(_) => Shape::Unicycle,
            Self::Car(_) => Shape::Car,
        }
    }

    pub(super) fn speed_cap_mps(&self) -> f64 {
        match self {
            Self::PointMass(body) => body.speed_cap_mps,
            Self::DoubleIntegrator(body) => body.speed_cap_mps,
            Self::Quadrotor(body) => body.speed_cap_mps,
            Self::RigidBody(body) => body.speed_cap_mps,
            Self::Unicycle(body) => body.speed_cap_mps,
            Self::Car(body) => body.speed_cap_mps,
        }
    }

    /// What the body makes of a demand: the caps.
    pub(super) fn cap(&self, [speed_mps, turn, rest]: Drive) -> Drive {
        let clamp = |number: f64, cap: f64| number.clamp(-cap, cap);
        match self {
            Self::PointMass(body) => body.velocity_mps([speed_mps, turn, rest]),
            Self::DoubleIntegrator(_) | Self::Quadrotor(_) | Self::RigidBody(_) => {
                within([speed_mps, turn, rest], self.speed_cap_mps())
            }
            Self::Unicycle(body) => {
                [clamp(speed_mps, body.speed_cap_mps), clamp(turn, body.yaw_rate_cap_radps), 0.0]
            }
            Self::Car(body) => {
                [clamp(speed_mps, body.speed_cap_mps), clamp(turn, body.steer_cap_rad), 0.0]
            }
        }
    }

    /// How it is pushed, if it keeps its velocity.
    pub(super) fn inertial(&self) -> Option<&dyn Inertial> {
        match self {
            Self::DoubleIntegrator(body) => Some(body),
            Self::Quadrotor(body) => Some(body),
            Self::RigidBody(body) => Some(body),
            Self::PointMass(_) | Self::Unicycle(_) | Self::Car(_) => None,
        }
    }

    /// Yaw rate (rad/s) of a turning body.
    #[inline]
    pub(super) fn yaw_rate_radps(&self, speed_mps: f64, turn: f64) -> f64 {
        match self {
            Self::PointMass(_)
            | Self::DoubleIntegrator(_)
            | Self::Quadrotor(_)
            | Self::RigidBody(_) => 0.0,
            Self::Unicycle(_) => turn,
            Self::Car(body) => speed_mps * libm::tan(turn) / body.wheelbase_m,
        }
    }

    /// What to ask of the body so that it moves with this velocity (m/s), as well as it can within `dt_s`.
    pub(super) fn follow(&self, velocity_mps: [f64; 3], heading_rad: f64, dt_s: f64) -> Drive {
        if self.shape() == Shape::Velocity {
            return velocity_mps;
        }
        let [vx, vy, _] = velocity_mps;
        let speed_mps = libm::hypot(vx, vy).min(self.speed_cap_mps());
        if speed_mps == 0.0 {
            return [0.0; 3];
        }
        let error_rad = wrapped(libm::atan2(vy, vx) - heading_rad);
        match self {
            Self::PointMass(_)
            | Self::DoubleIntegrator(_)
            | Self::Quadrotor(_)
            | Self::RigidBody(_)
            | Self::Unicycle(_) => {
                [(speed_mps * libm::cos(error_rad)).max(0.0), error_rad / dt_s, 0.0]
            }
            Self::Car(body) => {
                let turn = libm::atan(body.wheelbase_m * error_rad / (dt_s * speed_mps));
                [speed_mps, turn, 0.0]
            }
        }
    }
}

/// An angle brought into (−π, π].
#[must_use]
pub fn wrapped(angle_rad: f64) -> f64 {
    let turns = libm::round(angle_rad / std::f64::consts::TAU);
    angle_rad - turns * std::f64::consts::TAU
}
