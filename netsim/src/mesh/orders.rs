//! Faults, jamming and traffic that are ordered from outside; motes whose robots come and go.

use super::network::Mesh;
use crate::energy;
use crate::wire::address::ALL_NODES;
use physics::asn::Asn;
use physics::medium::jam::Jam;
use proto::ids::MoteId;
use proto::types::PacketPurpose;
use proto::types::{AgentStates, EVERYONE, MoteCommand, MoteOrder};

impl Mesh {
    /// Orders take effect at the beginning of slot `asn`.
    pub(super) fn obey(&mut self, commands: &[MoteCommand], asn: Asn) {
        self.state.place.obey(commands);
        for command in commands {
            match &command.order {
                MoteOrder::Kill(mote) => {
                    self.switch_off(MoteId(*mote), asn);
                }
                MoteOrder::Revive(mote) | MoteOrder::Add(mote) => {
                    // A mote that works again has the battery that it had.
                    if self.has_run_empty(MoteId(*mote), asn) {
                        self.state.place.working.set(*mote as usize, false);
                    }
                    if self.state.place.is_alive(*mote as usize) {
                        self.switch_on(MoteId(*mote), asn);
                    }
                }
                MoteOrder::Jam { channel, from_ns, until_ns, centre_m, radius_m } => {
                    self.state.jams.add(Jam {
                        channel: *channel as u8,
                        from_ns: *from_ns,
                        until_ns: *until_ns,
                        centre_m: *centre_m,
                        radius_m: *radius_m,
                    });
                }
                MoteOrder::Send { mote, destination, payload } => {
                    self.send_ordered(MoteId(*mote), MoteId(*destination), payload.clone(), asn);
                }
            }
        }
        self.state.jams.forget_before((asn * self.config.slot).ns());
    }

    /// Motes whose batteries are empty fail, where the configuration wants that.
    pub(super) fn fail_empty_motes(&mut self, asn: Asn) {
        if !self.settings.battery_deaths {
            return;
        }
        for mote in 0..self.experiment.agent_count as u32 {
            if self.state.motes[mote as usize].is_on() && self.is_empty(MoteId(mote), asn) {
                self.state.place.working.set(mote as usize, false);
                self.switch_off(MoteId(mote), asn);
            }
        }
    }

    /// Whether the mote's battery is empty, where the configuration lets that end a mote.
    pub(super) fn has_run_empty(&self, mote: MoteId, asn: Asn) -> bool {
        self.settings.battery_deaths && self.is_empty(mote, asn)
    }

    /// Whether the mote has drawn what its battery held, until slot `asn`. Roots have none.
    pub(super) fn is_empty(&self, mote: MoteId, asn: Asn) -> bool {
        let node = &self.state.motes[mote.index()];
        let usage = node.tally.usage_until(asn, node.schedule.n_listening(asn));
        let drawn_uc = usage.charge_uc(self.settings.energy, self.config.slot);
        !node.is_root && self.settings.battery_mah * energy::UC_PER_MAH <= drawn_uc
    }

    /// A mote whose robot is gone is off, and on again when the robot is back.
    pub(super) fn follow_bodies(&mut self, states: &AgentStates, asn: Asn) {
        for mote in 0..self.experiment.agent_count as u32 {
            let place = mote as usize;
            if states.alive.get(place) && self.state.place.is_alive(place) {
                self.switch_on(MoteId(mote), asn);
            } else {
                self.switch_off(MoteId(mote), asn);
            }
        }
    }

    /// Switches a mote on that is off.
    pub(super) fn switch_on(&mut self, mote: MoteId, asn: Asn) {
        let has_oracle = self.has_oracle;
        let (node, mut world) = self.mote_and_world(mote, asn);
        if node.tally.on_since_asn.is_none() {
            if has_oracle {
                node.switch_on_ready(&mut world);
            } else {
                node.switch_on(&mut world);
            }
            self.reschedule(mote, asn);
        }
    }

    /// Switches a mote off that is on.
    pub(super) fn switch_off(&mut self, mote: MoteId, asn: Asn) {
        let (node, mut world) = self.mote_and_world(mote, asn);
        if node.tally.on_since_asn.is_some() {
            node.switch_off(&mut world);
            if self.has_oracle {
                self.oracle_lose(mote, asn);
            }
            // It may have been the last one that was missing.
            self.readiness_changed = true;
            self.listening_cache.forget(mote);
            self.state.calendar.set(mote, None);
        }
    }

    fn send_ordered(&mut self, mote: MoteId, destination: MoteId, payload: bytes::Bytes, asn: Asn) {
        let now = asn * self.config.slot;
        if self.has_oracle {
            if destination != MoteId(EVERYONE) {
                let bytes = payload.len() as u32;
                let kind = PacketPurpose::Ordered;
                let packet = self.state.packets.begin(kind, mote, destination, now, bytes);
                self.oracle_send(mote, destination, payload, packet, asn);
                self.reschedule(mote, asn);
            }
            return;
        }
        if destination == MoteId(EVERYONE) {
            let (node, mut world) = self.mote_and_world(mote, asn);
            node.say(&mut world, ALL_NODES, payload, 0);
        } else {
            let to = self.addresses.eui64(destination).global();
            let bytes = payload.len() as u32;
            let packet =
                self.state.packets.begin(PacketPurpose::Ordered, mote, destination, now, bytes);
            let (node, mut world) = self.mote_and_world(mote, asn);
            node.say(&mut world, to, payload, packet);
        }
        let (node, mut world) = self.mote_and_world(mote, asn);
        node.pump(&mut world);
        self.reschedule(mote, asn);
    }
}
