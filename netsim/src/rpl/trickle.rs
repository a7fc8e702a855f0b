//! When to say again what everyone may know already: the Trickle algorithm, RFC 6206.

use crate::dice::Dice;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

/// A Trickle timer. Names follow RFC 6206, § 4.1.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Trickle {
    /// Imin.
    interval_min: SimDuration,
    /// Imax.
    interval_max: SimDuration,
    /// k; 0: never suppressed (RFC 6206, § 6.5).
    redundancy: u8,
    running: Option<Interval>,
}

/// The current interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Interval {
    /// I.
    length: SimDuration,
    /// Its end.
    end: SimTime,
    /// t, until it has passed.
    transmit: Option<SimTime>,
    /// c.
    n_consistent: u8,
}

impl Trickle {
    /// A timer that does not run. The longest interval is the shortest one doubled `n_doublings` times.
    #[must_use]
    pub fn new(interval_min: SimDuration, n_doublings: u8, redundancy: u8) -> Self {
        let interval_min = interval_min.clamp(SimDuration::from_ns(2), LONGEST);
        let factor = 1u64.checked_shl(n_doublings.into()).unwrap_or(u64::MAX);
        let interval_max = interval_min.saturating_mul(factor).min(LONGEST);
        Self { interval_min, interval_max, redundancy, running: None }
    }

    /// Begins: the first interval is uniform in [Imin, Imax] (§ 4.2, rule 1).
    pub fn start(&mut self, now: SimTime, dice: &mut Dice) {
        let length = dice.duration(self.interval_min, self.interval_max + SimDuration::from_ns(1));
        self.begin(length, now, dice);
    }

    /// Begins with the shortest interval, which rule 1 permits and which a start followed at once by an inconsistency
    /// comes to.
    pub(crate) fn start_at_min(&mut self, now: SimTime, dice: &mut Dice) {
        self.begin(self.interval_min, now, dice);
    }

    /// Stops the timer: nothing is due until it is started again.
    pub fn stop(&mut self) {
        self.running = None;
    }

    /// Whether it runs.
    #[must_use]
    pub(crate) fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// The length of the current interval.
    #[must_use]
    pub fn interval(&self) -> Option<SimDuration> {
        self.running.map(|interval| interval.length)
    }

    /// A consistent message was heard (§ 4.2, rule 3).
    pub(crate) fn handle_consistent(&mut self) {
        if let Some(interval) = &mut self.running {
            interval.n_consistent = interval.n_consistent.saturating_add(1);
        }
    }

    /// An inconsistency was found (§ 4.2, rule 6): the shortest interval begins, unless it is the current one.
    /// Returns whether one begins.
    pub(crate) fn handle_inconsistent(&mut self, now: SimTime, dice: &mut Dice) -> bool {
        let resets = self.running.is_some_and(|interval| self.interval_min < interval.length);
        if resets {
            self.begin(self.interval_min, now, dice);
        }
        resets
    }

    /// When to call [`Trickle::handle_timeout`].
    #[must_use]
    pub fn poll_timeout(&self) -> Option<SimTime> {
        self.running.map(|interval| interval.transmit.unwrap_or(interval.end))
    }

    /// The time has come. Returns whether to transmit now (§ 4.2, rules 4 and 5).
    pub fn handle_timeout(&mut self, now: SimTime, dice: &mut Dice) -> bool {
        let Some(interval) = &mut self.running else { return false };
        if let Some(transmit) = interval.transmit
            && transmit <= now
        {
            interval.transmit = None;
            return self.redundancy == 0 || interval.n_consistent < self.redundancy;
        }
        if interval.end <= now && interval.transmit.is_none() {
            let length = interval.length.saturating_mul(2).min(self.interval_max);
            let begin = interval.end;
            self.begin(length, begin, dice);
        }
        false
    }

    /// Rule 2: c = 0, t uniform in [I/2, I).
    fn begin(&mut self, length: SimDuration, now: SimTime, dice: &mut Dice) {
        self.running = Some(Interval {
            length,
            end: now + length,
            transmit: Some(now + dice.duration(length / 2, length)),
            n_consistent: 0,
        });
    }
}

/// No interval is longer: 34 years.
const LONGEST: SimDuration = SimDuration::from_ns(1 << 60);

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proto::ids::MoteId;
    use proto::rng::Purpose;

    const MIN: SimDuration = SimDuration::from_ns(8_000_000);

    fn dice(seed: u64) -> Dice {
        Dice::new(seed, Purpose::Routing, MoteId(1))
    }

    /// Runs to the end of the current interval; returns the moments of transmission.
    fn one_interval(trickle: &mut Trickle, dice: &mut Dice) -> Vec<SimTime> {
        let end = trickle.running.unwrap().end;
        let mut sent = vec![];
        while let Some(at) = trickle.poll_timeout().filter(|&at| at <= end) {
            if trickle.handle_timeout(at, dice) {
                sent.push(at);
            }
        }
        sent
    }

    #[test]
    fn r12_fires_only_while_fewer_than_k_were_heard() {
        // RFC 6550, § 8.3.1: Imin 2^3 ms, 20 doublings, k 10.
        for n_heard in 0..20 {
            let mut dice = dice(n_heard);
            let mut trickle = Trickle::new(MIN, 20, 10);
            trickle.start_at_min(SimTime::START, &mut dice);
            for _ in 0..n_heard {
                trickle.handle_consistent();
            }
            assert_eq!(one_interval(&mut trickle, &mut dice).len(), usize::from(n_heard < 10));
        }
    }

    #[test]
    fn r12_the_interval_doubles_and_is_capped() {
        let mut dice = dice(1);
        let mut trickle = Trickle::new(MIN, 20, 10);
        trickle.start_at_min(SimTime::START, &mut dice);
        for doubling in 0..30 {
            assert_eq!(trickle.interval(), Some(MIN * (1 << doubling.min(20))));
            one_interval(&mut trickle, &mut dice);
        }
    }

    #[test]
    fn r12_a_reset_returns_to_imin() {
        let mut dice = dice(2);
        let mut trickle = Trickle::new(MIN, 20, 10);
        trickle.start_at_min(SimTime::START, &mut dice);
        one_interval(&mut trickle, &mut dice);
        assert!(
            trickle.handle_inconsistent(SimTime::START + MIN + SimDuration::from_ns(5), &mut dice)
        );
        assert_eq!(trickle.interval(), Some(MIN));
        assert_eq!(
            trickle.running.unwrap().end,
            SimTime::START + 2 * MIN + SimDuration::from_ns(5)
        );
    }

    #[test]
    fn r12_a_stop_cancels_both_moments() {
        let mut dice = dice(3);
        let mut trickle = Trickle::new(MIN, 20, 10);
        trickle.start_at_min(SimTime::START, &mut dice);
        trickle.stop();
        assert_eq!(trickle.poll_timeout(), None);
        assert!(!trickle.handle_timeout(SimTime::NEVER, &mut dice));
        assert!(!trickle.handle_inconsistent(SimTime::from_ns(1), &mut dice));
        assert!(!trickle.is_running());
    }

    #[test]
    fn rfc6206_4_2_rule_6_an_inconsistency_at_imin_changes_nothing() {
        let mut dice = dice(4);
        let mut trickle = Trickle::new(MIN, 20, 10);
        trickle.start_at_min(SimTime::START, &mut dice);
        let before = trickle.clone();
        assert!(!trickle.handle_inconsistent(SimTime::START + MIN / 4, &mut dice));
        assert_eq!(trickle, before);
    }

    #[test]
    fn rfc6206_4_2_rule_5_the_counter_begins_anew_with_each_interval() {
        let mut dice = dice(5);
        let mut trickle = Trickle::new(MIN, 20, 1);
        trickle.start_at_min(SimTime::START, &mut dice);
        trickle.handle_consistent();
        assert!(one_interval(&mut trickle, &mut dice).is_empty());
        assert_eq!(one_interval(&mut trickle, &mut dice).len(), 1);
    }

    #[test]
    fn rfc6206_6_5_with_k_zero_nothing_is_suppressed() {
        let mut dice = dice(6);
        let mut trickle = Trickle::new(MIN, 20, 0);
        trickle.start_at_min(SimTime::START, &mut dice);
        for _ in 0..300 {
            trickle.handle_consistent();
        }
        assert_eq!(one_interval(&mut trickle, &mut dice).len(), 1);
    }

    proptest! {
        #[test]
        fn rfc6206_4_2_rule_1_the_first_interval_lies_between_imin_and_imax(
            seed: u64, n_doublings in 0u8..40, min_ns in 2u64..1 << 40,
        ) {
            let mut trickle = Trickle::new(SimDuration::from_ns(min_ns), n_doublings, 3);
            trickle.start(SimTime::from_ns(9), &mut dice(seed));
            let length = trickle.interval().unwrap();
            prop_assert!(min_ns <= length.ns() && length <= trickle.interval_max);
        }

        #[test]
        fn rfc6206_4_2_rule_2_it_transmits_once_in_the_second_half_of_each_interval(
            seed: u64, n_doublings in 0u8..12,
        ) {
            let mut dice = dice(seed);
            let mut trickle = Trickle::new(MIN, n_doublings, 3);
            trickle.start(SimTime::START, &mut dice);
            for _ in 0..20 {
                let interval = trickle.running.unwrap();
                let sent = one_interval(&mut trickle, &mut dice);
                prop_assert_eq!(sent.len(), 1);
                prop_assert!(interval.end - SimDuration::from_ns(interval.length.ns().div_ceil(2)) <= sent[0]);
                prop_assert!(sent[0] < interval.end);
            }
        }
    }
}
