//! What is asked of measurements, who watches the work, and why there may be no answer.

use crate::corrected_data::NotCorrectable;
use crate::defects::MeasurementDefect;
use crate::extend::ExtendError;
use crate::identifiability::Identifiability;
use crate::progress::SearchProgress;
use measure::account::DataAccount;
use measure::config::Compared;
use measure::robots::RobotSamples;
use measure::table::DataTable;
use std::error::Error;
use study::StopFlag;
use study::choices::{ChoiceError, Choices};
use study::formula::FormulaFitError;
use study::open::{OpenError, Predicted};

/// A model and the measurements that it is compared with: of links or of robots, which the columns of the table tell.
#[derive(Clone)]
pub struct Request<'a> {
    /// The configuration: the model.
    pub config: &'a Compared,
    /// The measurements.
    pub table: &'a DataTable,
    /// Selection of rows, unit of cross-validation, and prediction horizon of robots.
    pub choices: Choices,
    /// Robots only: the simulator whose predictions are the base model, in place of `[robotsim.dynamics]`.
    pub simulator: Option<&'a dyn RobotSimulator>,
    /// Whether the answer shall have the rows with their predictions, for plots. That takes as long as some fits.
    pub wants_rows: bool,
    /// Whether all rows are searched, however long that takes. Otherwise a subset of them is where there are many.
    pub is_thorough: bool,
}

impl<'a> Request<'a> {
    /// A request with default choices.
    #[must_use]
    pub fn new(config: &'a Compared, table: &'a DataTable) -> Self {
        let choices = Choices::default();
        Self { config, table, choices, simulator: None, wants_rows: false, is_thorough: false }
    }

    /// The same with other choices.
    #[must_use]
    pub fn with_choices(self, choices: Choices) -> Self {
        Self { choices, ..self }
    }
}

/// Watches the work on a request, and may stop it. Every method has a default that does nothing.
pub trait Observer: Sync {
    /// Measurements were read: how many rows are used, and why others are not.
    fn opened(&self, _account: &DataAccount) {}

    /// What the measurements can tell, before a diagnosis searches them.
    fn identifiability(&self, _table: &Identifiability) {}

    /// An extension found these defects of the measurement, and corrects them.
    fn defects(&self, _defects: &[MeasurementDefect]) {}

    /// A search goes on.
    fn progress(&self, _progress: SearchProgress<'_>) {}

    /// The flag that stops the work once it is set. The answer then holds what was found until then, and says that it is not complete.
    fn stop_flag(&self) -> Option<&StopFlag> {
        None
    }
}

/// An observer that ignores everything and never stops the work.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unobserved;

impl Observer for Unobserved {}

/// The flag of an observer, or one that nobody sets.
pub(crate) fn stop_flag(observer: &dyn Observer) -> StopFlag {
    observer.stop_flag().cloned().unwrap_or_default()
}

/// A robot simulator outside this program, which predicts measured motion.
pub trait RobotSimulator {
    /// What it predicts of the windows of measured robots under a configuration.
    ///
    /// # Errors
    ///
    /// Whatever the implementation reports; [`DiagnoseError::Simulator`] returns it unchanged.
    fn predict(
        &self,
        config: &Compared,
        samples: &RobotSamples,
    ) -> Result<Predicted, SimulatorError>;
}

/// The failure of a robot simulator.
pub type SimulatorError = Box<dyn Error + Send + Sync>;

/// Why a request has no answer.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// One of the files cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The corrected measurements do not allow the choices.
    #[error(transparent)]
    Choice(#[from] ChoiceError),
    /// The formula is wrong.
    #[error(transparent)]
    Formula(#[from] FormulaFitError),
    /// An effect cannot be added.
    #[error(transparent)]
    Effect(#[from] ExtendError),
    /// No corrected file can be written.
    #[error(transparent)]
    NotCorrectable(#[from] NotCorrectable),
    /// Corrected data were asked for, but measurements of robots are not searched for defects.
    #[error("defects are looked for in link samples only")]
    CorrectedRobots,
    /// A robot simulator was given for measurements of links.
    #[error("a robot simulator predicts robot samples only, not link samples")]
    SimulatorOfLinks,
    /// The robot simulator failed, as it says itself.
    #[error("{0}")]
    Simulator(SimulatorError),
    /// The robot simulator does not execute the effects that would be added.
    #[error(transparent)]
    NotExecuted(#[from] NotExecuted),
    /// The work was stopped before anything could be answered.
    #[error("the search was stopped: {0}")]
    Stopped(Stopped),
}

/// Where an extension was when it was stopped without a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Stopped {
    /// Defects of the measurement were being looked for, which the corrected data need.
    #[error("it was not known yet which defects there are")]
    Defects,
    /// Effects were being searched for; those accepted until then were not asked for.
    #[error("further effects may be missing")]
    Search,
    /// Effects were being searched for, and none was accepted until then.
    #[error("no effect was accepted until then")]
    NothingAccepted,
    /// The effects were being fitted.
    #[error("the fit had not converged")]
    Fit,
}

/// Why an extended configuration is refused under another robot simulator.
#[derive(Debug, thiserror::Error)]
pub enum NotExecuted {
    /// The simulator refuses the configuration.
    #[error(
        "{error}\nthe robot simulator does not take the configuration extended by {names}, {NOT_APPLIED}"
    )]
    Refused {
        /// What the simulator reports.
        error: SimulatorError,
        /// Names of the effects.
        names: String,
    },
    /// The dynamics of the configuration cannot be built.
    #[error("robotsim.dynamics cannot be built")]
    Dynamics,
    /// The effects change no predicted motion.
    #[error(
        "{names} changes no predicted motion, {NOT_APPLIED}: whether {by} does so cannot be tested"
    )]
    NothingMoved {
        /// Names of the effects.
        names: String,
        /// Name and version of the simulator.
        by: String,
    },
    /// The simulator moves robots otherwise than the fit.
    #[error(
        "{by} takes the configuration extended by {names}, but does not move accordingly, {NOT_APPLIED}: the fit moves \
         predicted positions by {fitted_m:.4} m (root mean square), and with that configuration the simulator's predictions \
         still differ from it by {missing_m:.4} m. Let it execute [[robotsim.dynamics.effect]], or change its own model"
    )]
    MovesOtherwise {
        /// Names of the effects.
        names: String,
        /// Name and version of the simulator.
        by: String,
        /// By how much the fit moves predictions (m, root mean square).
        fitted_m: f64,
        /// By how much the simulator's predictions differ from those of the fit (m, root mean square).
        missing_m: f64,
    },
}

/// What follows for the user.
const NOT_APPLIED: &str = "so a run would not apply it, and nothing was written";
