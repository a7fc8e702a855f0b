//! The `[output]` section: which tables a run leaves, how often, and which links.

use proto::config::{Lists, Node, Problem, Section, check};
use proto::types::{DeliveryColumn, NS_PER_S, NetRecord};

/// Files that a run writes in addition to its configuration, summary and provenance.
#[derive(Clone, Copy, Debug, PartialEq, Section)]
pub struct OutputConfig {
    /// The links that links.parquet holds. A link is a transmission and a potential receiver.
    #[key(tag, default = "heard")]
    pub links: Links,
    /// Write run.mcap, the exchanged messages. Replay and verification require it.
    #[key(default = true)]
    pub mcap: bool,
    /// Write scene.mcap: robots, links, place and events as 3-D viewers draw them.
    #[key(default = true)]
    pub scene: bool,
    /// Interval between pictures of robots and links in scene.mcap (s of simulated time). Absent: every step.
    #[key(range = 1e-9..=1e9)]
    pub scene_every_s: Option<f64>,
    /// Write steps.parquet: the position of each agent and how many others it heard.
    #[key(default = true)]
    pub steps: bool,
    /// Write transmissions.parquet: the messages of the robots, and how many robots received each.
    #[key(default = true)]
    pub transmissions: bool,
    /// Write packets.parquet: each packet of the network that was delivered or dropped.
    #[key(default = true)]
    pub packets: bool,
    /// Write motes.parquet: the state and the statistics of each mote.
    #[key(default = true)]
    pub motes: bool,
    /// Interval at which motes are queried for their statistics for motes.parquet (s of simulated time), at steps that every_steps
    /// selects and at the end. Absent: at each of these steps.
    #[key(range = 1e-9..=1e9)]
    pub motes_every_s: Option<f64>,
    /// Write schedule.parquet: the cells of every mote when the network has formed and at the end of the run.
    #[key(default = true)]
    pub schedule: bool,
    /// Write neighbours.parquet: how many frames each mote has heard from each other mote, at the same times.
    #[key(default = true)]
    pub neighbours: bool,
    /// Keep each frame of a network with protocols, in run.mcap and frames.parquet: the way of a packet from hop to hop.
    #[key(default = true)]
    pub frames: bool,
    /// Write radio.pcap: the radio's traffic, as IEEE 802.15.4 TAP that Wireshark reads.
    #[key(default = false)]
    pub pcap: bool,
    /// Interval of the tables (steps). run.mcap always holds all steps.
    #[key(range = 1..=1_000_000_000, default = 1)]
    pub every_steps: u64,
    /// Write report.html.
    #[key(default = true)]
    pub report: bool,
}

/// Which links `links.parquet` holds.
#[derive(Clone, Copy, Debug, PartialEq, Section)]
pub enum Links {
    /// No links: the file is not written.
    None,
    /// Links with a received frame.
    Heard,
    /// A random sample of all links, received or not.
    Sample {
        /// Probability that a link is in the sample.
        #[key(name = "links_sample", above = 0.0, most = 1.0, default = 0.01)]
        fraction: f64,
    },
    /// Every link, received or not; 2500 robots have six million links per step.
    All,
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

    /// Simulated time between pictures of the swarm in `scene.mcap` (ns); `None`: at each step.
    #[must_use]
    pub fn scene_every_ns(&self) -> Option<u64> {
        self.scene_every_s.map(ns)
    }

    /// Whether `motes.parquet` holds a step that goes from `from_ns` to `until_ns`.
    #[must_use]
    pub fn holds_motes(&self, step: u64, from_ns: u64, until_ns: u64) -> bool {
        let is_time = |every_s| from_ns / ns(every_s) != until_ns / ns(every_s);
        self.motes && self.includes_step(step) && self.motes_every_s.is_none_or(is_time)
    }
}

impl Default for OutputConfig {
    fn default() -> Self {
        read(&Node::empty_table(), "output", &mut Vec::new()).0
    }
}

/// Reads the section at `path`, adding to `problems`. Returns it with its effective table.
pub fn read(node: &Node, path: &str, problems: &mut Vec<Problem>) -> (OutputConfig, toml::Table) {
    let table = check(node, path, &OutputConfig::SPEC, &Lists::NONE, problems).table;
    (OutputConfig::read(&table), table)
}

/// An interval in ns, at least 1: the range of the key begins there.
fn ns(every_s: f64) -> u64 {
    (libm::round(every_s * NS_PER_S as f64) as u64).max(1)
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
