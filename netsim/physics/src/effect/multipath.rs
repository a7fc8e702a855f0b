//! Rays that arrive by several ways, channel by channel.

use super::{Effect, Entry, UNCHECKED};
use crate::link::SPEED_OF_LIGHT_MPS;
use crate::scatter::{Law, Renewal, Scatter};
use crate::standard::o_qpsk_2450::CHANNELS;
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need, Role};
use proto::rng::Purpose;

/// `kind = "multipath"`.
pub const ENTRY: Entry = Entry::new::<Keys>(UNCHECKED, |table, ordinal| {
    let Keys { sd_db, coherence_mhz } = Keys::read(table);
    Some(Box::new(Multipath { sd_db, coherence_hz: coherence_mhz * 1e6, ordinal }))
});

/// Frequency-selective fading: one value per link, channel and position, the same in both directions.
///
/// # Mechanism
///
/// Rays from walls and furniture cancel on one channel and add on another. The pattern is constant while nothing moves, and changes
/// over half a wavelength.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + X, X ~ N(0, sd_db^2) per unordered pair, channel and place; correlation between channels e^(-|df| /
/// coherence_mhz); drawn anew whenever both ends together have moved on by half a wavelength (61 mm)
/// ```
///
/// # Source
///
/// T. Watteyne, A. Mehta, K. Pister, Reliability through frequency diversity: why channel hopping makes sense, PE-WASUN 2009;
/// Rappaport, § 5.4 (coherence bandwidth).
///
/// # Validity
///
/// Normal in dB, whereas real fades are deeper than peaks are high. Positions are uncorrelated. Passing people have no effect in
/// this model.
///
/// # Trace
///
/// Differences between the channels of a link, the same in both directions and constant in time for stationary nodes.
#[derive(Catalogued, Section)]
#[effect(
    name = "multipath",
    makes = Multipath,
    needs = &[Need::Channels, Need::Readings],
    example = "sd_db = 4.0\ncoherence_mhz = 5.0\n",
    level = Level::Random,
    generalises = &["shadowing", "wall-attenuation", "hidden-obstacle", "vegetation", "diffraction", "two-ray-ground"],
    role = Role::RandomPerChannel,
)]
struct Keys {
    /// Standard deviation (dB).
    #[key(range = 0.0..=20.0)]
    #[fit(
        unit = "dB",
        starts = [3.0],
        step = 0.05,
        plausible = 0.0..=10.0,
        source = "Rappaport, § 5.6: Rayleigh fading has 5.6 dB; two equal rays have 7.9 dB",
    )]
    sd_db: f64,
    /// Coherence bandwidth (MHz): frequency difference over which the correlation falls to 1/e. 5: a room of about ten metres, with
    /// a delay spread of 30 ns.
    #[key(range = 0.01..=1e4, default = 5.0)]
    #[fit(unit = "MHz", range = 0.1..=1e3, starts = [1.0, 5.0, 20.0], step = 0.1)]
    coherence_mhz: f64,
}

/// Half a wavelength at 2.44 GHz (m): the way after which another pattern is met.
pub const PLACE_M: f64 = 0.5 * SPEED_OF_LIGHT_MPS / 2.44e9;

/// Frequency-selective fading.
///
/// # Model
///
/// N(0, sd²) in dB per unordered pair, channel and place; a Gauss–Markov sequence over channels with correlation
/// e^(−|Δf|/B); a new, independent one whenever both ends together have travelled half a wavelength of 2.44 GHz.
///
/// # Validity
///
/// Where a frame has no known channel it is taken for one on channel 11. Normal in dB: true fades are deeper than peaks are
/// high. Clipped at ±5 sd. Both directions fade alike (reciprocity), so that it makes no link asymmetric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Multipath {
    /// Standard deviation (dB).
    pub sd_db: f64,
    /// Difference in frequency over which the correlation falls to 1/e (Hz).
    pub coherence_hz: f64,
    /// Tells several such effects apart.
    pub ordinal: u32,
}

impl Effect for Multipath {
    fn scatter(&self) -> Option<Scatter> {
        Some(Scatter {
            law: Law::Normal { sd_db: self.sd_db },
            renewal: Renewal::Place {
                length_m: PLACE_M,
                coherence_hz: self.coherence_hz,
                channels: CHANNELS,
            },
            purpose: Purpose::Multipath,
            ordinal: self.ordinal,
            directed: false,
        })
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::{Moment, PairBlock};
    use proto::ids::MoteId;

    #[test]
    fn channels_are_correlated_as_said_places_are_not_and_directions_are_alike() {
        let scatter = Multipath { sd_db: 1.0, coherence_hz: 10e6, ordinal: 0 }.scatter().unwrap();
        let value = |a: u32, b: u32, channel: u8, way_m: f64| {
            let at = Moment { period_ns: 5, sent_ns: 9, way_m, channel: Some(channel) };
            scatter.value_db(
                &mut PairBlock::new(3, MoteId(a), MoteId(b), 5),
                MoteId(a),
                MoteId(b),
                at,
            )
        };
        assert_eq!(value(4, 9, 17, 0.0), value(9, 4, 17, 0.0));
        assert_eq!(value(4, 9, 17, 0.0), value(9, 4, 17, 0.06), "the same place");
        let n = 20_000;
        let mean = |f: &dyn Fn(u32) -> f64| (0..n).map(f).sum::<f64>() / f64::from(n);
        // Products of standard normal numbers with correlation rho vary by 1 + rho^2: over 20,000 links 0.01 at most. All
        // nine bounds are 4.5 standard errors: a correct program fails for one seed in 16,000. The seed is fixed.
        for (a, b, way_m, expected) in [
            (11, 11, 0.0, 1.0),
            (26, 26, 0.0, 1.0),
            (11, 12, 0.0, (-0.5f64).exp()),
            (18, 19, 0.0, (-0.5f64).exp()),
            (17, 19, 0.0, (-1.0f64).exp()),
            (11, 13, 0.0, (-1.0f64).exp()),
            (12, 26, 0.0, (-7.0f64).exp()),
            (20, 20, 0.0615, 0.0),
            (20, 21, 1.0, 0.0),
        ] {
            let got = mean(&|i| value(i, i + 1, a, 0.0) * value(i, i + 1, b, way_m));
            let tolerance = 4.5 * f64::sqrt((1.0 + expected * expected) / f64::from(n));
            assert!((got - expected).abs() < tolerance, "{a} {b} {way_m}: {got}, {expected}");
        }
    }
}
