//! Uniform between a bound and another 40 dB below: the Pister hack.

use super::friis::{friis_dbm, friis_reach};
use super::{Entry, Family, NOT_REPLAYED, Prediction, Propagation, Radio, Reach, Reception};
use crate::link::{Link, SPEED_OF_LIGHT_MPS};
use crate::scatter::{Law, Renewal, Scatter};
use proto::config::{Choice, Section, variant};
use proto::rng::Purpose;

/// `propagation = "experimental-randomness"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<ExperimentalRandomness>("experimental-randomness"),
    family: Family::Signal,
    replay: NOT_REPLAYED,
    build: |table, context| {
        Some(Box::new(ExperimentalRandomness {
            radio: context.radio,
            ..ExperimentalRandomness::read(table)
        }))
    },
};

/// Span of the levels (dB).
const SPAN_DB: f64 = 40.0;

/// When a link's received power is redrawn.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Redraw {
    /// Never.
    Frozen,
    /// In every control period.
    Period,
    /// For every frame.
    Frame,
    /// As the ends move: the correlation falls to 1/e after they have moved half a wavelength in total.
    Coherence,
}

/// Uniform between Friis - 40 dB and Friis, the same in both directions (Pister-hack; Municio et al. 2019).
///
/// The experimental randomness of the BotNet paper, mended.
///
/// # Model
///
/// ```text
/// P_rx = Friis(d) − 40 dB · U,  U uniform in [0, 1]
/// ```
///
/// One level per unordered pair ("Pister-hack"; Municio et al., "Simulating 6TiSCH networks", 2019). With
/// `redraw = "coherence"` levels are a Gaussian copula with uniform marginal and correlation e^(−Δ/(λ/2)), λ at the
/// carrier, Δ the way of both ends together.
///
/// # Validity
///
/// Levels do not depend on the channel, and (but for `coherence`) change as fast for robots at rest as for moving ones.
/// The published code of the BotNet paper clamps distances to at most 1 cm, so that every link there is perfect; here the
/// clamp is the lower bound it was meant to be, `min_distance_m`.
#[derive(Clone, Copy, Debug, PartialEq, Section)]
pub struct ExperimentalRandomness {
    /// When a link's received power is redrawn.
    #[key(default = Redraw::Period)]
    pub redraw: Redraw,
    /// Settings of the radio: power, frequency, antenna gains.
    #[key(skip)]
    pub radio: Radio,
}

impl Propagation for ExperimentalRandomness {
    fn predict(&self, link: &Link<'_>) -> Prediction {
        let friis_dbm = friis_dbm(self.radio.total_dbm(), link.distance_m, link.frequency_hz);
        Prediction { rssi_dbm: friis_dbm - 0.5 * SPAN_DB, reception: Reception::ByCurve }
    }

    fn scatter(&self) -> Option<Scatter> {
        let half_wavelength_m = 0.5 * SPEED_OF_LIGHT_MPS / self.radio.carrier_hz;
        Some(Scatter {
            law: Law::Uniform { span_db: SPAN_DB },
            renewal: match self.redraw {
                Redraw::Frozen => Renewal::Frozen,
                Redraw::Period => Renewal::Period,
                Redraw::Frame => Renewal::Frame,
                Redraw::Coherence => Renewal::Coherence { length_m: half_wavelength_m },
            },
            purpose: Purpose::RandomnessLevel,
            ordinal: 0,
            directed: false,
        })
    }

    fn reach(&self, floor_dbm: f64, frequency_hz: f64) -> Reach {
        friis_reach(self.radio.total_dbm(), floor_dbm + 0.5 * SPAN_DB, frequency_hz)
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}
