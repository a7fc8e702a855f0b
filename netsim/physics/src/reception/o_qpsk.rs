//! The bit error rate of IEEE 802.15.4's O-QPSK in noise.

use super::{Curve, Entry};
use proto::config::{Problem, Section, variant};

/// `kind = "o-qpsk"`.
pub const ENTRY: Entry = Entry { variant: variant::<Keys>("o-qpsk"), build };

/// Bit error rate (dimensionless) of 2.4 GHz O-QPSK in white Gaussian noise.
///
/// # Model
///
/// Non-coherent detection of 16 quasi-orthogonal 32-chip sequences, IEEE Std 802.15.4-2006, Annex E, § E.4.1.8:
///
/// ```text
/// BER = 8/15 · 1/16 · Σ_{k=2}^{16} (−1)^k C(16, k) exp(20 · SINR · (1/k − 1))
/// ```
///
/// # Arguments
///
/// * `sinr`: signal to interference-plus-noise ratio over the 2 MHz channel, linear (W/W), not dB; finite, not negative.
///
/// # Validity
///
/// Interference counts as Gaussian noise. Absent: multipath within the symbol, frequency offset, implementation loss; a
/// real receiver needs some dB more.
///
/// # Examples
///
/// ```
/// use physics::reception::o_qpsk::bit_error_rate;
///
/// let sinr = 10f64.powf(2.0 / 10.0); // 2 dB
/// assert!((bit_error_rate(sinr) - 5.13e-7).abs() < 0.01e-7);
/// ```
#[must_use]
pub fn bit_error_rate(sinr: f64) -> f64 {
    debug_assert!(sinr.is_finite() && 0.0 <= sinr, "sinr must be finite and >= 0, got {sinr}");
    let mut sum = 0.0;
    for k in 2..=16 {
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        let k = f64::from(k);
        sum += sign * BINOMIAL_16[k as usize] * libm::exp(20.0 * sinr * (1.0 / k - 1.0));
    }
    // The alternating sum can stray below zero by rounding where the true value vanishes.
    (8.0 / 15.0 / 16.0 * sum).clamp(0.0, 0.5)
}

/// C(16, k).
const BINOMIAL_16: [f64; 17] = [
    1.0, 16.0, 120.0, 560.0, 1820.0, 4368.0, 8008.0, 11440.0, 12870.0, 11440.0, 8008.0, 4368.0,
    1820.0, 560.0, 120.0, 16.0, 1.0,
];

/// Reception where every bit must be right: (1 − BER)^(8 · bytes).
///
/// # Model
///
/// SINR = 10^((RSSI − noise floor)/10), [`bit_error_rate`], independent bits.
///
/// # Validity
///
/// As the bit error rate. The probability counts as 0 where it is below 10⁻¹², and as 1 from 12 dB on, where the bit error
/// rate is below 10⁻³⁰.
#[derive(Clone, Debug, PartialEq)]
pub struct OQpsk {
    noise_floor_dbm: f64,
    n_bits: f64,
    floor_dbm: f64,
}

/// SINR (dB) from which on no bit is wrong.
const CERTAIN_DB: f64 = 12.0;
/// Probability that counts as 0.
pub(super) const NEVER: f64 = 1e-12;

impl OQpsk {
    /// Reception of frames of `frame_bytes` over `noise_floor_dbm`.
    #[must_use]
    pub fn new(noise_floor_dbm: f64, frame_bytes: u32) -> Self {
        let mut curve =
            Self { noise_floor_dbm, n_bits: 8.0 * f64::from(frame_bytes), floor_dbm: f64::MIN };
        // The power at which the probability is NEVER, by bisection.
        let (mut low, mut high) = (noise_floor_dbm - 200.0, noise_floor_dbm + CERTAIN_DB);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if curve.reception_probability(middle) < NEVER {
                low = middle;
            } else {
                high = middle;
            }
        }
        curve.floor_dbm = low;
        curve
    }
}

impl Curve for OQpsk {
    fn reception_probability(&self, rssi_dbm: f64) -> f64 {
        let sinr_db = rssi_dbm - self.noise_floor_dbm;
        if rssi_dbm < self.floor_dbm {
            0.0
        } else if CERTAIN_DB <= sinr_db {
            1.0
        } else {
            let bit_error_rate = bit_error_rate(libm::pow(10.0, sinr_db / 10.0));
            libm::exp(self.n_bits * libm::log1p(-bit_error_rate))
        }
    }

    fn floor_dbm(&self) -> f64 {
        self.floor_dbm
    }

    fn ceiling_dbm(&self) -> f64 {
        self.noise_floor_dbm + CERTAIN_DB
    }
}

/// The bit error rate of 2.4 GHz O-QPSK over the signal-to-noise ratio (IEEE Std 802.15.4-2006, E.4.1.8), for every bit of the
/// frame.
#[derive(Section)]
struct Keys {
    /// Noise power in the receiver's channel (dBm). -105: the 6TiSCH simulator's.
    #[key(range = -200.0..=0.0, default = -105.0)]
    noise_floor_dbm: f64,
    /// Length of a frame on air (bytes). 127: the longest of IEEE 802.15.4.
    #[key(range = 1..=2047, default = 127)]
    frame_bytes: u32,
}

fn build(table: &toml::Table, _: &str, _: &mut Vec<Problem>) -> Option<Box<dyn Curve>> {
    let keys = Keys::read(table);
    Some(Box::new(OQpsk::new(keys.noise_floor_dbm, keys.frame_bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_ns3_lr_wpan_error_model_five_ratios() {
        // ns-3's test lr-wpan-error-model: SNR (dB), bit error rate, tolerance (its printed digits).
        for (snr_db, expected, tolerance) in [
            (5.0, 7.38e-14, 0.01e-14),
            (2.0, 5.13e-7, 0.01e-7),
            (-1.0, 0.00114, 0.00001),
            (-4.0, 0.0391, 0.0001),
            (-7.0, 0.175, 0.001),
        ] {
            let got = bit_error_rate(libm::pow(10.0, snr_db / 10.0));
            assert!((got - expected).abs() < tolerance, "{snr_db} dB: {got}");
        }
    }

    #[test]
    fn a_stronger_frame_is_never_less_likely_to_arrive_and_a_longer_one_never_likelier() {
        let (short, long) = (OQpsk::new(-105.0, 20), OQpsk::new(-105.0, 127));
        let mut before = 0.0;
        for step in -4000..=1500 {
            let rssi_dbm = -105.0 + f64::from(step) / 100.0;
            let now = long.reception_probability(rssi_dbm);
            // Near certainty neighbouring values differ by the rounding of a sum of terms up to 10^4.
            assert!(before <= now + 1e-9, "{rssi_dbm} dBm");
            assert!(now <= short.reception_probability(rssi_dbm) + 1e-9, "{rssi_dbm} dBm");
            before = now;
        }
        assert!(long.reception_probability(long.floor_dbm() - 1e-6) == 0.0);
        assert_eq!(before, 1.0);
    }
}
