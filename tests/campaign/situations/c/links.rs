//! Situations of links.

use super::field::{DRONE, Field, span_m};
use crate::campaign::situations::Case;
use crate::campaign::situations::files::{LinkRow, Log};
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::Write as _;

pub(super) fn nothing(seed: u64) -> Case {
    Field::drone(seed).campaign(Log::All, &[])
}

/// So few rows that nothing can be excluded.
pub(super) fn nothing_tiny(seed: u64) -> Case {
    let mut case = Field::of(seed, false, 60).campaign(Log::All, &[]);
    case.truth.is_tiny = true;
    case
}

/// Another network takes frames whatever their strength, and the log has the others only.
pub(super) fn nothing_bursts(seed: u64) -> Case {
    let mut field = Field::drone(seed);
    field.margin_db = field.draws.between(14.0, 20.0);
    let [every_s, share] = [field.draws.between(5.0, 40.0), field.draws.between(0.2, 0.5)];
    field.loss = field.each(|row| f64::from(u8::from((row.time_s / every_s).fract() < share)));
    let case = field.campaign(Log::Received, &[]);
    Case { truth: crate::campaign::situations::truth::Truth::default(), ..case }
}

/// Links summed up over bursts of frames, as a site survey does it.
pub(super) fn nothing_summed_up(seed: u64) -> Case {
    let mut field = Field::mesh(seed);
    // Of every sum the frames have the place and time of the first.
    const FRAMES: usize = 10;
    for index in 0..field.rows.len() {
        let first = field.rows[index - index % FRAMES].clone();
        field.rows[index] = first;
    }
    let whole = field.rows.len() / FRAMES * FRAMES;
    field.campaign_as(&[], |rows, _| {
        let mut text =
            "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,frames,pdr\n"
                .to_owned();
        for frames in rows[..whole].chunks(FRAMES) {
            let LinkRow { time_s, tx, rx, places_m, .. } = &frames[0];
            let _ = write!(text, "{time_s:.3},{tx},{rx},");
            for place in places_m.iter().flatten() {
                let _ = write!(text, ",{place:.3}");
            }
            let read: Vec<f64> = frames.iter().filter_map(|frame| frame.rssi_dbm).collect();
            let mean = read.iter().sum::<f64>() / read.len() as f64;
            let mean = if read.is_empty() { String::new() } else { format!("{mean:.2}") };
            let _ = writeln!(text, ",{mean},{FRAMES},{:.2}", read.len() as f64 / FRAMES as f64);
        }
        text
    })
}

fn exponent(field: &mut Field) {
    let n = rounded(field.draws.between(2.4, 3.2), 2);
    let signal = field.each(|row| -10.0 * (n - 2.0) * span_m(row).max(1.0).log10());
    let cause = Cause::of("path-loss-exponent").sized("exponent", n);
    field.hide(cause.seen_over(&["distance_m", "log10_distance"]), signal);
}

/// A value per pair of nodes, whatever the direction.
fn per_pair(field: &mut Field, sd_db: f64) -> Vec<f64> {
    let n = field.n_sensors + 1;
    let values: Vec<f64> = (0..n * n).map(|_| sd_db * field.draws.normal()).collect();
    field.each(|row| values[row.tx.min(row.rx) * n + row.tx.max(row.rx)])
}

pub(super) fn exponent_and_shadows(seed: u64) -> Case {
    let mut field = Field::mesh(seed);
    exponent(&mut field);
    let sd_db = field.draws.between(3.0, 6.0);
    let n_pairs = field.n_sensors * (field.n_sensors - 1) / 2;
    let signal = per_pair(&mut field, sd_db);
    let cause = Cause::of("shadowing").sized("sd_db", sd_db).seen_over(&["link*"]);
    field.hide(cause.drawing(n_pairs), signal);
    // What the slope does to the level is seen whatever the shadows.
    field.consequences = vec!["system-gain"];
    // Of the slope a link says as much as one reading with the noise of its shadow.
    let per_link = field.rows.len() as f64 / n_pairs as f64;
    let worth = (field.noise_db / sd_db).powi(2) / per_link;
    let mut case = field.campaign(Log::All, &[]);
    case.truth.causes[0].nats *= worth.min(1.0);
    case
}

/// A grove on the map.
pub(super) fn grove(seed: u64) -> Case {
    let mut field = Field::mesh(seed);
    let half = field.radius_m * field.draws.between(0.2, 0.4);
    let centre = [0, 1].map(|_| rounded(0.3 * field.radius_m * field.draws.between(-1.0, 1.0), 1));
    let [low, high] = [-half, half].map(|by| centre.map(|place| rounded(place + by, 1)));
    let db_per_m = -rounded(field.draws.between(8.0, 16.0) / half, 3);
    // Part of the way within both pairs of sides (Liang and Barsky).
    let within_m = |row: &LinkRow| {
        let [a, b] = row.places_m;
        let [mut from, mut to] = [0.0_f64, 1.0_f64];
        for axis in 0..2 {
            let way = b[axis] - a[axis];
            let [one, other] = [low[axis], high[axis]].map(|side| (side - a[axis]) / way);
            from = from.max(one.min(other));
            to = to.min(one.max(other));
        }
        (to - from).max(0.0) * span_m(row)
    };
    let signal = field.each(|row| db_per_m * within_m(row));
    let cause = Cause::of("vegetation").sized("db_per_m", db_per_m);
    field.hide(cause.seen_over(&["*foliage*", "*midpoint*"]), signal);
    let [[x0, y0], [x1, y1]] = [low, high];
    field.sections = format!(
        "\n[[site.foliage]]\npolygon_m = [[{x0:?}, {y0:?}], [{x1:?}, {y0:?}], [{x1:?}, {y1:?}], [{x0:?}, {y1:?}]]\n"
    );
    field.campaign(Log::All, &[])
}

/// The battery of one sensor empties.
pub(super) fn one_battery(seed: u64) -> Case {
    let mut field = Field::mesh(seed);
    let sensor = 1 + field.draws.below(field.n_sensors);
    let fall_db = field.draws.between(6.0, 14.0);
    let db_per_hour = -fall_db * 3600.0 / field.duration_s;
    let signal =
        field.each(|row| if row.tx == sensor { db_per_hour * row.time_s / 3600.0 } else { 0.0 });
    let cause = Cause::of("battery-sag").mostly(&[sensor]).sized("db_per_hour", db_per_hour);
    field.hide(cause.seen_over(&["time_s", "transmitter"]), signal);
    field.consequences = vec!["node-offset", "link-drift"];
    field.campaign(Log::All, &[])
}

/// The drone's barometer is off.
pub(super) fn barometer(seed: u64) -> Case {
    let mut field = Field::drone(seed);
    let off_m = field.draws.between(8.0, 20.0);
    let signal = field
        .rows
        .iter()
        .map(|row| {
            field.free_space_db(&field.with_drone(row, 0.0, off_m)) - field.free_space_db(row)
        })
        .collect();
    let cause = Cause::of("measurement:*position*").or(&["measurement:*height*"]);
    let seen = ["elevation*", "*_z_m", "distance_m", "log10_distance", "*height*"];
    field.hide(cause.seen_over(&seen), signal);
    field.consequences = vec!["antenna-pattern", "path-loss-exponent", "system-gain"];
    field.campaign(Log::All, &[])
}

/// The drone's track is that of some seconds before or after.
pub(super) fn late_track(seed: u64) -> Case {
    let mut field = Field::drone(seed);
    let shift_s = field.draws.between(2.0, 6.0) * if field.draws.chance(0.5) { 1.0 } else { -1.0 };
    let signal = field
        .rows
        .iter()
        .map(|row| {
            field.free_space_db(&field.with_drone(row, shift_s, 0.0)) - field.free_space_db(row)
        })
        .collect();
    field.hide(Cause::of("measurement:clock*").or(&["measurement:*time*"]), signal);
    field.consequences = vec!["measurement:*position*", "bearing*", "antenna-pattern"];
    field.campaign(Log::All, &[])
}

/// Upright dipoles: the drone hears little of what is below it.
pub(super) fn dipoles(seed: u64) -> Case {
    let mut field = Field::drone(seed);
    let signal = field.each(|row| {
        let up = (row.places_m[1][2] - row.places_m[0][2]) / span_m(row).max(0.1);
        let from_upright = up.clamp(-1.0, 1.0).acos();
        let one = ((FRAC_PI_2 * from_upright.cos()).cos() / from_upright.sin().max(1e-6)).abs();
        2.0 * 20.0 * one.max(0.01).log10()
    });
    field.hide(Cause::of("antenna-pattern").seen_over(&["elevation*"]), signal);
    // What a pattern has on average is a gain as well.
    field.consequences = vec!["system-gain"];
    field.campaign(Log::All, &[])
}

/// The drone pitches, which its log says, and its antenna with it.
pub(super) fn pitching(seed: u64) -> Case {
    let mut field = Field::drone(seed);
    let [period_s, most] = [field.draws.between(7.0, 20.0), field.draws.between(8.0, 20.0)];
    let pitch = field.each(|row| {
        rounded(most * (TAU * row.time_s / period_s).sin() + 2.0 * (0.9 * row.time_s).cos(), 2)
    });
    field.log("pitch_deg", &pitch);
    let bend = field.draws.between(4.0, 9.0) / (most * most);
    let signal = pitch.iter().map(|degrees| -bend * degrees * degrees).collect();
    field.hide(Cause::unknown(&["pitch_deg"]), signal);
    field.consequences = vec!["system-gain"];
    field.campaign(Log::All, &[])
}

/// An update of the firmware changes all levels at once.
pub(super) fn update(seed: u64) -> Case {
    let mut field = Field::mesh(seed);
    let from_s = field.duration_s * field.draws.between(0.3, 0.7);
    let step_db =
        field.draws.log_between(0.08, 6.0) * if field.draws.chance(0.5) { 1.0 } else { -1.0 };
    let signal = field.each(|row| if from_s <= row.time_s { step_db } else { 0.0 });
    let cause = Cause::of("system-gain").sized("gain_db", step_db).for_a_time();
    field.hide(cause.seen_over(&["time_s"]), signal);
    field.consequences = vec!["drift", "battery-sag"];
    field.campaign(Log::All, &[])
}

/// Frames are lost while the drone is fast.
pub(super) fn fast_drone(seed: u64) -> Case {
    let mut field = Field::drone(seed);
    field.carrier_hz = 2.44e9;
    let k_db = rounded(field.draws.between(-8.0, 0.0), 1);
    let losses: Vec<f64> = field
        .rows
        .iter()
        .map(|row| {
            let doppler_hz = field.drone_mps(row.time_s) * field.carrier_hz / 299_792_458.0;
            let changed = 1.0 - (-0.004_256 * doppler_hz / 0.423).exp();
            changed / (1.0 + 10.0_f64.powf(k_db / 10.0))
        })
        .collect();
    field.loss = losses;
    let cause = Cause::of("motion-fading").sized("rician_k_db", k_db);
    let cause = Cause { is_of_losses: true, ..cause.seen_over(&["*speed*"]) };
    let none = vec![0.0; field.rows.len()];
    field.hide(cause, none);
    field.campaign(Log::All, &[])
}

/// A process of a correlation time at the rows' times.
fn process(field: &mut Field, tau_s: f64) -> Vec<f64> {
    let mut value = field.draws.normal();
    let times = field.each(|row| row.time_s);
    let mut before_s = 0.0;
    times
        .into_iter()
        .map(|time_s| {
            let kept: f64 = (-(time_s - before_s) / tau_s).exp();
            value = kept * value + (1.0 - kept * kept).sqrt() * field.draws.normal();
            before_s = time_s;
            value
        })
        .collect()
}

pub(super) fn gain_exponent_drift(seed: u64) -> Case {
    let mut field = Field::mesh(seed);
    let gain_db = -field.draws.between(5.0, 15.0);
    let constant = field.each(|_| gain_db);
    field.hide(Cause::of("system-gain"), constant);
    exponent(&mut field);
    let tau_s = field.duration_s * field.draws.between(0.03, 0.08);
    let sd_db = field.draws.between(1.5, 3.0);
    let signal = process(&mut field, tau_s).into_iter().map(|value| sd_db * value).collect();
    let n_values = (field.duration_s / tau_s) as usize;
    field.hide(Cause::of("drift").seen_over(&["time_s"]).drawing(n_values), signal);
    field.campaign(Log::All, &[])
}

/// People near some links: each link drifts by itself.
pub(super) fn people(seed: u64) -> Case {
    let mut field = Field::mesh(seed);
    let n = field.n_sensors + 1;
    let tau_s = field.duration_s * field.draws.between(0.1, 0.3);
    let sd_db = field.draws.between(3.0, 6.0);
    let mut last: Vec<Option<(f64, f64)>> = vec![None; n * n];
    let rows = field.rows.clone();
    let signal: Vec<f64> = rows
        .iter()
        .map(|row| {
            let pair = row.tx.min(row.rx) * n + row.tx.max(row.rx);
            let fresh = field.draws.normal();
            let value = last[pair].map_or(fresh, |(at_s, value)| {
                let kept = (-(row.time_s - at_s) / tau_s).exp();
                kept * value + (1.0 - kept * kept).sqrt() * fresh
            });
            last[pair] = Some((row.time_s, value));
            sd_db * value
        })
        .collect();
    let n_values = n * (n - 1) / 2 * (field.duration_s / tau_s) as usize;
    field.hide(Cause::of("link-drift").seen_over(&["time_s", "link*"]).drawing(n_values), signal);
    // A drift has a mean over the campaign.
    field.consequences = vec!["shadowing"];
    field.campaign(Log::All, &[])
}

/// Above some temperature amplifiers give way; humidity is logged, too, and does nothing.
pub(super) fn hot(seed: u64) -> Case {
    let mut field = Field::drone(seed);
    let [phase, span] = [field.draws.between(0.0, TAU), field.draws.between(8.0, 14.0)];
    let duration_s = field.duration_s;
    let warm = field.each(|row| {
        let share = row.time_s / duration_s;
        rounded(
            22.0 + span * (TAU * 1.6 * share + phase).sin() + 2.0 * (TAU * 7.0 * share).sin(),
            2,
        )
    });
    let humid: Vec<f64> = field
        .rows
        .iter()
        .zip(&warm)
        .map(|(row, celsius)| {
            rounded(60.0 - (celsius - 22.0) + 9.0 * (TAU * 3.3 * row.time_s / duration_s).cos(), 1)
        })
        .collect();
    let from_c = 22.0 + span * field.draws.between(0.0, 0.35);
    let slope = field.draws.between(0.5, 1.2);
    let signal = warm.iter().map(|celsius| -slope * (celsius - from_c).max(0.0)).collect();
    field.log("temperature_c", &warm);
    field.log("humidity_pct", &humid);
    field.hide(Cause::unknown(&["temperature_c"]), signal);
    field.consequences = vec!["temperature", "system-gain"];
    field.campaign(Log::All, &[])
}

/// Frames of the drone and of sensors differ: its transmitter has more power than the model's, its receiver is the same.
pub(super) fn strong_drone(seed: u64) -> Case {
    let mut field = Field::drone(seed);
    let more_db = field.draws.between(3.0, 12.0);
    let signal = field.each(|row| if row.tx == DRONE { more_db } else { 0.0 });
    let cause = Cause::of("node-offset").or(&["system-gain"]).mostly(&[DRONE]);
    field.hide(cause.seen_over(&["transmitter", "receiver", "tx", "rx"]), signal);
    field.consequences = vec!["system-gain"];
    field.campaign(Log::All, &[])
}
