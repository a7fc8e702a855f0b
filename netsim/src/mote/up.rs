//! From a received frame to the layer it is for.

use super::down::{Wanted, hops_of};
use super::{Brought, Mote, World};
use crate::app::ports::{APPLICATION_PORT, SWARM_PORT};
use crate::join::ports;
use crate::lowpan::{self, DropReason, LowpanAction, Step};
use crate::mac::queue::Queued;
use crate::mac::tsch::{Done, FrameHandling};
use crate::mac::{CellKind, CellRef};
use crate::rpl;
use crate::wire::Eui64;
use crate::wire::coap;
use crate::wire::datagram::{Datagram, UdpRepr, Upper};
use crate::wire::fragment::LowpanRepr;
use crate::wire::frame::{Content, FrameRepr};
use proto::time::SimTime;
use std::sync::Arc;

/// A frame as it reached a mote.
#[derive(Clone, Copy, Debug)]
pub struct Arrived<'a> {
    /// The frame as received, addresses and contents.
    pub frame: &'a FrameRepr,
    /// The cell in which it was received; `None`: while scanning, or after a pending bit.
    pub at: Option<CellRef>,
    /// IEEE 802.15.4 channel on which it came.
    pub channel: u8,
    /// How far the sender's clock is off (ns).
    pub source_ns: i64,
    /// Its strength (dBm).
    pub rssi_dbm: f64,
}

impl Mote {
    /// A frame was received. Returns whether it is acknowledged, and whether it was new.
    pub fn handle_frame(&mut self, world: &mut World<'_>, arrived: &Arrived<'_>) -> FrameHandling {
        let frame = arrived.frame;
        let from = frame.source;
        let is_beacon = matches!(frame.content, Content::Beacon(_));
        let sequence = (!is_beacon).then_some(frame.sequence);
        if self.mac.is_scanning() {
            if world.settings.compat.eb_rule {
                self.mac.hear(from, sequence, world.asn);
            }
            if let Content::Beacon(beacon) = &frame.content {
                let config = &world.settings.mac;
                self.wants_sync =
                    self.mac.handle_beacon(config, from, beacon.join_metric, world.now);
            }
            return FrameHandling { acknowledge: false, deliver: false };
        }
        if self.sf.quarantine_ends(from).is_some() {
            return FrameHandling { acknowledge: false, deliver: false };
        }
        let verdict = self.mac.handle_frame(
            &world.settings.mac,
            from,
            frame.destination,
            sequence,
            world.asn,
            arrived.source_ns,
        );
        if !verdict.acknowledge && frame.destination.is_some() {
            return verdict;
        }
        if let Some(at) = &arrived.at {
            self.schedule.count_rx(at);
            let dscp = frame.content.dscp();
            self.with_sf(world, |sf, cx| sf.handle_received(cx, at, from, dscp));
            self.handle_announcement(world, at, frame);
        }
        if let (true, Some(blacklist)) = (verdict.acknowledge, frame.blacklist) {
            self.mac.receive_blacklist(from, blacklist);
        }
        if verdict.acknowledge && frame.pending {
            self.mac.follow(world.asn, arrived.channel);
        }
        if verdict.deliver {
            match &frame.content {
                Content::KeepAlive if frame.destination.is_some() => {
                    let is_for_all = |at: &CellRef| at.cell.kind != CellKind::Normal;
                    if arrived.at.as_ref().is_some_and(is_for_all) {
                        self.mac.handle_keep_alive(&world.settings.mac, world.now);
                    }
                }
                Content::KeepAlive => {}
                Content::Beacon(beacon) => {
                    let metric = beacon.join_metric;
                    if world.settings.mobility.time_from_beacons
                        && self.mac.time_source() != Some(from)
                        && self.rpl.is_nearer(metric)
                    {
                        let (config, source_ns) = (&world.settings.mac, arrived.source_ns);
                        self.mac.take_time_beside(config, from, source_ns, world.now);
                    }
                    let (now, dice) = (world.now, &mut self.dice.routing);
                    if !self.rpl.handle_rank(from, metric, arrived.rssi_dbm, now, dice) {
                        self.rpl.handle_beacon(from, metric, now, dice);
                    }
                    self.with_sf(world, |sf, cx| sf.handle_beacon(cx, from, beacon.join_metric));
                }
                Content::Sixp(message) => self.sixtop.handle_message(from, message, world.now),
                Content::Lowpan(part) => {
                    let outcome = self.lowpan.handle(from, part, world.now);
                    self.handle_outcome(world, from, part, outcome);
                }
            }
        }
        verdict
    }

    /// As [`Mote::handle_frame`], and all that follows from it. Returns whether timers may be due sooner or cells may have
    /// changed: most beacons change neither, and leave nothing to pass on.
    pub(crate) fn take_in(
        &mut self,
        world: &mut World<'_>,
        arrived: &Arrived<'_>,
    ) -> (FrameHandling, bool) {
        let is_beacon = matches!(arrived.frame.content, Content::Beacon(_));
        if !is_beacon || self.mac.is_scanning() || self.sf.heeds_beacons() {
            let verdict = self.handle_frame(world, arrived);
            self.pump(world);
            return (verdict, true);
        }
        let timers = |mote: &Self, world: &World<'_>| {
            (mote.mac.poll_timeout(&world.settings.mac), mote.rpl.poll_timeout())
        };
        let before = timers(self, world);
        let verdict = self.handle_frame(world, arrived);
        let after = timers(self, world);
        let is_sooner = |(before, after): (Option<SimTime>, Option<SimTime>)| {
            after.is_some_and(|after| before.is_none_or(|before| after < before))
        };
        let has_news = self.rpl.has_news();
        if has_news {
            self.pump(world);
        }
        (verdict, has_news || is_sooner((before.0, after.0)) || is_sooner((before.1, after.1)))
    }

    fn handle_outcome(
        &mut self,
        world: &mut World<'_>,
        from: Eui64,
        part: &LowpanRepr,
        outcome: LowpanAction,
    ) {
        match outcome {
            LowpanAction::Wait => {}
            LowpanAction::Drop { reason: DropReason::Duplicate, .. } => {}
            LowpanAction::Drop { packet, reason } => self.lose(world, packet, reason),
            LowpanAction::Forward { next_hop, part } => {
                let packet = part.datagram().packet;
                self.send_part(world, part, Some(next_hop), packet);
            }
            LowpanAction::Deliver(datagram) => match lowpan::step(&datagram, self.address) {
                Ok(Step::Here) => {
                    self.note_way(world, from, &datagram);
                    self.handle_upper(world, from, &datagram);
                }
                Ok(Step::Onward(onward)) => {
                    if let Some((onward, next_hop)) = self.onward(world, from, onward) {
                        self.send_to(world, onward, Some(next_hop));
                    }
                }
                Err(reason) => self.lose(world, datagram.packet, reason),
            },
            LowpanAction::Route(onward) if self.tunnels(&onward) => {
                let outcome = self.lowpan.reassemble(from, part, world.now);
                self.handle_outcome(world, from, part, outcome);
            }
            LowpanAction::Route(onward) => {
                if let Some((onward, next_hop)) = self.onward(world, from, *onward) {
                    let onward = Arc::new(onward);
                    let outcome = self.lowpan.forward(from, part, onward, next_hop, world.now);
                    self.handle_outcome(world, from, part, outcome);
                }
            }
        }
    }

    /// A datagram has come to its end: routing learns from its packet information who routes through this mote. A datagram
    /// that went the wrong way has arrived all the same.
    fn note_way(&mut self, world: &World<'_>, from: Eui64, datagram: &Datagram) {
        if let Some(mut rpi) = datagram.rpi {
            let routed = datagram.route.is_some();
            let dice = &mut self.dice.routing;
            self.rpl.handle_data(&mut rpi, from, datagram.destination, routed, world.now, dice);
        }
    }

    /// Where a datagram goes on that is not for this mote, and with which headers; `None`: it ends here.
    fn onward(
        &mut self,
        world: &mut World<'_>,
        from: Eui64,
        mut datagram: Datagram,
    ) -> Option<(Datagram, Eui64)> {
        if let Some(mut rpi) = datagram.rpi {
            let routed = datagram.route.is_some();
            let verdict = self.rpl.handle_data(
                &mut rpi,
                from,
                datagram.destination,
                routed,
                world.now,
                &mut self.dice.routing,
            );
            datagram.rpi = Some(rpi);
            match verdict {
                rpl::ForwardingDecision::Forward => {}
                rpl::ForwardingDecision::Return(back) => return Some((datagram, back)),
                rpl::ForwardingDecision::Drop(reason) => {
                    let reason = match reason {
                        rpl::DropReason::RankError => DropReason::RankError,
                        rpl::DropReason::ForwardingError => DropReason::ForwardingError,
                        rpl::DropReason::NotInDodag => DropReason::NoRoute,
                    };
                    self.lose(world, datagram.packet, reason);
                    return None;
                }
            }
        }
        let next_hop = self.next_hop(&mut datagram);
        if next_hop.is_none() {
            self.lose(world, datagram.packet, DropReason::NoRoute);
        }
        next_hop.map(|next_hop| (datagram, next_hop))
    }

    fn handle_upper(&mut self, world: &mut World<'_>, from: Eui64, datagram: &Datagram) {
        match &datagram.upper {
            Upper::Rpl(message) => {
                let multicast = datagram.destination.is_multicast();
                self.rpl.handle_message(
                    from,
                    datagram.source,
                    multicast,
                    message,
                    world.now,
                    &mut self.dice.routing,
                );
            }
            Upper::Udp(udp) => self.handle_udp(world, datagram, udp),
        }
    }

    fn handle_udp(&mut self, world: &mut World<'_>, datagram: &Datagram, udp: &UdpRepr) {
        match udp.destination_port {
            APPLICATION_PORT | SWARM_PORT => {
                let hops = hops_of(datagram);
                let delivered = world.packets.deliver(datagram.packet, world.received, hops);
                if let Some(packet) = delivered
                    && udp.destination_port == SWARM_PORT
                {
                    world.swarm.push(Brought {
                        receiver: self.id,
                        sender: packet.source,
                        sent: packet.created,
                        hops,
                        rssi_dbm: 0.0,
                        payload: udp.payload.clone(),
                    });
                }
            }
            ports::COAP if coap::is_application(&udp.payload) => {
                self.handle_coap(world, datagram, udp);
            }
            ports::COAP => self.handle_join(world, datagram, udp),
            _ => {}
        }
    }

    /// What became of a transmission of ours.
    pub fn handle_done(
        &mut self,
        world: &mut World<'_>,
        at: Option<CellRef>,
        done: Done,
        acknowledged: bool,
    ) {
        let is_unicast = !matches!(done, Done::Broadcast(_));
        if let Some(at) = &at {
            self.schedule.count_tx(at, acknowledged);
            let verdict = is_unicast.then_some(acknowledged);
            let dscp = match &done {
                Done::Broadcast(None) => 0,
                Done::Broadcast(Some(of)) | Done::Acknowledged(of) | Done::GivenUp(of) => {
                    of.frame.content.dscp()
                }
                Done::Retry { dscp, .. } => *dscp,
            };
            self.with_sf(world, |sf, cx| sf.handle_transmitted(cx, at, verdict, dscp));
        }
        match done {
            Done::Broadcast(of) => self.tally.frames.n_sent += u64::from(of.is_some()),
            Done::Acknowledged(frame) => self.sent(world, at, frame, true),
            Done::Retry { destination, .. } => self.count_link(world, at, destination, false),
            Done::GivenUp(frame) => self.sent(world, at, frame, false),
        }
        for frame in self.mac.take_outrun() {
            self.discard(world, frame, DropReason::SequenceReused);
        }
    }

    /// Routing learns of a transmission. The 6TiSCH simulator counts none in cells that are for everyone.
    fn count_link(
        &mut self,
        world: &World<'_>,
        at: Option<CellRef>,
        to: Eui64,
        acknowledged: bool,
    ) {
        let is_for_all = at.is_some_and(|at| at.cell.neighbour.is_none());
        // A collision in a shared cell says nothing of the link; where few failures end one, they must not.
        let may_collide = !acknowledged
            && world.settings.rpl.handover.is_some()
            && at.is_some_and(|at| at.cell.options.shared);
        let is_ignored = may_collide || (world.settings.compat.stale_rank && is_for_all);
        if !is_ignored {
            self.rpl.handle_link(to, 1, acknowledged, world.now, &mut self.dice.routing);
        }
    }

    fn sent(
        &mut self,
        world: &mut World<'_>,
        at: Option<CellRef>,
        frame: Queued,
        acknowledged: bool,
    ) {
        let Some(neighbour) = frame.destination() else { return };
        self.count_link(world, at, neighbour, acknowledged);
        if let Content::Sixp(message) = &frame.frame.content {
            self.sixtop.handle_sent(neighbour, message, acknowledged, world.now);
        }
        if !acknowledged && world.settings.mobility.reroute && self.rpl.parent() == Some(neighbour)
        {
            // It does not answer at all: another parent is looked for at once.
            self.rpl.handle_unusable(neighbour, world.now, &mut self.dice.routing);
        }
        match (acknowledged, frame.has_arrived) {
            (false, _) if self.reroute_failed(world, &frame) => {
                self.tally.drop_frame(DropReason::Withdrawn, false);
            }
            (false, _) => self.lose_frame(world, &frame, DropReason::MaxRetries),
            // Taken for another: it was acknowledged, and what it carried is gone.
            (true, false) => {
                self.tally.frames.n_sent += 1;
                world.packets.lose(frame.packet, world.now, DropReason::SequenceReused);
            }
            (true, true) => self.tally.frames.n_sent += 1,
        }
        self.left_queue(world, neighbour);
    }

    /// A keep-alive for the time source.
    pub(super) fn keep_alive(&mut self, world: &mut World<'_>, source: Eui64) {
        self.enqueue(world, Wanted::new(Some(source), Content::KeepAlive));
    }
}
