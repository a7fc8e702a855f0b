//! Interference on two WiFi bands at once.

use super::air::{Air, layout, n_rows};
use super::answer::{Answer, Claim};
use super::{Case, Expected};
use crate::campaign::draws::Draws;
use crate::campaign::radio;

/// Half the width of a band (MHz).
const HALF_MHZ: f64 = 11.0;
/// Tolerance of a named centre (MHz): less than half the distance between channels.
const NEAR_MHZ: f64 = 2.4;

/// Centres (MHz) and duty cycles.
fn bands(seed: u64) -> [(f64, f64); 2] {
    let mut draws = Draws::new(seed, "two bands");
    let order = draws.order(3);
    [0, 1].map(|k| ([2412.0, 2437.0, 2462.0][order[k]], draws.between(0.15, 0.45)))
}

fn air(seed: u64) -> Air {
    let mut air = Air::new(seed, &layout(seed, 15.0), n_rows(seed, 4000, 5000));
    for (row, loss) in air.world.rows.iter().zip(&mut air.loss) {
        for (centre_mhz, duty) in bands(seed) {
            if (radio::centre_mhz(row.channel) - centre_mhz).abs() <= HALF_MHZ {
                *loss = 1.0 - (1.0 - *loss) * (1.0 - duty);
            }
        }
    }
    air
}

/// Honest: interference twice, with the two centres.
pub(super) fn case(seed: u64) -> Case {
    let air = air(seed);
    let sent = air.send();
    let claims = bands(seed).map(|(centre_mhz, _)| Claim {
        near: vec![("centre_mhz", [centre_mhz - NEAR_MHZ, centre_mhz + NEAR_MHZ])],
        ..Claim::of("interference")
    });
    let answer = Answer::of(claims.to_vec())
        .with_structure(&["frequency_mhz", "channel"])
        .with_error(air.error_over_noise(&sent));
    Case { csv: air.csv(&sent), config_toml: air.config(&sent), expected: Expected::Answer(answer) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_lost_on_four_channels_of_each_band() {
        for seed in 0..4 {
            let air = air(seed);
            for (centre_mhz, duty) in bands(seed) {
                // Channels 11 to 14, 16 to 19, 21 to 24.
                let first = 11 + ((centre_mhz - 2412.0) / 5.0).round() as u8;
                for (row, loss) in air.world.rows.iter().zip(&air.loss) {
                    if (first..first + 4).contains(&row.channel) {
                        assert!((loss - duty).abs() < 1e-12);
                    }
                }
            }
            let quiet = air.world.rows.iter().zip(&air.loss).filter(|(_, loss)| **loss == 0.0);
            let share = quiet.count() as f64 / air.loss.len() as f64;
            // 8 of 16 channels, over some 300 frames.
            assert!((share - 0.5).abs() < 0.13, "{share}");
        }
    }

    #[test]
    fn the_share_received_is_that_of_the_table_times_what_is_free() {
        let air = air(7);
        let sent = air.send();
        let [mut n, mut expected, mut variance] = [0.0; 3];
        for (row, reading) in sent.readings.iter().enumerate() {
            let power_dbm = sent.tx_power_dbm + air.level_db[row] + air.noise_db[row];
            let passes = radio::table(power_dbm) * (1.0 - air.loss[row]);
            n += f64::from(u8::from(reading.is_some()));
            expected += passes;
            variance += passes * (1.0 - passes);
        }
        assert!((n - expected).abs() < 4.0 * f64::sqrt(variance), "{n} {expected}");
    }
}
