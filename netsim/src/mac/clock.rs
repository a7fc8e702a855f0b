//! A mote's clock: how far it has drifted from true time since it was last corrected, and what it has learned of its rate.

use crate::dice::Dice;
use crate::wire::Eui64;
use physics::timing::RX_WAIT_NS;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

/// A crystal, its last correction, and the rate that the mote compensates.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// How much too fast (parts per 10⁹, negative: too slow), compensation included.
    rate_ppb: i64,
    /// When it was corrected.
    corrected: SimTime,
    /// How far it was off then (ns; positive: its slots begin late).
    offset_ns: i64,
    /// Resolution of a correction: one tick.
    tick: SimDuration,
    drift: Drift,
}

/// What a mote has learned of the rate of its clock against that of its time source.
///
/// # Model
///
/// The corrections of a window are added up. Their sum over the length of the window is the rate by which the compensated clock
/// is still off, to within a tick over that length. The first window lasts at least 20 s and is compensated wholly; each of the
/// next three is at least twice as long as the one before, and half of what it shows is compensated, so that errors of a single
/// window fade. The bound on the rate that remains is the greatest that windows have shown lately, an older one counting a
/// quarter less with each newer one, and a tick over the length of a window more.
///
/// T. Chang, T. Watteyne, K. Pister, Q. Wang, "Adaptive synchronization in multi-hop TSCH networks", Computer Networks 76, 2015.
///
/// # Validity
///
/// A mote that counts whole ticks compensates to within one more tick.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Drift {
    /// Rate that is compensated (parts per 10⁹).
    compensated_ppb: i64,
    /// Whose time the corrections of the window were taken from.
    source: Option<Eui64>,
    /// When the window began.
    begun: SimTime,
    /// Sum of its corrections (ns).
    sum_ns: i64,
    /// Windows that were measured, those against sources before counting for one; counted to [`N_DOUBLINGS`].
    n_windows: u8,
    /// Bound on the rate that remains (parts per 10⁹).
    bound_ppb: Option<u64>,
    /// Whether a window against this source has confirmed it.
    is_confirmed: bool,
    /// Whether some source has been kept long enough for the rate to be that of the root, not of motes that pass by.
    is_settled: bool,
}

/// Least length of the first window: a tick of 32,768 Hz over it is 1.5 ppm. Motes that move keep a source for 10 s or 20, which
/// is too short to learn from, as the source itself is corrected meanwhile.
const WINDOW: SimDuration = SimDuration::from_s(20);
/// So often the next one is twice as long: a tick over the last is 0.2 ppm.
const N_DOUBLINGS: u8 = 3;
/// Windows after which a mote settles with its source: they take 140 s, 120 s with a later source. Among motes that move none is
/// kept for so long.
const N_TO_SETTLE: u8 = 3;

impl Clock {
    /// A clock of a rate error uniform within ±`max_drift_ppm`, corrected in ticks of a `crystal_hz` crystal.
    ///
    /// The rate is constant: temperature and ageing are absent.
    #[must_use]
    pub fn new(max_drift_ppm: f64, crystal_hz: u32, dice: &mut Dice) -> Self {
        let rate_ppb = libm::round(dice.between(-1.0, 1.0) * max_drift_ppm * 1e3) as i64;
        Self { rate_ppb, tick: SimDuration::SECOND / u64::from(crystal_hz), ..Self::exact() }
    }

    /// A clock that is always right: a root's, which defines time.
    #[must_use]
    pub fn exact() -> Self {
        Self {
            rate_ppb: 0,
            corrected: SimTime::START,
            offset_ns: 0,
            tick: SimDuration::ZERO,
            drift: Drift::default(),
        }
    }

    /// The same crystal, faster by so much (ppm).
    #[must_use]
    pub fn faster(self, ppm: f64) -> Self {
        Self { rate_ppb: self.rate_ppb + libm::round(ppm * 1e3) as i64, ..self }
    }

    /// How far it is off: its slots begin that much after true time.
    #[must_use]
    pub fn deviation_ns(&self, now: SimTime) -> i64 {
        let elapsed = now.saturating_since(self.corrected);
        let whole = i64::try_from(elapsed.ns()).ok().and_then(|ns| self.rate_ppb.checked_mul(ns));
        self.offset_ns
            - match whole {
                Some(product) => product / 1_000_000_000,
                // After 9 million seconds at 1000 ppm.
                None => {
                    (i128::from(self.rate_ppb) * i128::from(elapsed.ns()) / 1_000_000_000) as i64
                }
            }
    }

    /// Takes over the time of another clock that is off by `source_ns`, to the nearest tick.
    pub fn correct(&mut self, source_ns: i64, now: SimTime, dice: &mut Dice) {
        let half_ns = (self.tick / 2).ns() as i64;
        self.offset_ns = source_ns + dice.below(self.tick.ns().max(1)) as i64 - half_ns;
        self.corrected = now;
    }

    /// The same, and learns from it how fast the clock is against that of `source`.
    ///
    /// What was learned against another source is compensated further, as both keep the root's time, but how long the clock
    /// holds against this one is not known until it is measured.
    pub fn learn(&mut self, source: Eui64, source_ns: i64, now: SimTime, dice: &mut Dice) {
        let before_ns = self.deviation_ns(now);
        self.correct(source_ns, now, dice);
        let drift = &mut self.drift;
        if drift.source != Some(source) {
            let n_windows = drift.n_windows.min(1);
            let (source, is_confirmed) = (Some(source), false);
            *drift = Drift { source, begun: now, sum_ns: 0, n_windows, is_confirmed, ..*drift };
            return;
        }
        drift.sum_ns += self.offset_ns - before_ns;
        let length = now - drift.begun;
        if length < WINDOW * (1 << drift.n_windows) {
            return;
        }
        let over_length =
            |ns: i64| (i128::from(ns) * 1_000_000_000 / i128::from(length.ns())) as i64;
        let remaining_ppb = over_length(drift.sum_ns);
        let shown_ppb =
            remaining_ppb.unsigned_abs() + over_length(self.tick.ns() as i64).unsigned_abs();
        if drift.n_windows != 0 {
            let remembered_ppb = drift.bound_ppb.map_or(0, |bound| bound - bound / 4);
            drift.bound_ppb = Some(shown_ppb.max(remembered_ppb));
            drift.is_confirmed = true;
        }
        let step_ppb = if drift.n_windows == 0 { remaining_ppb } else { remaining_ppb / 2 };
        self.rate_ppb -= step_ppb;
        drift.compensated_ppb += step_ppb;
        drift.n_windows = (drift.n_windows + 1).min(N_DOUBLINGS);
        drift.is_settled |= drift.n_windows == N_TO_SETTLE;
        (drift.begun, drift.sum_ns) = (now, 0);
    }

    /// Time has been lost: what the clock is compared with begins anew. The rate that was learned is compensated further.
    pub(crate) fn forget_source(&mut self) {
        let compensated_ppb = self.drift.compensated_ppb;
        self.drift = Drift { compensated_ppb, ..Drift::default() };
    }

    /// The mote is switched off, and what it has learned is lost.
    pub fn forget(&mut self) {
        self.rate_ppb += self.drift.compensated_ppb;
        self.drift = Drift::default();
    }

    /// How long it certainly stays within half of the guard time of its source without a correction; `None`: that is not
    /// known. The other half is for the source, whose own clock is corrected meanwhile.
    #[must_use]
    pub fn holds(&self) -> Option<SimDuration> {
        self.drift.bound_ppb.filter(|_| self.drift.is_confirmed).map(|ppb| self.holds_within(ppb))
    }

    /// The same without a source: how long it stays so near to the time that all sources kept so far, the root's.
    #[must_use]
    pub(crate) fn runs_free(&self) -> Option<SimDuration> {
        self.drift.bound_ppb.filter(|_| self.drift.is_settled).map(|ppb| self.holds_within(ppb))
    }

    fn holds_within(&self, bound_ppb: u64) -> SimDuration {
        let budget_ns = (RX_WAIT_NS / 4).unsigned_abs().saturating_sub(self.tick.ns());
        SimDuration::from_ns(
            (u128::from(budget_ns) * 1_000_000_000 / u128::from(bound_ppb.max(1))) as u64,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::ids::MoteId;
    use proto::rng::Purpose;

    const S: u64 = 1_000_000_000;

    #[test]
    fn a_clock_drifts_with_its_rate_and_is_put_right_to_a_tick() {
        for seed in 0..200 {
            let mut dice = Dice::new(seed, Purpose::Mac, MoteId(1));
            let mut clock = Clock::new(30.0, 32_768, &mut dice);
            assert!(clock.deviation_ns(SimTime::from_ns(100 * S)).abs() <= 3_000_000);
            clock.correct(-500, SimTime::from_ns(100 * S), &mut dice);
            let after_ns = clock.deviation_ns(SimTime::from_ns(100 * S));
            assert!((-500 - 15_259..-500 + 15_259).contains(&after_ns), "{after_ns}");
        }
        assert_eq!(Clock::exact().deviation_ns(SimTime::NEVER), 0);
    }

    /// Learns against a source whose clock is off by `source_ns` at each time (s).
    fn learn(
        clock: &mut Clock,
        times_s: impl Iterator<Item = u64>,
        source_ns: impl Fn(u64) -> i64,
    ) {
        let mut dice = Dice::new(7, Purpose::Mac, MoteId(2));
        for at_s in times_s {
            clock.learn(
                Eui64::of_mote(MoteId(0)),
                source_ns(at_s * S),
                SimTime::from_ns(at_s * S),
                &mut dice,
            );
        }
    }

    #[test]
    fn a_rate_is_learned_from_corrections_whatever_their_spacing() {
        for seed in 0..100 {
            for every_s in [1, 7, 16] {
                let mut clock =
                    Clock::new(100.0, 32_768, &mut Dice::new(seed, Purpose::Mac, MoteId(1)));
                let times_s = (0..=300).step_by(every_s);
                let last_s = 300 / every_s as u64 * every_s as u64;
                learn(&mut clock, times_s, |_| 0);
                let off_ns = clock.deviation_ns(SimTime::from_ns((last_s + 100) * S));
                assert!(off_ns.abs() < 300_000, "{off_ns}");
                let holds = clock.holds().unwrap();
                let off_ns = clock.deviation_ns(SimTime::from_ns(last_s * S + holds.ns()));
                assert!(30 * S < holds.ns() && off_ns.abs() < 550_000, "{holds:?} {off_ns}");
            }
        }
    }

    #[test]
    fn nothing_is_known_before_two_windows_and_after_another_source() {
        let mut clock = Clock::new(30.0, 32_768, &mut Dice::new(1, Purpose::Mac, MoteId(1)));
        learn(&mut clock, 0..60, |_| 0);
        assert_eq!(clock.holds(), None);
        learn(&mut clock, 60..=60, |_| 0);
        assert!(clock.holds().is_some());
        let mut dice = Dice::new(2, Purpose::Mac, MoteId(2));
        clock.learn(Eui64::of_mote(MoteId(5)), 0, SimTime::from_ns(61 * S), &mut dice);
        assert_eq!(clock.holds(), None);
        // Who follows the root keeps its rate: the estimate remains.
        let drifted_ns = clock.deviation_ns(SimTime::from_ns(161 * S))
            - clock.deviation_ns(SimTime::from_ns(61 * S));
        assert!(drifted_ns.abs() < 500_000, "{drifted_ns}");
    }

    #[test]
    fn who_has_kept_a_source_for_two_minutes_runs_free_and_not_who_meets_others_all_the_time() {
        let mut clock = Clock::new(30.0, 32_768, &mut Dice::new(1, Purpose::Mac, MoteId(1)));
        learn(&mut clock, (0..140).step_by(5), |_| 0);
        assert_eq!(clock.runs_free(), None);
        learn(&mut clock, 140..=140, |_| 0);
        let known = clock.runs_free();
        assert!(known.is_some());
        // Another source does not make it forget how fast it is itself.
        let mut dice = Dice::new(2, Purpose::Mac, MoteId(2));
        clock.learn(Eui64::of_mote(MoteId(5)), 0, SimTime::from_ns(141 * S), &mut dice);
        assert_eq!(clock.runs_free(), known);
        let mut restless = Clock::new(30.0, 32_768, &mut Dice::new(1, Purpose::Mac, MoteId(1)));
        for at_s in 0..1000 {
            restless.learn(
                Eui64::of_mote(MoteId((at_s / 60) as u32)),
                0,
                SimTime::from_ns(at_s * S),
                &mut dice,
            );
        }
        assert_eq!(restless.runs_free(), None);
    }

    #[test]
    fn who_is_switched_off_knows_nothing_of_its_clock() {
        let new = Clock::new(30.0, 32_768, &mut Dice::new(1, Purpose::Mac, MoteId(1)));
        let mut clock = new.clone();
        learn(&mut clock, (0..=200).step_by(5), |_| 0);
        let drift_ns = |clock: &Clock| {
            clock.deviation_ns(SimTime::from_ns(1200 * S))
                - clock.deviation_ns(SimTime::from_ns(200 * S))
        };
        assert!(drift_ns(&clock).abs() * 10 < drift_ns(&new).abs(), "{}", drift_ns(&clock));
        clock.forget();
        assert_eq!((drift_ns(&clock), clock.runs_free()), (drift_ns(&new), None));
    }

    #[test]
    fn a_source_that_changes_its_pace_shortens_what_is_relied_on() {
        let mut clock = Clock::new(30.0, 32_768, &mut Dice::new(1, Purpose::Mac, MoteId(1)));
        learn(&mut clock, (0..=200).step_by(5), |_| 0);
        let calm = clock.holds().unwrap();
        // 50 ppm one way for a minute, then the other.
        let swings = |at_ns: u64| {
            let phase = (at_ns - 200 * S) % (120 * S);
            let ramp = if phase < 60 * S { phase } else { 120 * S - phase };
            ramp as i64 * 50 / 1_000_000
        };
        learn(&mut clock, (205..=800).step_by(5), swings);
        let holds = clock.holds().unwrap();
        assert!(holds * 4 < calm, "{holds:?} {calm:?}");
    }
}
