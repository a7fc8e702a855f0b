//! The swarm's payloads that were on the air in a step, and who heard them.

use bytes::Bytes;
use physics::medium::resolve;
use proto::ids::MoteId;
use proto::time::SimTime;
use proto::types::{Deliveries, DeliveryColumn, EVERYONE, Heard, Medium, Payloads, Transmissions};

/// Transmissions of a step, and receptions of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Inbox {
    sent: Vec<Sent>,
    heard: Vec<HeardOne>,
    /// Room for sorting.
    places: Vec<u32>,
    sorted: Vec<HeardOne>,
}

/// A payload on the air.
#[derive(Clone, Debug, PartialEq)]
pub struct Sent {
    /// Number of the mote that sent it.
    pub sender: MoteId,
    /// When.
    pub sent: SimTime,
    /// When the slot of its first frame ended.
    pub end: SimTime,
    /// The payload as the robot gave it.
    pub payload: Bytes,
    /// For whom alone; `None`: everyone in reach.
    pub destination: Option<MoteId>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct HeardOne {
    receiver: MoteId,
    transmission: u32,
    received: SimTime,
    rssi_dbm: f32,
    hops: u32,
}

impl Inbox {
    /// Removes all payloads, sent and heard.
    pub(crate) fn clear(&mut self) {
        self.sent.clear();
        self.heard.clear();
    }

    /// A payload goes on the air. Returns its number, for [`Inbox::hear`].
    pub(crate) fn send(&mut self, sent: Sent) -> u32 {
        self.sent.push(sent);
        (self.sent.len() - 1) as u32
    }

    /// Somebody heard it.
    #[inline]
    pub(crate) fn hear(
        &mut self,
        receiver: MoteId,
        transmission: u32,
        received: SimTime,
        rssi_dbm: f32,
        hops: u32,
    ) {
        self.heard.push(HeardOne { receiver, transmission, received, rssi_dbm, hops });
    }

    /// Whether anybody heard anything.
    #[must_use]
    pub(crate) fn is_heard(&self) -> bool {
        !self.heard.is_empty()
    }

    /// All of it as deliveries, and an empty inbox.
    pub(crate) fn deliveries(
        &mut self,
        agent_count: usize,
        columns: &[DeliveryColumn],
    ) -> Deliveries {
        if self.sent.is_empty() {
            return Deliveries::default();
        }
        // By (sent, sender); of equal ones, in the order they were sent.
        let mut order: Vec<u32> = (0..self.sent.len() as u32).collect();
        let key = |&place: &u32| {
            let sent = &self.sent[place as usize];
            (sent.sent, sent.sender)
        };
        order.sort_by_key(key);
        let mut rank = vec![0; order.len()];
        for (new, &old) in (0..).zip(&order) {
            rank[old as usize] = new;
        }
        for heard in &mut self.heard {
            heard.transmission = rank[heard.transmission as usize];
        }
        self.sort(agent_count);
        let mut ends = Vec::with_capacity(agent_count);
        let mut indices = Vec::with_capacity(self.heard.len());
        for heard in &self.heard {
            ends.resize(heard.receiver.index(), indices.len() as u32);
            indices.push(heard.transmission);
        }
        ends.resize(agent_count, indices.len() as u32);
        let wants = |column| columns.contains(&column);
        let mut lengths = Vec::with_capacity(order.len());
        let mut data = Vec::new();
        for &place in &order {
            let payload = &self.sent[place as usize].payload;
            lengths.push(payload.len() as u32);
            data.extend_from_slice(payload);
        }
        let ordered = || order.iter().map(|&place| &self.sent[place as usize]);
        let deliveries = Deliveries {
            transmissions: Transmissions {
                sender: ordered().map(|sent| sent.sender.0).collect(),
                sent_ns: ordered().map(|sent| sent.sent.ns()).collect(),
                end_ns: ordered().map(|sent| sent.end.ns()).collect(),
                payloads: Payloads::new(lengths, data.into())
                    .expect("as much data as the lengths add up to"),
                destination: if self.sent.iter().all(|sent| sent.destination.is_none()) {
                    Vec::new()
                } else {
                    ordered().map(|sent| sent.destination.map_or(EVERYONE, |mote| mote.0)).collect()
                },
            },
            received_ns: if wants(DeliveryColumn::ReceivedNs) {
                self.heard.iter().map(|heard| heard.received.ns()).collect()
            } else {
                Vec::new()
            },
            rssi_dbm: if wants(DeliveryColumn::RssiDbm) {
                self.heard.iter().map(|heard| heard.rssi_dbm).collect()
            } else {
                Vec::new()
            },
            hops: if wants(DeliveryColumn::Hops) {
                self.heard.iter().map(|heard| heard.hops).collect()
            } else {
                Vec::new()
            },
            medium: if wants(DeliveryColumn::Medium) {
                vec![Medium::Radio; self.heard.len()]
            } else {
                Vec::new()
            },
            heard: resolve::shorter(Heard::Lists { ends, indices }, agent_count, order.len()),
        };
        self.clear();
        deliveries
    }

    /// By receiver, and of each receiver by transmission. Places are counted: nearly all come in the order of transmissions.
    fn sort(&mut self, agent_count: usize) {
        if !self.heard.is_sorted_by_key(|heard| heard.transmission) {
            self.heard.sort_by_key(|heard| heard.transmission);
        }
        self.places.clear();
        self.places.resize(agent_count, 0);
        for heard in &self.heard {
            self.places[heard.receiver.index()] += 1;
        }
        let mut before = 0;
        for place in &mut self.places {
            before += std::mem::replace(place, before);
        }
        self.sorted.clear();
        self.sorted.resize(self.heard.len(), HeardOne::default());
        for heard in &self.heard {
            let place = &mut self.places[heard.receiver.index()];
            self.sorted[*place as usize] = *heard;
            *place += 1;
        }
        std::mem::swap(&mut self.heard, &mut self.sorted);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::time::SimDuration;

    #[test]
    fn deliveries_are_in_order_of_time_and_sender_however_they_came() {
        let mut inbox = Inbox::default();
        let sent = |sender, sent| Sent {
            sender,
            sent,
            end: sent + SimDuration::from_ns(1),
            payload: vec![sender.0 as u8].into(),
            destination: (sender == MoteId(5)).then_some(MoteId(2)),
        };
        let late = inbox.send(sent(MoteId(3), SimTime::from_ns(20)));
        let early = inbox.send(sent(MoteId(5), SimTime::from_ns(10)));
        let first = inbox.send(sent(MoteId(1), SimTime::from_ns(10)));
        inbox.hear(MoteId(2), late, SimTime::from_ns(21), -50.0, 1);
        inbox.hear(MoteId(0), late, SimTime::from_ns(21), -60.0, 1);
        inbox.hear(MoteId(2), first, SimTime::from_ns(11), -70.0, 2);
        inbox.hear(MoteId(2), early, SimTime::from_ns(11), -80.0, 1);
        let columns = [DeliveryColumn::RssiDbm, DeliveryColumn::Hops];
        let deliveries = inbox.deliveries(4, &columns);
        assert_eq!(deliveries.transmissions.sender, [1, 5, 3]);
        assert_eq!(deliveries.transmissions.payloads.data()[..], [1, 5, 3]);
        let heard: Vec<Vec<usize>> =
            (0..4).map(|agent| deliveries.heard_by(agent).collect()).collect();
        assert_eq!(heard, [vec![2], vec![], vec![0, 1, 2], vec![]]);
        assert_eq!(deliveries.transmissions.destination, [EVERYONE, 2, EVERYONE]);
        assert_eq!(deliveries.rssi_dbm, [-60.0, -70.0, -80.0, -50.0]);
        assert_eq!(deliveries.hops, [1, 2, 1, 1]);
        assert!(!inbox.is_heard());
    }
}
