//! `[[netsim.app]]`: who sends how much to whom.

use proto::config::{
    Choice, Default, Field, Kind, Problem, Range, TableSpec, Tag, Variant, Variants, join, typed,
};
use proto::types::NS_PER_S;
use serde::{Deserialize, Serialize};

/// Description of `[[netsim.app]]`.
pub const SPEC: TableSpec = TableSpec {
    doc: "An application that generates packets at motes.",
    fields: &[
        Field {
            key: "senders",
            doc: "The motes that send.",
            kind: Kind::Either(&[
                Kind::Choice(&[Choice { name: "all", doc: "All motes that have a destination." }]),
                Kind::List {
                    of: &Kind::Integer { min: 0, max: u32::MAX as i64 },
                    min: 1,
                    max: usize::MAX,
                },
            ]),
            default: Default::Text("all"),
        },
        Field {
            key: "destination",
            doc: "The destination: one of these, or the number of a mote.",
            kind: Kind::Either(&[
                Kind::Choice(&[
                    Choice { name: "root", doc: "The root of the sender's DODAG." },
                    Choice { name: "peers", doc: "A random other mote for each packet." },
                    Choice { name: "all", doc: "All other motes in turn." },
                ]),
                Kind::Integer { min: 0, max: u32::MAX as i64 },
            ]),
            default: Default::Text("root"),
        },
        Field {
            key: "payload_bytes",
            doc: "UDP payload of a packet. With headers it must stay below the minimum MTU of IPv6, 1280 bytes.",
            kind: Kind::Integer { min: 1, max: MAX_PAYLOAD_BYTES },
            default: Default::Integer(30),
        },
    ],
    tag: Some(&TAG),
};

const TAG: Tag = Tag {
    key: "kind",
    doc: "The traffic pattern.",
    default: Some(PERIODIC.name),
    variants: Variants::Fixed(&[PERIODIC, BURST]),
};

const PERIODIC: Variant = Variant {
    name: "periodic",
    doc: "Periodically, from the time at which the mote may send.",
    fields: &[
        Field {
            key: "period_s",
            doc: "Mean time between two packets of a mote (s). 60: the 6TiSCH simulator.",
            kind: Kind::Number(Range::closed(1e-3, 1e6)),
            default: Default::Number(60.0),
        },
        Field {
            key: "jitter",
            doc: "Jitter: each interval is uniform within this fraction of period_s to either side. 0.05: the 6TiSCH \
                  simulator.",
            kind: Kind::Number(Range::closed(0.0, 0.99)),
            default: Default::Number(0.05),
        },
    ],
};

const BURST: Variant = Variant {
    name: "burst",
    doc: "One burst of packets.",
    fields: &[
        Field {
            key: "at_s",
            doc: "Delay after the time at which the mote may send (s).",
            kind: Kind::Number(Range::closed(0.0, 1e6)),
            default: Default::Required,
        },
        Field {
            key: "n_packets",
            doc: "How many.",
            kind: Kind::Integer { min: 1, max: 10_000 },
            default: Default::Integer(1),
        },
    ],
};

/// Longest UDP payload (bytes).
const MAX_PAYLOAD_BYTES: i64 = 1000;

/// When packets are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Pattern {
    /// Again and again.
    Periodic {
        /// Mean time between two packets (ns).
        period_ns: u64,
        /// Each such time is drawn uniformly, so far (ns) to either side; less than the period.
        jitter_ns: u64,
    },
    /// Several at once, once.
    Burst {
        /// So long (ns) after the mote may send.
        after_ns: u64,
        /// How many; at least 1.
        n_packets: u32,
    },
}

/// To whom packets are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Peer {
    /// The root of the sender's DODAG.
    Root,
    /// A mote.
    Mote(u32),
    /// Another mote, drawn for each packet.
    Random,
    /// Every other mote in turn: from a root, traffic down the network.
    All,
}

/// An application as configured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Spec {
    /// When packets are made: the pattern in time.
    pub pattern: Pattern,
    /// Destination of the packets.
    pub peer: Peer,
    /// UDP payload (bytes).
    pub payload_bytes: u16,
    /// By whom; `None`: by all that have somebody to send to.
    pub senders: Option<Vec<u32>>,
}

/// Keys of one table, those of the pattern apart.
#[derive(Deserialize)]
struct Keys {
    senders: Senders,
    destination: Destination,
    payload_bytes: u16,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Senders {
    Listed(Vec<u32>),
    All(serde::de::IgnoredAny),
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Destination {
    Mote(u32),
    Named(Named),
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Named {
    Root,
    Peers,
    All,
}

#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum PatternKeys {
    Periodic { period_s: f64, jitter: f64 },
    Burst { at_s: f64, n_packets: u32 },
}

impl Spec {
    /// Reads one table that [`SPEC`] has checked. `n_motes` bounds the numbers of motes. Appends what is wrong to `problems`.
    pub fn read(
        table: &toml::Table,
        path: &str,
        n_motes: u32,
        problems: &mut Vec<Problem>,
    ) -> Option<Self> {
        let before = problems.len();
        let keys: Keys = typed(table);
        let ns = |duration_s: f64| (duration_s * NS_PER_S as f64).round() as u64;
        let mut mote = |key: String, number: u32| {
            let valid = Some(number).filter(|&mote| mote < n_motes);
            if valid.is_none() {
                let last = n_motes.saturating_sub(1);
                let message = format!("must be the number of a mote, 0 to {last}");
                problems.push(Problem::new(key, message).value(number).nearest(last));
            }
            valid
        };

        let peer = match keys.destination {
            Destination::Mote(number) => mote(join(path, "destination"), number).map(Peer::Mote),
            Destination::Named(Named::Peers) => Some(Peer::Random),
            Destination::Named(Named::All) => Some(Peer::All),
            Destination::Named(Named::Root) => Some(Peer::Root),
        };
        let senders = match keys.senders {
            Senders::Listed(list) => {
                let motes = list.into_iter().enumerate().filter_map(|(index, number)| {
                    mote(join(path, &format!("senders[{index}]")), number)
                });
                Some(motes.collect())
            }
            Senders::All(_) => None,
        };
        let pattern = table.contains_key(TAG.key).then(|| typed::<PatternKeys>(table));
        let pattern = match pattern? {
            PatternKeys::Burst { at_s, n_packets } => {
                Pattern::Burst { after_ns: ns(at_s), n_packets }
            }
            PatternKeys::Periodic { period_s, jitter } => {
                let period_ns = ns(period_s);
                Pattern::Periodic { period_ns, jitter_ns: (period_ns as f64 * jitter) as u64 }
            }
        };
        if problems.len() != before {
            return None;
        }
        Some(Self { pattern, peer: peer?, payload_bytes: keys.payload_bytes, senders })
    }
}
