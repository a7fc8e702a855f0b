//! What a reading says about power, whatever the register makes of it.

use crate::thresholds::UNROUNDED_STEP_DB;
use numbers::optimise::roots::{Sample, illinois};

/// Registers read powers between these (dBm); where one never reads as much as was read, it was more power than this.
const POWERS_DBM: (f64, f64) = (-250.0, 100.0);
/// Ranges of powers that are wider, or narrower, than the step of readings by less than this share are as wide.
const AS_WIDE: f64 = 1e-6;
/// Most steps of a search, and how close it comes (dB).
const MOST_STEPS: usize = 100;
const CLOSE_DB: f64 = 1e-11;

/// What a register makes of powers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Register {
    /// It reads what there is.
    Exact,
    /// It reads as much more, or less, of every power.
    Shifted,
    /// What it reads more depends on the power.
    Bent,
}

impl Register {
    /// Classifies a register by its response: the reading (dBm) at every power (dBm).
    #[must_use]
    pub fn classify(read_dbm: &dyn Fn(f64) -> f64) -> Self {
        let more_db = |step: i32| {
            let power_dbm = 2.0 * f64::from(step);
            read_dbm(power_dbm) - power_dbm
        };
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for more in (-60..=10).map(more_db) {
            (least, most) = (least.min(more), most.max(more));
        }
        if AS_WIDE < most - least {
            Self::Bent
        } else if least != 0.0 || most != 0.0 {
            Self::Shifted
        } else {
            Self::Exact
        }
    }
}

/// The range of powers that gives one reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerRange {
    /// The reading less the power in their middle (dB).
    pub offset_db: f64,
    /// How wide they lie for a decibel of readings; exactly 1 where the register only shifts.
    pub stretch: f64,
}

impl PowerRange {
    /// Where the register reads as much more of every power (dB).
    #[must_use]
    pub const fn shifted(offset_db: f64) -> Self {
        Self { offset_db, stretch: 1.0 }
    }

    /// Powers with this reading (dBm), which is rounded to steps (dB; 0: it is not), of a register that never reads less of more.
    #[must_use]
    pub fn of_reading(read_dbm: &dyn Fn(f64) -> f64, reading_dbm: f64, quantum_db: f64) -> Self {
        let quantum_db = width_db(quantum_db);
        let [low, high] =
            [-0.5, 0.5].map(|half| power_dbm(read_dbm, reading_dbm + half * quantum_db));
        let stretch = (high - low) / quantum_db;
        let is_as_wide = (stretch - 1.0).abs() < AS_WIDE;
        Self {
            offset_db: reading_dbm - 0.5 * (low + high),
            stretch: if is_as_wide { 1.0 } else { stretch.max(AS_WIDE) },
        }
    }

    /// All powers at and below the one with this reading (dBm): of a register that shifts by so much (dB) and reads no less.
    #[must_use]
    pub fn below(reading_dbm: f64, shift_db: f64, quantum_db: f64) -> Self {
        let high_dbm = reading_dbm - shift_db + 0.5 * width_db(quantum_db);
        Self::between(POWERS_DBM.0.min(high_dbm - 1.0), high_dbm, reading_dbm, quantum_db)
    }

    /// All powers at and above the one with this reading (dBm): of a register that shifts by so much (dB) and reads no more.
    #[must_use]
    pub fn above(reading_dbm: f64, shift_db: f64, quantum_db: f64) -> Self {
        let low_dbm = reading_dbm - shift_db - 0.5 * width_db(quantum_db);
        Self::between(low_dbm, POWERS_DBM.1.max(low_dbm + 1.0), reading_dbm, quantum_db)
    }

    fn between(low_dbm: f64, high_dbm: f64, reading_dbm: f64, quantum_db: f64) -> Self {
        Self {
            offset_db: reading_dbm - 0.5 * (low_dbm + high_dbm),
            stretch: (high_dbm - low_dbm) / width_db(quantum_db),
        }
    }
}

/// The width of readings (dB) that are rounded to such steps.
#[must_use]
pub fn width_db(quantum_db: f64) -> f64 {
    quantum_db.max(UNROUNDED_STEP_DB)
}

/// The least power (dBm) of which as much is read.
fn power_dbm(read_dbm: &dyn Fn(f64) -> f64, reading_dbm: f64) -> f64 {
    let missing = |power_dbm: f64| read_dbm(power_dbm) - reading_dbm;
    let sample = |x: f64| Sample { x, y: missing(x) };
    // Where it begins to be read lies between two powers, which are moved apart until it does.
    let (mut low, mut high) = (sample(reading_dbm), sample(reading_dbm));
    let mut step = 1.0;
    while 0.0 <= low.y && POWERS_DBM.0 < low.x {
        high = low;
        low = sample((low.x - low.y.max(step)).max(POWERS_DBM.0));
        step *= 2.0;
    }
    while high.y < 0.0 && high.x < POWERS_DBM.1 {
        low = high;
        high = sample((high.x - high.y.min(-step)).min(POWERS_DBM.1));
        step *= 2.0;
    }
    if 0.0 <= low.y || high.y < 0.0 {
        return if high.y < 0.0 { high.x } else { low.x };
    }
    // At once where both are on one straight line, as where the register only shifts.
    illinois(missing, (low, high), CLOSE_DB, MOST_STEPS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn saturating(slope: f64) -> impl Fn(f64) -> f64 {
        move |dbm: f64| if dbm <= -50.0 { dbm } else { -50.0 + slope * (dbm + 50.0) }
    }

    #[test]
    fn powers_of_a_reading_are_those_that_are_read_so() {
        let read = saturating(0.25);
        let range = |reading_dbm: f64| PowerRange::of_reading(&read, reading_dbm, 1.0);
        assert_eq!(range(-70.0), PowerRange::shifted(0.0));
        // -48 dBm is read from -44 to -40 dBm, and half a decibel about the knee from -50.5 to -48 dBm.
        for (reading_dbm, low_dbm, high_dbm) in [(-48.0, -44.0, -40.0), (-50.0, -50.5, -48.0)] {
            let PowerRange { offset_db, stretch } = range(reading_dbm);
            assert!((stretch - (high_dbm - low_dbm)).abs() < 1e-9, "{reading_dbm}: {stretch}");
            let middle_dbm = reading_dbm - offset_db;
            assert!((middle_dbm - 0.5 * (low_dbm + high_dbm)).abs() < 1e-9, "{reading_dbm}");
        }
    }

    #[test]
    fn what_is_never_read_takes_more_power_than_there_is() {
        let read = saturating(0.0);
        let last = PowerRange::of_reading(&read, -50.0, 1.0);
        assert!((last.stretch - (POWERS_DBM.1 + 50.5)).abs() < 1e-6, "{last:?}");
        let beyond = PowerRange::of_reading(&read, -48.0, 1.0);
        assert_eq!(-48.0 - beyond.offset_db, POWERS_DBM.1);
    }

    #[test]
    fn a_register_that_is_bent_smoothly_is_inverted() {
        let read = |dbm: f64| -40.0 - libm::log(1.0 + libm::exp(-0.1 * (dbm + 40.0))) / 0.1;
        for reading_dbm in [-95.0, -60.0, -45.0, -41.0] {
            let power_dbm = power_dbm(&read, reading_dbm);
            assert!((read(power_dbm) - reading_dbm).abs() < 1e-9, "{reading_dbm}: {power_dbm}");
        }
    }

    #[test]
    fn registers_are_told_by_what_they_read() {
        assert_eq!(Register::classify(&|dbm| dbm), Register::Exact);
        assert_eq!(Register::classify(&|dbm| dbm + 3.0), Register::Shifted);
        assert_eq!(Register::classify(&saturating(0.9)), Register::Bent);
    }
}
