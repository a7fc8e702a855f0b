//! Packets from end to end: where each is from, and what becomes of it.

use proto::ids::MoteId;
use proto::time::SimTime;
use proto::types::PacketPurpose;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A packet on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Packet {
    /// Its number, from 1, in the order of creation.
    pub id: u64,
    /// What it is for.
    pub kind: PacketPurpose,
    /// Number of the mote that made it.
    pub source: MoteId,
    /// Number of the mote that it is for.
    pub destination: MoteId,
    /// When it was made.
    pub created: SimTime,
    /// Its payload (bytes).
    pub bytes: u32,
    /// Hops to the proxies that have passed it on.
    pub hops_before: u32,
}

/// A packet that has come to an end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ended<R> {
    /// The packet that ended.
    pub packet: Packet,
    /// When.
    pub ended: SimTime,
    /// Hops it took: 0 if it was not delivered.
    pub hops: u32,
    /// Why it was lost; `None`: it was delivered.
    pub lost: Option<R>,
}

/// The account of packets from end to end: those on their way, and those that have ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Packets<R> {
    next_id: u64,
    on_their_way: BTreeMap<u64, Packet>,
    /// Those that have ended since they were last taken.
    ended: Vec<Ended<R>>,
    n_delivered: u64,
    n_lost: u64,
    /// Arrivals of packets that had ended before: second copies, or packets that were taken for lost.
    n_late: u64,
    /// By kind.
    n_created: [u64; PacketPurpose::ALL.len()],
    /// Numbers of the downloads that have begun, by application and mote: a mote has one of each.
    downloads: BTreeMap<(u32, u32), u64>,
}

impl<R> Default for Packets<R> {
    fn default() -> Self {
        let (on_their_way, ended) = (BTreeMap::new(), Vec::new());
        Self {
            next_id: 1,
            on_their_way,
            ended,
            n_delivered: 0,
            n_lost: 0,
            n_late: 0,
            n_created: [0; PacketPurpose::ALL.len()],
            downloads: BTreeMap::new(),
        }
    }
}

impl<R: Copy> Packets<R> {
    /// A packet sets out. Returns its number.
    pub fn begin(
        &mut self,
        kind: PacketPurpose,
        source: MoteId,
        destination: MoteId,
        created: SimTime,
        bytes: u32,
    ) -> u64 {
        let id = self.next_id;
        self.next_id += 1;
        self.n_created[kind as usize] += 1;
        let packet = Packet { id, kind, source, destination, created, bytes, hops_before: 0 };
        self.on_their_way.insert(id, packet);
        id
    }

    /// The download of an application by a mote, `destination`, sets out, unless it did before: whoever notes it first, there is
    /// one. Returns its number, and whether it is new.
    pub(crate) fn begin_download(
        &mut self,
        app: u32,
        source: MoteId,
        destination: MoteId,
        created: SimTime,
        bytes: u32,
    ) -> (u64, bool) {
        if let Some(&id) = self.downloads.get(&(app, destination.0)) {
            return (id, false);
        }
        let id = self.begin(PacketPurpose::Download, source, destination, created, bytes);
        self.downloads.insert((app, destination.0), id);
        (id, true)
    }

    /// A packet has arrived. `None`: it has ended before, or is none that is counted.
    pub fn deliver(&mut self, id: u64, now: SimTime, hops: u32) -> Option<Packet> {
        let Some(packet) = self.on_their_way.remove(&id) else {
            self.n_late += u64::from(id != 0);
            return None;
        };
        self.n_delivered += 1;
        let hops = packet.hops_before + hops;
        self.ended.push(Ended { packet, ended: now, hops, lost: None });
        Some(packet)
    }

    /// A packet has come to a proxy over some hops, which passes it on to `destination`.
    pub fn pass_on(&mut self, id: u64, destination: MoteId, hops: u32) {
        if let Some(packet) = self.on_their_way.get_mut(&id) {
            packet.destination = destination;
            packet.hops_before += hops;
        }
    }

    /// A packet is lost. One that has ended before stays as it ended.
    pub fn lose(&mut self, id: u64, now: SimTime, reason: R) {
        if let Some(packet) = self.on_their_way.remove(&id) {
            self.n_lost += 1;
            self.ended.push(Ended { packet, ended: now, hops: 0, lost: Some(reason) });
        }
    }

    /// Those that have ended since this was last asked.
    pub(crate) fn take_ended(&mut self) -> Vec<Ended<R>> {
        std::mem::take(&mut self.ended)
    }

    /// How many of a kind have set out.
    #[must_use]
    pub fn created(&self, kind: PacketPurpose) -> u64 {
        self.n_created[kind as usize]
    }

    /// Whether a packet has not ended. Those that are not counted never do.
    #[must_use]
    pub fn goes_on(&self, id: u64) -> bool {
        id == 0 || self.on_their_way.contains_key(&id)
    }

    /// Those that have not ended, by number.
    pub fn on_their_way(&self) -> impl Iterator<Item = &Packet> {
        self.on_their_way.values()
    }

    /// How often a packet has arrived that had ended before.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.n_late
    }

    /// Sent, delivered, lost, on their way: the first is the sum of the others.
    #[must_use]
    pub fn counts(&self) -> [u64; 4] {
        [self.next_id - 1, self.n_delivered, self.n_lost, self.on_their_way.len() as u64]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packet_ends_once_and_all_are_accounted_for() {
        let mut packets = Packets::default();
        let [a, b, c] = [1, 2, 3].map(|source| {
            packets.begin(
                PacketPurpose::Application,
                MoteId(source),
                MoteId(0),
                SimTime::from_ns(5),
                9,
            )
        });
        assert_eq!(packets.deliver(a, SimTime::from_ns(8), 2).unwrap().source, MoteId(1));
        assert!(packets.deliver(a, SimTime::from_ns(9), 2).is_none());
        packets.lose(a, SimTime::from_ns(9), 'x');
        assert_eq!((packets.late(), packets.on_their_way().count()), (1, 2));
        assert_eq!([0, a, b].map(|id| packets.goes_on(id)), [true, false, true]);
        packets.lose(b, SimTime::from_ns(9), 'y');
        assert_eq!(packets.counts(), [3, 1, 1, 1]);
        let ended = packets.take_ended();
        assert_eq!(
            ended.iter().map(|ended| (ended.packet.id, ended.lost)).collect::<Vec<_>>(),
            [(a, None), (b, Some('y'))]
        );
        packets.deliver(c, SimTime::from_ns(9), 1);
        assert_eq!(packets.counts(), [3, 2, 1, 0]);
    }

    #[test]
    fn a_mote_has_one_download_of_each_application() {
        let mut packets = Packets::<char>::default();
        let began = [(0, 3), (0, 4), (1, 3), (0, 3)].map(|(app, mote)| {
            packets.begin_download(app, MoteId(0), MoteId(mote), SimTime::from_ns(5), 9)
        });
        assert_eq!(began, [(1, true), (2, true), (3, true), (1, false)]);
        packets.lose(1, SimTime::from_ns(9), 'x');
        assert_eq!(
            packets.begin_download(0, MoteId(0), MoteId(3), SimTime::from_ns(10), 9),
            (1, false)
        );
        assert!(packets.deliver(1, SimTime::from_ns(11), 1).is_none());
        assert_eq!((packets.created(PacketPurpose::Download), packets.late()), (3, 1));
    }
}
