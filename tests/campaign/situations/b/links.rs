//! Situations of links.

use super::radio::{Change, Radio, Shape, distance_m};
use crate::campaign::situations::Case;
use crate::campaign::situations::files::{LinkRow, Log};
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;
use std::f64::consts::{PI, TAU};

pub(super) fn nothing(seed: u64) -> Case {
    Radio::new(seed, Shape::Carts).finish(Log::All)
}

pub(super) fn nothing_star(seed: u64) -> Case {
    Radio::new(seed, Shape::Star).finish(Log::All)
}

/// A third of the lines is in the file twice.
pub(super) fn nothing_twice(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Corridor);
    radio.permit(&["measurement:duplicates"]);
    let mut draws = radio.draws.clone();
    let case = radio.finish(Log::All);
    let mut csv = String::new();
    for (index, line) in case.csv.lines().enumerate() {
        let times = if 0 < index && draws.chance(1.0 / 3.0) { 2 } else { 1 };
        for _ in 0..times {
            csv.push_str(line);
            csv.push('\n');
        }
    }
    Case { csv, ..case }
}

/// The register reads nothing below a floor, well above the weakest frames.
pub(super) fn floor(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Carts);
    let floor_dbm = (radio.power_dbm() + median(&radio.per_row(|row| radio.gain_db(row)))).round()
        - radio.draws.between(2.0, 6.0).round();
    let power_dbm = radio.power_dbm();
    let register = move |dbm: f64| dbm.max(floor_dbm);
    let cut = {
        let gains = radio.per_row(|row| radio.gain_db(row));
        let cut: Vec<f64> =
            gains.iter().map(|gain| register(power_dbm + gain) - power_dbm - gain).collect();
        0.5 * cut.iter().map(|cut| cut * cut).sum::<f64>() / radio.scale_db.powi(2)
    };
    let case = radio.finish_with(Log::All, &[], |_, dbm| register(dbm));
    let cause = Cause::of("measurement:register-floor").sized("floor_dbm", floor_dbm);
    let cause = Cause {
        nats: cut,
        ..cause.seen_over(&["predicted_rssi_dbm", "distance_m", "log10_distance"])
    };
    let mut truth = case.truth.permitting(&["receiver-nonlinearity", "path-loss-exponent"]);
    truth.nats = cut;
    truth.causes.push(cause);
    Case { truth, ..case }
}

fn median(values: &[f64]) -> f64 {
    crate::statistics::median(values)
}

/// Carts whose antennas look ahead; sensors on walls that have no preferred direction in the survey.
pub(super) fn pattern(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Carts);
    let strength_db = rounded(radio.draws.between(6.0, 14.0), 1);
    let boresight = rounded(radio.draws.between(-PI, PI), 2);
    let headings: Vec<f64> =
        (0..radio.n_nodes).map(|_| rounded(radio.draws.between(-PI, PI), 3)).collect();
    radio.log("tx_heading_rad", |row| headings[row.tx]);
    radio.log("rx_heading_rad", |row| headings[row.rx]);
    let gain = |row: &LinkRow| {
        let [[ax, ay, _], [bx, by, _]] = row.places_m;
        let there = (by - ay).atan2(bx - ax);
        let one = |bearing: f64, node: usize| {
            -0.5 * strength_db * (1.0 - (bearing - headings[node] - boresight).cos())
        };
        one(there, row.tx) + one(there + PI, row.rx)
    };
    let cause = Cause::of("antenna-pattern").sized("front_to_back_db", strength_db);
    radio.hide(cause.seen_over(&["*bearing*"]).drawing(1), gain);
    radio.permit(&["system-gain"]);
    radio.finish(Log::All)
}

/// A network on some channels takes frames from some time on; and the level is off.
pub(super) fn busy_channels(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Carts);
    let gain_db = -radio.draws.between(3.0, 9.0);
    radio.hide(Cause::of("system-gain").sized("gain_db", gain_db), |_| gain_db);
    let first = 11 + radio.draws.below(12) as u8;
    let duty = radio.draws.between(0.3, 0.7);
    let is_in = |row: &LinkRow| row.channel.is_some_and(|k| (first..first + 4).contains(&k));
    let cause = Cause::of("interference").sized("duty", duty);
    let cause = cause.seen_over(&["channel", "*mhz*", "*frequency*"]);
    radio.hide_losses(cause, |row| [if is_in(row) { duty } else { 0.0 }, 0.0]);
    radio.finish(Log::All)
}

/// One receiver is deaf: what it hears it reads well.
pub(super) fn deaf(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Corridor);
    let node = radio.draws.below(radio.n_nodes);
    let shift_db = radio.draws.between(4.0, 9.0);
    let cause = Cause::of("noise-floor").mostly(&[node]).sized("shift_db", shift_db);
    let cause = cause.seen_over(&["receiver", "rx", "link*"]);
    radio.hide_losses(cause, |row| [0.0, if row.rx == node { shift_db } else { 0.0 }]);
    radio.permit(&["reception-curve"]);
    radio.finish(Log::All)
}

/// One node's antenna is loose: all its frames are weak, both ways.
pub(super) fn loose(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Corridor);
    let node = radio.draws.below(radio.n_nodes);
    let loss_db = radio.draws.log_between(0.2, 15.0);
    let cause = Cause::of("system-gain").or(&["node-offset"]).mostly(&[node]);
    let cause = cause.seen_over(&["transmitter", "receiver"]).sized("gain_db", -loss_db);
    radio.hide(cause, |row| if row.tx == node || row.rx == node { -loss_db } else { 0.0 });
    radio.finish(Log::All)
}

/// A node was carried elsewhere in the middle, and the survey was not repeated.
pub(super) fn carried(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Corridor);
    let node = radio.draws.below(radio.n_nodes);
    let from_s = radio.duration_s * radio.draws.between(0.35, 0.65);
    let by_m = 0.25 * radio.length_m * if radio.draws.chance(0.5) { 1.0 } else { -1.0 };
    let exact = Radio::new(seed, Shape::Corridor);
    let change = |row: &LinkRow| {
        let mut true_row = row.clone();
        for (end, place) in [row.tx, row.rx].into_iter().zip(&mut true_row.places_m) {
            if end == node && from_s < row.time_s {
                place[0] += by_m;
            }
        }
        exact.gain_db(&true_row) - exact.gain_db(row)
    };
    let cause =
        Cause::of("measurement:*position*").or(&["measurement:*moved*", "measurement:*place*"]);
    radio.hide(cause.drawing(3), change);
    radio.permit(&["node-offset", "link-drift", "time_s", "transmitter", "receiver"]);
    radio.finish(Log::All)
}

/// A door across the corridor is open for some minutes and closed for some.
pub(super) fn door(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Corridor);
    let x_m = radio.length_m * radio.draws.between(0.35, 0.65);
    let loss_db = radio.draws.between(6.0, 14.0);
    let every_s = radio.duration_s / radio.draws.between(6.0, 14.0);
    let share = radio.draws.between(0.3, 0.6);
    let is_shut = |row: &LinkRow| (row.time_s / every_s).fract() < share;
    let crosses = |row: &LinkRow| (row.places_m[0][0] - x_m) * (row.places_m[1][0] - x_m) < 0.0;
    radio.hide(Cause::unknown(&["time_s", "*midpoint*"]).drawing(4), |row| {
        if is_shut(row) && crosses(row) { -loss_db } else { 0.0 }
    });
    radio.permit(&[
        "hidden-obstacle",
        "link-drift",
        "drift",
        "distance_m",
        "log10_distance",
        "system-gain",
    ]);
    radio.finish(Log::All)
}

/// Showers: a loss in proportion to rain and distance.
pub(super) fn rain(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Carts);
    let [first, second] = [0, 1].map(|_| radio.draws.between(0.1, 0.9));
    let [width, most] = [radio.draws.between(0.05, 0.12), radio.draws.between(15.0, 60.0)];
    let duration_s = radio.duration_s;
    let rain_mmph = |row: &LinkRow| {
        let bump = |at: f64| (-((row.time_s / duration_s - at) / width).powi(2)).exp();
        rounded(most * (bump(first) + 0.5 * bump(second)), 2)
    };
    let db_per_mmph_m = radio.draws.between(3.0, 7.0) / (most * 0.3 * radio.length_m);
    radio.log("rain_mmph", rain_mmph);
    radio.hide(Cause::unknown(&["rain_mmph"]), |row| {
        -db_per_mmph_m * rain_mmph(row) * distance_m(row)
    });
    radio.finish(Log::All)
}

/// Warm air is dry: temperature and humidity say the same, and one of both acts.
pub(super) fn warm_or_dry(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Carts);
    let phase = radio.draws.between(0.0, TAU);
    let [span_c, per_c] = [radio.draws.between(6.0, 14.0), radio.draws.between(2.0, 4.0)];
    let duration_s = radio.duration_s;
    let warm_c = |row: &LinkRow| {
        rounded(18.0 + 0.5 * span_c * (TAU * 1.4 * row.time_s / duration_s + phase).sin(), 2)
    };
    let humid = |row: &LinkRow| {
        // What the hygrometer adds by itself.
        let own = 0.15 * (1.7 * row.time_s).sin();
        rounded(60.0 - per_c * (warm_c(row) - 18.0) + own, 1)
    };
    radio.log("temperature_c", warm_c);
    radio.log("humidity_pct", humid);
    let slope = radio.draws.between(0.2, 0.5);
    if radio.draws.chance(0.5) {
        let cause = Cause::of("temperature").sized("db_per_c", -slope);
        radio.hide(cause.seen_over(&["temperature_c", "time_s"]), |row| {
            -slope * (warm_c(row) - 18.0)
        });
        let rivals: [Change<'_>; 1] = [("*humidity_pct", &humid)];
        return radio.finish_with(Log::All, &rivals, |_, dbm| dbm);
    }
    let cause = Cause::unknown(&["humidity_pct"]);
    radio.hide(cause, |row| -slope / per_c * (humid(row) - 60.0));
    let rivals: [Change<'_>; 1] = [("*temperature*", &warm_c)];
    radio.finish_with(Log::All, &rivals, |_, dbm| dbm)
}

/// Senders change their power from frame to frame; the user logged the setting, and the model has one.
pub(super) fn power_settings(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Corridor);
    let step_db = radio.draws.between(2.0, 5.0);
    let setting = |row: &LinkRow| ((row.time_s * 7.3) as u64 * 2_654_435_761 % 97 % 3) as f64;
    radio.log("power_level", setting);
    let cause = Cause::unknown(&["power_level"]);
    radio.hide(cause, |row| step_db * (setting(row) - 1.0));
    radio.finish(Log::All)
}

/// Beyond a distance the power falls faster.
pub(super) fn breakpoint(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Carts);
    let from_m = radio.length_m * radio.draws.between(0.2, 0.35);
    let more = radio.draws.between(1.5, 3.0);
    let cause = Cause::unknown(&["distance_m", "log10_distance"]).drawing(1);
    radio.hide(cause, |row| -10.0 * more * (distance_m(row) / from_m).max(1.0).log10());
    radio.permit(&["path-loss-exponent", "system-gain"]);
    radio.finish(Log::All)
}

/// Flat ground reflects, and the level is off.
pub(super) fn reflection(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Carts);
    let permittivity = rounded(radio.draws.between(3.0, 20.0), 1);
    let two_rays = |row: &LinkRow| {
        let [[ax, ay, az], [bx, by, bz]] = row.places_m;
        let over_m = (ax - bx).hypot(ay - by);
        let [direct_m, other_m] = [over_m.hypot(az - bz), over_m.hypot(az + bz)];
        let [sin, cos] = [(az + bz) / other_m, over_m / other_m];
        let root = (permittivity - cos * cos).sqrt();
        let coefficient = (permittivity * sin - root) / (permittivity * sin + root);
        let per_m =
            TAU * (2405.0 + 5.0 * (f64::from(row.channel.unwrap_or(11)) - 11.0)) / 299.792_458;
        let (s, c) = (per_m * (other_m - direct_m)).sin_cos();
        let amplitude = coefficient * direct_m / other_m;
        10.0 * ((1.0 + amplitude * c).powi(2) + (amplitude * s).powi(2)).max(1e-6).log10()
    };
    let cause = Cause::of("two-ray-ground").seen_over(&["distance_m", "log10_distance"]);
    radio.hide(cause.drawing(1), two_rays);
    let gain_db = radio.draws.between(3.0, 8.0);
    radio.hide(Cause::of("system-gain"), |_| gain_db);
    radio.finish(Log::All)
}

/// Two nodes that stay where they are: one number, whatever its cause.
pub(super) fn one_distance(seed: u64) -> Case {
    let mut radio = Radio::new(seed, Shape::Pair);
    let off_db = -radio.draws.between(4.0, 10.0);
    if radio.draws.chance(0.5) {
        let cause = Cause::of("system-gain");
        radio.hide(cause, |_| off_db);
        let slope = |row: &LinkRow| distance_m(row).log10();
        let rivals: [Change<'_>; 1] = [("path-loss-exponent", &slope)];
        return radio.finish_with(Log::All, &rivals, |_, dbm| dbm);
    }
    let more = -off_db / 10.0 / distance_m(&radio.rows[0]).log10().max(0.3);
    radio.is_level_rival = true;
    radio.hide(Cause::of("path-loss-exponent"), |row| -10.0 * more * distance_m(row).log10());
    let ones = |_: &LinkRow| 1.0;
    let rivals: [Change<'_>; 1] = [("system-gain", &ones)];
    radio.finish_with(Log::All, &rivals, |_, dbm| dbm)
}
