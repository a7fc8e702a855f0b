//! Columns that hold another reading of a received frame, such as its signal-to-noise ratio.
//!
//! The error of one reading is in the other, so that such a column explains readings better than any cause does.

use super::LinkRow;
use numbers::power::square;

/// What registers of received frames are called, as words of a column's name.
const NAMES: [&str; 12] =
    ["snr", "sinr", "snir", "lqi", "rssi", "rsrp", "rsrq", "rsni", "rcpi", "esno", "ebno", "noise"];
/// Fewest readings for a comparison.
const FEWEST_READINGS: usize = 20;
/// The spread of rounding over the step of readings.
const ROUNDING: f64 = 0.288_675;
/// Two readings are the same if a line between them leaves less than this share of what rounding spreads …
const ROUNDING_SHARE: f64 = 0.5;
/// … or, where readings are not rounded, of their standard deviation.
const EXACT_SHARE: f64 = 1e-6;

/// Whether a column is another reading of a received frame: by its name, unless frames that were lost have a value, too; or because it
/// agrees with the readings more closely than their rounding allows.
pub(super) fn is_one(name: &str, values: &[f64], rows: &[LinkRow], quantum_db: f64) -> bool {
    let pairs: Vec<[f64; 2]> = rows
        .iter()
        .zip(values)
        .map(|(row, &value)| [value, row.rssi_dbm])
        .filter(|pair| pair.iter().all(|value| value.is_finite()))
        .collect();
    let is_of_lost =
        rows.iter().zip(values).any(|(row, value)| row.received == 0.0 && value.is_finite());
    is_named(name) && !is_of_lost || is_same(&pairs, quantum_db)
}

/// Whether a column's name says that it is a reading of a received frame, such as `snr_db`.
#[must_use]
pub fn is_named(name: &str) -> bool {
    let lower = name.to_lowercase();
    lower.split(|letter: char| !letter.is_alphabetic()).any(|word| NAMES.contains(&word))
}

/// Whether a line between both of each pair leaves no more than rounding.
fn is_same(pairs: &[[f64; 2]], quantum_db: f64) -> bool {
    if pairs.len() < FEWEST_READINGS {
        return false;
    }
    let n = pairs.len() as f64;
    let mean = |k: usize| pairs.iter().map(|pair| pair[k]).sum::<f64>() / n;
    let means = [mean(0), mean(1)];
    let product = |a: usize, b: usize| {
        pairs.iter().map(|pair| (pair[a] - means[a]) * (pair[b] - means[b])).sum::<f64>() / n
    };
    let (of_column, of_readings) = (product(0, 0), product(1, 1));
    if of_column == 0.0 || of_readings == 0.0 {
        return false;
    }
    let left = of_readings - square(product(0, 1)) / of_column;
    let least_db = if 0.0 < quantum_db {
        ROUNDING_SHARE * ROUNDING * quantum_db
    } else {
        EXACT_SHARE * of_readings.sqrt()
    };
    left < square(least_db)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings of which the last are of lost frames.
    fn rows(n_lost: usize) -> Vec<LinkRow> {
        let row = |k: usize| LinkRow {
            line: k + 2,
            time_s: k as f64,
            run: 0,
            tx: 1,
            rx: 2,
            channel: None,
            tx_m: [0.0; 3],
            rx_m: [0.0; 3],
            tx_heading_rad: f64::NAN,
            rx_heading_rad: f64::NAN,
            rssi_dbm: if k + n_lost < 40 { -60.0 - ((k * k) % 13) as f64 } else { f64::NAN },
            frames: 1.0,
            received: f64::from(u8::from(k + n_lost < 40)),
        };
        (0..40).map(row).collect()
    }

    #[test]
    fn registers_are_known_by_their_names_where_received_frames_alone_have_them() {
        let rows = rows(5);
        let of_received: Vec<f64> =
            (0..40).map(|k| if k < 35 { (k * 7 % 11) as f64 } else { f64::NAN }).collect();
        for name in ["snr_db", "SNR", "rx_lqi", "noise_dbm"] {
            assert!(is_one(name, &of_received, &rows, 1.0), "{name}");
        }
        assert!(!is_one("temperature_c", &of_received, &rows, 1.0));
        // A noise floor that is known of lost frames is no reading of a frame.
        let of_all: Vec<f64> = (0..40).map(|k| (k * 7 % 11) as f64).collect();
        assert!(!is_one("noise_dbm", &of_all, &rows, 1.0));
    }

    #[test]
    fn what_follows_readings_below_their_rounding_is_the_same_register() {
        let rows = rows(0);
        let doubled: Vec<f64> = rows.iter().map(|row| 2.0 * row.rssi_dbm + 255.0).collect();
        assert!(is_one("raw", &doubled, &rows, 1.0));
        // An attenuator is followed up to rounding and noise.
        let near = |k: usize| rows[k].rssi_dbm + [0.3, -0.3, 0.1][k % 3];
        let attenuation: Vec<f64> = (0..40).map(near).collect();
        assert!(!is_one("attenuation_db", &attenuation, &rows, 1.0));
    }
}
