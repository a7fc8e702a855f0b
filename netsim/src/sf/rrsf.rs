//! One slot for every mote: BotNet's round-robin scheduling function.

use super::{
    Config, Configured, Context, Entry, Formation, MAX_SLOTS, PayloadCells, SchedulingFunction,
    TAG, Traffic,
};
use crate::mac::{Cell, CellKind, CellOptions};
use proto::config::{Problem, Section, join, variant};
use proto::ids::MoteId;
use proto::types::seconds;
use serde::{Deserialize, Serialize};

/// `kind = "rrsf"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("rrsf"),
    payload_cells: PayloadCells::Own,
    build: |table, context| {
        let keys = Keys::read(table);
        let most = usize::from(MAX_SLOTS - keys.shared_slots);
        let before = context.problems.len();
        if most < context.agent_count {
            let message =
                format!("\"rrsf\" has slots for at most {most} motes beside its shared slots");
            let problem = Problem::new(join(context.path, TAG.key), message);
            context.problems.push(problem.value(context.agent_count));
        }
        if context.shared_slot_0 && keys.shared_slots != 0 {
            let key = join(context.path, "shared_slots");
            let message = "must be 0 with compat.shared_slot_0, which reproduces BotNet's schedule";
            context.problems.push(Problem::new(key, message).value(keys.shared_slots).nearest(0));
        }
        (context.problems.len() == before).then_some(Config::new(RrsfConfig {
            n_motes: context.agent_count as u16,
            shared_slots: keys.shared_slots,
            shared_slot_0: context.shared_slot_0,
        }))
    },
};

/// Round robin (BotNet): the slotframe has one slot per mote, in which this mote transmits and all others receive.
#[derive(Section)]
struct Keys {
    /// Number of additional shared slots at the end of the slotframe, in which motes contend with unicast frames; use them if
    /// joining and routing need more than a mote's own slot.
    #[key(range = 0..=10_000, default = 0)]
    shared_slots: u16,
}

/// Handle of the slotframe with the motes' own slots.
pub(crate) const OWN_HANDLE: u8 = 1;
/// Handle of the slotframe, as long, with the shared slots.
pub(crate) const SHARED_HANDLE: u8 = 2;

/// What it takes at least to form (s), if that is longer than experiments wait by default.
const LONG_FORMATION_S: f64 = 3600.0;

/// Who has how many slots.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct RrsfConfig {
    /// Motes: slots that have an owner.
    pub n_motes: u16,
    /// Slots after them that all share.
    pub shared_slots: u16,
    /// Slot 0 is the minimal cell.
    pub shared_slot_0: bool,
}

/// Round robin: mote i transmits in slot i and receives in all others, on channel offset 0.
///
/// Beacons, broadcast frames, and unicast frames to whomever go out in the own slot, without contention. Unicast frames may
/// use shared slots too; beacons and broadcast frames may not, so that what swarms tell each other is never lost to a collision.
///
/// # Cost
///
/// A radio that is never off: in a slotframe of N slots it listens in N − 1 (BotNet has that, too).
///
/// # BotNet's code
///
/// There the minimal cell covers slot 0, so that mote 0, which leads flocks, has no slot of its own and is heard in three
/// quarters of the slotframes. `compat.shared_slot_0` repeats that.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Rrsf {
    config: RrsfConfig,
    mote: u16,
}

impl Configured for RrsfConfig {
    type OfMote = Rrsf;

    fn create(&self, mote: MoteId) -> Rrsf {
        Rrsf::new(self, mote)
    }

    /// Whether the roots' own slots are too few for what they must tell every mote.
    fn advice(&self, network: &Formation<'_>) -> Option<String> {
        let n_frames =
            f64::from(network.frames_per_mote) * network.n_motes as f64 / network.n_roots as f64;
        let slots = self.n_motes + self.shared_slots;
        let slotframe_s = seconds((u64::from(slots) * network.slot).ns());
        let takes_s = n_frames * slotframe_s;
        (self.shared_slots == 0 && LONG_FORMATION_S < takes_s).then(|| {
            format!(
                "{} = {:?} gives a root one frame in {slotframe_s} s: admitting all motes and acknowledging their routes \
                 takes at least {takes_s:.0} s, and most requests stay unanswered; set join.secure = false and rpl.dao_ack = \
                 false",
                join(network.path, TAG.key),
                ENTRY.variant.name,
            )
        })
    }
}

impl Rrsf {
    /// The scheduling function of a mote.
    ///
    /// # Panics
    ///
    /// If there is no slot for the mote.
    #[must_use]
    pub(crate) fn new(config: &RrsfConfig, mote: MoteId) -> Self {
        let slot = u16::try_from(mote.0).ok().filter(|&slot| slot < config.n_motes);
        Self { config: config.clone(), mote: slot.expect("every mote has a slot") }
    }
}

impl SchedulingFunction for Rrsf {
    fn start(&mut self, cx: &mut Context<'_>) {
        let kind = if self.config.shared_slot_0 { CellKind::Normal } else { CellKind::Advertising };
        let own = Cell::new(self.mote, 0, CellOptions::TX, None).of_kind(kind);
        let slots = self.slotframe_slots();
        let schedule = &mut *cx.schedule;
        schedule.add_slotframe(OWN_HANDLE, slots);
        schedule.set_background(OWN_HANDLE, Some(0)).expect("the slotframe was just added");
        if !(self.config.shared_slot_0 && self.mote == 0) {
            schedule.add(OWN_HANDLE, own).expect("every mote has a slot");
        }
        if self.config.shared_slots != 0 {
            let shared: Vec<Cell> = (self.config.n_motes..slots)
                .map(|slot| Cell::new(slot, 0, CellOptions::TX_RX_SHARED, None))
                .collect();
            schedule.add_slotframe(SHARED_HANDLE, slots);
            schedule.add_all(SHARED_HANDLE, &shared).expect("they lie before the end");
        }
    }

    fn stop(&mut self) {}

    fn slotframe_slots(&self) -> u16 {
        self.config.n_motes + self.config.shared_slots
    }

    fn minimal_cell(&self) -> Option<u16> {
        self.config.shared_slot_0.then(|| self.slotframe_slots())
    }

    fn slotframe_of(&self, traffic: Traffic) -> Option<u8> {
        match traffic {
            // BotNet's robots speak in their own slots; the first has none.
            Traffic::Payload if self.config.shared_slot_0 && self.mote != 0 => Some(OWN_HANDLE),
            _ if self.config.shared_slot_0 => None,
            Traffic::Beacon | Traffic::Broadcast | Traffic::Payload => Some(OWN_HANDLE),
            Traffic::Unicast(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Bench, built, read};
    use super::*;
    use crate::wire::Eui64;
    use physics::asn::Asn;

    #[test]
    fn p5_every_slot_schedules_one_mote_to_transmit_and_all_others_to_receive() {
        let config = built("kind = \"rrsf\"", 7);
        let motes: Vec<Bench> = (0..7).map(|mote| Bench::start(&config, MoteId(mote))).collect();
        for slot in 0..7 {
            for (mote, bench) in (0..).zip(&motes) {
                let cells: Vec<_> = bench.schedule.cells_at(Asn(slot)).collect();
                let [at] = cells[..] else { panic!("one cell in every slot") };
                let options = if slot == mote { CellOptions::TX } else { CellOptions::RX };
                assert_eq!(
                    (at.cell.options, at.cell.channel, at.cell.neighbour),
                    (options, 0, None)
                );
            }
        }
    }

    #[test]
    fn mote_0_is_no_exception_and_beacons_are_sent_in_the_own_slot() {
        let config = built("kind = \"rrsf\"", 5);
        let bench = Bench::start(&config, MoteId(0));
        assert_eq!(bench.sf.minimal_cell(), None);
        let own: Vec<_> = bench.schedule.cells().collect();
        assert_eq!((own.len(), own[0].cell.slot, own[0].cell.kind), (1, 0, CellKind::Advertising));
        assert_eq!(bench.sf.slotframe_of(Traffic::Beacon), Some(own[0].handle));
    }

    #[test]
    fn a_radio_listens_in_all_slots_but_one() {
        let config = built("kind = \"rrsf\"", 2500);
        assert_eq!(config.slotframe_slots(), 2500);
        let bench = Bench::start(&config, MoteId(2499));
        assert_eq!(bench.schedule.cells().count(), 1);
        assert_eq!(bench.schedule.n_listening(Asn(25_000)), 24_990);
    }

    #[test]
    fn shared_slots_are_for_unicast_frames_alone() {
        let config = built("kind = \"rrsf\"\nshared_slots = 2", 5);
        let bench = Bench::start(&config, MoteId(4));
        assert_eq!(config.slotframe_slots(), 7);
        let shared =
            bench.schedule.cells().filter(|at| at.cell.options == CellOptions::TX_RX_SHARED);
        let shared: Vec<_> = shared.map(|at| (at.handle, at.cell.slot)).collect();
        assert_eq!(shared, [(SHARED_HANDLE, 5), (SHARED_HANDLE, 6)]);
        assert_eq!(bench.sf.slotframe_of(Traffic::Broadcast), Some(OWN_HANDLE));
        assert_eq!(bench.sf.slotframe_of(Traffic::Unicast(Eui64::of_mote(MoteId(1)))), None);
    }

    #[test]
    fn botnets_shared_cell_covers_the_slot_of_mote_0() {
        let config = built("kind = \"rrsf\" # compat.shared_slot_0", 5);
        for mote in 0..5 {
            let bench = Bench::start(&config, MoteId(mote));
            let first = bench.schedule.cells_at(Asn(0)).next().unwrap();
            assert_eq!((first.handle, first.cell.options), (0, CellOptions::TX_RX_SHARED));
            assert_eq!(bench.schedule.slotframe(0).unwrap().slots(), 5);
            let said = (mote != 0).then_some(OWN_HANDLE);
            assert_eq!(bench.sf.slotframe_of(Traffic::Payload), said);
            assert_eq!(bench.sf.slotframe_of(Traffic::Broadcast), None);
            let own = bench.schedule.slotframe(OWN_HANDLE).unwrap().cells();
            let own: Vec<_> = own.iter().map(|own| (u32::from(own.slot), own.kind)).collect();
            let expected = if mote == 0 { vec![] } else { vec![(mote, CellKind::Normal)] };
            assert_eq!(own, expected);
            assert_eq!(bench.sf.slotframe_of(Traffic::Broadcast), None);
        }
    }

    #[test]
    fn what_has_no_room_is_refused() {
        let (config, problems, _) = read("kind = \"rrsf\"\nshared_slots = 35", 65_500);
        assert!(config.is_none());
        assert_eq!(
            problems,
            [
                "netsim.sf.kind: \"rrsf\" has slots for at most 65499 motes beside its shared slots, got 65500"
            ]
        );
        let text = "kind = \"rrsf\" # compat.shared_slot_0\nshared_slots = 3";
        assert_eq!(
            read(text, 5).1,
            [
                "netsim.sf.shared_slots: must be 0 with compat.shared_slot_0, which reproduces BotNet's schedule, got 3 \
                 (nearest valid: 0)"
            ]
        );
    }
}
