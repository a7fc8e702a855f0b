//! From two files, measurements and a configuration, to a study.

use super::Study;
use super::choices::{ChoiceError, Choices, ConditionRows};
use super::links::LinkStudy;
use super::links::rows::ModelledLinks;
use super::links::rows::covariates;
use super::robots::{RobotStudy, RobotStudyError, StatedSettings, body_for, odd_commands};
use super::thresholds::{FEWEST_BLOCKS, FEWEST_REPLICATES};
use measure::DataError;
use measure::account::DataFile;
use measure::config::Compared;
use measure::links::{LinkRow, LinkSamples, Losses};
use measure::robots::{CommandKind, RobotSamples};
use measure::table::DataTable;
use measure::{links, packets, robots};
use proto::config::{Node, Problem, Refusal, Value};
use proto::effect::Level;
use proto::prediction::PredictedWindow;
use robotsim::dynamics::{Dynamics, Shape};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeSet;

pub use measure::account::DataAccount;

/// Why measurements cannot be compared with a configuration.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The configuration is refused.
    #[error(transparent)]
    Config(#[from] Refusal),
    /// The data cannot be read.
    #[error(transparent)]
    Data(#[from] DataError),
    /// What was chosen by hand cannot be.
    #[error(transparent)]
    Choice(#[from] ChoiceError),
    /// The data can be read, but not used.
    #[error("{file}: {reason}")]
    Useless {
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
}

/// What a file of measurements is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub enum Subject {
    /// Links.
    #[serde(rename = "link")]
    Links,
    /// Robots.
    #[serde(rename = "robot")]
    Robots,
}

/// What a table is about, by its columns.
///
/// # Errors
///
/// It has neither shape: the columns it lacks for each.
pub fn subject(table: &DataTable) -> Result<Subject, OpenError> {
    if packets::has_shape(table).is_ok() {
        return Err(OpenError::Useless {
            file: table.path.display().to_string(),
            reason: "end-to-end packets are accepted by compare, diagnose and extend only"
                .to_owned(),
        });
    }
    match (links::has_shape(table), CommandKind::of_table(table)) {
        (Ok(()), _) => Ok(Subject::Links),
        (Err(_), Ok(_)) => Ok(Subject::Robots),
        (Err(link), Err(robot)) => Err(OpenError::Useless {
            file: table.path.display().to_string(),
            reason: format!(
                "the columns match no kind of measurements: link samples lack {}; robot samples lack {}; packets lack {}. {}",
                hinted(&link, table),
                hinted(&robot, table),
                hinted(&packets::has_shape(table).err().unwrap_or_default(), table),
                table.import_hint()
            ),
        }),
    }
}

/// Columns that are lacking, each with the one that may be meant.
fn hinted(lacking: &[String], table: &DataTable) -> String {
    let is_known = |name: &str| {
        [&links::KNOWN[..], &robots::KNOWN, &packets::KNOWN].iter().any(|list| list.contains(&name))
    };
    let names = || table.names().iter().map(String::as_str).filter(|name| !is_known(name));
    let hint = |name: &String| match proto::config::most_similar(name, names()) {
        Some(nearest) => format!("{name} (did you mean the column {nearest}?)"),
        None => name.clone(),
    };
    lacking.iter().map(hint).collect::<Vec<_>>().join(", ")
}

/// Robot samples, read and compared with the dynamics of a configuration.
///
/// # Errors
///
/// What is wrong with either, in words for its author.
pub fn robots(
    config: &Compared,
    table: &DataTable,
    choices: &Choices,
) -> Result<(RobotStudy, DataAccount), OpenError> {
    robots_predicted(config, table, choices, None)
}

/// What another robot simulator predicts of measured robots.
#[derive(Clone, Debug)]
pub struct Predicted {
    /// Name and version of the simulator.
    pub by: String,
    /// One for each window of [`super::robots::prediction_windows`].
    pub windows: Vec<PredictedWindow>,
}

/// As [`robots()`]; where another simulator's predictions are given, these are the base model. `[robotsim]` is then that
/// simulator's section: `[robotsim.dynamics]` counts as a description of what it does if it is a valid one of this program's,
/// of a body that executes the commands of the file. Otherwise effects are added to a bare body.
///
/// # Errors
///
/// As [`robots()`].
pub fn robots_predicted(
    config: &Compared,
    table: &DataTable,
    choices: &Choices,
    predicted: Option<Predicted>,
) -> Result<(RobotStudy, DataAccount), OpenError> {
    if choices.given_rssi {
        return Err(ChoiceError::NoReadings.into());
    }
    if choices.losses_logged.is_some() {
        return Err(ChoiceError::NoFrames.into());
    }
    let file = table.path.display().to_string();
    let useless = |reason: String| OpenError::Useless { file: file.clone(), reason };
    let robots = robots::read(table).map_err(useless)?;
    let read = described_dynamics(config, &robots);
    let is_foreign = predicted.is_some();
    let Described { dynamics, is_wheelbase_given } = match read {
        Ok(described) if !is_foreign || described.executes(robots.shape) => described,
        _ if is_foreign => Described::bare(config, robots.shape),
        Ok(described) => described,
        Err(problems) => return Err(config.refuse(problems).into()),
    };
    let (predicted_by, predicted) = predicted.map(|it| (it.by, it.windows)).unzip();
    let mass_kg = dynamics.get("mass_kg").and_then(toml::Value::as_float);
    let odd = odd_commands::warnings(&robots, mass_kg);
    let mut account = DataAccount {
        data: file_of(table),
        rows: robots.n_rows,
        used: robots.samples.len(),
        rejected: robots.rejected.clone(),
        warnings: robots.warnings.clone(),
        predicted_by,
    };
    let stated = StatedSettings {
        is_wheelbase_given,
        sd_m: localization_sd_m(config),
        terrain: config.site.terrain.clone(),
        catalogue: config.catalogues.robots.clone(),
        predicted,
    };
    let study =
        RobotStudy::new(robots, &dynamics, stated, (choices, table)).map_err(
            |error| match error {
                RobotStudyError::Choice(error) => error.into(),
                other => useless(other.to_string()),
            },
        )?;
    account.rejected.extend_from_slice(study.rejected());
    account.warnings.extend(odd);
    account.warnings.extend(too_few(&study));
    Ok((study, account))
}

/// The dynamics that a configuration describes.
struct Described {
    dynamics: toml::Table,
    is_wheelbase_given: bool,
}

impl Described {
    /// Whether its body executes such commands.
    fn executes(&self, shape: Shape) -> bool {
        self.dynamics.get("kind").and_then(toml::Value::as_str) == Some(body_for(shape))
    }

    /// A body without effects that executes such commands.
    fn bare(config: &Compared, shape: Shape) -> Self {
        let kind = toml::Table::from_iter([("kind".to_owned(), body_for(shape).into())]);
        let node = Node { value: Value::from(&toml::Value::Table(kind)), span: None };
        let lists = config.catalogues.robots.lists();
        let spec = &robotsim::dynamics::SPEC;
        let dynamics = proto::config::check(&node, "", spec, &lists, &mut Vec::new()).table;
        Self { dynamics, is_wheelbase_given: false }
    }
}

/// `[robotsim.dynamics]`, checked.
fn described_dynamics(config: &Compared, robots: &RobotSamples) -> Result<Described, Vec<Problem>> {
    let written = config.section("robotsim", "dynamics");
    let mut problems = Vec::new();
    let dynamics = proto::config::check(
        &written,
        "robotsim.dynamics",
        &robotsim::dynamics::SPEC,
        &config.catalogues.robots.lists(),
        &mut problems,
    )
    .table;
    if matches!(&config.section("robotsim", "group").value, Value::List(groups) if !groups.is_empty())
    {
        problems.push(Problem::new(
            "robotsim.group",
            "must be absent when the model is compared with robot samples, which are predicted by [robotsim.dynamics] \
             alone; remove it",
        ));
    }
    if problems.is_empty() {
        let effects = &config.catalogues.robots.effects;
        Dynamics::build(&dynamics, "robotsim.dynamics", effects, &mut problems);
    }
    let columns = robots.covariates.iter().map(|(name, _)| name.as_str()).collect();
    problems.extend(unknown_columns(config, &Limited::ROBOTS, columns));
    if !problems.is_empty() {
        return Err(problems);
    }
    let is_wheelbase_given = written.get("wheelbase_m").is_some();
    Ok(Described { dynamics, is_wheelbase_given })
}

/// The noise of measured positions that a configuration gives (m).
#[must_use]
pub fn localization_sd_m(config: &Compared) -> Option<f64> {
    let sd_m = match config.section("robotsim", "localization").get("sd_m").map(Node::to_toml) {
        Some(toml::Value::Float(sd_m)) => sd_m,
        Some(toml::Value::Integer(sd_m)) => sd_m as f64,
        _ => return None,
    };
    (0.0 < sd_m).then_some(sd_m)
}

/// The name of the file, and its digest.
pub fn file_of(table: &DataTable) -> DataFile {
    let name = table.path.file_name().map_or_else(Default::default, |name| name.to_string_lossy());
    DataFile { file: name.into_owned(), sha256: table.sha256.clone() }
}

/// Measured links, read and compared with the radio of a configuration.
///
/// # Errors
///
/// What is wrong with either, in words for its author.
pub fn links(
    config: &Compared,
    table: &DataTable,
    choices: &Choices,
) -> Result<(LinkStudy, DataAccount), OpenError> {
    if choices.window_s.is_some() {
        return Err(ChoiceError::NoWindows.into());
    }
    let file = table.path.display().to_string();
    let useless = |reason: String| OpenError::Useless { file: file.clone(), reason };
    let mut links = links::read(table).map_err(useless)?;
    links.readings.is_given = choices.given_rssi;
    let are_losses_unknown = settle_losses(&mut links, choices)?;
    if choices.given_rssi && !links.readings.is_aggregated {
        return Err(ChoiceError::SingleFrames.into());
    }
    let n_motes = links.rows.iter().map(|row| row.tx.max(row.rx) as usize + 1).max().unwrap_or(1);
    let (model, effective) = config.radio(n_motes)?;
    let columns = links.covariates.iter().map(|(name, _)| name.as_str()).collect();
    let mut problems = unknown_columns(config, &Limited::LINKS, columns);
    problems.extend(limited_at_random(&model));
    if !problems.is_empty() {
        return Err(config.refuse(problems).into());
    }
    let number = |key: &str| effective.get(key).and_then(toml::Value::as_float);
    let fixed_sd_db = number("noise_sd_db").filter(|sd_db| 0.0 < *sd_db);
    let height_m = number("antenna_height_m").unwrap_or_default();
    let rows = ModelledLinks::new(links, model, config.site.clone(), height_m);
    if rows.is_empty() {
        return Err(OpenError::Useless {
            file,
            reason: rows.links.rejected.iter().fold(
                "no row is usable".to_owned(),
                |text, rejected| {
                    format!(
                        "{text}; {} rows: {} (first on line {})",
                        rejected.rows, rejected.reason, rejected.first_line
                    )
                },
            ),
        });
    }
    if choices.given_rssi && rows.base.iter().any(|base| base.stated.is_some()) {
        return Err(ChoiceError::Stated.into());
    }
    let (rows, choices) = chosen(rows, table, choices)?;
    if choices.given_rssi && !rows.links.readings.has_losses() {
        return Err(ChoiceError::NothingLost { rows: rows.len() }.into());
    }
    let mut account = DataAccount {
        data: file_of(table),
        rows: rows.links.n_rows,
        used: rows.len(),
        rejected: rows.links.rejected.clone(),
        warnings: rows.links.warnings.clone(),
        predicted_by: None,
    };
    account.warnings.extend(absent(config, &rows));
    let study = LinkStudy::new(rows, fixed_sd_db, &choices, &config.catalogues.radio)?
        .with_losses_unknown(are_losses_unknown);
    account.warnings.extend(study.fallback().map(str::to_owned));
    account.warnings.extend(too_few(&study));
    Ok((study, account))
}

/// Settles what rows say of lost frames by what was stated: on the command line, in the file, or by lost frames that are there. Returns
/// whether it is unknown: then readings are taken as they are, and what a diagnosis finds is certain only as far as it does not depend
/// on it.
fn settle_losses(links: &mut LinkSamples, choices: &Choices) -> Result<bool, ChoiceError> {
    let is_lost = |row: &&LinkRow| row.received < row.frames;
    let is_logged = links.readings.has_losses();
    let stated = choices.losses_logged.or(links.losses_logged);
    if is_logged && stated == Some(false) {
        let line = links.rows.iter().find(is_lost).map_or(0, |row| row.line);
        let rows = links.rows.iter().filter(is_lost).count();
        return Err(ChoiceError::LossesAreThere { rows, line });
    }
    links.readings.losses = match stated {
        Some(true) => Losses::Logged,
        _ if is_logged => Losses::Logged,
        Some(false) if !links.readings.is_given => Losses::NotLogged,
        _ => Losses::Ignored,
    };
    Ok(stated.is_none() && !is_logged && !links.readings.is_given)
}

/// Where effects of one side are configured, and how the columns are found that limit one.
struct Limited {
    side: &'static str,
    section: &'static str,
    columns_of: fn(&toml::Table) -> Vec<String>,
}

impl Limited {
    const LINKS: Self =
        Self { side: "netsim", section: "phy", columns_of: physics::effect::only::columns };
    const ROBOTS: Self = Self {
        side: "robotsim",
        section: "dynamics",
        columns_of: robotsim::dynamics::effect::only::columns,
    };

    /// The checked or unchecked tables of the effects.
    fn effects(&self, config: &Compared) -> Vec<toml::Table> {
        let effects = config.section(self.side, self.section).get("effect").map(Node::to_toml);
        let tables = effects.as_ref().and_then(toml::Value::as_array).into_iter().flatten();
        tables.filter_map(toml::Value::as_table).cloned().collect()
    }
}

/// Conditions of effects that name columns which the measurements do not have: such an effect would never act.
fn unknown_columns(config: &Compared, limited: &Limited, columns: Vec<&str>) -> Vec<Problem> {
    let is_known = |name: &str| {
        columns.iter().any(|column| {
            *column == name
                || ["tx_", "rx_"].iter().any(|end| column.strip_prefix(end) == Some(name))
        })
    };
    // Of a column without an end, both ends have the value.
    let is_known = |name: &str| {
        is_known(name)
            || ["tx_", "rx_"].iter().filter_map(|end| name.strip_prefix(end)).any(is_known)
    };
    let mut problems = Vec::new();
    for (index, effect) in limited.effects(config).iter().enumerate() {
        for name in (limited.columns_of)(effect).iter().filter(|name| !is_known(name)) {
            let path = format!("{}.{}.effect[{index}].only.where", limited.side, limited.section);
            let message = "must use names of the effect formula or columns of the measurements; there is no such column";
            let mut problem = Problem::new(path, message).value(name);
            problem.nearest =
                proto::config::most_similar(name, columns.iter().copied()).map(str::to_owned);
            problems.push(problem);
        }
    }
    problems
}

/// Effects that are limited to some links and vary at random, or have a curve of reception of their own: the likelihood has one
/// distribution and one curve for all rows.
fn limited_at_random(model: &physics::Model) -> Vec<Problem> {
    let effects = model.effects.iter().enumerate().filter(|(_, effect)| effect.is_limited());
    let changes_all = effects.filter(|(_, it)| it.scatter().is_some() || it.curve().is_some());
    changes_all
        .map(|(index, effect)| {
            let message = format!(
                "must be absent from {} when the model is compared with link samples, because random variation and reception curves \
                 are compared over all rows; remove it",
                effect.name()
            );
            Problem::new(format!("netsim.phy.effect[{index}].only"), message)
        })
        .collect()
}

/// Whether a column says what became of frames; readings that are given do not.
fn is_outcome(name: &str, is_given: bool) -> bool {
    ["received", "pdr"].contains(&name) || !is_given && ["rssi_dbm", "rssi_sd_db"].contains(&name)
}

/// The rows that are used by choice, and the choices with all campaigns named.
fn chosen(
    rows: ModelledLinks,
    table: &DataTable,
    choices: &Choices,
) -> Result<(ModelledLinks, Choices), ChoiceError> {
    let measured = &rows.links.rows;
    let runs: Vec<u32> = measured.iter().map(|row| row.run).collect();
    let choices = choices.resolved(&runs)?;
    let seen = ConditionRows {
        table,
        lines: measured.iter().map(|row| row.line).collect(),
        runs,
        derived: if choices.condition.is_some() { covariates::by_name(&rows) } else { Vec::new() },
        when: "",
    };
    let kept = choices.select_rows(&seen)?;
    if !kept.rows.contains(&false) {
        return Ok((rows, choices));
    }
    let mut rows = rows.some(&kept.rows);
    rows.links.rejected.extend(kept.rejected);
    if rows.links.readings.has_losses() {
        rows.links.readings.losses = links::losses(&rows.links.rows);
    }
    let is_given = choices.given_rssi;
    let by_outcome: Vec<&str> =
        kept.asked.iter().map(String::as_str).filter(|name| is_outcome(name, is_given)).collect();
    if is_given && !by_outcome.is_empty() {
        return Err(ChoiceError::ChosenByReception { columns: by_outcome.join(" and ") });
    }
    if rows.links.readings.is_of_received() && !by_outcome.is_empty() {
        rows.links.readings.losses = Losses::Ignored;
        rows.links.warnings.push(format!(
            "rows were selected by {}, an outcome of reception. Selecting rows by the outcome biases the result, so \
             reception is not fitted, and only RSSI readings are used",
            by_outcome.join(" and ")
        ));
    }
    Ok((rows, choices))
}

/// Motes that effects of a configuration name, and that never appear in the measurements.
fn absent(config: &Compared, rows: &ModelledLinks) -> Option<String> {
    let motes: BTreeSet<i64> =
        rows.links.rows.iter().flat_map(|row| [row.tx, row.rx]).map(i64::from).collect();
    let effects = Limited::LINKS.effects(config);
    let lists = |effect: &toml::Table| {
        let limits = effect.get(proto::effect::only::KEY).and_then(toml::Value::as_table);
        let tables = [Some(effect), limits].into_iter().flatten();
        let lists = tables.filter_map(|table| table.get("nodes")?.as_array().cloned());
        lists.flatten().collect::<Vec<_>>()
    };
    let named: BTreeSet<i64> = effects
        .iter()
        .flat_map(lists)
        .collect::<Vec<_>>()
        .iter()
        .filter_map(toml::Value::as_integer)
        .filter(|mote| !motes.contains(mote))
        .collect();
    let list: Vec<String> = named.iter().take(5).map(i64::to_string).collect();
    (!list.is_empty()).then(|| {
        format!(
            "effects of the configuration list nodes that never appear in the measurements: {}. Check that both use the \
             same mote numbers; otherwise the effect acts on no mote, or on the wrong ones",
            list.join(", ")
        )
    })
}

/// Warnings about the candidates that cannot be tested because the data fall into too few independent blocks.
fn too_few<S: Study>(study: &S) -> Vec<String> {
    let names = |level: Level| {
        let names: Vec<&str> = study
            .candidates()
            .iter()
            .filter(|c| c.curve_over().is_none() && c.untestable.is_none() && c.level == level)
            .map(|candidate| candidate.name.as_str())
            .collect();
        names.join(", ")
    };
    let mut warnings = Vec::new();
    let blocks = study.blocks(Level::Time);
    if !blocks.suffices() {
        warnings.push(format!(
            "the data have only {} {}; at least {FEWEST_BLOCKS} are required, so no effect is accepted",
            blocks.n_scored(),
            blocks.unit
        ));
        return warnings;
    }
    if !blocks.may_be_certain() {
        warnings.push(format!(
            "the data have only {} {}; at least {FEWEST_BLOCKS}, or {FEWEST_REPLICATES} runs, are required for an effect to be certain",
            blocks.n_scored(),
            blocks.unit
        ));
    }
    let blocks = study.blocks(Level::Place);
    if !blocks.suffices() && !names(Level::Place).is_empty() {
        warnings.push(format!(
            "the data have only {} {}; at least {} are required for effects that differ between places. Not tried: {}",
            blocks.n_scored(),
            blocks.unit,
            blocks.fewest(),
            names(Level::Place)
        ));
    }
    warnings
}
