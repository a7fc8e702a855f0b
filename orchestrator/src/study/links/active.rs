//! Effects at certain values, and what a model with them says about a row.

use super::likelihood::Level;
use super::rows::Rows;
use netsim::phy::effect::Effect;
use std::sync::Arc;

/// An effect at certain values of its parameters.
#[derive(Clone, Debug)]
pub(super) struct Active {
    pub(super) effect: Arc<dyn Effect>,
    /// Registers read otherwise with it.
    reads_otherwise: bool,
}

impl Active {
    pub(super) fn new(effect: Box<dyn Effect>, rows: &Rows) -> Self {
        // Readings over the whole range tell whether it touches them at all.
        let reads_otherwise = !rows.is_empty()
            && (-60..=10).any(|step| {
                let dbm = 2.0 * f64::from(step);
                (rows.register_dbm(&*effect, 0, dbm) - dbm).abs() > 0.0
            });
        Self { effect: Arc::from(effect), reads_otherwise }
    }

    pub(super) fn get(&self) -> &dyn Effect {
        &*self.effect
    }

    /// Whether it changes how frames vary about the mean, or which pass at a level.
    pub(super) fn is_instrument(&self) -> bool {
        self.effect.curve().is_some() || self.effect.scatter().is_some()
    }

    /// Whether it changes nothing but means.
    pub(super) fn is_plain(&self) -> bool {
        !self.reads_otherwise && !self.is_instrument()
    }
}

/// Effects with which registers read otherwise.
pub(super) fn reading_otherwise(effects: &[Option<Active>]) -> impl Iterator<Item = &dyn Effect> {
    effects.iter().flatten().filter(|active| active.reads_otherwise).map(Active::get)
}

/// What a model with terms says about a row. `added`: power, shift, logarithm of survival that the terms add. `otherwise`: those
/// with which registers read otherwise.
pub(super) fn level<'a>(
    rows: &Rows,
    row: usize,
    added: [f64; 3],
    otherwise: impl Iterator<Item = &'a dyn Effect>,
) -> Level {
    let base = &rows.base[row];
    let power_dbm = base.power_dbm + added[0];
    let reading = otherwise.fold(power_dbm + base.register_db, |reading, effect| {
        rows.register_dbm(effect, row, reading)
    });
    Level {
        power_dbm,
        register_db: reading - power_dbm,
        shift_db: base.shift_db + added[1],
        ln_survival: base.ln_survival + added[2],
        stated: base.stated,
    }
}
