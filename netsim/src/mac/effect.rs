//! Effects on what motes do in the network, each `[[netsim.mac.effect]]` of the configuration one of them.
//!
//! One file per effect, one list, `BUILT_IN`. An effect that is not configured contributes exactly nothing, and draws nothing.
//! What the radio does with frames is not here: that is [`physics::effect`].

pub mod ack_loss;
pub mod clock_drift;
pub mod duty_cycle_limit;
pub mod node_reboots;
pub mod processing_delay;
pub mod queue_limit;

use proto::config::{
    Problem, Registered, Registry, Section, TableSpec, Tag, Variant, Variants, join, variant,
};
use proto::effect::{About, Catalogued, Fit, Named};
use proto::ids::MoteId;
use proto::time::SimDuration;
use std::fmt::Debug;

/// Impairments of a mote that the protocols do not expect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Burden {
    /// Probability that an acknowledgment it sends is lost, beside what the radio loses.
    pub ack_loss: f64,
    /// Greatest further error of its clock's rate (ppm).
    pub max_drift_ppm: f64,
    /// What limits its airtime.
    pub duty: Option<Duty>,
    /// Reboots per second, on average.
    pub reboots_per_s: f64,
    /// How long it works on a datagram before that is in the queue.
    pub processing: SimDuration,
    /// Frames for which it has room, whatever is configured.
    pub queue_frames: Option<u16>,
}

/// What burdens a mote without effects: nothing.
pub(crate) const NO_BURDEN: Burden = Burden {
    ack_loss: 0.0,
    max_drift_ppm: 0.0,
    duty: None,
    reboots_per_s: 0.0,
    processing: SimDuration::ZERO,
    queue_frames: None,
};

/// A limit of the time on air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Duty {
    /// Fraction of the time for which the mote may transmit, 0 to 1.
    pub fraction: f64,
    /// Length of the window over which the fraction is computed.
    pub window: SimDuration,
}

/// A mote as an effect sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node {
    /// Number of the mote.
    pub mote: MoteId,
    /// Whether it is a root.
    pub is_root: bool,
}

/// One effect. Stateless: it says what it adds to the burden of a mote, and the mote's layers bear that.
pub trait Effect: Named + Send + Sync + Debug {
    /// Adds its part to the burden of a mote.
    fn weigh(&self, node: Node, burden: &mut Burden);
}

/// Description of one `[[netsim.mac.effect]]`.
pub const SPEC: TableSpec = TableSpec {
    doc: "An effect on the behaviour of motes in the network.",
    fields: &[],
    tag: Some(&TAG),
};

/// The key that selects an effect.
pub(crate) const TAG: Tag =
    Tag { key: "kind", doc: "The effect.", default: None, variants: Variants::List(LIST) };

/// An effect that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name and keys.
    pub variant: Variant,
    /// What people should know of it.
    pub about: About,
    /// Which values are tried against measurements.
    pub fit: Fit,
    /// Whether it is about clocks, which must then be kept.
    pub needs_kept_time: bool,
    /// Makes it of its checked table.
    pub build: fn(&toml::Table) -> Option<Box<dyn Effect>>,
}

impl Entry {
    /// The effect of a struct, which has nothing to do with clocks.
    pub const fn of<T: Effect + Catalogued + Section + 'static>() -> Self {
        Self {
            variant: variant::<T>(T::NAME),
            about: T::ABOUT,
            fit: T::FIT,
            needs_kept_time: false,
            build: |table| Some(Box::new(T::read(table))),
        }
    }
}

impl Registered for Entry {
    fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// What descriptions call the list of effects.
pub(crate) const LIST: &str = "netsim.mac.effect";

/// The effects that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[
    ack_loss::ENTRY,
    clock_drift::ENTRY,
    duty_cycle_limit::ENTRY,
    node_reboots::ENTRY,
    processing_delay::ENTRY,
    queue_limit::ENTRY,
];

/// The motes that an effect concerns, whose numbers [`build`] checks.
#[derive(Clone, Debug, PartialEq, Section)]
pub struct Concerned {
    /// Numbers of the affected motes. Absent: all; for node-reboots all except the roots.
    #[key(length = 1..=1_000_000)]
    pub motes: Option<Vec<MoteId>>,
}

impl Concerned {
    /// Whether the effect concerns a mote.
    #[must_use]
    pub fn includes(&self, mote: MoteId) -> bool {
        self.motes.as_ref().is_none_or(|motes| motes.contains(&mote))
    }
}

/// Makes the effects of checked tables, in their order, and adds what is wrong with them together with the rest: they
/// stand at `path[0]`, `path[1]`, …
///
/// * `is_time_kept`: clocks are kept, so that they may drift.
/// * `known`: what effects there are.
pub fn build(
    tables: &[toml::Table],
    path: &str,
    agent_count: usize,
    is_time_kept: bool,
    known: &Registry<Entry>,
    problems: &mut Vec<Problem>,
) -> Vec<Box<dyn Effect>> {
    let mut effects = Vec::with_capacity(tables.len());
    for (index, table) in tables.iter().enumerate() {
        let at = format!("{path}[{index}]");
        let Some(entry) = known.selected(table, &TAG) else { continue };
        let Concerned { motes } = Concerned::read(table);
        let numbers = motes.into_iter().flatten().enumerate();
        for (place, mote) in numbers.filter(|(_, mote)| agent_count <= mote.index()) {
            let last = agent_count as i64 - 1;
            let key = join(&at, &format!("motes[{place}]"));
            let problem = Problem::new(key, format!("must be the number of a mote, 0 to {last}"));
            problems.push(problem.value(mote).nearest(last));
        }
        if entry.needs_kept_time && !is_time_kept {
            let message = "requires keep_alive_s other than 0, because drifting clocks must be resynchronised";
            problems.push(Problem::new(join(&at, TAG.key), message));
        }
        effects.extend((entry.build)(table));
    }
    effects
}

/// What effects together lay on each mote; empty without effects.
#[must_use]
pub(crate) fn burdens(
    effects: &[Box<dyn Effect>],
    agent_count: usize,
    roots: &[MoteId],
) -> Vec<Burden> {
    if effects.is_empty() {
        return Vec::new();
    }
    let burden_of = |mote: MoteId| {
        let node = Node { mote, is_root: roots.contains(&mote) };
        let mut burden = NO_BURDEN;
        effects.iter().for_each(|effect| effect.weigh(node, &mut burden));
        burden
    };
    MoteId::first(agent_count).map(burden_of).collect()
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;

    #[derive(Section)]
    struct All {
        #[key(tables = SPEC)]
        effect: Vec<toml::Table>,
    }

    /// What a table of keys lays on motes 0, a root, and 1 to 3.
    pub(crate) fn laid(tables: &str) -> Vec<Burden> {
        let table: toml::Table = tables.parse().unwrap();
        let text = toml::to_string(&table).unwrap();
        let node = proto::config::parse(&text).unwrap();
        let mut problems = Vec::new();
        let known = Registry::new(BUILT_IN);
        let lists = proto::config::Lists::default().with(LIST, &known);
        let checked = proto::config::check(&node, "", &All::SPEC, &lists, &mut problems).table;
        let effects = build(&All::read(&checked).effect, "effect", 4, true, &known, &mut problems);
        assert!(problems.is_empty(), "{problems:?}");
        burdens(&effects, 4, &[MoteId(0)])
    }
}

#[cfg(test)]
mod tests {
    use super::testing::laid;
    use super::*;

    #[test]
    fn effects_add_up_and_concern_whom_they_name() {
        let laid = laid(
            "[[effect]]\nkind = \"ack-loss\"\nprobability = 0.5\n[[effect]]\nkind = \"ack-loss\"\nprobability = 0.5\n\
             motes = [2]\n[[effect]]\nkind = \"queue-limit\"\nframes = 4\n[[effect]]\nkind = \"queue-limit\"\nframes = 7",
        );
        assert_eq!(laid[1].ack_loss, 0.5);
        assert_eq!(laid[2].ack_loss, 0.75);
        assert!(laid.iter().all(|burden| burden.queue_frames == Some(4)));
        assert!(burdens(&[], 4, &[MoteId(0)]).is_empty());
        assert_eq!(NO_BURDEN, Burden::default());
    }

    #[test]
    fn motes_that_are_none_and_clocks_that_nobody_keeps_are_refused() {
        let tables: toml::Table =
            "[[effect]]\nkind = \"clock-drift\"\nmax_ppm = 50.0\nmotes = [1, 9]".parse().unwrap();
        let mut problems = Vec::new();
        let tables: Vec<toml::Table> = tables["effect"].clone().try_into().unwrap();
        let known = Registry::new(BUILT_IN);
        build(&tables, "mac.effect", 4, false, &known, &mut problems);
        let paths: Vec<&str> = problems.iter().map(|problem| problem.path.as_str()).collect();
        assert_eq!(paths, ["mac.effect[0].motes[1]", "mac.effect[0].kind"]);
    }
}
