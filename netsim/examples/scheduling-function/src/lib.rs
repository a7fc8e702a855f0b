//! A scheduling function of one's own: every mote listens in one cell, which wanders from slotframe to slotframe.

use netsim::mac::{Cell, CellOptions};
use netsim::physics::asn::Asn;
use netsim::sf::{
    BuildContext, Config, Configured, Context, Entry, PayloadCells, SchedulingFunction, Traffic,
    minimal,
};
use netsim::wire::Eui64;
use proto::config::{Problem, Section, join, variant};
use proto::ids::MoteId;
use proto::time::SimTime;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// `kind = "wandering-receiver"`.
pub static ENTRY: Entry = Entry {
    variant: variant::<WanderingConfig>("wandering-receiver"),
    payload_cells: PayloadCells::Shared,
    build,
};

fn build(table: &toml::Table, context: &mut BuildContext<'_>) -> Option<Config> {
    let config = WanderingConfig::read(table);
    if config.slotframe_slots == config.minimal_slots {
        let key = join(context.path, "slotframe_slots");
        let message = "must differ from minimal_slots, or some cells would always coincide with the minimal cell";
        let problem = Problem::new(key, message).value(config.slotframe_slots);
        context.problems.push(problem.nearest(config.slotframe_slots + 1));
        return None;
    }
    Some(Config::new(config))
}

/// Every mote listens in one cell, which its address and the number of the slotframe determine.
#[derive(Clone, Debug, PartialEq, Eq, Section, Serialize, Deserialize)]
pub struct WanderingConfig {
    /// Length of the slotframe with these cells (slots).
    #[key(range = 2..=1000, default = 17)]
    pub slotframe_slots: u16,
    /// Length of the slotframe with the minimal cell (slots).
    #[key(range = 2..=1000, default = 31)]
    pub minimal_slots: u16,
}

impl WanderingConfig {
    /// Slot and channel offset in which a mote listens in the slotframe that contains the slot `asn`.
    pub fn cell_of(&self, mote: Eui64, asn: Asn, n_channels: u16) -> (u16, u16) {
        let number = asn / u64::from(self.slotframe_slots);
        let mixed = (mote.0 ^ number.rotate_left(32)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let slot = (mixed >> 48) % u64::from(self.slotframe_slots);
        let channel = (mixed >> 32) % u64::from(n_channels);
        (slot as u16, channel as u16)
    }
}

impl Configured for WanderingConfig {
    type OfMote = Wandering;

    fn create(&self, _mote: MoteId) -> Wandering {
        Wandering { config: self.clone(), waiting: BTreeSet::new(), next: None }
    }
}

/// The handle of its slotframe. Slotframe 0 is that of the minimal cell.
const HANDLE: u8 = 1;

/// The scheduling function of one mote. All of its state is here, so that a snapshot has it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Wandering {
    config: WanderingConfig,
    /// Neighbours for whom frames wait.
    waiting: BTreeSet<Eui64>,
    /// When the next slotframe begins.
    next: Option<SimTime>,
}

impl Wandering {
    /// The cells of the slotframe that contains the current slot.
    fn install(&mut self, cx: &mut Context<'_>) {
        let cell = |mote, options, neighbour| {
            let (slot, channel) = self.config.cell_of(mote, cx.asn, cx.n_channels);
            Cell::new(slot, channel, options, neighbour)
        };
        let mut cells = vec![cell(cx.own, CellOptions::RX, None)];
        cells.extend(self.waiting.iter().map(|&to| cell(to, CellOptions::TX_SHARED, Some(to))));
        cx.schedule.remove_where(HANDLE, |_| true);
        cx.schedule.add_all(HANDLE, &cells).expect("slots are taken modulo the length");
        let length = u64::from(self.config.slotframe_slots);
        self.next = Some(Asn((cx.asn / length + 1) * length) * cx.slot);
    }
}

impl SchedulingFunction for Wandering {
    fn start(&mut self, cx: &mut Context<'_>) {
        cx.schedule.add_slotframe(HANDLE, self.config.slotframe_slots);
        self.install(cx);
    }

    fn stop(&mut self) {
        self.waiting.clear();
        self.next = None;
    }

    #[expect(clippy::misnamed_getters, reason = "the slotframe of the minimal cell")]
    fn slotframe_slots(&self) -> u16 {
        self.config.minimal_slots
    }

    fn minimal_cell(&self) -> Option<u16> {
        Some(self.config.minimal_slots)
    }

    fn handle_queue(&mut self, cx: &mut Context<'_>, neighbour: Eui64, waits: bool) {
        if waits {
            self.waiting.insert(neighbour);
        } else {
            self.waiting.remove(&neighbour);
        }
        self.install(cx);
    }

    fn poll_timeout(&self) -> Option<SimTime> {
        self.next
    }

    fn handle_timeout(&mut self, cx: &mut Context<'_>) {
        self.install(cx);
    }

    fn slotframe_of(&self, traffic: Traffic) -> Option<u8> {
        match traffic {
            Traffic::Unicast(_) => Some(HANDLE),
            Traffic::Beacon | Traffic::Broadcast | Traffic::Payload => Some(minimal::HANDLE),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use netsim::catalogue::Catalogue;
    use netsim::sf::testing::{Bench, Section as Keys};

    fn catalogue() -> Catalogue {
        let mut catalogue = Catalogue::default();
        catalogue.scheduling_functions.add(&ENTRY);
        catalogue
    }

    fn config() -> Config {
        Keys::new("kind = \"wandering-receiver\"", 9).built(&catalogue())
    }

    #[test]
    fn in_every_slotframe_a_frame_goes_where_its_receiver_listens() {
        let (mut from, mut to) =
            (Bench::start(&config(), MoteId(3)), Bench::start(&config(), MoteId(5)));
        let receiver = to.own;
        from.tell(|sf, cx| sf.handle_queue(cx, receiver, true));
        let mut places = BTreeSet::new();
        for _ in 0..100 {
            let frame = from.schedule.slotframe(HANDLE).expect("it has a slotframe");
            let sent = *frame.tx_cells().next().expect("a frame waits");
            let at = frame.next_asn(sent.slot, from.asn);
            let heard = to.schedule.listens(at).expect("it listens there").cell;
            // Slotframe 0 takes precedence where the minimal cell is.
            assert!(at % 31 == 0 || (heard.slot, heard.channel) == (sent.slot, sent.channel));
            places.insert((sent.slot, sent.channel));
            from.pass_time();
            to.pass_time();
        }
        assert!(50 < places.len(), "it wanders: {}", places.len());
    }

    #[test]
    fn a_restored_mote_goes_on_as_if_nothing_had_happened() {
        let mut mote = Bench::start(&config(), MoteId(3));
        mote.tell(|sf, cx| sf.handle_queue(cx, Eui64::of_mote(MoteId(5)), true));
        let mut restored = mote.restored(&config());
        for _ in 0..20 {
            mote.pass_time();
            restored.pass_time();
            assert_eq!((&restored.sf, &restored.schedule), (&mote.sf, &mote.schedule));
        }
    }

    #[test]
    fn equal_lengths_are_refused_with_the_nearest_valid_choice() {
        let text = "kind = \"wandering-receiver\"\nslotframe_slots = 31";
        assert_eq!(
            Keys::new(text, 9).read(&catalogue()).problems,
            [
                "netsim.sf.slotframe_slots: must differ from minimal_slots, or some cells would always coincide with the \
              minimal cell, got 31 (nearest valid: 32)"
            ]
        );
    }
}
