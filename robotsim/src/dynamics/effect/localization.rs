//! Errors of the measured position.

use super::{Effect, Entry, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Parameter, Role};
use serde::Deserialize;

/// `kind = "localization"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "localization",
        doc: "Positions are measured with noise, with a delay, or with a wrong scale. The motion itself does not change.",
        fields: &[
            Field {
                key: "sd_m",
                doc: "Standard deviation of the noise, per component of the plane (m).",
                kind: Kind::Number(Range::closed(0.0, 1e4)),
                default: Default::Number(0.0),
            },
            Field {
                key: "delay_s",
                doc: "Delay of the measurement (s).",
                kind: Kind::Number(Range::closed(0.0, 60.0)),
                default: Default::Number(0.0),
            },
            Field {
                key: "scale",
                doc: "Ratio of measured to true coordinates, from the origin.",
                kind: Kind::Number(Range::above(0.0, 10.0)),
                default: Default::Number(1.0),
            },
        ],
    },
    about: About {
        mechanism: "Cameras, satellites and anchors measure positions with noise, with a delay, and in a frame whose scale \
                    may be wrong. Robots act on the measured positions and broadcast them.",
        equation: "measured(t) = scale * x(t - delay_s) + N(0, sd_m^2)",
        source: "Definition.",
        validity: "Noise is independent between steps. A constant bias is not identifiable. In data, the scale is aliased \
                   with slip and the delay with dead-time, which diagnose tests instead; every model estimates the noise.",
        trace: "An error that is present from the start of the window and does not grow over it.",
        needs: &[],
        example: "sd_m = 0.02\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "sd_m",
            unit: "m",
            min: 1e-6,
            max: 1e3,
            starts: &[0.02],
            step: 0.001,
        }],
        variants: &[],
        level: Level::Random,
        generalises: &[],
        role: Role::Noise,
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<Localization>(table))),
};

/// How positions are measured: scale, delay, noise.
///
/// # Model
///
/// ```text
/// measured(t) = k x(t − d) + n        n ~ N(0, σ²) in x and y, 0 in z, independent from step to step
/// ```
///
/// By definition. Robots believe what was measured, and say so on the air.
///
/// # Arguments
///
/// * `sd_m` σ: standard deviation of the noise, per component of the plane (m), not negative.
/// * `delay_s` d: age of what is measured (s), not negative; between two known places a robot was on the straight line.
/// * `scale` k: measured coordinate per true one (1).
///
/// # Validity
///
/// Noise is white: satellite and camera positions drift over seconds, which hides in no average as this does. A constant bias cannot be
/// seen. In measurements a scale is the same as `slip` and a delay the same as `dead-time`: a diagnosis tries those in its
/// place. Positions are measured once: one such effect per robot. Not validated against hardware.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct Localization {
    /// Standard deviation of the noise, per component of the plane (m).
    pub sd_m: f64,
    /// Age of what is measured (s).
    pub delay_s: f64,
    /// Measured coordinate per true one.
    pub scale: f64,
}

impl Localization {
    /// Positions as they are.
    pub(in crate::dynamics) const PERFECT: Self = Self { sd_m: 0.0, delay_s: 0.0, scale: 1.0 };
}

impl Effect for Localization {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn localization(&self) -> Option<Localization> {
        Some(*self)
    }
}
