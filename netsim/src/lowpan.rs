//! The 6LoWPAN layer: datagrams in one frame or several, put together again or forwarded in parts.
//!
//! | module | what |
//! |---|---|
//! | [`mod@drop`] | why packets end |
//! | [`headers`] | whether a datagram is for this mote or goes on |
//!
//! A datagram that fits a frame passes as it is. A larger one is cut (RFC 4944, § 5.3), and either put together at every hop
//! ([`Mode::PerHopReassembly`]), or forwarded part by part along the way that its first part has found
//! ([`Mode::FragmentForwarding`], RFC 8930). Parts are not repaired end to end (RFC 8931): if one is lost, so is the datagram.

mod buffer;
pub mod drop;
pub mod headers;
mod vrb;

pub use drop::DropReason;
pub use headers::{Step, step};

use crate::dice::Dice;
use crate::wire::Eui64;
use crate::wire::datagram::Datagram;
use crate::wire::fragment::{Fragment, LowpanRepr};
use buffer::{Added, Buffer};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use vrb::Entry;

/// What a mote does with datagrams that come in parts and are not for itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// It puts them together and cuts them again.
    PerHopReassembly,
    /// It forwards each part as it comes.
    #[default]
    FragmentForwarding,
}

/// Settings, the same for all motes. Defaults are those of the 6TiSCH simulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Config {
    /// What is done with parts.
    pub mode: Mode,
    /// Datagrams that are put together at the same time; a root has no limit.
    pub reassembly_buffers: u16,
    /// How long one may take. 60 s: RFC 4944, § 5.3.
    pub reassembly_timeout: SimDuration,
    /// Datagrams that are forwarded in parts at the same time; a root has no limit.
    pub vrb_entries: u16,
    /// How long the way of one is remembered.
    pub vrb_timeout: SimDuration,
    /// If a part is missing, the following ones are not forwarded.
    pub discard_after_missing: bool,
    /// The way is forgotten with the last part, not with time.
    pub discard_after_last: bool,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            mode: Mode::default(),
            reassembly_buffers: 1,
            reassembly_timeout: SimDuration::from_s(60),
            vrb_entries: 50,
            vrb_timeout: SimDuration::from_s(60),
            discard_after_missing: false,
            discard_after_last: false,
        }
    }
}

/// What a received part, or whole datagram, comes to.
#[derive(Clone, Debug, PartialEq)]
pub enum LowpanAction {
    /// A datagram is complete. [`step`] decides whether it is for this mote.
    Deliver(Arc<Datagram>),
    /// The first part of a datagram that goes on: with hop limit and source route as they are on the next hop. Routing finds
    /// that; then [`Lowpan::forward`], or [`Lowpan::reassemble`] where headers are added.
    Route(Box<Datagram>),
    /// A part to be sent to a neighbour.
    Forward {
        /// To whom.
        next_hop: Eui64,
        /// The part.
        part: LowpanRepr,
    },
    /// Other parts are missing.
    Wait,
    /// It ends here.
    Drop {
        /// Identity of the datagram, for records.
        packet: u64,
        /// Why.
        reason: DropReason,
    },
}

/// A datagram as it is sent: whole, or in parts.
#[derive(Clone, Debug)]
pub struct Parts {
    whole: Option<Arc<Datagram>>,
    parts: std::vec::IntoIter<Fragment>,
}

impl Iterator for Parts {
    type Item = LowpanRepr;

    fn next(&mut self) -> Option<LowpanRepr> {
        if let Some(datagram) = self.whole.take() {
            return Some(LowpanRepr::Whole(datagram));
        }
        let part = self.parts.next()?;
        Some(if part.offset == 0 { LowpanRepr::First(part) } else { LowpanRepr::Next(part) })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let n = usize::from(self.whole.is_some()) + self.parts.len();
        (n, Some(n))
    }
}

impl ExactSizeIterator for Parts {}

/// What a datagram of mote `own` is sent in, to `next_hop` or to everyone: whole if it fits the `room` (bytes) of a frame, otherwise
/// cut.
///
/// # Errors
///
/// It is too large for fragments, or its headers for a frame.
pub(crate) fn parts_of(
    datagram: Arc<Datagram>,
    tag: u16,
    own: Eui64,
    next_hop: Option<Eui64>,
    room: usize,
) -> Result<Parts, DropReason> {
    if datagram.compressed_len(own, next_hop) <= room {
        return Ok(Parts { whole: Some(datagram), parts: Vec::new().into_iter() });
    }
    let parts = datagram.fragment(tag, room).ok_or(DropReason::TooLarge)?;
    Ok(Parts { whole: None, parts: parts.into_iter() })
}

/// Tags are the sender's: a datagram in parts is known by both.
type Key = (Eui64, u16);

/// The 6LoWPAN layer of one mote.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lowpan {
    config: Config,
    own: Eui64,
    is_root: bool,
    /// Of the next datagram that is sent in parts. One count for all neighbours: unique for each of them.
    tag: u16,
    buffers: BTreeMap<Key, Buffer>,
    vrb: BTreeMap<Key, Entry>,
    /// No time of those in `buffers` and `vrb` is earlier.
    earliest: SimTime,
    /// Losses that the driver has not been notified of.
    lost: Vec<(u64, DropReason)>,
}

impl Lowpan {
    /// Nothing under way. Tags begin anywhere (RFC 4944, § 5.3: the first is not defined).
    #[must_use]
    pub fn new(config: Config, own: Eui64, is_root: bool, dice: &mut Dice) -> Self {
        Self {
            config,
            own,
            is_root,
            tag: dice.word() as u16,
            buffers: BTreeMap::new(),
            vrb: BTreeMap::new(),
            earliest: SimTime::NEVER,
            lost: Vec::new(),
        }
    }

    /// What is to be sent to `next_hop`, or to everyone, in frames with `room` bytes for it.
    ///
    /// # Errors
    ///
    /// It is too large for fragments, or its headers for a frame.
    pub fn send(
        &mut self,
        datagram: Arc<Datagram>,
        next_hop: Option<Eui64>,
        room: usize,
    ) -> Result<Parts, DropReason> {
        let parts = parts_of(datagram, self.tag, self.own, next_hop, room)?;
        if parts.whole.is_none() {
            self.tag = self.tag.wrapping_add(1);
        }
        Ok(parts)
    }

    /// Something has come from a neighbour.
    pub fn handle(&mut self, from: Eui64, received: &LowpanRepr, now: SimTime) -> LowpanAction {
        let part = match received {
            LowpanRepr::Whole(datagram) => return LowpanAction::Deliver(datagram.clone()),
            LowpanRepr::First(part) | LowpanRepr::Next(part) => part,
        };
        let key = (from, part.tag);
        let drop = |reason| LowpanAction::Drop { packet: part.datagram.packet, reason };
        let is_first = matches!(received, LowpanRepr::First(_));
        if !buffer::is_valid(part) || is_first != (part.offset == 0) {
            return drop(DropReason::Malformed);
        }
        self.expire(now);

        if let Some(entry) = self.vrb.get(&key) {
            match (entry.is_of(part), is_first) {
                (true, true) => return drop(DropReason::Duplicate),
                (true, false) => return self.pass_on(key, part),
                (false, false) => return drop(DropReason::NoVrbEntry),
                // The neighbour uses the tag anew: it was switched off in between.
                (false, true) => {
                    self.lost.push((entry.packet, DropReason::FragmentOverlap));
                    self.vrb.remove(&key);
                }
            }
        }
        let is_forwarding = self.config.mode == Mode::FragmentForwarding;
        if is_forwarding && !self.buffers.contains_key(&key) {
            if !is_first {
                return drop(DropReason::NoVrbEntry);
            }
            match step(&part.datagram, self.own) {
                Ok(Step::Here) => {}
                Ok(Step::Onward(datagram)) => return LowpanAction::Route(Box::new(datagram)),
                Err(reason) => return drop(reason),
            }
        }
        self.collect(key, part, now)
    }

    /// Forwards the first part of a datagram, which `from` has sent and for which [`Lowpan::handle`] asked for a route. The
    /// others will follow it to `next_hop`. `datagram`: its headers on the next hop.
    pub fn forward(
        &mut self,
        from: Eui64,
        received: &LowpanRepr,
        datagram: Arc<Datagram>,
        next_hop: Eui64,
        now: SimTime,
    ) -> LowpanAction {
        let packet = datagram.packet;
        let LowpanRepr::First(first) = received else {
            return LowpanAction::Drop { packet, reason: DropReason::Malformed };
        };
        if !self.is_root && usize::from(self.config.vrb_entries) <= self.vrb.len() {
            return LowpanAction::Drop { packet, reason: DropReason::VrbTableFull };
        }
        if self.tag == first.tag {
            // So that a capture distinguishes the hops.
            self.tag = self.tag.wrapping_add(1);
        }
        let tag = self.tag;
        self.tag = self.tag.wrapping_add(1);
        let until = now + self.config.vrb_timeout;
        self.earliest = self.earliest.min(until);
        self.vrb.insert((from, first.tag), Entry::new(first, next_hop, tag, until));
        let part = LowpanRepr::First(Fragment { tag, datagram, ..first.clone() });
        LowpanAction::Forward { next_hop, part }
    }

    /// Puts a datagram together of which the first part has come, and for which [`Lowpan::handle`] asked for a route: it
    /// goes on with more headers than it has come with, so that its parts would no longer fit their frames, nor their size
    /// and offsets the datagram (RFC 4944, § 5.3). It is delivered when it is complete.
    pub fn reassemble(&mut self, from: Eui64, received: &LowpanRepr, now: SimTime) -> LowpanAction {
        match received {
            LowpanRepr::Whole(datagram) => LowpanAction::Deliver(datagram.clone()),
            LowpanRepr::First(part) | LowpanRepr::Next(part) => {
                self.collect((from, part.tag), part, now)
            }
        }
    }

    /// When something is given up.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<SimTime> {
        if !self.lost.is_empty() {
            return Some(SimTime::START);
        }
        (!self.buffers.is_empty() || !self.vrb.is_empty()).then_some(self.earliest)
    }

    /// Gives up what has waited too long. Returns what is lost by it: identities of datagrams, and why.
    pub fn handle_timeout(&mut self, now: SimTime) -> Vec<(u64, DropReason)> {
        self.expire(now);
        std::mem::take(&mut self.lost)
    }

    /// Forgets everything under way (RFC 4944, § 5.3: when a mote leaves the network), for this reason. Returns what is lost
    /// by it.
    pub fn clear(&mut self, reason: DropReason) -> Vec<(u64, DropReason)> {
        let buffers = std::mem::take(&mut self.buffers);
        let vrb = std::mem::take(&mut self.vrb);
        let mut lost = std::mem::take(&mut self.lost);
        lost.extend(buffers.values().map(|buffer| (buffer.packet, reason)));
        let entries = vrb.values().filter(|entry| !entry.is_complete());
        lost.extend(entries.map(|entry| (entry.packet, reason)));
        self.earliest = SimTime::NEVER;
        lost
    }

    /// Identities of the datagrams that are being put together, or of which parts have passed and others have not.
    pub fn under_way(&self) -> impl Iterator<Item = u64> + '_ {
        let passing = self.vrb.values().filter(|entry| !entry.is_complete());
        let lost = self.lost.iter().map(|&(packet, _)| packet);
        let collected = self.buffers.values().map(|buffer| buffer.packet);
        collected.chain(passing.map(|entry| entry.packet)).chain(lost)
    }

    /// How many datagrams are being put together.
    #[must_use]
    pub fn n_buffers(&self) -> usize {
        self.buffers.len()
    }

    /// How many datagrams are being forwarded in parts, or were until recently.
    #[must_use]
    pub fn n_vrb_entries(&self) -> usize {
        self.vrb.len()
    }

    fn pass_on(&mut self, key: Key, part: &Fragment) -> LowpanAction {
        let packet = part.datagram.packet;
        let Some(entry) = self.vrb.get_mut(&key) else {
            return LowpanAction::Drop { packet, reason: DropReason::NoVrbEntry };
        };
        if self.config.discard_after_missing && entry.misses_before(part) {
            self.vrb.remove(&key);
            return LowpanAction::Drop { packet, reason: DropReason::MissingFragment };
        }
        let (next_hop, tag) = (entry.next_hop, entry.tag);
        if entry.pass(part) && self.config.discard_after_last {
            self.vrb.remove(&key);
        }
        let part = LowpanRepr::Next(Fragment { tag, ..part.clone() });
        LowpanAction::Forward { next_hop, part }
    }

    fn collect(&mut self, key: Key, part: &Fragment, now: SimTime) -> LowpanAction {
        let packet = part.datagram.packet;
        let until = now + self.config.reassembly_timeout;
        if !self.buffers.contains_key(&key) {
            if !self.is_root && usize::from(self.config.reassembly_buffers) <= self.buffers.len() {
                return LowpanAction::Drop { packet, reason: DropReason::ReassemblyBufferFull };
            }
            self.earliest = self.earliest.min(until);
        }
        let buffer = self.buffers.entry(key).or_insert_with(|| Buffer::new(part, until));
        let mut added = buffer.add(part);
        if added == Added::Conflict {
            // What is there is given up, and this part begins anew (RFC 4944, § 5.3).
            self.lost.push((buffer.packet, DropReason::FragmentOverlap));
            *buffer = Buffer::new(part, until);
            added = buffer.add(part);
        }
        match added {
            Added::Complete(datagram) => {
                self.buffers.remove(&key);
                LowpanAction::Deliver(datagram)
            }
            Added::Incomplete => LowpanAction::Wait,
            Added::Same => LowpanAction::Drop { packet, reason: DropReason::Duplicate },
            // A part is in no conflict with an empty buffer made for it.
            Added::Conflict => LowpanAction::Drop { packet, reason: DropReason::Malformed },
        }
    }

    fn expire(&mut self, now: SimTime) {
        if now < self.earliest {
            return;
        }
        let lost = &mut self.lost;
        self.buffers.retain(|_, buffer| {
            let stays = now < buffer.until;
            if !stays {
                lost.push((buffer.packet, DropReason::ReassemblyTimeout));
            }
            stays
        });
        self.vrb.retain(|_, entry| {
            let stays = now < entry.until;
            if !stays && !entry.is_complete() {
                lost.push((entry.packet, DropReason::ReassemblyTimeout));
            }
            stays
        });
        let buffers = self.buffers.values().map(|buffer| buffer.until);
        let entries = self.vrb.values().map(|entry| entry.until);
        self.earliest = buffers.chain(entries).min().unwrap_or(SimTime::NEVER);
    }
}

#[cfg(test)]
mod tests;
