//! The tables of a run: their columns, and how a step becomes rows.

use super::RecordError;
use super::counts::heard;
use super::output::{Links, OutputConfig};
use super::period::{Period, distance_m};
use super::table::{Cell, ColumnKind, ColumnShape, Table, TableShape};
use super::whole::Fingerprint;
use proto::rng::{Draws, Purpose, ordered_link};
use proto::types::{AgentStates, Bitmap, MoteStates};
use std::path::Path;

/// The tables that a run writes.
pub(crate) struct Tables {
    links_choice: Links,
    every_steps: u64,
    sample: Draws,
    steps: Option<Table>,
    links: Option<Table>,
    packets: Option<Table>,
    motes: Option<Table>,
}

impl Tables {
    /// Begins the tables that are asked for.
    pub(crate) fn create(
        dir: &Path,
        output: &OutputConfig,
        seed: u64,
    ) -> Result<Self, RecordError> {
        let table = |wanted: bool, shape| wanted.then(|| Table::create(dir, shape)).transpose();
        Ok(Self {
            links_choice: output.links,
            every_steps: output.every_steps,
            sample: Draws::new(seed, Purpose::RecordSample),
            steps: table(output.steps, &STEPS)?,
            links: table(output.links != Links::None, &LINKS)?,
            packets: table(output.packets, &PACKETS)?,
            motes: table(output.motes, &MOTES)?,
        })
    }

    /// Adds where everything begins, as step 0.
    pub(crate) fn begin(
        &mut self,
        states: &AgentStates,
        motes: &MoteStates,
    ) -> Result<(), RecordError> {
        self.agents(0, 0, states, &vec![0; states.len()])?;
        self.mote_states(0, 0, motes)
    }

    /// Adds a step, if it is one of those asked for.
    pub(crate) fn add(&mut self, period: &Period<'_>) -> Result<(), RecordError> {
        if !period.step.is_multiple_of(self.every_steps) {
            return Ok(());
        }
        self.agents(period.step, period.time_ns, period.states, &period.counts.neighbours)?;
        self.transmissions(period)?;
        match self.links_choice {
            Links::None => {}
            Links::Heard => self.links_heard(period)?,
            Links::All => self.links_chosen(period, |_, _| true)?,
            Links::Sample { fraction } => {
                let (draws, step) = (self.sample, period.step);
                self.links_chosen(period, |index, receiver| {
                    let sender = period.deliveries.transmissions.sender[index];
                    draws.uniform(ordered_link(sender, receiver as u32), step, index as u64)
                        < fraction
                })?;
            }
        }
        self.mote_states(period.step, period.time_ns, period.motes)
    }

    /// Ends the tables. Returns each one's file, rows and fingerprint.
    pub(crate) fn finish(self) -> Result<Vec<(&'static str, u64, Fingerprint)>, RecordError> {
        let tables = [
            (&STEPS, self.steps),
            (&LINKS, self.links),
            (&PACKETS, self.packets),
            (&MOTES, self.motes),
        ];
        let mut finished = Vec::new();
        for (shape, table) in tables {
            if let Some(table) = table {
                let (n_rows, fingerprint) = table.finish()?;
                finished.push((shape.file, n_rows, fingerprint));
            }
        }
        Ok(finished)
    }

    fn agents(
        &mut self,
        step: u64,
        time_ns: u64,
        states: &AgentStates,
        neighbours: &[u32],
    ) -> Result<(), RecordError> {
        let Some(table) = &mut self.steps else { return Ok(()) };
        let optional =
            |column: &[f64], agent: usize| Cell::or_null(column.get(agent).copied(), Cell::F64);
        for (agent, &n_heard) in neighbours.iter().enumerate() {
            let [x_m, y_m, z_m] = states.position_m(agent);
            table.push([
                Cell::U64(step),
                Cell::U64(time_ns),
                Cell::U32(agent as u32),
                Cell::Bool(states.alive.get(agent)),
                Cell::F64(x_m),
                Cell::F64(y_m),
                Cell::F64(z_m),
                optional(&states.vx_mps, agent),
                optional(&states.vy_mps, agent),
                optional(&states.vz_mps, agent),
                optional(&states.heading_rad, agent),
                Cell::U32(n_heard),
            ])?;
        }
        Ok(())
    }

    fn transmissions(&mut self, period: &Period<'_>) -> Result<(), RecordError> {
        let Some(table) = &mut self.packets else { return Ok(()) };
        let sent = &period.deliveries.transmissions;
        for (index, &sender) in sent.sender.iter().enumerate() {
            table.push([
                Cell::U64(period.step),
                Cell::U32(sender),
                Cell::U64(sent.sent_ns[index]),
                Cell::U64(sent.end_ns[index]),
                Cell::U32(sent.payloads.length_bytes()[index]),
                Cell::U32(period.counts.receivers[index]),
            ])?;
        }
        Ok(())
    }

    /// The links over which something was heard, by receiver.
    fn links_heard(&mut self, period: &Period<'_>) -> Result<(), RecordError> {
        let Some(table) = &mut self.links else { return Ok(()) };
        let mut delivery = 0;
        for receiver in 0..period.states.len() {
            for index in period.deliveries.heard_by(receiver) {
                if period.deliveries.transmissions.sender[index] as usize != receiver {
                    table.push(link(period, receiver, index, Some(delivery)))?;
                }
                delivery += 1;
            }
        }
        Ok(())
    }

    /// The links chosen among all between alive agents, heard or not, by receiver.
    fn links_chosen(
        &mut self,
        period: &Period<'_>,
        is_chosen: impl Fn(usize, usize) -> bool,
    ) -> Result<(), RecordError> {
        let Some(table) = &mut self.links else { return Ok(()) };
        let sent = &period.deliveries.transmissions;
        let mut delivery = 0;
        for receiver in 0..period.states.len() {
            let is_alive = period.states_on_air.alive.get(receiver);
            for (index, &sender) in sent.sender.iter().enumerate() {
                let is_heard = heard(period.deliveries, receiver, index);
                if is_alive && sender as usize != receiver && is_chosen(index, receiver) {
                    table.push(link(period, receiver, index, is_heard.then_some(delivery)))?;
                }
                delivery += usize::from(is_heard);
            }
        }
        Ok(())
    }

    fn mote_states(
        &mut self,
        step: u64,
        time_ns: u64,
        motes: &MoteStates,
    ) -> Result<(), RecordError> {
        let Some(table) = &mut self.motes else { return Ok(()) };
        let flag = |bitmap: &Option<Bitmap>, mote| {
            Cell::or_null(bitmap.as_ref().map(|bitmap| bitmap.get(mote)), Cell::Bool)
        };
        let number = |column: &[u32], mote: usize| column.get(mote).copied();
        for mote in 0..motes.alive.len() {
            table.push([
                Cell::U64(step),
                Cell::U64(time_ns),
                Cell::U32(mote as u32),
                Cell::Bool(motes.alive.get(mote)),
                flag(&motes.synced, mote),
                flag(&motes.joined, mote),
                Cell::or_null(number(&motes.rank, mote), Cell::U32),
                Cell::or_null(
                    number(&motes.parent, mote).filter(|&parent| parent != u32::MAX),
                    Cell::U32,
                ),
                Cell::or_null(number(&motes.queue_length, mote), Cell::U32),
            ])?;
        }
        Ok(())
    }
}

/// The row of a link. `delivery` is the place of the delivery in the optional columns, if there was one.
fn link(period: &Period<'_>, receiver: usize, index: usize, delivery: Option<usize>) -> [Cell; 10] {
    let deliveries = period.deliveries;
    let sent = &deliveries.transmissions;
    let sender = sent.sender[index];
    let received_ns = delivery.map(|delivery| {
        deliveries.received_ns.get(delivery).copied().unwrap_or(sent.end_ns[index])
    });
    let hops = delivery.map(|delivery| deliveries.hops.get(delivery).copied().unwrap_or(1));
    let rssi_dbm = delivery.and_then(|delivery| deliveries.rssi_dbm.get(delivery).copied());
    [
        Cell::U64(period.step),
        Cell::U64(period.time_ns),
        Cell::U32(sender),
        Cell::U32(receiver as u32),
        Cell::U64(sent.sent_ns[index]),
        Cell::F64(distance_m(period.states_on_air, sender as usize, receiver)),
        Cell::Bool(delivery.is_some()),
        Cell::or_null(received_ns, Cell::U64),
        Cell::or_null(rssi_dbm, Cell::F32),
        Cell::or_null(hops, Cell::U32),
    ]
}

/// The shapes of all tables.
pub const TABLES: [&TableShape; 4] = [&STEPS, &LINKS, &PACKETS, &MOTES];

const STEP: ColumnShape =
    never_null("step", ColumnKind::U64, "The step, from 1; 0 is where the run begins.");
const TIME: ColumnShape =
    never_null("time_ns", ColumnKind::U64, "Simulated time at the end of the step (ns).");
const NOT_KNOWN: &str = "the robot simulator does not report it";
const NO_SUCH_STATE: &str = "the network has no such state";
const NOT_RECEIVED: &str = "not received";

const STEPS: TableShape = TableShape {
    file: "steps.parquet",
    row: "An agent at the end of a step, alive or not, and at the beginning (step 0).",
    columns: &[
        STEP,
        TIME,
        never_null("agent", ColumnKind::U32, "The agent, from 0."),
        never_null("alive", ColumnKind::Bool, "It exists. Where false, the row says nothing else."),
        never_null("x_m", ColumnKind::F64, "Position, east (m)."),
        never_null("y_m", ColumnKind::F64, "Position, north (m)."),
        never_null("z_m", ColumnKind::F64, "Position, up (m)."),
        nullable("vx_mps", ColumnKind::F64, NOT_KNOWN, "Velocity over the step, east (m/s)."),
        nullable("vy_mps", ColumnKind::F64, NOT_KNOWN, "Velocity over the step, north (m/s)."),
        nullable("vz_mps", ColumnKind::F64, NOT_KNOWN, "Velocity over the step, up (m/s)."),
        nullable(
            "heading_rad",
            ColumnKind::F64,
            "bodies have no direction",
            "Direction the body faces (rad, from +x towards +y).",
        ),
        never_null(
            "n_heard",
            ColumnKind::U32,
            "How many other agents it heard in the step's period, each counted once.",
        ),
    ],
};

const LINKS: TableShape = TableShape {
    file: "links.parquet",
    row: "A transmission and an alive agent that might hear it: those chosen by `output.links`.",
    columns: &[
        STEP,
        TIME,
        never_null("sender", ColumnKind::U32, "The agent that sent."),
        never_null("receiver", ColumnKind::U32, "The agent that might hear it."),
        never_null("sent_ns", ColumnKind::U64, "When the first bit was sent (ns)."),
        never_null(
            "distance_m",
            ColumnKind::F64,
            "Between the two where the network took them to be during the period (m).",
        ),
        never_null("received", ColumnKind::Bool, "It was delivered."),
        nullable("received_ns", ColumnKind::U64, NOT_RECEIVED, "When it was delivered (ns)."),
        nullable(
            "rssi_dbm",
            ColumnKind::F32,
            "not received, or the network does not report it",
            "Received signal strength (dBm).",
        ),
        nullable("hops", ColumnKind::U32, NOT_RECEIVED, "Hops it took."),
    ],
};

const PACKETS: TableShape = TableShape {
    file: "packets.parquet",
    row: "A transmission.",
    columns: &[
        never_null("step", ColumnKind::U64, "The step in whose period it was sent, from 1."),
        never_null("sender", ColumnKind::U32, "The agent that sent it."),
        never_null("sent_ns", ColumnKind::U64, "When its first bit was sent (ns)."),
        never_null("end_ns", ColumnKind::U64, "When its last bit had arrived (ns)."),
        never_null("payload_bytes", ColumnKind::U32, "Length of its payload (bytes)."),
        never_null("n_receivers", ColumnKind::U32, "How many other agents received it."),
    ],
};

const MOTES: TableShape = TableShape {
    file: "motes.parquet",
    row: "A mote at the end of a step, and at the beginning (step 0). Mote i is the radio of agent i.",
    columns: &[
        STEP,
        TIME,
        never_null("mote", ColumnKind::U32, "The mote, from 0."),
        never_null("alive", ColumnKind::Bool, "Its radio works."),
        nullable("synced", ColumnKind::Bool, NO_SUCH_STATE, "Synchronised to the network."),
        nullable("joined", ColumnKind::Bool, NO_SUCH_STATE, "Joined the network."),
        nullable("rank", ColumnKind::U32, NO_SUCH_STATE, "Routing rank (RFC 6550)."),
        nullable(
            "parent",
            ColumnKind::U32,
            "the mote has none, or the network has no such state",
            "Preferred parent, a mote.",
        ),
        nullable("queue_length", ColumnKind::U32, NO_SUCH_STATE, "Packets waiting."),
    ],
};

const fn never_null(name: &'static str, kind: ColumnKind, doc: &'static str) -> ColumnShape {
    ColumnShape { name, kind, null_when: "", doc }
}

const fn nullable(
    name: &'static str,
    kind: ColumnKind,
    null_when: &'static str,
    doc: &'static str,
) -> ColumnShape {
    ColumnShape { name, kind, null_when, doc }
}
