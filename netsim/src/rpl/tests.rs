//! What several machines do together, and clauses that need a whole one.

mod clauses;
mod data;
mod handover;
mod mrhof;
mod network;
mod probing;
mod vectors;

use super::*;
use crate::wire::address::ALL_RPL_NODES;
use crate::wire::rpl::{DaoAckRepr, DaoRepr, DioRepr, DisRepr};
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::time::{SimDuration, SimTime};
/// One machine whose messages and events are looked at.
struct Bench {
    rpl: Rpl,
    dice: Dice,
    now: SimTime,
}

fn mote(n: u32) -> Eui64 {
    Eui64::of_mote(MoteId(n))
}

fn dio_of(root: u32, rank: u16) -> DioRepr {
    let dodag = Dodag::of_root(&Config::default(), mote(root), 240, 240);
    dodag.dio(0, rank)
}

impl Bench {
    fn new(config: Config, n: u32, is_root: bool) -> Self {
        let mut dice = Dice::new(1, Purpose::Routing, MoteId(n));
        let mut rpl = Rpl::new(config, mote(n), is_root);
        rpl.start(SimTime::START, &mut dice);
        Self { rpl, dice, now: SimTime::START }
    }

    /// A mote 9 without a DODAG.
    fn mote(config: Config) -> Self {
        Self::new(config, 9, false)
    }

    /// Links that need one transmission from the first on: rank rises by one hop each.
    fn perfect() -> Config {
        Config { initial_etx_x128: 128, ..Config::default() }
    }

    fn hear(&mut self, from: u32, dio: &DioRepr) {
        self.receive(from, true, &RplMessage::Dio(dio.clone()));
    }

    fn receive(&mut self, from: u32, multicast: bool, message: &RplMessage) {
        let (from, now) = (mote(from), self.now);
        let source = from.link_local();
        self.rpl.handle_message(from, source, multicast, message, now, &mut self.dice);
    }

    fn link(&mut self, to: u32, n_transmissions: u16, acknowledged: bool) {
        let now = self.now;
        self.rpl.handle_link(mote(to), n_transmissions, acknowledged, now, &mut self.dice);
    }

    /// Lets time pass; returns what was sent.
    fn pass(&mut self, duration: SimDuration) -> Vec<Outgoing> {
        let end = self.now + duration;
        let mut sent = self.sent();
        while let Some(at) = self.rpl.poll_timeout().filter(|&at| at <= end) {
            self.now = self.now.max(at);
            self.rpl.handle_timeout(self.now, &mut self.dice);
            sent.extend(self.sent());
        }
        self.now = end;
        sent
    }

    fn sent(&mut self) -> Vec<Outgoing> {
        std::iter::from_fn(|| self.rpl.poll_transmit()).collect()
    }

    fn events(&mut self) -> Vec<Event> {
        std::iter::from_fn(|| self.rpl.poll_event()).collect()
    }
}

/// Ranks of the DIOs among messages.
fn dio_ranks(sent: &[Outgoing]) -> Vec<u16> {
    let rank = |one: &Outgoing| match &one.message {
        RplMessage::Dio(dio) => Some(dio.rank),
        _ => None,
    };
    sent.iter().filter_map(rank).collect()
}

/// The DAOs among messages.
fn daos(sent: &[Outgoing]) -> Vec<(Ipv6Addr, DaoRepr)> {
    let dao = |one: &Outgoing| match &one.message {
        RplMessage::Dao(dao) => Some((one.destination, dao.clone())),
        _ => None,
    };
    sent.iter().filter_map(dao).collect()
}

/// Destinations of the DISs among messages.
fn dis_destinations(sent: &[Outgoing]) -> Vec<Ipv6Addr> {
    let is_dis = |one: &&Outgoing| matches!(one.message, RplMessage::Dis(_));
    sent.iter().filter(is_dis).map(|one| one.destination).collect()
}

fn ack(sequence: u8, status: u8) -> RplMessage {
    RplMessage::DaoAck(DaoAckRepr { instance: 0, sequence, status })
}
