//! Predictions row by row, for pictures.

use super::LinkStudy;
use super::fit::LinkFit;
use super::likelihood::Instrument;
use super::predict::instrument_for;
use crate::study::view::{View, Viewed};
use std::collections::BTreeMap;

impl Viewed for LinkStudy {
    fn view(&self, fit: &LinkFit) -> View {
        let specs = self.specs_of(&fit.terms);
        let cells = self.cells(fit.decorrelation_m);
        let mut tables: BTreeMap<i64, Instrument> = BTreeMap::new();
        let mut view = View::default();
        for (row, measured) in self.rows.links.rows.iter().enumerate() {
            let level = fit.level(&self.rows, &specs, row);
            let lift = fit.random.level_db(cells, row);
            let extra = fit.random.variance(cells, row);
            let instrument = instrument_for(fit, extra, &mut tables);
            let (mean, sd) = instrument.reading(&level, lift);
            view.predicted.push(mean);
            view.measured.push(measured.rssi_dbm);
            view.sd.push(sd);
            view.level.push(level.power_dbm + lift - level.shift_db);
            view.passes.push(instrument.reception(&level, lift));
        }
        view
    }
}

impl LinkStudy {
    /// Whether the sender and the receiver of each row move during the campaign.
    #[must_use]
    pub fn moving(&self) -> Vec<[bool; 2]> {
        let still = super::testable::still(&self.rows);
        let moves = |mote: u32| !still.get(&mote).copied().unwrap_or(true);
        self.rows.links.rows.iter().map(|row| [moves(row.tx), moves(row.rx)]).collect()
    }
}
