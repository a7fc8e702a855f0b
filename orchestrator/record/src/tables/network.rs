//! What the network says of itself, as rows: packets, motes, schedules, and who has heard whom.

use super::{PacketCells, Tables};
use crate::RecordError;
use crate::table::Cell;
use metrics::kpi::PacketAccount;
use metrics::period::Period;
use proto::types::{Bitmap, EVERYONE, MoteStates, Statistic};

impl Tables {
    /// Adds what the network's reply brought.
    pub(super) fn network(
        &mut self,
        period: &Period<'_>,
        account: &PacketAccount,
    ) -> Result<(), RecordError> {
        self.packets(period)?;
        let statistics = period.statistics.map(|statistics| &statistics.columns[..]);
        // Without statistics of its own a network is asked for none: then the times are those it would be asked at.
        if statistics.is_some()
            || self.statistics.is_empty()
                && self.output.holds_motes(period.step, period.from_ns, period.time_ns)
        {
            let statistics = statistics.unwrap_or_default();
            self.motes(period.step, period.time_ns, period.motes, statistics, account)?;
        }
        self.cells(period)?;
        self.heard_links(period)?;
        self.frames(period)
    }

    fn packets(&mut self, period: &Period<'_>) -> Result<(), RecordError> {
        let (Some(table), Some(packets)) = (&mut self.packets, period.packets) else {
            return Ok(());
        };
        for i in 0..packets.len() {
            let destination = Some(packets.destination[i]).filter(|&mote| mote != EVERYONE);
            table.push([
                Cell::U64(period.step),
                Cell::U64(packets.id[i]),
                Cell::Text(&packets.kinds[packets.kind[i] as usize].name),
                Cell::U32(packets.source[i]),
                Cell::or_null(destination, Cell::U32),
                Cell::U64(packets.created_ns[i]),
                Cell::U64(packets.ended_ns[i]),
                Cell::U32(packets.hops[i]),
                Cell::U32(packets.payload_bytes[i]),
                Cell::Bool(packets.outcome[i] == 0),
                packets.drop_reason(i).map_or(Cell::Null, Cell::Text),
            ])?;
        }
        Ok(())
    }

    /// Adds a row for each mote. Statistics that are missing are null.
    pub(super) fn motes(
        &mut self,
        step: u64,
        time_ns: u64,
        motes: &MoteStates,
        statistics: &[Statistic],
        account: &PacketAccount,
    ) -> Result<(), RecordError> {
        self.told.resize(motes.alive.len(), PacketCells::default());
        let Some(table) = &mut self.motes else { return Ok(()) };
        let flag = |bitmap: &Option<Bitmap>, mote| {
            Cell::or_null(bitmap.as_ref().map(|bitmap| bitmap.get(mote)), Cell::Bool)
        };
        let number = |column: &[u32], mote: usize| column.get(mote).copied();
        let columns: Vec<Option<&Statistic>> = self
            .statistics
            .iter()
            .map(|name| statistics.iter().find(|column| column.name == *name))
            .collect();
        for mote in 0..motes.alive.len() {
            let parent = number(&motes.parent, mote).filter(|&parent| parent != u32::MAX);
            let states = [
                Cell::U64(step),
                Cell::U64(time_ns),
                Cell::U32(mote as u32),
                Cell::Bool(motes.alive.get(mote)),
                flag(&motes.synced, mote),
                flag(&motes.joined, mote),
                Cell::or_null(number(&motes.rank, mote), Cell::U32),
                Cell::or_null(parent, Cell::U32),
                Cell::or_null(number(&motes.queue_length, mote), Cell::U32),
            ];
            let counted = columns
                .iter()
                .map(|column| Cell::or_null(column.and_then(|column| column.get(mote)), Cell::F64));
            let packets = self.told[mote].cells(account, mote);
            table.push(states.into_iter().chain(packets).chain(counted))?;
        }
        Ok(())
    }

    fn cells(&mut self, period: &Period<'_>) -> Result<(), RecordError> {
        let (Some(table), Some(cells)) = (&mut self.schedule, period.schedule) else {
            return Ok(());
        };
        for i in 0..cells.len() {
            let option = |bit: u32| Cell::Bool(cells.options[i] & bit != 0);
            let neighbour = Some(cells.neighbour[i]).filter(|&mote| mote != u32::MAX);
            table.push([
                Cell::U64(period.step),
                Cell::U64(period.time_ns),
                Cell::U32(cells.mote[i]),
                Cell::U32(cells.slotframe[i]),
                Cell::U32(cells.slotframe_slots[i]),
                Cell::U32(cells.slot[i]),
                Cell::U32(cells.channel_offset[i]),
                option(1),
                option(2),
                option(4),
                option(8),
                option(16),
                Cell::or_null(neighbour, Cell::U32),
            ])?;
        }
        Ok(())
    }

    fn frames(&mut self, period: &Period<'_>) -> Result<(), RecordError> {
        let (Some(table), Some(frames)) = (&mut self.frames, period.frames) else { return Ok(()) };
        let some = |number: u32| Cell::or_null(Some(number).filter(|&n| n != u32::MAX), Cell::U32);
        for i in 0..frames.len() {
            table.push([
                Cell::U64(period.step),
                Cell::U64(frames.sent_ns[i]),
                Cell::U32(frames.sender[i]),
                some(frames.destination[i]),
                Cell::U32(frames.channel[i]),
                some(frames.channel_offset[i]),
                Cell::Text(&frames.kinds[frames.kind[i] as usize]),
                Cell::U32(frames.length_bytes[i]),
                Cell::or_null(Some(frames.packet[i]).filter(|&packet| packet != 0), Cell::U64),
                Cell::U32(frames.attempt[i]),
                Cell::U32(frames.n_received[i]),
                Cell::U32(frames.n_missed[i]),
                Cell::Text(frames.outcome[i].name()),
            ])?;
        }
        Ok(())
    }

    fn heard_links(&mut self, period: &Period<'_>) -> Result<(), RecordError> {
        let (Some(table), Some(links)) = (&mut self.neighbours, period.heard_links) else {
            return Ok(());
        };
        for i in 0..links.receiver.len() {
            table.push([
                Cell::U64(period.step),
                Cell::U64(period.time_ns),
                Cell::U32(links.receiver[i]),
                Cell::U32(links.sender[i]),
                Cell::U64(links.frames[i]),
                Cell::or_null(links.rssi_dbm.get(i).copied(), Cell::F32),
            ])?;
        }
        Ok(())
    }
}
