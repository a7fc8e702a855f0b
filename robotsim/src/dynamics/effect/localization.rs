//! Errors of the measured position.

use super::{Effect, Entry};
use proto::config::Section;
use proto::effect::{Catalogued, Level, Role};

/// `kind = "localization"`.
pub(super) const ENTRY: Entry = Entry::of::<Localization>();

/// Positions are measured with noise, with a delay, or with a wrong scale. The motion itself does not change.
///
/// # Mechanism
///
/// Cameras, satellites and anchors measure positions with noise, with a delay, and in a frame whose scale may be wrong. Robots act
/// on the measured positions and broadcast them.
///
/// # Equation
///
/// ```text
/// measured(t) = scale * x(t - delay_s) + N(0, sd_m^2)
/// ```
///
/// # Source
///
/// Definition.
///
/// # Validity
///
/// Noise is independent between steps. A constant bias is not identifiable. In data, the scale is aliased with slip and the delay
/// with dead-time, which diagnose tests instead; every model estimates the noise.
///
/// # Trace
///
/// An error that is present from the start of the window and does not grow over it.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "localization",
    needs = &[],
    example = "sd_m = 0.02\n",
    level = Level::Random,
    role = Role::Noise,
)]
pub struct Localization {
    /// Standard deviation of the noise, per component of the plane (m).
    #[key(range = 0.0..=1e4, default = 0.0)]
    #[fit(unit = "m", range = 1e-6..=1e3, starts = [0.02], step = 0.001)]
    pub sd_m: f64,
    /// Delay of the measurement (s).
    #[key(range = 0.0..=60.0, default = 0.0)]
    pub delay_s: f64,
    /// Ratio of measured to true coordinates, from the origin.
    #[key(above = 0.0, most = 10.0, default = 1.0)]
    pub scale: f64,
}

impl Localization {
    /// Positions as they are.
    pub(in crate::dynamics) const PERFECT: Self = Self { sd_m: 0.0, delay_s: 0.0, scale: 1.0 };
}

impl Effect for Localization {
    fn localization(&self) -> Option<Localization> {
        Some(*self)
    }
}
