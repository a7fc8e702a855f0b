//! The swarm's payloads: from what the robots say to frames in the queues.

use super::network::Mesh;
use crate::mote::settings::Transport;
use crate::wire::address::ALL_NODES;
use bytes::Bytes;
use physics::asn::Asn;
use proto::ids::MoteId;
use proto::side::NetInput;
use proto::time::SimDuration;
use proto::types::PacketPurpose;

/// Minimum MTU of IPv6 (bytes; RFC 8200, section 5), less the headers of IPv6 and UDP. 6LoWPAN cuts datagrams up to it into fragments.
const MOST_UNICAST_BYTES: u32 = 1280 - 40 - 8;

impl Mesh {
    /// The longest payload of a robot (bytes); `None`: payloads are not sent. A broadcast is one frame: nobody would acknowledge its
    /// fragments.
    #[must_use]
    pub fn max_payload_bytes(&self) -> Option<u32> {
        match self.settings.transport {
            Transport::None => None,
            Transport::UnicastNeighbours => Some(MOST_UNICAST_BYTES),
            Transport::OwnCell | Transport::SharedCell | Transport::BroadcastSlotframe { .. } => {
                self.state.motes.first().map(|mote| mote.broadcast_room(&self.settings) as u32)
            }
        }
    }

    /// At the beginning of a control period every mote that is ready takes over what its robot says. Later within a
    /// period, where steps are shorter, only what is still waiting is replaced.
    pub(super) fn hand_over_payloads(&mut self, input: &NetInput<'_>, asn: Asn) {
        if self.settings.transport == Transport::None {
            return;
        }
        let slot = self.config.slot;
        let now = asn * slot;
        let is_new_period = (now % SimDuration::from_ns(self.experiment.step_ns)).is_zero();
        let data = input.payloads.data();
        let mut begin = 0;
        for (mote, &length) in (0..).zip(input.payloads.length_bytes()) {
            let range = begin..begin + length as usize;
            begin = range.end;
            let node = &self.state.motes[mote as usize];
            let waits = node.mac.queue().iter().any(|queued| queued.is_latest_only);
            if length == 0 || !node.ready || !input.states.alive.get(mote as usize) {
                continue;
            }
            // Payloads for one neighbour are packets, and are reported as such.
            if is_new_period && waits && self.settings.transport != Transport::UnicastNeighbours {
                self.state.motes[mote as usize].tally.n_superseded += 1;
            }
            if is_new_period || waits {
                self.hand_over(MoteId(mote), data.slice(range), asn);
                self.reschedule(MoteId(mote), asn);
            }
        }
    }

    fn hand_over(&mut self, mote: MoteId, payload: Bytes, asn: Asn) {
        match self.settings.transport {
            Transport::None => {}
            Transport::OwnCell | Transport::SharedCell | Transport::BroadcastSlotframe { .. } => {
                let (node, mut world) = self.mote_and_world(mote, asn);
                node.say(&mut world, ALL_NODES, payload, 0);
            }
            Transport::UnicastNeighbours => {
                let neighbours: Vec<_> =
                    self.state.motes[mote.index()].mac.neighbours().addresses().collect();
                let now = asn * self.config.slot;
                for neighbour in neighbours {
                    let Some(other) = self.addresses.mote(neighbour) else { continue };
                    let bytes = payload.len() as u32;
                    let packet =
                        self.state.packets.begin(PacketPurpose::Swarm, mote, other, now, bytes);
                    let (node, mut world) = self.mote_and_world(mote, asn);
                    node.say(&mut world, neighbour.link_local(), payload.clone(), packet);
                }
            }
        }
        let (node, mut world) = self.mote_and_world(mote, asn);
        node.pump(&mut world);
    }
}
