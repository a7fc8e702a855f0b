//! A mote's surroundings, for tests of scheduling functions, in this crate and in others.
//!
//! [`Section`] reads `[netsim.sf]` as a run would, [`Bench`] is one mote with its schedule. Nothing is on the air: whatever
//! happens to the mote is said by [`Bench::tell`].
//!
//! # Examples
//!
//! ```
//! use netsim::catalogue::Catalogue;
//! use netsim::sf::testing::{Bench, Section};
//! use proto::ids::MoteId;
//!
//! // Of an entry of one's own: let mut catalogue = Catalogue::default(); catalogue.scheduling_functions.add(&ENTRY);
//! let section = Section::new("kind = \"minimal\"\nslotframe_slots = 11", 5);
//! let config = section.built(Catalogue::built_in());
//! let mote = Bench::start(&config, MoteId(1));
//! assert_eq!(mote.schedule.slotframe(0).map(|frame| frame.slots()), Some(11));
//! ```

use super::{AnySf, BuildContext, Config, Context, SPEC, TAG, minimal};
use crate::catalogue::Catalogue;
use crate::dice::Dice;
use crate::mac::Schedule;
use crate::sixtop::Sixtop;
use crate::wire::Eui64;
use physics::asn::Asn;
use proto::config::{check, parse};
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::time::SimDuration;

/// Length of a slot of a [`Bench`].
pub(crate) const SLOT: SimDuration = SimDuration::from_ms(10);

/// Channels of a [`Section`] and of a [`Bench`].
pub(crate) const N_CHANNELS: u16 = 16;

/// The text of `[netsim.sf]`, with what it depends on elsewhere in `[netsim]`.
#[derive(Clone, Copy, Debug)]
pub struct Section<'a> {
    /// Its keys, in TOML.
    pub text: &'a str,
    /// Motes of the network; mote 0 is the root.
    pub agent_count: usize,
    /// `netsim.rpl.mode = "storing"`.
    pub stores_routes: bool,
    /// `netsim.compat.shared_slot_0`.
    pub shared_slot_0: bool,
}

/// What a [`Section`] was read as.
#[derive(Debug)]
pub struct Read {
    /// The configuration; `None`: `problems` says why not.
    pub config: Option<Config>,
    /// What is wrong, as users read it.
    pub problems: Vec<String>,
    /// What users should check.
    pub warnings: Vec<String>,
}

impl<'a> Section<'a> {
    /// A section for a network of `agent_count` motes in which only the root stores routes.
    #[must_use]
    pub fn new(text: &'a str, agent_count: usize) -> Self {
        Self { text, agent_count, stores_routes: false, shared_slot_0: false }
    }

    /// The same in a network whose motes store routes.
    #[must_use]
    pub fn storing(self) -> Self {
        Self { stores_routes: true, ..self }
    }

    /// Checks the keys and makes the configuration of the scheduling function that `kind` selects.
    ///
    /// # Panics
    ///
    /// If the text is no TOML.
    #[must_use]
    pub fn read(&self, catalogue: &Catalogue) -> Read {
        let mut problems = Vec::new();
        let node = parse(self.text).unwrap_or_else(|error| panic!("{error:?}: {}", self.text));
        let table = check(&node, "netsim.sf", &SPEC, &catalogue.lists(), &mut problems).table;
        let mut context = BuildContext {
            path: "netsim.sf",
            agent_count: self.agent_count,
            n_channels: N_CHANNELS,
            roots: &[MoteId(0)],
            shared_slot_0: self.shared_slot_0,
            stores_routes: self.stores_routes,
            address: Eui64::of_mote,
            problems,
            warnings: Vec::new(),
        };
        let function = catalogue.scheduling_functions.selected(&table, &TAG);
        let config = function.and_then(|function| (function.build)(&table, &mut context));
        let problems = context.problems.iter().map(ToString::to_string).collect();
        Read { config, problems, warnings: context.warnings }
    }

    /// As [`Section::read`], of a section without any fault.
    ///
    /// # Panics
    ///
    /// If there are problems or warnings.
    #[must_use]
    pub fn built(&self, catalogue: &Catalogue) -> Config {
        let Read { config, problems, warnings } = self.read(catalogue);
        assert_eq!(problems, [""; 0]);
        assert_eq!(warnings, [""; 0]);
        config.expect("what cannot be built has a problem")
    }
}

/// One mote with its schedule, in slots of `SLOT` on `N_CHANNELS` channels.
#[derive(Debug)]
pub struct Bench {
    /// Its address.
    pub own: Eui64,
    /// Its scheduling function.
    pub sf: AnySf,
    /// Its slotframes and cells.
    pub schedule: Schedule,
    /// Its preferred parent. [`Bench::set_parent`] changes it.
    pub parent: Option<Eui64>,
    /// The current slot.
    pub asn: Asn,
    is_root: bool,
    sixtop: Sixtop,
    dice: Dice,
    unusable: Vec<Eui64>,
}

impl Bench {
    /// A mote that has just become synchronised in slot 0; mote 0 is the root.
    #[must_use]
    pub fn start(config: &Config, mote: MoteId) -> Self {
        let mut bench = Self {
            own: Eui64::of_mote(mote),
            sf: config.create(mote),
            schedule: Schedule::new(),
            parent: None,
            asn: Asn(0),
            is_root: mote == MoteId(0),
            sixtop: Sixtop::default(),
            dice: Dice::new(1, Purpose::Scheduling, mote),
            unusable: Vec::new(),
        };
        if let Some(slots) = bench.sf.minimal_cell() {
            minimal::install(&mut bench.schedule, slots);
        }
        bench.tell(|sf, cx| sf.start(cx));
        bench
    }

    /// Calls the scheduling function with the mote's surroundings.
    pub fn tell(&mut self, what: impl FnOnce(&mut AnySf, &mut Context<'_>)) {
        let mut cx = Context {
            own: self.own,
            is_root: self.is_root,
            asn: self.asn,
            now: self.asn * SLOT,
            slot: SLOT,
            n_channels: N_CHANNELS,
            parent: self.parent,
            schedule: &mut self.schedule,
            sixtop: &mut self.sixtop,
            dice: &mut self.dice,
            unusable: &mut self.unusable,
        };
        what(&mut self.sf, &mut cx);
    }

    /// Time goes on to when the scheduling function wants to be called, and it is.
    ///
    /// # Panics
    ///
    /// If it does not want to be called.
    pub fn pass_time(&mut self) {
        let next = self.sf.poll_timeout().expect("it waits for something");
        self.asn = Asn::first_from(next, SLOT);
        self.tell(|sf, cx| sf.handle_timeout(cx));
    }

    /// The preferred parent changes.
    pub fn set_parent(&mut self, parent: Option<Eui64>) {
        let old = std::mem::replace(&mut self.parent, parent);
        self.tell(|sf, cx| sf.handle_parent(cx, old));
    }

    /// The same mote after it was saved and read back: state and schedule as bytes, as a snapshot has them.
    ///
    /// # Panics
    ///
    /// If `config` cannot read what its own scheduling function has saved.
    #[must_use]
    pub fn restored(&self, config: &Config) -> Self {
        let read = "plain data in memory";
        let saved = postcard::to_stdvec(&(&self.sf, &self.schedule, &self.dice)).expect(read);
        let (mut sf, schedule, dice): (AnySf, Schedule, Dice) =
            postcard::from_bytes(&saved).expect(read);
        assert!(sf.resume(config), "the state is not that of this scheduling function");
        let sixtop = self.sixtop.clone();
        Self { sf, schedule, dice, sixtop, unusable: self.unusable.clone(), ..*self }
    }
}

/// Reads a section of a built-in function. A comment in it stands for the key of another section.
#[cfg(test)]
pub(super) fn read(text: &str, agent_count: usize) -> (Option<Config>, Vec<String>, Vec<String>) {
    let section = Section {
        shared_slot_0: text.contains("# compat.shared_slot_0"),
        stores_routes: text.contains("# storing"),
        ..Section::new(text, agent_count)
    };
    let Read { config, problems, warnings } = section.read(Catalogue::built_in());
    (config, problems, warnings)
}

/// As [`read`], of what is valid.
#[cfg(test)]
pub(super) fn built(text: &str, agent_count: usize) -> Config {
    let (config, problems, warnings) = read(text, agent_count);
    assert_eq!(problems, [""; 0]);
    assert_eq!(warnings, [""; 0]);
    config.unwrap()
}
