//! What can be hidden in the motion of robots, and what their campaigns are like.

/// What is hidden in a robot campaign: the robot effects of the catalogue, and some that no catalogue has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RobotHidden {
    /// `actuator-lag`: speed follows with a time constant.
    ActuatorLag,
    /// `dead-time`: commands act later.
    DeadTime,
    /// `slip`: slower than commanded, in proportion.
    Slip,
    /// `heading-bias`: the command is rotated.
    HeadingBias,
    /// `dead-band`: slow commands do nothing.
    DeadBand,
    /// `speed-limit`: below the cap assumed.
    SpeedLimit,
    /// `acceleration-limit`: velocity changes no faster.
    AccelerationLimit,
    /// `quadratic-drag`: fast commands fall short.
    QuadraticDrag,
    /// `steering-bias`: a trim of steering or yaw rate.
    SteeringBias,
    /// `wind`: a constant drift.
    Wind,
    /// `slope`: drift downhill.
    Slope,
    /// `rough-ground`: slower inside a disc.
    RoughGround,
    /// `yaw-coupling`: drift across in turns.
    YawCoupling,
    /// `downwash`: robots that are near repel each other.
    Downwash,
    /// `localization`: positions are measured with more noise than assumed.
    Localization,
    /// In no catalogue: slower the more there is to carry.
    Payload,
    /// In no catalogue: a drift that swings in time.
    Tide,
    /// In no catalogue: a drift to the east that grows to the north.
    Stream,
}

impl RobotHidden {
    /// Those in the catalogue.
    pub const KNOWN: [Self; 15] = [
        Self::ActuatorLag,
        Self::DeadTime,
        Self::Slip,
        Self::HeadingBias,
        Self::DeadBand,
        Self::SpeedLimit,
        Self::AccelerationLimit,
        Self::QuadraticDrag,
        Self::SteeringBias,
        Self::Wind,
        Self::Slope,
        Self::RoughGround,
        Self::YawCoupling,
        Self::Downwash,
        Self::Localization,
    ];

    /// Those in no catalogue.
    pub const UNKNOWN: [Self; 3] = [Self::Payload, Self::Tide, Self::Stream];

    /// Its name in the catalogue; for those in none, a name of ours.
    #[must_use]
    pub const fn effect(self) -> &'static str {
        match self {
            Self::ActuatorLag => "actuator-lag",
            Self::DeadTime => "dead-time",
            Self::Slip => "slip",
            Self::HeadingBias => "heading-bias",
            Self::DeadBand => "dead-band",
            Self::SpeedLimit => "speed-limit",
            Self::AccelerationLimit => "acceleration-limit",
            Self::QuadraticDrag => "quadratic-drag",
            Self::SteeringBias => "steering-bias",
            Self::Wind => "wind",
            Self::Slope => "slope",
            Self::RoughGround => "rough-ground",
            Self::YawCoupling => "yaw-coupling",
            Self::Downwash => "downwash",
            Self::Localization => "localization",
            Self::Payload => "unknown-payload",
            Self::Tide => "unknown-tide",
            Self::Stream => "unknown-stream",
        }
    }

    /// For one in no catalogue: the columns in any of which its structure is seen; empty for the others.
    #[must_use]
    pub const fn covariates(self) -> &'static [&'static str] {
        match self {
            Self::Payload => &["payload_kg"],
            Self::Tide => &["time_s"],
            Self::Stream => &["y_m"],
            _ => &[],
        }
    }
}

/// How robots are commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drive {
    /// By a velocity in the plane, up to near the cap of 30 m/s.
    Velocity,
    /// By speed and yaw rate.
    Unicycle,
    /// By speed and steering angle.
    Car,
}

/// What a robot campaign is like.
#[derive(Clone, Debug, PartialEq)]
pub struct Fleet {
    /// How many robots.
    pub n_robots: usize,
    /// How they are commanded.
    pub drive: Drive,
    /// Extent of the place, east and north (m).
    pub extent_m: [f64; 2],
    /// Greatest speed they are told (m/s).
    pub fastest_mps: f64,
    /// Standard deviation of the measured position, per axis (m).
    pub noise_m: f64,
}

impl Fleet {
    /// Five robots on 120 × 90 m, measured to 1.5 cm; told up to 29 m/s, or 8 for unicycles and 6 for cars.
    #[must_use]
    pub const fn standard(drive: Drive) -> Self {
        let fastest_mps = match drive {
            Drive::Velocity => 29.0,
            Drive::Unicycle => 8.0,
            Drive::Car => 6.0,
        };
        Self { n_robots: 5, drive, extent_m: [120.0, 90.0], fastest_mps, noise_m: 0.015 }
    }

    /// Five small robots on 5 × 4 m, told up to 0.6 m/s, measured to 1.5 cm.
    ///
    /// What happens while a velocity changes can be told apart (lag, dead time, a limit of acceleration) only if it lasts longer
    /// than the 50 ms between samples; after the changes of fast robots, that would be many times the noise.
    #[must_use]
    pub const fn slow() -> Self {
        Self { extent_m: [5.0, 4.0], fastest_mps: 0.6, ..Self::standard(Drive::Velocity) }
    }

    /// The fleet that shows an effect: slow where it is about changes of velocity, cars and unicycles where it is about turns.
    #[must_use]
    pub const fn showing(hidden: RobotHidden) -> Self {
        match hidden {
            RobotHidden::ActuatorLag
            | RobotHidden::DeadTime
            | RobotHidden::AccelerationLimit
            | RobotHidden::DeadBand => Self::slow(),
            RobotHidden::SteeringBias => Self::standard(Drive::Car),
            RobotHidden::YawCoupling => Self::standard(Drive::Unicycle),
            _ => Self::standard(Drive::Velocity),
        }
    }
}
