//! Simulated time: moments, and durations between them.
//!
//! Both are whole nanoseconds, so sums and differences are exact. They are written to messages, snapshots and files as
//! the number itself.

use crate::types::seconds;
use serde::{Deserialize, Serialize};
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Mul, Rem, Sub, SubAssign};

/// A moment of simulated time: the nanoseconds since the experiment began.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct SimTime(u64);

/// A duration of simulated time, never negative (ns).
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct SimDuration(u64);

impl SimTime {
    /// The moment at which an experiment begins.
    pub const START: Self = Self(0);
    /// Later than anything happens.
    pub const NEVER: Self = Self(u64::MAX);

    /// So many nanoseconds after the beginning.
    #[must_use]
    pub const fn from_ns(ns: u64) -> Self {
        Self(ns)
    }

    /// Nanoseconds since the beginning.
    #[must_use]
    pub const fn ns(self) -> u64 {
        self.0
    }

    /// Seconds since the beginning, for display and physics. Exact below 104 days.
    #[must_use]
    pub fn seconds(self) -> f64 {
        seconds(self.0)
    }

    /// How long this is after `earlier`; zero if it is before it.
    #[must_use]
    pub const fn saturating_since(self, earlier: Self) -> SimDuration {
        SimDuration(self.0.saturating_sub(earlier.0))
    }

    /// So much later; at the latest [`SimTime::NEVER`].
    #[must_use]
    pub const fn saturating_add(self, duration: SimDuration) -> Self {
        Self(self.0.saturating_add(duration.0))
    }

    /// So much earlier; at the earliest [`SimTime::START`].
    #[must_use]
    pub const fn saturating_sub(self, duration: SimDuration) -> Self {
        Self(self.0.saturating_sub(duration.0))
    }
}

impl SimDuration {
    /// No time.
    pub const ZERO: Self = Self(0);
    /// Longer than anything takes.
    pub const MAX: Self = Self(u64::MAX);
    /// One second.
    pub const SECOND: Self = Self(crate::types::NS_PER_S);

    /// So many nanoseconds.
    #[must_use]
    pub const fn from_ns(ns: u64) -> Self {
        Self(ns)
    }

    /// So many microseconds.
    #[must_use]
    pub const fn from_us(us: u64) -> Self {
        Self(us * 1_000)
    }

    /// So many milliseconds.
    #[must_use]
    pub const fn from_ms(ms: u64) -> Self {
        Self(ms * 1_000_000)
    }

    /// So many whole seconds.
    #[must_use]
    pub const fn from_s(s: u64) -> Self {
        Self(s * crate::types::NS_PER_S)
    }

    /// So many seconds, to the nearest nanosecond; nothing, if negative.
    #[must_use]
    pub fn from_seconds(seconds: f64) -> Self {
        Self((seconds * crate::types::NS_PER_S as f64).round() as u64)
    }

    /// Its nanoseconds.
    #[must_use]
    pub const fn ns(self) -> u64 {
        self.0
    }

    /// Its seconds, for display and physics. Exact below 104 days.
    #[must_use]
    pub fn seconds(self) -> f64 {
        seconds(self.0)
    }

    /// Whether it is no time at all.
    #[must_use]
    pub const fn is_zero(self) -> bool {
        self.0 == 0
    }

    /// So much more; at most [`SimDuration::MAX`].
    #[must_use]
    pub const fn saturating_add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }

    /// So much less; not less than nothing.
    #[must_use]
    pub const fn saturating_sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }

    /// So many times as long; at most [`SimDuration::MAX`].
    #[must_use]
    pub const fn saturating_mul(self, factor: u64) -> Self {
        Self(self.0.saturating_mul(factor))
    }

    /// How many times `part` begins in it: the quotient, rounded up.
    #[must_use]
    pub const fn div_ceil(self, part: Self) -> u64 {
        self.0.div_ceil(part.0)
    }
}

impl Add<SimDuration> for SimTime {
    type Output = Self;

    fn add(self, duration: SimDuration) -> Self {
        Self(self.0 + duration.0)
    }
}

impl AddAssign<SimDuration> for SimTime {
    fn add_assign(&mut self, duration: SimDuration) {
        self.0 += duration.0;
    }
}

impl Sub<SimDuration> for SimTime {
    type Output = Self;

    fn sub(self, duration: SimDuration) -> Self {
        Self(self.0 - duration.0)
    }
}

impl Sub for SimTime {
    type Output = SimDuration;

    fn sub(self, earlier: Self) -> SimDuration {
        SimDuration(self.0 - earlier.0)
    }
}

/// The time since the last multiple of a duration.
impl Rem<SimDuration> for SimTime {
    type Output = SimDuration;

    fn rem(self, period: SimDuration) -> SimDuration {
        SimDuration(self.0 % period.0)
    }
}

/// Whole periods since the beginning.
impl Div<SimDuration> for SimTime {
    type Output = u64;

    fn div(self, period: SimDuration) -> u64 {
        self.0 / period.0
    }
}

impl Add for SimDuration {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl AddAssign for SimDuration {
    fn add_assign(&mut self, other: Self) {
        self.0 += other.0;
    }
}

impl Sub for SimDuration {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl SubAssign for SimDuration {
    fn sub_assign(&mut self, other: Self) {
        self.0 -= other.0;
    }
}

impl Mul<u64> for SimDuration {
    type Output = Self;

    fn mul(self, factor: u64) -> Self {
        Self(self.0 * factor)
    }
}

impl Mul<SimDuration> for u64 {
    type Output = SimDuration;

    fn mul(self, duration: SimDuration) -> SimDuration {
        duration * self
    }
}

impl Div<u64> for SimDuration {
    type Output = Self;

    fn div(self, divisor: u64) -> Self {
        Self(self.0 / divisor)
    }
}

/// How often the other fits into it.
impl Div for SimDuration {
    type Output = u64;

    fn div(self, other: Self) -> u64 {
        self.0 / other.0
    }
}

impl Rem for SimDuration {
    type Output = Self;

    fn rem(self, other: Self) -> Self {
        Self(self.0 % other.0)
    }
}

impl Sum for SimDuration {
    fn sum<I: Iterator<Item = Self>>(durations: I) -> Self {
        durations.fold(Self::ZERO, Add::add)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_and_durations_are_exact_and_written_as_their_number() {
        let moment = SimTime::START + SimDuration::from_ms(1_500) * 3;
        assert_eq!(moment.ns(), 4_500_000_000);
        assert_eq!(moment.seconds(), 4.5);
        assert_eq!(moment - SimTime::from_ns(1), SimDuration::from_ns(4_499_999_999));
        assert_eq!((moment / SimDuration::SECOND, moment % SimDuration::SECOND).0, 4);
        assert_eq!(moment % SimDuration::SECOND, SimDuration::from_us(500_000));
        assert_eq!(SimTime::START.saturating_since(moment), SimDuration::ZERO);
        assert_eq!(SimTime::NEVER.saturating_add(SimDuration::SECOND), SimTime::NEVER);
        assert_eq!(serde_json::to_string(&moment).unwrap(), "4500000000");
        assert_eq!(serde_json::from_str::<SimDuration>("7").unwrap(), SimDuration::from_ns(7));
    }
}
