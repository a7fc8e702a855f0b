//! The bit error rate of binary FSK in noise.

use super::o_qpsk::NEVER;
use super::{Curve, Entry};
use proto::config::{Section, variant};

/// `kind = "fsk"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("fsk"),
    build: |table, _, _| {
        let Keys { receiver, frame_bytes } = Keys::read(table);
        Some(Box::new(Fsk::new(receiver.noise_floor_dbm, receiver.gain(), frame_bytes)))
    },
};

/// Bit error rate of 2-FSK with orthogonal tones in white Gaussian noise, detected by energy.
///
/// # Model
///
/// ```text
/// BER = 1/2 exp(−(Eb/N0) / 2)
/// ```
///
/// Proakis, Digital Communications, 5th edition, 4.5 (non-coherent detection of orthogonal signals, M = 2).
///
/// # Arguments
///
/// * `ratio`: energy of a bit over the noise density, linear, not dB; finite, not negative.
///
/// # Examples
///
/// ```
/// use physics::reception::fsk::bit_error_rate;
///
/// let ratio = 10f64.powf(13.35 / 10.0); // 13.35 dB
/// assert!((bit_error_rate(ratio) - 1.0e-5).abs() < 0.1e-5);
/// ```
#[must_use]
pub fn bit_error_rate(ratio: f64) -> f64 {
    debug_assert!(ratio.is_finite() && 0.0 <= ratio, "ratio must be finite and >= 0, got {ratio}");
    0.5 * libm::exp(-0.5 * ratio)
}

/// Reception where every bit must be right: (1 − BER)^(8 · bytes).
///
/// # Model
///
/// Eb/N0 = 10^((RSSI − noise floor)/10) · bandwidth / bit rate, [`bit_error_rate`], independent bits.
///
/// # Validity
///
/// No fading within the frame, no frequency offset, no forward error correction. The probability counts as 0 where it is below
/// 10⁻¹², and as 1 from an Eb/N0 of 22 dB on, where the bit error rate is below 10⁻³⁴.
#[derive(Clone, Debug, PartialEq)]
pub struct Fsk {
    noise_floor_dbm: f64,
    gain: f64,
    n_bits: f64,
    floor_dbm: f64,
}

/// Eb/N0 (dB) from which on no bit is wrong.
const CERTAIN_DB: f64 = 22.0;

impl Fsk {
    /// Reception of frames of `frame_bytes` over `noise_floor_dbm`; `gain`: bandwidth over bit rate.
    #[must_use]
    pub fn new(noise_floor_dbm: f64, gain: f64, frame_bytes: u32) -> Self {
        let n_bits = 8.0 * f64::from(frame_bytes);
        // The probability is NEVER where the bit error rate is 1 − NEVER^(1/n).
        let bit_error_rate = -libm::expm1(libm::log(NEVER) / n_bits);
        let ratio = (-2.0 * libm::log(2.0 * bit_error_rate)).max(0.0);
        let floor_dbm = noise_floor_dbm + 10.0 * libm::log10(ratio / gain);
        // Short frames arrive by chance whatever the noise: they are not looked for 200 dB below it.
        Self { noise_floor_dbm, gain, n_bits, floor_dbm: floor_dbm.max(noise_floor_dbm - 200.0) }
    }
}

impl Curve for Fsk {
    fn reception_probability(&self, rssi_dbm: f64) -> f64 {
        if rssi_dbm < self.floor_dbm {
            0.0
        } else if self.ceiling_dbm() <= rssi_dbm {
            1.0
        } else {
            let ratio = libm::pow(10.0, (rssi_dbm - self.noise_floor_dbm) / 10.0) * self.gain;
            libm::exp(self.n_bits * libm::log1p(-bit_error_rate(ratio)))
        }
    }

    fn floor_dbm(&self) -> f64 {
        self.floor_dbm
    }

    fn ceiling_dbm(&self) -> f64 {
        self.noise_floor_dbm + CERTAIN_DB - 10.0 * libm::log10(self.gain)
    }
}

/// The bit error rate of 2-FSK, detected without phase, over the signal-to-noise ratio, for every bit of the frame.
#[derive(Section)]
struct Keys {
    #[key(flatten)]
    receiver: Receiver,
    /// Length of a frame on air (bytes). 127: the longest of 6TiSCH.
    #[key(range = 1..=2047, default = 127)]
    frame_bytes: u32,
}

/// The receiver of such frames, which interference weighs as well.
#[derive(Section)]
pub(crate) struct Receiver {
    /// Noise power in the receiver's bandwidth (dBm).
    #[key(range = -200.0..=0.0, default = -117.0)]
    pub(crate) noise_floor_dbm: f64,
    /// Bandwidth in which that noise is collected (Hz).
    #[key(range = 1e2..=1e9, default = 100e3)]
    pub(crate) bandwidth_hz: f64,
    /// Bit rate (bit/s).
    #[key(range = 1e2..=1e9, default = 50e3)]
    pub(crate) bit_rate_bps: f64,
}

impl Receiver {
    /// Bandwidth over bit rate.
    pub(crate) fn gain(&self) -> f64 {
        self.bandwidth_hz / self.bit_rate_bps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_a_frame_arrives_with_the_closed_form_of_its_bits() {
        let curve = Fsk::new(-117.0, 2.0, 20);
        for rssi_dbm in [-109.0, -108.0, -107.0, -105.0] {
            let ratio = 2.0 * 10f64.powf((rssi_dbm + 117.0) / 10.0);
            let expected = (1.0 - 0.5 * (-ratio / 2.0).exp()).powi(160);
            let got = curve.reception_probability(rssi_dbm);
            assert!((got - expected).abs() < 1e-12, "{rssi_dbm}: {got} {expected}");
        }
        // 1 % of frames of 20 bytes are lost at the sensitivity: Eb/N0 = 2 ln(160 / 0.02), to first order in the 1 %.
        let sensitivity_dbm = -117.0 + 10.0 * (2.0 * (160.0f64 / 0.0201).ln() / 2.0).log10();
        assert!((curve.reception_probability(sensitivity_dbm) - 0.99).abs() < 1e-4);
    }

    #[test]
    fn the_curve_rises_from_0_at_its_floor_to_1() {
        for bytes in [1, 20, 127, 2047] {
            let curve = Fsk::new(-117.0, 2.0, bytes);
            assert_eq!(curve.reception_probability(curve.floor_dbm() - 1e-6), 0.0);
            assert_eq!(curve.reception_probability(curve.ceiling_dbm()), 1.0);
            let mut before = 0.0;
            for step in -3000..=2500 {
                let now = curve.reception_probability(-117.0 + f64::from(step) / 100.0);
                // Rounding of the exponential function.
                assert!(before <= now + 1e-12, "{bytes} {step}");
                before = now;
            }
        }
    }
}
