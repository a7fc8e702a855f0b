//! Replay of a measured trace.

use super::{BuildContext, Entry, Family, Prediction, Propagation, Reach, Reception};
use crate::k7::{self, K7};
use crate::link::Link;
use bytes::Bytes;
use proto::config::{Choice, FilePath, Problem, Section, variant};
use std::collections::BTreeMap;

/// `propagation = "trace"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("trace"),
    family: Family::Recording,
    replay: duration_ns,
    build,
};

/// What follows the last row.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
enum AfterEnd {
    /// Refuse an experiment whose experiment.duration_s exceeds the trace.
    Refuse,
    /// Each link keeps the values of its last row.
    Hold,
}

/// Replay of a K7 trace: reception and RSSI as measured per link, channel and time.
///
/// Keys of `[netsim.phy]`.
#[derive(Section)]
struct Keys {
    /// A K7 file, gzipped or plain.
    #[key(required)]
    file: Option<FilePath>,
    /// Behaviour after the end of the trace.
    #[key(default = AfterEnd::Refuse)]
    after_end: AfterEnd,
}

/// How long it lasts, unless links are held beyond its end.
fn duration_ns(table: &toml::Table, files: &BTreeMap<String, Bytes>) -> Option<u64> {
    let keys = Keys::read(table);
    let content = files.get(&keys.file?.0)?;
    if keys.after_end == AfterEnd::Hold { None } else { Some(k7::header(content)?.duration_ns) }
}

/// What a link and channel without rows reads (dBm): the 6TiSCH simulator's mark for nothing.
pub const NOTHING_DBM: f64 = -1000.0;

/// Replay of a K7 trace.
///
/// # Model
///
/// Every row holds, for its ordered link and channel (all channels where it names none), from its own slot on, until the
/// next row of that link and channel. Rows at the head of the file hold from the beginning, until the first row whose
/// link and channel came before. Links and channels without rows hear nothing. After its last row a link stays as it
/// is. Positions play no part.
///
/// Frames take their channel from the hopping sequence by absolute slot number.
///
/// # Validity
///
/// What was averaged over the frames of a row (100 of them, within 10 s) is taken as the probability of each frame:
/// losses in bursts are lost.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    n_nodes: usize,
    slot_ns: u64,
    /// Per (sender, receiver, channel − 11): from which slot on, RSSI (dBm), probability of reception. By slot.
    rows: Vec<Vec<(u64, f64, f64)>>,
}

const N_CHANNELS: usize = 16;

impl Trace {
    /// The replay of a trace in slots of `slot_ns`.
    #[must_use]
    pub fn new(k7: &K7, slot_ns: u64) -> Self {
        let n_nodes = k7.header.node_count;
        let mut rows = vec![Vec::new(); n_nodes * n_nodes * N_CHANNELS];
        for row in &k7.rows {
            let channels = match row.channel {
                Some(channel) => channel..=channel,
                None => 11..=26,
            };
            for channel in channels {
                let place = (row.src as usize * n_nodes + row.dst as usize) * N_CHANNELS
                    + usize::from(channel - 11);
                let slot = row.from_ns / slot_ns;
                rows[place].push((slot, row.rssi_dbm.unwrap_or(NOTHING_DBM), row.pdr));
            }
        }
        for list in &mut rows {
            // Stable: of two rows in one slot the later in the file holds.
            list.sort_by_key(|&(slot, ..)| slot);
        }
        Self { n_nodes, slot_ns, rows }
    }
}

impl Propagation for Trace {
    fn predict(&self, link: &Link<'_>) -> Prediction {
        let (src, dst) = (link.sender.id.index(), link.receiver.id.index());
        let row = match link.channel {
            Some(channel @ 11..=26) if src < self.n_nodes && dst < self.n_nodes => {
                let place = (src * self.n_nodes + dst) * N_CHANNELS + usize::from(channel - 11);
                let list = &self.rows[place];
                let after = list.partition_point(|&(slot, ..)| slot <= link.time_ns / self.slot_ns);
                after.checked_sub(1).map(|last| list[last])
            }
            _ => None,
        };
        let (_, rssi_dbm, pdr) = row.unwrap_or((0, NOTHING_DBM, 0.0));
        Prediction { rssi_dbm, reception: Reception::Stated(pdr) }
    }

    fn reach(&self, _: f64, _: f64) -> Reach {
        Reach::Unlimited
    }
}

fn build(table: &toml::Table, context: &mut BuildContext<'_>) -> Option<Box<dyn Propagation>> {
    let key = format!("{}.file", context.path);
    let keys = Keys::read(table);
    let file = &keys.file?.0;
    let Some(content) = context.files.get(file) else {
        let message =
            "names a file whose content is missing; send it together with the configuration";
        context.problems.push(Problem::new(key, message).value(format!("{file:?}")));
        return None;
    };
    let k7 = match k7::read(content) {
        Ok(k7) => k7,
        Err(complaints) => {
            context.problems.extend(complaints.into_iter().map(|complaint| {
                Problem::new(&key, format!("is not a K7 trace: {file}: {complaint}"))
            }));
            return None;
        }
    };
    let before = context.problems.len();
    let header = &k7.header;
    // Measurements may be of some of the nodes.
    let is_compared = context.channels.is_empty() && context.agent_count < header.node_count;
    if header.node_count != context.agent_count && !is_compared {
        let message =
            format!("has {} nodes, so the experiment must have as many agents", header.node_count);
        let problem = Problem::new(&key, message);
        context.problems.push(problem.value(context.agent_count).nearest(header.node_count));
    }
    let missing: Vec<String> = context
        .channels
        .iter()
        .filter(|channel| !header.channels.contains(channel))
        .map(ToString::to_string)
        .collect();
    if !missing.is_empty() {
        let message = format!(
            "was not measured on all channels of netsim.hopping_sequence: {} missing; the trace has the channels {:?}",
            missing.join(", "),
            header.channels
        );
        context.problems.push(Problem::new(&key, message));
    }
    if keys.after_end != AfterEnd::Hold {
        let duration_s = proto::types::seconds(header.duration_ns);
        context.warnings.push(format!(
            "{file} lasts {duration_s} s, from time 0 on, formation included: in a longer run every link then stays as its \
             last row says"
        ));
    }
    (context.problems.len() == before)
        .then(|| Box::new(Trace::new(&k7, context.slot_ns)) as Box<dyn Propagation>)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::{End, Scene};
    use proto::ids::MoteId;

    /// Three nodes, two channels, one minute; the third row repeats the first one's link and channel.
    const TEXT: &str = "{\"tx_length\": 100, \"start_date\": \"2018-01-11T16:32:22.0\", \
        \"stop_date\": \"2018-01-11T16:33:22.0\", \"channels\": [11, 12], \"location\": \"x\", \
        \"node_count\": 3, \"interframe_duration\": 100}\n\
        datetime,src,dst,channel,mean_rssi,pdr,tx_count\n\
        2018-01-11T16:32:22.0,0,1,11,-69.9,1.0,100\n\
        2018-01-11T16:32:30.0,1,0,12,-80.5,0.25,100\n\
        2018-01-11T16:32:32.0,0,1,11,,0.0,100\n\
        2018-01-11T16:32:42.5,1,2,,-60,0.5,100\n";

    fn predict(trace: &Trace, src: u32, dst: u32, channel: u8, time_s: f64) -> (f64, f64) {
        let scene = Scene::default();
        let prediction = trace.predict(&Link {
            sender: End::new(MoteId(src), [0.0; 3]),
            receiver: End::new(MoteId(dst), [0.0; 3]),
            distance_m: 1.0,
            channel: Some(channel),
            frequency_hz: 2.4e9,
            time_ns: (time_s * 1e9) as u64,
            scene: &scene,
        });
        let Reception::Stated(pdr) = prediction.reception else { panic!("a trace states it") };
        (prediction.rssi_dbm, pdr)
    }

    #[test]
    fn rows_hold_from_their_slot_on_and_the_head_of_the_file_from_the_beginning() {
        let trace = Trace::new(&k7::read(TEXT.as_bytes()).unwrap(), 10_000_000);
        assert_eq!(predict(&trace, 0, 1, 11, 0.0), (-69.9, 1.0));
        assert_eq!(predict(&trace, 0, 1, 11, 9.99), (-69.9, 1.0));
        assert_eq!(predict(&trace, 0, 1, 11, 10.0), (NOTHING_DBM, 0.0));
        assert_eq!(predict(&trace, 1, 0, 12, 0.0), (-80.5, 0.25), "second row: still the head");
        assert_eq!(predict(&trace, 1, 2, 11, 20.49), (NOTHING_DBM, 0.0));
        assert_eq!(predict(&trace, 1, 2, 11, 20.5), (-60.0, 0.5), "no channel: all channels");
        assert_eq!(predict(&trace, 1, 2, 26, 3600.0), (-60.0, 0.5), "the last row stays");
        assert_eq!(predict(&trace, 0, 1, 12, 30.0), (NOTHING_DBM, 0.0), "no row");
    }
}
