//! Keys of an experiment that are written and have no influence.

use netsim::catalogue::Catalogue;
use netsim::config::idle::{Surroundings, idle};
use netsim::config::profile::Motes;
use proto::config::{IdleKey, Node};
use proto::side::Setup;

/// Those of `[netsim]`, as written. `motes`: those of the robots, if they are known.
pub(super) fn of_network(written: &Node, setup: &Setup, motes: Option<&Motes>) -> Vec<IdleKey> {
    let around = Surroundings {
        path: &setup.path,
        site: &setup.site,
        agent_count: setup.experiment.agent_count,
        positions_m: motes.map(|motes| &motes.positions_m[..]),
    };
    idle(written, around, Catalogue::built_in())
}
