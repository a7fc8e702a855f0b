//! Frames that a receiver did not log, as the sequence numbers of their senders show them.
//!
//! A receiver that logged at least one frame of a sender lost the sender's other frames while it was logging: from its first row to its
//! last, of any sender. These frames are those that other receivers logged in this time, and the numbers between two that were logged.

use crate::account::Account;
use crate::derive::{numbered, reject_numbers};
use crate::frame::{BYTES_OF_CELL, Frame, NO_TIME};
use crate::join::{self, Match};
use crate::mapping::{Join, JoinKind};
use crate::sequence::{self, Counting, Gap, Numbered, OUT_OF_ORDER, SequenceGaps};
use measure::links;
use measure::memory::Memory;
use measure::time_of_day;
use proto::bounds::ROWS;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// What was added to the rows of a run.
#[derive(Debug, Default)]
pub(crate) struct Added {
    /// Rows of lost frames.
    pub n_lost: usize,
    /// What the numbers say, by sender and receiver.
    pub gaps: Vec<SequenceGaps>,
    /// Senders of whose frames none was logged by two receivers, although several receivers logged some.
    pub n_unshared: usize,
}

/// The number of a campaign as a log states it, by its bits, and a sender.
type SenderKey = (u64, u32);

/// The frames of a sender that each receiver logged, in order of time.
type Logged = BTreeMap<u32, Vec<Numbered>>;

/// A frame that a receiver did not log.
struct Lost {
    /// Its time by the receiver's clock, its number, and a row of the same run.
    frame: Numbered,
    tx: u32,
    rx: u32,
    /// The row is that of another receiver, which logged the frame.
    is_logged: bool,
}

/// Adds a row for every frame that a receiver did not log.
///
/// Rows whose numbers cannot show lost frames are rejected.
///
/// * `run`: number of the run.
/// * `modulus`: where numbers begin anew, as the mapping states it.
///
/// # Errors
///
/// The table would have more rows than a table may have, or need more memory than there is.
pub(crate) fn add_lost_frames(
    frame: &mut Frame,
    run: u32,
    modulus: Option<u64>,
    account: &mut Account<'_>,
    memory: &mut Memory,
) -> Result<Added, String> {
    reject_numbers(frame, modulus, account);
    frame.reject(account, |frame, row| {
        let is_missing = frame.column("sequence")?[row].is_nan();
        is_missing.then(|| "sequence is missing, so losses around it are not known".to_owned())
    });
    let mut reasons = vec![None; frame.n_rows()];
    let mut countings: BTreeMap<SenderKey, Counting> = BTreeMap::new();
    for (sender, mut logged) in by_sender(frame) {
        let counting = counting_of(&logged, modulus);
        countings.insert(sender, counting);
        logged.values_mut().for_each(|frames| drop_repeats(frames, counting, &mut reasons));
        if !is_count(&logged, counting) {
            let rows = logged.values().flatten().map(|frame| frame.row);
            rows.for_each(|row| reasons[row] = Some(NO_COUNT));
        }
    }
    frame.reject(account, |_, row| reasons[row].map(str::to_owned));
    let n_working = 4 * frame.n_rows() * size_of::<Numbered>();
    memory.take(n_working as u64, "sequence numbers")?;
    let mut added = Added::default();
    let mut lost: Vec<Lost> = Vec::new();
    let covered_ns = covered_ns(frame);
    for ((stated_run, tx), mut logged) in by_sender(frame) {
        let Some(&counting) = countings.get(&(stated_run, tx)) else { continue };
        let offsets_ns = align(&mut logged, counting);
        let known = Known::of(&logged, counting);
        added.n_unshared += usize::from(known.is_unshared(&logged));
        for (&rx, own) in logged.iter().filter(|(rx, _)| **rx != tx) {
            let offset_ns = offsets_ns.get(&rx).copied().unwrap_or(0);
            let (first_ns, last_ns) = covered_ns.get(&(stated_run, rx)).copied().unwrap_or((0, 0));
            let covered_ns = first_ns.saturating_sub(offset_ns)..=last_ns.saturating_sub(offset_ns);
            let (sent, others) = known.sent(own, &covered_ns, counting);
            let found = sequence::gaps(&sent, counting);
            let n_lost = others.len() + found.n_missing();
            ROWS.check((frame.n_rows() + lost.len() + n_lost) as u64)?;
            memory.take(
                (n_lost * (size_of::<Lost>() + size_of::<Matches>())) as u64,
                "lost frames",
            )?;
            let row = |one: Numbered, is_logged: bool| {
                let frame =
                    Numbered { created_ns: one.created_ns.saturating_add(offset_ns), ..one };
                Lost { frame, tx, rx, is_logged }
            };
            lost.extend(others.into_iter().map(|one| row(one, true)));
            lost.extend(found.gaps.iter().flat_map(Gap::missing).map(|one| row(one, false)));
            added.gaps.push(SequenceGaps {
                run,
                source: tx,
                receiver: Some(rx),
                arrived: own.len(),
                missing: n_lost,
                restarts: found.restarts,
                first_line: found.gaps.first().map_or(0, |gap| gap.after.line),
            });
        }
    }
    memory.release(n_working as u64);
    let n_cells = lost.len() * (frame.columns.len() + frame.times_ns.len());
    memory.take((n_cells * BYTES_OF_CELL) as u64, "lost frames")?;
    // A log whose times go back may hold several campaigns: its readers shall see that.
    let is_in_order = frame.time_ns().is_some_and(<[i64]>::is_sorted);
    append(frame, &lost);
    if is_in_order {
        let times_ns = frame.time_ns().unwrap_or_default();
        let mut order: Vec<usize> = (0..times_ns.len()).collect();
        order.sort_by_key(|&row| times_ns[row]);
        frame.reorder(&order);
    }
    added.n_lost = lost.len();
    Ok(added)
}

const LOGGED_BEFORE: &str =
    "the receiver logged the frame before: sender and sequence number are equal";
const NO_COUNT: &str = "the sequence numbers of the sender do not count its frames: they stay the same, or begin anew in more than one row \
                        of ten";

/// The frames of each sender that each receiver logged.
fn by_sender(frame: &Frame) -> BTreeMap<SenderKey, Logged> {
    let mut senders: BTreeMap<SenderKey, Logged> = BTreeMap::new();
    let columns = ["tx", "rx", "sequence"].map(|name| frame.column(name));
    let [Some(tx), Some(rx), Some(sequence)] = columns else { return senders };
    for row in 0..frame.n_rows() {
        let logged = senders.entry((stated_run(frame, row), tx[row] as u32)).or_default();
        logged.entry(rx[row] as u32).or_default().push(numbered(frame, sequence, row));
    }
    let lists = senders.values_mut().flat_map(BTreeMap::values_mut);
    // Within the resolution of times, the order of the log holds.
    lists.for_each(|frames| frames.sort_by_key(|one| (one.created_ns, one.row)));
    senders
}

fn stated_run(frame: &Frame, row: usize) -> u64 {
    frame.column("run").map_or(0, |column| column[row].to_bits())
}

/// From when to when each receiver was logging (ns), by run.
fn covered_ns(frame: &Frame) -> BTreeMap<SenderKey, (i64, i64)> {
    let mut covered: BTreeMap<SenderKey, (i64, i64)> = BTreeMap::new();
    if let (Some(rx), Some(times_ns)) = (frame.column("rx"), frame.time_ns()) {
        for (row, (&rx, &time_ns)) in rx.iter().zip(times_ns).enumerate() {
            let key = (stated_run(frame, row), rx as u32);
            let (first, last) = covered.entry(key).or_insert((time_ns, time_ns));
            (*first, *last) = ((*first).min(time_ns), (*last).max(time_ns));
        }
    }
    covered
}

/// How a sender's numbers count.
fn counting_of(logged: &Logged, modulus: Option<u64>) -> Counting {
    let greatest = logged.values().flatten().map(|one| u64::from(one.sequence)).max().unwrap_or(0);
    // Numbers that come near the end of a register are taken to begin anew there.
    let ends_at = |modulus: &u64| (modulus - u64::from(OUT_OF_ORDER)..*modulus).contains(&greatest);
    let inferred = || [1 << 8, 1 << 12, 1 << 16].into_iter().find(ends_at).unwrap_or(1 << 32);
    let counting = Counting { modulus: modulus.unwrap_or_else(inferred), period_ns: None };
    let mut periods_ns: Vec<f64> = Vec::new();
    let (mut elapsed_ns, mut steps) = (0.0, 0.0);
    for pair in logged.values().flat_map(|frames| frames.windows(2)) {
        if let Some(step) = counting.step(&pair[0], &pair[1]).filter(|&step| 0 < step) {
            let ns = pair[1].created_ns.saturating_sub(pair[0].created_ns) as f64;
            periods_ns.push(ns / step as f64);
            (elapsed_ns, steps) = (elapsed_ns + ns, steps + step as f64);
        }
    }
    periods_ns.sort_by(f64::total_cmp);
    let median_ns = periods_ns.get(periods_ns.len() / 2).copied().filter(|&ns| 0.0 < ns);
    // Where most frames share their time with the one before, the mean.
    let period_ns = median_ns.or(Some(elapsed_ns / steps)).filter(|&ns| 0.0 < ns);
    Counting { period_ns, ..counting }
}

/// Within as many usual periods, clocks of receivers may differ; fewer where numbers begin anew.
const MOST_APART: u64 = 1024;

fn apart(counting: Counting) -> u64 {
    MOST_APART.min(counting.modulus / 2)
}

/// Whether fewer numbers pass between two times than until numbers begin anew.
fn is_near(counting: Counting, earlier_ns: i64, later_ns: i64) -> bool {
    let elapsed_ns = later_ns.saturating_sub(earlier_ns) as f64;
    counting.period_ns.is_none_or(|period_ns| elapsed_ns <= apart(counting) as f64 * period_ns)
}

/// Drops frames that the receiver logged before: at the same time, or as the frame before, soon after it.
fn drop_repeats(
    frames: &mut Vec<Numbered>,
    counting: Counting,
    reasons: &mut [Option<&'static str>],
) {
    frames.dedup_by(|later, earlier| {
        let is_soon = || {
            counting.period_ns.is_some() && is_near(counting, earlier.created_ns, later.created_ns)
        };
        let is_repeat = later.sequence == earlier.sequence
            && (later.created_ns == earlier.created_ns || is_soon());
        if is_repeat {
            reasons[later.row] = Some(LOGGED_BEFORE);
        }
        is_repeat
    });
}

/// Whether numbers count the frames of a sender.
fn is_count(logged: &Logged, counting: Counting) -> bool {
    let mut pairs = logged.values().flat_map(|frames| frames.windows(2)).peekable();
    let is_single = pairs.peek().is_none();
    let is_rising = pairs.any(|pair| counting.step(&pair[0], &pair[1]).is_some_and(|s| 0 < s));
    let n_rows: usize = logged.values().map(Vec::len).sum();
    let restarts = logged.values().map(|frames| sequence::gaps(frames, counting).restarts);
    is_single || is_rising && 10 * restarts.sum::<usize>() <= n_rows.max(10)
}

/// Subtracts from the times of each receiver by how much its clock is ahead of that of the receiver with the most frames. Returns that by
/// receiver (ns).
fn align(logged: &mut Logged, counting: Counting) -> BTreeMap<u32, i64> {
    let mut times_ns: BTreeMap<u32, Vec<i64>> = BTreeMap::new();
    for one in logged.values().max_by_key(|frames| frames.len()).into_iter().flatten() {
        times_ns.entry(one.sequence).or_default().push(one.created_ns);
    }
    let mut offsets_ns = BTreeMap::new();
    for (&rx, frames) in logged {
        let offset_ns = offset_ns(frames, &times_ns, counting);
        frames.iter_mut().for_each(|one| one.created_ns = one.created_ns.saturating_sub(offset_ns));
        offsets_ns.insert(rx, offset_ns);
    }
    offsets_ns
}

/// By how much a receiver's clock is ahead (ns): the most frequent difference between its times and the nearest times at which the
/// reference logged the same number. 0 where too few frames say so.
fn offset_ns(own: &[Numbered], reference_ns: &BTreeMap<u32, Vec<i64>>, counting: Counting) -> i64 {
    const FEWEST: usize = 3;
    let Some(period_ns) = counting.period_ns else { return 0 };
    let difference = |one: &Numbered| {
        let times_ns = reference_ns.get(&one.sequence)?;
        let at = times_ns.partition_point(|&time_ns| time_ns < one.created_ns);
        let near = times_ns[at.saturating_sub(1)..times_ns.len().min(at + 1)].iter();
        near.map(|&time_ns| one.created_ns.saturating_sub(time_ns))
            .min_by_key(|ns| ns.unsigned_abs())
    };
    let mut differences_ns: Vec<i64> = own.iter().filter_map(difference).collect();
    differences_ns.sort_unstable();
    // The differences that lie in one period, for each that is the least of them.
    let mut end = 0;
    let of_one_period = (0..differences_ns.len()).map(|first| {
        let is_in = |ns: i64| (ns.saturating_sub(differences_ns[first]) as f64) < period_ns;
        while differences_ns.get(end).is_some_and(|&ns| is_in(ns)) {
            end += 1;
        }
        first..end
    });
    let most = of_one_period.max_by_key(ExactSizeIterator::len).unwrap_or(0..0);
    let is_enough = FEWEST <= most.len();
    if is_enough { differences_ns[(most.start + most.end) / 2] } else { 0 }
}

/// The frames of a sender that any receiver logged.
struct Known {
    /// Each once, as the first receiver logged it, in order of time.
    frames: Vec<Numbered>,
    /// How many rows are of a frame that another receiver had logged.
    n_shared: usize,
}

impl Known {
    fn of(logged: &Logged, counting: Counting) -> Self {
        let mut all: Vec<Numbered> = logged.values().flatten().copied().collect();
        all.sort_by_key(|one| (one.created_ns, one.row));
        let mut known = Self { frames: Vec::new(), n_shared: 0 };
        let mut places: BTreeMap<u32, usize> = BTreeMap::new();
        let apart = apart(counting) as usize;
        for one in all {
            let last = places.get(&one.sequence);
            if last.is_some_and(|last| known.frames.len() < last + apart) {
                known.n_shared += 1;
            } else {
                places.insert(one.sequence, known.frames.len());
                known.frames.push(one);
            }
        }
        known
    }

    /// Whether several receivers logged frames of the sender, and none was logged by two.
    fn is_unshared(&self, logged: &Logged) -> bool {
        let is_long = |frames: &&Vec<Numbered>| OUT_OF_ORDER as usize <= frames.len();
        self.n_shared == 0 && 2 <= logged.values().filter(is_long).count()
    }

    /// What is known to have been sent while a receiver was logging, in order; and of that, what others logged and it did not.
    ///
    /// Clocks of receivers may still differ, so what another logged must also fit by its number between the frames that the receiver
    /// logged.
    ///
    /// * `own`: what it logged, in order of time.
    /// * `covered_ns`: from when to when it was logging.
    fn sent(
        &self,
        own: &[Numbered],
        covered_ns: &RangeInclusive<i64>,
        counting: Counting,
    ) -> (Vec<Numbered>, Vec<Numbered>) {
        let rises = |from: Option<&Numbered>, to: Option<&Numbered>| {
            let Some((from, to)) = from.zip(to) else { return true };
            let is_rise = |step: u64| 0 < step && step < counting.modulus / 2;
            !is_near(counting, from.created_ns, to.created_ns)
                || counting.step(from, to).is_some_and(is_rise)
        };
        let (mut sent, mut others) = (Vec::new(), Vec::new());
        let mut n_own = 0;
        for one in self.frames.iter().filter(|one| covered_ns.contains(&one.created_ns)) {
            while own.get(n_own).is_some_and(|own| own.created_ns <= one.created_ns) {
                sent.push(own[n_own]);
                n_own += 1;
            }
            let before = n_own.checked_sub(1).and_then(|last| own.get(last));
            if rises(before, Some(one)) && rises(Some(one), own.get(n_own)) {
                sent.push(*one);
                others.push(*one);
            }
        }
        sent.extend(&own[n_own..]);
        (sent, others)
    }
}

/// Appends a row for each lost frame.
///
/// What belongs to sender or receiver (`tx_…`, `rx_…`) is interpolated in time over all rows of that node, and every other column over
/// the rows of the link; whole numbers are those of the nearer row. Readings of the frame are empty. The channel is that on which
/// another receiver logged the frame, or the only one of the sender.
fn append(frame: &mut Frame, lost: &[Lost]) {
    let times_ns = frame.time_ns().map_or_else(Vec::new, <[i64]>::to_vec);
    let series = |key: &dyn Fn(usize) -> Option<(u64, u64, u64)>| {
        let mut lists: BTreeMap<(u64, u64, u64), Vec<(i64, usize)>> = BTreeMap::new();
        for (row, &time_ns) in times_ns.iter().enumerate() {
            if let Some(key) = key(row) {
                lists.entry(key).or_default().push((time_ns, row));
            }
        }
        lists.values_mut().for_each(|rows| rows.sort_unstable());
        lists
    };
    let of = |name: &str, row: usize| Some(frame.column(name)?[row] as u64);
    let run = |row: usize| stated_run(frame, row);
    let by_tx = series(&|row| Some((run(row), of("tx", row)?, 0)));
    let by_rx = series(&|row| Some((run(row), of("rx", row)?, 0)));
    let by_link = series(&|row| Some((run(row), of("tx", row)?, of("rx", row)?)));
    let matches: Vec<Matches> = lost
        .iter()
        .map(|one| {
            let (run, tx, rx) = (run(one.frame.row), u64::from(one.tx), u64::from(one.rx));
            let time_ns = one.frame.created_ns;
            let at = |rows: Option<&Vec<(i64, usize)>>, kind: JoinKind| {
                join::nearest(rows?, time_ns, Join { kind, within_ns: i64::MAX })
            };
            let of_node = |rows: Option<&Vec<(i64, usize)>>| {
                at(rows, JoinKind::Interpolated).or_else(|| at(rows, JoinKind::Nearest))
            };
            Matches {
                tx: of_node(by_tx.get(&(run, tx, 0))),
                rx: of_node(by_rx.get(&(run, rx, 0))),
                link: at(by_link.get(&(run, tx, rx)), JoinKind::Interpolated),
            }
        })
        .collect();
    let only_channels = only_channels(frame);
    let runs: Vec<u64> = lost.iter().map(|one| run(one.frame.row)).collect();
    for (name, values) in &mut frame.columns {
        let is_whole = values.iter().all(|value| value.is_nan() || value.fract() == 0.0)
            && !name.ends_with("_m")
            && !name.ends_with("_rad");
        let interpolated = |matched: Option<Match>, values: &[f64]| match matched {
            None => f64::NAN,
            Some(found) if is_whole => {
                values[if found.weight < 0.5 { found.row } else { found.next }]
            }
            Some(found) => join::value(name, values, found),
        };
        for ((one, matches), run) in lost.iter().zip(&matches).zip(&runs) {
            let value = match name.as_str() {
                "tx" => f64::from(one.tx),
                "rx" => f64::from(one.rx),
                "run" => values[one.frame.row],
                "sequence" => f64::from(one.frame.sequence),
                "received" => 0.0,
                "channel" if one.is_logged => values[one.frame.row],
                "channel" => {
                    only_channels.get(&(*run, one.tx)).copied().flatten().unwrap_or(f64::NAN)
                }
                "rssi_dbm" => f64::NAN,
                name if links::is_reading_of_frame(name) => f64::NAN,
                name if name.starts_with("tx_") => interpolated(matches.tx, values),
                time_of_day::START => interpolated(matches.rx, values),
                name if name.starts_with("rx_") => interpolated(matches.rx, values),
                _ => interpolated(matches.link, values),
            };
            values.push(value);
        }
    }
    for (name, times) in &mut frame.times_ns {
        let is_time = name == "time_s";
        times.extend(lost.iter().map(|one| if is_time { one.frame.created_ns } else { NO_TIME }));
    }
    frame.lines.extend(lost.iter().map(|one| one.frame.line));
}

/// The rows around a lost frame, by whose they are.
struct Matches {
    tx: Option<Match>,
    rx: Option<Match>,
    link: Option<Match>,
}

/// The channel of each sender that has one channel only, in each run.
fn only_channels(frame: &Frame) -> BTreeMap<SenderKey, Option<f64>> {
    let mut channels: BTreeMap<SenderKey, Option<f64>> = BTreeMap::new();
    if let (Some(tx), Some(channel)) = (frame.column("tx"), frame.column("channel")) {
        for (row, (&tx, &channel)) in tx.iter().zip(channel).enumerate() {
            let known =
                channels.entry((stated_run(frame, row), tx as u32)).or_insert(Some(channel));
            *known = known.filter(|&known| known == channel);
        }
    }
    channels
}

#[cfg(test)]
mod tests;
