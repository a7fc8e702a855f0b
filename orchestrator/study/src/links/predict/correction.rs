//! What a fit says of rows that were changed, and a study of measurements that were corrected.

use crate::choices::ChoiceError;
use crate::defects::Correction;
use crate::links::LinkStudy;
use crate::links::fit::LinkFit;
use crate::links::likelihood::RowPrediction;
use crate::links::rows::ModelledLinks;

impl LinkStudy {
    /// What a fit says of every row, random effects apart. `rows`: those of the study, or as many in their place, such as rows with
    /// other positions.
    #[must_use]
    pub fn row_predictions(&self, fit: &LinkFit, rows: &ModelledLinks) -> Vec<RowPrediction> {
        let specs = self.specs_of(&fit.terms);
        let otherwise = fit.otherwise(rows);
        (0..rows.len()).map(|row| fit.level((rows, &specs), row, &otherwise)).collect()
    }

    /// Whether registers do more than shift, by a fit.
    #[must_use]
    pub fn has_bent_register(&self, fit: &LinkFit) -> bool {
        fit.otherwise(&self.rows).is_bent()
    }

    /// A study of the corrected measurements; `None`: the correction changes nothing in memory, or leaves rows that the model cannot
    /// predict.
    ///
    /// # Errors
    ///
    /// The rows that are left do not allow what was chosen by hand.
    pub fn corrected(&self, correction: &Correction) -> Result<Option<Self>, ChoiceError> {
        if correction.is_empty() {
            return Ok(None);
        }
        let mut rows = self.rows.clone();
        if !correction.replaced.is_empty() {
            let mut measured = rows.links.rows.clone();
            for &(row, replacement) in &correction.replaced {
                measured[row as usize] = replacement;
            }
            let Some(changed) = rows.with_rows(measured) else { return Ok(None) };
            rows = changed;
        }
        if !correction.left_out.is_empty() {
            let mut is_kept = vec![true; rows.len()];
            correction.left_out.iter().for_each(|&row| is_kept[row as usize] = false);
            rows = rows.some(&is_kept);
        }
        rows.limits_dbm = correction.limits_dbm.or(rows.limits_dbm);
        let study = Self::new(rows, self.fixed_sd_db, &self.choices, &self.catalogue)?;
        Ok(Some(study.with_stop_flag(&self.stop).with_losses_unknown(self.are_losses_unknown)))
    }
}
