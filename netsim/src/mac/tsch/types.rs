//! What goes into the MAC of a mote, and what comes out.

use crate::mac::blacklist;
use crate::mac::queue::Queued;
use crate::mac::schedule::CellRef;
use crate::wire::Eui64;
use physics::timing::Airtime;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

/// Settings of the MAC, the same for all motes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// Length of a slot.
    pub slot: SimDuration,
    /// Channels by absolute slot number and channel offset.
    pub hopping_sequence: Vec<u8>,
    /// How long frames are on the air.
    pub airtime: Airtime,
    /// How links blacklist channels; `None`: they do not.
    pub blacklist: Option<blacklist::Config>,
    /// Frames that may wait (macMaxQueue); `None`: any number.
    pub queue_capacity: Option<u16>,
    /// Attempts after the first (macMaxFrameRetries); `None`: any number.
    pub max_retries: Option<u16>,
    /// Least back-off exponent in shared cells (macMinBe).
    pub min_exponent: u8,
    /// Greatest back-off exponent in shared cells (macMaxBe).
    pub max_exponent: u8,
    /// Mean time between beacons of a mote, where few are in reach.
    pub beacon_period: SimDuration,
    /// Least mean time between the beacons of all motes in reach.
    pub beacon_spacing: SimDuration,
    /// Beacons as the 6TiSCH simulator sends them: in an idle advertising cell with this probability over 1 + n, n being
    /// the neighbours ever heard.
    pub beacon_probability: Option<f64>,
    /// Contention as in the 6TiSCH simulator: back-off begins anew with every frame, and a keep-alive comes too late for the
    /// slot in which it falls due, so that one whose period is a multiple of the slotframe misses the cell of the last one.
    pub contends_as_peer: bool,
    /// How long to wait for further beacons after the first (RFC 8180, § 6.2: MAX_EB_DELAY).
    pub beacon_wait: SimDuration,
    /// The same for a mote that has lost its time; no longer than `beacon_wait`.
    pub rejoin_wait: SimDuration,
    /// Beacons of so many neighbours end the wait (RFC 8180, § 6.2: NUM_NEIGHBOURS_TO_WAIT).
    pub neighbours_to_wait: u16,
    /// How long a scanning mote stays on a channel (slots).
    pub scan_dwell_slots: u32,
    /// A mote that has not heard its time source for so long sends a frame to it; 0: never.
    pub keep_alive: SimDuration,
    /// A mote that has not heard its time source for so long is no longer synchronised.
    pub desynchronise: SimDuration,
    /// The longest that a mote waits before it sends a frame to its time source, once it has learned how fast its clock
    /// is against that of the source; `None`: motes do not learn that.
    pub max_keep_alive: Option<SimDuration>,
    /// The longest that a mote without a time source keeps time by its own clock, as far as that is known to hold.
    pub max_free_run: SimDuration,
    /// Greatest rate error of a clock (ppm).
    pub max_drift_ppm: f64,
    /// Frequency of the crystal whose ticks clocks count (Hz).
    pub crystal_hz: u32,
    /// A frame announces that another for the same neighbour follows in the next slot.
    pub pending_bit: bool,
    /// It does so, too, where in the next slot all contend, or listen for everyone: in shared cells and a slotframe's background.
    pub bursts_beside_everyone: bool,
    /// A mote that has lost its time source scans on the channel that beacons have in each slot, as long as it knows which slot it
    /// is.
    pub scans_hopping: bool,
}

impl Config {
    /// How long after it was corrected a clock is less than half a slot off that of another mote.
    pub(super) fn knows_slot_for(&self) -> SimDuration {
        // Each of the two may be off by the greatest rate error. Without one they always agree.
        SimDuration::from_ns(
            (self.slot.ns() as f64 / 2.0 / (2.0 * self.max_drift_ppm * 1e-6)) as u64,
        )
    }

    /// After how long without its time source a mote asks for it that is lost `desynchronise` after it was heard. The
    /// ratio of the two is always the same.
    pub(super) fn keep_alive_within(&self, desynchronise: SimDuration) -> SimDuration {
        if desynchronise == self.desynchronise {
            return self.keep_alive;
        }
        scaled(desynchronise, self.keep_alive, self.desynchronise)
    }

    /// How long a mote that knows the rate of its clock does without its time source, where the clock certainly holds for
    /// `holds`: no shorter than one that does not know it, and no longer than is set.
    pub(super) fn desynchronise_within(&self, holds: Option<SimDuration>) -> SimDuration {
        let (Some(holds), Some(max)) = (holds, self.max_keep_alive) else {
            return self.desynchronise;
        };
        let longest = scaled(self.desynchronise, max, self.keep_alive);
        holds.min(longest).max(self.desynchronise)
    }

    /// How long a mote runs free that has no time source any more.
    pub(super) fn runs_free_for(&self, holds: Option<SimDuration>) -> SimDuration {
        holds.unwrap_or_default().min(self.max_free_run).max(self.desynchronise)
    }
}

fn scaled(value: SimDuration, by: SimDuration, over: SimDuration) -> SimDuration {
    let product = u128::from(value.ns()) * u128::from(by.ns());
    SimDuration::from_ns((product / u128::from(over.ns().max(1))) as u64)
}

/// Synchronisation of a mote.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// Its radio is off.
    Off,
    /// It listens for beacons, one channel after another.
    Scanning {
        /// Beacons heard: from whom, join metric.
        heard: Vec<(Eui64, u8)>,
        /// When to choose among them.
        decide: Option<SimTime>,
    },
    /// It keeps time.
    Synced {
        /// Whose time; `None`: its own, it is a root.
        source: Option<Eui64>,
        /// When it last heard from the source.
        heard: SimTime,
        /// When to consider a keep-alive.
        keep_alive: SimTime,
    },
}

/// What a mote sends in a slot.
#[derive(Clone, Debug, PartialEq)]
pub enum Outgoing {
    /// A beacon.
    Beacon,
    /// A frame from the queue.
    Frame(Queued),
}

/// A transmission in a slot: what is sent, in which cell, on which channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Transmission {
    /// In which cell; `None`: the slot after one with the pending bit.
    pub at: Option<CellRef>,
    /// IEEE 802.15.4 channel, after hopping.
    pub channel: u8,
    /// A beacon, or a frame from the queue.
    pub outgoing: Outgoing,
    /// Another frame for the same neighbour follows in the next slot.
    pub pending: bool,
}

/// How a mote listens in a slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Listening {
    /// In which cell; `None`: it scans, or the slot follows one with the pending bit.
    pub at: Option<CellRef>,
    /// IEEE 802.15.4 channel, after hopping.
    pub channel: u8,
    /// It does not keep time: it listens all the time.
    pub scans: bool,
    /// The cell is known to count no frames: it stands for slots without cells.
    pub is_background: bool,
    /// The schedule has the mote listen in this slot, if not always here.
    pub is_scheduled: bool,
}

impl Listening {
    /// A mote that keeps time, in a cell or, `None`, after a pending bit.
    #[must_use]
    pub fn synchronised(at: Option<CellRef>, channel: u8) -> Self {
        Self { at, channel, scans: false, is_background: false, is_scheduled: at.is_some() }
    }
}

/// What the MAC says to a frame that was received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameHandling {
    /// Whether the receiver acknowledges the frame.
    pub acknowledge: bool,
    /// It goes to the upper layers: it is for us, and new.
    pub deliver: bool,
}

/// What became of a transmission.
#[derive(Clone, Debug, PartialEq)]
pub enum Done {
    /// A beacon or a broadcast frame: nobody acknowledges.
    Broadcast(Option<Queued>),
    /// Acknowledged.
    Acknowledged(Queued),
    /// Not acknowledged: it will be sent again.
    Retry {
        /// For whom.
        destination: Eui64,
        /// Its class.
        dscp: u8,
    },
    /// Not acknowledged, and sent often enough.
    GivenUp(Queued),
}

/// What is due because time has passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Due {
    /// The wait for beacons is over: synchronise to this neighbour.
    Synchronise(Eui64),
    /// A keep-alive for the time source.
    KeepAlive(Eui64),
    /// The time source has not been heard for too long; the mote's own clock still holds.
    SourceLost(Eui64),
    /// The mote does not know the time any more.
    Desynchronised,
}
