//! Deliveries of both media as one list.

use super::carried::Carried;
use super::copies::Copies;
use bytes::Bytes;
use physics::medium::resolve;
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use proto::types::{Deliveries, DeliveryColumn, EVERYONE, Heard, Medium, Payloads, Transmissions};

/// A delivery.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Delivery {
    /// Of the transmission.
    rank: u32,
    received: SimTime,
    medium: Medium,
    rssi_dbm: f32,
    hops: u32,
}

/// A transmission of either medium.
struct Sent {
    sender: MoteId,
    sent: SimTime,
    end: SimTime,
    destination: MoteId,
    payload: Bytes,
}

/// Deliveries of the main network, which states when each was received, and of the second medium. `copies`: of two copies the
/// receiver takes the first; given with the length of a control period.
pub(super) fn merged(
    main: Deliveries,
    carried: Carried,
    agent_count: usize,
    columns: &[DeliveryColumn],
    mut copies: Option<(&mut Copies, SimDuration)>,
) -> Deliveries {
    let n_main = main.transmissions.sender.len();
    let mut sent = of_main(&main.transmissions);
    let mut heard: Vec<(u32, Delivery)> = Vec::with_capacity(main.n_deliveries());
    for receiver in 0..agent_count {
        for index in main.heard_by(receiver) {
            let at = heard.len();
            let received = main.received_ns.get(at).copied().map(SimTime::from_ns);
            heard.push((
                receiver as u32,
                Delivery {
                    rank: index as u32,
                    received: received.unwrap_or(sent[index].end),
                    medium: Medium::Radio,
                    rssi_dbm: main.rssi_dbm.get(at).copied().unwrap_or_default(),
                    hops: main.hops.get(at).copied().unwrap_or(1),
                },
            ));
        }
    }
    for (index, frame) in (n_main as u32..).zip(carried.frames) {
        for &(receiver, rssi_dbm) in &frame.receivers {
            let received = frame.end;
            let (rank, medium, hops) = (index, Medium::Second, 1);
            heard.push((receiver, Delivery { rank, received, medium, rssi_dbm, hops }));
        }
        sent.push(Sent {
            sender: frame.sender,
            sent: frame.sent,
            end: frame.end,
            destination: MoteId(EVERYONE),
            payload: frame.payload,
        });
    }
    if sent.is_empty() {
        return Deliveries::default();
    }
    if let Some((copies, step)) = &mut copies {
        heard.sort_by_key(|&(receiver, delivery)| {
            (receiver, delivery.received, delivery.medium, delivery.rank)
        });
        heard.retain(|&(receiver, delivery)| {
            let sent = &sent[delivery.rank as usize];
            copies.is_first(MoteId(receiver), sent.sender, sent.sent / *step)
        });
    }
    // By (sent, sender); of equal ones, the main network's first.
    let mut order: Vec<u32> = (0..sent.len() as u32).collect();
    order.sort_by_key(|&place| (sent[place as usize].sent, sent[place as usize].sender));
    let mut rank = vec![0; order.len()];
    for (new, &old) in (0..).zip(&order) {
        rank[old as usize] = new;
    }
    for (_, delivery) in &mut heard {
        delivery.rank = rank[delivery.rank as usize];
    }
    heard.sort_by_key(|&(receiver, delivery)| (receiver, delivery.rank));
    let ordered: Vec<&Sent> = order.iter().map(|&place| &sent[place as usize]).collect();
    deliveries(&ordered, &heard, agent_count, columns)
}

fn of_main(transmissions: &Transmissions) -> Vec<Sent> {
    let mut begin = 0;
    let payloads = &transmissions.payloads;
    (0..transmissions.sender.len())
        .map(|index| {
            let end = begin + payloads.length_bytes()[index] as usize;
            let payload = payloads.data().slice(begin..end);
            begin = end;
            Sent {
                sender: MoteId(transmissions.sender[index]),
                sent: SimTime::from_ns(transmissions.sent_ns[index]),
                end: SimTime::from_ns(transmissions.end_ns[index]),
                destination: MoteId(
                    transmissions.destination.get(index).copied().unwrap_or(EVERYONE),
                ),
                payload,
            }
        })
        .collect()
}

fn deliveries(
    sent: &[&Sent],
    heard: &[(u32, Delivery)],
    agent_count: usize,
    columns: &[DeliveryColumn],
) -> Deliveries {
    let mut ends = Vec::with_capacity(agent_count);
    let mut indices = Vec::with_capacity(heard.len());
    for &(receiver, delivery) in heard {
        ends.resize(receiver as usize, indices.len() as u32);
        indices.push(delivery.rank);
    }
    ends.resize(agent_count, indices.len() as u32);
    let lengths = sent.iter().map(|sent| sent.payload.len() as u32).collect();
    let data: Vec<u8> = sent.iter().flat_map(|sent| sent.payload.iter().copied()).collect();
    let to_all = sent.iter().all(|sent| sent.destination == MoteId(EVERYONE));
    let wants = |column| columns.contains(&column);
    let each = || heard.iter().map(|(_, delivery)| delivery);
    Deliveries {
        transmissions: Transmissions {
            sender: sent.iter().map(|sent| sent.sender.0).collect(),
            sent_ns: sent.iter().map(|sent| sent.sent.ns()).collect(),
            end_ns: sent.iter().map(|sent| sent.end.ns()).collect(),
            payloads: Payloads::new(lengths, data.into())
                .expect("as much data as the lengths add up to"),
            destination: if to_all {
                Vec::new()
            } else {
                sent.iter().map(|sent| sent.destination.0).collect()
            },
        },
        received_ns: if wants(DeliveryColumn::ReceivedNs) {
            each().map(|delivery| delivery.received.ns()).collect()
        } else {
            Vec::new()
        },
        rssi_dbm: if wants(DeliveryColumn::RssiDbm) {
            each().map(|delivery| delivery.rssi_dbm).collect()
        } else {
            Vec::new()
        },
        hops: if wants(DeliveryColumn::Hops) {
            each().map(|delivery| delivery.hops).collect()
        } else {
            Vec::new()
        },
        // Where it is left out, it means radio.
        medium: each().map(|delivery| delivery.medium).collect(),
        heard: resolve::shorter(Heard::Lists { ends, indices }, agent_count, sent.len()),
    }
}
