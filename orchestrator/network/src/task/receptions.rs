//! Who heard whom, and when: as it was measured, or as a network would have had it. What was said is not part of it.

use bytes::Bytes;
use input::Reading;
use input::result::ResultFolder;
use measure::DataError;
use measure::table::DataTable;
use measure::{links, packets};
use proto::bounds::DESCRIPTION_BYTES;
use proto::types::{Deliveries, Heard, NS_PER_S, Payloads, Transmissions};
use std::collections::BTreeMap;
use std::path::Path;

/// One message of a robot that another received.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReceivedMessage {
    /// When it was sent (ns).
    pub sent_ns: u64,
    /// When it was received (ns).
    pub received_ns: u64,
    /// Number of the robot that sent it.
    pub sender: u32,
    /// Number of the robot that received it.
    pub receiver: u32,
    /// How strong it was (dBm), where that is known.
    pub rssi_dbm: Option<f32>,
}

/// All received messages, in order of reception.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Receptions {
    deliveries: Vec<ReceivedMessage>,
    /// Rows of the file; of them, those that say that something was received.
    pub n_rows: usize,
}

/// Columns of the links that a run leaves.
const OF_RUN: [&str; 5] = ["sender", "receiver", "sent_ns", "received", "received_ns"];

impl Receptions {
    /// Sorts received messages and drops duplicates.
    #[must_use]
    pub fn from_unsorted(mut deliveries: Vec<ReceivedMessage>) -> Self {
        deliveries.sort_by_key(|it| (it.received_ns, it.sent_ns, it.sender, it.receiver));
        deliveries.dedup();
        Self { n_rows: deliveries.len(), deliveries }
    }

    /// Reads what was heard from `from_s` on, which becomes 0: a table of packets, link samples, the links of a run, or the
    /// folder of a run.
    ///
    /// # Errors
    ///
    /// It cannot be read, does not say who heard whom and when, or is of a result and not what the run wrote.
    pub fn read(
        path: &Path,
        n_agents: usize,
        from_s: f64,
        reading: Reading,
    ) -> Result<Self, DataError> {
        let table = if path.is_dir() {
            let run = ResultFolder::open(path, reading)?;
            is_whole(&run)?;
            DataTable::of_result(&run, "links.parquet", reading.budget)?
        } else {
            DataTable::read(path, reading)?
        };
        Self::of_table(&table, n_agents, from_s)
            .map_err(|message| DataError::Format { path: table.path.clone(), message })
    }

    /// The same of a table.
    ///
    /// # Errors
    ///
    /// See [`Self::read`].
    pub fn of_table(table: &DataTable, n_agents: usize, from_s: f64) -> Result<Self, String> {
        let rows: Vec<(f64, f64, u32, u32, f64)> = if OF_RUN
            .iter()
            .all(|name| table.column(name).is_some())
        {
            let cell = |name: &str, row: usize| table.column(name).map_or(f64::NAN, |all| all[row]);
            (0..table.n_rows())
                .filter(|&row| cell("received", row) != 0.0)
                .map(|row| {
                    let [sent_s, received_s] =
                        ["sent_ns", "received_ns"].map(|name| cell(name, row) * 1e-9);
                    let [tx, rx] = ["sender", "receiver"].map(|name| cell(name, row) as u32);
                    (sent_s, received_s, tx, rx, cell("rssi_dbm", row))
                })
                .collect()
        } else if packets::has_shape(table).is_ok() {
            let packets = packets::read(table)?.packets;
            let known = packets.iter().filter_map(|it| Some((it, it.received_s?)));
            known.map(|(it, at_s)| (it.time_s, at_s, it.source, it.destination, f64::NAN)).collect()
        } else if links::has_shape(table).is_ok() {
            let links = links::read(table)?;
            if links.readings.is_aggregated {
                return Err(
                    "aggregates frames over time; give one row per frame, with its time".to_owned()
                );
            }
            let heard = links.rows.iter().filter(|row| 0.0 < row.received);
            heard.map(|row| (row.time_s, row.time_s, row.tx, row.rx, row.rssi_dbm)).collect()
        } else {
            return Err(
                "has no receptions: it needs the columns time_s, source, destination and received_s, or time_s, tx, rx, \
                 rssi_dbm and received"
                    .to_owned(),
            );
        };
        let most = rows.iter().map(|row| row.2.max(row.3)).max().unwrap_or_default();
        if n_agents <= most as usize {
            return Err(format!(
                "mentions agent {most}, but the experiment has {n_agents} agents, 0 to {}; renumber the agents, or set \
                 experiment.agents",
                n_agents - 1
            ));
        }
        let ns = |time_s: f64| ((time_s - from_s) * NS_PER_S as f64).round();
        let deliveries = rows
            .into_iter()
            .filter(|row| row.0.is_finite() && row.1.is_finite() && row.2 != row.3)
            .filter(|row| 0.0 <= ns(row.0))
            .map(|(sent_s, received_s, sender, receiver, rssi_dbm)| ReceivedMessage {
                sent_ns: ns(sent_s) as u64,
                // What is received takes time, if only a little: it belongs to the period in which it was sent.
                received_ns: (ns(received_s) as u64).max(ns(sent_s) as u64 + 1),
                sender,
                receiver,
                rssi_dbm: rssi_dbm.is_finite().then_some(rssi_dbm as f32),
            })
            .collect();
        let heard = Self::from_unsorted(deliveries);
        if heard.deliveries.is_empty() {
            return Err(format!("has no reception after {from_s} s"));
        }
        Ok(Self { n_rows: table.n_rows(), ..heard })
    }

    /// How often somebody heard somebody.
    #[must_use]
    pub fn n(&self) -> usize {
        self.deliveries.len()
    }

    /// Whether all strengths are known.
    #[must_use]
    pub fn has_strengths(&self) -> bool {
        self.deliveries.iter().all(|it| it.rssi_dbm.is_some())
    }

    /// What was received in (`from_ns`, `until_ns`], with what senders had to say when they sent.
    ///
    /// * `said`: what everyone said, period by period of `step_ns`.
    #[must_use]
    pub fn within(
        &self,
        [from_ns, until_ns]: [u64; 2],
        said: &[Payloads],
        step_ns: u64,
        n_agents: usize,
    ) -> Deliveries {
        let place =
            |until_ns: u64| self.deliveries.partition_point(|it| it.received_ns <= until_ns);
        let here = &self.deliveries[place(from_ns)..place(until_ns)];
        // A frame that several heard is one frame.
        let mut frames: BTreeMap<(u64, u32), (usize, u64)> = BTreeMap::new();
        for it in here {
            let frame = frames.entry((it.sent_ns, it.sender)).or_insert((0, it.received_ns));
            frame.1 = frame.1.min(it.received_ns);
        }
        let mut transmissions = Transmissions::default();
        let (mut lengths, mut data) = (Vec::new(), Vec::new());
        for (index, ((sent_ns, sender), (place, end_ns))) in frames.iter_mut().enumerate() {
            *place = index;
            transmissions.sender.push(*sender);
            transmissions.sent_ns.push(*sent_ns);
            transmissions.end_ns.push(*end_ns);
            let words = said.get((sent_ns / step_ns) as usize);
            let bytes = words.and_then(|words| words.iter().nth(*sender as usize)).unwrap_or(&[]);
            lengths.push(bytes.len() as u32);
            data.extend_from_slice(bytes);
        }
        transmissions.payloads = Payloads::new(lengths, Bytes::from(data)).unwrap_or_default();
        let mut of_receiver: Vec<Vec<(usize, &ReceivedMessage)>> = vec![Vec::new(); n_agents];
        for it in here {
            of_receiver[it.receiver as usize].push((frames[&(it.sent_ns, it.sender)].0, it));
        }
        let (mut ends, mut indices) = (Vec::new(), Vec::new());
        let (mut received_ns, mut rssi_dbm) = (Vec::new(), Vec::new());
        let has_strengths = here.iter().all(|it| it.rssi_dbm.is_some());
        for heard in &mut of_receiver {
            heard.sort_by_key(|(index, it)| (*index, it.received_ns));
            heard.dedup_by_key(|(index, _)| *index);
            for (index, it) in heard {
                indices.push(*index as u32);
                received_ns.push(it.received_ns);
                if let (true, Some(dbm)) = (has_strengths, it.rssi_dbm) {
                    rssi_dbm.push(dbm);
                }
            }
            ends.push(indices.len() as u32);
        }
        if transmissions.sender.is_empty() {
            return Deliveries::default();
        }
        let heard = Heard::Lists { ends, indices };
        Deliveries { transmissions, heard, received_ns, rssi_dbm, ..Deliveries::default() }
    }
}

/// Adds what a network delivered in a step; times count from `since_ns`.
pub(super) fn collect(
    deliveries: &Deliveries,
    n_agents: usize,
    since_ns: u64,
    into: &mut Vec<ReceivedMessage>,
) {
    let sent = &deliveries.transmissions;
    let mut k = 0;
    for receiver in 0..n_agents {
        for index in deliveries.heard_by(receiver) {
            let received_ns = deliveries.received_ns.get(k).copied().unwrap_or(sent.end_ns[index]);
            let rssi_dbm = deliveries.rssi_dbm.get(k).copied();
            k += 1;
            let sender = sent.sender[index];
            // A frame that was sent before the robots started says nothing about the task.
            let Some(sent_ns) = sent.sent_ns[index].checked_sub(since_ns) else { continue };
            if sender as usize != receiver {
                let received_ns = received_ns.saturating_sub(since_ns);
                let receiver = receiver as u32;
                into.push(ReceivedMessage { sent_ns, received_ns, sender, receiver, rssi_dbm });
            }
        }
    }
}

/// Refuses a run that has kept only some of what was heard.
fn is_whole(run: &ResultFolder) -> Result<(), DataError> {
    let text = run.text(&DESCRIPTION_BYTES, "config.toml")?;
    let config: toml::Table = text.parse().unwrap_or_default();
    let output = config.get("output").and_then(toml::Value::as_table);
    let setting = |key: &str| output.and_then(|output| output.get(key));
    let links = setting("links").and_then(toml::Value::as_str).unwrap_or("heard");
    let every = setting("every_steps").and_then(toml::Value::as_integer).unwrap_or(1);
    if !["heard", "all"].contains(&links) || every != 1 {
        let message = format!(
            "the run did not record all receptions (output.links = {links:?}, every_steps = {every}); record it with \
             links = \"heard\" and every_steps = 1"
        );
        return Err(DataError::Format { path: run.path().to_owned(), message });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> DataTable {
        DataTable::of_csv(Path::new("heard.csv"), text.as_bytes()).unwrap()
    }

    #[test]
    fn what_was_heard_is_said_anew_in_the_period_in_which_it_arrives() {
        let mut text = "time_s,source,destination,received_s\n".to_owned();
        for time_s in 100..130 {
            text += &format!("{time_s},2,0,{time_s}.5\n{time_s},2,1,{time_s}.7\n");
        }
        let heard = Receptions::of_table(&table(&text), 3, 100.0).unwrap();
        assert_eq!((heard.n(), heard.has_strengths()), (60, false));
        let said: Vec<Payloads> =
            (0..40u8).map(|k| Payloads::new(vec![0, 0, 1], vec![k].into()).unwrap()).collect();
        let second = 1_000_000_000;
        let now = heard.within([3 * second, 4 * second], &said, second, 3);
        assert_eq!(now.transmissions.sender, [2]);
        assert_eq!(now.transmissions.payloads.iter().collect::<Vec<_>>(), [&[3]]);
        assert_eq!(now.n_deliveries(), 2);
        assert_eq!(heard.within([99 * second, 100 * second], &said, second, 3).n_deliveries(), 0);
    }

    #[test]
    fn a_frame_that_arrives_later_says_what_was_true_when_it_was_sent() {
        let late = |sent_ns, received_ns| ReceivedMessage {
            sent_ns,
            received_ns,
            sender: 1,
            receiver: 0,
            rssi_dbm: Some(-60.0),
        };
        let heard = Receptions::from_unsorted(vec![late(25, 31), late(5, 33)]);
        let said: Vec<Payloads> =
            (0..4u8).map(|k| Payloads::new(vec![0, 1], vec![k].into()).unwrap()).collect();
        let now = heard.within([30, 40], &said, 10, 2);
        // In the order of sending: the later frame counts, whichever arrives last.
        assert_eq!(now.transmissions.sent_ns, [5, 25]);
        assert_eq!(now.transmissions.payloads.iter().collect::<Vec<_>>(), [&[0], &[2]]);
        assert_eq!((now.received_ns, now.rssi_dbm.len()), (vec![33, 31], 2));
        let mut again = Vec::new();
        let whole = heard.within([0, 40], &said, 10, 2);
        collect(&whole, 2, 0, &mut again);
        assert_eq!(Receptions::from_unsorted(again), heard);
    }

    #[test]
    fn what_does_not_say_who_heard_whom_and_when_is_refused() {
        for (text, part) in [
            ("time_s,agent\n0,1\n", "received_s"),
            (
                "time_s,tx,rx,channel,rssi_dbm,frames,pdr\n0,0,1,11,-60,10,0.5\n",
                "one row per frame",
            ),
        ] {
            let error = Receptions::of_table(&table(text), 3, 0.0).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
        let mut text = "time_s,source,destination,received_s\n".to_owned();
        (0..30).for_each(|k| text += &format!("{k},7,0,{k}.5\n"));
        let error = Receptions::of_table(&table(&text), 3, 0.0).unwrap_err();
        assert!(error.contains("agent 7") && error.contains("0 to 2"), "{error}");
        let error = Receptions::of_table(&table(&text), 9, 99.0).unwrap_err();
        assert!(error.contains("after 99 s"), "{error}");
    }
}
