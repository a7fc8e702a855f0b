//! What the network reports: states, formation, statistics, schedules, packets.

use super::network::{HeardOf, Mesh};
use crate::app::Counters;
use crate::energy::{self, ACK_BYTES};
use crate::lowpan::DropReason;
use crate::mac::CellKind;
use crate::mac::kind::FrameKind;
use crate::mote::{Lack, Mote, tally};
use crate::wire::Eui64;
use physics::asn::Asn;
use physics::medium::slot::Sent;
use proto::ids::MoteId;
use proto::side::{NetInput, NetOutput};
use proto::time::{SimDuration, SimTime};
use proto::types::PacketPurpose;
use proto::types::{
    self, Bitmap, Formation, HeardLinks, MoteStates, MoteStatistics, NetRecord, Schedule, Statistic,
};

/// What a mote lacks whose answer from the root may not fit a frame.
const TOO_FAR: &str = "waits to be admitted by the join registrar, and source routes of the root do not fit a frame: so many hops need \
                       rpl.mode = \"storing\"";
/// Longest frame (PSDU, bytes).
const LONGEST: u16 = 127;
/// With a smaller probability of reception, a mote is out of range.
const HARDLY: f64 = 0.1;

impl Mesh {
    /// The reply to a step that has come to `time`.
    pub(super) fn report(&mut self, input: &NetInput<'_>, time: SimTime) -> NetOutput {
        let n = self.experiment.agent_count;
        let keeps = |record| self.records.contains(&record);
        let packets = keeps(NetRecord::Packets).then(|| self.packets());
        let wanted = |record| input.records.contains(&record);
        let statistics = wanted(NetRecord::Statistics).then(|| self.statistics(time));
        let schedule = wanted(NetRecord::Schedule).then(|| self.schedule());
        let heard_links = wanted(NetRecord::HeardLinks).then(|| self.heard_links());
        if packets.is_none() {
            self.state.packets.take_ended();
        }
        NetOutput {
            time_ns: time.ns(),
            deliveries: self.inbox.deliveries(n, &self.columns),
            motes: self.motes(),
            commands: Vec::new(),
            formation: Some(self.formation()),
            packets,
            capture: self.capture.take(),
            statistics,
            schedule,
            heard_links,
            frames: self.frames.take(),
        }
    }

    /// The motes now.
    #[must_use]
    pub fn motes(&self) -> MoteStates {
        let motes = &self.state.motes;
        let flags = |is_set: &dyn Fn(&Mote) -> bool| {
            let mut bits = Bitmap::filled(motes.len(), false);
            for (place, mote) in motes.iter().enumerate() {
                bits.set(place, is_set(mote));
            }
            bits
        };
        let parent = |mote: &Mote| mote.rpl.parent().and_then(|parent| self.addresses.mote(parent));
        MoteStates {
            alive: self.state.place.alive(),
            synced: Some(flags(&|mote| mote.mac.is_synced())),
            joined: Some(flags(&|mote| mote.joined)),
            rank: motes.iter().map(|mote| u32::from(mote.rpl.rank())).collect(),
            parent: motes
                .iter()
                .map(|mote| parent(mote).map_or(u32::MAX, |parent| parent.0))
                .collect(),
            queue_length: motes.iter().map(|mote| mote.mac.queue_len() as u32).collect(),
        }
    }

    /// Looks whether everybody takes part now, if that has not been so before.
    pub(super) fn look_whether_formed(&mut self, asn: Asn) {
        if !std::mem::take(&mut self.readiness_changed) || self.state.formed.formed.is_some() {
            return;
        }
        let all =
            self.state.motes.iter().all(|mote| {
                if mote.is_on() { mote.ready } else { !self.has_run_empty(mote.id, asn) }
            });
        if all {
            self.state.formed.formed = Some((asn + 1) * self.config.slot);
        }
    }

    /// Whether the network has formed, and who is missing for what.
    #[must_use]
    pub fn formation(&self) -> Formation {
        let formed = self.state.formed.formed;
        let mut formation = Formation {
            formed_ns: formed.map(SimTime::ns),
            reasons: Lack::ALL.map(|lack| lack.words().to_owned()).to_vec(),
            ..Formation::default()
        };
        if formed.is_none() {
            // By the one through whom it asks: a root answers over a source route.
            let is_too_far = self
                .state
                .motes
                .iter()
                .any(|mote| mote.is_root && mote.tally.dropped(DropReason::TooLarge) != 0);
            let admission = if is_too_far {
                formation.reasons.push(TOO_FAR.to_owned());
                formation.reasons.len() - 1
            } else {
                Lack::Admission as usize
            };
            for mote in &self.state.motes {
                let reason = match mote.lacks() {
                    Some(Lack::Admission) if mote.is_on() => admission,
                    Some(lack) if mote.is_on() => lack as usize,
                    None if mote.is_on() => continue,
                    _ if self.has_run_empty(mote.id, self.state.asn) => formation.reasons.len(),
                    _ => continue,
                };
                formation.missing.push(mote.id.0);
                formation.reason.push(reason as u32);
            }
            if formation.reason.contains(&(formation.reasons.len() as u32)) {
                formation.reasons.push("has an empty battery".to_owned());
            }
        }
        formation
    }

    fn packets(&mut self) -> types::Packets {
        let mut ended = self.state.packets.take_ended();
        ended.sort_by_key(|ended| (ended.ended, ended.packet.id));
        let kinds: &[PacketPurpose] = if self.settings.uses_coap() {
            &PacketPurpose::ALL
        } else {
            &PacketPurpose::WITHOUT_COAP
        };
        let kinds = kinds.iter().map(|&kind| types::PacketKind {
            name: kind.name().to_owned(),
            is_application: kind == PacketPurpose::Application,
            created: self.state.packets.created(kind),
        });
        types::Packets {
            id: ended.iter().map(|ended| ended.packet.id).collect(),
            kind: ended.iter().map(|ended| ended.packet.kind as u32).collect(),
            source: ended.iter().map(|ended| ended.packet.source.0).collect(),
            destination: ended.iter().map(|ended| ended.packet.destination.0).collect(),
            created_ns: ended.iter().map(|ended| ended.packet.created.ns()).collect(),
            ended_ns: ended.iter().map(|ended| ended.ended.ns()).collect(),
            hops: ended.iter().map(|ended| ended.hops).collect(),
            payload_bytes: ended.iter().map(|ended| ended.packet.bytes).collect(),
            outcome: ended
                .iter()
                .map(|ended| ended.lost.map_or(0, |reason| reason.index() as u32 + 1))
                .collect(),
            kinds: kinds.collect(),
            reasons: DropReason::ALL.map(|reason| reason.name().to_owned()).to_vec(),
        }
    }

    /// Numbers per mote at a time.
    #[must_use]
    pub fn statistics(&mut self, time: SimTime) -> MoteStatistics {
        let out_of_range = self.parents_out_of_range(time);
        let slot = self.config.slot;
        let asn = Asn::first_from(time, slot);
        let model = self.settings.energy;
        let airtime = self.settings.mac.airtime;
        let usages: Vec<energy::Usage> = self
            .state
            .motes
            .iter()
            .map(|mote| mote.tally.usage_until(asn, mote.schedule.n_listening(asn)))
            .collect();
        let motes = &self.state.motes;
        let all = |name: &str, unit: &str, values: Vec<f64>| Statistic {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values,
            known: None,
        };
        let count = |name: &str, unit: &str, value: &dyn Fn(&Mote) -> u64| {
            all(name, unit, motes.iter().map(|mote| value(mote) as f64).collect())
        };
        let first = |name: &str, value: &dyn Fn(&Mote) -> Option<SimTime>| {
            let mut known = Bitmap::filled(motes.len(), false);
            let mut values = Vec::with_capacity(motes.len());
            for (place, mote) in motes.iter().enumerate() {
                known.set(place, value(mote).is_some());
                values.push(value(mote).unwrap_or_default().ns() as f64);
            }
            Statistic { name: name.to_owned(), unit: "ns".to_owned(), values, known: Some(known) }
        };
        let used = |name: &str, unit: &str, value: &dyn Fn(&energy::Usage) -> f64| {
            all(name, unit, usages.iter().map(value).collect())
        };
        let mut columns = vec![
            count("is_root", "", &|mote| u64::from(mote.is_root)),
            all("battery_mah", "mAh", vec![self.settings.battery_mah; motes.len()]),
            used("charge_uc", "uC", &|usage| usage.charge_uc(model, slot)),
            count("up_ns", "ns", &|mote| (mote.tally.slots_on(asn) * slot).ns()),
            used("radio_on_ns", "ns", &|usage| {
                usage.radio_on(slot, ACK_BYTES, &airtime).ns() as f64
            }),
            count("tx_frames", "frames", &|mote| mote.tally.sent_in_all().n),
            count("rx_frames", "frames", &|mote| mote.tally.n_rx),
            count("tx_unicast", "frames", &|mote| mote.tally.sent_in_all().n_unicast),
            count("tx_acked", "frames", &|mote| mote.tally.sent_in_all().n_acked),
            count("retransmissions", "frames", &|mote| mote.tally.sent_in_all().n_repeated),
            count("queue_drops", "frames", &|mote| mote.tally.n_queue_drops),
            count("payloads_superseded", "payloads", &|mote| mote.tally.n_superseded),
            count("parent_changes", "", &|mote| mote.tally.n_parent_changes),
            count("packets_created", "packets", &|mote| mote.tally.n_created),
            count("desynchronisations", "", &|mote| mote.tally.n_desynchronised),
            used("idle_listen_slots", "slots", &|usage| usage.idle_listen as f64),
            used("scan_slots", "slots", &|usage| usage.scan as f64),
            out_of_range,
            first("first_synced_ns", &|mote| mote.tally.first_synced),
            first("first_joined_ns", &|mote| mote.tally.first_joined),
            first("first_ready_ns", &|mote| mote.tally.first_ready),
        ];
        if self.settings.is_secured() {
            columns.push(count("security_drops", "frames", &|mote| mote.tally.n_insecure));
        }
        if self.settings.battery_deaths {
            columns
                .push(count("battery_empty", "", &|mote| u64::from(self.is_empty(mote.id, asn))));
        }
        if self.settings.uses_coap() {
            let sent: Vec<Counters> = motes.iter().map(Mote::coap_counters).collect();
            let column = |name: &str, value: fn(&Counters) -> u64| {
                all(name, "messages", sent.iter().map(|sent| value(sent) as f64).collect())
            };
            columns.extend([
                column("coap_requests", |sent| sent.requests),
                column("coap_retransmissions", |sent| sent.retransmissions),
                column("coap_duplicates", |sent| sent.duplicates),
                column("blocks_requested", |sent| sent.blocks),
                column("blocks_retransmitted", |sent| sent.block_retransmissions),
                column("blocks_duplicated", |sent| sent.block_duplicates),
            ]);
        }
        for kind in FrameKind::ALL {
            let name = kind.name().replace('-', "_");
            let mut column = |prefix: &str, value: fn(&tally::Sent) -> u64| {
                let name = format!("{prefix}_{name}");
                columns
                    .push(count(&name, "frames", &|mote| value(&mote.tally.sent[kind as usize])));
            };
            column("tx_frames", |sent| sent.n);
            column("tx_unicast", |sent| sent.n_unicast);
            column("tx_acked", |sent| sent.n_acked);
            column("retransmissions", |sent| sent.n_repeated);
        }
        // Payloads that are superseded have a column of their own.
        let reasons = DropReason::ALL
            .into_iter()
            .filter(|&reason| reason.is_loss() && reason != DropReason::Superseded);
        columns.extend(reasons.map(|reason| {
            let name = format!("drops_{}", reason.name());
            count(&name, "", &|mote| mote.tally.dropped(reason))
        }));
        MoteStatistics { columns }
    }

    /// Of each mote that has a parent, whether that hardly receives a frame of it any more.
    fn parents_out_of_range(&mut self, time: SimTime) -> Statistic {
        let channel = self.config.hopping_sequence.first().copied().unwrap_or_default();
        let airtime = SimDuration::from_ns(self.settings.mac.airtime.of(LONGEST).unsigned_abs());
        let MoteStates { alive, parent, .. } = self.motes();
        let mut known = Bitmap::filled(parent.len(), false);
        let mut values = vec![0.0; parent.len()];
        for mote in alive.iter_ones().filter(|&mote| parent[mote] != u32::MAX) {
            known.set(mote, true);
            let sender = MoteId(mote as u32);
            let sent = Sent { sender, channel, sent_ns: time.ns(), end_ns: (time + airtime).ns() };
            let arrival = self.links.arrival(sent, MoteId(parent[mote]));
            values[mote] = f64::from(u8::from(arrival.reception_probability < HARDLY));
        }
        Statistic {
            name: "parent_out_of_range".to_owned(),
            unit: String::new(),
            values,
            known: Some(known),
        }
    }

    fn schedule(&self) -> Schedule {
        let mut schedule = Schedule::default();
        for mote in &self.state.motes {
            for frame in mote.schedule.slotframes() {
                let mut cells: Vec<_> = frame.cells().iter().collect();
                cells.sort_by_key(|cell| (cell.slot, cell.channel));
                for cell in cells {
                    // Time is kept in what beacons announce (RFC 8180, § 4.1): see `Mote::beacon`.
                    let is_announced = cell.kind != CellKind::Normal;
                    let options = u32::from(cell.options.tx)
                        | u32::from(cell.options.rx) << 1
                        | u32::from(cell.options.shared) << 2
                        | u32::from(is_announced && cell.options.rx) << 3;
                    let number = |address: Eui64| self.addresses.mote(address);
                    schedule.mote.push(mote.id.0);
                    schedule.slotframe.push(u32::from(frame.handle));
                    schedule.slotframe_slots.push(u32::from(frame.slots()));
                    schedule.slot.push(u32::from(cell.slot));
                    schedule.channel_offset.push(u32::from(cell.channel));
                    schedule.options.push(options);
                    schedule
                        .neighbour
                        .push(cell.neighbour.and_then(number).unwrap_or(MoteId(u32::MAX)).0);
                }
            }
        }
        schedule
    }

    /// A frame was heard.
    #[inline]
    pub(super) fn note_heard(&mut self, receiver: MoteId, sender: MoteId, rssi_dbm: f64) {
        if self.state.heard.is_empty() {
            return;
        }
        let heard_of = &mut self.state.heard[receiver.index()];
        match heard_of.binary_search_by_key(&sender, |heard| heard.sender) {
            Ok(place) => {
                heard_of[place].frames += 1;
                heard_of[place].sum_dbm += rssi_dbm;
            }
            Err(place) => heard_of.insert(place, HeardOf { sender, frames: 1, sum_dbm: rssi_dbm }),
        }
    }

    fn heard_links(&self) -> HeardLinks {
        let mut links = HeardLinks::default();
        for (receiver, heard_of) in (0..).zip(&self.state.heard) {
            for heard in heard_of {
                links.receiver.push(receiver);
                links.sender.push(heard.sender.0);
                links.frames.push(heard.frames);
                links.rssi_dbm.push((heard.sum_dbm / heard.frames as f64) as f32);
            }
        }
        links
    }
}
