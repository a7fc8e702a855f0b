//! A channel that changes while a frame is on the air.

use super::{Effect, Entry, UNCHECKED};
use crate::link::{End, Link, Side};
use proto::config::{Choice, Section};
use proto::effect::{Catalogued, Fixed, Need};

/// `kind = "motion-fading"`.
pub const ENTRY: Entry = Entry::new::<Keys>(UNCHECKED, |table, _| {
    let Keys { rician_k_db, frame_ms, law } = Keys::read(table);
    let k = libm::pow(10.0, rician_k_db / 10.0);
    let scattered = match law {
        Law::CoherenceTime => 1.0 / (k + 1.0),
        Law::Correlation => libm::exp(-k),
    };
    Some(Box::new(MotionFading { frame_s: frame_ms / 1000.0, scattered, law }))
});

/// Frames are lost because the channel changes during a frame while the ends move.
///
/// # Mechanism
///
/// A receiver estimates the channel at the beginning of a frame. While the ends move, the reflected waves change before the end of
/// the frame, faster at higher speed.
///
/// # Equation
///
/// ```text
/// coherence-time: P(lost) = (1 - e^(-T f_d / 0.423)) / (K + 1); correlation: P(lost) = 1/2 (1 - J0(2 pi f_d T)) e^-K; f_d
/// = v/lambda, v the relative speed, T = frame_ms, K = 10^(rician_k_db/10)
/// ```
///
/// # Source
///
/// R. H. Clarke, A statistical theory of mobile-radio reception, Bell System Technical Journal 47 (1968) 957 (J0); P. A. Bello, B.
/// D. Nelin, IRE Trans. Communications Systems CS-10 (1962) 160, and A. Goldsmith, Wireless Communications, § 6.4 (error floor of
/// differential detection in Rician fading); T. S. Rappaport, Wireless Communications, 2nd ed., § 5.4.3 (coherence time 0.423 /
/// f_d).
///
/// # Validity
///
/// A receiver that does not track the channel within a frame; an upper bound for others. The Doppler shift, 240 Hz at 30 m/s, is
/// negligible against 40 ppm of the crystals. No effect without a known speed.
///
/// # Trace
///
/// Losses follow the relative speed, independently of the RSSI.
#[derive(Catalogued, Section)]
#[effect(
    name = "motion-fading",
    makes = MotionFading,
    needs = &[Need::Movement, Need::Losses],
    example = "rician_k_db = -5.0\n",
    variants = &[&[("law", Fixed::Text("coherence-time"))], &[("law", Fixed::Text("correlation"))]],
)]
struct Keys {
    /// Rician K-factor: power of the direct wave to that of the reflected waves (dB); high with line of sight.
    #[key(range = -60.0..=60.0)]
    #[fit(unit = "dB", range = -20.0..=15.0, starts = [-10.0, 0.0, 5.0], step = 0.05)]
    rician_k_db: f64,
    /// Duration of a frame (ms). 4.256: the longest of IEEE 802.15.4, 133 bytes with the header.
    #[key(above = 0.0, most = 1000.0, default = 4.256)]
    frame_ms: f64,
    /// Criterion for the loss of a frame.
    #[key(default = Law::CoherenceTime)]
    law: Law,
}

/// Which change of the channel loses a frame.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// The scattered power that has decorrelated by the frame's end: 1 - e^(-T/Tc), Tc = 0.423 / f_d.
    CoherenceTime,
    /// The phase has turned by more than a right angle since the beginning of the frame (Clarke's J0).
    Correlation,
}

/// Losses to a channel that changes.
///
/// # Model
///
/// `coherence-time`: of the power that arrives scattered, 1/(K + 1), the share 1 − e^(−T/Tc) has decorrelated by the end of a frame of
/// length T, with the coherence time Tc = 0.423/f_d, f_d = v/λ, of Clarke's model (Rappaport, § 5.4.3); so much is lost:
///
/// ```text
/// P(lost) = (1 − e^(−T f_d / 0.423)) / (K + 1)
/// ```
///
/// `correlation`: the least that is lost.
/// Clarke (1968): where waves arrive evenly from all sides, the channel's correlation after the time τ is J0(2π f_d τ), f_d = v/λ.
/// A receiver that compares what it hears with a reference τ old errs, however strong the signal, with the probability
/// ½ (1 − ρ) e^(−K) (Bello and Nelin 1962; Goldsmith, eq. 6.92, for Rician K): the phase has turned by more than a right angle.
/// A frame is lost if that has happened by its end, so τ is its length T:
///
/// ```text
/// P(lost) = ½ (1 − J0(2π f_d T)) e^(−K)
/// ```
///
/// At 1 m/s and 4.3 ms that is 0.6 % without a steady wave, at 5 m/s 14 %, at 30 m/s 37 %.
///
/// # Validity
///
/// An upper bound for receivers that follow the channel within a frame. The relative speed is that of the ends' velocities, as fast
/// as the covariate `speed_mps` of either end says, if there is one; where no velocity is known, of the covariate `relative_speed_mps`, or √(v_tx² + v_rx²) of `speed_mps` at both ends (directions
/// unknown); where none is, nothing is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionFading {
    /// Length of a frame (s).
    pub frame_s: f64,
    /// How much the steady wave leaves to chance.
    pub scattered: f64,
    /// Criterion for the loss of a frame.
    pub law: Law,
}

/// A channel stays what it is for so many turns of the greatest Doppler shift (Rappaport, § 5.4.3).
const COHERENCE_TURNS: f64 = 0.423;

fn relative_speed_mps(link: &Link<'_>) -> Option<f64> {
    // How fast an end goes, if the measurements say so, is known better than from its places.
    let velocity = |end: &End, side: Side| {
        let velocity = end.velocity_mps?;
        let speed = velocity.iter().map(|v| v * v).sum::<f64>().sqrt();
        let share = match link.covariate("speed_mps", side) {
            Some(measured) if 0.0 < speed => measured / speed,
            _ => 1.0,
        };
        Some(velocity.map(|v| v * share))
    };
    let both = (velocity(&link.sender, Side::Sender), velocity(&link.receiver, Side::Receiver));
    match both {
        (None, None) => {}
        (a, b) => {
            let (a, b) = (a.unwrap_or_default(), b.unwrap_or_default());
            let [x, y, z] = [0, 1, 2].map(|axis| a[axis] - b[axis]);
            return Some((x * x + y * y + z * z).sqrt());
        }
    }
    link.covariate("relative_speed_mps", Side::Sender).or_else(|| {
        let speed_of = |side| link.covariate("speed_mps", side);
        match (speed_of(Side::Sender), speed_of(Side::Receiver)) {
            (None, None) => None,
            (a, b) => {
                let (a, b) = (a.unwrap_or_default(), b.unwrap_or_default());
                Some((a * a + b * b).sqrt())
            }
        }
    })
}

impl Effect for MotionFading {
    fn loss(&self, link: &Link<'_>) -> f64 {
        let speed_mps = relative_speed_mps(link).filter(|speed_mps| speed_mps.is_finite());
        let Some(speed_mps) = speed_mps.filter(|&speed_mps| speed_mps != 0.0) else { return 0.0 };
        let turns = speed_mps / link.wavelength_m() * self.frame_s;
        let changed = match self.law {
            Law::CoherenceTime => 1.0 - libm::exp(-turns / COHERENCE_TURNS),
            Law::Correlation => 0.5 * (1.0 - libm::j0(std::f64::consts::TAU * turns)),
        };
        changed * self.scattered
    }
}

#[cfg(test)]
mod tests {
    use crate::effect::testing::{along_x, made};
    use crate::link::{Covariates, Scene};

    #[test]
    fn at_the_first_zero_of_j0_half_of_all_frames_are_lost_without_a_steady_wave() {
        // J0(2.404826) = 0: v = 2.404826 λ/(2 π T). J0(3.831706) = -0.402759 is its least.
        let scene = Scene::default();
        let mut link = along_x(10.0, 1.0, None, &scene);
        let speed = |x: f64| x * link.wavelength_m() / (std::f64::consts::TAU * 0.004);
        for (x, k_db, expected) in [
            (0.0, -60.0, 0.0),
            (2.404_826, -60.0, 0.5),
            (3.831_706, -60.0, 0.5 * 1.402_759),
            (2.404_826, 0.0, 0.5 * (-1.0f64).exp()),
        ] {
            let speed_mps = speed(x);
            let mut moving = link;
            moving.sender.velocity_mps = Some([0.6 * speed_mps, 0.0, 0.0]);
            moving.receiver.velocity_mps = Some([-0.4 * speed_mps, 0.0, 0.0]);
            let keys = format!("rician_k_db = {k_db:?}\nframe_ms = 4.0\nlaw = 'correlation'");
            let effect = made("motion-fading", &keys);
            let got = effect.loss(&moving);
            // K of -60 dB is 10^-6, the zeros have seven digits.
            assert!((got - expected).abs() < 2e-6, "{x} {k_db}: {got}");
        }
        // Side by side at any speed nothing changes between them.
        link.sender.velocity_mps = Some([9.0, 3.0, 0.0]);
        link.receiver.velocity_mps = Some([9.0, 3.0, 0.0]);
        assert_eq!(made("motion-fading", "rician_k_db = -20").loss(&link), 0.0);
    }

    #[test]
    fn in_a_coherence_time_the_scattered_power_falls_to_a_part_in_e() {
        let scene = Scene::default();
        let mut link = along_x(10.0, 1.0, None, &scene);
        // 0.423 turns in 4 ms; at 0 dB half of the power is scattered.
        let speed_mps = 0.423 / 0.004 * link.wavelength_m();
        link.sender.velocity_mps = Some([speed_mps, 0.0, 0.0]);
        for (k_db, scattered) in [(-60.0, 1.0), (0.0, 0.5)] {
            let keys = format!("rician_k_db = {k_db:?}\nframe_ms = 4.0");
            let got = made("motion-fading", &keys).loss(&link);
            assert!((got - scattered * 0.632_121).abs() < 2e-6, "{k_db}: {got}");
        }
    }

    #[test]
    fn speeds_may_be_columns() {
        let effect = made("motion-fading", "rician_k_db = -20\nlaw = 'correlation'");
        let loss_with = |row: &[(&str, f64)]| {
            let row: Vec<_> = row.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
            let scene = Scene { covariates: Covariates::Row(&row), ..Scene::default() };
            effect.loss(&along_x(10.0, 1.0, None, &scene))
        };
        let five = loss_with(&[("relative_speed_mps", 5.0)]);
        assert!((five - 0.14).abs() < 0.005, "as documented: {five}");
        assert_eq!(loss_with(&[("tx_speed_mps", 3.0), ("rx_speed_mps", 4.0)]), five);
        assert_eq!(loss_with(&[("humidity_pct", 5.0)]), 0.0);
    }
}
