//! The `[output]` section: which tables a run leaves, how often, and which links.

use proto::config::{
    Default as Absence, Field, Kind, Node, Problem, Range, TableSpec, Tag, Variant, check,
};
use proto::types::DeliveryColumn;

/// What a run leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputConfig {
    /// Write `run.mcap`. Without it the run can be neither replayed nor verified step by step.
    pub mcap: bool,
    /// Write `steps.parquet`.
    pub steps: bool,
    /// Write `packets.parquet`.
    pub packets: bool,
    /// Write `motes.parquet`.
    pub motes: bool,
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
}

impl Default for OutputConfig {
    fn default() -> Self {
        read(&Node::empty_table(), "output", &mut Vec::new()).0
    }
}

/// Reads the section at `path`, adding to `problems`. Returns it with its effective table.
pub fn read(node: &Node, path: &str, problems: &mut Vec<Problem>) -> (OutputConfig, toml::Table) {
    let table = check(node, path, &SPEC, problems).table;
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
    let config = OutputConfig {
        mcap: flag("mcap"),
        steps: flag("steps"),
        packets: flag("packets"),
        motes: flag("motes"),
        links,
        every_steps: u64::try_from(every_steps).unwrap_or(1).max(1),
        report: flag("report"),
    };
    (config, table)
}

/// The description of the section.
pub const SPEC: TableSpec = TableSpec {
    doc: "What a run leaves beside its configuration, summary and provenance.",
    fields: &[
        flag("mcap", "Write run.mcap, the messages exchanged. Replaying and verifying need it."),
        flag("steps", "Write steps.parquet: where each agent was and how many it heard."),
        flag("packets", "Write packets.parquet: each transmission and how many heard it."),
        flag("motes", "Write motes.parquet: the state of each mote."),
        Field {
            key: "every_steps",
            doc: "The tables hold every so many steps. run.mcap always holds all.",
            kind: Kind::Integer { min: 1, max: 1_000_000_000 },
            default: Absence::Integer(1),
        },
        flag("report", "Write report.html."),
    ],
    tag: Some(&Tag {
        key: "links",
        doc: "Which links links.parquet holds: a link is a transmission and an agent that might hear it.",
        default: Some("heard"),
        variants: links,
    }),
};

fn links() -> Vec<Variant> {
    vec![
        Variant { name: "none", doc: "No links: the file is not written.", fields: &[] },
        Variant { name: "heard", doc: "Links over which something was heard.", fields: &[] },
        Variant {
            name: "sample",
            doc: "A random sample of all links, heard or not.",
            fields: &[LINKS_SAMPLE],
        },
        Variant {
            name: "all",
            doc: "Every link, heard or not: 2500 robots have six million in each step.",
            fields: &[],
        },
    ]
}

const LINKS_SAMPLE: Field = Field {
    key: "links_sample",
    doc: "The chance of each link to be in the sample.",
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

    fn of(text: &str) -> (OutputConfig, Vec<String>) {
        let mut problems = Vec::new();
        let (config, _) = read(&parse(text).unwrap(), "output", &mut problems);
        (config, problems.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn an_absent_section_records_everything_and_the_links_that_were_heard() {
        let config = OutputConfig::default();
        assert!(config.mcap && config.steps && config.packets && config.motes && config.report);
        assert_eq!((config.links, config.every_steps), (Links::Heard, 1));
    }

    #[test]
    fn each_choice_of_links_is_read() {
        assert_eq!(of("links = \"none\"").0.links, Links::None);
        assert_eq!(of("links = \"all\"").0.links, Links::All);
        let sampled = of("links = \"sample\"\nlinks_sample = 0.5").0;
        assert_eq!(sampled.links, Links::Sample { fraction: 0.5 });
        assert!(of("links = \"none\"").0.columns().is_empty());
    }

    #[test]
    fn every_problem_is_named_with_its_range() {
        let (_, problems) = of("links_sample = 2\nevery_steps = 0\nmcpa = true\nreport = 1");
        assert_eq!(
            problems,
            [
                "output.every_steps: must be a whole number from 1 to 1000000000, got 0 (nearest valid: 1)",
                "output.report: must be true or false, got 1",
                "output.links_sample: does not go with links = \"heard\", only with \"sample\"",
                "output.mcpa: is not a known key (nearest valid: mcap)",
            ]
        );
    }
}
