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
    same_length(&message.lengths())?;
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
    Ok(message.into_value())
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
    same_length(&message.lengths())?;
    let v1::Schedule { mote, slotframe, slotframe_slots, slot, channel_offset, neighbour, .. } =
        &message;
    motes_exist("mote", mote, n_motes, false)?;
    motes_exist("neighbour", neighbour, n_motes, true)?;
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
    Ok(message.into_value())
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
    same_length(&message.lengths())?;
    let v1::HeardLinks { receiver, sender, rssi_dbm, .. } = &message;
    let n = receiver.len();
    if !rssi_dbm.is_empty() {
        same_length(&[("receiver", n), ("rssi_dbm", rssi_dbm.len())])?;
    }
    motes_exist("receiver", receiver, n_motes, false)?;
    motes_exist("sender", sender, n_motes, false)?;
    if let Some(i) = (1..n).find(|&i| (receiver[i], sender[i]) <= (receiver[i - 1], sender[i - 1]))
    {
        let reason =
            format!("must be in the order (receiver, sender), each pair once; entry {i} is not");
        return Err(InvalidField::new("receiver", reason));
    }
    if let Some(rssi) = rssi_dbm.iter().find(|rssi| !is_number(f64::from(**rssi))) {
        return Err(InvalidField::new("rssi_dbm", format!("{NUMBER}, got {rssi}")));
    }
    Ok(message.into_value())
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
    same_length(&message.lengths())?;
    motes_exist("sender", &message.sender, n_motes, false)?;
    motes_exist("destination", &message.destination, n_motes, true)?;
    unique("kinds", message.kinds.iter().map(String::as_str))?;
    less_than("kind", &message.kind, message.kinds.len())?;
    let order = |i: usize| (message.sent_ns[i], message.sender[i]);
    if let Some(i) = (1..n).find(|&i| order(i) < order(i - 1)) {
        let reason = format!("must be in the order (sent_ns, sender); entry {i} is not");
        return Err(InvalidField::new("sent_ns", reason));
    }
    if let Some(number) = message.outcome.iter().find(|number| outcome(**number).is_none()) {
        return Err(InvalidField::new("outcome", format!("unknown outcome: {number}")));
    }
    Ok(message.into_value())
}

/// The outcome of a frame from its number, if this version of the contract knows it.
fn outcome(number: i32) -> Option<FrameOutcome> {
    use FrameOutcome::{Acknowledged, Broadcast, Lost, NotAcknowledged};
    let all = [Broadcast, Lost, NotAcknowledged, Acknowledged];
    all.into_iter().find(|outcome| *outcome as i32 == number)
}

/// Columns by name, each with its length: that of the first.
fn same_length(columns: &[(&str, usize)]) -> Result<()> {
    let Some(((first, n), others)) = columns.split_first() else { return Ok(()) };
    match others.iter().find(|(_, length)| length != n) {
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

/// The message of a record whose columns have the same names in the value.
trait Columns {
    type Value;

    /// The columns by name, each with its length.
    fn lengths(&self) -> Vec<(&'static str, usize)>;

    /// The value of a message that was found valid.
    fn into_value(self) -> Self::Value;
}

/// Records by their columns. After these come lists of another length, or columns that may be empty.
macro_rules! records {
    ($($name:ident { $($column:ident),+; $($list:ident),* })+) => {$(
        impl From<$name> for v1::$name {
            fn from(record: $name) -> Self {
                Self {
                    $($column: record.$column.converted(),)+
                    $($list: record.$list.converted(),)*
                }
            }
        }

        impl Columns for v1::$name {
            type Value = $name;

            fn lengths(&self) -> Vec<(&'static str, usize)> {
                vec![$((stringify!($column), self.$column.len())),+]
            }

            fn into_value(self) -> $name {
                $name {
                    $($column: self.$column.converted(),)+
                    $($list: self.$list.converted(),)*
                }
            }
        }
    )+};
}

records! {
    Packets {
        id, kind, source, destination, created_ns, ended_ns, hops, payload_bytes, outcome;
        kinds, reasons
    }
    Schedule { mote, slotframe, slotframe_slots, slot, channel_offset, options, neighbour; }
    HeardLinks { receiver, sender, frames; rssi_dbm }
    Frames {
        sent_ns, sender, destination, channel, channel_offset, kind, length_bytes, packet, attempt,
        n_received, n_missed, outcome;
        kinds
    }
}

/// A column of a message from that of a value, or the other way round. Most are the same.
trait Converted<T> {
    fn converted(self) -> T;
}

impl<T> Converted<T> for T {
    fn converted(self) -> T {
        self
    }
}

impl Converted<Vec<i32>> for Vec<FrameOutcome> {
    fn converted(self) -> Vec<i32> {
        self.into_iter().map(|outcome| outcome as i32).collect()
    }
}

impl Converted<Vec<FrameOutcome>> for Vec<i32> {
    fn converted(self) -> Vec<FrameOutcome> {
        self.into_iter().filter_map(outcome).collect()
    }
}

impl Converted<Vec<v1::PacketKind>> for Vec<PacketKind> {
    fn converted(self) -> Vec<v1::PacketKind> {
        let kind = |PacketKind { name, is_application, created }| v1::PacketKind {
            name,
            is_application,
            created,
        };
        self.into_iter().map(kind).collect()
    }
}

impl Converted<Vec<PacketKind>> for Vec<v1::PacketKind> {
    fn converted(self) -> Vec<PacketKind> {
        let kind = |v1::PacketKind { name, is_application, created }| PacketKind {
            name,
            is_application,
            created,
        };
        self.into_iter().map(kind).collect()
    }
}

#[cfg(test)]
mod tests;
