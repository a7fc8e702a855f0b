//! Situations of links.

use super::site::{Design, Site, clearance_m, crosses, distance_m, free_space_db, slow};
use crate::campaign::draws::Draws;
use crate::campaign::situations::Case;
use crate::campaign::situations::files::{LinkRow, Log};
use crate::campaign::situations::reference::Rival;
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;
use std::f64::consts::TAU;

fn plain(reading_dbm: f64) -> f64 {
    reading_dbm
}

/// Sequence numbers of each sender's frames, as some loggers keep them.
fn log_sequence(site: &mut Site) {
    let mut next = vec![0.0; site.n_nodes() * site.n_nodes()];
    let n = site.n_nodes();
    let numbers: Vec<f64> = site
        .rows
        .iter()
        .map(|row| {
            let number = &mut next[row.tx * n + row.rx];
            *number += 1.0;
            *number
        })
        .collect();
    site.log("sequence", &numbers);
}

fn exponent(site: &mut Site, exponent: f64) {
    let signal = site.per_row(|row| -10.0 * (exponent - 2.0) * distance_m(row).max(1.0).log10());
    site.hide(
        Cause::of("path-loss-exponent")
            .sized("exponent", exponent)
            .seen_over(&["distance_m", "log10_distance"]),
        signal,
    );
}

pub(super) fn nothing(seed: u64) -> Case {
    Site::new(seed).finish(Log::All, Vec::new(), plain)
}

pub(super) fn nothing_received_only(seed: u64) -> Case {
    let mut draws = Draws::new(seed, "received only");
    let design = Design { share: draws.between(0.45, 0.75), ..Design::drawn(&mut draws) };
    let mut site = Site::of(draws, design);
    if site.draws.chance(0.5) {
        log_sequence(&mut site);
    }
    site.finish(Log::Received, Vec::new(), plain)
}

pub(super) fn nothing_two_nodes(seed: u64) -> Case {
    let mut draws = Draws::new(seed, "two nodes");
    let rows = 400 + draws.below(800);
    let design = Design { n_fixed: 1, n_moving: 1, n_rows: rows, ..Design::drawn(&mut draws) };
    Site::of(draws, design).finish(Log::All, Vec::new(), plain)
}

/// Noise with a long tail upwards, of the same standard deviation: half of it exponential.
pub(super) fn nothing_skewed(seed: u64) -> Case {
    let mut site = Site::new(seed);
    for index in 0..site.noise_db.len() {
        let tail = -(1.0 - site.draws.uniform()).ln() - 1.0;
        let share = 0.5_f64.sqrt();
        site.noise_db[index] = share * site.noise_db[index] + share * site.sd_db * tail;
    }
    site.finish(Log::All, Vec::new(), plain)
}

/// The link quality of the same packet follows the reading: it causes nothing.
pub(super) fn nothing_second_reading(seed: u64) -> Case {
    let mut site = Site::new(seed);
    let power_dbm = site.power_dbm();
    let gain = site.draws.between(2.0, 4.0);
    let quality: Vec<f64> = (0..site.rows.len())
        .map(|index| {
            let above = power_dbm + site.base_db()[index] + site.noise_db[index] + 97.0;
            (40.0 + gain * above + site.draws.normal()).clamp(0.0, 255.0).round()
        })
        .collect();
    site.log("lqi", &quality);
    site.finish(Log::Received, Vec::new(), plain)
}

pub(super) fn exponent_received_only(seed: u64) -> Case {
    let mut draws = Draws::new(seed, "received only");
    let design = Design { share: draws.between(0.5, 0.75), ..Design::drawn(&mut draws) };
    let mut site = Site::of(draws, design);
    let n = rounded(site.draws.between(2.4, 3.4), 2);
    exponent(&mut site, n);
    site.finish(Log::Received, Vec::new(), plain)
}

pub(super) fn gain(seed: u64) -> Case {
    let mut site = Site::new(seed);
    let size = site.draws.log_between(0.05, 30.0);
    let gain_db = if site.draws.chance(0.5) { size } else { -size };
    let signal = site.per_row(|_| gain_db);
    site.hide(Cause::of("system-gain").sized("gain_db", gain_db), signal);
    site.finish(Log::All, Vec::new(), plain)
}

/// The survey has a still node elsewhere: the file's place, and so the model, is wrong.
pub(super) fn misplaced(seed: u64) -> Case {
    let mut site = Site::new(seed);
    let node = site.draws.below(site.design.n_fixed);
    let angle = site.draws.between(0.0, TAU);
    let off_m = site.draws.between(0.1, 0.25) * site.design.side_m;
    let moved = |row: &LinkRow| {
        let mut row = row.clone();
        for (end, place) in [row.tx, row.rx].into_iter().zip(&mut row.places_m) {
            if end == node {
                place[0] += off_m * angle.cos();
                place[1] += off_m * angle.sin();
            }
        }
        row
    };
    let signal = site.per_row(|row| free_space_db(&moved(row)) - free_space_db(row));
    let cause =
        Cause::of("measurement:*position*").or(&["measurement:*place*", "measurement:*survey*"]);
    site.hide(cause.drawing(2), signal);
    site.permit(&[
        "node-offset",
        "tx_x_m",
        "tx_y_m",
        "rx_x_m",
        "rx_y_m",
        "*transmitter",
        "*receiver",
        "bearing*",
        "antenna-pattern",
    ]);
    let rivals = vec![Rival::new("node-offset", site.node_levels())];
    site.finish(Log::All, rivals, plain)
}

/// Two devices of different make: one direction is weaker, and the exponent is another.
pub(super) fn two_devices(seed: u64) -> Case {
    let mut draws = Draws::new(seed, "two devices");
    let design = Design {
        n_fixed: 1,
        n_moving: 1,
        n_rows: 500 + draws.below(900),
        share: 0.97,
        ..Design::drawn(&mut draws)
    };
    let mut site = Site::of(draws, design);
    let weaker_db = site.draws.between(6.0, 16.0);
    let signal = site.per_row(|row| if row.tx == 0 { -weaker_db } else { 0.0 });
    site.hide(
        Cause::of("node-offset").or(&["system-gain"]).seen_over(&[
            "transmitter",
            "receiver",
            "tx",
            "rx",
        ]),
        signal,
    );
    let n = site.draws.between(2.5, 3.3);
    exponent(&mut site, n);
    site.permit(&["system-gain"]);
    site.finish(Log::All, Vec::new(), plain)
}

/// A temperature that rises and falls with the day.
fn log_temperature(site: &mut Site, is_straight: bool) -> Vec<f64> {
    let [slope, phase] = [site.draws.between(8.0, 20.0), site.draws.between(0.0, TAU)];
    let duration_s = site.design.duration_s;
    let waves = if is_straight { 0.15 } else { 3.0 };
    let values = site.per_row(|row| {
        let share = row.time_s / duration_s;
        rounded(12.0 + slope * share + waves * (TAU * 2.3 * share + phase).sin(), 2)
    });
    site.log("temperature_c", &values);
    values
}

fn temperature(site: &mut Site, values: &[f64], db_per_c: f64) {
    let signal = values.iter().map(|value| db_per_c * (value - 20.0)).collect();
    let cause = Cause::of("temperature").sized("db_per_c", db_per_c);
    site.hide(cause.seen_over(&["temperature_c", "time_s"]), signal);
}

pub(super) fn temperature_and_drift(seed: u64) -> Case {
    let mut site = Site::new(seed);
    let values = log_temperature(&mut site, false);
    let db_per_c = -site.draws.between(0.15, 0.4);
    temperature(&mut site, &values, db_per_c);
    let [tau_s, sd_db] = [site.draws.between(100.0, 500.0), site.draws.between(1.0, 2.0)];
    let drift = slow(&mut site.draws, &site.rows, tau_s);
    let signal = drift.into_iter().map(|value| sd_db * value).collect();
    let n_values = (site.design.duration_s / tau_s) as usize;
    site.hide(Cause::of("drift").seen_over(&["time_s"]).drawing(n_values), signal);
    site.finish(Log::All, Vec::new(), plain)
}

/// One of two causes that these data cannot distinguish: the temperature rises steadily while batteries empty.
pub(super) fn temperature_or_battery(seed: u64) -> Case {
    let mut site = Site::new(seed);
    let values = log_temperature(&mut site, true);
    let time = site.per_row(|row| row.time_s / 3600.0);
    if site.draws.chance(0.5) {
        let db_per_c = -site.draws.between(0.15, 0.4);
        temperature(&mut site, &values, db_per_c);
        let rivals = vec![Rival::new("battery-sag", vec![time])];
        return site.finish(Log::All, rivals, plain);
    }
    let db_per_hour = -site.draws.between(2.0, 6.0);
    let signal = time.iter().map(|hours| db_per_hour * hours).collect();
    let cause = Cause::of("battery-sag").sized("db_per_hour", db_per_hour);
    site.hide(cause.seen_over(&["time_s", "temperature_c"]), signal);
    let rivals = vec![Rival::new("temperature", vec![values])];
    site.finish(Log::All, rivals, plain)
}

/// A register that reads strong frames too low.
pub(super) fn saturation(seed: u64) -> Case {
    let mut site = Site::new(seed);
    let power_dbm = site.power_dbm();
    let mut powers: Vec<f64> = site.base_db().iter().map(|level| power_dbm + level).collect();
    powers.sort_by(f64::total_cmp);
    let share = site.draws.between(0.4, 0.7);
    let from_dbm = rounded(powers[(share * powers.len() as f64) as usize], 1);
    let slope = rounded(site.draws.between(0.0, 0.5), 2);
    let register =
        |dbm: f64| if dbm < from_dbm { dbm } else { from_dbm + slope * (dbm - from_dbm) };
    let signal: Vec<f64> = site
        .base_db()
        .iter()
        .map(|level| register(power_dbm + level) - power_dbm - level)
        .collect();
    // The readings change, and not the power.
    site.take_from_power(&signal);
    let cause = Cause::of("receiver-nonlinearity").or(&["measurement:register-ceiling"]);
    let cause = cause.sized("saturation_dbm", from_dbm).sized("slope", slope);
    site.hide(cause.seen_over(&["predicted_rssi_dbm", "distance_m", "log10_distance"]), signal);
    site.finish(Log::All, Vec::new(), register)
}

/// A forklift on a circle attenuates what it stands in.
pub(super) fn forklift(seed: u64) -> Case {
    let mut site = Site::new(seed);
    let side_m = site.design.side_m;
    let [loss_db, radius_m] =
        [site.draws.between(8.0, 16.0), side_m * site.draws.between(0.05, 0.1)];
    let [period_s, way_m] =
        [site.draws.between(100.0, 240.0), side_m * site.draws.between(0.15, 0.3)];
    let signal = site.per_row(|row| {
        let phase = TAU * row.time_s / period_s;
        let at = [0.5 * side_m + way_m * phase.cos(), 0.5 * side_m + way_m * phase.sin()];
        if clearance_m(row, at) < radius_m { -loss_db } else { 0.0 }
    });
    site.hide(Cause::unknown(&["time_s", "*midpoint*"]), signal);
    site.permit(&["hidden-obstacle", "system-gain", "distance_m", "log10_distance"]);
    site.finish(Log::All, Vec::new(), plain)
}

/// A node that moves logs with a clock that is too fast: its places are those of another time.
pub(super) fn fast_clock(seed: u64) -> Case {
    let mut draws = Draws::new(seed, "clock");
    let design = Design { n_fixed: 7, n_moving: 3, ..Design::drawn(&mut draws) };
    let mut site = Site::of(draws, design);
    let node = site.design.n_fixed + site.draws.below(3);
    let rate = site.draws.between(0.004, 0.012);
    // Places between rows of the node follow from neighbouring rows: its own track, shifted in time.
    let mut track: Vec<(f64, [f64; 3])> = Vec::new();
    for row in &site.rows {
        for (end, place) in [row.tx, row.rx].into_iter().zip(row.places_m) {
            if end == node {
                track.push((row.time_s, place));
            }
        }
    }
    let at = |time_s: f64| {
        let next = track.partition_point(|(at_s, _)| *at_s < time_s).clamp(1, track.len() - 1);
        let [(from_s, from), (to_s, to)] = [track[next - 1], track[next]];
        let share = ((time_s - from_s) / (to_s - from_s).max(1e-3)).clamp(0.0, 1.0);
        [0, 1, 2].map(|axis| from[axis] + share * (to[axis] - from[axis]))
    };
    let moved = |row: &LinkRow| {
        let mut row = row.clone();
        let time_s = row.time_s * (1.0 + rate);
        for (end, place) in [row.tx, row.rx].into_iter().zip(&mut row.places_m) {
            if end == node {
                *place = at(time_s);
            }
        }
        row
    };
    let signal = site.per_row(|row| free_space_db(&moved(row)) - free_space_db(row));
    site.hide(Cause::of("measurement:clock*"), signal);
    site.permit(&["measurement:*position*", "time_s", "node-offset"]);
    site.finish(Log::All, Vec::new(), plain)
}

/// A register whose steps are not a decibel. With one transmit power that is an exponent, and a level, to the readings.
pub(super) fn register_scale(seed: u64) -> Case {
    let mut site = Site::new(seed);
    let power_dbm = site.power_dbm();
    let scale = if site.draws.chance(0.5) {
        site.draws.between(0.75, 0.9)
    } else {
        site.draws.between(1.1, 1.25)
    };
    let about_dbm = -site.draws.between(60.0, 80.0);
    let register = |dbm: f64| about_dbm + scale * (dbm - about_dbm);
    let read = |level: &f64| register(power_dbm + level) - power_dbm - level;
    let signal: Vec<f64> = site.base_db().iter().map(read).collect();
    site.take_from_power(&signal);
    let cause = Cause::of("measurement:*scale*").or(&["receiver-nonlinearity"]);
    site.hide(cause.seen_over(&["distance_m", "log10_distance", "predicted_rssi_dbm"]), signal);
    site.permit(&["system-gain"]);
    let logs = site.per_row(|row| distance_m(row).log10());
    site.finish(Log::All, vec![Rival::new("path-loss-exponent", vec![logs])], register)
}

fn wall(site: &mut Site) -> [[f64; 2]; 2] {
    let side_m = site.design.side_m;
    let x_m = rounded(side_m * site.draws.between(0.35, 0.65), 1);
    [[x_m, rounded(-0.1 * side_m, 1)], [x_m, rounded(side_m * site.draws.between(0.6, 1.0), 1)]]
}

pub(super) fn unmapped_wall(seed: u64) -> Case {
    let mut site = Site::new(seed);
    let wall = wall(&mut site);
    let loss_db = site.draws.between(5.0, 12.0);
    let signal = site.per_row(|row| if crosses(row, wall) { -loss_db } else { 0.0 });
    let cause = Cause::of("hidden-obstacle").sized("loss_db", loss_db);
    site.hide(cause.seen_over(&["*midpoint*"]).drawing(4), signal);
    site.finish(Log::All, Vec::new(), plain)
}

pub(super) fn walls_and_exponent(seed: u64) -> Case {
    let mut site = Site::new(seed);
    let wall = wall(&mut site);
    let loss_db = site.draws.between(4.0, 10.0);
    let signal = site.per_row(|row| if crosses(row, wall) { -loss_db } else { 0.0 });
    site.hide(
        Cause::of("wall-attenuation").sized("loss_db", loss_db).seen_over(&["walls*"]),
        signal,
    );
    let n = rounded(site.draws.between(2.3, 3.0), 2);
    exponent(&mut site, n);
    let [from, to] = wall;
    site.configure(&format!("\n[[site.wall]]\nfrom_m = {from:?}\nto_m = {to:?}\n"));
    site.finish(Log::All, Vec::new(), plain)
}

/// So few rows, at so few distances, that a gain and an exponent may be one another.
pub(super) fn few_rows(seed: u64) -> Case {
    let mut draws = Draws::new(seed, "few");
    let design =
        Design { n_fixed: 5, n_moving: 0, n_rows: 100, share: 0.9, ..Design::drawn(&mut draws) };
    let mut site = Site::of(draws, design);
    if site.draws.chance(0.5) {
        let gain_db = -site.draws.between(4.0, 9.0);
        let signal = site.per_row(|_| gain_db);
        site.hide(Cause::of("system-gain").sized("gain_db", gain_db), signal);
        let logs = site.per_row(|row| distance_m(row).log10());
        return site.finish(Log::All, vec![Rival::new("path-loss-exponent", vec![logs])], plain);
    }
    let n = rounded(site.draws.between(2.2, 2.6), 2);
    exponent(&mut site, n);
    let ones = site.per_row(|_| 1.0);
    site.is_level_rival = true;
    site.finish(Log::All, vec![Rival::new("system-gain", vec![ones])], plain)
}

pub(super) fn three_causes(seed: u64) -> Case {
    let mut draws = Draws::new(seed, "three");
    let design = Design::drawn(&mut draws).still();
    let mut site = Site::of(draws, design);
    let gain_db = -site.draws.between(5.0, 14.0);
    // The reference of the temperature is aliased with the gain: either name will do.
    let constant = site.per_row(|_| gain_db);
    site.shift(&constant);
    site.permit(&["system-gain"]);
    let sd_db = site.draws.between(2.0, 4.0);
    let offsets: Vec<[f64; 2]> = (0..site.n_nodes())
        .map(|_| [sd_db * site.draws.normal(), sd_db * site.draws.normal()])
        .collect();
    let signal = site.per_row(|row| offsets[row.tx][0] + offsets[row.rx][1]);
    let n_values = 2 * site.n_nodes();
    site.hide(
        Cause::of("node-offset").seen_over(&["transmitter", "receiver"]).drawing(n_values),
        signal,
    );
    let values = log_temperature(&mut site, false);
    let db_per_c = -site.draws.between(0.2, 0.5);
    temperature(&mut site, &values, db_per_c);
    site.finish(Log::All, Vec::new(), plain)
}
