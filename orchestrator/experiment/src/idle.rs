//! Keys of an experiment that are written and have no influence.

use netsim::catalogue::Catalogue;
use netsim::config::idle::{Surroundings, channels, idle};
use netsim::config::profile::Motes;
use proto::config::{IdleKey, Node, Value};
use proto::side::Setup;

/// Those of `[netsim]`, as written. `motes`: those of the robots, if they are known; `keeps_heights`: these keep the heights at which
/// they begin.
pub(super) fn of_network(
    written: &Node,
    setup: &Setup,
    motes: Option<&Motes>,
    keeps_heights: bool,
) -> Vec<IdleKey> {
    let around = Surroundings {
        path: &setup.path,
        site: &setup.site,
        agent_count: setup.experiment.agent_count,
        positions_m: motes.map(|motes| &motes.positions_m[..]),
        keeps_heights,
    };
    idle(written, around, Catalogue::built_in())
}

/// Those of `[[timeline]]`: noise on channels that the network of this effective section does not use.
pub(super) fn of_timeline(tree: &Node, network: &toml::Table) -> Vec<IdleKey> {
    let used = channels(network, Catalogue::built_in());
    let Some(Value::List(entries)) = tree.get("timeline").map(|node| &node.value) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    for (index, entry) in entries.iter().enumerate() {
        let Some(Value::List(jammed)) = entry.get("channels").map(|node| &node.value) else {
            continue;
        };
        let is_used = |node: &Node| match node.value {
            Value::Integer(channel) => used.iter().any(|&it| i64::from(it) == channel),
            _ => false,
        };
        if used.is_empty() || jammed.iter().any(is_used) {
            continue;
        }
        let key = format!("timeline[{index}].channels");
        let mut sorted = used.clone();
        sorted.sort_unstable();
        sorted.dedup();
        let sorted: Vec<String> = sorted.iter().map(u8::to_string).collect();
        let warning = format!(
            "{key} has no influence: the network sends on none of these channels; choose some of netsim.hopping_sequence: {}",
            sorted.join(", ")
        );
        found.push(IdleKey { key, warning });
    }
    found
}
