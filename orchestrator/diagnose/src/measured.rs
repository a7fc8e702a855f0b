//! What measurements of links and of robots have in common for a diagnosis, and where they differ.

use crate::compare;
use crate::compare::comparison::Comparison;
use crate::corrected_data::{CorrectedData, corrected_data};
use crate::defects;
use crate::ladder::Search;
use crate::request::{DiagnoseError, NotExecuted, Observer, Request, stop_flag};
use crate::rows::{self, MeasuredRows};
use measure::account::DataAccount;
use measure::config::Compared;
use measure::robots;
use measure::table::DataTable;
use study::choices::ChoiceError;
use study::defects::Defect;
use study::formula::{FormulaFitError, FormulaRequest};
use study::links::LinkStudy;
use study::open::{self, OpenError, Predicted, Subject};
use study::robots::RobotStudy;
use study::thresholds::MOST_MISSING_SHARE;
use study::view::Viewed;
use study::{COMMON, StopFlag, TermId};

/// Positions that are as close (m) are the same.
const SAME_M: f64 = 1e-9;

/// A study of one kind of measurements, as a diagnosis needs it.
pub(crate) trait Measured: Viewed + Sized {
    /// The kind.
    const SUBJECT: Subject;
    /// Section of its effects in a configuration.
    const EFFECT_SECTION: &'static str;

    /// Reads measurements of this kind and compares them with the model of a request.
    fn open(request: &Request<'_>) -> Result<(Self, DataAccount), DiagnoseError>;

    /// The same study, whose fits end early once the flag is set.
    fn stopping(self, stop: &StopFlag) -> Self;

    /// Unit of errors in words.
    fn error_unit(&self) -> &'static str;

    /// A study of about as many rows as a search needs; none where there are hardly more.
    fn some_rows(&self) -> Option<Self> {
        None
    }

    /// Why no size can be stated, before a search, from which on effects would be found. None: one can.
    fn sizes_by_simulation(&self) -> Option<&'static str> {
        None
    }

    /// The same measurements as if received frames alone had been logged, where it is not known whether lost frames were and it matters.
    fn as_received(&self) -> Option<Self> {
        None
    }

    /// Defects of the measurement.
    fn defects(&self, _observer: &dyn Observer) -> Vec<Defect> {
        Vec::new()
    }

    /// The study of the measurements with all defects corrected; `None`: no correction changes them in memory.
    fn without_defects(&self, _defects: &[Defect]) -> Result<Option<Self>, ChoiceError> {
        Ok(None)
    }

    /// The measured file with all defects corrected.
    fn corrected_data(
        &self,
        _table: &DataTable,
        _defects: &[Defect],
    ) -> Result<CorrectedData, DiagnoseError> {
        Err(DiagnoseError::CorrectedRobots)
    }

    /// Adds a formula of the user's to what may be missing.
    fn with_formula(&mut self, wanted: &FormulaRequest) -> Result<(), FormulaFitError>;

    /// How large the error of the configured model is, and under which conditions.
    fn comparison(&self, search: &Search<'_, Self>, account: &DataAccount) -> Comparison;

    /// The rows of the study, and the errors of the configured model and of that with some terms, as plots need them.
    fn measured_rows(&self, search: &Search<'_, Self>, terms: &[TermId]) -> MeasuredRows;

    /// What an error may depend on: a value per row.
    fn error_covariates(&self) -> Vec<(String, Vec<f64>)>;

    /// Refuses an extended configuration that a run would not apply.
    fn require_executed(
        &self,
        _request: &Request<'_>,
        _search: &Search<'_, Self>,
        _added: Added<'_>,
    ) -> Result<(), DiagnoseError> {
        Ok(())
    }

    /// Why two campaigns of this kind cannot be searched as one.
    fn mismatch(&self, other: &Self) -> Option<&'static str>;
}

/// Effects that a configuration is extended by.
#[derive(Clone, Copy)]
pub(crate) struct Added<'a> {
    pub(crate) terms: &'a [TermId],
    pub(crate) names: &'a [String],
    /// The text of the extended configuration.
    pub(crate) text: &'a str,
}

/// Reads measurements and reports how much of them is used.
pub(crate) fn opened<S: Measured>(
    request: &Request<'_>,
    observer: &dyn Observer,
) -> Result<(S, DataAccount), DiagnoseError> {
    let (study, account) = S::open(request)?;
    observer.opened(&account);
    Ok((study.stopping(&stop_flag(observer)), account))
}

impl Measured for LinkStudy {
    const SUBJECT: Subject = Subject::Links;
    const EFFECT_SECTION: &'static str = "netsim.phy.effect";

    fn open(request: &Request<'_>) -> Result<(Self, DataAccount), DiagnoseError> {
        if request.simulator.is_some() {
            return Err(DiagnoseError::SimulatorOfLinks);
        }
        Ok(open::links(request.config, request.table, &request.choices)?)
    }

    fn stopping(self, stop: &StopFlag) -> Self {
        self.with_stop_flag(stop)
    }

    fn error_unit(&self) -> &'static str {
        if self.rows.links.readings.is_given { "pdr" } else { "dB" }
    }

    fn some_rows(&self) -> Option<Self> {
        self.thinned()
    }

    fn as_received(&self) -> Option<Self> {
        Self::as_received(self)
    }

    fn defects(&self, observer: &dyn Observer) -> Vec<Defect> {
        defects::find(self, &|progress| observer.progress(progress))
    }

    fn without_defects(&self, defects: &[Defect]) -> Result<Option<Self>, ChoiceError> {
        self.corrected(&defects::joint_correction(defects))
    }

    fn corrected_data(
        &self,
        table: &DataTable,
        defects: &[Defect],
    ) -> Result<CorrectedData, DiagnoseError> {
        Ok(corrected_data(table, self, defects)?)
    }

    fn with_formula(&mut self, wanted: &FormulaRequest) -> Result<(), FormulaFitError> {
        self.add_formula(wanted)
    }

    fn comparison(&self, search: &Search<'_, Self>, account: &DataAccount) -> Comparison {
        compare::links(self, search, account)
    }

    fn measured_rows(&self, _search: &Search<'_, Self>, _terms: &[TermId]) -> MeasuredRows {
        rows::of_links(self)
    }

    fn error_covariates(&self) -> Vec<(String, Vec<f64>)> {
        self.covariates()
    }

    fn mismatch(&self, other: &Self) -> Option<&'static str> {
        let is_aggregated = |study: &Self| study.rows.links.readings.is_aggregated;
        (is_aggregated(self) != is_aggregated(other)).then_some(
            "one file has a row per frame and the other rows of several frames; convert both alike",
        )
    }
}

impl Measured for RobotStudy {
    const SUBJECT: Subject = Subject::Robots;
    const EFFECT_SECTION: &'static str = "robotsim.dynamics.effect";

    fn open(request: &Request<'_>) -> Result<(Self, DataAccount), DiagnoseError> {
        let Request { config, table, ref choices, simulator, .. } = *request;
        let predicted = match simulator {
            None => None,
            Some(simulator) => {
                let useless = |reason: String| OpenError::Useless {
                    file: table.path.display().to_string(),
                    reason,
                };
                let samples = robots::read(table).map_err(useless)?;
                Some(simulator.predict(config, &samples).map_err(DiagnoseError::Simulator)?)
            }
        };
        Ok(open::robots_predicted(config, table, choices, predicted)?)
    }

    fn stopping(self, stop: &StopFlag) -> Self {
        self.with_stop_flag(stop)
    }

    fn error_unit(&self) -> &'static str {
        "m"
    }

    // The fit of others takes up a part of an effect of a body that moves, each of another part.
    fn sizes_by_simulation(&self) -> Option<&'static str> {
        Some("of robots, `power` finds sizes by simulation")
    }

    fn some_rows(&self) -> Option<Self> {
        self.thinned()
    }

    fn with_formula(&mut self, wanted: &FormulaRequest) -> Result<(), FormulaFitError> {
        self.add_formula(wanted)
    }

    fn comparison(&self, search: &Search<'_, Self>, account: &DataAccount) -> Comparison {
        compare::robots(self, search, account)
    }

    fn measured_rows(&self, search: &Search<'_, Self>, terms: &[TermId]) -> MeasuredRows {
        rows::of_robots(self, search, terms)
    }

    fn error_covariates(&self) -> Vec<(String, Vec<f64>)> {
        self.covariates()
    }

    /// A simulator other than this program's is asked to predict with the extended configuration, and has to move as the fit says.
    fn require_executed(
        &self,
        request: &Request<'_>,
        search: &Search<'_, Self>,
        added: Added<'_>,
    ) -> Result<(), DiagnoseError> {
        let Some(simulator) = request.simulator else { return Ok(()) };
        let fit = search.full_fit(added.terms, COMMON, None);
        let extended: Compared =
            request.config.with_text(added.text.to_owned()).map_err(OpenError::from)?;
        let names = added.names.join(", ");
        let predicted = match simulator.predict(&extended, self.robots()) {
            Ok(predicted) => predicted,
            Err(error) => return Err(NotExecuted::Refused { error, names }.into()),
        };
        let Predicted { by, windows } = predicted;
        let Some([fitted_m, missing_m]) = self.applied(&fit, &windows) else {
            return Err(NotExecuted::Dynamics.into());
        };
        if fitted_m < SAME_M {
            return Err(NotExecuted::NothingMoved { names, by }.into());
        }
        if MOST_MISSING_SHARE * fitted_m < missing_m {
            return Err(NotExecuted::MovesOtherwise { names, by, fitted_m, missing_m }.into());
        }
        Ok(())
    }

    fn mismatch(&self, other: &Self) -> Option<&'static str> {
        (self.robots().shape != other.robots().shape).then_some(
            "the robots of the two files are commanded in different ways; convert both alike",
        )
    }
}
