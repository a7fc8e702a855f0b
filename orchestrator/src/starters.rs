//! Starter experiments: what `new` writes.

use diagnose::simulate;
use measure::config::Compared;
use measure::table::DataTable;
use std::fmt::Write as _;
use std::path::Path;

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
                &links_template(),
            )?,
            Self::MeasuredRobots => measured(
                &text(include_str!("starters/measured-robots.toml")),
                MISSING_FROM_ROBOTS,
                "tracks.csv",
                &tracks_template(),
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
    let config = Compared::of_text(Path::new("truth.toml"), truth.clone(), &[])
        .map_err(|refusal| refusal.to_string())?;
    let table = DataTable::of_csv(Path::new(data), template.as_bytes())
        .map_err(|refusal| refusal.to_string())?;
    let simulated =
        simulate::simulate(&config, &table, SEED, None).map_err(|refusal| refusal.to_string())?;
    Ok(vec![
        StarterFile { name: "model.toml", text: model.replace("@EFFECT@", "") },
        StarterFile { name: data, text: simulated.to_csv() },
        StarterFile { name: "truth.toml", text: truth },
    ])
}

/// Number of rows of measured links.
const LINK_ROWS: u32 = 3000;

/// Frames of twelve stationary motes during one hour: their instants, ends and channels. The readings are placeholders.
fn links_template() -> String {
    const MOTES_M: [[f64; 2]; 12] = [
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
    ];
    let mut csv =
        "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,received\n"
            .to_owned();
    let n_motes = MOTES_M.len() as u32;
    for row in 0..LINK_ROWS {
        let (round, tx) = (row / n_motes, row % n_motes);
        let rx = (tx + 1 + round % (n_motes - 1)) % n_motes;
        let channel = 11 + (row * 7 + round) % 16;
        let [[tx_x_m, tx_y_m], [rx_x_m, rx_y_m]] =
            [tx, rx].map(|mote| MOTES_M.get(mote as usize).copied().unwrap_or_default());
        let (time_s, rssi_dbm) = (f64::from(row) * 1.2, -60 - (row % 20) as i32);
        let _ = writeln!(
            csv,
            "{time_s:.1},{tx},{rx},{channel},{tx_x_m},{tx_y_m},1,{rx_x_m},{rx_y_m},1,{rssi_dbm},1"
        );
    }
    csv
}

/// Tracks of four robots that each drive along a polygon with a corner every 4 s. The positions are placeholders.
fn tracks_template() -> String {
    // Velocities (m/s) along a hexagon, each side at its own speed.
    const SIDES_MPS: [[f64; 2]; 6] =
        [[1.0, 0.0], [0.3, 0.5], [-0.4, 0.7], [-0.8, 0.0], [-0.3, -0.5], [0.2, -0.7]];
    const PERIOD_S: f64 = 0.2;
    const SAMPLES: u32 = 250;
    let mut csv = "time_s,agent,x_m,y_m,z_m,cmd_vx_mps,cmd_vy_mps\n".to_owned();
    for agent in 0..4_u32 {
        let [mut x_m, mut y_m] = [f64::from(agent) * 8.0, 0.0];
        for sample in 0..SAMPLES {
            let side = (sample / 20 + agent) as usize % SIDES_MPS.len();
            let [vx_mps, vy_mps] = SIDES_MPS.get(side).copied().unwrap_or_default();
            let time_s = f64::from(sample) * PERIOD_S;
            let _ = writeln!(csv, "{time_s:.1},{agent},{x_m:.3},{y_m:.3},0,{vx_mps},{vy_mps}");
            x_m += vx_mps * PERIOD_S;
            y_m += vy_mps * PERIOD_S;
        }
    }
    csv
}
