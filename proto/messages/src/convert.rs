//! From messages to values, refusing what is malformed, and back.
//!
//! Every function that reads a message takes the number of agents and returns [`InvalidField`] naming the field and what
//! is wrong with it. Nothing malformed passes this border.

mod exchange;
mod kinds;
mod messages;
mod predictions;
mod records;
mod tasks;

pub use exchange::{
    network_request, network_start, network_step, reported_motes, robots_request, robots_start,
    robots_step,
};
pub use kinds::{Numbered, columns, coupling, known, motion_command_kind, numbers, records};
pub use predictions::{predicted_response, predicted_windows, prediction_windows};
pub use records::{formation, frames, heard_links, packets, schedule, statistics};
pub use tasks::{agent_messages, task_figures};

use crate::v1;
use bytes::Bytes;
use proto::types::{
    AgentCommand, AgentOrder, AgentStates, Bitmap, Covariate, Deliveries, EVERYONE, Heard, Medium,
    MoteCommand, MoteOrder, MoteStates, MovedObstacle, Payloads, Transmissions,
};

/// A field of a message that breaks the contract.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {reason}")]
pub struct InvalidField {
    /// Path of the field within its message.
    pub field: String,
    /// What is wrong and what is allowed.
    pub reason: String,
}

impl InvalidField {
    /// A complaint about a field.
    pub fn new(field: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { field: field.into(), reason: reason.into() }
    }

    fn within(self, outer: &str) -> Self {
        Self { field: format!("{outer}.{}", self.field), reason: self.reason }
    }
}

type Result<T> = std::result::Result<T, InvalidField>;

/// Agent states from a message.
///
/// # Errors
///
/// A column of the wrong length, a number that is not finite, a covariate named twice.
pub fn states(message: Option<v1::AgentStates>, n_agents: usize) -> Result<AgentStates> {
    let message = message.ok_or_else(|| InvalidField::new("states", "is missing"))?;
    let required = |name, column: Vec<f64>| column_of(name, column, n_agents, false);
    let optional = |name, column: Vec<f64>| column_of(name, column, n_agents, true);
    let build = || -> Result<AgentStates> {
        let mut covariates: Vec<Covariate> = Vec::with_capacity(message.covariates.len());
        for (index, covariate) in message.covariates.into_iter().enumerate() {
            let field = format!("covariates[{index}]");
            if covariate.name.is_empty() || covariates.iter().any(|c| c.name == covariate.name) {
                return Err(InvalidField::new(
                    format!("{field}.name"),
                    format!("must be unique and not empty, got {:?}", covariate.name),
                ));
            }
            let values = column_of(&format!("{field}.values"), covariate.values, n_agents, false)?;
            covariates.push(Covariate { name: covariate.name, values });
        }
        Ok(AgentStates {
            alive: bitmap("alive", &message.alive, n_agents)?,
            x_m: required("x_m", message.x_m)?,
            y_m: required("y_m", message.y_m)?,
            z_m: required("z_m", message.z_m)?,
            vx_mps: optional("vx_mps", message.vx_mps)?,
            vy_mps: optional("vy_mps", message.vy_mps)?,
            vz_mps: optional("vz_mps", message.vz_mps)?,
            heading_rad: optional("heading_rad", message.heading_rad)?,
            covariates,
        })
    };
    build().map_err(|invalid| invalid.within("states"))
}

/// Payloads from a message, `n` of them. A message that is absent or empty stands for `n` empty payloads.
///
/// # Errors
///
/// Another number of lengths, or data of another length than their sum.
pub fn payloads(message: Option<v1::Payloads>, n: usize) -> Result<Payloads> {
    let message = message.unwrap_or_default();
    let lengths = if message.length_bytes.is_empty() && message.data.is_empty() {
        vec![0; n]
    } else {
        message.length_bytes
    };
    if lengths.len() != n {
        return Err(InvalidField::new(
            "payloads.length_bytes",
            format!("must have {n} entries, got {}", lengths.len()),
        ));
    }
    let n_bytes = message.data.len();
    let total: u64 = lengths.iter().map(|&length| u64::from(length)).sum();
    Payloads::new(lengths, message.data).ok_or_else(|| {
        InvalidField::new("payloads.data", format!("must be {total} bytes long, got {n_bytes}"))
    })
}

/// Deliveries from a message; an absent one stands for none at all.
///
/// # Errors
///
/// Columns of unequal length, agents or indices that do not exist, indices out of order, transmissions out of order.
pub fn deliveries(message: Option<v1::Deliveries>, n_agents: usize) -> Result<Option<Deliveries>> {
    let Some(message) = message else { return Ok(None) };
    deliveries_of(message, n_agents).map(Some).map_err(|invalid| invalid.within("deliveries"))
}

fn deliveries_of(message: v1::Deliveries, n_agents: usize) -> Result<Deliveries> {
    let sent = message.transmissions.unwrap_or_default();
    let n_sent = sent.sender.len();
    let same_length = |field: &str, length: usize| {
        if length == n_sent {
            Ok(())
        } else {
            Err(InvalidField::new(
                format!("transmissions.{field}"),
                format!("must have {n_sent} entries, as sender, got {length}"),
            ))
        }
    };
    same_length("sent_ns", sent.sent_ns.len())?;
    same_length("end_ns", sent.end_ns.len())?;
    if let Some(agent) = sent.sender.iter().find(|&&agent| agent as usize >= n_agents) {
        return Err(InvalidField::new(
            "transmissions.sender",
            format!("agents are 0 to {}, got {agent}", n_agents - 1),
        ));
    }
    if !sent.destination.is_empty() {
        same_length("destination", sent.destination.len())?;
    }
    let exists = |agent: u32| (agent as usize) < n_agents || agent == EVERYONE;
    if let Some(agent) = sent.destination.iter().find(|&&agent| !exists(agent)) {
        return Err(InvalidField::new(
            "transmissions.destination",
            format!("agents are 0 to {}, and {EVERYONE} is everyone, got {agent}", n_agents - 1),
        ));
    }
    let order = |i: usize| (sent.sent_ns[i], sent.sender[i]);
    if let Some(i) = (1..n_sent).find(|&i| order(i) < order(i - 1)) {
        return Err(InvalidField::new(
            "transmissions",
            format!("must be in the order (sent_ns, sender); entry {i} is not"),
        ));
    }
    if let Some(i) = (0..n_sent).find(|&i| sent.end_ns[i] < sent.sent_ns[i]) {
        return Err(InvalidField::new(
            "transmissions.end_ns",
            format!("must not be before sent_ns; entry {i} is"),
        ));
    }
    let payloads = payloads(sent.payloads, n_sent).map_err(|i| i.within("transmissions"))?;
    let heard = heard(message.heard_end, message.heard, message.heard_bitmap, n_agents, n_sent)?;
    let medium = message.medium.into_iter();
    let medium = medium.map(|number| Medium::of_number(number).unwrap_or(Medium::Radio));
    let deliveries = Deliveries {
        transmissions: Transmissions {
            sender: sent.sender,
            sent_ns: sent.sent_ns,
            end_ns: sent.end_ns,
            payloads,
            destination: sent.destination,
        },
        heard,
        received_ns: message.received_ns,
        rssi_dbm: message.rssi_dbm,
        hops: message.hops,
        medium: medium.collect(),
    };
    let columns = [
        ("received_ns", deliveries.received_ns.len()),
        ("rssi_dbm", deliveries.rssi_dbm.len()),
        ("hops", deliveries.hops.len()),
        ("medium", deliveries.medium.len()),
    ];
    if columns.iter().any(|&(_, length)| length != 0) {
        let n = deliveries.n_deliveries();
        if let Some((field, length)) =
            columns.iter().find(|&&(_, length)| length != 0 && length != n)
        {
            return Err(InvalidField::new(
                *field,
                format!("must be empty or have {n} entries, one per delivery, got {length}"),
            ));
        }
    }
    if let Some(rssi) = deliveries.rssi_dbm.iter().find(|rssi| !rssi.is_finite()) {
        return Err(InvalidField::new("rssi_dbm", format!("must be finite, got {rssi}")));
    }
    Ok(deliveries)
}

fn heard(
    ends: Vec<u32>,
    indices: Vec<u32>,
    rows: Bytes,
    n_agents: usize,
    n_sent: usize,
) -> Result<Heard> {
    if !rows.is_empty() {
        let row_bytes = n_sent.div_ceil(8);
        if !ends.is_empty() || !indices.is_empty() {
            return Err(InvalidField::new(
                "heard_bitmap",
                "must be absent if heard and heard_end are present",
            ));
        }
        if rows.len() != n_agents * row_bytes {
            return Err(InvalidField::new(
                "heard_bitmap",
                format!("must be {} bytes long, got {}", n_agents * row_bytes, rows.len()),
            ));
        }
        let spare = if n_sent.is_multiple_of(8) { 0 } else { 0xffu8 << (n_sent % 8) };
        if rows.chunks_exact(row_bytes).any(|row| row[row_bytes - 1] & spare != 0) {
            return Err(InvalidField::new("heard_bitmap", "spare bits must be zero"));
        }
        return Ok(Heard::Rows { bytes: rows, row_bytes });
    }
    if ends.is_empty() && indices.is_empty() {
        return Ok(Heard::Lists { ends, indices });
    }
    if ends.len() != n_agents {
        return Err(InvalidField::new(
            "heard_end",
            format!("must have {n_agents} entries, got {}", ends.len()),
        ));
    }
    let mut start = 0;
    for (receiver, &end) in ends.iter().enumerate() {
        let list = indices.get(start..end as usize).ok_or_else(|| {
            InvalidField::new(
                format!("heard_end[{receiver}]"),
                format!("must be from {start} to {}, got {end}", indices.len()),
            )
        })?;
        if list.windows(2).any(|pair| pair[1] <= pair[0])
            || list.last().is_some_and(|&last| last as usize >= n_sent)
        {
            return Err(InvalidField::new(
                "heard",
                format!("receiver {receiver}: indices must ascend and be less than {n_sent}"),
            ));
        }
        start = end as usize;
    }
    if start != indices.len() {
        return Err(InvalidField::new(
            "heard_end",
            format!("must end with {}, the length of heard, got {start}", indices.len()),
        ));
    }
    Ok(Heard::Lists { ends, indices })
}

/// Mote states from a message; an absent one stands for motes that all work.
///
/// # Errors
///
/// A column of the wrong length.
pub fn motes(message: Option<v1::MoteStates>, n_agents: usize) -> Result<MoteStates> {
    let Some(message) = message else {
        return Ok(MoteStates::all_working(n_agents));
    };
    let column = |field: &str, column: Vec<u32>| {
        if column.is_empty() || column.len() == n_agents {
            Ok(column)
        } else {
            Err(InvalidField::new(
                format!("motes.{field}"),
                format!("must be empty or have {n_agents} entries, got {}", column.len()),
            ))
        }
    };
    let optional_bitmap = |field: &str, bytes: &Bytes| {
        if bytes.is_empty() { Ok(None) } else { bitmap(field, bytes, n_agents).map(Some) }
    };
    Ok(MoteStates {
        alive: bitmap("motes.alive", &message.alive, n_agents)?,
        synced: optional_bitmap("motes.synced", &message.synced)?,
        joined: optional_bitmap("motes.joined", &message.joined)?,
        rank: column("rank", message.rank)?,
        parent: column("parent", message.parent)?,
        queue_length: column("queue_length", message.queue_length)?,
    })
}

/// Orders to agents from messages, in the order given. Whoever obeys them sorts them with those from elsewhere.
///
/// # Errors
///
/// An agent that does not exist, an order that is missing, a number that is not finite.
pub fn agent_commands(
    messages: Vec<v1::AgentCommand>,
    n_agents: usize,
) -> Result<Vec<AgentCommand>> {
    use v1::agent_command::Order;
    let mut commands = Vec::with_capacity(messages.len());
    for (index, message) in messages.into_iter().enumerate() {
        let field = |name: &str| format!("commands[{index}].{name}");
        if message.agent as usize >= n_agents {
            return Err(InvalidField::new(
                field("agent"),
                format!("agents are 0 to {}, got {}", n_agents - 1, message.agent),
            ));
        }
        let order = match message.order {
            Some(Order::Velocity(v)) => AgentOrder::Velocity([v.vx_mps, v.vy_mps, v.vz_mps]),
            Some(Order::Waypoint(p)) => AgentOrder::Waypoint([p.x_m, p.y_m, p.z_m]),
            Some(Order::Release(_)) => AgentOrder::Release,
            None => return Err(InvalidField::new(field("order"), "is missing")),
        };
        if let AgentOrder::Velocity(numbers) | AgentOrder::Waypoint(numbers) = order
            && let Some(number) = numbers.iter().find(|number| !is_number(**number))
        {
            return Err(InvalidField::new(field("order"), format!("{NUMBER}, got {number}")));
        }
        commands.push(AgentCommand { agent: message.agent, source: message.source, order });
    }
    Ok(commands)
}

/// Sorts orders by (source, agent), keeping the order of those that are equal in both.
pub fn sort_agent_commands(commands: &mut [AgentCommand]) {
    commands.sort_by(|a, b| (&a.source, a.agent).cmp(&(&b.source, b.agent)));
}

/// Orders to the network from messages, in the order given. Whoever obeys them sorts them with those from elsewhere.
///
/// # Errors
///
/// A mote or channel that does not exist, an order that is missing, a time interval that is empty, a number that is not
/// finite.
pub fn mote_commands(messages: Vec<v1::MoteCommand>, n_agents: usize) -> Result<Vec<MoteCommand>> {
    use v1::mote_command::Order;
    let mut commands = Vec::with_capacity(messages.len());
    for (index, message) in messages.into_iter().enumerate() {
        let field = |name: &str| format!("commands[{index}].{name}");
        let mote = |mote: u32| {
            if (mote as usize) < n_agents {
                Ok(mote)
            } else {
                Err(InvalidField::new(
                    field("mote"),
                    format!("motes are 0 to {}, got {mote}", n_agents - 1),
                ))
            }
        };
        let order = match message.order {
            Some(Order::Kill(order)) => MoteOrder::Kill(mote(order.mote)?),
            Some(Order::Revive(order)) => MoteOrder::Revive(mote(order.mote)?),
            Some(Order::Add(order)) => MoteOrder::Add(mote(order.mote)?),
            Some(Order::Jam(jam)) => {
                if !(11..=26).contains(&jam.channel) {
                    return Err(InvalidField::new(
                        field("jam.channel"),
                        format!("must be 11 to 26, got {}", jam.channel),
                    ));
                }
                if jam.until_ns <= jam.from_ns {
                    return Err(InvalidField::new(
                        field("jam.until_ns"),
                        format!(
                            "must be later than from_ns, {}, got {}",
                            jam.from_ns, jam.until_ns
                        ),
                    ));
                }
                let finite = jam.x_m.is_finite() && jam.y_m.is_finite() && jam.radius_m.is_finite();
                if !finite || jam.radius_m < 0.0 {
                    return Err(InvalidField::new(
                        field("jam"),
                        "x_m and y_m must be finite, radius_m finite and not negative",
                    ));
                }
                MoteOrder::Jam {
                    channel: jam.channel,
                    from_ns: jam.from_ns,
                    until_ns: jam.until_ns,
                    centre_m: [jam.x_m, jam.y_m],
                    radius_m: jam.radius_m,
                }
            }
            Some(Order::Send(send)) => {
                let destination =
                    if send.destination == EVERYONE { EVERYONE } else { mote(send.destination)? };
                MoteOrder::Send { mote: mote(send.mote)?, destination, payload: send.payload }
            }
            None => return Err(InvalidField::new(field("order"), "is missing")),
        };
        commands.push(MoteCommand { source: message.source, order });
    }
    Ok(commands)
}

/// Moved obstacles from messages.
///
/// # Errors
///
/// A number that is not finite.
pub fn moved_obstacles(messages: Vec<v1::MovedObstacle>) -> Result<Vec<MovedObstacle>> {
    messages
        .into_iter()
        .map(|message| {
            if is_number(message.x_m) && is_number(message.y_m) {
                Ok(MovedObstacle { name: message.name, centre_m: [message.x_m, message.y_m] })
            } else {
                Err(InvalidField::new("moved_obstacles", NUMBER))
            }
        })
        .collect()
}

/// What every number must be: sums and squares of such numbers are finite, too.
const NUMBER: &str = "must be finite and at most 1e12 in magnitude";

fn is_number(value: f64) -> bool {
    value.abs() <= 1e12
}

fn column_of(field: &str, column: Vec<f64>, n: usize, optional: bool) -> Result<Vec<f64>> {
    if column.len() != n && !(optional && column.is_empty()) {
        let or_empty = if optional { "be empty or " } else { "" };
        return Err(InvalidField::new(
            field,
            format!("must {or_empty}have {n} entries, one per agent, got {}", column.len()),
        ));
    }
    match column.iter().position(|value| !is_number(*value)) {
        Some(agent) => Err(InvalidField::new(
            format!("{field}[{agent}]"),
            format!("{NUMBER}, got {}", column[agent]),
        )),
        None => Ok(column),
    }
}

fn bitmap(field: &str, bytes: &Bytes, n: usize) -> Result<Bitmap> {
    Bitmap::from_bytes(bytes, n).ok_or_else(|| {
        InvalidField::new(
            field,
            format!(
                "must be {} bytes for {n} agents, spare bits zero, got {} bytes",
                n.div_ceil(8),
                bytes.len()
            ),
        )
    })
}

#[cfg(test)]
mod tests;
