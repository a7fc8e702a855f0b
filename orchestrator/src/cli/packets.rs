//! The commands that hold a network against measured packets.

use super::Failure;
use super::measured::{account_json, account_text};
use crate::compare::Comparison;
use crate::config::{self, Overrides, Plan};
use crate::console::say;
use crate::measure::packets::{self, Packets};
use crate::measure::table::Table;
use crate::network::compared::{self, Asked};
use crate::network::replay::Replay;
use crate::network::tracks::Tracks;
use crate::study::open::{self, Account};
use clap::Args;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// How packets are replayed.
#[derive(Args, Clone)]
pub(super) struct ReplayArgs {
    /// Of packets: where robots were measured, as a table with time_s, agent, x_m, y_m, or the folder of a run. Without it they
    /// go as the experiment has them
    #[arg(long, value_name = "FILE")]
    positions: Option<PathBuf>,
    /// Of packets: seeds under which the network is run
    #[arg(long, value_name = "N", default_value_t = Asked::default().seeds)]
    seeds: u64,
    /// Of packets: those made before are not compared (s)
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    from: f64,
}

/// Measured packets, and the experiment that is held against them.
pub(super) struct Opened {
    pub(super) replay: Replay,
    pub(super) packets: Packets,
    pub(super) account: Account,
    pub(super) asked: Asked,
}

impl ReplayArgs {
    /// What is asked.
    fn asked(&self) -> Asked {
        Asked { seeds: self.seeds, from_s: self.from }
    }

    /// As they would be typed.
    pub(super) fn words(&self) -> String {
        let positions = self.positions.as_ref();
        format!(
            "{} --seeds {} --from {}",
            positions.map_or_else(String::new, |path| format!(" --positions {}", path.display())),
            self.seeds,
            self.from
        )
    }

    /// Reads everything.
    pub(super) fn open(
        &self,
        config: &Path,
        set: &[String],
        table: &Table,
    ) -> Result<Opened, Failure> {
        let overrides = Overrides { set: set.to_vec(), ..Overrides::default() };
        let plan: Plan = config::load(config, &overrides).map_err(Failure::request)?;
        let packets = packets::read(table)
            .map_err(|why| Failure::request(format!("{}: {why}", table.path.display())))?;
        let tracks = match &self.positions {
            Some(path) => Some(Tracks::read(path).map_err(Failure::request)?),
            None => None,
        };
        let replay = Replay::new(plan, tracks, &packets.packets)
            .map_err(|error| Failure::request(format!("{}: {error}", config.display())))?;
        let mut account = Account {
            file: open::name_of(table),
            sha256: table.sha256.clone(),
            rows: packets.n_rows,
            used: packets.packets.len(),
            rejected: packets.rejected.clone(),
            warnings: packets.warnings.clone(),
        };
        if replay.resends() {
            account.warnings.push(
                "the experiment has no [[netsim.app]]: the measured packets are sent again at their times, whether motes have joined \
                 by then or not"
                    .to_owned(),
            );
        }
        Ok(Opened { replay, packets, account, asked: self.asked() })
    }
}

/// `orchestrator compare` of packets: the answer, told.
pub(super) fn compare(opened: &Opened) -> Result<Value, Failure> {
    let Opened { replay, packets, account, asked } = opened;
    account_text(account);
    tracing::info!("{} seeds of {:.0} s", asked.seeds, replay.duration_s());
    let Comparison { mut json, text } =
        compared::compare(replay, &packets.packets, *asked).map_err(Failure::request)?;
    account_json(account, &mut json);
    say(text);
    Ok(json)
}
