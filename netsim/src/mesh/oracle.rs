//! The central scheduler of `sf.kind = "oracle"`: a bound to hold protocols against.
//!
//! # Model
//!
//! * In each slot, datagrams are looked at by age. One goes a hop further if neither its mote nor the next one is taken by an older
//!   one; each transmission has a channel for itself, so that there are as many as channels are hopped over.
//! * Ways are the cheapest by expected transmissions, 1 / reception probability of each link, found anew in each control period from
//!   where everybody is then.
//! * Whether a frame arrives is decided as for all others, alone on its channel and with exact clocks. Who sent it knows. It is
//!   repeated without end, and a datagram for which there is no way waits until there is one.
//! * A frame is as long as one without headers of routing. Queues have no end.
//!
//! # Validity
//!
//! A bound of what schedules can deliver to within what its greedy choice loses: the best schedule would look ahead. More
//! transmissions at a time than channels would be possible far from each other. Effects on processors and clocks are left out.
//! Payloads of the swarm for everyone are not carried.

use super::network::Mesh;
use crate::app;
use crate::energy::SlotUse;
use crate::lowpan::DropReason;
use crate::mac::kind::FrameKind;
use crate::mac::tsch::channel_of;
use crate::mote::Brought;
use bytes::Bytes;
use physics::asn::Asn;
use physics::medium::links::Links;
use physics::medium::slot::{Listening, OnAir, Paths as _, Reception, Sent, Slot};
use physics::timing::Airtime;
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use proto::types::PacketPurpose;
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// By mote, what waits there: datagrams by the number of their packet, which is their age.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Waiting(Vec<BTreeMap<u64, Datagram>>);

/// A datagram on its way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Datagram {
    destination: MoteId,
    /// Lengths of its frames (PSDU, bytes).
    frame_bytes: Vec<u16>,
    /// How many of them have made the present hop.
    n_across: u16,
    /// How often the next one has failed.
    n_failed: u16,
    hops: u32,
    /// What it brings a robot, if it is for one.
    payload: Option<Bytes>,
}

impl Waiting {
    /// Nothing, for `n` motes.
    pub(super) fn new(n: usize) -> Self {
        Self(vec![BTreeMap::new(); n])
    }

    /// Whether it is of so many motes, and can go on.
    pub(crate) fn is_of(&self, n: usize) -> bool {
        let mut datagrams = self.0.iter().flat_map(BTreeMap::values);
        self.0.len() == n
            && datagrams.all(|datagram| {
                datagram.destination.index() < n
                    && usize::from(datagram.n_across) < datagram.frame_bytes.len()
            })
    }

    /// Whether something waits at a mote.
    pub(super) fn is_at(&self, mote: MoteId) -> bool {
        !self.0[mote.index()].is_empty()
    }
}

/// The cheapest ways of a control period.
#[derive(Debug, Default)]
pub(super) struct Ways {
    /// By mote: from whom it can receive, and at which cost; empty: not known yet.
    incoming: Vec<Vec<(MoteId, u64)>>,
    /// By destination: of each mote, the cost from there and the next hop.
    to: BTreeMap<MoteId, Vec<(u64, MoteId)>>,
}

/// Cost of one certain transmission: costs are whole numbers, so that sums do not depend on their order.
const CERTAIN: f64 = 1e6;
/// Cost where there is no way.
const NO_WAY: (u64, MoteId) = (u64::MAX, MoteId(u32::MAX));

impl Ways {
    /// Motes have moved, or come and gone.
    pub(super) fn forget(&mut self) {
        self.incoming.clear();
        self.to.clear();
    }

    /// Of each mote, what it costs from there to a destination, and the next hop.
    fn to(
        &mut self,
        links: &mut Links,
        n: u32,
        destination: MoteId,
        slot: Probe,
    ) -> &[(u64, MoteId)] {
        if self.incoming.is_empty() {
            self.incoming = incoming(links, n, slot);
        }
        let incoming = &self.incoming;
        self.to.entry(destination).or_insert_with(|| cheapest(incoming, destination))
    }
}

/// On which channel and when links are looked at.
#[derive(Clone, Copy, Debug)]
struct Probe {
    channel: u8,
    at: SimTime,
    airtime: Airtime,
}

/// Of each mote, from whom it receives, and how many transmissions that takes.
fn incoming(links: &mut Links, n: u32, at: Probe) -> Vec<Vec<(MoteId, u64)>> {
    let mut incoming = vec![Vec::new(); n as usize];
    let mut arrivals = Vec::new();
    for sender in MoteId::first(n as usize) {
        let receivers = links
            .neighbours(sender)
            .map_or_else(|| (0..n).map(MoteId).collect(), <[MoteId]>::to_vec);
        let end = at.at + SimDuration::from_ns(at.airtime.of(127).unsigned_abs());
        let sent = Sent { sender, channel: at.channel, sent_ns: at.at.ns(), end_ns: end.ns() };
        arrivals.clear();
        links.arrivals(sent, &receivers, &mut arrivals);
        for (receiver, arrival) in receivers.into_iter().zip(&arrivals) {
            if receiver != sender && 0.0 < arrival.reception_probability {
                let cost = libm::round(CERTAIN / arrival.reception_probability) as u64;
                incoming[receiver.index()].push((sender, cost));
            }
        }
    }
    incoming
}

/// Dijkstra's algorithm, from the destination against the links.
fn cheapest(incoming: &[Vec<(MoteId, u64)>], destination: MoteId) -> Vec<(u64, MoteId)> {
    let mut ways = vec![NO_WAY; incoming.len()];
    ways[destination.index()] = (0, destination);
    let mut heap = BinaryHeap::from([Reverse((0, destination))]);
    while let Some(Reverse((cost, mote))) = heap.pop() {
        if ways[mote.index()].0 < cost {
            continue;
        }
        for &(from, of_link) in &incoming[mote.index()] {
            let way = (cost.saturating_add(of_link), mote);
            if way < ways[from.index()] {
                ways[from.index()] = way;
                heap.push(Reverse((way.0, from)));
            }
        }
    }
    ways
}

/// A hop that is made in a slot.
#[derive(Clone, Copy, Debug)]
struct Hop {
    from: MoteId,
    to: MoteId,
    packet: u64,
    bytes: u16,
}

impl Mesh {
    /// A slot in which somebody has something to send.
    pub(super) fn oracle_slot(&mut self, asn: Asn) {
        let mut awake = std::mem::take(&mut self.scratch.awake);
        self.state.calendar.take(asn, &mut awake);
        for &mote in &awake {
            self.create_packets(mote, asn);
        }
        let hops = self.choose_hops(asn);
        self.make_hops(&hops, asn);
        awake.extend(hops.iter().map(|hop| hop.to));
        for &mote in &awake {
            self.reschedule(mote, asn + 1);
        }
        self.scratch.awake = awake;
        self.pass_on_payloads(asn);
        self.look_whether_formed(asn);
    }

    /// A datagram that a robot or somebody outside sends to one mote.
    pub(super) fn oracle_send(
        &mut self,
        mote: MoteId,
        destination: MoteId,
        payload: Bytes,
        packet: u64,
        asn: Asn,
    ) {
        let settings = &self.settings;
        let to = self.addresses.eui64(destination);
        let node = &mut self.state.motes[mote.index()];
        match node.frame_lengths(settings, to, payload.clone()) {
            Ok(frame_bytes) => {
                let (n_across, n_failed, hops) = (0, 0, 0);
                let payload = Some(payload);
                let datagram =
                    Datagram { destination, frame_bytes, n_across, n_failed, hops, payload };
                self.state.waiting.0[mote.index()].insert(packet, datagram);
            }
            Err(reason) => {
                node.tally.datagrams_dropped[reason.index()] += 1;
                self.state.packets.lose(packet, asn * self.config.slot, reason);
            }
        }
    }

    /// What a mote held is lost with it.
    pub(super) fn oracle_lose(&mut self, mote: MoteId, asn: Asn) {
        let now = asn * self.config.slot;
        for packet in std::mem::take(&mut self.state.waiting.0[mote.index()]).into_keys() {
            self.state.packets.lose(packet, now, DropReason::Killed);
        }
    }

    /// Packets of a mote's applications that are due.
    fn create_packets(&mut self, mote: MoteId, asn: Asn) {
        let now = asn * self.config.slot;
        let place = mote.index();
        for app in 0..self.state.motes[place].apps.len() {
            while self.state.motes[place].apps[app].poll_timeout().is_some_and(|at| at <= now) {
                let node = &mut self.state.motes[place];
                let mut context = app::Context {
                    now,
                    received: now,
                    dice: &mut node.dice.application,
                    packets: &mut self.state.packets,
                    reaches: &|_| true,
                };
                let Some(packet) = node.apps[app].handle_timeout(&mut context) else { continue };
                let destination = match packet.destination {
                    app::Destination::Mote(mote) => mote,
                    app::Destination::Root => self.nearest_root(mote, asn),
                };
                self.state.motes[place].tally.n_created += 1;
                let payload = packet.payload();
                let bytes = payload.len() as u32;
                let kind = PacketPurpose::Application;
                let id = self.state.packets.begin(kind, mote, destination, packet.created, bytes);
                self.oracle_send(mote, destination, payload, id, asn);
                if let Some(datagram) = self.state.waiting.0[place].get_mut(&id) {
                    datagram.payload = None;
                }
            }
        }
    }

    fn nearest_root(&mut self, mote: MoteId, asn: Asn) -> MoteId {
        let roots = self.settings.roots.clone();
        let of_roots = roots.into_iter().map(|root| (self.way(mote, root, asn).0, root));
        of_roots.min().expect("a network has a root").1
    }

    /// Cost of the way from a mote to another, and the next hop.
    fn way(&mut self, mote: MoteId, destination: MoteId, asn: Asn) -> (u64, MoteId) {
        let channel = self.config.hopping_sequence[0];
        let airtime = self.settings.mac.airtime;
        let at = Probe { channel, at: asn * self.config.slot, airtime };
        let n = self.experiment.agent_count as u32;
        self.ways.to(&mut self.links, n, destination, at)[mote.index()]
    }

    /// Who sends what to whom: the oldest first.
    fn choose_hops(&mut self, asn: Asn) -> Vec<Hop> {
        let stamp = asn + 1;
        let waiting = std::mem::take(&mut self.state.waiting);
        let mut seen = std::mem::take(&mut self.scratch.seen);
        let mut oldest: Vec<(u64, MoteId)> = (0..)
            .zip(&waiting.0)
            .filter_map(|(mote, queue)| Some((*queue.first_key_value()?.0, MoteId(mote))))
            .collect();
        oldest.sort_unstable();
        let mut hops = Vec::new();
        for (_, from) in oldest {
            if hops.len() == self.config.hopping_sequence.len() {
                break;
            }
            if seen[from.index()] == stamp {
                continue;
            }
            let mut tried = Vec::new();
            for (&packet, datagram) in &waiting.0[from.index()] {
                if tried.contains(&datagram.destination) {
                    continue;
                }
                tried.push(datagram.destination);
                let (cost, to) = self.way(from, datagram.destination, asn);
                if cost == u64::MAX || seen[to.index()] == stamp {
                    continue;
                }
                seen[from.index()] = stamp;
                seen[to.index()] = stamp;
                let bytes = datagram.frame_bytes[usize::from(datagram.n_across)];
                hops.push(Hop { from, to, packet, bytes });
                break;
            }
        }
        self.state.waiting = waiting;
        self.scratch.seen = seen;
        hops
    }

    /// Sends the frames, each on a channel for itself.
    fn make_hops(&mut self, hops: &[Hop], asn: Asn) {
        let channels: Vec<u8> =
            (0..).take(hops.len()).map(|at| channel_of(&self.settings.mac, asn, at)).collect();
        let on_air: Vec<OnAir> = hops
            .iter()
            .zip(&channels)
            .map(|(hop, &channel)| OnAir {
                sender: hop.from,
                channel,
                starts_ns: 0,
                psdu_bytes: hop.bytes,
            })
            .collect();
        let heard: Vec<Listening> = hops
            .iter()
            .zip(&channels)
            .map(|(hop, &channel)| Listening::synchronised(hop.to, channel, 0))
            .collect();
        let slot = Slot { asn, begins_ns: (asn * self.config.slot).ns() };
        let receptions = self.medium.resolve(&mut self.links, slot, &on_air, &heard).to_vec();
        for ((hop, on_air), reception) in hops.iter().zip(&on_air).zip(receptions) {
            let received = match reception {
                Reception::Received { rssi_dbm, .. } => Some(rssi_dbm),
                Reception::Idle | Reception::Lost { .. } => None,
            };
            self.count_hop(hop, received.is_some());
            if let Some(rssi_dbm) = received {
                self.note_heard(hop.to, hop.from, rssi_dbm);
                self.pass_on(
                    hop,
                    SimTime::from_ns(
                        slot.begins_ns
                            .saturating_add_signed(on_air.ends_ns(&self.settings.mac.airtime)),
                    ),
                    rssi_dbm,
                );
            }
        }
    }

    fn count_hop(&mut self, hop: &Hop, is_received: bool) {
        let Hop { from, to, packet, bytes } = *hop;
        let datagram = self.state.waiting.0[from.index()].get_mut(&packet);
        let n_failed = datagram.map_or(0, |datagram| {
            let before = datagram.n_failed;
            datagram.n_failed = if is_received { 0 } else { before.saturating_add(1) };
            before
        });
        let n_secured_acks = u64::from(is_received && self.settings.join.security.is_some());
        let tally = &mut self.state.motes[from.index()].tally;
        tally.usage.secured_acks_received += n_secured_acks;
        tally.sent[FrameKind::Data as usize].count(Some(is_received), n_failed != 0);
        tally.usage.count(SlotUse::TxUnicast { bytes, acked: is_received });
        let tally = &mut self.state.motes[to.index()].tally;
        tally.usage.secured_acks_sent += n_secured_acks;
        tally.n_rx += u64::from(is_received);
        tally.usage.count(if is_received {
            SlotUse::RxUnicast { bytes }
        } else {
            SlotUse::IdleListen
        });
    }

    /// A frame has arrived: with the last one of its datagram, that is where the frame is.
    fn pass_on(&mut self, hop: &Hop, received: SimTime, rssi_dbm: f64) {
        let queue = &mut self.state.waiting.0[hop.from.index()];
        let Some(datagram) = queue.get_mut(&hop.packet) else { return };
        datagram.n_across += 1;
        if usize::from(datagram.n_across) < datagram.frame_bytes.len() {
            return;
        }
        let Some(mut datagram) = queue.remove(&hop.packet) else { return };
        datagram.n_across = 0;
        datagram.hops += 1;
        if datagram.destination != hop.to {
            self.state.waiting.0[hop.to.index()].insert(hop.packet, datagram);
            return;
        }
        let delivered = self.state.packets.deliver(hop.packet, received, datagram.hops);
        if let (Some(packet), Some(payload)) = (delivered, datagram.payload) {
            self.scratch.swarm.push(Brought {
                receiver: hop.to,
                sender: packet.source,
                sent: packet.created,
                hops: datagram.hops,
                rssi_dbm: rssi_dbm as f32,
                payload,
            });
        }
    }
}
