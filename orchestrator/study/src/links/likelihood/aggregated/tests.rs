use super::*;
use crate::links::likelihood::Noise;
use crate::links::likelihood::reception::{PowerMixture, SampledCurve};
use crate::links::likelihood::tests::row;
use measure::links::{Losses, Readings};
use numbers::power::square;
use physics::reception::Curve;

/// Half of all frames at −90 dBm, 1.5 dB wide.
#[derive(Debug)]
struct Normal;

impl Curve for Normal {
    fn reception_probability(&self, rssi_dbm: f64) -> f64 {
        0.5 * libm::erfc(-(rssi_dbm + 90.0) / 1.5 / std::f64::consts::SQRT_2)
    }
    fn floor_dbm(&self) -> f64 {
        -99.0
    }
    fn ceiling_dbm(&self) -> f64 {
        -81.0
    }
}

fn instrument(sd_db: f64, link_sd_db: f64) -> Instrument {
    let readings =
        Readings { quantum_db: 0.0, losses: Losses::Logged, is_aggregated: true, is_given: false };
    let noise = Noise { sd_db, link_sd_db, ..Noise::default() };
    Instrument::new(SampledCurve::tabulate(&Normal), PowerMixture::none(), noise, readings)
        .with_tables(&[])
}

fn level(power_dbm: f64) -> RowPrediction {
    RowPrediction {
        power_dbm,
        register_db: 0.0,
        range: PowerRange::shifted(0.0),
        shift_db: 0.0,
        ln_survival: 0.0,
        stated: None,
    }
}

#[test]
fn far_above_the_curve_it_is_the_normal_density_of_the_mean() {
    let slope =
        instrument(2.0, 3.0).aggregated_likelihood(&row(100.0, 100.0, -52.0), &level(-50.0), 0.0);
    // A stray loss in a thousand; the mean varies by 3 dB and by the least.
    let variance: f64 = 9.0 + 0.09;
    let expected = 100.0 / (1.0 + 99.0 * FRAME_CORRELATION) * libm::log(1.0 - STRAY_FRAMES)
        - 0.5 * (4.0 / variance + libm::log(std::f64::consts::TAU * variance));
    assert!((slope.log - expected).abs() < 1e-6, "{} {expected}", slope.log);
    assert!((slope.over_level + 2.0 / variance).abs() < 1e-6);
    assert!((slope.weight - 1.0 / variance).abs() < 1e-6);
    assert!(
        (slope.over_ln_link_sd - (9.0 * 4.0 / variance / variance - 9.0 / variance)).abs() < 1e-5
    );
}

#[test]
fn slopes_are_those_of_the_likelihood() {
    for (received, rssi) in [(0.0, f64::NAN), (7.0, -88.5), (35.0, -88.0), (50.0, -86.0)] {
        let seen = row(50.0, received, rssi);
        let likelihood_at = |power: f64, sd: f64, link_sd: f64| {
            instrument(sd, link_sd).aggregated_likelihood(&seen, &level(power), 0.0)
        };
        // Moments of frames that pass are taken from tables, linear between their points: an integral is off by 1e-3 nats, and
        // a difference over 0.1 by 0.02, over 0.02 by 0.06.
        let (h, here) = (0.2, likelihood_at(-89.0, 2.0, 1.5));
        let by_level = (likelihood_at(-89.0 + h, 2.0, 1.5).log
            - likelihood_at(-89.0 - h, 2.0, 1.5).log)
            / (2.0 * h);
        let h = 0.05f64;
        let by_link = (likelihood_at(-89.0, 2.0, 1.5 * libm::exp(h)).log
            - likelihood_at(-89.0, 2.0, 1.5 * libm::exp(-h)).log)
            / (2.0 * h);
        let by_sd = (likelihood_at(-89.0, 2.0 * 1.02, 1.5).log - here.log) / libm::log(1.02);
        assert!(
            (here.over_level - by_level).abs() < 1e-2,
            "{received}: {} {by_level}",
            here.over_level
        );
        assert!(
            (here.over_ln_link_sd - by_link).abs() < 2e-2,
            "{received}: {} {by_link}",
            here.over_ln_link_sd
        );
        assert!((here.over_ln_sd - by_sd).abs() < 6e-2, "{received}: {} {by_sd}", here.over_ln_sd);
    }
}

#[test]
fn tables_say_what_integrals_say() {
    let plain = instrument(2.0, 3.0);
    let tabled = plain.clone().with_tables(&[50.0]);
    let silent = row(50.0, 0.0, f64::NAN);
    for power in [-130.0, -95.3, -90.1, -87.7, -80.0, -74.2] {
        let [a, b] =
            [&plain, &tabled].map(|one| one.aggregated_likelihood(&silent, &level(power), 0.0));
        assert!((a.log - b.log).abs() < 1e-4, "{power}: {a:?} {b:?}");
        assert!((a.over_level - b.over_level).abs() < 1e-4, "{power}: {a:?} {b:?}");
        // A ratio of two integrals over 2 %: errors of 1e-3 count for fifty times as much.
        assert!((a.over_ln_sd - b.over_ln_sd).abs() < 5e-2, "{power}: {a:?} {b:?}");
        assert!((a.over_ln_link_sd - b.over_ln_link_sd).abs() < 1e-2, "{power}: {a:?} {b:?}");
    }
    // In closed form above the curve, by an integral where anything can be lost for weakness.
    let strong = row(50.0, 49.0, -70.0);
    let without = Instrument { tabulated: None, ..plain.clone() };
    for power in [-60.0, -72.0, -95.0] {
        let [a, b] =
            [&without, &plain].map(|one| one.aggregated_likelihood(&strong, &level(power), 0.0));
        assert!((a.log - b.log).abs() < 2e-3, "{power}: {a:?} {b:?}");
        assert!((a.over_level - b.over_level).abs() < 1e-3, "{power}: {a:?} {b:?}");
        assert!((a.over_ln_sd - b.over_ln_sd).abs() < 1e-3, "{power}: {a:?} {b:?}");
    }
}

#[test]
fn few_points_say_what_many_say() {
    let few = instrument(2.0, 3.0);
    for (received, rssi) in [(99.0, -84.0), (80.0, -88.5), (50.0, -88.5), (10.0, -89.0)] {
        for power in [-80.0, -90.0, -96.0] {
            let row = row(100.0, received, rssi);
            let counts = RowCounts::from_row(&row, &few);
            let u = |k: u32| -120.0 + 0.005 * f64::from(k);
            let sum: f64 = (0..14_000)
                .map(|k| few.log_likelihood_at(&counts, &PLAIN, u(k)) - square(u(k) - power) / 18.0)
                .map(libm::exp)
                .sum();
            let exact = libm::log(sum * 0.005) - 0.5 * (libm::log(9.0) + LN_TAU);
            let found = few.integral(&counts, &PLAIN, power, 9.0).log;
            assert!((found - exact).abs() < 0.01, "{received} at {power}: {found} {exact}");
        }
    }
}

#[test]
fn a_level_far_from_what_was_seen_has_slopes() {
    for (received, rssi, power) in
        [(45.0, -90.09, -56.7), (40.0, -89.2, -59.4), (0.0, f64::NAN, 0.0)]
    {
        let slope = instrument(2.0, 20.0).aggregated_likelihood(
            &row(1000.0, received, rssi),
            &level(power),
            0.0,
        );
        let all =
            [slope.log, slope.over_level, slope.weight, slope.over_ln_sd, slope.over_ln_link_sd];
        assert!(all.iter().all(|value| value.is_finite()), "{slope:?}");
        assert!(slope.over_level < 0.0, "{slope:?}");
    }
}

#[test]
fn a_row_that_nobody_received_says_that_the_level_is_low() {
    let weak =
        instrument(2.0, 2.0).aggregated_likelihood(&row(100.0, 0.0, f64::NAN), &level(-90.0), 0.0);
    assert!(weak.over_level < -0.5, "{weak:?}");
    let [_, _, share, sd] =
        instrument(2.0, 2.0).row_of(&row(100.0, 0.0, f64::NAN), &level(-90.0), (0.0, 0.0), None);
    assert!((share - 0.5).abs() < 0.01 && 0.1 < sd, "{share} {sd}");
}
