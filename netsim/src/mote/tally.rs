//! What is counted of a mote, from the beginning of the experiment.

use crate::energy::Usage;
use crate::lowpan::DropReason;
use crate::mac::kind::FrameKind;
use physics::asn::Asn;
use proto::time::SimTime;
use serde::{Deserialize, Serialize};

/// Counters of a mote.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// Uses of the radio. Idle listening, scanning and sleep are counted from the schedule: see
    /// [`Tally::usage_until`].
    pub usage: Usage,
    /// Frames sent, acknowledgments apart, by [`FrameKind`].
    pub sent: [Sent; FrameKind::N],
    /// Frames received, whether new or repeated.
    pub n_rx: u64,
    /// Those of them that were dropped because they were not secured by a key that the mote has.
    pub n_insecure: u64,
    /// Packets dropped because the queue was full.
    pub n_queue_drops: u64,
    /// Payloads of the swarm that a newer one replaced before they were sent.
    pub n_superseded: u64,
    /// Changes of the preferred parent, the first choice apart.
    pub n_parent_changes: u64,
    /// Packets that the mote's applications created.
    pub n_created: u64,
    /// How often the mote lost synchronisation.
    pub n_desynchronised: u64,
    /// When it was first synchronised.
    pub first_synced: Option<SimTime>,
    /// When it was first admitted.
    pub first_joined: Option<SimTime>,
    /// When it was first ready to send data.
    pub first_ready: Option<SimTime>,
    /// Since when it has been on (ASN), if it is.
    pub on_since_asn: Option<Asn>,
    /// Slots during which it was on before.
    pub n_slots_on: u64,
    /// Since when it has been scanning (ASN), if it is.
    pub scans_since_asn: Option<Asn>,
    /// Slots that the schedule gave to listening in which it sent or received instead.
    pub n_listening_used: u64,
    /// What became of the frames that layers gave to the MAC, whatever they carry.
    pub frames: Frames,
    /// Datagrams and parts of them that ended here before they were frames, by reason.
    pub datagrams_dropped: [u64; DropReason::N],
}

/// Transmissions of frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sent {
    /// All of them.
    pub n: u64,
    /// Those that asked for an acknowledgment.
    pub n_unicast: u64,
    /// Those of these that got it.
    pub n_acked: u64,
    /// Those that repeat a frame that was not acknowledged.
    pub n_repeated: u64,
}

impl Sent {
    /// Counts one. `acknowledged`: whether it was, if it asked for that.
    pub(crate) fn count(&mut self, acknowledged: Option<bool>, is_repeated: bool) {
        self.n += 1;
        self.n_unicast += u64::from(acknowledged.is_some());
        self.n_acked += u64::from(acknowledged == Some(true));
        self.n_repeated += u64::from(is_repeated);
    }
}

/// What became of the frames that layers gave to the MAC: all that it does not hold have ended in one of these ways.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Frames {
    /// Frames given to it; one that takes the place of another counts once. Beacons are none: the MAC makes them itself.
    pub n_given: u64,
    /// Sent: acknowledged, or for everyone.
    pub n_sent: u64,
    /// Ended without an acknowledgment, by reason.
    pub dropped: [u64; DropReason::N],
    /// Those of the dropped that had arrived all the same: their acknowledgments had not.
    pub n_arrived: u64,
}

impl Frames {
    /// How many ended without an acknowledgment.
    #[must_use]
    pub fn n_dropped(&self) -> u64 {
        self.dropped.iter().sum()
    }
}

impl Tally {
    /// Frames sent, of all kinds together.
    #[must_use]
    pub fn sent_in_all(&self) -> Sent {
        self.sent.iter().fold(Sent::default(), |sum, sent| Sent {
            n: sum.n + sent.n,
            n_unicast: sum.n_unicast + sent.n_unicast,
            n_acked: sum.n_acked + sent.n_acked,
            n_repeated: sum.n_repeated + sent.n_repeated,
        })
    }

    /// A frame ended without an acknowledgment. One in whose place comes a newer one for the same purpose does not end: the
    /// two are one.
    pub(super) fn drop_frame(&mut self, reason: DropReason, has_arrived: bool) {
        if reason == DropReason::Superseded {
            self.frames.n_given -= 1;
            return;
        }
        self.frames.dropped[reason.index()] += 1;
        self.frames.n_arrived += u64::from(has_arrived);
    }

    /// What ended at this mote for a reason: frames, and datagrams before they were any.
    #[must_use]
    pub fn dropped(&self, reason: DropReason) -> u64 {
        self.frames.dropped[reason.index()] + self.datagrams_dropped[reason.index()]
    }

    /// Is switched on in this slot.
    pub fn switch_on(&mut self, asn: Asn) {
        self.on_since_asn = Some(asn);
    }

    /// Is switched off: this slot is not counted any more.
    pub fn switch_off(&mut self, asn: Asn) {
        self.stop_scanning(asn);
        if let Some(since_asn) = self.on_since_asn.take() {
            self.n_slots_on += asn.saturating_since(since_asn);
        }
    }

    /// Scans from this slot on.
    pub(crate) fn start_scanning(&mut self, asn: Asn) {
        self.scans_since_asn = Some(asn);
    }

    /// Scans no more: this slot is not counted.
    pub(crate) fn stop_scanning(&mut self, asn: Asn) {
        if let Some(since_asn) = self.scans_since_asn.take() {
            self.usage.scan += asn.saturating_since(since_asn);
        }
    }

    /// All uses of the radio before slot `asn`. `n_listening`: slots that the schedule gave to listening.
    #[must_use]
    pub fn usage_until(&self, asn: Asn, n_listening: u64) -> Usage {
        let mut usage = self.usage;
        if let Some(since_asn) = self.scans_since_asn {
            usage.scan += asn.saturating_since(since_asn);
        }
        usage.idle_listen += n_listening.saturating_sub(self.n_listening_used);
        usage.sleep = self.slots_on(asn).saturating_sub(usage.active_slots());
        usage
    }

    /// Slots before `asn` during which it was on.
    #[must_use]
    pub fn slots_on(&self, asn: Asn) -> u64 {
        let now = self.on_since_asn.map_or(0, |since_asn| asn.saturating_since(since_asn));
        self.n_slots_on + now
    }
}
