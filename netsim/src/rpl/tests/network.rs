//! Many machines and links that lose messages, without a MAC.

use super::*;
use crate::wire::datagram::RpiRepr;
use proptest::prelude::*;
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use std::collections::BTreeSet;

/// Time from a message's sending to its reception.
const DELAY: SimDuration = SimDuration::from_ns(20_000_000);
/// Transmissions of a unicast frame.
const N_TRIES: u16 = 5;

struct Network {
    motes: Vec<Rpl>,
    dice: Vec<Dice>,
    /// Delivery ratio of the link from one mote to another.
    pdr: Vec<Vec<f64>>,
    alive: Vec<bool>,
    air: Dice,
    now: SimTime,
    /// Messages on their way: when, from, to, message, whether to everyone.
    flying: VecDeque<(SimTime, usize, usize, Ipv6Addr, RplMessage, bool)>,
}

impl Network {
    fn new(config: &Config, roots: usize, pdr: Vec<Vec<f64>>, seed: u64) -> Self {
        let n = pdr.len();
        let dice = |i| Dice::new(seed, Purpose::Routing, MoteId(i as u32));
        let mote = |i| Rpl::new(config.clone(), super::mote(i as u32), i < roots);
        let mut network = Self {
            motes: (0..n).map(mote).collect(),
            dice: (0..n).map(dice).collect(),
            pdr,
            alive: vec![true; n],
            air: Dice::new(seed, Purpose::Mac, MoteId(0)),
            now: SimTime::START,
            flying: VecDeque::new(),
        };
        for i in 0..n {
            network.motes[i].start(SimTime::START, &mut network.dice[i]);
        }
        network
    }

    fn index(&self, address: Eui64) -> Option<usize> {
        (0..self.motes.len()).find(|&i| mote(i as u32) == address)
    }

    fn hears(&mut self, from: usize, to: usize) -> bool {
        self.alive[from] && self.alive[to] && self.air.uniform() < self.pdr[from][to]
    }

    /// A unicast frame with retries; the sender learns what came of it.
    fn unicast(&mut self, from: usize, to: usize) -> bool {
        let mut n = 0;
        let mut arrives = false;
        while !arrives && n < N_TRIES {
            n += 1;
            arrives = self.hears(from, to);
        }
        let (now, dice) = (self.now, &mut self.dice[from]);
        self.motes[from].handle_link(mote(to as u32), n, arrives, now, dice);
        arrives
    }

    /// Carries a unicast datagram hop by hop at once; returns where it ended.
    fn carry(&mut self, from: usize, destination: Ipv6Addr) -> Option<usize> {
        let mut at = from;
        let mut rpi: Option<RpiRepr> = None;
        let mut hops: VecDeque<Ipv6Addr> = VecDeque::new();
        for _ in 0..64 {
            if self.motes[at].address() == Some(destination) {
                return Some(at);
            }
            let mut returns = None;
            let next = if let Some(hop) = hops.pop_front() {
                Eui64::of_ip(hop)
            } else {
                match self.motes[at].route(destination)? {
                    Route::Neighbour(next) | Route::Up(next) | Route::Down(next) => next,
                    Route::Source { first_hop, route } => {
                        hops = route.hops.into_iter().skip(1).collect();
                        first_hop
                    }
                }
            };
            let down = self.motes[at].parent().is_none();
            let mut info = rpi.or_else(|| self.motes[at].rpi(down))?;
            let next = self.index(next)?;
            if !self.unicast(at, next) {
                return None;
            }
            let is_routed = !hops.is_empty();
            let (now, dice) = (self.now, &mut self.dice[next]);
            let from = mote(at as u32);
            match self.motes[next].handle_data(&mut info, from, destination, is_routed, now, dice) {
                ForwardingDecision::Forward => {}
                ForwardingDecision::Return(back) => returns = Some(back),
                ForwardingDecision::Drop(_) => return None,
            }
            rpi = Some(info);
            at = next;
            if let Some(back) = returns {
                let back = self.index(back)?;
                let (now, dice) = (self.now, &mut self.dice[back]);
                let from = mote(at as u32);
                let _ =
                    self.motes[back].handle_data(&mut info, from, destination, false, now, dice);
                return None;
            }
        }
        None
    }

    fn send(&mut self, from: usize) {
        while let Some(out) = self.motes[from].poll_transmit() {
            let at = self.now + DELAY;
            if out.destination == ALL_RPL_NODES {
                for to in (0..self.motes.len()).filter(|&to| to != from) {
                    if self.pdr[from][to] != 0.0 && self.hears(from, to) {
                        let source = mote(from as u32).link_local();
                        self.flying.push_back((at, from, to, source, out.message.clone(), true));
                    }
                }
                continue;
            }
            let is_local = out.destination.is_unicast_link_local();
            let (to, last, source) = if is_local {
                let to = self.index(Eui64::of_ip(out.destination));
                let arrives = to.is_some_and(|to| self.unicast(from, to));
                (to.filter(|_| arrives), Some(from), mote(from as u32).link_local())
            } else {
                let source = mote(from as u32).global();
                (self.carry(from, out.destination), None, source)
            };
            if let Some(to) = to {
                // Over several hops only the source matters.
                let last = last.unwrap_or(from);
                self.flying.push_back((at, last, to, source, out.message, false));
            }
        }
        while self.motes[from].poll_event().is_some() {}
    }

    fn run(&mut self, duration: SimDuration) {
        let end = self.now + duration;
        for i in 0..self.motes.len() {
            self.send(i);
        }
        loop {
            let timer = (0..self.motes.len())
                .filter(|&i| self.alive[i])
                .filter_map(|i| self.motes[i].poll_timeout().map(|at| (at, i)))
                .min();
            let flight = self.flying.front().map(|flight| flight.0);
            let timer_at = timer.map(|(at, _)| at);
            let Some(at) = [flight, timer_at].into_iter().flatten().min() else { break };
            if end < at {
                break;
            }
            self.now = self.now.max(at);
            if flight.is_some_and(|flight| timer_at.is_none_or(|timer| flight <= timer)) {
                let Some((_, from, to, source, message, multicast)) = self.flying.pop_front()
                else {
                    break;
                };
                if self.alive[to] {
                    let (now, dice) = (self.now, &mut self.dice[to]);
                    let from = mote(from as u32);
                    self.motes[to].handle_message(from, source, multicast, &message, now, dice);
                    self.send(to);
                }
            } else if let Some((_, i)) = timer {
                self.motes[i].handle_timeout(self.now, &mut self.dice[i]);
                self.send(i);
            }
        }
        self.now = end;
    }

    /// Every mote sends a datagram to its root now and then, for links to be measured and loops to be found.
    fn run_with_traffic(&mut self, duration: SimDuration, period: SimDuration) {
        let end = self.now + duration;
        while self.now < end {
            self.run(period.min(end - self.now));
            for i in 0..self.motes.len() {
                if self.alive[i]
                    && let Some(root) = self.motes[i].dodag_id()
                {
                    self.carry(i, root);
                    self.send(i);
                }
            }
        }
    }

    fn kill(&mut self, i: usize) {
        self.alive[i] = false;
        self.motes[i].stop();
        self.send(i);
    }

    /// Motes in the circle that parents form, if there is one.
    fn has_loop(&self) -> bool {
        (0..self.motes.len()).any(|first| {
            let mut seen = BTreeSet::new();
            let mut at = Some(first);
            while let Some(i) = at {
                if !seen.insert(i) {
                    return true;
                }
                at = self.motes[i].parent().and_then(|parent| self.index(parent));
            }
            false
        })
    }

    /// Whether a moment comes, within 30 minutes, in which all is well: no circle, and each of `motes` in the DODAG and
    /// with a route at the root that works. Links lose messages, so that a mote may be about to change its parent at any
    /// one moment.
    fn settles(&mut self, motes: &[usize]) -> bool {
        (0..90).any(|_| {
            let is_well = !self.has_loop() && motes.iter().all(|&i| self.is_reached(i));
            if !is_well {
                self.run_with_traffic(MINUTE / 3, MINUTE / 3);
            }
            is_well
        })
    }

    fn is_reached(&mut self, i: usize) -> bool {
        let target = mote(i as u32).global();
        self.motes[i].is_in_dodag()
            && self.motes[0].route(target).is_some()
            && (0..3).any(|_| self.carry(0, target) == Some(i))
    }

    /// Alive motes that are connected to a root over links that can be used.
    fn reachable(&self, roots: usize, least_pdr: f64) -> Vec<usize> {
        let mut seen: BTreeSet<usize> = (0..roots).filter(|&i| self.alive[i]).collect();
        let mut edge: Vec<usize> = seen.iter().copied().collect();
        while let Some(i) = edge.pop() {
            for j in 0..self.motes.len() {
                if self.alive[j] && least_pdr <= self.pdr[i][j] && seen.insert(j) {
                    edge.push(j);
                }
            }
        }
        seen.into_iter().collect()
    }
}

/// Links of a line with some shortcuts: everybody is connected over good links.
fn links(n: usize, extra: &[(usize, usize)], good: f64, extra_pdr: f64) -> Vec<Vec<f64>> {
    let mut pdr = vec![vec![0.0; n]; n];
    let mut set = |i: usize, j: usize, value: f64| {
        if i != j && pdr[i][j] == 0.0 {
            pdr[i][j] = value;
            pdr[j][i] = value;
        }
    };
    for i in 1..n {
        set(i / 2, i, good);
        set(i - 1, i, good);
    }
    for &(i, j) in extra {
        set(i % n, j % n, extra_pdr);
    }
    pdr
}

const MINUTE: SimDuration = SimDuration::from_s(60);

fn quick(mode: Mode, objective: Objective) -> Config {
    Config {
        mode,
        objective,
        // Sixteen hops over good links, and more while they are being measured.
        max_rank_increase: 16384,
        dio_interval_min: 12,
        dio_interval_doublings: 6,
        forget: 120 * SimDuration::SECOND,
        ..Config::default()
    }
}

#[test]
fn a_line_of_perfect_links_forms_and_every_route_resolves() {
    for mode in [Mode::NonStoring, Mode::Storing] {
        let mut pdr = vec![vec![0.0; 6]; 6];
        for i in 1..6 {
            (pdr[i - 1][i], pdr[i][i - 1]) = (1.0, 1.0);
        }
        let mut network = Network::new(&quick(mode, Objective::mrhof()), 1, pdr, 3);
        network.run_with_traffic(20 * MINUTE, 10 * SimDuration::SECOND);
        for i in 1..6 {
            assert_eq!(network.motes[i].parent(), Some(mote(i as u32 - 1)), "{mode:?}");
            assert_eq!(network.motes[i].rank(), 256 * (i as u16 + 1), "{mode:?}");
            assert_eq!(network.carry(0, mote(i as u32).global()), Some(i), "{mode:?}");
            let children: Vec<Eui64> = network.motes[i - 1].children().collect();
            assert_eq!(children, [mote(i as u32)], "{mode:?}");
        }
        assert_eq!(network.motes[0].routes().len(), 5);
        // Peer to peer: by the root, or by the common router.
        assert_eq!(network.carry(5, mote(2).global()), Some(2), "{mode:?}");
    }
}

#[test]
fn several_roots_share_the_motes_by_rank_and_a_lost_root_gives_its_to_the_other() {
    // 0 - 2 - 3 - 4 - 5 - 1: two roots, 0 and 1, at the ends of a line.
    let mut pdr = vec![vec![0.0; 6]; 6];
    for (i, j) in [(0, 2), (2, 3), (3, 4), (4, 5), (5, 1)] {
        (pdr[i][j], pdr[j][i]) = (1.0, 1.0);
    }
    let config = quick(Mode::NonStoring, Objective::mrhof());
    let mut network = Network::new(&config, 2, pdr, 5);
    network.run_with_traffic(30 * MINUTE, 10 * SimDuration::SECOND);
    let root_of = |network: &Network, i: usize| network.motes[i].dodag_id();
    assert_eq!(root_of(&network, 2), Some(mote(0).global()));
    assert_eq!(root_of(&network, 5), Some(mote(1).global()));
    network.kill(1);
    network.run_with_traffic(60 * MINUTE, 10 * SimDuration::SECOND);
    for i in 2..6 {
        assert_eq!(root_of(&network, i), Some(mote(0).global()), "{i}");
        assert_eq!(network.carry(0, mote(i as u32).global()), Some(i), "{i}");
    }
}

#[test]
fn global_repair_moves_everyone_to_the_new_version() {
    let pdr = links(9, &[], 1.0, 0.0);
    let mut network = Network::new(&quick(Mode::Storing, Objective::of0()), 1, pdr, 8);
    network.run_with_traffic(20 * MINUTE, 20 * SimDuration::SECOND);
    let before = network.motes[0].version();
    network.motes[0].global_repair(network.now, &mut network.dice[0]);
    network.run_with_traffic(10 * MINUTE, 20 * SimDuration::SECOND);
    let versions: BTreeSet<Option<u8>> = network.motes.iter().map(Rpl::version).collect();
    assert_eq!(versions.len(), 1);
    assert_ne!(versions.first().copied().flatten(), before);
    assert!(!network.has_loop());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, max_shrink_iters: 40, ..ProptestConfig::default() })]
    #[test]
    fn everyone_finds_a_parent_loops_do_not_last_and_routes_resolve(
        seed: u64,
        n in 4usize..14,
        extra in proptest::collection::vec((0usize..14, 0usize..14), 0..12),
        storing: bool,
        of0: bool,
        dead in 1usize..14,
    ) {
        let mode = if storing { Mode::Storing } else { Mode::NonStoring };
        let objective = if of0 { Objective::of0() } else { Objective::mrhof() };
        let pdr = links(n, &extra, 0.95, 0.4);
        let mut network = Network::new(&quick(mode, objective), 1, pdr, seed);
        network.run_with_traffic(40 * MINUTE, 20 * SimDuration::SECOND);
        let all: Vec<usize> = (1..n).collect();
        prop_assert!(network.settles(&all));
        // One dies. Those who depended on it find another way, if there is one over good links.
        network.kill(1 + dead % (n - 1));
        network.run_with_traffic(40 * MINUTE, 20 * SimDuration::SECOND);
        let connected = network.reachable(1, 0.9);
        prop_assert!(network.settles(&connected[1..]));
        // Nobody believes in the dead one.
        for i in 1..n {
            if let Some(parent) = network.motes[i].parent() {
                let parent = network.index(parent).unwrap();
                prop_assert!(network.alive[parent]);
            }
        }
    }
}
