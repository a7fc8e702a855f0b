//! `[netsim.swarm]`: how the swarm's payloads travel.

use crate::mote::settings::Transport;
use crate::sf::{self, PayloadCells};
use proto::config::{Choice, Problem, Reason, Section, TableSpec, join};

/// Description of `[netsim.swarm]`.
pub(super) const SPEC: TableSpec = Keys::SPEC;

/// What the checked table is read with.
pub(super) struct Given<'a> {
    /// Its path.
    pub(super) path: &'a str,
    /// The scheduling function; `None`: it is none that is known, which has been said.
    pub(super) function: Option<&'static sf::Entry>,
    /// Capacity of the experiment.
    pub(super) agent_count: usize,
    /// Length of the hopping sequence.
    pub(super) n_channels: usize,
    /// What is wrong.
    pub(super) problems: &'a mut Vec<Problem>,
    /// What should be checked.
    pub(super) warnings: &'a mut Vec<String>,
}

/// How the network transports the robots' payloads.
#[derive(Section)]
struct Keys {
    /// Cells that carry the payloads. Absent: own-cell if the scheduling function gives each mote its own cell, otherwise
    /// broadcast-slotframe.
    transport: Option<Choices>,
    /// Length of the broadcast slotframe (slots). Absent: the number of motes. Motes whose numbers differ by this length share a
    /// slot.
    #[key(range = 1..=65_534)]
    slots: Option<u16>,
    /// Channel offset of its cells. Absent: the last one of the hopping sequence, to avoid collisions with the minimal cell (0) and
    /// with Orchestra's beacons and broadcasts (0, 1).
    #[key(range = 0..=511)]
    channel_offset: Option<u16>,
}

/// The values of `transport`.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
enum Choices {
    /// No payloads are sent: a plain sensor network.
    None,
    /// Broadcast once per period, in each mote's own cell from the scheduling function.
    OwnCell,
    /// Broadcast once per period, in the shared cells, where they collide, as in BotNet under MSF.
    SharedCell,
    /// Unicast once per period to each neighbour, with acknowledgments and retransmissions.
    UnicastNeighbours,
    /// Broadcast once per period, in an additional slotframe in which each mote has its own slot and listens in all others.
    BroadcastSlotframe,
}

/// Makes the transport of the checked table.
pub(super) fn build(table: &toml::Table, given: &mut Given<'_>) -> Transport {
    let keys = Keys::read(table);
    let Some(function) = given.function else { return Transport::None };
    let cells = function.payload_cells;
    let transport = keys.transport.unwrap_or(default_transport(function));
    let mut refuse = |why: &str, nearest: Choices| {
        let path = join(given.path, "transport");
        let message =
            format!("does not apply with sf.kind = {:?}, because {why}", function.variant.name);
        given.problems.push(
            Problem::new(path, message)
                .value(format!("{:?}", transport.name()))
                .nearest(format!("{:?}", nearest.name())),
        );
    };
    if cells == PayloadCells::None && transport != Choices::None {
        refuse("it carries no payloads for everyone", Choices::None);
        return Transport::None;
    }
    let built = match transport {
        Choices::None => Transport::None,
        Choices::OwnCell => {
            if !cells.has_own() {
                refuse("it gives no mote a cell for itself", Choices::BroadcastSlotframe);
            }
            Transport::OwnCell
        }
        Choices::SharedCell => {
            if !cells.has_shared() {
                refuse("every mote has its own cell", Choices::OwnCell);
            }
            Transport::SharedCell
        }
        Choices::UnicastNeighbours => Transport::UnicastNeighbours,
        Choices::BroadcastSlotframe => Transport::BroadcastSlotframe {
            slots: keys.slots.unwrap_or(given.agent_count.min(65_534) as u16),
            channel: keys.channel_offset.unwrap_or(given.n_channels as u16 - 1),
        },
    };
    if let Transport::BroadcastSlotframe { slots, .. } = built {
        let n = given.agent_count;
        if usize::from(slots) < n {
            given.warnings.push(format!(
                "{} = {slots} for {n} motes: several share a slot, and whoever hears two of them receives one at most",
                join(given.path, "slots"),
            ));
        }
    }
    built
}

/// Why keys of the broadcast slotframe have no influence, if there is none. `path`: of the section.
pub(super) fn without_slotframe(
    table: &toml::Table,
    function: Option<&sf::Entry>,
    path: &str,
) -> Option<Reason> {
    let transport = Keys::read(table).transport.unwrap_or(default_transport(function?));
    (transport != Choices::BroadcastSlotframe).then(|| {
        let slotframe = Choices::BroadcastSlotframe.name();
        let transport = transport.name();
        Reason::new(
            format!("transport = {transport:?} has no broadcast slotframe"),
            format!("set {path}.transport = {slotframe:?}, or leave the key out"),
        )
    })
}

/// The transport of a scheduling function, if none is written.
fn default_transport(function: &sf::Entry) -> Choices {
    match function.payload_cells {
        PayloadCells::None => Choices::None,
        PayloadCells::Own | PayloadCells::Either => Choices::OwnCell,
        PayloadCells::Shared => Choices::BroadcastSlotframe,
    }
}
