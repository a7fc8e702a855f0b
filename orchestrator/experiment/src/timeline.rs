//! `[[timeline]]`: faults and traffic that the experiment file orders, each at its time.

use proto::config::{
    Choice, Default, Field, Kind, Lists, Node, Problem, Range, TableSpec, Tag, Variant, Variants,
    check,
};
use proto::types::{MoteCommand, MoteCommandKind, MoteOrder, NS_PER_S, seconds};

/// Description of an entry.
pub const SPEC: TableSpec = TableSpec {
    doc: "A scheduled event of the network.",
    fields: &[Field {
        key: "at_s",
        doc: "Time of the event (s after the robots start, as duration_s). It takes effect at the beginning of the control \
              period that contains this time; noise starts and ends exactly on time.",
        kind: Kind::Number(Range::closed(0.0, 1e9)),
        default: Default::Required,
    }],
    tag: Some(&Tag {
        key: "order",
        doc: "The event.",
        default: None,
        variants: Variants::Fixed(&[
            Variant { name: "kill", doc: "The radio of a mote fails.", fields: &[MOTES] },
            Variant {
                name: "revive",
                doc: "The radio of a mote works again, as after a reboot.",
                fields: &[MOTES],
            },
            Variant {
                name: "add",
                doc: "A mote that netsim.absent leaves out joins the network.",
                fields: &[MOTES],
            },
            Variant {
                name: "jam",
                doc: "Noise on channels, everywhere or within a disc.",
                fields: &JAM,
            },
            Variant { name: "send", doc: "One additional packet.", fields: &SEND },
        ]),
    }),
};

/// The entries as a key of the whole file, so that they are checked like any other.
const SECTION: TableSpec = TableSpec {
    doc: "",
    fields: &[Field {
        key: "timeline",
        doc: "",
        kind: Kind::Tables(&SPEC),
        default: Default::Absent,
    }],
    tag: None,
};

const MOTE: Kind = Kind::Integer { min: 0, max: u32::MAX as i64 - 1 };

const MOTES: Field = Field {
    key: "motes",
    doc: "The mote, or a list of them.",
    kind: Kind::Either(&[MOTE, Kind::List { of: &MOTE, min: 1, max: usize::MAX }]),
    default: Default::Required,
};

const fn coordinate(key: &'static str, doc: &'static str) -> Field {
    Field {
        key,
        doc,
        kind: Kind::Number(Range::closed(-1e12, 1e12)),
        default: Default::Number(0.0),
    }
}

const JAM: [Field; 5] = [
    Field {
        key: "channels",
        doc: "IEEE 802.15.4 channels. Absent: all of them.",
        kind: Kind::List { of: &Kind::Integer { min: 11, max: 26 }, min: 1, max: 16 },
        default: Default::Absent,
    },
    Field {
        key: "until_s",
        doc: "End of the noise (s after the robots start).",
        kind: Kind::Number(Range::above(0.0, 1e9)),
        default: Default::Required,
    },
    coordinate("x_m", "Centre of the disc, east (m)."),
    coordinate("y_m", "Centre of the disc, north (m)."),
    Field {
        key: "radius_m",
        doc: "Radius of the disc (m). Absent: everywhere.",
        kind: Kind::Number(Range::above(0.0, 1e12)),
        default: Default::Absent,
    },
];

const SEND: [Field; 4] = [
    MOTES,
    Field {
        key: "destination",
        doc: "Destination mote, or \"all\": a broadcast to all motes in range.",
        kind: Kind::Either(&[
            MOTE,
            Kind::Choice(&[Choice { name: "all", doc: "All motes in range." }]),
        ]),
        default: Default::Required,
    },
    Field {
        key: "payload",
        doc: "Payload as text. Set exactly one of payload and payload_hex.",
        kind: Kind::Text,
        default: Default::Absent,
    },
    Field {
        key: "payload_hex",
        doc: "Payload as hexadecimal digits, two per byte.",
        kind: Kind::Text,
        default: Default::Absent,
    },
];

/// Who orders it, in records.
pub const SOURCE: &str = "timeline";

/// The orders of a file, earliest first.
#[derive(Clone, Debug, std::default::Default, PartialEq)]
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
    pub(super) fn check_added(&self, absent: &[u32], problems: &mut Vec<Problem>) {
        let mut added: Vec<(usize, u32)> = self
            .entries
            .iter()
            .filter_map(|entry| match entry.order {
                MoteOrder::Add(mote) if !absent.contains(&mote) => Some((entry.index, mote)),
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
    let mut table = check(&alone, "", &SECTION, &Lists::NONE, problems).table;
    let effective = table.remove("timeline");
    let mut entries = Vec::new();
    for (index, table) in effective.iter().flat_map(toml::Value::as_array).flatten().enumerate() {
        let Some(table) = table.as_table() else { continue };
        let mut entry = EntryReader { index, table, agents, duration_s, problems };
        let (at_ns, orders) = entry.read();
        entries.extend(orders.into_iter().map(|order| TimelineEntry { index, at_ns, order }));
    }
    if problems.len() != n_problems {
        return (Timeline::default(), effective);
    }
    entries.sort_by_key(|entry| entry.at_ns);
    (Timeline { entries }, effective)
}

/// Reads an entry whose keys are known to be right, one by one.
struct EntryReader<'a> {
    index: usize,
    table: &'a toml::Table,
    agents: Option<usize>,
    duration_s: Option<f64>,
    problems: &'a mut Vec<Problem>,
}

impl EntryReader<'_> {
    fn read(&mut self) -> (u64, Vec<MoteOrder>) {
        let at_s = self.number("at_s").unwrap_or(0.0);
        if let Some(duration_s) = self.duration_s.filter(|&duration_s| duration_s <= at_s) {
            let message = format!("must be less than experiment.duration_s, {duration_s}");
            self.refuse("at_s", message, at_s);
        }
        let of_each = |motes: Vec<u32>, order: fn(u32) -> MoteOrder| {
            motes.into_iter().map(order).collect::<Vec<_>>()
        };
        let orders = match self.table.get("order").and_then(toml::Value::as_str) {
            Some("kill") => of_each(self.motes(), MoteOrder::Kill),
            Some("revive") => of_each(self.motes(), MoteOrder::Revive),
            Some("add") => of_each(self.motes(), MoteOrder::Add),
            Some("jam") => self.jam(at_s),
            Some("send") => self.send(),
            _ => Vec::new(),
        };
        (ns(at_s), orders)
    }

    fn jam(&mut self, at_s: f64) -> Vec<MoteOrder> {
        let until_s = self.number("until_s").unwrap_or(0.0);
        if ns(until_s) <= ns(at_s) {
            self.refuse("until_s", format!("must be greater than at_s, {at_s}"), until_s);
        }
        let channels: Vec<u32> = match self.table.get("channels").and_then(toml::Value::as_array) {
            Some(list) => list.iter().filter_map(to_u32).collect(),
            None => (11..=26).collect(),
        };
        let radius_m = self.number("radius_m").unwrap_or(0.0);
        if self.table.get("radius_m").is_none() {
            for key in ["x_m", "y_m"] {
                if let Some(value) = self.number(key).filter(|&value| value != 0.0) {
                    self.refuse(key, "must be set together with radius_m".to_owned(), value);
                }
            }
        }
        let centre_m = ["x_m", "y_m"].map(|key| self.number(key).unwrap_or(0.0));
        let (from_ns, until_ns) = (ns(at_s), ns(until_s));
        let jam = |channel| MoteOrder::Jam { channel, from_ns, until_ns, centre_m, radius_m };
        channels.into_iter().map(jam).collect()
    }

    fn send(&mut self) -> Vec<MoteOrder> {
        let destination = match self.table.get("destination").and_then(to_u32) {
            Some(mote) => {
                self.exists("destination", mote);
                mote
            }
            None => u32::MAX,
        };
        let text = |key: &str| self.table.get(key).and_then(toml::Value::as_str);
        let payload = match (text("payload"), text("payload_hex")) {
            (Some(text), None) => text.as_bytes().to_vec(),
            (None, Some(digits)) => match bytes_of(digits) {
                Some(bytes) => bytes,
                None => {
                    let digits = format!("{digits:?}");
                    self.refuse(
                        "payload_hex",
                        "must be hexadecimal digits, two per byte".to_owned(),
                        digits,
                    );
                    Vec::new()
                }
            },
            _ => {
                let message = "must have exactly one of the keys payload and payload_hex";
                self.problems.push(Problem::new(format!("timeline[{}]", self.index), message));
                Vec::new()
            }
        };
        let payload = bytes::Bytes::from(payload);
        let send = |mote| MoteOrder::Send { mote, destination, payload: payload.clone() };
        self.motes().into_iter().map(send).collect()
    }

    /// The motes named; those that do not exist are problems.
    fn motes(&mut self) -> Vec<u32> {
        match self.table.get("motes") {
            Some(toml::Value::Array(list)) => {
                let motes: Vec<u32> = list.iter().filter_map(to_u32).collect();
                for (place, &mote) in motes.iter().enumerate() {
                    self.exists(&format!("motes[{place}]"), mote);
                }
                motes
            }
            one => {
                let mote = one.and_then(to_u32);
                if let Some(mote) = mote {
                    self.exists("motes", mote);
                }
                mote.into_iter().collect()
            }
        }
    }

    fn exists(&mut self, key: &str, mote: u32) {
        if let Some(agents) = self.agents.filter(|&agents| agents <= mote as usize) {
            let path = format!("timeline[{}].{key}", self.index);
            let message = format!("must be the number of a mote, 0 to {}", agents - 1);
            self.problems.push(Problem::new(path, message).value(mote).nearest(agents - 1));
        }
    }

    fn number(&self, key: &str) -> Option<f64> {
        self.table.get(key).and_then(toml::Value::as_float)
    }

    fn refuse(&mut self, key: &str, message: String, value: impl ToString) {
        let path = format!("timeline[{}].{key}", self.index);
        self.problems.push(Problem::new(path, message).value(value));
    }
}

fn to_u32(value: &toml::Value) -> Option<u32> {
    value.as_integer().and_then(|value| u32::try_from(value).ok())
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
