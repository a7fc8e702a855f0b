//! The keys of `[experiment]`.

use super::control;
use proto::config::{Choice, Default, Field, Kind, Range, TableSpec};

/// Keys of `[experiment]` on which no result depends.
pub const WITHOUT_EFFECT: [&str; 7] = [
    "transport",
    "tls",
    "step_deadline_s",
    "checkpoint_every_s",
    "restarts",
    "reconnect_limit_s",
    // What the file holds has an effect: warm_start_sha256.
    "warm_start",
];

/// Description of `[experiment]`.
pub const EXPERIMENT: TableSpec = TableSpec {
    doc: "The experiment: its name, seed, duration and number of robots, and how the two simulators are coupled.",
    fields: &[
        Field {
            key: "name",
            doc: "Name of the experiment and of the folder with its results: letters, digits, '-', '_' and '.'.",
            kind: Kind::Text,
            default: Default::Required,
        },
        Field {
            key: "seed",
            doc: "Seed of all random draws. The same seed and configuration give the same recording.",
            kind: Kind::Integer { min: 0, max: i64::MAX },
            default: Default::Required,
        },
        Field {
            key: "duration_s",
            doc: "Simulated time (s), from when the robots start. Rounded up to whole control periods.",
            kind: Kind::Number(Range::above(0.0, 1e9)),
            default: Default::Required,
        },
        Field {
            key: "agents",
            doc: "Number of robots, each with a radio.",
            kind: Kind::Integer { min: 1, max: proto::side::MAX_AGENTS as i64 },
            default: Default::Required,
        },
        Field {
            key: "coupling",
            doc: "How the two simulators are coupled.",
            kind: Kind::Choice(&[
                Choice {
                    name: "sequential",
                    doc: "Robots act on the messages received and move, then the network runs with their new positions.",
                },
                Choice {
                    name: "parallel",
                    doc: "Both simulators run at the same time, and robots receive messages one control period later.",
                },
            ]),
            default: Default::Text("sequential"),
        },
        Field {
            key: "control_period",
            doc: "The control period, in which robots act once: a slotframe, up to each delivered packet, { slots = n } or \
                  { rate_hz = r }.",
            kind: Kind::Either(&[
                Kind::Choice(&[
                    Choice {
                        name: "slotframe",
                        doc: "One slotframe of the network. Without protocols it has one slot per agent; with them it is \
                              that of the scheduling function, or the broadcast slotframe of the payloads.",
                    },
                    Choice {
                        name: "packet",
                        doc: "Until a packet is delivered, at most one slotframe.",
                    },
                ]),
                Kind::Table(&control::SPEC),
            ]),
            default: Default::Text("slotframe"),
        },
        Field {
            key: "start",
            doc: "When the robots start. Absent: when the network has formed, or at once if there is no network formation.",
            kind: Kind::Choice(&[
                Choice {
                    name: "when-formed",
                    doc: "They stand still until the network has formed; this time does not count towards duration_s.",
                },
                Choice {
                    name: "at-once",
                    doc: "At time 0, whether the network has formed or not.",
                },
            ]),
            default: Default::Absent,
        },
        Field {
            key: "formation_limit_s",
            doc: "Timeout of network formation (s of simulated time). If the network has not formed by then, the run fails \
                  and lists the missing motes with the reason.",
            kind: Kind::Number(Range::above(0.0, 1e9)),
            default: Default::Number(3600.0),
        },
        Field {
            key: "warm_start",
            doc: "Path of a formed network that murmuration run --save-formed wrote, relative to this file. The run starts from \
                  it instead of forming the network: positions, shadowing and clock rates are those of the file, all later \
                  random draws come from seed.",
            kind: Kind::Text,
            default: Default::Absent,
        },
        Field {
            key: "warm_start_sha256",
            doc: "SHA-256 of the file of warm_start, in hexadecimal: the program refuses another file. A run from a formed \
                  network writes this key to its config.toml.",
            kind: Kind::Text,
            default: Default::Absent,
        },
        Field {
            key: "stop_when_complete",
            doc: "Whether to end the run when the robots report their task complete.",
            kind: Kind::Bool,
            default: Default::Bool(true),
        },
        Field {
            key: "transport",
            doc: "Transport of the step requests. Results do not depend on it.",
            kind: Kind::Choice(&[
                Choice {
                    name: "auto",
                    doc: "One gRPC stream if the simulator supports sessions, otherwise single calls.",
                },
                Choice {
                    name: "stream",
                    doc: "One gRPC stream; refused if a simulator does not support sessions.",
                },
                Choice { name: "unary", doc: "Single calls." },
            ]),
            default: Default::Text("auto"),
        },
        Field {
            key: "step_deadline_s",
            doc: "Timeout of one step (s of real time) for a simulator that is alive. A simulator that shows no sign of \
                  life is abandoned after about five seconds.",
            kind: Kind::Number(Range::closed(1.0, 86_400.0)),
            default: Default::Number(60.0),
        },
        Field {
            key: "accept_commands",
            doc: "Whether other programs may give orders to the simulators that the run starts; it prints where, and a token.",
            kind: Kind::Bool,
            default: Default::Absent,
        },
        Field {
            key: "checkpoint_every_s",
            doc: "Interval of checkpoints (s of real time); 0: none. After a failure the run continues from the latest one. \
                  Requires output.mcap. Results do not depend on it.",
            kind: Kind::Number(Range::closed(0.0, 1e6)),
            default: Default::Number(60.0),
        },
        Field {
            key: "restarts",
            doc: "How often a run continues from its latest checkpoint when a simulator died or was lost; 0: it fails \
                  instead.",
            kind: Kind::Integer { min: 0, max: 1000 },
            default: Default::Integer(3),
        },
        Field {
            key: "reconnect_limit_s",
            doc: "How long to wait for a lost simulator on another host before the run fails (s of real time).",
            kind: Kind::Number(Range::closed(0.0, 86_400.0)),
            default: Default::Number(60.0),
        },
        Field {
            key: "tls",
            doc: "Certificates for simulators on other hosts.",
            kind: Kind::Table(&TLS),
            default: Default::Absent,
        },
    ],
    tag: None,
};

const TLS: TableSpec = TableSpec {
    doc: "Certificates, as paths of PEM files.",
    fields: &[
        Field {
            key: "ca",
            doc: "Certificate authority that signed the simulators' certificates.",
            kind: Kind::Text,
            default: Default::Required,
        },
        Field {
            key: "cert",
            doc: "Client certificate, for simulators that require one.",
            kind: Kind::Text,
            default: Default::Absent,
        },
        Field {
            key: "key",
            doc: "Private key of the client certificate.",
            kind: Kind::Text,
            default: Default::Absent,
        },
    ],
    tag: None,
};
