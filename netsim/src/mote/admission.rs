//! The way into the network: what passes between the join protocol and the rest of a mote.

use super::down::{HOP_LIMIT, hops_of};
use super::{Mote, World};
use crate::join::{Event, Outgoing};
use crate::lowpan::DropReason;
use crate::wire::Eui64;
use crate::wire::cojp::CojpRepr;
use crate::wire::datagram::{Datagram, UdpRepr};
use proto::types::PacketPurpose;

impl Mote {
    /// Passes on what the join protocol has to say. Returns whether there was anything.
    pub(super) fn pump_join(&mut self, world: &mut World<'_>) -> bool {
        let mut moved = false;
        while let Some(outgoing) = self.pledge.poll_transmit() {
            moved = true;
            let packet = self.begin_join(world, Eui64::of_ip(outgoing.destination), &outgoing);
            self.send_join(world, &outgoing, packet);
        }
        while let Some(event) = self.pledge.poll_event() {
            moved = true;
            match event {
                Event::Joined => {
                    self.proxy.set_join_rate(self.pledge.join_rate_bytes_s());
                    self.admit(world);
                }
                Event::Failed if self.mac.is_synced() => self.desynchronise(world),
                Event::Failed | Event::Left => {}
            }
        }
        moved
    }

    /// A request or a response sets out.
    fn begin_join(&self, world: &mut World<'_>, to: Eui64, outgoing: &Outgoing) -> u64 {
        let Some(to) = world.addresses.mote(to) else { return 0 };
        let bytes = outgoing.message.buffer_len() as u32;
        world.packets.begin(PacketPurpose::Join, self.id, to, world.now, bytes)
    }

    fn send_join(&mut self, world: &mut World<'_>, outgoing: &Outgoing, packet: u64) {
        let datagram = Datagram {
            packet,
            source: outgoing.source,
            destination: outgoing.destination,
            dscp: outgoing.dscp,
            hop_limit: HOP_LIMIT,
            rpi: None,
            route: None,
            upper: outgoing.upper(),
        };
        self.send(world, datagram);
    }

    /// A message has come to this proxy, which passes it on.
    fn pass_on(world: &mut World<'_>, packet: u64, passed: Outgoing, hops: u32) -> (Outgoing, u64) {
        if let Some(to) = world.addresses.mote(Eui64::of_ip(passed.destination)) {
            world.packets.pass_on(packet, to, hops);
        }
        (passed, packet)
    }

    /// A message of the join protocol has come: as registrar, as proxy, or as the pledge itself. What cannot be served ends
    /// here: the pledge will ask again.
    pub(super) fn handle_join(
        &mut self,
        world: &mut World<'_>,
        datagram: &Datagram,
        udp: &UdpRepr,
    ) {
        let Ok(message) = CojpRepr::parse(&udp.payload) else {
            return self.lose(world, datagram.packet, DropReason::Malformed);
        };
        let hops = hops_of(datagram);
        let (now, received) = (world.now, world.received);
        let answer = match &message {
            CojpRepr::Request { pledge, .. } | CojpRepr::ProtectedRequest { pledge, .. } => {
                match &mut self.registrar {
                    Some(registrar) => {
                        let answer = registrar.handle_request(datagram.source, &message, now);
                        answer.map(|answer| {
                            world.packets.deliver(datagram.packet, received, hops);
                            let packet = self.begin_join(world, *pledge, &answer);
                            (answer, packet)
                        })
                    }
                    None if self.joined => {
                        let root = self.rpl.dodag_id();
                        let passed =
                            self.proxy.handle_request(datagram.source, &message, root, now);
                        passed.map(|passed| Self::pass_on(world, datagram.packet, passed, hops))
                    }
                    None => Err(DropReason::NotJoined),
                }
            }
            CojpRepr::Response { proxy_state: Some(_), .. }
            | CojpRepr::ProtectedResponse { proxy_state: Some(_), .. } => {
                let passed = self.proxy.handle_response(&message);
                passed.map(|passed| Self::pass_on(world, datagram.packet, passed, hops))
            }
            CojpRepr::Response { proxy_state: None, .. }
            | CojpRepr::ProtectedResponse { proxy_state: None, .. } => {
                world.packets.deliver(datagram.packet, received, hops);
                self.pledge.handle_response(&message);
                return;
            }
        };
        match answer {
            Ok((answer, packet)) => self.send_join(world, &answer, packet),
            Err(reason) => self.lose(world, datagram.packet, reason),
        }
    }
}
