//! The measured rows that an answer is about, with the predictions of both models: what plots are made of.

use crate::held_out;
use crate::ladder::Search;
use crate::measured::Measured;
use measure::robots::RobotSample;
use study::links::LinkStudy;
use study::robots::RobotStudy;
use study::view::RowPredictions;
use study::{COMMON, TermId};

/// Measured rows, and the predictions of fits that have not seen them.
#[derive(Clone, Debug)]
pub struct PredictedRows {
    /// Where and between whom rows were measured.
    pub rows: MeasuredRows,
    /// The model as configured.
    pub before: RowPredictions,
    /// The model with the effects found, if there are any.
    pub after: Option<RowPredictions>,
    /// Covariates: a name, and a value per row.
    pub covariates: Vec<(String, Vec<f64>)>,
}

/// Rows of one kind.
#[derive(Clone, Debug)]
pub enum MeasuredRows {
    /// Frames and possible receivers.
    Links(LinkRows),
    /// Windows of robots' tracks.
    Robots(RobotRows),
}

/// Measured links, a value per row.
#[derive(Clone, Debug)]
pub struct LinkRows {
    /// Sender and receiver of each row.
    pub ends: Vec<[LinkEnd; 2]>,
    /// Mote numbers of sender and receiver.
    pub motes: Vec<[u32; 2]>,
    /// Frames sent, and frames received of them, NaN where unknown.
    pub frames: Vec<[f64; 2]>,
    /// Step of the readings (dB), 0 if they are not rounded.
    pub quantum_db: f64,
}

/// An end of a measured link.
#[derive(Clone, Copy, Debug)]
pub struct LinkEnd {
    /// Its place (m, east and north).
    pub place_m: [f64; 2],
    /// Whether it moves in the course of the measurements.
    pub is_moving: bool,
}

/// Measured robots, a value per window.
#[derive(Clone, Debug)]
pub struct RobotRows {
    /// Tracks, as places over time (m).
    pub tracks: Vec<Vec<[f64; 2]>>,
    /// Where each window begins and ends (m).
    pub ends: Vec<[[f64; 2]; 2]>,
    /// Number of each window's robot.
    pub agents: Vec<u32>,
    /// Horizon (s), rmse of the model as configured, and of the model found (m).
    pub horizons: Vec<(f64, f64, Option<f64>)>,
}

/// All rows of a study as predicted by the configured model, and by that with these terms if there are any.
pub(crate) fn predicted<S: Measured>(
    study: &S,
    search: &Search<'_, S>,
    terms: &[TermId],
) -> PredictedRows {
    PredictedRows {
        rows: study.measured_rows(search, terms),
        before: held_out::predictions(study, search, &[]),
        after: (!terms.is_empty()).then(|| held_out::predictions(study, search, terms)),
        covariates: study.error_covariates(),
    }
}

/// The rows of measured links.
pub(crate) fn of_links(study: &LinkStudy) -> MeasuredRows {
    let measured = &study.rows.links.rows;
    let ends = measured.iter().zip(study.moving()).map(|(row, [tx, rx])| {
        [(row.tx_m, tx), (row.rx_m, rx)]
            .map(|([x_m, y_m, _], is_moving)| LinkEnd { place_m: [x_m, y_m], is_moving })
    });
    MeasuredRows::Links(LinkRows {
        ends: ends.collect(),
        motes: measured.iter().map(|row| [row.tx, row.rx]).collect(),
        frames: measured.iter().map(|row| [row.frames, row.received]).collect(),
        quantum_db: study.rows.links.readings.quantum_db,
    })
}

/// The windows of measured robots, and the errors over the horizon of the configured model and of that with these terms.
pub(crate) fn of_robots(
    study: &RobotStudy,
    search: &Search<'_, RobotStudy>,
    terms: &[TermId],
) -> MeasuredRows {
    let robots = study.robots();
    let place = |sample: &RobotSample| [sample.position_m[0], sample.position_m[1]];
    let before = study.errors_by_horizon(&search.full_fit(&[], COMMON, None));
    let after = if terms.is_empty() {
        Vec::new()
    } else {
        study.errors_by_horizon(&search.full_fit(terms, COMMON, None))
    };
    let horizons = before
        .into_iter()
        .map(|(at, error)| (at, error, after.iter().find(|(s, _)| *s == at).map(|(_, e)| *e)))
        .collect();
    let tracks = robots.tracks.iter();
    MeasuredRows::Robots(RobotRows {
        tracks: tracks
            .map(|track| robots.samples[track.clone()].iter().map(place).collect())
            .collect(),
        ends: study.windows().iter().map(|ends| ends.map(place)).collect(),
        agents: study.windows().iter().map(|[start, _]| start.agent).collect(),
        horizons,
    })
}
