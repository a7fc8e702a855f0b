//! Measured robots compared with another robot simulator: `--robotsim` of compare, diagnose and extend.

use super::stop::Stopper;
use super::{Failure, TlsArgs, on_runtime};
use clap::Args;
use diagnose::{RobotSimulator, SimulatorError};
use drive::peer::{Launch, Peer as _, PredictionConfig, Reach, Remote, RobotSide, SideError};
use experiment::{ReachKeys, Tls, Transport};
use measure::config::Compared;
use measure::robots::RobotSamples;
use measure::table::DataTable;
use proto::config::{Node, Problem, Section as _};
use std::path::{Path, PathBuf};
use std::time::Duration;
use study::open::Predicted;
use study::robots::{command_kind, prediction_windows};

/// How often a fetch looks whether it is to stop.
const STOP_EVERY: Duration = Duration::from_millis(100);
/// Longest wait (s) for the reply to one call of a simulator that is alive, unless `experiment.step_deadline_s` says another.
const DEADLINE_S: f64 = 60.0;

/// Which robot simulator is compared.
#[derive(Args)]
pub(super) struct ForeignArgs {
    /// Robots only: compare the predictions of the robot simulator at this URL, instead of [robotsim.dynamics], with the
    /// measurements. It must announce predictions; [robotsim] is sent to it as its configuration
    #[arg(long, value_name = "URL")]
    robotsim: Option<String>,
    #[command(flatten)]
    tls: TlsArgs,
}

impl ForeignArgs {
    /// Refuses a simulator of robots for measurements that hold none.
    pub(super) fn refuse(&self, what: &str) -> Result<(), Failure> {
        match &self.robotsim {
            Some(url) => Err(Failure::request(format!(
                "--robotsim {url}: applies to robot samples only, not to {what}; leave it out"
            ))),
            None => Ok(()),
        }
    }

    /// As it would be typed.
    pub(super) fn words(&self) -> String {
        self.robotsim.as_ref().map_or_else(String::new, |url| format!(" --robotsim {url}"))
    }

    /// The simulator, if one is given, for the windows of these measurements.
    pub(super) fn simulator<'a>(
        &'a self,
        table: &'a DataTable,
        stopper: Option<&'a Stopper>,
    ) -> Option<Foreign<'a>> {
        let url = self.robotsim.as_deref()?;
        Some(Foreign { args: self, url, table, stopper })
    }

    fn reach(&self, url: &str, config: &Compared) -> Result<Reach, Failure> {
        let experiment = config.tree.get("experiment");
        let step_deadline_s =
            match experiment.and_then(|it| it.get("step_deadline_s")).map(Node::to_toml) {
                Some(toml::Value::Float(seconds)) => seconds,
                Some(toml::Value::Integer(seconds)) => seconds as f64,
                _ => DEADLINE_S,
            };
        let tls = match self.tls.tls() {
            Some(tls) => Some(tls),
            None => written_tls(config)?,
        };
        Ok(Reach {
            url: Some(url.to_owned()),
            tls,
            transport: Transport::Unary,
            step_deadline: Duration::from_secs_f64(step_deadline_s.clamp(1.0, 86_400.0)),
            is_busy: false,
            // Nothing is started.
            launch: Launch::new(PathBuf::new()),
        })
    }
}

/// A robot simulator at a URL.
pub(super) struct Foreign<'a> {
    args: &'a ForeignArgs,
    url: &'a str,
    /// The measurements, which messages name.
    table: &'a DataTable,
    stopper: Option<&'a Stopper>,
}

impl RobotSimulator for Foreign<'_> {
    fn predict(
        &self,
        config: &Compared,
        samples: &RobotSamples,
    ) -> Result<Predicted, SimulatorError> {
        Ok(self.predicted(config, samples)?)
    }
}

impl Foreign<'_> {
    /// What the simulator predicts under a configuration.
    fn predicted(&self, config: &Compared, samples: &RobotSamples) -> Result<Predicted, Failure> {
        let url = self.url;
        if !["http://", "https://"].iter().any(|scheme| url.starts_with(scheme)) {
            return Err(Failure::request(format!(
                "--robotsim {url}: must be http://HOST:PORT or https://HOST:PORT"
            )));
        }
        let windows = prediction_windows(samples)
            .map_err(|error| Failure::request(format!("{}: {error}", self.table.path.display())))?;
        let asked = prediction_config(config);
        let reach = self.args.reach(url, config)?;
        let kind = command_kind(samples.shape);
        let work = async {
            let mut peer = Remote::<RobotSide>::connect(&reach).await?;
            let by = format!("{} {}", peer.described().name, peer.described().version);
            let report = |done, all| {
                tracing::info!("{by}: predicted {done} of {all} windows");
            };
            let windows = peer.predict(&asked, kind, &windows, report).await?;
            Ok(Predicted { by: by.trim_end().to_owned(), windows })
        };
        let fetched = on_runtime(async {
            tokio::select! {
                biased;
                fetched = work => Some(fetched),
                () = stopped(self.stopper) => None,
            }
        })?;
        match (fetched, self.stopper) {
            (Some(fetched), _) => fetched.map_err(|error| failure(error, config)),
            (None, Some(stopper)) => Err(stopper.refuse_partial(
                "It ended before the robot simulator had predicted all windows; give it more time",
            )),
            (None, None) => unreachable!("nobody stops it"),
        }
    }
}

/// Returns once the work is to stop; never without a stopper.
async fn stopped(stopper: Option<&Stopper>) {
    let Some(stopper) = stopper else { return std::future::pending().await };
    while !stopper.flag().is_set() {
        tokio::time::sleep(STOP_EVERY).await;
    }
}

/// The sections that a simulator of robots is sent.
fn prediction_config(config: &Compared) -> PredictionConfig {
    let text = |section: Option<&Node>| {
        let table = section.map(Node::to_toml);
        table
            .as_ref()
            .and_then(toml::Value::as_table)
            .map(toml::Table::to_string)
            .unwrap_or_default()
    };
    let mut robotsim = config.tree.get("robotsim").cloned();
    if let Some(robotsim) = &mut robotsim {
        for key in ReachKeys::SPEC.fields.iter().map(|field| field.key) {
            robotsim.take(key);
        }
    }
    PredictionConfig {
        site_toml: text(config.tree.get("site")),
        config_toml: text(robotsim.as_ref()),
    }
}

/// The certificates that a configuration names.
fn written_tls(config: &Compared) -> Result<Option<Tls>, Failure> {
    let experiment = config.tree.get("experiment");
    let Some(section) = experiment.and_then(|experiment| experiment.get("tls")) else {
        return Ok(None);
    };
    let base = config.path.parent().unwrap_or(Path::new("."));
    let mut problems = Vec::new();
    let tls = experiment::tls_of(section, base, &mut problems);
    if problems.is_empty() { Ok(tls) } else { Err(Failure::request(config.refuse(problems))) }
}

/// A configuration that the simulator refuses is the user's: shown on the lines of the file.
fn failure(error: SideError, config: &Compared) -> Failure {
    match error {
        SideError::Unacceptable { side, problems } => {
            let placed = |problem: Problem| {
                if problem.path.starts_with("site") { problem } else { problem.within(side) }
            };
            Failure::request(config.refuse(problems.into_iter().map(placed).collect()))
        }
        SideError::Cannot { .. }
        | SideError::Unreachable { .. }
        | SideError::NotASimulator { .. }
        | SideError::Certificate { .. } => Failure::request(error),
        other => Failure::work(other),
    }
}
