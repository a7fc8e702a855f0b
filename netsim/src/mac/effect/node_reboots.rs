//! Motes that begin anew.

use super::{Burden, Effect, Entry, MOTES, Motes, Node, concerns};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "node-reboots"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "node-reboots",
        doc: "Motes reboot at random times: they lose their state and rejoin the network.",
        fields: &[
            Field {
                key: "mean_interval_s",
                doc: "Mean time between reboots of a mote (s).",
                kind: Kind::Number(Range::closed(1.0, 1e9)),
                default: Default::Required,
            },
            Field { doc: "Numbers of the affected motes. Absent: all except the roots.", ..MOTES },
        ],
    },
    about: About {
        mechanism: "A watchdog fires, a contact is loose, or the battery voltage drops under a pulse. The mote loses its \
                    queue, routes, cells and synchronisation, and must rejoin the network. Motes that routed through it \
                    need another route.",
        equation: "times between the reboots of a mote: exponential with mean mean_interval_s; several effects: rates add up",
        source: "G. Barrenetxea et al., The hitchhiker's guide to successful wireless sensor network deployments, SenSys \
                 2008; a constant rate is the simplest law and an assumption of this model.",
        validity: "Reboots are independent of each other, of load and of time. Booting takes no time, because rejoining \
                   takes far longer.",
        trace: "Periods without packets of one mote, followed by a join; losses of motes that route through it.",
        needs: &[Need::Packets],
        example: "mean_interval_s = 3600.0\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "mean_interval_s",
            unit: "s",
            min: 1.0,
            max: 1e9,
            starts: &[600.0, 1800.0, 7200.0],
            step: 10.0,
        }],
        variants: &[],
        level: Level::Run,
        generalises: &[],
        ..Fit::PLAIN
    },
    needs_kept_time: false,
    build: |table| Some(Box::new(typed::<NodeReboots>(table))),
};

/// Motes that begin anew.
///
/// # Model
///
/// ```text
/// T ~ Exp(1/m)        P(T > t) = e^(−t/m)
/// ```
///
/// T is the time from one reboot of a mote to the next. Of several effects that concern a mote the rates 1/m are added. A constant rate
/// is the simplest law, and an assumption; that deployed motes reboot: Barrenetxea et al., "The hitchhiker's guide to successful
/// wireless sensor network deployments", SenSys 2008.
///
/// # Arguments
///
/// * `mean_interval_s` m: mean time between two reboots of a mote (s), at least 1.
/// * `motes`: the motes that reboot; absent: all but the roots.
///
/// # Validity
///
/// Reboots are independent of each other, of load and of time: motes that share a supply, or reboot when they are busy, are
/// not described. Booting takes no time; finding the network takes far longer. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct NodeReboots {
    /// Mean time between reboots of a mote (s).
    pub mean_interval_s: f64,
    /// Which; none: all but the roots.
    pub motes: Motes,
}

impl Effect for NodeReboots {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn weigh(&self, node: Node, burden: &mut Burden) {
        if concerns(&self.motes, node.mote) && (self.motes.is_some() || !node.is_root) {
            burden.reboots_per_s += 1.0 / self.mean_interval_s;
        }
    }
}
