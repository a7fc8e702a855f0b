//! What is odd about rows of links that can be used, and what it does to an answer.

use super::LinkRow;
use crate::warnings::{GREATEST_MPS, LEAST_JUMP_M, first_few, way_m};
use numbers::statistics::median_high;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

/// A mote that goes farther than this (m) in a campaign moves.
const WAY_M: f64 = 5.0;
/// Moving motes that are slower than this (m/s) throughout are measured in other units than seconds.
const LEAST_MPS: f64 = 0.05;
/// Times that span more than this (s) in whole numbers are milliseconds.
const GREATEST_SPAN_S: f64 = 2e6;
/// Fewer frames of a mote say nothing.
const FEWEST_FRAMES: f64 = 20.0;
/// Fewer intervals between changes of a position are no rate.
const FEWEST_INTERVALS: usize = 5;
/// A register that reads the same in so many rows is stuck.
const STUCK_ROWS: usize = 20;

/// A register that always reads the same carries nothing.
pub(super) fn stuck_register(rows: &[LinkRow]) -> Option<String> {
    let mut readings = rows.iter().map(|row| row.rssi_dbm).filter(|rssi| rssi.is_finite());
    let first = readings.next()?;
    let mut n = 1;
    for rssi in readings {
        if rssi != first {
            return None;
        }
        n += 1;
    }
    (STUCK_ROWS <= n).then(|| {
        format!("rssi_dbm is {first} in all {n} readings, so there is nothing to compare with; the register was stuck, or \
                 was never read")
    })
}

/// All that is odd about rows of links that can be used.
pub(super) fn link_warnings(rows: &[LinkRow]) -> Vec<String> {
    let mut warnings = Vec::new();
    warnings.extend(positive(rows));
    warnings.extend(backwards(rows));
    warnings.extend(timeless(rows));
    let tracks = tracks(rows);
    warnings.extend(milliseconds(rows, &tracks));
    warnings.extend(exchanged(rows, &tracks));
    warnings.extend(motes(rows));
    warnings.extend(one_channel(rows));
    warnings.extend(below_ground(rows));
    warnings
}

fn one_channel(rows: &[LinkRow]) -> Option<String> {
    let channels: BTreeSet<Option<u8>> = rows.iter().map(|row| row.channel).collect();
    match channels.first() {
        Some(Some(channel)) if channels.len() == 1 => Some(format!(
            "channel is {channel} in every row, so effects that differ between channels (multipath, interference) cannot \
             be tested"
        )),
        _ => None,
    }
}

fn below_ground(rows: &[LinkRow]) -> Option<String> {
    let low = |row: &LinkRow| row.tx_m[2] < 0.0 || row.rx_m[2] < 0.0;
    let mut below = rows.iter().filter(|row| low(row));
    let first = below.next()?;
    let (name, height_m) = match first.tx_m[2] < 0.0 {
        true => ("tx_z_m", first.tx_m[2]),
        false => ("rx_z_m", first.rx_m[2]),
    };
    Some(format!(
        "antennas are below the ground (z = 0) in {} rows: {name} is {height_m} on line {}, but must be at least 0; effects \
         of the ground and of heights cannot be trusted",
        1 + below.count(),
        first.line
    ))
}

fn noun(motes: &BTreeSet<u32>) -> &'static str {
    if motes.len() == 1 { "mote" } else { "motes" }
}

fn positive(rows: &[LinkRow]) -> Option<String> {
    let mut strong = rows.iter().filter(|row| 0.0 < row.rssi_dbm);
    let first = strong.next()?;
    Some(format!(
        "rssi_dbm is positive in {} rows, the first on line {}; RSSI readings in dBm are negative (about -100 to -20). \
         These readings are used as they are, and bias means and noise upwards",
        1 + strong.count(),
        first.line
    ))
}

fn backwards(rows: &[LinkRow]) -> Option<String> {
    let back: Vec<&LinkRow> = rows
        .windows(2)
        .filter(|pair| pair[0].run == pair[1].run && pair[1].time_s < pair[0].time_s)
        .map(|pair| &pair[1])
        .collect();
    back.first().map(|first| {
        format!(
            "time_s decreases in {} places, first on line {}. Rows are sorted by time; if the file holds several \
             campaigns, number them in a column run",
            back.len(),
            first.line
        )
    })
}

fn timeless(rows: &[LinkRow]) -> Option<String> {
    let n_missing = rows.iter().filter(|row| !row.time_s.is_finite()).count();
    let times: BTreeSet<u64> =
        rows.iter().filter(|row| row.time_s.is_finite()).map(|row| row.time_s.to_bits()).collect();
    if times.len() == 1 && 1 < rows.len() {
        return Some(
            "time_s is the same in every row, so effects that change over time cannot be tested; cross-validation holds \
             out pairs of motes instead of blocks of time"
                .to_owned(),
        );
    }
    (0 < n_missing).then(|| {
        format!("time_s is missing in {n_missing} rows; effects that change over time are not tested on them")
    })
}

/// Where each mote was, by campaign: sorted by time.
type Tracks = BTreeMap<(u32, u32), Vec<(f64, [f64; 3])>>;

fn tracks(rows: &[LinkRow]) -> Tracks {
    let mut tracks = Tracks::new();
    for row in rows.iter().filter(|row| row.time_s.is_finite()) {
        for (mote, place) in [(row.tx, row.tx_m), (row.rx, row.rx_m)] {
            if place[..2].iter().all(|c| c.is_finite()) {
                tracks.entry((row.run, mote)).or_default().push((row.time_s, place));
            }
        }
    }
    for track in tracks.values_mut() {
        track.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    tracks
}

fn milliseconds(rows: &[LinkRow], tracks: &Tracks) -> Option<String> {
    let mut known = rows.iter().map(|row| row.time_s).filter(|time| time.is_finite());
    let first = known.next()?;
    let mut is_whole = first.fract() == 0.0;
    let [low, high] = known.fold([first, first], |[low, high], time| {
        is_whole &= time.fract() == 0.0;
        [low.min(time), high.max(time)]
    });
    let span = high - low;
    if !is_whole {
        return None;
    }
    // Motes that are on their way, but hardly get on.
    let mut speeds: Vec<f64> = tracks
        .values()
        .filter_map(|track| {
            let way: f64 = track.windows(2).map(|pair| way_m(pair[0].1, pair[1].1)).sum();
            (WAY_M < way).then(|| way / span)
        })
        .collect();
    speeds.sort_by(f64::total_cmp);
    let median = (!speeds.is_empty()).then(|| median_high(&speeds));
    if span <= GREATEST_SPAN_S && median.is_none_or(|mps| span < 1e4 || LEAST_MPS <= mps) {
        return None;
    }
    let mut text = format!(
        "time_s spans {span} in whole numbers and is read as seconds ({:.1} days); if it is in milliseconds, divide it by \
         1000",
        span / 86_400.0
    );
    if let Some(mps) = median {
        let _ = write!(text, ". Mobile motes would move at {mps:.4} m/s");
    }
    text.push_str(". A wrong unit scales effects of time and motion by 1000");
    Some(text)
}

/// Senders and receivers of a moment.
type Ends = (BTreeSet<u32>, BTreeSet<u32>);

/// The time between changes of the position of a mote (s), in the median. Frames are logged more often than positions change where
/// positions are measured at a rate of their own, or hold for a step of a simulation: then a position is as old as this, and the time
/// between two frames says nothing of a speed. 0 where there are too few changes.
fn update_s(track: &[(f64, [f64; 3])]) -> f64 {
    // Heights may be unknown, and are then no number, which differs from itself.
    let has_moved = |pair: &&[(f64, [f64; 3])]| 0.0 < way_m(pair[0].1, pair[1].1);
    let changes: Vec<f64> = track.windows(2).filter(has_moved).map(|pair| pair[1].0).collect();
    let mut intervals_s: Vec<f64> = changes.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if intervals_s.len() < FEWEST_INTERVALS {
        return 0.0;
    }
    intervals_s.sort_by(f64::total_cmp);
    median_high(&intervals_s)
}

/// Signs of exchanged ends: one mote at two places at a time, motes that jump, one receiver of several senders at a time.
fn exchanged(rows: &[LinkRow], tracks: &Tracks) -> Vec<String> {
    let mut warnings = Vec::new();
    let (mut torn, mut jumping) = (BTreeSet::new(), BTreeSet::new());
    for (&(_, mote), track) in tracks {
        let update_s = update_s(track);
        for pair in track.windows(2) {
            let (passed_s, way) = (pair[1].0 - pair[0].0, way_m(pair[0].1, pair[1].1));
            if passed_s == 0.0 && 1.0 < way {
                torn.insert(mote);
            } else if LEAST_JUMP_M < way && GREATEST_MPS * passed_s.max(update_s) < way {
                jumping.insert(mote);
            }
        }
    }
    jumping.retain(|mote| !torn.contains(mote));
    if !torn.is_empty() {
        warnings.push(format!(
            "{} {}: in two places at the same time. Check whether tx and rx, or their positions, are swapped in some rows; \
             wrong distances invalidate every answer",
            noun(&torn),
            first_few(&torn)
        ));
    }
    if !jumping.is_empty() {
        warnings.push(format!(
            "{} {}: position jumps faster than {GREATEST_MPS} m/s. Check whether tx and rx, or their positions, are \
             swapped in some rows, and whether time_s is in s; wrong distances or speeds invalidate every answer",
            noun(&jumping),
            first_few(&jumping)
        ));
    }
    // A frame has one sender and several receivers.
    let mut moments: BTreeMap<(u32, u64, u8), Ends> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.time_s.is_finite()) {
        let key = (row.run, row.time_s.to_bits(), row.channel.unwrap_or(0));
        let (senders, receivers) = moments.entry(key).or_default();
        senders.insert(row.tx);
        receivers.insert(row.rx);
    }
    let count = |is_counted: fn(&Ends) -> bool| {
        moments.values().filter(|moment| is_counted(moment)).count()
    };
    let many_to_one = count(|(senders, receivers)| receivers.len() == 1 && 2 < senders.len());
    let one_to_many = count(|(senders, receivers)| senders.len() == 1 && 2 < receivers.len());
    if 10 <= many_to_one && 9 * one_to_many < many_to_one {
        warnings.push(format!(
            "at {many_to_one} times several motes send on one channel and one receives; the reverse occurs at \
             {one_to_many} times. Check whether tx and rx are swapped; if so, effects of one end (antennas, offsets of \
             motes) would be attributed to the other"
        ));
    }
    warnings
}

/// Motes that are missing or mute.
fn motes(rows: &[LinkRow]) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut counts: BTreeMap<u32, [f64; 4]> = BTreeMap::new();
    for row in rows {
        let got = if row.received.is_finite() { row.received } else { row.frames };
        let sender = counts.entry(row.tx).or_default();
        sender[0] += row.frames;
        sender[1] += got;
        let receiver = counts.entry(row.rx).or_default();
        receiver[2] += row.frames;
        receiver[3] += got;
    }
    let (first, last) = (counts.keys().next().copied(), counts.keys().next_back().copied());
    if let (Some(first), Some(last)) = (first, last) {
        // Numbers with holes, if they are numbers at all and not addresses.
        let missing: BTreeSet<u32> = if (last - first) as usize <= 2 * counts.len() {
            (first..=last).filter(|mote| !counts.contains_key(mote)).collect()
        } else {
            BTreeSet::new()
        };
        if !missing.is_empty() {
            warnings.push(format!(
                "{} {} without any row, although motes are numbered {first} to {last}: switched off, or rows were lost? Effects \
                 visible only on links of these are not found",
                noun(&missing),
                first_few(&missing)
            ));
        }
    }
    let with = |is: fn(&[f64; 4]) -> bool| -> BTreeSet<u32> {
        counts.iter().filter(|(_, counts)| is(counts)).map(|(mote, _)| *mote).collect()
    };
    let unheard = with(|[sent, heard, ..]| FEWEST_FRAMES <= *sent && *heard == 0.0);
    let deaf = with(|[_, _, sent, heard]| FEWEST_FRAMES <= *sent && *heard == 0.0);
    if !unheard.is_empty() {
        warnings.push(format!(
            "{} {}: sends, but is never received. If its radio was broken, leave its rows out; otherwise its losses count \
             as losses by distance or obstacles",
            noun(&unheard),
            first_few(&unheard)
        ));
    }
    if !deaf.is_empty() {
        warnings.push(format!(
            "{} {}: never receives a frame. If its radio was broken, leave its rows out; otherwise its losses count as \
             losses by distance or obstacles",
            noun(&deaf),
            first_few(&deaf)
        ));
    }
    warnings
}
