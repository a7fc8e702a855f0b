//! Motes on a line, each with a queue from which one frame per slotframe goes to its next hop. No MAC.

use super::*;
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use std::collections::VecDeque;

pub(super) fn mote(n: u32) -> Eui64 {
    Eui64::of_mote(MoteId(n))
}

/// From one mote to another, without a route.
pub(super) fn datagram(from: u32, to: u32, packet: u64, payload: usize) -> Datagram {
    let payload: Vec<u8> = (0..payload).map(|i| i as u8).collect();
    Datagram {
        packet,
        source: mote(from).global(),
        destination: mote(to).global(),
        dscp: 0,
        hop_limit: 64,
        rpi: None,
        route: None,
        upper: Upper::Udp(UdpRepr {
            source_port: 0xf0b0,
            destination_port: 0xf0b0,
            payload: payload.into(),
        }),
    }
}

/// From the root down to a mote, over all in between.
pub(super) fn down(to: u32, packet: u64, payload: usize) -> Datagram {
    let hops = (1..=to).map(|hop| mote(hop).global()).collect();
    let route = SourceRoute { root: mote(0).global(), hops, tunnel_hop_limit: None };
    Datagram { route: Some(route), ..datagram(0, to, packet, payload) }
}

pub(super) struct Member {
    pub(super) lowpan: Lowpan,
    pub(super) queue: VecDeque<(u32, LowpanRepr)>,
    pub(super) delivered: Vec<Arc<Datagram>>,
    pub(super) lost: Vec<(u64, DropReason)>,
    pub(super) n_received: usize,
}

pub(super) struct Line {
    pub(super) motes: Vec<Member>,
    now: SimTime,
}

/// Up the line, or as the source route says.
fn next_hop(at: u32, datagram: &Datagram) -> u32 {
    let hop = datagram.route.as_ref().map(|route| route.hops[0]);
    hop.map_or(at.wrapping_sub(1), |hop| (0..9).find(|&n| mote(n).global() == hop).unwrap())
}

impl Line {
    pub(super) fn new(n: u32, config: Config) -> Self {
        let member = |n| Member {
            lowpan: lowpan(n, config),
            queue: VecDeque::new(),
            delivered: Vec::new(),
            lost: Vec::new(),
            n_received: 0,
        };
        Self { motes: (0..n).map(member).collect(), now: SimTime::START }
    }

    pub(super) fn send(&mut self, at: u32, datagram: Datagram) {
        let to = next_hop(at, &datagram);
        let member = &mut self.motes[at as usize];
        let parts = member.lowpan.send(Arc::new(datagram), Some(mote(to)), ROOM).unwrap();
        member.queue.extend(parts.map(|part| (to, part)));
    }

    /// Slotframes: every mote sends the first frame of its queue; `is_lost` says of each whether it is.
    pub(super) fn run(&mut self, n: usize, mut is_lost: impl FnMut(u32, &LowpanRepr) -> bool) {
        for _ in 0..n {
            self.now += SimDuration::from_ns(1_010_000_000);
            let sent: Vec<_> = (0..)
                .zip(&mut self.motes)
                .filter_map(|(from, member)| Some((from, member.queue.pop_front()?)))
                .collect();
            for (from, (to, part)) in sent {
                assert!(part.buffer_len(mote(from), Some(mote(to))) <= ROOM, "{part:?}");
                if !is_lost(from, &part) {
                    self.receive(from, to, &part);
                }
            }
        }
    }

    fn receive(&mut self, from: u32, at: u32, received: &LowpanRepr) {
        let now = self.now;
        let member = &mut self.motes[at as usize];
        member.n_received += 1;
        let mut outcome = member.lowpan.handle(mote(from), received, now);
        if let LowpanAction::Route(datagram) = outcome {
            let to = mote(next_hop(at, &datagram));
            outcome = member.lowpan.forward(mote(from), received, (*datagram).into(), to, now);
        }
        match outcome {
            LowpanAction::Wait | LowpanAction::Route(_) => {}
            LowpanAction::Drop { packet, reason } => member.lost.push((packet, reason)),
            LowpanAction::Forward { next_hop, part } => {
                let to = (0..9).find(|&n| mote(n) == next_hop).unwrap();
                member.queue.push_back((to, part));
            }
            LowpanAction::Deliver(datagram) => match step(&datagram, mote(at)) {
                Ok(Step::Here) => member.delivered.push(datagram),
                Ok(Step::Onward(datagram)) => self.send(at, datagram),
                Err(reason) => member.lost.push((datagram.packet, reason)),
            },
        }
    }

    /// Lets all times pass.
    pub(super) fn expire(&mut self) {
        for member in &mut self.motes {
            while let Some(due) = member.lowpan.poll_timeout() {
                let lost = member.lowpan.handle_timeout(due.max(self.now));
                member.lost.extend(lost);
            }
        }
    }

    /// Mote and packet.
    pub(super) fn delivered(&self) -> Vec<(u32, u64)> {
        let delivered_to = |(n, member): (u32, &Member)| -> Vec<_> {
            member.delivered.iter().map(|datagram| (n, datagram.packet)).collect()
        };
        (0..).zip(&self.motes).flat_map(delivered_to).collect()
    }

    pub(super) fn lost(&self) -> Vec<(u64, DropReason)> {
        self.motes.iter().flat_map(|member| member.lost.iter().copied()).collect()
    }
}
