//! MSF, the minimal scheduling function of 6TiSCH: RFC 9033.
//!
//! | module | what | section |
//! |---|---|---|
//! | `config` | constants, `[netsim.sf]` | § 14 |
//! | `cells` | autonomous and negotiated cells, candidates | § 3, § 8 |
//! | [`hash`] | where autonomous cells lie | § 3, appendix A |
//! | `initiate` | requests to the parent, errors | § 4.6, § 5, § 12 |
//! | [`policy`] | what functions that negotiate like MSF decide otherwise | |
//! | `respond` | requests of others | § 8 |
//! | `usage` | used and elapsed cells | § 5.1 |

mod cells;
mod config;
pub mod hash;
mod initiate;
pub mod policy;
mod respond;
mod usage;

#[cfg(test)]
pub(super) mod tests;

use super::{Configured, Context, SchedulingFunction, Traffic};
use crate::mac::{Cell, CellOptions, CellRef};
use crate::sixtop::Event;
use crate::timer::earliest;
use crate::wire::Eui64;
use crate::wire::datagram::code_points;
use crate::wire::sixp::{SixpCell, SixpRequest};
use cells::Cells;
pub(super) use config::read;
pub use config::{ENTRY, MsfConfig};
use policy::{Policy, Rfc9033};
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use usage::Usage;

/// Scheduling function identifier (§ 7): what [`crate::sixtop::Config::sfid`] must be.
pub const SFID: u8 = 0;
/// Handle of the slotframe with the minimal cell (§ 2).
pub(crate) const MINIMAL: u8 = 0;
/// Handle of the slotframe with autonomous cells (§ 2).
pub const AUTONOMOUS: u8 = 1;
/// Handle of the slotframe with negotiated cells (§ 2).
pub const NEGOTIATED: u8 = 2;

/// Frames after which a cell's delivery ratio counts for something: its counters have been halved once (§ 5.3, MAX_NUMTX).
const SIGNIFICANT_FRAMES: u32 = 256;

/// MSF of one mote.
///
/// Cells with the parent are asked for; cells with children are granted. Whatever is to be asked is remembered here and sent
/// one after the other, as 6P allows one transaction with a neighbour at a time. `P` decides how many cells, and where.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Msf<P = Rfc9033> {
    config: MsfConfig,
    policy: P,
    parent: Option<Eui64>,
    tx: Box<Usage>,
    rx: Box<Usage>,
    /// Without negotiated cells to receive from the parent, the autonomous one counts (§ 5.1).
    receives_autonomously: bool,
    /// When the first of both is to be judged.
    due: Option<SimTime>,
    /// Cells to be added.
    missing: Cells,
    /// Cells to be deleted.
    spare: Cells,
    /// Cells to be moved.
    to_relocate: Vec<SixpCell>,
    /// Frames sent in each negotiated cell to the parent.
    n_sent: BTreeMap<SixpCell, u32>,
    /// Former parents, cleared once the new one has given as many cells (§ 5.2).
    former: Vec<Eui64>,
    /// Neighbours that must receive CLEAR, and how often that has failed.
    clears: BTreeMap<Eui64, u8>,
    /// Requests to the parent that failed in a row.
    n_failures: u8,
    /// Until when nothing is asked.
    hold_until: Option<SimTime>,
    /// Neighbours left alone, and until when.
    quarantined: BTreeMap<Eui64, SimTime>,
    housekeeping: Option<SimTime>,
    /// When neighbours with cells were last heard in one.
    heard: BTreeMap<Eui64, SimTime>,
    /// Neighbours for whom frames wait.
    waiting: BTreeSet<Eui64>,
    n_full: u64,
}

impl Configured for MsfConfig {
    type OfMote = Msf;

    fn create(&self, mote: MoteId) -> Msf {
        Msf::new(self, mote)
    }

    fn has_dedicated_cells(&self) -> bool {
        true
    }
}

impl Msf {
    /// The scheduling function of a mote.
    #[must_use]
    pub fn new(config: &MsfConfig, _mote: MoteId) -> Self {
        Self::with_policy(config, Rfc9033)
    }
}

impl<P: Policy> Msf<P> {
    /// The scheduling function of a mote, with a policy other than the standard's.
    #[must_use]
    pub(crate) fn with_policy(config: &MsfConfig, policy: P) -> Self {
        Self {
            config: config.clone(),
            policy,
            parent: None,
            tx: Box::default(),
            rx: Box::default(),
            receives_autonomously: false,
            due: None,
            missing: Cells::default(),
            spare: Cells::default(),
            to_relocate: Vec::new(),
            n_sent: BTreeMap::new(),
            former: Vec::new(),
            clears: BTreeMap::new(),
            n_failures: 0,
            hold_until: None,
            quarantined: BTreeMap::new(),
            housekeeping: None,
            heard: BTreeMap::new(),
            waiting: BTreeSet::new(),
            n_full: 0,
        }
    }

    /// Whether frames from a neighbour are to be dropped (§ 12).
    #[must_use]
    pub(crate) fn is_quarantined(&self, neighbour: Eui64) -> bool {
        self.quarantined.contains_key(&neighbour)
    }

    /// NumCellsUsed, of the cells to the parent and of those from it (RFC 9033, § 5.1).
    #[must_use]
    pub fn cells_used(&self) -> [u64; 2] {
        [self.tx.used(), self.rx.used()]
    }

    /// How often a cell could not be asked for because no slot was free.
    #[must_use]
    pub fn n_full(&self) -> u64 {
        self.n_full
    }

    /// When use is to be judged next, as time.
    fn find_due(&mut self, cx: &Context<'_>) {
        let first = [self.tx.due_asn(), self.rx.due_asn()].into_iter().flatten().min();
        self.due = first.map(|asn| cx.now + asn.saturating_since(cx.asn) * cx.slot);
    }

    /// § 5.1, step 2.
    fn adapt(&mut self, cx: &mut Context<'_>) {
        let Some(parent) = self.parent else { return };
        let most = self.config.max_num_cells;
        // Wishes of last time that could not be sent yet are not repeated.
        let is_settled = self.missing == Cells::default() && !cx.sixtop.is_busy(parent);
        let own = cells::count(cx.schedule, parent);
        if self.tx.due_asn().is_some_and(|asn| asn <= cx.asn) {
            let used = self.tx.used();
            self.tx.restart(cx.asn, most);
            if is_settled {
                (self.missing.tx, self.spare.tx) = self.policy.judge(&self.config, used, own.tx, 1);
            }
        }
        if self.rx.due_asn().is_some_and(|asn| asn <= cx.asn) {
            let used = self.rx.used();
            self.rx.restart(cx.asn, most);
            if is_settled {
                (self.missing.rx, self.spare.rx) = self.policy.judge(&self.config, used, own.rx, 0);
            }
        }
        self.find_due(cx);
    }

    /// § 5.3, and cells of neighbours that have gone (§ 5.1).
    fn keep_house(&mut self, cx: &mut Context<'_>) {
        let silent = seconds(self.config.cleanup_s);
        let gone: Vec<Eui64> = self
            .heard
            .iter()
            .filter(|&(peer, heard)| {
                Some(*peer) != self.parent && silent <= cx.now.saturating_since(*heard)
            })
            .map(|(&peer, _)| peer)
            .collect();
        for peer in gone {
            if cells::negotiated(cx.schedule, peer).next().is_some() {
                self.clear(cx, peer);
            }
            self.heard.remove(&peer);
        }
        let Some(parent) = self.parent else { return };
        let is_significant = |cell: &&Cell| {
            cell.options == CellOptions::TX
                && self.n_sent.get(&cells::place(cell)).is_some_and(|&n| SIGNIFICANT_FRAMES <= n)
                && cell.num_tx != 0
        };
        let judged: Vec<&Cell> =
            cells::negotiated(cx.schedule, parent).filter(is_significant).collect();
        let ratio = |cell: &Cell| (u64::from(cell.num_tx_ack), u64::from(cell.num_tx));
        let best =
            judged.iter().map(|cell| ratio(cell)).max_by(|a, b| (a.0 * b.1).cmp(&(b.0 * a.1)));
        let Some((best_ack, best_tx)) = best else { return };
        let limit = u64::from(self.config.relocate_pdr_percent);
        self.to_relocate = judged
            .iter()
            .filter(|cell| {
                // best − own > limit, times both numbers of frames.
                let (ack, tx) = ratio(cell);
                (best_ack * tx).saturating_sub(ack * best_tx) * 100 > limit * best_tx * tx
            })
            .map(|cell| cells::place(cell))
            .collect();
    }
}

impl<P: Policy> SchedulingFunction for Msf<P> {
    fn start(&mut self, cx: &mut Context<'_>) {
        let slots = self.config.slotframe_slots;
        cx.schedule.add_slotframe(AUTONOMOUS, slots);
        cx.schedule.add_slotframe(NEGOTIATED, slots);
        let (slot, channel) = hash::autonomous_cell(cx.own, slots, cx.n_channels);
        let own = Cell::new(slot, channel, CellOptions::RX, None);
        cx.schedule.add(AUTONOMOUS, own).expect("autonomous cells lie within the slotframe");
        self.housekeeping = Some(cx.now + seconds(self.config.housekeeping_s));
        self.handle_parent(cx, None);
    }

    fn stop(&mut self) {
        *self = Self::with_policy(&self.config, self.policy.clone());
    }

    fn slotframe_slots(&self) -> u16 {
        self.config.slotframe_slots
    }

    fn minimal_cell(&self) -> Option<u16> {
        // § 2: all three as long as each other.
        Some(self.config.slotframe_slots)
    }

    fn quarantine_ends(&self, neighbour: Eui64) -> Option<SimTime> {
        self.quarantined.get(&neighbour).copied()
    }

    fn handle_parent(&mut self, cx: &mut Context<'_>, _old: Option<Eui64>) {
        let new = cx.parent.filter(|_| !cx.is_root);
        let had = match self.parent {
            Some(old) if new == Some(old) => return,
            Some(old) => {
                let had = cells::count(cx.schedule, old);
                let is_involved = had != Cells::default() || cx.sixtop.is_busy(old);
                if is_involved && !self.clears.contains_key(&old) {
                    self.former.push(old);
                }
                had
            }
            None => Cells::default(),
        };
        let had = Cells { tx: had.tx + self.missing.tx, rx: had.rx + self.missing.rx };
        self.parent = new;
        self.missing = Cells::default();
        self.spare = Cells::default();
        self.to_relocate.clear();
        self.n_sent.clear();
        self.n_failures = 0;
        self.hold_until = None;
        match new {
            Some(new) => {
                self.former.retain(|former| *former != new);
                let own = cells::count(cx.schedule, new);
                self.missing.tx = had.tx.max(1).saturating_sub(own.tx);
                self.missing.rx = had.rx.saturating_sub(own.rx);
                if self.is_quarantined(new) {
                    cx.unusable.push(new);
                }
                // § 5.3: counters of cells begin anew.
                let kept: Vec<Cell> = cells::negotiated(cx.schedule, new).copied().collect();
                if !kept.is_empty() {
                    cx.schedule.remove_where(NEGOTIATED, |cell| cell.neighbour == Some(new));
                    for cell in kept {
                        cells::install(cx.schedule, new, cell.options, &[cells::place(&cell)]);
                    }
                }
            }
            None => {
                for old in std::mem::take(&mut self.former) {
                    self.clear(cx, old);
                }
            }
        }
        let most = self.config.max_num_cells;
        self.refresh(cx);
        self.tx.restart(cx.asn, most);
        self.rx.restart(cx.asn, most);
        self.find_due(cx);
        self.drive(cx);
    }

    fn handle_queue(&mut self, cx: &mut Context<'_>, neighbour: Eui64, waits: bool) {
        if waits {
            self.waiting.insert(neighbour);
        } else {
            self.waiting.remove(&neighbour);
        }
        self.update_autonomous_tx(cx, neighbour);
    }

    fn handle_event(&mut self, cx: &mut Context<'_>, event: Event) {
        match event {
            Event::Request { peer, request } => self.answer(cx, peer, &request),
            Event::Answered { peer, request, answer, .. } => {
                self.handle_answer(cx, peer, &request, &answer);
            }
            Event::Completed { peer, request, response, .. } => {
                self.carry_out(cx, peer, &request, &response);
            }
            Event::Failed { peer, request, is_initiator: true, why } => {
                self.handle_failure(cx, peer, &request, why);
            }
            Event::Inconsistent { peer } => {
                // § 13. A CLEAR that is on its way settles it.
                let is_settled =
                    matches!(cx.sixtop.open_request(peer), Some(SixpRequest::Clear { .. }));
                if !is_settled {
                    self.clear(cx, peer);
                }
            }
            // Three steps are not used (§ 8); what others began and did not end leaves nothing behind.
            Event::Confirmed { .. } | Event::Failed { is_initiator: false, .. } => {}
        }
        self.drive(cx);
    }

    fn handle_transmitted(
        &mut self,
        cx: &mut Context<'_>,
        at: &CellRef,
        acknowledged: Option<bool>,
        dscp: u8,
    ) {
        let Some(neighbour) = at.cell.neighbour.filter(|_| at.handle == NEGOTIATED) else { return };
        if acknowledged == Some(true) {
            self.heard.insert(neighbour, cx.now);
        }
        if self.parent == Some(neighbour) && at.cell.options == CellOptions::TX {
            if calls_for_cells(dscp) {
                self.tx.count_used();
            }
            *self.n_sent.entry(cells::place(&at.cell)).or_default() += 1;
        }
    }

    fn handle_received(&mut self, cx: &mut Context<'_>, at: &CellRef, from: Eui64, dscp: u8) {
        let is_negotiated = at.handle == NEGOTIATED && at.cell.neighbour == Some(from);
        if is_negotiated {
            self.heard.insert(from, cx.now);
        }
        let is_autonomous = at.handle == AUTONOMOUS && self.receives_autonomously;
        if self.parent == Some(from) && (is_negotiated || is_autonomous) && calls_for_cells(dscp) {
            self.rx.count_used();
        }
    }

    fn poll_timeout(&self) -> Option<SimTime> {
        let quarantine = self.quarantined.values().min().copied();
        earliest([self.due, self.hold_until, self.housekeeping, quarantine])
    }

    fn handle_timeout(&mut self, cx: &mut Context<'_>) {
        let now = cx.now;
        let is_due = |at: Option<SimTime>| at.is_some_and(|at| at <= now);
        self.quarantined.retain(|_, until| now < *until);
        if is_due(self.hold_until) {
            self.hold_until = None;
        }
        if is_due(self.due) {
            self.adapt(cx);
        }
        if is_due(self.housekeeping) {
            self.housekeeping = Some(now + seconds(self.config.housekeeping_s));
            self.keep_house(cx);
        }
        self.drive(cx);
    }

    fn is_ready(&self, cx: &Context<'_>) -> bool {
        let mut to_parent =
            self.parent.iter().flat_map(|&parent| cells::negotiated_tx(cx.schedule, parent));
        cx.is_root || to_parent.any(|cell| cell.options == CellOptions::TX)
    }

    fn slotframe_of(&self, traffic: Traffic) -> Option<u8> {
        match traffic {
            // § 2.
            Traffic::Beacon | Traffic::Broadcast | Traffic::Payload => Some(MINIMAL),
            Traffic::Unicast(_) => None,
        }
    }
}

/// Whether frames of a class are a reason for more cells. Requests of motes that are not admitted yet are none, or anyone
/// could have a network exhaust itself (RFC 9031, § 6.1.1; RFC 9033, § 17, counts them and leaves limits to the proxies).
fn calls_for_cells(dscp: u8) -> bool {
    dscp != code_points::AF43
}

fn seconds(duration_s: u32) -> SimDuration {
    SimDuration::from_s(duration_s.into())
}
