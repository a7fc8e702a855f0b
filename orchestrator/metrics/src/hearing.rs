//! Who heard whom in which part of a run, thinned out so that any run fits into a few pictures.

use super::period::Period;
use std::collections::BTreeMap;

/// Frames heard so far, by (receiver, sender), as reported at some times.
#[derive(Clone, Debug, Default)]
pub struct Hearing {
    reports: Vec<Report>,
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
        let states = period.states;
        let place = |agent: usize| {
            let is_alive = states.alive.get(agent) && period.motes.alive.get(agent);
            is_alive.then(|| [states.x_m[agent], states.y_m[agent]])
        };
        self.reports.push(Report {
            time_ns: period.time_ns,
            frames: pairs.zip(links.frames.iter().copied()).collect(),
            places: (0..states.len()).map(place).collect(),
        });
        if MAX_PERIODS < self.reports.len() {
            // The two periods that are shortest together become one; the latest stays as it is.
            let time_ns = |report: usize| self.reports[report].time_ns;
            let together =
                |&i: &usize| time_ns(i + 1) - if i == 0 { 0 } else { time_ns(i - 1) };
            if let Some(shortest) = (0..self.reports.len() - 1).min_by_key(together) {
                self.reports.remove(shortest);
            }
        }
    }

    /// The periods, one after the other. A last one that is short is part of the one before.
    #[must_use]
    pub fn periods(&self) -> Vec<HeardPeriod> {
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

fn between(begin: &Report, end: &Report) -> HeardPeriod {
    let is_alive = |mote: u32| end.places.get(mote as usize).is_some_and(Option::is_some);
    let mut pairs: BTreeMap<(u32, u32), bool> = BTreeMap::new();
    for (&(receiver, sender), &frames) in &end.frames {
        let before = begin.frames.get(&(receiver, sender)).copied().unwrap_or(0);
        if before < frames && is_alive(receiver) && is_alive(sender) {
            let pair = (receiver.min(sender), receiver.max(sender));
            pairs.entry(pair).and_modify(|both| *both = true).or_insert(false);
        }
    }
    HeardPeriod {
        from_ns: begin.time_ns,
        until_ns: end.time_ns,
        pairs,
        places: end.places.clone(),
    }
}

/// Most periods.
const MAX_PERIODS: usize = 12;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::Counts;
    use proto::types::{AgentStates, Bitmap, Deliveries, HeardLinks, MoteStates};

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
    fn a_short_last_period_joins_the_one_before() {
        let hearing = heard(&[(10, [1, 1, 1]), (20, [2, 2, 2]), (21, [2, 2, 2])]);
        let spans: Vec<[u64; 2]> =
            hearing.periods().iter().map(|it| [it.from_ns, it.until_ns]).collect();
        assert_eq!(spans, [[0, 10_000_000_000], [10_000_000_000, 21_000_000_000]]);
        assert_eq!(hearing.periods()[1].pairs, [((0, 1), true)].into());
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
