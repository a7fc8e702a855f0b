//! Predictions row by row, for pictures.

use crate::links::LinkStudy;
use crate::links::fit::LinkFit;
use crate::view::{RowPredictions, Viewed};

impl Viewed for LinkStudy {
    fn view(&self, fit: &LinkFit) -> RowPredictions {
        let mut view = RowPredictions::default();
        for (predicted, measured) in self.predictions(fit).iter().zip(&self.rows.links.rows) {
            view.predicted.push(predicted.rssi_dbm);
            view.measured.push(measured.rssi_dbm);
            view.sd.push(predicted.sd_db);
            view.level.push(predicted.level_dbm);
            view.passes.push(predicted.passes);
        }
        view
    }
}

impl LinkStudy {
    /// Whether the sender and the receiver of each row move during the campaign.
    #[must_use]
    pub fn moving(&self) -> Vec<[bool; 2]> {
        let still = self.rows.still();
        let moves = |mote: u32| !still.get(&mote).copied().unwrap_or(true);
        self.rows.links.rows.iter().map(|row| [moves(row.tx), moves(row.rx)]).collect()
    }
}
