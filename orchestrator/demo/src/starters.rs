//! Starter experiments: what `new` writes.

use crate::campaign::{self, LinkCampaign, TrackCampaign};

/// What a starter is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum StarterKind {
    /// Robots follow a leader, and hear of each other by radio only
    Flocking,
    /// Robots form a straight line
    Formation,
    /// Stationary sensors report to a base over 6TiSCH
    Sensors,
    /// Robots map a building and report to a base over 6TiSCH
    Exploration,
    /// A model of the radio, and measured links to compare it with
    MeasuredLinks,
    /// A model of robots, and measured tracks to compare it with
    MeasuredRobots,
}

/// A file of a starter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StarterFile {
    /// Its name within the folder.
    pub name: &'static str,
    /// Its text.
    pub text: String,
}

/// The effect that the starter's model of the radio lacks.
const MISSING_FROM_LINKS: &str = "\n# The effect that model.toml lacks.\n[[netsim.phy.effect]]\nkind = \"wall-attenuation\"\nloss_db = 5.0\n";

/// The effect that the starter's model of robots lacks.
const MISSING_FROM_ROBOTS: &str = "\n# The effect that model.toml lacks.\n[[robotsim.dynamics.effect]]\nkind = \"wind\"\nvelocity_mps = [0.06, -0.04, 0.0]\n";

/// Seed of the simulated measurements.
const SEED: u64 = 1;

impl StarterKind {
    /// The files of the starter. `name`: name of the experiment; `program`: name of the program, for commands in comments.
    ///
    /// # Errors
    ///
    /// The measurements cannot be simulated.
    pub fn files(self, name: &str, program: &str) -> Result<Vec<StarterFile>, String> {
        let text = |template: &str| template.replace("@NAME@", name).replace("@PROGRAM@", program);
        let experiment = |template| StarterFile { name: "experiment.toml", text: text(template) };
        Ok(match self {
            Self::Flocking => vec![experiment(include_str!("starters/flocking.toml"))],
            Self::Formation => vec![experiment(include_str!("starters/formation.toml"))],
            Self::Sensors => vec![experiment(include_str!("starters/sensors.toml"))],
            Self::Exploration => vec![
                experiment(include_str!("starters/exploration.toml")),
                StarterFile {
                    name: "start.csv",
                    text: include_str!("starters/exploration.csv").to_owned(),
                },
            ],
            Self::MeasuredLinks => measured(
                &text(include_str!("starters/measured-links.toml")),
                MISSING_FROM_LINKS,
                "links.csv",
                &LINKS.template(),
            )?,
            Self::MeasuredRobots => measured(
                &text(include_str!("starters/measured-robots.toml")),
                MISSING_FROM_ROBOTS,
                "tracks.csv",
                &TRACKS.template(),
            )?,
        })
    }

    /// The file of measurements, if the starter is about measurements.
    fn data(self) -> Option<&'static str> {
        match self {
            Self::MeasuredLinks => Some("links.csv"),
            Self::MeasuredRobots => Some("tracks.csv"),
            Self::Flocking | Self::Formation | Self::Sensors | Self::Exploration => None,
        }
    }

    /// Commands to type next, within the folder of the starter, without the name of the program.
    #[must_use]
    pub fn next_commands(self) -> Vec<String> {
        match self.data() {
            Some(data) => ["check", "compare", "diagnose"]
                .map(|command| format!("{command} model.toml --data {data}"))
                .to_vec(),
            None => vec!["run experiment.toml".to_owned(), "run experiment.toml --live".to_owned()],
        }
    }
}

/// A model, the model with the missing effect, and measurements that the second one makes. `template`: rows to measure (CSV).
fn measured(
    model: &str,
    missing: &str,
    data: &'static str,
    template: &str,
) -> Result<Vec<StarterFile>, String> {
    // The comments that come before the first section and after the last one belong to the model alone.
    let sections = model.split_once("\n\n").map_or(model, |(_, sections)| sections);
    let sections = sections.split("@EFFECT@").next().unwrap_or_default();
    let truth = format!(
        "# The model that made {data}: model.toml with the effect that it lacks.\n\n{sections}{missing}"
    );
    let simulated = campaign::simulated(("truth.toml", &truth), (data, template), SEED)?;
    Ok(vec![
        StarterFile { name: "model.toml", text: model.replace("@EFFECT@", "") },
        StarterFile { name: data, text: simulated.to_csv() },
        StarterFile { name: "truth.toml", text: truth },
    ])
}

/// Frames of twelve stationary motes during one hour.
const LINKS: LinkCampaign = LinkCampaign {
    motes_m: &[
        [2.0, 3.0],
        [9.0, 1.5],
        [20.0, 4.0],
        [33.0, 2.0],
        [6.0, 11.0],
        [13.0, 8.0],
        [22.0, 12.0],
        [37.0, 10.0],
        [4.0, 21.0],
        [17.0, 19.0],
        [27.0, 23.0],
        [36.0, 18.0],
    ],
    rows: 3000,
    period_s: 1.2,
    temperature_c: None,
};

/// Tracks of four robots.
const TRACKS: TrackCampaign = TrackCampaign {
    sides_mps: [[1.0, 0.0], [0.3, 0.5], [-0.4, 0.7], [-0.8, 0.0], [-0.3, -0.5], [0.2, -0.7]],
    start_m: [0.0, 0.0],
    robots: 4,
    samples: 250,
};
