//! From a datagram to frames in the queue.

use super::{Mote, World};
use crate::app;
use crate::app::ports::{APPLICATION_PORT, SWARM_PORT};
use crate::lowpan::DropReason;
use crate::mac::queue::{Priority, Queued, SWARM_HANDLE};
use crate::mote::settings::{PEER_FRAME_BYTES, Settings, Transport};
use crate::rpl::Route;
use crate::sf::Traffic;
use crate::wire::Eui64;
use crate::wire::address::ALL_NODES;
use crate::wire::datagram::{Datagram, UdpRepr, Upper};
use crate::wire::fragment::LowpanRepr;
use crate::wire::frame::{Content, FrameRepr, payload_room};
use crate::wire::security::FrameSecurity;
use bytes::Bytes;
use proto::time::SimDuration;
use proto::types::PacketPurpose;
use serde::{Deserialize, Serialize};
use std::net::Ipv6Addr;
use std::sync::Arc;

/// Hops a datagram may take.
pub(crate) const HOP_LIMIT: u8 = 64;

/// Hops that a datagram has taken where it arrives.
pub(super) fn hops_of(datagram: &Datagram) -> u32 {
    if datagram.source.is_unicast_link_local() {
        return 1;
    }
    let taken = |left: u8| u32::from(HOP_LIMIT.saturating_sub(left));
    let in_tunnel = datagram.route.as_ref().and_then(|route| route.tunnel_hop_limit);
    taken(datagram.hop_limit) + in_tunnel.map_or(0, taken) + 1
}

/// A frame that wants to be sent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Wanted {
    pub(super) destination: Option<Eui64>,
    pub(super) content: Content,
    pub(super) slotframe: Option<u8>,
    pub(super) is_latest_only: bool,
    pub(super) packet: u64,
}

impl Wanted {
    /// An ordinary frame that belongs to no packet.
    pub(super) fn new(destination: Option<Eui64>, content: Content) -> Self {
        Self { destination, content, slotframe: None, is_latest_only: false, packet: 0 }
    }
}

impl Mote {
    /// A datagram of this mote's own, from one of its addresses.
    pub(super) fn originate(
        &mut self,
        world: &mut World<'_>,
        destination: Ipv6Addr,
        upper: Upper,
        packet: u64,
    ) {
        let on_link = destination.is_multicast() || destination.is_unicast_link_local();
        let datagram = Datagram {
            packet,
            source: if on_link { self.address.link_local() } else { self.address.global() },
            destination,
            dscp: 0,
            hop_limit: HOP_LIMIT,
            rpi: None,
            route: None,
            upper,
        };
        self.send(world, datagram);
    }

    /// Sends a datagram on its way: one of our own, or one to be forwarded.
    pub(super) fn send(&mut self, world: &mut World<'_>, mut datagram: Datagram) {
        if datagram.destination.is_multicast() {
            return self.send_to(world, datagram, None);
        }
        match self.next_hop(&mut datagram) {
            Some(next_hop) => self.send_to(world, datagram, Some(next_hop)),
            None => self.lose(world, datagram.packet, DropReason::NoRoute),
        }
    }

    /// Whether a datagram gets a source route here, and with it the headers of a tunnel.
    pub(super) fn tunnels(&self, datagram: &Datagram) -> bool {
        let has_route = datagram.route.as_ref().is_some_and(|route| !route.hops.is_empty());
        !has_route && matches!(self.rpl.route(datagram.destination), Some(Route::Source { .. }))
    }

    /// The next hop of a datagram; what routing has to say in its headers is written into them.
    pub(super) fn next_hop(&self, datagram: &mut Datagram) -> Option<Eui64> {
        if let Some(hop) = datagram.route.as_ref().and_then(|route| route.hops.first()) {
            return Some(Eui64::of_ip(*hop));
        }
        let (next_hop, down) = match self.rpl.route(datagram.destination)? {
            Route::Neighbour(neighbour) => return Some(neighbour),
            Route::Up(parent) => (parent, false),
            Route::Down(child) => (child, true),
            Route::Source { first_hop, mut route } => {
                if route.root != datagram.source {
                    route.tunnel_hop_limit = Some(HOP_LIMIT);
                    // The outer headers begin here, and what they say of the way with them.
                    datagram.rpi = None;
                }
                datagram.route = Some(route);
                (first_hop, true)
            }
        };
        if datagram.rpi.is_none() {
            datagram.rpi = self.rpl.rpi(down);
        }
        Some(next_hop)
    }

    /// Sends a datagram to a neighbour, or to everyone: in one frame, or in parts.
    pub(super) fn send_to(
        &mut self,
        world: &mut World<'_>,
        datagram: Datagram,
        next_hop: Option<Eui64>,
    ) {
        let packet = datagram.packet;
        let security = self.datagram_security(world.settings, &datagram);
        let room = world.settings.room(&datagram, next_hop, security);
        match self.lowpan.send(Arc::new(datagram), next_hop, room) {
            Ok(parts) => {
                for part in parts {
                    self.send_part(world, part, next_hop, packet);
                }
            }
            Err(reason) => self.lose(world, packet, reason),
        }
    }

    /// Sends a datagram that fits a frame, or a part of one.
    pub(super) fn send_part(
        &mut self,
        world: &mut World<'_>,
        part: LowpanRepr,
        next_hop: Option<Eui64>,
        packet: u64,
    ) {
        let content = Content::Lowpan(part);
        let wanted = Wanted { packet, ..Wanted::new(next_hop, content) };
        let works = world.settings.burden(self.id).processing;
        if next_hop.is_none() || works == SimDuration::ZERO {
            self.enqueue(world, wanted);
        } else {
            let begins = world.effective_asn * world.settings.mac.slot;
            self.in_work.push_back((begins + works, wanted));
        }
    }

    /// What the processor has finished by now goes into the queue.
    pub(super) fn finish_work(&mut self, world: &mut World<'_>) {
        while self.in_work.front().is_some_and(|(at, _)| *at <= world.now) {
            if let Some((_, wanted)) = self.in_work.pop_front() {
                self.enqueue(world, wanted);
            }
        }
    }

    /// A packet of an application.
    pub(super) fn send_application(&mut self, world: &mut World<'_>, packet: &app::Packet) {
        let to = match packet.destination {
            app::Destination::Root => self.rpl.dodag_id().map(Eui64::of_ip),
            app::Destination::Mote(mote) => Some(world.addresses.eui64(mote)),
        };
        let Some(to) = to else { return };
        let Some(mote) = world.addresses.mote(to) else { return };
        self.tally.n_created += 1;
        let udp = packet.udp();
        let bytes = udp.payload.len() as u32;
        let kind = PacketPurpose::Application;
        let id = world.packets.begin(kind, self.id, mote, packet.created, bytes);
        self.originate(world, to.global(), Upper::Udp(udp), id);
    }

    /// Lengths of the frames (PSDU, bytes) that carry a payload to a neighbour, without headers of routing.
    ///
    /// # Errors
    /// The datagram is too long.
    pub(crate) fn frame_lengths(
        &mut self,
        settings: &Settings,
        to: Eui64,
        payload: Bytes,
    ) -> Result<Vec<u16>, DropReason> {
        let ports = APPLICATION_PORT;
        let upper = Upper::Udp(UdpRepr { source_port: ports, destination_port: ports, payload });
        let datagram = Datagram {
            packet: 0,
            source: self.address.global(),
            destination: to.global(),
            dscp: 0,
            hop_limit: HOP_LIMIT,
            rpi: None,
            route: None,
            upper,
        };
        let security = self.datagram_security(settings, &datagram);
        let room = settings.room(&datagram, Some(to), security);
        let parts = self.lowpan.send(Arc::new(datagram), Some(to), room)?;
        let length = |part| {
            settings.psdu_bytes(&FrameRepr {
                source: self.address,
                destination: Some(to),
                sequence: 0,
                ack_request: true,
                pending: false,
                security,
                slots: None,
                blacklist: None,
                content: Content::Lowpan(part),
            })
        };
        Ok(parts.into_iter().map(length).collect())
    }

    /// A payload of the swarm: to everyone in reach in the cells that its transport has, or to one mote.
    pub fn say(
        &mut self,
        world: &mut World<'_>,
        destination: Ipv6Addr,
        payload: Bytes,
        packet: u64,
    ) {
        let upper =
            Upper::Udp(UdpRepr { source_port: SWARM_PORT, destination_port: SWARM_PORT, payload });
        if !destination.is_multicast() {
            return self.originate(world, destination, upper, packet);
        }
        let datagram = self.on_link(destination, upper, packet);
        let slotframe = match world.settings.transport {
            Transport::BroadcastSlotframe { .. } => Some(SWARM_HANDLE),
            Transport::None
            | Transport::OwnCell
            | Transport::SharedCell
            | Transport::UnicastNeighbours => self.sf.slotframe_of(Traffic::Payload),
        };
        let content = Content::Lowpan(LowpanRepr::Whole(Arc::new(datagram)));
        let wanted = Wanted { slotframe, is_latest_only: true, ..Wanted::new(None, content) };
        self.enqueue(world, wanted);
    }

    /// A datagram to all neighbours.
    fn on_link(&self, destination: Ipv6Addr, upper: Upper, packet: u64) -> Datagram {
        Datagram {
            packet,
            source: self.address.link_local(),
            destination,
            dscp: 0,
            hop_limit: HOP_LIMIT,
            rpi: None,
            route: None,
            upper,
        }
    }

    /// The longest payload (bytes) that one frame to all neighbours has room for.
    #[must_use]
    pub(crate) fn broadcast_room(&self, settings: &Settings) -> usize {
        if settings.compat.no_frame_overhead {
            return PEER_FRAME_BYTES;
        }
        let (source_port, destination_port) = (SWARM_PORT, SWARM_PORT);
        let upper = Upper::Udp(UdpRepr { source_port, destination_port, payload: Bytes::new() });
        let datagram = self.on_link(ALL_NODES, upper, 0);
        let security =
            if settings.is_secured() { FrameSecurity::K2 } else { FrameSecurity::Unsecured };
        let headers = datagram.compressed_len(self.address, None);
        payload_room(None, security).saturating_sub(headers)
    }

    /// Puts a frame into the queue. A control message that waits there is not queued again: routing and pledges repeat
    /// theirs because an answer is late, not lost.
    pub(super) fn enqueue(&mut self, world: &mut World<'_>, wanted: Wanted) {
        let Wanted { destination, content, slotframe, is_latest_only, packet } = wanted;
        let priority = Priority::of(&content, is_latest_only);
        let has_two = world.settings.compat.shared_slot_0;
        let may_repeat = has_two || is_latest_only || !priority.is_control();
        if !may_repeat && self.mac.queue().has_same(destination, &content) {
            return self.lose(world, packet, DropReason::Duplicate);
        }
        if priority == Priority::ForwardedRequest {
            self.rpl.handle_join_request(world.now, &mut self.dice.routing);
        }
        let priority = if has_two { priority.of_two() } else { priority };
        self.tally.frames.n_given += 1;
        if !self.mac.is_synced() {
            self.tally.drop_frame(DropReason::Desynchronised, false);
            return world.packets.lose(packet, world.now, DropReason::Desynchronised);
        }
        let traffic = destination.map_or(Traffic::Broadcast, Traffic::Unicast);
        let slotframe = slotframe.or_else(|| self.sf.slotframe_of(traffic));
        let frame = FrameRepr {
            source: self.address,
            destination,
            sequence: 0,
            ack_request: destination.is_some(),
            pending: false,
            security: self.content_security(world.settings, &content),
            slots: None,
            blacklist: None,
            content,
        };
        let frame = Queued {
            psdu_bytes: world.settings.psdu_bytes(&frame),
            frame,
            priority,
            slotframe,
            is_latest_only,
            packet,
            n_attempts: 0,
            number: 0,
            has_arrived: false,
        };
        if let Some(neighbour) = destination
            && !self.mac.queue().waits_for(neighbour)
        {
            self.with_sf(world, |sf, cx| sf.handle_queue(cx, neighbour, true));
        }
        match self.mac.enqueue(frame) {
            Ok(None) => {}
            Ok(Some(displaced)) => {
                let reason = if displaced.is_latest_only && is_latest_only {
                    DropReason::Superseded
                } else {
                    self.tally.n_queue_drops += 1;
                    DropReason::TxqueueFull
                };
                self.discard(world, displaced, reason);
            }
            Err(refused) => {
                self.tally.n_queue_drops += 1;
                self.discard(world, refused, DropReason::TxqueueFull);
            }
        }
    }

    /// A frame that will not be sent any more.
    pub(super) fn discard(&mut self, world: &mut World<'_>, frame: Queued, reason: DropReason) {
        self.lose_frame(world, &frame, reason);
        if let (Content::Sixp(message), Some(to)) = (&frame.frame.content, frame.destination()) {
            self.sixtop.handle_sent(to, message, false, world.now);
        }
        if let Some(neighbour) = frame.destination() {
            self.left_queue(world, neighbour);
        }
    }

    /// A frame for a neighbour has left the queue.
    pub(super) fn left_queue(&mut self, world: &mut World<'_>, neighbour: Eui64) {
        if !self.mac.queue().waits_for(neighbour) {
            self.with_sf(world, |sf, cx| sf.handle_queue(cx, neighbour, false));
        }
    }

    /// A frame ends without an acknowledgment. If it has arrived all the same, nothing is lost.
    pub(super) fn lose_frame(&mut self, world: &mut World<'_>, frame: &Queued, reason: DropReason) {
        self.tally.drop_frame(reason, frame.has_arrived);
        if !frame.has_arrived {
            world.packets.lose(frame.packet, world.now, reason);
        }
    }

    /// A datagram, or a part of one, ends here, and its packet with it.
    pub(super) fn lose(&mut self, world: &mut World<'_>, packet: u64, reason: DropReason) {
        self.tally.datagrams_dropped[reason.index()] += 1;
        world.packets.lose(packet, world.now, reason);
    }
}
