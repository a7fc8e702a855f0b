//! What a fitted model predicts for the rows, and what is left of them.

use super::LinkStudy;
use super::fit::LinkFit;
use super::likelihood::{Instrument, Level};
use crate::diagnose::ladder::{COMMON, Ladder, Search};
use crate::diagnose::scan::{self, Structure};
use crate::study::RowScore;
use std::collections::BTreeMap;

/// What is left when the ladder has ended.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOver {
    /// Formulas of the covariates that were taken as curves, and the rmse after each (dB).
    pub formulas: BTreeMap<String, (String, f64)>,
    /// The strongest structure that nothing in the model explains.
    pub structure: Option<Structure>,
}

/// The instrument of a fit where the level has a variance (dB²) of its own: made in steps of 2 % of the noise.
pub(super) fn instrument_for<'a>(
    fit: &LinkFit,
    extra: f64,
    tables: &'a mut BTreeMap<i64, Instrument>,
) -> &'a Instrument {
    let variance = fit.instrument.sd_db * fit.instrument.sd_db + extra;
    let key = (25.0 * variance.ln()).round() as i64;
    tables.entry(key).or_insert_with(|| fit.instrument.with_sd((key as f64 / 50.0).exp()))
}

impl LinkStudy {
    /// Scores one row.
    pub(super) fn score(
        &self,
        fit: &LinkFit,
        row: usize,
        level: &Level,
        lift: f64,
        extra: f64,
        tables: &mut BTreeMap<i64, Instrument>,
    ) -> RowScore {
        instrument_for(fit, extra, tables).score(&self.rows.links.rows[row], level, lift)
    }

    /// What a fit predicts for every row: the mean reading of a received frame (dBm), its standard deviation (dB), and the
    /// probability of reception.
    #[must_use]
    pub fn predictions(&self, fit: &LinkFit) -> Vec<(f64, f64, f64)> {
        let specs = self.specs_of(&fit.terms);
        let cells = self.cells(fit.decorrelation_m);
        let mut tables: BTreeMap<i64, Instrument> = BTreeMap::new();
        (0..self.rows.len())
            .map(|row| {
                let level = fit.level(&self.rows, &specs, row);
                let lift = fit.random.level_db(cells, row);
                let extra = fit.random.variance(cells, row);
                let instrument = instrument_for(fit, extra, &mut tables);
                let (mean, sd) = instrument.reading(&level, lift);
                (mean, sd, instrument.reception(&level, lift))
            })
            .collect()
    }

    /// What is left of the rows under a fit: deviations of readings (dB), the same in standard deviations, and the surprise
    /// of reception in standard deviations. NaN where there is none.
    #[must_use]
    pub fn residuals(&self, fit: &LinkFit) -> [Vec<f64>; 3] {
        let mut all = [(); 3].map(|()| vec![f64::NAN; self.rows.len()]);
        for (row, (mean, sd, passes)) in self.predictions(fit).into_iter().enumerate() {
            let measured = &self.rows.links.rows[row];
            if measured.rssi_dbm.is_finite() {
                all[0][row] = measured.rssi_dbm - mean;
                all[1][row] = all[0][row] / sd;
            }
            if self.rows.links.has_losses && measured.received.is_finite() {
                let share = measured.received / measured.frames;
                all[2][row] = (share - passes) / (passes * (1.0 - passes)).max(1e-6).sqrt();
            }
        }
        all
    }

    /// What is left over a covariate when the ladder has ended: for what was taken as a curve its formula, and the strongest
    /// structure that nothing explains.
    #[must_use]
    pub fn left_over(&self, search: &Search<'_, Self>, ladder: &Ladder) -> LeftOver {
        let mut formulas = BTreeMap::new();
        for &term in &ladder.accepted {
            let Some(covariate) = self.candidates[term].curve_over() else { continue };
            let rest: Vec<usize> =
                ladder.accepted.iter().copied().filter(|&other| other != term).collect();
            let [deviation, ..] = self.residuals(&search.full(&rest, COMMON, None));
            let values = self.rows.links.covariates.iter().find(|(name, _)| name == covariate);
            if let Some(found) = values
                .and_then(|(name, values)| scan::formula(name, values, &deviation, &self.time))
            {
                formulas.insert(covariate.to_owned(), found);
            }
        }
        let [deviation, scaled, surprise] =
            self.residuals(&search.full(&ladder.accepted, COMMON, None));
        let covariates = self.covariates();
        let levels = [&self.time, &self.place];
        let mut structure = if ladder.too_little.is_none() && levels.iter().all(|l| l.suffices()) {
            scan::strongest(&covariates, &[&scaled, &surprise], &levels)
        } else {
            None
        };
        if let Some(structure) = &mut structure
            && let Some((name, values)) =
                covariates.iter().find(|(name, _)| *name == structure.covariate)
        {
            structure.formula = scan::formula(name, values, &deviation, &self.time);
        }
        LeftOver { formulas, structure }
    }
}
