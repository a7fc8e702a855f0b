use super::*;
use physics::reception::table::Table;

fn instrument(sd_db: f64) -> Instrument {
    let curve = SampledCurve::tabulate(&Table::dust());
    let spread = PowerMixture::none();
    let readings =
        Readings { quantum_db: 1.0, losses: Losses::Logged, is_aggregated: false, is_given: false };
    Instrument::new(curve, spread, Noise { sd_db, ..Noise::default() }, readings)
}

pub(crate) fn row(frames: f64, received: f64, rssi_dbm: f64) -> LinkRow {
    let place = [0.0; 3];
    LinkRow {
        line: 2,
        time_s: f64::NAN,
        run: 0,
        tx: 1,
        rx: 2,
        channel: None,
        tx_m: place,
        rx_m: place,
        tx_heading_rad: f64::NAN,
        rx_heading_rad: f64::NAN,
        rssi_dbm,
        frames,
        received,
    }
}

fn level(power_dbm: f64) -> RowPrediction {
    RowPrediction {
        power_dbm,
        register_db: 0.0,
        range: PowerRange::shifted(0.0),
        shift_db: 1.3,
        ln_survival: -0.2,
        stated: None,
    }
}

#[test]
fn readings_sum_to_what_is_received() {
    for power_dbm in [-98.0, -95.3, -90.0, -80.0] {
        let (instrument, level) = (instrument(2.0), level(power_dbm));
        let readings = (-120..-60).map(f64::from);
        let sum: f64 = readings
            .map(|rssi| libm::exp(instrument.row_likelihood(&row(1.0, 1.0, rssi), &level, 0.0).log))
            .sum();
        let passes = instrument.reception(&level, 0.0);
        assert!((sum - passes).abs() < 2e-3 * passes.max(0.1), "{power_dbm}: {sum} {passes}");
    }
}

#[test]
fn readings_of_frames_that_were_logged_if_received_sum_to_one_and_have_these_slopes() {
    let of = |sd_db: f64| {
        let all = instrument(sd_db);
        let readings = Readings { losses: Losses::NotLogged, ..all.readings };
        Instrument::new(all.curve, all.spread, Noise { sd_db, ..Noise::default() }, readings)
    };
    let at = |power_dbm: f64, rssi_dbm: f64, sd_db: f64| {
        of(sd_db).row_likelihood(&row(1.0, 1.0, rssi_dbm), &level(power_dbm), 0.0)
    };
    for power_dbm in [-95.31, -91.03, -84.05] {
        let readings = (-120..-60).map(f64::from);
        let sum: f64 = readings.map(|rssi_dbm| libm::exp(at(power_dbm, rssi_dbm, 2.0).log)).sum();
        assert!((sum - 1.0).abs() < 5e-3, "{power_dbm}: {sum}");
        for rssi_dbm in [-93.0, -90.0, -86.0] {
            let (here, h) = (at(power_dbm, rssi_dbm, 2.0), 1e-3);
            let apart = |f: &dyn Fn(f64) -> f64| (f(h) - f(-h)) / (2.0 * h);
            let by_level = apart(&|h| at(power_dbm + h, rssi_dbm, 2.0).log);
            let by_ln_sd = apart(&|h| at(power_dbm, rssi_dbm, 2.0 * libm::exp(h)).log);
            for (slope, difference) in [(here.over_level, by_level), (here.over_ln_sd, by_ln_sd)] {
                let tolerance = 0.02 * difference.abs().max(1.0);
                assert!((slope - difference).abs() < tolerance, "{slope} {difference}");
            }
            assert!(0.0 < here.weight);
        }
    }
}

/// A register that flattens in the middle of where frames are lost.
fn saturating(power_dbm: f64) -> f64 {
    power_dbm.min(-93.0) + 0.4 * (power_dbm + 93.0).max(0.0)
}

fn bent(power_dbm: f64, rssi_dbm: f64) -> RowPrediction {
    RowPrediction { range: PowerRange::of_reading(&saturating, rssi_dbm, 1.0), ..level(power_dbm) }
}

#[test]
fn readings_of_a_bent_register_sum_to_what_is_received() {
    for power_dbm in [-98.0, -94.0, -90.0, -80.0] {
        let instrument = instrument(2.0);
        let (mut sum, mut mean_dbm) = (0.0, 0.0);
        for rssi_dbm in (-120..-60).map(f64::from) {
            let level = bent(power_dbm, rssi_dbm);
            let share =
                libm::exp(instrument.row_likelihood(&row(1.0, 1.0, rssi_dbm), &level, 0.0).log);
            sum += share;
            mean_dbm += share * rssi_dbm;
        }
        let level =
            RowPrediction { register_db: saturating(power_dbm) - power_dbm, ..level(power_dbm) };
        let passes = instrument.reception(&level, 0.0);
        assert!((sum - passes).abs() < 2e-3 * passes.max(0.1), "{power_dbm}: {sum} {passes}");
        let (reading_dbm, _) = instrument.reading(&level, 0.0, Some(&saturating));
        let mean_dbm = mean_dbm / sum;
        assert!((mean_dbm - reading_dbm).abs() < 0.05, "{power_dbm}: {mean_dbm} {reading_dbm}");
    }
}

#[test]
fn normal_noise_alone_is_as_a_spread_of_which_both_halves_are_alike() {
    let alone = instrument(2.0);
    let halves = PowerMixture(vec![(0.0, 0.5), (0.0, 0.5)]);
    let both = Instrument::new(alone.curve.clone(), halves, alone.noise(), alone.readings);
    for (power_dbm, deviation_db) in [(-95.0, -3.0), (-92.4, 0.3), (-90.0, 11.0)] {
        let [a, b] = [&alone, &both].map(|it| it.rounded(power_dbm, deviation_db));
        for (a, b) in [
            (a.log, b.log),
            (a.over_level, b.over_level),
            (a.weight, b.weight),
            (a.over_ln_sd, b.over_ln_sd),
        ] {
            assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{power_dbm}: {a} {b}");
        }
    }
}

#[test]
fn slopes_of_rounded_readings_are_those_of_the_likelihood() {
    let plain = [-96.0, -95.0, -91.0, -79.0].map(|rssi_dbm| (rssi_dbm, false));
    let above = [-95.0, -93.0, -91.0, -87.0].map(|rssi_dbm| (rssi_dbm, true));
    for (rssi_dbm, is_bent) in plain.into_iter().chain(above) {
        let likelihood_at = |power_dbm: f64, sd_db: f64| {
            let level = if is_bent { bent(power_dbm, rssi_dbm) } else { level(power_dbm) };
            instrument(sd_db).row_likelihood(&row(1.0, 1.0, rssi_dbm), &level, 0.0)
        };
        let (here, h) = (likelihood_at(-94.0, 2.0), 1e-3);
        let by_level =
            (likelihood_at(-94.0 + h, 2.0).log - likelihood_at(-94.0 - h, 2.0).log) / (2.0 * h);
        let by_sd = (likelihood_at(-94.0, 2.0 + h).log - likelihood_at(-94.0, 2.0 - h).log) / h;
        let bend = (likelihood_at(-94.0 + h, 2.0).over_level
            - likelihood_at(-94.0 - h, 2.0).over_level)
            / (2.0 * h);
        for (slope, difference) in
            [(here.over_level, by_level), (here.over_ln_sd, by_sd), (here.weight, -bend)]
        {
            let tolerance = 1e-5 * difference.abs().max(1.0);
            assert!((slope - difference).abs() < tolerance, "{rssi_dbm}: {difference} {here:?}");
        }
    }
}
