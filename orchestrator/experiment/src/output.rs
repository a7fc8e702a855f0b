//! The `[output]` section: which tables a run leaves, how often, and which links.

use proto::config::{
    Default as Absence, Field, Kind, Lists, Node, Problem, Range, TableSpec, Tag, Variant,
    Variants, check,
};
use proto::types::{DeliveryColumn, NS_PER_S, NetRecord};

/// What a run leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputConfig {
    /// Write `run.mcap`. Without it the run can be neither replayed nor verified step by step.
    pub mcap: bool,
    /// Write `scene.mcap`.
    pub scene: bool,
    /// Simulated time between pictures of the swarm in `scene.mcap` (ns); `None`: at each step.
    pub scene_every_ns: Option<u64>,
    /// Write `steps.parquet`.
    pub steps: bool,
    /// Write `transmissions.parquet`.
    pub transmissions: bool,
    /// Write `packets.parquet`, if the network has packets to tell of.
    pub packets: bool,
    /// Write `motes.parquet`.
    pub motes: bool,
    /// Simulated time between rows of a mote (ns), beside [`Self::every_steps`]; `None`: as often as that says.
    pub motes_every_ns: Option<u64>,
    /// Write `schedule.parquet`, if the network has schedules.
    pub schedule: bool,
    /// Write `neighbours.parquet`, if the network keeps who has heard whom.
    pub neighbours: bool,
    /// Write `frames.parquet`, if the network keeps its frames.
    pub frames: bool,
    /// Write `radio.pcap`, if the network keeps its radio traffic.
    pub pcap: bool,
    /// Which links `links.parquet` holds.
    pub links: Links,
    /// Tables hold every so many steps, at least 1. `run.mcap` always holds every step.
    pub every_steps: u64,
    /// Write `report.html`.
    pub report: bool,
}

/// Which links `links.parquet` holds. A link is a transmission and an agent that might hear it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Links {
    /// Every link, heard or not.
    All,
    /// Those over which something was heard.
    Heard,
    /// None: the file is not written.
    None,
    /// A sample of all, heard or not.
    Sample {
        /// The chance of each link to be in the sample, greater than 0 and at most 1.
        fraction: f64,
    },
}

impl OutputConfig {
    /// The optional columns that the tables can use, to be asked of a network that announces them.
    #[must_use]
    pub fn columns(&self) -> &'static [DeliveryColumn] {
        match self.links {
            Links::None => &[],
            Links::All | Links::Heard | Links::Sample { .. } => {
                &[DeliveryColumn::ReceivedNs, DeliveryColumn::RssiDbm, DeliveryColumn::Hops]
            }
        }
    }

    /// The records that tables, summary and report can use, to be asked of a network that announces them. Packets and
    /// statistics are the network's figures in the summary: they are wanted whatever tables there are.
    #[must_use]
    pub fn records(&self) -> Vec<NetRecord> {
        let wanted = [
            (true, NetRecord::Packets),
            (true, NetRecord::Statistics),
            (self.pcap, NetRecord::Capture),
            (self.frames, NetRecord::Frames),
            (self.schedule || self.report, NetRecord::Schedule),
            (self.neighbours || self.report, NetRecord::HeardLinks),
        ];
        wanted.into_iter().filter_map(|(is_wanted, record)| is_wanted.then_some(record)).collect()
    }

    /// Whether the tables hold a step.
    #[must_use]
    pub fn includes_step(&self, step: u64) -> bool {
        step.is_multiple_of(self.every_steps)
    }

    /// Whether `motes.parquet` holds a step that goes from `from_ns` to `until_ns`.
    #[must_use]
    pub fn holds_motes(&self, step: u64, from_ns: u64, until_ns: u64) -> bool {
        let is_time = |every_ns| from_ns / every_ns != until_ns / every_ns;
        self.motes && self.includes_step(step) && self.motes_every_ns.is_none_or(is_time)
    }
}

impl Default for OutputConfig {
    fn default() -> Self {
        read(&Node::empty_table(), "output", &mut Vec::new()).0
    }
}

/// Reads the section at `path`, adding to `problems`. Returns it with its effective table.
pub fn read(node: &Node, path: &str, problems: &mut Vec<Problem>) -> (OutputConfig, toml::Table) {
    let table = check(node, path, &SPEC, &Lists::NONE, problems).table;
    let flag = |key: &str| table.get(key).and_then(toml::Value::as_bool).unwrap_or(true);
    let links = match table.get("links").and_then(toml::Value::as_str) {
        Some("all") => Links::All,
        Some("none") => Links::None,
        Some("sample") => Links::Sample {
            fraction: table.get("links_sample").and_then(toml::Value::as_float).unwrap_or(0.01),
        },
        _ => Links::Heard,
    };
    let every_steps = table.get("every_steps").and_then(toml::Value::as_integer).unwrap_or(1);
    // At least a nanosecond: the range of the key begins there.
    let every_ns = |key: &str| {
        let every_s = table.get(key).and_then(toml::Value::as_float);
        every_s.map(|every_s| (libm::round(every_s * NS_PER_S as f64) as u64).max(1))
    };
    let config = OutputConfig {
        mcap: flag("mcap"),
        scene: flag("scene"),
        scene_every_ns: every_ns("scene_every_s"),
        steps: flag("steps"),
        transmissions: flag("transmissions"),
        packets: flag("packets"),
        motes: flag("motes"),
        motes_every_ns: every_ns("motes_every_s"),
        schedule: flag("schedule"),
        neighbours: flag("neighbours"),
        frames: flag("frames"),
        pcap: table.get("pcap").and_then(toml::Value::as_bool).unwrap_or(false),
        links,
        every_steps: u64::try_from(every_steps).unwrap_or(1).max(1),
        report: flag("report"),
    };
    (config, table)
}

/// The description of the section.
pub const SPEC: TableSpec = TableSpec {
    doc: "Files that a run writes in addition to its configuration, summary and provenance.",
    fields: &[
        flag("mcap", "Write run.mcap, the exchanged messages. Replay and verification require it."),
        flag(
            "scene",
            "Write scene.mcap: robots, links, place and events as 3-D viewers draw them.",
        ),
        Field {
            key: "scene_every_s",
            doc: "Interval between pictures of robots and links in scene.mcap (s of simulated time). Absent: every step.",
            kind: Kind::Number(Range::closed(1e-9, 1e9)),
            default: Absence::Absent,
        },
        flag(
            "steps",
            "Write steps.parquet: the position of each agent and how many others it heard.",
        ),
        flag(
            "transmissions",
            "Write transmissions.parquet: the messages of the robots, and how many robots received each.",
        ),
        flag(
            "packets",
            "Write packets.parquet: each packet of the network that was delivered or dropped.",
        ),
        flag("motes", "Write motes.parquet: the state and the statistics of each mote."),
        Field {
            key: "motes_every_s",
            doc: "Interval at which motes are queried for their statistics for motes.parquet (s of simulated time), at \
                  steps that every_steps selects and at the end. Absent: at each of these steps.",
            kind: Kind::Number(Range::closed(1e-9, 1e9)),
            default: Absence::Absent,
        },
        flag(
            "schedule",
            "Write schedule.parquet: the cells of every mote when the network has formed and at the end of the run.",
        ),
        flag(
            "neighbours",
            "Write neighbours.parquet: how many frames each mote has heard from each other mote, at the same times.",
        ),
        flag(
            "frames",
            "Keep each frame of a network with protocols, in run.mcap and frames.parquet: the way of a packet from hop to hop.",
        ),
        Field {
            key: "pcap",
            doc: "Write radio.pcap: the radio's traffic, as IEEE 802.15.4 TAP that Wireshark reads.",
            kind: Kind::Bool,
            default: Absence::Bool(false),
        },
        Field {
            key: "every_steps",
            doc: "Interval of the tables (steps). run.mcap always holds all steps.",
            kind: Kind::Integer { min: 1, max: 1_000_000_000 },
            default: Absence::Integer(1),
        },
        flag("report", "Write report.html."),
    ],
    tag: Some(&Tag {
        key: "links",
        doc: "The links that links.parquet holds. A link is a transmission and a potential receiver.",
        default: Some("heard"),
        variants: Variants::Fixed(LINKS),
    }),
};

const LINKS: &[Variant] = &[
    Variant { name: "none", doc: "No links: the file is not written.", fields: &[] },
    Variant { name: "heard", doc: "Links with a received frame.", fields: &[] },
    Variant {
        name: "sample",
        doc: "A random sample of all links, received or not.",
        fields: &[LINKS_SAMPLE],
    },
    Variant {
        name: "all",
        doc: "Every link, received or not; 2500 robots have six million links per step.",
        fields: &[],
    },
];

const LINKS_SAMPLE: Field = Field {
    key: "links_sample",
    doc: "Probability that a link is in the sample.",
    kind: Kind::Number(Range::above(0.0, 1.0)),
    default: Absence::Number(0.01),
};

const fn flag(key: &'static str, doc: &'static str) -> Field {
    Field { key, doc, kind: Kind::Bool, default: Absence::Bool(true) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::config::parse;

    fn parse_output(text: &str) -> (OutputConfig, Vec<String>) {
        let mut problems = Vec::new();
        let (config, _) = read(&parse(text).unwrap(), "output", &mut problems);
        (config, problems.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn an_absent_section_records_everything_and_the_links_that_were_heard() {
        let config = OutputConfig::default();
        assert!(config.mcap && config.steps && config.packets && config.motes && config.report);
        assert!(config.transmissions && config.schedule && config.neighbours && !config.pcap);
        assert_eq!((config.links, config.every_steps), (Links::Heard, 1));
    }

    #[test]
    fn each_choice_of_links_is_read() {
        assert_eq!(parse_output("links = \"none\"").0.links, Links::None);
        assert_eq!(parse_output("links = \"all\"").0.links, Links::All);
        let sampled = parse_output("links = \"sample\"\nlinks_sample = 0.5").0;
        assert_eq!(sampled.links, Links::Sample { fraction: 0.5 });
        assert!(parse_output("links = \"none\"").0.columns().is_empty());
    }

    #[test]
    fn motes_are_held_when_a_multiple_of_their_time_is_reached() {
        let config = parse_output("motes_every_s = 1.0").0;
        let held = |from_ms: u64, until_ms: u64| {
            config.holds_motes(1, from_ms * 1_000_000, until_ms * 1_000_000)
        };
        assert_eq!([held(0, 999), held(900, 1000), held(1000, 1999)], [false, true, false]);
        // A period longer than that holds them every time.
        assert!(held(1500, 6500));
        assert!(
            parse_output("").0.holds_motes(1, 0, 1)
                && !parse_output("motes = false").0.holds_motes(1, 0, 1)
        );
    }

    #[test]
    fn what_nobody_will_look_at_is_not_asked_for() {
        let nothing = "report = false\nschedule = false\nneighbours = false\nframes = false";
        let records = parse_output(nothing).0.records();
        assert_eq!(records, [NetRecord::Packets, NetRecord::Statistics]);
        assert!(parse_output("pcap = true").0.records().contains(&NetRecord::Capture));
    }

    #[test]
    fn every_problem_is_named_with_its_range() {
        let (_, problems) =
            parse_output("links_sample = 2\nevery_steps = 0\nmcpa = true\nreport = 1");
        assert_eq!(
            problems,
            [
                "output.every_steps: must be a whole number from 1 to 1000000000, got 0 (nearest valid: 1)",
                "output.report: must be true or false, got 1",
                "output.links_sample: does not apply with links = \"heard\", only with \"sample\"",
                "output.mcpa: is not a known key (nearest valid: mcap)",
            ]
        );
    }
}
