//! Who heard whom in which part of a run, thinned out so that any run fits into a few pictures.

use super::period::Period;
use proto::types::{Deliveries, Heard, MoteStates};
use std::collections::BTreeMap;

/// Who heard whom: of robots that speak in windows of a second, of others as the network reports it from time to time.
#[derive(Clone, Debug, Default)]
pub struct Hearing {
    /// Frames heard so far, as reported at some times.
    reports: Vec<Report>,
    /// Windows that are kept, equally spaced.
    kept: Vec<HeardPeriod>,
    /// One of so many windows is kept.
    every: usize,
    /// Windows that have ended.
    n_ended: usize,
    /// The latest of them, and the one under way.
    ended: Option<Window>,
    under_way: Option<Window>,
}

/// What robots heard of each other in a while.
#[derive(Clone, Debug, Default)]
struct Window {
    from_ns: u64,
    until_ns: u64,
    heard: HeardMatrix,
    places: Vec<Option<[f64; 2]>>,
}

/// Who heard whom: a row of bits for each receiver, a bit for each sender.
#[derive(Clone, Debug, Default)]
struct HeardMatrix {
    row_bytes: usize,
    bytes: Vec<u8>,
}

impl HeardMatrix {
    fn new(n_agents: usize) -> Self {
        let row_bytes = n_agents.div_ceil(8);
        Self { row_bytes, bytes: vec![0; n_agents * row_bytes] }
    }

    fn add(&mut self, deliveries: &Deliveries) {
        let senders = &deliveries.transmissions.sender;
        // All speak once, in their order: the usual case, whose rows are this matrix.
        let is_each = 8 * (self.row_bytes.max(1) - 1) < senders.len()
            && senders.iter().enumerate().all(|(index, &sender)| index == sender as usize);
        match &deliveries.heard {
            Heard::Rows { bytes, row_bytes }
                if is_each && *row_bytes == self.row_bytes && bytes.len() == self.bytes.len() =>
            {
                self.bytes.iter_mut().zip(bytes).for_each(|(all, &new)| *all |= new);
            }
            _ if senders.is_empty() => {}
            _ => {
                for (receiver, row) in self.bytes.chunks_exact_mut(self.row_bytes).enumerate() {
                    for index in deliveries.heard_by(receiver) {
                        let sender = senders[index] as usize;
                        row[sender / 8] |= 1 << (sender % 8);
                    }
                }
            }
        }
    }

    /// What either says.
    fn with(&self, other: &Self) -> Self {
        let bytes = self.bytes.iter().zip(&other.bytes).map(|(one, two)| one | two).collect();
        Self { row_bytes: self.row_bytes, bytes }
    }

    /// (receiver, sender) of all bits.
    fn pairs(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        let rows = self.bytes.chunks_exact(self.row_bytes.max(1)).enumerate();
        rows.flat_map(|(receiver, row)| {
            let bytes = row.iter().enumerate().filter(|(_, byte)| **byte != 0);
            bytes.flat_map(move |(at, byte)| {
                let senders = (0..8).filter(move |bit| byte >> bit & 1 == 1);
                senders.map(move |bit| (receiver as u32, (8 * at + bit) as u32))
            })
        })
    }
}

/// What was reported at a time.
#[derive(Clone, Debug)]
struct Report {
    time_ns: u64,
    frames: BTreeMap<(u32, u32), u64>,
    /// Where living motes were (m, east and north).
    places: Vec<Option<[f64; 2]>>,
}

/// Who heard whom between two reports, and where the motes were at its end.
#[derive(Clone, Debug, PartialEq)]
pub struct HeardPeriod {
    /// Begin (ns).
    pub from_ns: u64,
    /// End (ns).
    pub until_ns: u64,
    /// Pairs of motes that were alive at the end, the lower number first: whether both heard the other.
    pub pairs: BTreeMap<(u32, u32), bool>,
    /// Where living motes were at the end (m, east and north); `None` for those that were dead or absent.
    pub places: Vec<Option<[f64; 2]>>,
}

impl Hearing {
    /// Adds a step, if it reports who has heard whom.
    pub fn add(&mut self, period: &Period<'_>) {
        let Some(links) = period.heard_links else { return };
        let pairs = links.receiver.iter().copied().zip(links.sender.iter().copied());
        self.reports.push(Report {
            time_ns: period.time_ns,
            frames: pairs.zip(links.frames.iter().copied()).collect(),
            places: places(period),
        });
        if MAX_PERIODS < self.reports.len() {
            // The two periods that are shortest together become one; the latest stays as it is.
            let time_ns = |report: usize| self.reports[report].time_ns;
            let together = |&i: &usize| time_ns(i + 1) - if i == 0 { 0 } else { time_ns(i - 1) };
            if let Some(shortest) = (0..self.reports.len() - 1).min_by_key(together) {
                self.reports.remove(shortest);
            }
        }
    }

    /// Adds what robots heard in a step in which they were free to move.
    pub fn add_payloads(&mut self, period: &Period<'_>) {
        let begin = || Window {
            from_ns: period.from_ns,
            heard: HeardMatrix::new(period.states.len()),
            ..Window::default()
        };
        let mut window = self.under_way.take().unwrap_or_else(begin);
        window.heard.add(period.deliveries);
        window.until_ns = period.time_ns;
        window.places = places(period);
        if window.until_ns - window.from_ns < WINDOW_NS {
            self.under_way = Some(window);
            return;
        }
        if self.n_ended.is_multiple_of(self.every.max(1)) {
            self.kept.push(window.period());
            if MAX_PERIODS < self.kept.len() {
                let mut index = 0;
                self.kept.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.every = 2 * self.every.max(1);
            }
        }
        self.n_ended += 1;
        self.ended = Some(window);
    }

    /// The periods, one after the other; the last one ends with the run. One that is short is part of the one before.
    #[must_use]
    pub fn periods(&self) -> Vec<HeardPeriod> {
        let windows = self.windows();
        if windows.iter().any(|window| !window.pairs.is_empty()) {
            windows
        } else {
            self.reported()
        }
    }

    fn windows(&self) -> Vec<HeardPeriod> {
        let is_long = |window: &&Window| WINDOW_NS <= 2 * (window.until_ns - window.from_ns);
        let last = match (&self.ended, &self.under_way) {
            (Some(ended), Some(rest)) if !is_long(&rest) => Some(Window {
                from_ns: ended.from_ns,
                heard: ended.heard.with(&rest.heard),
                ..rest.clone()
            }),
            (_, Some(rest)) => Some(rest.clone()),
            (ended, None) => ended.clone(),
        };
        let Some(last) = last else { return Vec::new() };
        let before = self.kept.iter().filter(|window| window.from_ns < last.from_ns);
        before.cloned().chain([last.period()]).collect()
    }

    fn reported(&self) -> Vec<HeardPeriod> {
        let mut reports: Vec<&Report> = self.reports.iter().collect();
        let times: Vec<u64> = reports.iter().map(|report| report.time_ns).collect();
        if let [.., before, last, end] = [&[0_u64][..], &times[..]].concat()[..]
            && 2 * (end - last) < last - before
        {
            reports.remove(reports.len() - 2);
        }
        let nothing = Report { time_ns: 0, frames: BTreeMap::new(), places: Vec::new() };
        let begins = std::iter::once(&nothing).chain(reports.iter().copied());
        begins.zip(&reports).map(|(begin, end)| between(begin, end)).collect()
    }
}

impl Window {
    fn period(&self) -> HeardPeriod {
        HeardPeriod {
            from_ns: self.from_ns,
            until_ns: self.until_ns,
            pairs: pairs_of(self.heard.pairs(), &self.places),
            places: self.places.clone(),
        }
    }
}

/// Where living motes of living robots are after a step.
fn places(period: &Period<'_>) -> Vec<Option<[f64; 2]>> {
    let states = period.states;
    let place = |agent: usize| {
        let is_alive = states.alive.get(agent) && works(period.motes, agent);
        is_alive.then(|| [states.x_m[agent], states.y_m[agent]])
    };
    (0..states.len()).map(place).collect()
}

/// Whether a mote works, as far as the network reports that.
pub(crate) fn works(motes: &MoteStates, mote: usize) -> bool {
    motes.alive.len() <= mote || motes.alive.get(mote)
}

/// Pairs of which one, or both, heard the other, of motes that have a place. A (receiver, sender) may come more than once.
fn pairs_of(
    heard: impl Iterator<Item = (u32, u32)>,
    places: &[Option<[f64; 2]>],
) -> BTreeMap<(u32, u32), bool> {
    let is_alive = |mote: u32| places.get(mote as usize).is_some_and(Option::is_some);
    let mut directions: BTreeMap<(u32, u32), [bool; 2]> = BTreeMap::new();
    for (receiver, sender) in heard.filter(|&(receiver, sender)| receiver != sender) {
        if is_alive(receiver) && is_alive(sender) {
            let pair = (receiver.min(sender), receiver.max(sender));
            directions.entry(pair).or_default()[usize::from(receiver < sender)] = true;
        }
    }
    directions.into_iter().map(|(pair, [down, up])| (pair, down && up)).collect()
}

fn between(begin: &Report, end: &Report) -> HeardPeriod {
    let is_new =
        |pair: &(u32, u32), frames: u64| begin.frames.get(pair).copied().unwrap_or(0) < frames;
    let heard = end.frames.iter().filter(|&(pair, &frames)| is_new(pair, frames));
    HeardPeriod {
        from_ns: begin.time_ns,
        until_ns: end.time_ns,
        pairs: pairs_of(heard.map(|(&pair, _)| pair), &end.places),
        places: end.places.clone(),
    }
}

/// Length of a window (ns).
const WINDOW_NS: u64 = 1_000_000_000;

/// Most periods.
const MAX_PERIODS: usize = 12;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::Counts;
    use proto::types::{AgentStates, Bitmap, EVERYONE, HeardLinks, Payloads, Transmissions};

    /// Three motes; reports at these times (s) of the frames that mote 0 has heard of 1 and 1 of 0, and 2 of 0. Mote 2 is dead
    /// from 30 s on.
    fn heard(reports: &[(u64, [u64; 3])]) -> Hearing {
        let mut states = AgentStates::at_origin(3);
        let deliveries = Deliveries::default();
        let counts = Counts::from_deliveries(&deliveries, 3);
        let mut hearing = Hearing::default();
        for &(time_s, frames) in reports {
            states.x_m[1] = time_s as f64;
            let mut alive = Bitmap::filled(3, true);
            alive.set(2, time_s < 30);
            let motes = MoteStates { alive, ..MoteStates::default() };
            let links = HeardLinks {
                receiver: vec![0, 1, 2],
                sender: vec![1, 0, 0],
                frames: frames.to_vec(),
                rssi_dbm: vec![-60.0; 3],
            };
            let places = [(0, &states), (time_s * 1_000_000_000, &states)];
            let period = Period::of_places(1, places, (&deliveries, &counts), &motes);
            hearing.add(&Period { heard_links: Some(&links), ..period });
        }
        hearing
    }

    #[test]
    fn a_pair_that_no_longer_hears_each_other_and_a_dead_mote_are_not_of_the_last_period() {
        let hearing = heard(&[(10, [5, 5, 5]), (20, [5, 9, 9]), (30, [5, 10, 10])]);
        let periods = hearing.periods();
        assert_eq!(periods[0].pairs, [((0, 1), true), ((0, 2), false)].into());
        assert_eq!(periods[1].pairs, [((0, 1), false), ((0, 2), false)].into());
        assert_eq!(periods[2].pairs, [((0, 1), false)].into());
        assert_eq!(periods[2].places, [Some([0.0, 0.0]), Some([30.0, 0.0]), None]);
        assert_eq!([periods[2].from_ns, periods[2].until_ns], [20_000_000_000, 30_000_000_000]);
    }

    #[test]
    fn robots_that_flew_apart_do_not_hear_each_other_in_the_last_period() {
        let mut states = AgentStates::at_origin(2);
        let motes = MoteStates { alive: Bitmap::filled(2, true), ..MoteStates::default() };
        let mut hearing = Hearing::default();
        // Ten steps a second, for 20.3 s. Both speak; they hear each other for 12 s.
        for step in 1..=203_u32 {
            let is_near = step <= 120;
            states.x_m[1] = f64::from(step);
            let deliveries = Deliveries {
                transmissions: Transmissions {
                    sender: vec![0, 1],
                    sent_ns: vec![0; 2],
                    end_ns: vec![1; 2],
                    payloads: Payloads::new(vec![0; 2], vec![].into()).unwrap(),
                    destination: vec![EVERYONE; 2],
                },
                heard: Heard::Lists {
                    ends: if is_near { vec![1, 2] } else { vec![0, 0] },
                    indices: if is_near { vec![1, 0] } else { vec![] },
                },
                ..Deliveries::default()
            };
            let counts = Counts::from_deliveries(&deliveries, 2);
            let [from_ns, time_ns] = [step - 1, step].map(|step| u64::from(step) * 100_000_000);
            let places = [(from_ns, &states), (time_ns, &states)];
            hearing.add_payloads(&Period::of_places(1, places, (&deliveries, &counts), &motes));
        }
        let periods = hearing.periods();
        assert_eq!(periods[0].pairs, [((0, 1), true)].into());
        let last = periods.last().unwrap();
        assert_eq!([last.from_ns, last.until_ns], [19_000_000_000, 20_300_000_000]);
        assert!(last.pairs.is_empty() && last.places[1] == Some([203.0, 0.0]));
        assert!((6..=MAX_PERIODS + 1).contains(&periods.len()), "{}", periods.len());
    }

    #[test]
    fn rows_of_bits_and_lists_say_the_same_of_who_heard_whom() {
        let n = 11;
        // Receiver r hears r+1 and r+4; all speak, or all but the first two.
        for silent in [0, 2_u32] {
            let sender: Vec<u32> = (silent..n).collect();
            let heard_of = |receiver: u32| {
                let mut heard = vec![(receiver + 1) % n, (receiver + 4) % n];
                heard.sort_unstable();
                heard
                    .into_iter()
                    .filter_map(|one| sender.iter().position(|&it| it == one))
                    .collect::<Vec<_>>()
            };
            let (mut ends, mut indices) = (Vec::new(), Vec::new());
            let mut bytes = vec![0_u8; 2 * n as usize];
            for receiver in 0..n {
                for index in heard_of(receiver) {
                    indices.push(index as u32);
                    bytes[2 * receiver as usize + index / 8] |= 1 << (index % 8);
                }
                ends.push(indices.len() as u32);
            }
            let expected: Vec<(u32, u32)> = (0..n)
                .flat_map(|receiver| {
                    heard_of(receiver).into_iter().map(move |index| (receiver, index))
                })
                .map(|(receiver, index)| (receiver, sender[index]))
                .collect();
            for heard in [
                Heard::Lists { ends: ends.clone(), indices: indices.clone() },
                Heard::Rows { bytes: bytes.clone().into(), row_bytes: 2 },
            ] {
                let transmissions =
                    Transmissions { sender: sender.clone(), ..Transmissions::default() };
                let mut matrix = HeardMatrix::new(n as usize);
                matrix.add(&Deliveries { transmissions, heard, ..Deliveries::default() });
                assert_eq!(matrix.pairs().collect::<Vec<_>>(), expected);
            }
        }
    }

    #[test]
    fn a_short_last_period_joins_the_one_before() {
        let hearing = heard(&[(10, [1, 1, 1]), (20, [2, 2, 2]), (21, [2, 2, 2])]);
        let spans: Vec<[u64; 2]> =
            hearing.periods().iter().map(|it| [it.from_ns, it.until_ns]).collect();
        assert_eq!(spans, [[0, 10_000_000_000], [10_000_000_000, 21_000_000_000]]);
        assert_eq!(hearing.periods()[1].pairs, [((0, 1), true), ((0, 2), false)].into());
    }

    #[test]
    fn a_long_run_keeps_few_periods_that_cover_it() {
        let reports: Vec<(u64, [u64; 3])> = (1..=100).map(|k| (10 * k, [k, k, k])).collect();
        let periods = heard(&reports).periods();
        assert!((6..=MAX_PERIODS).contains(&periods.len()));
        assert_eq!((periods[0].from_ns, periods.last().unwrap().until_ns), (0, 1_000_000_000_000));
        assert!(periods.windows(2).all(|pair| pair[0].until_ns == pair[1].from_ns));
        assert!(periods.iter().all(|it| it.until_ns - it.from_ns < 400_000_000_000));
    }
}
