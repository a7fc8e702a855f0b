//! What can be hidden in a link campaign, and how large.

/// How large a hidden effect is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Size {
    /// 0.15 of the noise, or 2 points of delivery.
    Faint,
    /// 0.4 of the noise, or 5 points of delivery.
    Medium,
    /// As large as the noise, or 15 points of delivery.
    Clear,
}

impl Size {
    /// All, the smallest first.
    pub const ALL: [Self; 3] = [Self::Faint, Self::Medium, Self::Clear];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Faint => "faint",
            Self::Medium => "medium",
            Self::Clear => "clear",
        }
    }

    /// The rms of a contribution over received rows (over windows), divided by the noise.
    #[must_use]
    pub const fn of_noise(self) -> f64 {
        match self {
            Self::Faint => 0.15,
            Self::Medium => 0.4,
            Self::Clear => 1.0,
        }
    }

    /// The share of all frames that an effect on reception takes away.
    #[must_use]
    pub const fn of_delivery(self) -> f64 {
        match self {
            Self::Faint => 0.02,
            Self::Medium => 0.05,
            Self::Clear => 0.15,
        }
    }
}

/// What is hidden in a link campaign: the radio effects of the catalogue, and some that no catalogue has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Hidden {
    /// `system-gain`: a constant.
    SystemGain,
    /// `path-loss-exponent`: another exponent than free space has.
    PathLossExponent,
    /// `two-ray-ground`: a reflection from the ground.
    TwoRayGround,
    /// `wall-attenuation`: mapped walls absorb.
    WallAttenuation,
    /// `hidden-obstacle`: an unmapped screen.
    HiddenScreen,
    /// `hidden-obstacle`: an unmapped disc.
    HiddenDisc,
    /// `vegetation`: mapped foliage absorbs, per metre.
    Vegetation,
    /// `body-blocking`: other nodes near the path absorb.
    BodyBlocking,
    /// `antenna-pattern`: cardioids.
    AntennaPattern,
    /// `node-offset`: every node sends and hears a little differently.
    NodeOffset,
    /// `shadowing`: one value for a link, changing as its ends move.
    Shadowing,
    /// `multipath`: one value for a link, channel and place.
    Multipath,
    /// `fast-fading`: Rician, from frame to frame.
    FastFading,
    /// `interference`: other traffic on some channels.
    Interference,
    /// `noise-floor`: frames must be stronger to be received.
    NoiseFloor,
    /// `reception-curve`: a receiver with a waterfall of its own.
    ReceptionCurve,
    /// `receiver-nonlinearity`: the register is compressed above some level.
    ReceiverNonlinearity,
    /// `temperature`: weaker where it is warm.
    Temperature,
    /// `battery-sag`: some nodes send weaker and weaker.
    BatterySag,
    /// `motion-fading`: fast nodes lose frames.
    MotionFading,
    /// `diffraction`: mapped walls of finite height cast shadows.
    Diffraction,
    /// In no catalogue: weaker with the square of how far humidity is from 60 %.
    HumiditySquared,
    /// In no catalogue: a sinusoid in time, about one and a half periods.
    Sinusoid,
    /// In no catalogue: weaker the faster the sender moves.
    SenderSpeed,
    /// In no catalogue: weaker the more dust there is.
    Dust,
    /// In no catalogue: weaker from some moment on.
    Step,
    /// In no catalogue: a gradient over the place of the receiver, from west to east.
    EastGradient,
    /// In no catalogue: frames are lost the more humid it is.
    HumidityLoss,
}

impl Hidden {
    /// Those in the catalogue.
    pub const KNOWN: [Self; 21] = [
        Self::SystemGain,
        Self::PathLossExponent,
        Self::TwoRayGround,
        Self::WallAttenuation,
        Self::HiddenScreen,
        Self::HiddenDisc,
        Self::Vegetation,
        Self::BodyBlocking,
        Self::AntennaPattern,
        Self::NodeOffset,
        Self::Shadowing,
        Self::Multipath,
        Self::FastFading,
        Self::Interference,
        Self::NoiseFloor,
        Self::ReceptionCurve,
        Self::ReceiverNonlinearity,
        Self::Temperature,
        Self::BatterySag,
        Self::MotionFading,
        Self::Diffraction,
    ];

    /// Those in no catalogue.
    pub const UNKNOWN: [Self; 7] = [
        Self::HumiditySquared,
        Self::Sinusoid,
        Self::SenderSpeed,
        Self::Dust,
        Self::Step,
        Self::EastGradient,
        Self::HumidityLoss,
    ];

    /// Its name in the catalogue; for those in none, a name of ours.
    #[must_use]
    pub const fn effect(self) -> &'static str {
        match self {
            Self::SystemGain => "system-gain",
            Self::PathLossExponent => "path-loss-exponent",
            Self::TwoRayGround => "two-ray-ground",
            Self::WallAttenuation => "wall-attenuation",
            Self::HiddenScreen | Self::HiddenDisc => "hidden-obstacle",
            Self::Vegetation => "vegetation",
            Self::BodyBlocking => "body-blocking",
            Self::AntennaPattern => "antenna-pattern",
            Self::NodeOffset => "node-offset",
            Self::Shadowing => "shadowing",
            Self::Multipath => "multipath",
            Self::FastFading => "fast-fading",
            Self::Interference => "interference",
            Self::NoiseFloor => "noise-floor",
            Self::ReceptionCurve => "reception-curve",
            Self::ReceiverNonlinearity => "receiver-nonlinearity",
            Self::Temperature => "temperature",
            Self::BatterySag => "battery-sag",
            Self::MotionFading => "motion-fading",
            Self::Diffraction => "diffraction",
            Self::HumiditySquared => "unknown-humidity-squared",
            Self::Sinusoid => "unknown-sinusoid",
            Self::SenderSpeed => "unknown-sender-speed",
            Self::Dust => "unknown-dust",
            Self::Step => "unknown-step",
            Self::EastGradient => "unknown-east-gradient",
            Self::HumidityLoss => "unknown-humidity-loss",
        }
    }

    /// For one in no catalogue: the columns of the file in any of which its structure is seen; empty for the others.
    #[must_use]
    pub const fn covariates(self) -> &'static [&'static str] {
        match self {
            Self::HumiditySquared | Self::HumidityLoss => &["humidity_pct"],
            Self::Sinusoid | Self::Step => &["time_s"],
            Self::SenderSpeed => &["tx_speed_mps"],
            Self::Dust => &["dust_ugm3"],
            Self::EastGradient => &["rx_x_m"],
            _ => &[],
        }
    }

    /// Whether it takes frames away while the strength of those received is as it was.
    pub(crate) const fn is_of_reception(self) -> bool {
        matches!(
            self,
            Self::Interference
                | Self::NoiseFloor
                | Self::ReceptionCurve
                | Self::MotionFading
                | Self::HumidityLoss
        )
    }
}
