//! What the page of an answer about links or robots shows beside the answer.

use diagnose::held_out;
use diagnose::ladder::Search;
use measure::robots::RobotSample;
use report::measured::{LinkRows, MeasuredRows, RobotRows};
use study::COMMON;
use study::links::LinkStudy;
use study::robots::RobotStudy;
use study::view::RowPredictions;

/// What pictures need beside an answer.
pub(super) struct Pictures {
    pub(super) rows: MeasuredRows,
    pub(super) before: RowPredictions,
    pub(super) after: Option<RowPredictions>,
    pub(super) covariates: Vec<(String, Vec<f64>)>,
}

impl Pictures {
    /// Of measured links, with these effects beside none.
    pub(super) fn of_links(
        study: &LinkStudy,
        search: &Search<'_, LinkStudy>,
        terms: &[usize],
    ) -> Self {
        tracing::info!("drawing");
        let measured = &study.rows.links.rows;
        let rows = LinkRows {
            ends: measured
                .iter()
                .zip(study.moving())
                .map(|(row, [tx, rx])| {
                    [([row.tx_m[0], row.tx_m[1]], tx), ([row.rx_m[0], row.rx_m[1]], rx)]
                })
                .collect(),
            motes: measured.iter().map(|row| [row.tx, row.rx]).collect(),
            frames: measured.iter().map(|row| [row.frames, row.received]).collect(),
            quantum_db: study.rows.links.readings.quantum_db,
        };
        Self {
            rows: MeasuredRows::Links(rows),
            before: held_out::predictions(study, search, &[]),
            after: (!terms.is_empty()).then(|| held_out::predictions(study, search, terms)),
            covariates: study.covariates(),
        }
    }

    /// Of measured robots, with these effects beside none.
    pub(super) fn of_robots(
        study: &RobotStudy,
        search: &Search<'_, RobotStudy>,
        terms: &[usize],
    ) -> Self {
        tracing::info!("drawing");
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
        let rows = RobotRows {
            tracks: robots
                .tracks
                .iter()
                .map(|track| robots.samples[track.clone()].iter().map(place).collect())
                .collect(),
            ends: study.windows().iter().map(|ends| ends.map(place)).collect(),
            agents: study.windows().iter().map(|[start, _]| start.agent).collect(),
            horizons,
        };
        Self {
            rows: MeasuredRows::Robots(rows),
            before: held_out::predictions(study, search, &[]),
            after: (!terms.is_empty()).then(|| held_out::predictions(study, search, terms)),
            covariates: study.covariates(),
        }
    }
}
