//! Interference by the bit error rate of binary FSK.

use super::{Entry, Rule, milliwatts};
use crate::reception::fsk::{Receiver, bit_error_rate};
use proto::config::{Section, variant};

/// `kind = "fsk"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("fsk"),
    build: |table| Some(Box::new(Fsk::new(&Keys::read(table)))),
};

/// The bit error rate of 2-FSK, detected without phase, over the signal-to-interference-and-noise ratio, for every bit with
/// interference.
#[derive(Section)]
struct Keys {
    #[key(flatten)]
    receiver: Receiver,
    /// Co-channel rejection (dB): how much stronger a frame of 20 bytes must be than another one on its channel for 1 % of such frames to
    /// be lost, and for a receiver to switch to it from an earlier frame. 10: receivers of 2-FSK with modulation index 1.
    #[key(range = -10.0..=40.0, default = 10.0)]
    co_channel_rejection_db: f64,
}

/// Interference by the bit error rate.
///
/// # Model
///
/// As [`o_qpsk::OQpsk`](super::o_qpsk::OQpsk), with the bit error rate of [`bit_error_rate`] at
/// Eb/N0 = S / (N + w I) · bandwidth / bit rate. The weight w makes a frame of 20 bytes, with 8 of the physical layer before it,
/// that exceeds one other by the co-channel rejection be lost with 1 %.
///
/// # Validity
///
/// One other frame, with neither fading nor frequency offset between them. Several add up as powers.
#[derive(Clone, Debug, PartialEq)]
pub struct Fsk {
    noise_mw: f64,
    gain: f64,
    bit_ns: f64,
    weight: f64,
    capture_db: f64,
}

/// Bits of a frame of 20 bytes, headers of the physical layer included.
const CRITERION_BITS: f64 = 224.0;

impl Fsk {
    fn new(keys: &Keys) -> Self {
        let gain = keys.receiver.gain();
        let criterion = -libm::expm1(libm::log(0.99) / CRITERION_BITS);
        let ratio = -2.0 * libm::log(2.0 * criterion);
        Self {
            noise_mw: milliwatts(keys.receiver.noise_floor_dbm),
            gain,
            bit_ns: 1e9 / keys.receiver.bit_rate_bps,
            weight: milliwatts(keys.co_channel_rejection_db) * gain / ratio,
            capture_db: keys.co_channel_rejection_db,
        }
    }

    /// Logarithm of the probability that a bit is right.
    fn log_right(&self, signal_mw: f64, disturbance_mw: f64) -> f64 {
        libm::log1p(-bit_error_rate(signal_mw / disturbance_mw * self.gain))
    }
}

impl Rule for Fsk {
    fn disturbance_mw(&self, rssi_dbm: f64) -> f64 {
        self.weight * milliwatts(rssi_dbm)
    }

    fn survival(&self, signal_dbm: f64, interference_mw: f64, stretch_ns: i64, _: i64) -> f64 {
        if interference_mw == 0.0 {
            return 1.0;
        }
        let signal_mw = milliwatts(signal_dbm);
        let per_bit = self.log_right(signal_mw, self.noise_mw + interference_mw)
            - self.log_right(signal_mw, self.noise_mw);
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
    use crate::reception::Curve as _;
    use crate::reception::fsk::Fsk as NoiseCurve;

    fn rule(co_channel_rejection_db: f64) -> Fsk {
        let (noise_floor_dbm, bandwidth_hz, bit_rate_bps) = (-117.0, 100e3, 50e3);
        let receiver = Receiver { noise_floor_dbm, bandwidth_hz, bit_rate_bps };
        Fsk::new(&Keys { receiver, co_channel_rejection_db })
    }

    #[test]
    fn a_frame_that_exceeds_another_by_the_co_channel_rejection_is_lost_with_1_percent() {
        for rejection_db in [3.0, 10.0] {
            let rule = rule(rejection_db);
            let disturbance_mw = rule.disturbance_mw(-50.0 - rejection_db);
            let got = rule.survival(-50.0, disturbance_mw, 28 * 160_000, 28 * 160_000);
            // Noise, more than 57 dB lower, moves the exponent by 2e-6 of 9.
            assert!((got - 0.99).abs() < 1e-5, "{rejection_db} dB: {got}");
        }
    }

    #[test]
    fn interference_as_strong_as_noise_is_noise_counted_once() {
        let rule = Fsk { weight: 1.0, ..rule(10.0) };
        let frame_ns = 135 * 160_000;
        for signal_dbm in [-107.0, -106.0, -105.0] {
            let quiet = NoiseCurve::new(-117.0, 2.0, 135).reception_probability(signal_dbm);
            let disturbed =
                quiet * rule.survival(signal_dbm, milliwatts(-117.0), frame_ns, frame_ns);
            let doubled_dbm = -117.0 + 10.0 * libm::log10(2.0);
            let expected = NoiseCurve::new(doubled_dbm, 2.0, 135).reception_probability(signal_dbm);
            assert!((disturbed - expected).abs() < 1e-9, "{signal_dbm}: {disturbed} {expected}");
        }
    }
}
