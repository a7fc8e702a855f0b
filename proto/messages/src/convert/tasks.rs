//! What robots have to say beside their states, from messages to values and back: messages to single agents, and how far their
//! task is.

use super::{InvalidField, NUMBER, Result, is_number};
use crate::v1;
use bytes::{Bytes, BytesMut};
use proto::types::{AgentMessage, TaskFigure, is_statistic_name};

/// Messages to single agents.
///
/// # Errors
///
/// Columns of unequal length, agents that do not exist, a message to its own sender, an empty one.
pub fn agent_messages(
    message: Option<v1::AgentMessages>,
    n_agents: usize,
) -> Result<Vec<AgentMessage>> {
    let Some(v1::AgentMessages { sender, destination, payloads }) = message else {
        return Ok(Vec::new());
    };
    let n = sender.len();
    if destination.len() != n {
        let reason = format!("must have {n} entries, as sender, got {}", destination.len());
        return Err(InvalidField::new("messages.destination", reason));
    }
    let payloads = super::payloads(payloads, n).map_err(|invalid| invalid.within("messages"))?;
    let mut begin = 0;
    let mut messages = Vec::with_capacity(n);
    for ((&from, &to), &length) in sender.iter().zip(&destination).zip(payloads.length_bytes()) {
        for (field, agent) in [("messages.sender", from), ("messages.destination", to)] {
            if n_agents <= agent as usize {
                let reason = format!("agents are 0 to {}, got {agent}", n_agents - 1);
                return Err(InvalidField::new(field, reason));
            }
        }
        if from == to {
            let reason = format!("must differ from the sender, got {to}");
            return Err(InvalidField::new("messages.destination", reason));
        }
        if length == 0 {
            let reason = "must be at least 1 each, got 0";
            return Err(InvalidField::new("messages.payloads.length_bytes", reason));
        }
        let end = begin + length as usize;
        let payload = payloads.data().slice(begin..end);
        messages.push(AgentMessage { sender: from, destination: to, payload });
        begin = end;
    }
    Ok(messages)
}

/// Figures of the robots' task.
///
/// # Errors
///
/// A name that is none or comes twice, a number that is not finite.
pub fn task_figures(messages: Vec<v1::TaskFigure>) -> Result<Vec<TaskFigure>> {
    let mut figures: Vec<TaskFigure> = Vec::with_capacity(messages.len());
    for v1::TaskFigure { name, value } in messages {
        if !is_statistic_name(&name) {
            let reason =
                format!("must be lower-case letters, digits and underscores, got {name:?}");
            return Err(InvalidField::new("figures.name", reason));
        }
        if figures.iter().any(|known| known.name == name) {
            return Err(InvalidField::new("figures.name", format!("must be unique, got {name:?}")));
        }
        if !is_number(value) {
            return Err(InvalidField::new("figures.value", format!("{NUMBER}, got {value}")));
        }
        figures.push(TaskFigure { name, value });
    }
    Ok(figures)
}

impl From<Vec<AgentMessage>> for v1::AgentMessages {
    fn from(messages: Vec<AgentMessage>) -> Self {
        let mut data = BytesMut::new();
        for message in &messages {
            data.extend_from_slice(&message.payload);
        }
        let length = |message: &AgentMessage| message.payload.len() as u32;
        Self {
            sender: messages.iter().map(|message| message.sender).collect(),
            destination: messages.iter().map(|message| message.destination).collect(),
            payloads: Some(v1::Payloads {
                length_bytes: messages.iter().map(length).collect(),
                data: Bytes::from(data),
            }),
        }
    }
}

impl From<TaskFigure> for v1::TaskFigure {
    fn from(TaskFigure { name, value }: TaskFigure) -> Self {
        Self { name, value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn messages() -> Vec<AgentMessage> {
        vec![
            AgentMessage { sender: 2, destination: 0, payload: Bytes::from_static(b"map") },
            AgentMessage { sender: 0, destination: 2, payload: Bytes::from_static(b"there") },
        ]
    }

    #[test]
    fn what_is_sent_is_what_arrives() {
        let message = v1::AgentMessages::from(messages());
        assert_eq!(agent_messages(Some(message), 3).unwrap(), messages());
        assert_eq!(agent_messages(None, 3).unwrap(), []);
    }

    #[test]
    fn messages_that_nobody_can_carry_are_refused() {
        let refused = |change: fn(&mut v1::AgentMessages)| {
            let mut message = v1::AgentMessages::from(messages());
            change(&mut message);
            agent_messages(Some(message), 3).unwrap_err().to_string()
        };
        let all = [
            refused(|message| message.sender[0] = 3),
            refused(|message| message.destination[1] = 0),
            refused(|message| message.destination.truncate(1)),
            refused(|message| {
                let payloads = message.payloads.as_mut().unwrap();
                payloads.length_bytes = vec![8, 0];
            }),
        ];
        assert_eq!(
            all,
            [
                "messages.sender: agents are 0 to 2, got 3",
                "messages.destination: must differ from the sender, got 0",
                "messages.destination: must have 2 entries, as sender, got 1",
                "messages.payloads.length_bytes: must be at least 1 each, got 0",
            ]
        );
    }

    #[test]
    fn a_figure_has_a_name_of_its_own_and_a_number() {
        let figure = |name: &str, value| v1::TaskFigure { name: name.to_owned(), value };
        assert_eq!(task_figures(vec![figure("mapped_ratio", 0.5)]).unwrap()[0].value, 0.5);
        assert!(
            task_figures(vec![figure("mapped_ratio", 0.5), figure("mapped_ratio", 0.5)]).is_err()
        );
        assert!(task_figures(vec![figure("Mapped", 0.5)]).is_err());
        assert!(task_figures(vec![figure("mapped_ratio", f64::NAN)]).is_err());
    }
}
