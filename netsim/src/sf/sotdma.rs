//! Slots that motes take for themselves, no two within two hops the same: for swarms that move.

use super::{Config, Configured, Context, Entry, PayloadCells, SchedulingFunction, Traffic};
use crate::mac::{Cell, CellKind, CellOptions, CellRef};
use crate::wire::Eui64;
use crate::wire::slots::{MAX_SLOTS, SlotSet, SlotsRepr, tag};
use physics::asn::Asn;
use proto::config::{Choice, Problem, Section, join, variant};
use proto::ids::MoteId;
use proto::time::SimTime;
use serde::{Deserialize, Serialize};

/// `kind = "sotdma"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<SotdmaConfig>("sotdma"),
    payload_cells: PayloadCells::Own,
    build: |table, context| {
        let config = SotdmaConfig::read(table);
        if config.slotframe_slots <= config.shared_slots {
            let message = format!(
                "must leave slots for motes: it must be less than sf.slotframe_slots = {}",
                config.slotframe_slots
            );
            let problem = Problem::new(join(context.path, "shared_slots"), message);
            context.problems.push(
                problem.value(config.shared_slots).nearest(config.slotframe_slots.max(2) - 1),
            );
            return None;
        }
        Some(Config::new(config))
    },
};

/// Handle of the slotframe with the slots that motes take.
pub(crate) const OWN_HANDLE: u8 = 1;
/// Handle of the slotframe, as long, with the shared slots.
pub(crate) const SHARED_HANDLE: u8 = 2;

/// Slotframes that a mote listens for before it takes a slot.
const LISTENS_FIRST: u8 = 2;
/// Slotframes within which a neighbour is heard often enough that it should hear this mote as well, and how often that is.
const SETTLED: (u8, u32) = (8, 6);
/// A mote that such a neighbour does not hear checks its slot more often: the mean number of slotframes in between.
const DOUBTFUL_CHECK_SLOTFRAMES: f64 = 4.0;

/// Self-organised TDMA: every mote takes a slot that no mote within two hops uses, detects conflicts from the announcements of
/// neighbours, and then changes its slot. The slotframe length depends on the density, not on the number of motes.
///
/// How slots are shared out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Section)]
pub struct SotdmaConfig {
    /// Length of the slotframe (slots): the shared slots plus more than the maximum number of motes within two hops.
    #[key(range = 2..=MAX_SLOTS, default = 64)]
    pub slotframe_slots: u16,
    /// Number of shared slots at the end of the slotframe, in which motes contend with unicast frames for joining and routing.
    #[key(range = 1..=128, default = 6)]
    pub shared_slots: u16,
    /// In which slots a mote sends unicast frames.
    #[key(default = UnicastSlots::Shared)]
    pub unicast: UnicastSlots,
    /// Mean interval (slotframes) at which a mote listens in its own slot instead of sending, to detect a neighbour that uses the
    /// same slot.
    #[key(range = 2..=10_000, default = 16)]
    pub check_slotframes: u16,
    /// Number of slotframes after which a neighbour that was not heard is forgotten, and its slot free again: few where slotframes
    /// are long and motes move.
    #[key(range = 2..=8, default = 8)]
    pub forget_slotframes: u8,
}

/// In which slots unicast frames go out.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UnicastSlots {
    /// In the shared slots, so they never displace broadcast frames.
    Shared,
    /// In its own slot as well, without contention, alternating with broadcast frames: for networks in which routing and data
    /// matter more than the robots' payloads.
    Own,
}

impl SotdmaConfig {
    /// Slots that motes can take: those before the shared ones.
    fn n_own(&self) -> u16 {
        self.slotframe_slots - self.shared_slots
    }
}

/// A neighbour that has been heard in a slot of its own.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Neighbour {
    address: Eui64,
    /// The slot in which it was heard last.
    slot: u16,
    /// By slotframe, the current one in bit 0: whether it was heard. Who has not been in `forget_slotframes` is forgotten.
    heard: u8,
    /// Slots in which it hears neighbours.
    taken: SlotSet,
}

/// Self-organised slots.
///
/// In its own slot a mote broadcasts, all others listen, on channel offset 0. Each such frame carries an information element
/// ([`SlotsRepr`]) that says in which slots its sender hears a neighbour, and by a tag of eight bits whom. A mote that has
/// nothing else to say sends that alone.
///
/// # Rules
///
/// 1. A mote first listens for two slotframes. Then it takes, at random, one of the slots in which it hears nobody and in which
///    no neighbour does. If there is none, it takes one in which it hears nobody and the fewest neighbours do.
/// 2. Whoever learns that a neighbour hears another mote in its slot gives the slot up and takes another one. Of two motes
///    that a neighbour hears in turn, it announces the one that it heard last: the other one gives way.
/// 3. Two motes that hear each other and have the same slot hear nothing of each other, and may have no neighbour in common.
///    Therefore each now and then listens in its own slot instead of sending, at random, every `check_slotframes` in the
///    mean; and every four, as long as a neighbour that it hears well does not announce it. Who hears another mote in its
///    own slot gives the slot up.
///
/// Where a neighbour hears neither of two motes because their frames collide there, both check their slots (rule 3): as soon as
/// one is silent, the neighbour hears and announces the other (rule 2).
///
/// Unicast frames go out in the shared slots, so that they never displace broadcast frames; or, if so configured, in the
/// own slot as well.
///
/// # Model
///
/// As in LMAC (van Hoesel, Havinga: "A Lightweight Medium Access Protocol (LMAC) for Wireless Sensor Networks", INSS 2004) slots
/// are reused beyond two hops and neighbours announce the ones they hear as bits. What differs is made for motes that move: tags
/// tell who is heard, so that a conflict shows although one of two frames is received, and own slots are checked.
///
/// # Cost
///
/// A radio that is never off, as in the round robin. The element and what sets it off take 11 bytes, one for every 8 slots and one for each tag;
/// where a frame has no room for all tags each gives others, at random, and conflicts are noticed later. A mote sends in
/// (`check_slotframes` − 1) of `check_slotframes` slotframes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sotdma {
    config: SotdmaConfig,
    /// The slot it has taken.
    slot: Option<u16>,
    /// Whether it listens there this time.
    checks: bool,
    /// Whether it has learned that another mote has that slot.
    conflict: bool,
    /// Slotframes for which it has listened, or has had its slot.
    n_slotframes: u8,
    /// When it next decides: when its own slot begins, or the slotframe if it has none.
    next: Option<SimTime>,
    /// Whether a frame is wanted that carries what it announces.
    wants_frame: bool,
    /// By address.
    neighbours: Vec<Neighbour>,
}

impl Configured for SotdmaConfig {
    type OfMote = Sotdma;

    fn create(&self, mote: MoteId) -> Sotdma {
        Sotdma::new(self, mote)
    }
}

impl Sotdma {
    /// The scheduling function of a mote.
    #[must_use]
    pub fn new(config: &SotdmaConfig, _mote: MoteId) -> Self {
        Self {
            config: config.clone(),
            slot: None,
            checks: false,
            conflict: false,
            n_slotframes: 0,
            next: None,
            wants_frame: false,
            neighbours: Vec::new(),
        }
    }

    /// The slot it has taken; `None`: none yet.
    #[must_use]
    pub fn slot(&self) -> Option<u16> {
        self.slot
    }

    fn epoch(&self, asn: Asn) -> u64 {
        asn / u64::from(self.config.slotframe_slots)
    }

    /// Who is heard in a slot: of several, who was heard last.
    fn heard_in(&self, slot: u16) -> Option<&Neighbour> {
        let there = self.neighbours.iter().filter(|neighbour| neighbour.slot == slot);
        there.min_by_key(|neighbour| neighbour.heard.trailing_zeros())
    }

    /// Takes a slot (rule 1), another one than it has.
    fn take(&mut self, cx: &mut Context<'_>) {
        let n_own = self.config.n_own();
        let mut n_hear = [0_u32; MAX_SLOTS as usize];
        for neighbour in &self.neighbours {
            n_hear[usize::from(neighbour.slot)] += u32::from(MAX_SLOTS);
            for slot in neighbour.taken.iter() {
                n_hear[usize::from(slot)] += 1;
            }
        }
        let left = self.slot;
        let candidates = || (0..n_own).filter(|&slot| Some(slot) != left || n_own == 1);
        let fewest = candidates().map(|slot| n_hear[usize::from(slot)]).min();
        let best = || candidates().filter(|&slot| Some(n_hear[usize::from(slot)]) == fewest);
        let choice = cx.dice.below(best().count() as u64) as usize;
        self.slot = best().nth(choice);
        self.checks = false;
        self.conflict = false;
        self.n_slotframes = 0;
    }

    /// The cells that it has now.
    fn install(&self, cx: &mut Context<'_>) {
        cx.schedule.remove_where(OWN_HANDLE, |_| true);
        if let (Some(slot), false) = (self.slot, self.checks) {
            let own = Cell::new(slot, 0, CellOptions::TX, None).of_kind(CellKind::Advertising);
            cx.schedule.add(OWN_HANDLE, own).expect("its slot lies before the end");
        }
    }

    /// Next time its own slot begins, or the slotframe.
    fn wait(&mut self, cx: &Context<'_>) {
        let length = u64::from(self.config.slotframe_slots);
        let from = cx.asn + 1;
        let slot = u64::from(self.slot.unwrap_or(0));
        let asn = from + (slot + length - from % length) % length;
        self.next = Some(asn * cx.slot);
    }

    /// How likely it is to check its slot now (rule 3).
    fn check_probability(&self) -> f64 {
        let own = self.slot.expect("it has a slot");
        let (settled, often) = SETTLED;
        let is_doubtful = settled <= self.n_slotframes
            && self.neighbours.iter().any(|neighbour| {
                often <= neighbour.heard.count_ones() && !neighbour.taken.has(own)
            });
        let ordinary = f64::from(self.config.check_slotframes);
        1.0 / if is_doubtful { DOUBTFUL_CHECK_SLOTFRAMES.min(ordinary) } else { ordinary }
    }
}

impl SchedulingFunction for Sotdma {
    fn start(&mut self, cx: &mut Context<'_>) {
        let slots = self.config.slotframe_slots;
        let schedule = &mut *cx.schedule;
        schedule.add_slotframe(OWN_HANDLE, slots);
        schedule.set_background(OWN_HANDLE, Some(0)).expect("the slotframe was just added");
        let shared: Vec<Cell> = (self.config.n_own()..slots)
            .map(|slot| Cell::new(slot, 0, CellOptions::TX_RX_SHARED, None))
            .collect();
        schedule.add_slotframe(SHARED_HANDLE, slots);
        schedule.add_all(SHARED_HANDLE, &shared).expect("they lie before the end");
        self.wait(cx);
    }

    fn stop(&mut self) {
        *self = Self::new(&self.config, MoteId(0));
    }

    fn slotframe_slots(&self) -> u16 {
        self.config.slotframe_slots
    }

    fn minimal_cell(&self) -> Option<u16> {
        None
    }

    fn slotframe_of(&self, traffic: Traffic) -> Option<u8> {
        match traffic {
            Traffic::Beacon | Traffic::Broadcast | Traffic::Payload => Some(OWN_HANDLE),
            Traffic::Unicast(_) => match self.config.unicast {
                UnicastSlots::Shared => Some(SHARED_HANDLE),
                UnicastSlots::Own => None,
            },
        }
    }

    fn is_ready(&self, _cx: &Context<'_>) -> bool {
        self.slot.is_some()
    }

    fn poll_timeout(&self) -> Option<SimTime> {
        self.next
    }

    fn handle_timeout(&mut self, cx: &mut Context<'_>) {
        for neighbour in &mut self.neighbours {
            neighbour.heard <<= 1;
        }
        let remembered = u8::MAX >> (8 - self.config.forget_slotframes);
        self.neighbours.retain(|neighbour| neighbour.heard & remembered != 0);
        self.n_slotframes = self.n_slotframes.saturating_add(1);
        if self.slot.is_none() {
            if LISTENS_FIRST < self.n_slotframes {
                self.take(cx);
                self.install(cx);
            }
        } else if self.conflict {
            self.take(cx);
            self.install(cx);
        } else {
            let checks = cx.dice.uniform() < self.check_probability();
            // Unicast frames have every other turn.
            let is_turn = match self.config.unicast {
                UnicastSlots::Shared => true,
                UnicastSlots::Own => self.epoch(cx.asn).is_multiple_of(2),
            };
            self.wants_frame = !checks && is_turn;
            if checks != self.checks {
                self.checks = checks;
                self.install(cx);
            }
        }
        self.wait(cx);
    }

    fn poll_announcement(&mut self) -> Option<u8> {
        std::mem::take(&mut self.wants_frame).then_some(OWN_HANDLE)
    }

    fn announcement(&self, own: Eui64, at: &CellRef, asn: Asn) -> Option<SlotsRepr> {
        if at.handle != OWN_HANDLE {
            return None;
        }
        let mut taken = SlotSet::default();
        self.neighbours.iter().for_each(|neighbour| taken.insert(neighbour.slot));
        let epoch = self.epoch(asn);
        let n = taken.len();
        let first = usize::from(tag(own, epoch)) % n.max(1);
        let slots = taken.iter().skip(first).chain(taken.iter().take(first));
        let tags = slots
            .filter_map(|slot| self.heard_in(slot))
            .map(|neighbour| tag(neighbour.address, epoch))
            .collect();
        Some(SlotsRepr { n_slots: self.config.n_own(), taken, first: first as u8, tags })
    }

    fn handle_announcement(
        &mut self,
        cx: &mut Context<'_>,
        at: &CellRef,
        from: Eui64,
        announced: &SlotsRepr,
    ) {
        let slot = at.cell.slot;
        let n_own = self.config.n_own();
        if at.handle != OWN_HANDLE || n_own <= slot || announced.n_slots != n_own {
            return;
        }
        let taken = announced.taken;
        match self.neighbours.binary_search_by_key(&from, |neighbour| neighbour.address) {
            Ok(place) => {
                let known = &mut self.neighbours[place];
                (known.slot, known.taken) = (slot, taken);
                known.heard |= 1;
            }
            Err(place) => {
                self.neighbours.insert(place, Neighbour { address: from, slot, heard: 1, taken });
            }
        }
        if let Some(own) = self.slot {
            let who = announced.tag_in(own);
            self.conflict |=
                own == slot || who.is_some_and(|who| who != tag(cx.own, self.epoch(cx.asn)));
        }
    }
}

#[cfg(test)]
mod tests;
