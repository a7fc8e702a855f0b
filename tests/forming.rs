//! A network that forms, made up: the real one without protocols, which says in addition what one with protocols would.
//!
//! `[netsim] forms_after_s` says when the last mote joins; mote i of n joins after i / (n - 1) of it. From then on every
//! mote but the root, 0, creates a packet for it in each step; that of a step before is delivered over i hops, but
//! mote 2's are dropped. The last one created is thus always on its way.

use crate::fake::Faulty;
use bytes::Bytes;
use proto::config::{Node, Problem, Value};
use proto::side::{NetInput, NetOutput, NetSimulator, NetStart, NotASnapshot, Setup};
use proto::types::{
    Bitmap, DeliveryColumn, Formation, HeardLinks, MoteCommandKind, MoteStates, MoteStatistics,
    NS_PER_S, NetRecord, PacketKind, Packets, Schedule, Statistic,
};
use proto_host::NetHost;
use proto_host::services::net_sim_service_server::NetSimServiceServer;

/// Serves such a network. It ends with the test's process.
#[must_use]
pub fn serve() -> Faulty {
    let host = NetHost::new(Forming::default());
    Faulty::serve(move |server| server.add_service(NetSimServiceServer::new(host)))
}

/// The network.
#[derive(Debug, Default)]
struct Forming {
    inner: netsim::sim::Network,
    n: usize,
    records: Vec<NetRecord>,
    forms_after_ns: u64,
    formed_ns: Option<u64>,
    created: u64,
    /// Packets on their way: number, source, when they were created.
    on_their_way: Vec<(u64, u32, u64)>,
}

impl Forming {
    fn joins_ns(&self, mote: usize) -> u64 {
        self.forms_after_ns / (self.n.max(2) as u64 - 1) * mote as u64
    }

    fn has_joined(&self, time_ns: u64) -> Bitmap {
        let mut joined = Bitmap::filled(self.n, false);
        (0..self.n).for_each(|mote| joined.set(mote, self.joins_ns(mote) <= time_ns));
        joined
    }

    fn formation(&mut self, time_ns: u64) -> Formation {
        let joined = self.has_joined(time_ns);
        let missing: Vec<u32> =
            (0..self.n).filter(|&mote| !joined.get(mote)).map(|mote| mote as u32).collect();
        if missing.is_empty() && self.formed_ns.is_none() {
            self.formed_ns = Some(self.joins_ns(self.n - 1));
        }
        // The next one to join hears somebody already.
        let reason = (0..missing.len()).map(|place| u32::from(place != 0)).collect();
        let reasons = ["has not joined", "hears no enhanced beacon"].map(str::to_owned).to_vec();
        Formation { formed_ns: self.formed_ns, missing, reason, reasons }
    }

    fn packets(&mut self, from_ns: u64, until_ns: u64) -> Packets {
        let mut packets = Packets {
            reasons: vec!["queue_full".to_owned(), "max_retries".to_owned()],
            ..Packets::default()
        };
        for (id, source, created_ns) in std::mem::take(&mut self.on_their_way) {
            packets.id.push(id);
            packets.kind.push(0);
            packets.source.push(source);
            packets.destination.push(0);
            packets.created_ns.push(created_ns);
            packets.ended_ns.push(from_ns);
            packets.hops.push(source);
            packets.payload_bytes.push(90);
            packets.outcome.push(if source == 2 { 2 } else { 0 });
        }
        let joined = self.has_joined(until_ns);
        for mote in joined.iter_ones().filter(|&mote| mote != 0) {
            self.on_their_way.push((self.created, mote as u32, from_ns));
            self.created += 1;
        }
        let name = "app".to_owned();
        packets.kinds.push(PacketKind { name, is_application: true, created: self.created });
        packets
    }

    fn statistics(&self, time_ns: u64) -> MoteStatistics {
        let column = |name: &str, unit: &str, value: &dyn Fn(usize) -> f64| Statistic {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values: (0..self.n).map(value).collect(),
            known: None,
        };
        let joined = self.has_joined(time_ns);
        let joined_ns = |mote| if joined.get(mote) { self.joins_ns(mote) as f64 } else { 0.0 };
        let mut first_joined = column("first_joined_ns", "ns", &joined_ns);
        first_joined.known = Some(joined.clone());
        MoteStatistics {
            columns: vec![
                // 100 µA, for mote 1 twice that.
                column("charge_uc", "uC", &|mote| {
                    time_ns as f64 * 1e-7 * if mote == 1 { 2.0 } else { 1.0 }
                }),
                column("up_ns", "ns", &|_| time_ns as f64),
                column("radio_on_ns", "ns", &|_| time_ns as f64 / 4.0),
                column("is_root", "", &|mote| f64::from(u8::from(mote == 0))),
                first_joined,
            ],
        }
    }

    fn schedule(&self) -> Schedule {
        let motes = 0..self.n as u32;
        Schedule {
            mote: motes.clone().collect(),
            slotframe: vec![0; self.n],
            slotframe_slots: vec![101; self.n],
            slot: motes.clone().collect(),
            channel_offset: vec![3; self.n],
            options: vec![1; self.n],
            neighbour: motes.map(|mote| mote.checked_sub(1).unwrap_or(u32::MAX)).collect(),
        }
    }

    /// Each mote hears the one before it once in 100 ms.
    fn heard_links(&self, time_ns: u64) -> HeardLinks {
        let receiver: Vec<u32> = (1..self.n as u32).collect();
        HeardLinks {
            sender: receiver.iter().map(|mote| mote - 1).collect(),
            frames: vec![time_ns / 100_000_000; receiver.len()],
            rssi_dbm: vec![-71.5; receiver.len()],
            receiver,
        }
    }

    fn motes(&self, motes: MoteStates, time_ns: u64) -> MoteStates {
        let joined = self.has_joined(time_ns);
        let parent =
            |mote: usize| if mote == 0 || !joined.get(mote) { u32::MAX } else { mote as u32 - 1 };
        MoteStates {
            synced: Some(joined.clone()),
            rank: (1..=self.n as u32).map(|depth| 256 * depth).collect(),
            parent: (0..self.n).map(parent).collect(),
            joined: Some(joined),
            ..motes
        }
    }
}

/// A frame of two bytes, sent then.
fn captured(time_ns: u64) -> Bytes {
    let numbers = [time_ns / NS_PER_S, time_ns % NS_PER_S, 2, 2];
    let mut bytes: Vec<u8> =
        numbers.into_iter().flat_map(|number| (number as u32).to_le_bytes()).collect();
    bytes.extend([0xca, 0xfe]);
    bytes.into()
}

impl NetSimulator for Forming {
    const NAME: &'static str = "forming";

    fn config_schema_json(&self) -> String {
        String::new()
    }

    fn commands() -> &'static [MoteCommandKind] {
        &[MoteCommandKind::Kill, MoteCommandKind::Revive]
    }

    fn columns() -> &'static [DeliveryColumn] {
        netsim::sim::Network::columns()
    }

    fn records() -> &'static [NetRecord] {
        &[
            NetRecord::Packets,
            NetRecord::Capture,
            NetRecord::Statistics,
            NetRecord::Schedule,
            NetRecord::HeardLinks,
        ]
    }

    fn configure(&mut self, setup: &Setup) -> Result<NetStart, Vec<Problem>> {
        let forms_after_s = match setup.config.get("forms_after_s").map(|node| &node.value) {
            Some(Value::Number(seconds)) => *seconds,
            _ => return Err(vec![Problem::new("forms_after_s", "must be a number")]),
        };
        let config = Node::empty_table();
        let start = self.inner.configure(&Setup { config, ..setup.clone() })?;
        let inner = std::mem::take(&mut self.inner);
        *self = Self {
            inner,
            n: setup.experiment.agent_count,
            records: setup.records.clone(),
            forms_after_ns: (forms_after_s * NS_PER_S as f64) as u64,
            ..Self::default()
        };
        let kept = |record| self.records.contains(&record);
        let mut effective = toml::Table::new();
        effective.insert("forms_after_s".to_owned(), forms_after_s.into());
        let capture_header = if kept(NetRecord::Capture) {
            Bytes::copy_from_slice(&netsim::wire::tap::file_header())
        } else {
            Bytes::new()
        };
        Ok(NetStart {
            effective,
            motes: self.motes(start.motes, 0),
            warnings: Vec::new(),
            statistics: kept(NetRecord::Statistics).then(|| self.statistics(0)),
            max_payload_bytes: None,
            capture_header,
            formation: Some(self.formation(0)),
            records: self.records.clone(),
        })
    }

    fn step(&mut self, input: &NetInput<'_>) -> NetOutput {
        let output = self.inner.step(input);
        let time_ns = output.time_ns;
        let wanted = |record| input.records.contains(&record);
        let packets = self.packets(input.from_ns, time_ns);
        NetOutput {
            motes: self.motes(output.motes.clone(), time_ns),
            formation: Some(self.formation(time_ns)),
            packets: self.records.contains(&NetRecord::Packets).then_some(packets),
            capture: if self.records.contains(&NetRecord::Capture) {
                captured(input.from_ns)
            } else {
                Bytes::new()
            },
            statistics: wanted(NetRecord::Statistics).then(|| self.statistics(time_ns)),
            schedule: wanted(NetRecord::Schedule).then(|| self.schedule()),
            heard_links: wanted(NetRecord::HeardLinks).then(|| self.heard_links(time_ns)),
            ..output
        }
    }

    fn snapshot(&self) -> Vec<u8> {
        self.inner.snapshot()
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), NotASnapshot> {
        self.inner.restore(state)
    }

    fn reseed(&mut self, seed: u64) {
        self.inner.reseed(seed);
    }
}
