//! The tables of a run: their columns, and how a step becomes rows.

mod network;
mod packet_cells;
mod shapes;

pub use shapes::TABLES;

use super::table::{Cell, Table};
use super::{RecordError, RunHeader};
use experiment::output::{Links, OutputConfig};
use input::fingerprint::Fingerprint;
use metrics::counts::was_heard_by;
use metrics::kpi::PacketAccount;
use metrics::period::{Period, distance_m};
use packet_cells::PacketCells;
use proto::rng::{Draws, Purpose, ordered_link};
use proto::types::{AgentStates, MoteStates, NetRecord, Statistic};
use shapes::{FRAMES, LINKS, MOTES, NEIGHBOURS, PACKETS, SCHEDULE, STEPS, TRANSMISSIONS};
use std::path::Path;

/// The tables that a run writes.
pub(crate) struct Tables {
    output: OutputConfig,
    /// Names of the motes' statistics.
    statistics: Vec<String>,
    sample: Draws,
    steps: Option<Table>,
    links: Option<Table>,
    transmissions: Option<Table>,
    packets: Option<Table>,
    motes: Option<Table>,
    schedule: Option<Table>,
    neighbours: Option<Table>,
    frames: Option<Table>,
    /// Each mote's packets as last reported.
    told: Vec<PacketCells>,
}

impl Tables {
    /// Begins the tables that are asked for, of what there is.
    pub(crate) fn create(dir: &Path, header: &RunHeader) -> Result<Self, RecordError> {
        let RunHeader { output, records, seed, .. } = header;
        let table = |wanted: bool, shape| wanted.then(|| Table::create(dir, shape)).transpose();
        let kept = |wanted: bool, record| wanted && records.contains(&record);
        let statistics: Vec<String> =
            header.statistics.iter().map(|(name, _)| name.clone()).collect();
        let motes =
            output.motes.then(|| Table::create_with(dir, &MOTES, &statistics)).transpose()?;
        Ok(Self {
            output: *output,
            statistics,
            sample: Draws::new(*seed, Purpose::RecordSample),
            steps: table(output.steps, &STEPS)?,
            links: table(output.links != Links::None, &LINKS)?,
            transmissions: table(output.transmissions, &TRANSMISSIONS)?,
            packets: table(kept(output.packets, NetRecord::Packets), &PACKETS)?,
            motes,
            schedule: table(kept(output.schedule, NetRecord::Schedule), &SCHEDULE)?,
            neighbours: table(kept(output.neighbours, NetRecord::HeardLinks), &NEIGHBOURS)?,
            frames: table(kept(output.frames, NetRecord::Frames), &FRAMES)?,
            told: Vec::new(),
        })
    }

    /// Adds where everything begins, as step 0.
    pub(crate) fn begin(
        &mut self,
        states: &AgentStates,
        motes: &MoteStates,
        statistics: &[Statistic],
    ) -> Result<(), RecordError> {
        self.agents(0, 0, states, &vec![0; states.len()])?;
        self.motes(0, 0, motes, statistics, &PacketAccount::default())
    }

    /// Adds a step, if it is one of those asked for. `account`: what became of packets, those of this step included.
    pub(crate) fn add(
        &mut self,
        period: &Period<'_>,
        account: &PacketAccount,
    ) -> Result<(), RecordError> {
        self.network(period, account)?;
        if !self.output.includes_step(period.step) {
            return Ok(());
        }
        self.agents(period.step, period.time_ns, period.states, &period.counts.neighbours)?;
        self.transmissions(period)?;
        match self.output.links {
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
        Ok(())
    }

    /// Ends the tables. Returns each one's file, rows and fingerprint.
    pub(crate) fn finish(self) -> Result<Vec<(&'static str, u64, Fingerprint)>, RecordError> {
        let tables = [
            (&STEPS, self.steps),
            (&LINKS, self.links),
            (&TRANSMISSIONS, self.transmissions),
            (&PACKETS, self.packets),
            (&MOTES, self.motes),
            (&SCHEDULE, self.schedule),
            (&NEIGHBOURS, self.neighbours),
            (&FRAMES, self.frames),
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
        let Some(table) = &mut self.transmissions else { return Ok(()) };
        let sent = &period.deliveries.transmissions;
        for (index, &sender) in sent.sender.iter().enumerate() {
            table.push([
                Cell::U64(period.step),
                Cell::U32(sender),
                Cell::U64(sent.sent_ns[index]),
                Cell::U64(sent.end_ns[index]),
                Cell::U32(sent.payloads.length_bytes()[index]),
                Cell::U32(period.counts.receivers[index]),
                Cell::or_null(sent.destination(index), Cell::U32),
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
                let is_heard = was_heard_by(period.deliveries, receiver, index);
                let is_for_it = sent.destination(index).is_none_or(|it| it as usize == receiver);
                let might_hear = is_alive && is_for_it && sender as usize != receiver;
                if might_hear && is_chosen(index, receiver) {
                    table.push(link(period, receiver, index, is_heard.then_some(delivery)))?;
                }
                delivery += usize::from(is_heard);
            }
        }
        Ok(())
    }
}

/// Whether `motes.parquet` has a column of that name whatever statistics there are.
pub fn is_column_of_motes(name: &str) -> bool {
    MOTES.columns.iter().any(|column| column.name == name)
}

/// The row of a link. `delivery` is the place of the delivery in the optional columns, if there was one.
fn link(
    period: &Period<'_>,
    receiver: usize,
    index: usize,
    delivery: Option<usize>,
) -> [Cell<'static>; 10] {
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
