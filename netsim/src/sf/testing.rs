//! A mote's surroundings, for tests of scheduling functions.

use super::{AnySf, BuildContext, Config, Context, SPEC, TAG, minimal};
use crate::catalogue::Catalogue;
use crate::dice::Dice;
use crate::mac::Schedule;
use crate::sixtop::Sixtop;
use crate::wire::Eui64;
use proto::config::{check, parse};
use proto::rng::Purpose;

/// Reads `[netsim.sf]` for a network of `agent_count` motes on 16 channels, mote 0 the root.
pub(super) fn read(text: &str, agent_count: usize) -> (Option<Config>, Vec<String>, Vec<String>) {
    let mut problems = Vec::new();
    let catalogue = Catalogue::built_in();
    let node = parse(text).unwrap();
    let table = check(&node, "netsim.sf", &SPEC, &catalogue.lists(), &mut problems).table;
    let mut context = BuildContext {
        path: "netsim.sf",
        agent_count,
        n_channels: 16,
        roots: &[0],
        // A comment in the section stands for the key of another one.
        shared_slot_0: text.contains("# compat.shared_slot_0"),
        address: Eui64::of_mote,
        problems,
        warnings: Vec::new(),
    };
    let function = catalogue.scheduling_functions.selected(&table, &TAG);
    let config = function.and_then(|function| (function.build)(&table, &mut context));
    let problems = context.problems.iter().map(ToString::to_string).collect();
    (config, problems, context.warnings)
}

/// As [`read`], of what is valid.
pub(super) fn built(text: &str, agent_count: usize) -> Config {
    let (config, problems, warnings) = read(text, agent_count);
    assert_eq!(problems, [""; 0]);
    assert_eq!(warnings, [""; 0]);
    config.unwrap()
}

/// One mote with its schedule.
pub(super) struct Bench {
    pub(super) own: Eui64,
    pub(super) sf: AnySf,
    pub(super) schedule: Schedule,
    pub(super) parent: Option<Eui64>,
    pub(super) asn: u64,
    is_root: bool,
    sixtop: Sixtop,
    dice: Dice,
    unusable: Vec<Eui64>,
}

impl Bench {
    /// A mote that has just become synchronised; mote 0 is the root.
    pub(super) fn start(config: &Config, mote: u32) -> Self {
        let mut bench = Self {
            own: Eui64::of_mote(mote),
            sf: config.create(mote),
            schedule: Schedule::new(),
            parent: None,
            asn: 0,
            is_root: mote == 0,
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

    /// Tells the scheduling function something.
    pub(super) fn tell(&mut self, what: impl FnOnce(&mut AnySf, &mut Context<'_>)) {
        let mut cx = Context {
            own: self.own,
            is_root: self.is_root,
            asn: self.asn,
            now_ns: self.asn * 10_000_000,
            slot_ns: 10_000_000,
            n_channels: 16,
            parent: self.parent,
            schedule: &mut self.schedule,
            sixtop: &mut self.sixtop,
            dice: &mut self.dice,
            unusable: &mut self.unusable,
        };
        what(&mut self.sf, &mut cx);
    }

    /// Time goes on to when the scheduling function wants to be called, and it is.
    pub(super) fn pass_time(&mut self) {
        let next_ns = self.sf.poll_timeout().expect("it waits for something");
        self.asn = next_ns.div_ceil(10_000_000);
        self.tell(|sf, cx| sf.handle_timeout(cx));
    }

    /// The preferred parent changes.
    pub(super) fn set_parent(&mut self, parent: Option<Eui64>) {
        let old = std::mem::replace(&mut self.parent, parent);
        self.tell(|sf, cx| sf.handle_parent(cx, old));
    }
}
