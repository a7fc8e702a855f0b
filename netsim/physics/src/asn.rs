//! Absolute slot numbers.

use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::{Add, AddAssign, Div, Mul, Rem, Sub};

/// An absolute slot number: slots since the network began (IEEE Std 802.15.4-2015, 6.2.6.3). Written to messages, snapshots and files
/// as the number itself.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct Asn(pub u64);

impl Asn {
    /// The first slot.
    pub const FIRST: Self = Self(0);
    /// Later than any.
    pub const NEVER: Self = Self(u64::MAX);

    /// The first slot that begins at a moment or later, where slots last so long.
    #[must_use]
    pub const fn first_from(time: SimTime, slot: SimDuration) -> Self {
        Self(time.ns().div_ceil(slot.ns()))
    }

    /// The slots since `earlier`; none if it is later.
    #[must_use]
    pub const fn saturating_since(self, earlier: Self) -> u64 {
        self.0.saturating_sub(earlier.0)
    }
}

/// So many slots later.
impl Add<u64> for Asn {
    type Output = Self;

    fn add(self, slots: u64) -> Self {
        Self(self.0 + slots)
    }
}

impl AddAssign<u64> for Asn {
    fn add_assign(&mut self, slots: u64) {
        self.0 += slots;
    }
}

/// So many slots earlier.
impl Sub<u64> for Asn {
    type Output = Self;

    fn sub(self, slots: u64) -> Self {
        Self(self.0 - slots)
    }
}

/// The slots between two.
impl Sub for Asn {
    type Output = u64;

    fn sub(self, earlier: Self) -> u64 {
        self.0 - earlier.0
    }
}

/// The number of its slotframe of so many slots.
impl Div<u64> for Asn {
    type Output = u64;

    fn div(self, slotframe_slots: u64) -> u64 {
        self.0 / slotframe_slots
    }
}

/// When it begins, where slots last so long.
impl Mul<SimDuration> for Asn {
    type Output = SimTime;

    fn mul(self, slot: SimDuration) -> SimTime {
        SimTime::START + slot * self.0
    }
}

/// Its slot within a slotframe of so many.
impl Rem<u64> for Asn {
    type Output = u64;

    fn rem(self, slotframe_slots: u64) -> u64 {
        self.0 % slotframe_slots
    }
}

impl fmt::Display for Asn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}
