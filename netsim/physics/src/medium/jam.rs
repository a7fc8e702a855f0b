//! Jamming: noise on a channel, everywhere or in a disc, for a time.

use serde::{Deserialize, Serialize};

/// Noise so strong that nothing is received in it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Jam {
    /// IEEE 802.15.4 channel, 11 to 26.
    pub channel: u8,
    /// From when (ns).
    pub from_ns: u64,
    /// Until when (ns), exclusively.
    pub until_ns: u64,
    /// Centre of the disc (m), in the plane.
    pub centre_m: [f64; 2],
    /// Its radius (m); 0: everywhere.
    pub radius_m: f64,
}

impl Jam {
    /// Whether it covers a place.
    #[must_use]
    pub fn covers(&self, [x, y, _]: [f64; 3]) -> bool {
        let (dx, dy) = (x - self.centre_m[0], y - self.centre_m[1]);
        self.radius_m == 0.0 || dx * dx + dy * dy <= self.radius_m * self.radius_m
    }
}

/// The jams that last or are to come.
///
/// # Model
///
/// Within a jam's channel, time and disc a receiver notices nothing: a frame that overlaps it, if only in part, is as if
/// it did not arrive. Where the sender stands does not matter.
///
/// # Validity
///
/// A disc with a sharp edge: no fading of the noise with distance, no neighbouring channels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Jams {
    list: Vec<Jam>,
}

impl Jams {
    /// Adds a jam, in force from its beginning to its end.
    pub fn add(&mut self, jam: Jam) {
        self.list.push(jam);
    }

    /// Forgets those that are over.
    pub fn forget_before(&mut self, now_ns: u64) {
        self.list.retain(|jam| now_ns < jam.until_ns);
    }

    /// Whether there are none.
    #[inline]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Whether a receiver at `position_m` notices nothing of a frame on `channel` from `from_ns` to `until_ns`.
    #[must_use]
    pub fn silence(&self, position_m: [f64; 3], channel: u8, from_ns: u64, until_ns: u64) -> bool {
        self.list.iter().any(|jam| {
            jam.channel == channel
                && jam.from_ns < until_ns
                && from_ns < jam.until_ns
                && jam.covers(position_m)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JAM: Jam =
        Jam { channel: 15, from_ns: 1000, until_ns: 2000, centre_m: [3.0, 4.0], radius_m: 5.0 };

    fn jams(jam: Jam) -> Jams {
        let mut jams = Jams::default();
        jams.add(jam);
        jams
    }

    #[test]
    fn a_jam_has_a_channel_a_time_and_a_place() {
        let jams = jams(JAM);
        assert!(jams.silence([0.0; 3], 15, 1500, 1600), "on the rim");
        assert!(jams.silence([3.0, 4.0, 100.0], 15, 1500, 1600), "a disc has no height");
        assert!(!jams.silence([-0.1, 0.0, 0.0], 15, 1500, 1600), "outside");
        assert!(!jams.silence([0.0; 3], 16, 1500, 1600), "another channel");
        assert!(jams.silence([0.0; 3], 15, 900, 1001), "its end is disturbed");
        assert!(jams.silence([0.0; 3], 15, 1999, 2500), "its begin is disturbed");
        assert!(!jams.silence([0.0; 3], 15, 900, 1000), "before");
        assert!(!jams.silence([0.0; 3], 15, 2000, 2500), "after");
    }

    #[test]
    fn a_jam_without_radius_is_everywhere() {
        let jams = jams(Jam { radius_m: 0.0, ..JAM });
        assert!(jams.silence([1e6, -1e6, 0.0], 15, 1500, 1600));
    }

    #[test]
    fn what_is_over_is_forgotten() {
        let mut jams = jams(JAM);
        jams.forget_before(1999);
        assert!(!jams.is_empty());
        jams.forget_before(2000);
        assert!(jams.is_empty());
    }
}
