//! Motes that begin anew.

use super::{Burden, Effect, Entry, Node};
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need};
use proto::ids::MoteId;

/// `kind = "node-reboots"`.
pub const ENTRY: Entry = Entry::of::<NodeReboots>();

/// Motes reboot at random times: they lose their state and rejoin the network.
///
/// # Mechanism
///
/// A watchdog fires, a contact is loose, or the battery voltage drops under a pulse. The mote loses its queue, routes, cells and
/// synchronisation, and must rejoin the network. Motes that routed through it need another route.
///
/// # Equation
///
/// ```text
/// times between the reboots of a mote: exponential with mean mean_interval_s; several effects: rates add up
/// ```
///
/// # Source
///
/// G. Barrenetxea et al., The hitchhiker's guide to successful wireless sensor network deployments, SenSys 2008; a constant rate is
/// the simplest law and an assumption of this model.
///
/// # Validity
///
/// Reboots are independent of each other, of load and of time. Booting takes no time, because rejoining takes far longer.
///
/// # Trace
///
/// Periods without packets of one mote, followed by a join; losses of motes that route through it.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "node-reboots",
    needs = &[Need::Packets],
    example = "mean_interval_s = 3600.0\n",
    level = Level::Run,
)]
pub(crate) struct NodeReboots {
    /// Mean time between reboots of a mote (s).
    #[key(range = 1.0..=1e9)]
    #[fit(unit = "s", starts = [600.0, 1800.0, 7200.0], step = 10.0)]
    pub mean_interval_s: f64,
    /// Numbers of the affected motes. Absent: all except the roots.
    #[key(length = 1..=1_000_000)]
    pub motes: Option<Vec<MoteId>>,
}

impl Effect for NodeReboots {
    fn weigh(&self, node: Node, burden: &mut Burden) {
        if self.motes.as_ref().map_or(!node.is_root, |motes| motes.contains(&node.mote)) {
            burden.reboots_per_s += 1.0 / self.mean_interval_s;
        }
    }
}
