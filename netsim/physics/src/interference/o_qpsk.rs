//! Interference by the bit error rate of IEEE 802.15.4's O-QPSK.

use super::{Entry, Noise, Rule, milliwatts};
use crate::memo::Memo;
use crate::reception::o_qpsk::bit_error_rate;
use proto::config::{Section, variant};

/// `kind = "o-qpsk"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("o-qpsk"),
    build: |table| {
        let keys = Keys::read(table);
        let rule = OQpsk::new(keys.noise.noise_floor_dbm, keys.co_channel_rejection_db);
        let bit_ns = keys.bit_rate_bps.map_or(rule.bit_ns, |bps| 1e9 / bps);
        Some(Box::new(OQpsk { bit_ns, ..rule }))
    },
};

/// The bit error rate of 2.4 GHz O-QPSK over the signal-to-interference-and-noise ratio (IEEE Std 802.15.4-2006, E.4.1.8), for every bit
/// with interference.
#[derive(Section)]
struct Keys {
    #[key(flatten)]
    noise: Noise,
    /// Co-channel rejection (dB): how much stronger a frame of 20 bytes must be than another one on its channel for 1 % of such frames to
    /// be lost, and for a receiver to switch to it from an earlier frame. 3: the data sheet of the CC2420. 0.5: as if the other frame
    /// were white noise.
    #[key(range = -10.0..=40.0, default = 3.0)]
    co_channel_rejection_db: f64,
    /// Bit rate (bit/s). Absent: 250000, that of 2.4 GHz.
    #[key(range = 1e2..=1e9)]
    bit_rate_bps: Option<f64>,
}

/// Interference by the bit error rate.
///
/// # Model
///
/// With the bit error rate BER of [`bit_error_rate`], over n disturbed bits (4 µs each at 250 kbit/s):
///
/// ```text
/// factor = ((1 − BER(S / (N + w I))) / (1 − BER(S / N)))^n
/// ```
///
/// The weight w stands for this: a frame of the same modulation disturbs more than white noise of the same power, since
/// despreading does not suppress it as well. It is set so that a frame of 20 bytes which exceeds one other by the
/// co-channel rejection is lost with 1 %, the criterion of data sheets (IEEE Std 802.15.4-2006, 6.1.7: 20 octets, 1 %). The
/// default is the CC2420's 3 dB (data sheet SWRS041, receive section), w = 1.77.
///
/// # Validity
///
/// One other frame, with neither fading nor frequency offset between them. Several add up as powers. Frames that are the
/// same bit for bit (constructive interference) count as any others.
#[derive(Clone, Debug, PartialEq)]
pub struct OQpsk {
    noise_mw: f64,
    weight: f64,
    capture_db: f64,
    bit_ns: f64,
}

/// A bit lasts so long (ns): 250 kb/s.
const BIT_NS: f64 = 4000.0;
/// From this ratio on no bit is wrong: 12 dB, where the bit error rate is below 10⁻³⁰.
const CERTAIN: f64 = 15.848_931_924_611_133;
/// Bits of a frame of 20 bytes, headers of the physical layer included.
const CRITERION_BITS: f64 = 208.0;

thread_local! {
    static POWERS_MW: Memo = const { Memo::new() };
    static LOGS_RIGHT: Memo = const { Memo::new() };
}

/// As [`milliwatts`].
fn power_mw(level_dbm: f64) -> f64 {
    POWERS_MW.with(|memo| memo.value(level_dbm, milliwatts))
}

/// Logarithm of the probability that a bit is right.
fn log_right(sinr: f64) -> f64 {
    LOGS_RIGHT.with(|memo| memo.value(sinr, |sinr| libm::log1p(-bit_error_rate(sinr))))
}

impl OQpsk {
    /// Interference over this noise (dBm), with this co-channel rejection (dB).
    #[must_use]
    pub fn new(noise_floor_dbm: f64, co_channel_rejection_db: f64) -> Self {
        // The ratio that loses 1 %, by bisection.
        let (mut low, mut high) = (0.0, CERTAIN);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            let received = libm::exp(CRITERION_BITS * libm::log1p(-bit_error_rate(middle)));
            if received < 0.99 {
                low = middle;
            } else {
                high = middle;
            }
        }
        Self {
            noise_mw: milliwatts(noise_floor_dbm),
            weight: milliwatts(co_channel_rejection_db) / high,
            capture_db: co_channel_rejection_db,
            bit_ns: BIT_NS,
        }
    }
}

impl Rule for OQpsk {
    fn disturbance_mw(&self, rssi_dbm: f64) -> f64 {
        self.weight * power_mw(rssi_dbm)
    }

    fn survival(&self, signal_dbm: f64, interference_mw: f64, stretch_ns: i64, _: i64) -> f64 {
        let signal_mw = power_mw(signal_dbm);
        let sinr = signal_mw / (self.noise_mw + interference_mw);
        if CERTAIN <= sinr || interference_mw == 0.0 {
            return 1.0;
        }
        let snr = signal_mw / self.noise_mw;
        let quiet = if CERTAIN <= snr { 0.0 } else { log_right(snr) };
        let per_bit = log_right(sinr) - quiet;
        libm::exp(stretch_ns as f64 / self.bit_ns * per_bit).min(1.0)
    }

    fn capture_db(&self) -> f64 {
        self.capture_db
    }

    fn hides_preambles(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reception::Curve;
    use crate::reception::o_qpsk::OQpsk as NoiseCurve;

    const FRAME_NS: i64 = 4_256_000;

    #[test]
    fn a_frame_that_exceeds_another_by_the_co_channel_rejection_is_lost_with_1_percent() {
        for rejection_db in [-3.0, 0.5, 3.0, 10.0] {
            let rule = OQpsk::new(-105.0, rejection_db);
            let disturbance_mw = rule.disturbance_mw(-60.0 - rejection_db);
            let got = rule.survival(-60.0, disturbance_mw, 26 * 32_000, 26 * 32_000);
            // Noise, 45 dB lower, moves the ratio by 3e-5, and the loss at most 10 times as much, of 0.01.
            assert!((got - 0.99).abs() < 1e-5, "{rejection_db} dB: {got}");
        }
    }

    #[test]
    fn white_noise_would_need_0_5_db() {
        let rule = OQpsk::new(-105.0, 0.5);
        // As the key's documentation says, to the digit that it gives.
        assert!((10.0 * libm::log10(rule.weight)).abs() < 0.05, "{}", rule.weight);
    }

    #[test]
    fn interference_as_strong_as_noise_is_noise_counted_once() {
        // With weight 1 a disturbance of the noise's power makes 3.01 dB more noise: the reception curve over that.
        let mut rule = OQpsk::new(-105.0, 0.5);
        rule.weight = 1.0;
        for signal_dbm in [-103.0, -102.0, -101.0, -100.0] {
            let quiet = NoiseCurve::new(-105.0, 133).reception_probability(signal_dbm);
            let disturbed =
                quiet * rule.survival(signal_dbm, rule.disturbance_mw(-105.0), FRAME_NS, FRAME_NS);
            let doubled_dbm = -105.0 + 10.0 * libm::log10(2.0);
            let expected = NoiseCurve::new(doubled_dbm, 133).reception_probability(signal_dbm);
            // Sums of terms up to 10^4 on both sides.
            assert!((disturbed - expected).abs() < 1e-9, "{signal_dbm}: {disturbed} {expected}");
        }
    }
}
