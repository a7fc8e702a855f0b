//! Measured robots compared with another robot simulator: `--robotsim` of compare, diagnose and extend.

use super::stop::Stopper;
use super::{Failure, TlsArgs, on_runtime};
use clap::Args;
use drive::peer::{Launch, Peer as _, PredictionConfig, Reach, Remote, RobotSide, SideError};
use experiment::{REACH, Tls, Transport};
use measure::config::Compared;
use measure::robots::{self, RobotSamples};
use measure::table::DataTable;
use proto::config::{Node, Problem};
use std::path::{Path, PathBuf};
use std::time::Duration;
use study::choices::Choices;
use study::open::{self, DataAccount, Predicted};
use study::robots::{RobotFit, RobotStudy, command_kind, prediction_windows};

/// How often a fetch looks whether it is to stop.
const STOP_EVERY: Duration = Duration::from_millis(100);
/// Longest wait (s) for the reply to one call of a simulator that is alive, unless `experiment.step_deadline_s` says another.
const DEADLINE_S: f64 = 60.0;

/// A simulator executes an effect if, with it, its predictions miss at most this part of what the fit says: effects are fitted to
/// first order.
const MOST_MISSING: f64 = 0.5;
/// Positions that are as close (m) are the same.
const SAME_M: f64 = 1e-9;

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

    /// Measured robots, compared with the simulator of this URL, or else with the configured dynamics.
    pub(super) fn open_robots(
        &self,
        config: &Compared,
        table: &DataTable,
        choices: &Choices,
        stopper: Option<&Stopper>,
    ) -> Result<(RobotStudy, DataAccount), Failure> {
        let Some(url) = &self.robotsim else {
            return open::robots(config, table, choices).map_err(Failure::request);
        };
        let samples = robots::read(table)
            .map_err(|why| Failure::request(format!("{}: {why}", table.path.display())))?;
        let predicted = self.predict(url, config, &samples, table, stopper)?;
        open::robots_predicted(config, table, choices, Some(predicted)).map_err(Failure::request)
    }

    /// What the simulator predicts under a configuration.
    fn predict(
        &self,
        url: &str,
        config: &Compared,
        samples: &RobotSamples,
        table: &DataTable,
        stopper: Option<&Stopper>,
    ) -> Result<Predicted, Failure> {
        if !["http://", "https://"].iter().any(|scheme| url.starts_with(scheme)) {
            return Err(Failure::request(format!(
                "--robotsim {url}: must be http://HOST:PORT or https://HOST:PORT"
            )));
        }
        let windows = prediction_windows(samples)
            .map_err(|error| Failure::request(format!("{}: {error}", table.path.display())))?;
        let asked = prediction_config(config);
        let reach = self.reach(url, config)?;
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
                () = stopped(stopper) => None,
            }
        })?;
        match (fetched, stopper) {
            (Some(fetched), _) => fetched.map_err(|error| failure(error, config)),
            (None, Some(stopper)) => Err(stopper.refuse_partial(
                "It ended before the robot simulator had predicted all windows; give it more time",
            )),
            (None, None) => unreachable!("nobody stops it"),
        }
    }

    /// Refuses an extended configuration that the simulator, if one is compared, would not apply in a run: it is asked to predict
    /// with that configuration, and has to move as the fit says.
    pub(super) fn require_applied(
        &self,
        (study, fit): (&RobotStudy, &RobotFit),
        extended: &Compared,
        table: &DataTable,
        names: &str,
        stopper: &Stopper,
    ) -> Result<(), Failure> {
        let Some(url) = &self.robotsim else { return Ok(()) };
        let nothing = "so a run would not apply it, and nothing was written";
        let predicted = self.predict(url, extended, study.robots(), table, Some(stopper));
        let Predicted { by, windows } = predicted.map_err(|Failure { text, .. }| {
            Failure::work(format!(
                "{text}\nthe robot simulator does not take the configuration extended by {names}, {nothing}"
            ))
        })?;
        let Some([fitted_m, missing_m]) = study.applied(fit, &windows) else {
            return Err(Failure::work("robotsim.dynamics cannot be built"));
        };
        if fitted_m < SAME_M {
            return Err(Failure::work(format!(
                "{names} changes no predicted motion, {nothing}: whether {by} does so cannot be tested"
            )));
        }
        if MOST_MISSING * fitted_m < missing_m {
            return Err(Failure::work(format!(
                "{by} takes the configuration extended by {names}, but does not move accordingly, {nothing}: the fit moves \
                 predicted positions by {fitted_m:.4} m (root mean square), and with that configuration the simulator's \
                 predictions still differ from it by {missing_m:.4} m. Let it execute [[robotsim.dynamics.effect]], or \
                 change its own model"
            )));
        }
        Ok(())
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
        for key in REACH.fields.iter().map(|field| field.key) {
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
    let experiment = config.tree.get("experiment").map(Node::to_toml);
    let Some(experiment) = experiment.as_ref().and_then(toml::Value::as_table) else {
        return Ok(None);
    };
    let base = config.path.parent().unwrap_or(Path::new("."));
    let mut problems = Vec::new();
    let tls = experiment::tls_of(experiment, base, &mut problems);
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
