//! `[[timeline]]`: faults and traffic that the experiment file orders, each at its time.

use proto::config::{Choice, Lists, Node, OneOf, Problem, Section, check};
use proto::ids::MoteId;
use proto::types::{MoteCommand, MoteCommandKind, MoteOrder, NS_PER_S, seconds};

/// The entries as a key of the whole file, so that they are checked like any other.
#[derive(Section)]
struct Entries {
    timeline: Vec<EntryKeys>,
}

/// A scheduled event of the network.
#[derive(Section)]
pub(super) struct EntryKeys {
    /// The event.
    #[key(tag)]
    order: Option<Order>,
    /// Time of the event (s after the robots start, as duration_s). It takes effect at the beginning of the control period that contains
    /// this time; noise starts and ends exactly on time.
    #[key(range = 0.0..=1e9)]
    at_s: f64,
}

/// What happens.
#[derive(Section)]
enum Order {
    /// The radio of a mote fails.
    Kill(MotesKey),
    /// The radio of a mote works again, as after a reboot.
    Revive(MotesKey),
    /// A mote that netsim.absent leaves out joins the network.
    Add(MotesKey),
    /// Noise on channels, everywhere or within a disc.
    Jam(Jam),
    /// One additional packet.
    Send(Send),
}

#[derive(Section)]
struct MotesKey {
    /// The mote, or a list of them.
    motes: Motes,
}

#[derive(OneOf)]
enum Motes {
    One(#[key(range = 0..=u32::MAX - 1)] u32),
    Several(#[key(range = 0..=u32::MAX - 1, length = 1..)] Vec<u32>),
}

#[derive(Section)]
struct Jam {
    /// IEEE 802.15.4 channels. Absent: all of them.
    #[key(range = 11..=26, length = 1..=16)]
    channels: Option<Vec<u32>>,
    /// End of the noise (s after the robots start).
    #[key(above = 0.0, most = 1e9)]
    until_s: f64,
    /// Centre of the disc, east (m).
    #[key(range = -1e12..=1e12, default = 0.0)]
    x_m: f64,
    /// Centre of the disc, north (m).
    #[key(range = -1e12..=1e12, default = 0.0)]
    y_m: f64,
    /// Radius of the disc (m). Absent: everywhere.
    #[key(above = 0.0, most = 1e12)]
    radius_m: Option<f64>,
}

#[derive(Section)]
struct Send {
    #[key(flatten)]
    source: MotesKey,
    /// Destination mote, or "all": a broadcast to all motes in range.
    destination: Destination,
    /// Payload as text. Set exactly one of payload and payload_hex.
    payload: Option<String>,
    /// Payload as hexadecimal digits, two per byte.
    payload_hex: Option<String>,
}

#[derive(OneOf)]
enum Destination {
    Mote(#[key(range = 0..=u32::MAX - 1)] u32),
    Broadcast(Broadcast),
}

#[derive(Choice, Clone, Copy)]
enum Broadcast {
    /// All motes in range.
    All,
}

/// Who orders it, in records.
pub const SOURCE: &str = "timeline";

/// The orders of a file, earliest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timeline {
    entries: Vec<TimelineEntry>,
}

/// An order at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimelineEntry {
    /// Its place in the file, from 0.
    pub index: usize,
    /// When (ns), from when the robots start.
    pub at_ns: u64,
    /// What happens. Times of noise are counted as `at_ns`.
    pub order: MoteOrder,
}

impl Timeline {
    /// All orders, earliest first, those of one time in the order of the file.
    #[must_use]
    pub fn entries(&self) -> &[TimelineEntry] {
        &self.entries
    }

    /// The orders whose time lies in `from_ns..until_ns`, for robots that started at `start_ns`.
    #[must_use]
    pub fn commands(&self, start_ns: u64, from_ns: u64, until_ns: u64) -> Vec<MoteCommand> {
        let within =
            |entry: &&TimelineEntry| (from_ns..until_ns).contains(&(start_ns + entry.at_ns));
        self.entries.iter().filter(within).map(|entry| command(&entry.order, start_ns)).collect()
    }

    /// Orders beyond `obeyed`, which the network of the file would not notice, are problems: one for each entry.
    pub(super) fn check_orders(&self, obeyed: &[MoteCommandKind], problems: &mut Vec<Problem>) {
        let mut unnoticed: Vec<&TimelineEntry> =
            self.entries.iter().filter(|entry| !obeyed.contains(&entry.order.kind())).collect();
        unnoticed.sort_by_key(|entry| entry.index);
        unnoticed.dedup_by_key(|entry| entry.index);
        for entry in unnoticed {
            let (order, why) = match entry.order {
                MoteOrder::Jam { .. } => ("jam", "it has no interference"),
                MoteOrder::Send { .. } => ("send", "it sends only the robots' payloads"),
                MoteOrder::Kill(_) | MoteOrder::Revive(_) | MoteOrder::Add(_) => continue,
            };
            problems.push(
                Problem::new(
                    format!("timeline[{}].order", entry.index),
                    format!("is not supported with netsim.mode = \"propagation-only\": {why}"),
                )
                .value(format!("{order:?}"))
                .nearest("netsim.mode = \"6tisch\""),
            );
        }
    }

    /// Only motes of `absent` can be added; an entry that names another is a problem.
    pub(super) fn check_added(&self, absent: &[MoteId], problems: &mut Vec<Problem>) {
        let mut added: Vec<(usize, u32)> = self
            .entries
            .iter()
            .filter_map(|entry| match entry.order {
                MoteOrder::Add(mote) if !absent.contains(&MoteId(mote)) => {
                    Some((entry.index, mote))
                }
                _ => None,
            })
            .collect();
        added.sort_unstable();
        for (index, mote) in added {
            problems.push(
                Problem::new(
                    format!("timeline[{index}].motes"),
                    "must be motes listed in netsim.absent, because all other motes are present from the beginning",
                )
                .value(mote),
            );
        }
    }
}

fn command(order: &MoteOrder, start_ns: u64) -> MoteCommand {
    let mut order = order.clone();
    if let MoteOrder::Jam { from_ns, until_ns, .. } = &mut order {
        *from_ns += start_ns;
        *until_ns += start_ns;
    }
    MoteCommand { source: SOURCE.to_owned(), order }
}

/// Reads the entries of the file `tree`, adding to `problems`. `agents` and `duration_s` are `None` where they are not known.
pub(super) fn read(
    tree: &Node,
    agents: Option<usize>,
    duration_s: Option<f64>,
    problems: &mut Vec<Problem>,
) -> (Timeline, Option<toml::Value>) {
    let mut alone = Node::empty_table();
    if let (Some(written), proto::config::Value::Table(entries)) =
        (tree.get("timeline"), &mut alone.value)
    {
        entries.push(("timeline".to_owned(), None, written.clone()));
    }
    let n_problems = problems.len();
    let mut table = check(&alone, "", &Entries::SPEC, &Lists::NONE, problems).table;
    let mut entries = Vec::new();
    for (index, keys) in Entries::read(&table).timeline.into_iter().enumerate() {
        let mut reader = EntryReader { index, agents, duration_s, problems };
        let (at_ns, orders) = reader.read(keys);
        entries.extend(orders.into_iter().map(|order| TimelineEntry { index, at_ns, order }));
    }
    let effective = table.remove("timeline");
    if problems.len() != n_problems {
        return (Timeline::default(), effective);
    }
    entries.sort_by_key(|entry| entry.at_ns);
    (Timeline { entries }, effective)
}

/// Reads an entry whose keys are known to be right, one by one.
struct EntryReader<'a> {
    index: usize,
    agents: Option<usize>,
    duration_s: Option<f64>,
    problems: &'a mut Vec<Problem>,
}

impl EntryReader<'_> {
    fn read(&mut self, keys: EntryKeys) -> (u64, Vec<MoteOrder>) {
        let at_s = keys.at_s;
        if let Some(duration_s) = self.duration_s.filter(|&duration_s| duration_s <= at_s) {
            let message = format!("must be less than experiment.duration_s, {duration_s}");
            self.refuse("at_s", message, at_s);
        }
        let orders = match keys.order {
            Some(Order::Kill(key)) => self.of_each(key, MoteOrder::Kill),
            Some(Order::Revive(key)) => self.of_each(key, MoteOrder::Revive),
            Some(Order::Add(key)) => self.of_each(key, MoteOrder::Add),
            Some(Order::Jam(jam)) => self.jam(at_s, jam),
            Some(Order::Send(send)) => self.send(send),
            None => Vec::new(),
        };
        (ns(at_s), orders)
    }

    fn jam(&mut self, at_s: f64, jam: Jam) -> Vec<MoteOrder> {
        let until_s = jam.until_s;
        if ns(until_s) <= ns(at_s) {
            self.refuse("until_s", format!("must be greater than at_s, {at_s}"), until_s);
        }
        let centre_m = [jam.x_m, jam.y_m];
        if jam.radius_m.is_none() {
            for (key, value) in ["x_m", "y_m"].into_iter().zip(centre_m) {
                if value != 0.0 {
                    self.refuse(key, "must be set together with radius_m".to_owned(), value);
                }
            }
        }
        let channels = jam.channels.unwrap_or_else(|| (11..=26).collect());
        let (from_ns, until_ns) = (ns(at_s), ns(until_s));
        let radius_m = jam.radius_m.unwrap_or(0.0);
        let jam = |channel| MoteOrder::Jam { channel, from_ns, until_ns, centre_m, radius_m };
        channels.into_iter().map(jam).collect()
    }

    fn send(&mut self, send: Send) -> Vec<MoteOrder> {
        let destination = match send.destination {
            Destination::Mote(mote) => {
                self.exists("destination", mote);
                mote
            }
            Destination::Broadcast(_) => u32::MAX,
        };
        let payload = match (send.payload, send.payload_hex) {
            (Some(text), None) => text.into_bytes(),
            (None, Some(digits)) => bytes_of(&digits).unwrap_or_else(|| {
                let message = "must be hexadecimal digits, two per byte".to_owned();
                self.refuse("payload_hex", message, format!("{digits:?}"));
                Vec::new()
            }),
            _ => {
                let message = "must have exactly one of the keys payload and payload_hex";
                self.problems.push(Problem::new(format!("timeline[{}]", self.index), message));
                Vec::new()
            }
        };
        let payload = bytes::Bytes::from(payload);
        let order = |mote| MoteOrder::Send { mote, destination, payload: payload.clone() };
        self.of_each(send.source, order)
    }

    /// An order for each mote that is named; those that do not exist are problems.
    fn of_each(&mut self, key: MotesKey, order: impl Fn(u32) -> MoteOrder) -> Vec<MoteOrder> {
        let motes = match key.motes {
            Motes::One(mote) => {
                self.exists("motes", mote);
                vec![mote]
            }
            Motes::Several(motes) => {
                for (place, &mote) in motes.iter().enumerate() {
                    self.exists(&format!("motes[{place}]"), mote);
                }
                motes
            }
        };
        motes.into_iter().map(order).collect()
    }

    fn exists(&mut self, key: &str, mote: u32) {
        if let Some(agents) = self.agents.filter(|&agents| agents <= mote as usize) {
            let path = format!("timeline[{}].{key}", self.index);
            let message = format!("must be the number of a mote, 0 to {}", agents - 1);
            self.problems.push(Problem::new(path, message).value(mote).nearest(agents - 1));
        }
    }

    fn refuse(&mut self, key: &str, message: String, value: impl ToString) {
        let path = format!("timeline[{}].{key}", self.index);
        self.problems.push(Problem::new(path, message).value(value));
    }
}

fn ns(time_s: f64) -> u64 {
    libm::round(time_s * NS_PER_S as f64) as u64
}

/// The bytes that hexadecimal digits stand for.
fn bytes_of(digits: &str) -> Option<Vec<u8>> {
    let digits: Vec<u32> = digits.chars().map(|c| c.to_digit(16)).collect::<Option<_>>()?;
    let pairs = digits.chunks_exact(2);
    pairs.remainder().is_empty().then(|| pairs.map(|pair| (pair[0] * 16 + pair[1]) as u8).collect())
}

/// An order in a few words, for messages.
#[must_use]
pub fn describe(entry: &TimelineEntry) -> String {
    let what = match &entry.order {
        MoteOrder::Kill(mote) => format!("kill mote {mote}"),
        MoteOrder::Revive(mote) => format!("revive mote {mote}"),
        MoteOrder::Add(mote) => format!("add mote {mote}"),
        MoteOrder::Jam { channel, .. } => format!("jam channel {channel}"),
        MoteOrder::Send { mote, .. } => format!("send from mote {mote}"),
    };
    format!("{what} at {} s", seconds(entry.at_ns))
}

#[cfg(test)]
mod tests;
