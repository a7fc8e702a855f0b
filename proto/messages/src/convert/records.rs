//! Records of the network, from messages to values and back.

use super::{InvalidField, NUMBER, Result, bitmap, is_number};
use crate::v1;
use bytes::Bytes;
use proto::types::{
    Formation, FrameOutcome, Frames, HeardLinks, MoteStatistics, PacketKind, Packets, Schedule,
    Statistic, is_statistic_name,
};

/// Formation from a message.
///
/// # Errors
///
/// Motes or reasons that do not exist, motes that do not ascend, columns of unequal length, missing motes of a network
/// that has formed.
pub fn formation(message: Option<v1::Formation>, n_motes: usize) -> Result<Option<Formation>> {
    let Some(message) = message else { return Ok(None) };
    let invalid =
        |field: &str, reason: String| Err(InvalidField::new(format!("formation.{field}"), reason));
    let v1::Formation { formed, formed_ns, missing, reason, reasons } = message;
    if reason.len() != missing.len() {
        let n = missing.len();
        return invalid(
            "reason",
            format!("must have {n} entries, as missing, got {}", reason.len()),
        );
    }
    if formed && !missing.is_empty() {
        return invalid("missing", "must be empty once the network has formed".to_owned());
    }
    if missing.windows(2).any(|pair| pair[1] <= pair[0])
        || missing.last().is_some_and(|&mote| n_motes <= mote as usize)
    {
        return invalid("missing", format!("must ascend and be less than {n_motes}"));
    }
    if let Some(index) = reason.iter().find(|&&index| reasons.len() <= index as usize) {
        return invalid("reason", format!("must be less than {}, got {index}", reasons.len()));
    }
    Ok(Some(Formation { formed_ns: formed.then_some(formed_ns), missing, reason, reasons }))
}

/// Packets from a message.
///
/// # Errors
///
/// Columns of unequal length, motes, kinds or reasons that do not exist, packets out of order or that end before they
/// were created, names that are not unique.
pub fn packets(message: Option<v1::Packets>, n_motes: usize) -> Result<Option<Packets>> {
    let Some(message) = message else { return Ok(None) };
    packets_of(message, n_motes).map(Some).map_err(|invalid| invalid.within("packets"))
}

fn packets_of(message: v1::Packets, n_motes: usize) -> Result<Packets> {
    let n = message.id.len();
    same_length(
        n,
        "id",
        &[
            ("kind", message.kind.len()),
            ("source", message.source.len()),
            ("destination", message.destination.len()),
            ("created_ns", message.created_ns.len()),
            ("ended_ns", message.ended_ns.len()),
            ("hops", message.hops.len()),
            ("payload_bytes", message.payload_bytes.len()),
            ("outcome", message.outcome.len()),
        ],
    )?;
    motes_exist("source", &message.source, n_motes, false)?;
    motes_exist("destination", &message.destination, n_motes, true)?;
    unique("kinds", message.kinds.iter().map(|kind| kind.name.as_str()))?;
    unique("reasons", message.reasons.iter().map(String::as_str))?;
    less_than("kind", &message.kind, message.kinds.len())?;
    less_than("outcome", &message.outcome, message.reasons.len() + 1)?;
    let order = |i: usize| (message.ended_ns[i], message.id[i]);
    if let Some(i) = (1..n).find(|&i| order(i) <= order(i - 1)) {
        let reason = format!("must be in the order (ended_ns, id); entry {i} is not");
        return Err(InvalidField::new("id", reason));
    }
    if let Some(i) = (0..n).find(|&i| message.ended_ns[i] < message.created_ns[i]) {
        let reason = format!("must not be before created_ns; entry {i} is");
        return Err(InvalidField::new("ended_ns", reason));
    }
    Ok(Packets {
        id: message.id,
        kind: message.kind,
        source: message.source,
        destination: message.destination,
        created_ns: message.created_ns,
        ended_ns: message.ended_ns,
        hops: message.hops,
        payload_bytes: message.payload_bytes,
        outcome: message.outcome,
        kinds: message
            .kinds
            .into_iter()
            .map(|v1::PacketKind { name, is_application, created }| PacketKind {
                name,
                is_application,
                created,
            })
            .collect(),
        reasons: message.reasons,
    })
}

/// Statistics from a message.
///
/// # Errors
///
/// Names that are no names or not unique, columns of the wrong length, numbers that are not finite.
pub fn statistics(
    message: Option<v1::MoteStatistics>,
    n_motes: usize,
) -> Result<Option<MoteStatistics>> {
    let Some(message) = message else { return Ok(None) };
    unique("statistics.columns", message.columns.iter().map(|column| column.name.as_str()))?;
    let mut columns = Vec::with_capacity(message.columns.len());
    for (index, v1::Statistic { name, unit, values, known }) in
        message.columns.into_iter().enumerate()
    {
        let field = |name: &str| format!("statistics.columns[{index}].{name}");
        if !is_statistic_name(&name) {
            let reason = "must be at most 64 lower-case letters, digits and underscores, starting with a letter";
            return Err(InvalidField::new(field("name"), format!("{reason}, got {name:?}")));
        }
        if values.len() != n_motes {
            let reason = format!("must have {n_motes} entries, one per mote, got {}", values.len());
            return Err(InvalidField::new(field("values"), reason));
        }
        // Nanoseconds of years and sums of charge exceed what positions may be, not what sums of squares can bear.
        if let Some(value) = values.iter().find(|value| !is_statistic(**value)) {
            let reason = format!("must be finite and at most 1e18 in magnitude, got {value}");
            return Err(InvalidField::new(field("values"), reason));
        }
        let known =
            if known.is_empty() { None } else { Some(bitmap(&field("known"), &known, n_motes)?) };
        columns.push(Statistic { name, unit, values, known });
    }
    Ok(Some(MoteStatistics { columns }))
}

/// Greatest magnitude of a statistic.
const MAX_STATISTIC: f64 = 1e18;

fn is_statistic(value: f64) -> bool {
    value.abs() <= MAX_STATISTIC
}

/// Schedules from a message.
///
/// # Errors
///
/// Columns of unequal length, motes that do not exist, slots beyond their slotframe, cells out of order.
pub fn schedule(message: Option<v1::Schedule>, n_motes: usize) -> Result<Option<Schedule>> {
    let Some(message) = message else { return Ok(None) };
    schedule_of(message, n_motes).map(Some).map_err(|invalid| invalid.within("schedule"))
}

fn schedule_of(message: v1::Schedule, n_motes: usize) -> Result<Schedule> {
    let v1::Schedule { mote, slotframe, slotframe_slots, slot, channel_offset, options, neighbour } =
        message;
    same_length(
        mote.len(),
        "mote",
        &[
            ("slotframe", slotframe.len()),
            ("slotframe_slots", slotframe_slots.len()),
            ("slot", slot.len()),
            ("channel_offset", channel_offset.len()),
            ("options", options.len()),
            ("neighbour", neighbour.len()),
        ],
    )?;
    motes_exist("mote", &mote, n_motes, false)?;
    motes_exist("neighbour", &neighbour, n_motes, true)?;
    if let Some(i) = (0..slot.len()).find(|&i| slotframe_slots[i] <= slot[i]) {
        let reason = format!("must be less than slotframe_slots; entry {i} is not");
        return Err(InvalidField::new("slot", reason));
    }
    let order = |i: usize| (mote[i], slotframe[i], slot[i], channel_offset[i]);
    if let Some(i) = (1..mote.len()).find(|&i| order(i) < order(i - 1)) {
        let reason = format!(
            "must be in the order (mote, slotframe, slot, channel_offset); entry {i} is not"
        );
        return Err(InvalidField::new("mote", reason));
    }
    Ok(Schedule { mote, slotframe, slotframe_slots, slot, channel_offset, options, neighbour })
}

/// Who has heard whom, from a message.
///
/// # Errors
///
/// Columns of unequal length, motes that do not exist, pairs out of order or twice, strengths that are not finite.
pub fn heard_links(message: Option<v1::HeardLinks>, n_motes: usize) -> Result<Option<HeardLinks>> {
    let Some(message) = message else { return Ok(None) };
    heard_links_of(message, n_motes).map(Some).map_err(|invalid| invalid.within("heard_links"))
}

fn heard_links_of(message: v1::HeardLinks, n_motes: usize) -> Result<HeardLinks> {
    let v1::HeardLinks { receiver, sender, frames, rssi_dbm } = message;
    let n = receiver.len();
    same_length(n, "receiver", &[("sender", sender.len()), ("frames", frames.len())])?;
    if !rssi_dbm.is_empty() {
        same_length(n, "receiver", &[("rssi_dbm", rssi_dbm.len())])?;
    }
    motes_exist("receiver", &receiver, n_motes, false)?;
    motes_exist("sender", &sender, n_motes, false)?;
    if let Some(i) = (1..n).find(|&i| (receiver[i], sender[i]) <= (receiver[i - 1], sender[i - 1]))
    {
        let reason =
            format!("must be in the order (receiver, sender), each pair once; entry {i} is not");
        return Err(InvalidField::new("receiver", reason));
    }
    if let Some(rssi) = rssi_dbm.iter().find(|rssi| !is_number(f64::from(**rssi))) {
        return Err(InvalidField::new("rssi_dbm", format!("{NUMBER}, got {rssi}")));
    }
    Ok(HeardLinks { receiver, sender, frames, rssi_dbm })
}

/// Frames from a message.
///
/// # Errors
///
/// Columns of unequal length, motes or kinds that do not exist, frames out of order, outcomes that are none, names that are not
/// unique.
pub fn frames(message: Option<v1::Frames>, n_motes: usize) -> Result<Option<Frames>> {
    let Some(message) = message else { return Ok(None) };
    frames_of(message, n_motes).map(Some).map_err(|invalid| invalid.within("frames"))
}

fn frames_of(message: v1::Frames, n_motes: usize) -> Result<Frames> {
    let n = message.sent_ns.len();
    same_length(
        n,
        "sent_ns",
        &[
            ("sender", message.sender.len()),
            ("destination", message.destination.len()),
            ("channel", message.channel.len()),
            ("channel_offset", message.channel_offset.len()),
            ("kind", message.kind.len()),
            ("length_bytes", message.length_bytes.len()),
            ("packet", message.packet.len()),
            ("attempt", message.attempt.len()),
            ("n_received", message.n_received.len()),
            ("n_missed", message.n_missed.len()),
            ("outcome", message.outcome.len()),
        ],
    )?;
    motes_exist("sender", &message.sender, n_motes, false)?;
    motes_exist("destination", &message.destination, n_motes, true)?;
    unique("kinds", message.kinds.iter().map(String::as_str))?;
    less_than("kind", &message.kind, message.kinds.len())?;
    let order = |i: usize| (message.sent_ns[i], message.sender[i]);
    if let Some(i) = (1..n).find(|&i| order(i) < order(i - 1)) {
        let reason = format!("must be in the order (sent_ns, sender); entry {i} is not");
        return Err(InvalidField::new("sent_ns", reason));
    }
    let outcome = message.outcome.iter().map(|&number| match v1::FrameOutcome::try_from(number) {
        Ok(v1::FrameOutcome::Unspecified) => Ok(FrameOutcome::Broadcast),
        Ok(v1::FrameOutcome::Lost) => Ok(FrameOutcome::Lost),
        Ok(v1::FrameOutcome::NotAcknowledged) => Ok(FrameOutcome::NotAcknowledged),
        Ok(v1::FrameOutcome::Acknowledged) => Ok(FrameOutcome::Acknowledged),
        Err(_) => Err(InvalidField::new("outcome", format!("unknown outcome: {number}"))),
    });
    Ok(Frames {
        outcome: outcome.collect::<Result<_>>()?,
        sent_ns: message.sent_ns,
        sender: message.sender,
        destination: message.destination,
        channel: message.channel,
        channel_offset: message.channel_offset,
        kind: message.kind,
        length_bytes: message.length_bytes,
        packet: message.packet,
        attempt: message.attempt,
        n_received: message.n_received,
        n_missed: message.n_missed,
        kinds: message.kinds,
    })
}

fn same_length(n: usize, first: &str, columns: &[(&str, usize)]) -> Result<()> {
    match columns.iter().find(|(_, length)| *length != n) {
        Some((field, length)) => Err(InvalidField::new(
            *field,
            format!("must have {n} entries, as {first}, got {length}"),
        )),
        None => Ok(()),
    }
}

fn motes_exist(field: &str, motes: &[u32], n_motes: usize, or_none: bool) -> Result<()> {
    let exists = |mote: u32| (mote as usize) < n_motes || or_none && mote == u32::MAX;
    match motes.iter().find(|&&mote| !exists(mote)) {
        Some(mote) => Err(InvalidField::new(
            field,
            format!("motes are 0 to {}, got {mote}", n_motes.saturating_sub(1)),
        )),
        None => Ok(()),
    }
}

fn less_than(field: &str, indices: &[u32], n: usize) -> Result<()> {
    match indices.iter().find(|&&index| n <= index as usize) {
        Some(index) => Err(InvalidField::new(field, format!("must be less than {n}, got {index}"))),
        None => Ok(()),
    }
}

fn unique<'a>(field: &str, names: impl Iterator<Item = &'a str>) -> Result<()> {
    let mut known: Vec<&str> = Vec::new();
    for name in names {
        if name.is_empty() || known.contains(&name) {
            let reason = format!("names must be unique and not empty, got {name:?}");
            return Err(InvalidField::new(field, reason));
        }
        known.push(name);
    }
    Ok(())
}

impl From<Formation> for v1::Formation {
    fn from(formation: Formation) -> Self {
        let Formation { formed_ns, missing, reason, reasons } = formation;
        Self {
            formed: formed_ns.is_some(),
            formed_ns: formed_ns.unwrap_or(0),
            missing,
            reason,
            reasons,
        }
    }
}

impl From<Packets> for v1::Packets {
    fn from(packets: Packets) -> Self {
        Self {
            id: packets.id,
            kind: packets.kind,
            source: packets.source,
            destination: packets.destination,
            created_ns: packets.created_ns,
            ended_ns: packets.ended_ns,
            hops: packets.hops,
            payload_bytes: packets.payload_bytes,
            outcome: packets.outcome,
            kinds: packets
                .kinds
                .into_iter()
                .map(|PacketKind { name, is_application, created }| v1::PacketKind {
                    name,
                    is_application,
                    created,
                })
                .collect(),
            reasons: packets.reasons,
        }
    }
}

impl From<MoteStatistics> for v1::MoteStatistics {
    fn from(statistics: MoteStatistics) -> Self {
        let columns =
            statistics.columns.into_iter().map(|Statistic { name, unit, values, known }| {
                let known =
                    known.map_or_else(Bytes::new, |known| Bytes::copy_from_slice(known.as_bytes()));
                v1::Statistic { name, unit, values, known }
            });
        Self { columns: columns.collect() }
    }
}

impl From<Schedule> for v1::Schedule {
    fn from(schedule: Schedule) -> Self {
        let Schedule { mote, slotframe, slotframe_slots, slot, channel_offset, options, neighbour } =
            schedule;
        Self { mote, slotframe, slotframe_slots, slot, channel_offset, options, neighbour }
    }
}

impl From<Frames> for v1::Frames {
    fn from(frames: Frames) -> Self {
        Self {
            outcome: frames.outcome.iter().map(|&outcome| outcome as i32).collect(),
            sent_ns: frames.sent_ns,
            sender: frames.sender,
            destination: frames.destination,
            channel: frames.channel,
            channel_offset: frames.channel_offset,
            kind: frames.kind,
            length_bytes: frames.length_bytes,
            packet: frames.packet,
            attempt: frames.attempt,
            n_received: frames.n_received,
            n_missed: frames.n_missed,
            kinds: frames.kinds,
        }
    }
}

impl From<HeardLinks> for v1::HeardLinks {
    fn from(links: HeardLinks) -> Self {
        let HeardLinks { receiver, sender, frames, rssi_dbm } = links;
        Self { receiver, sender, frames, rssi_dbm }
    }
}

#[cfg(test)]
mod tests;
