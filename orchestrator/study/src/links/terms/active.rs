//! Effects at certain values, and what a model with them says about a row.

use crate::links::likelihood::RowPrediction;
use crate::links::likelihood::reception::PowerMixture;
use crate::links::likelihood::register::{PowerRange, Register};
use crate::links::rows::{Contribution, ModelledLinks};
use physics::effect::Effect;
use physics::link::Link;
use physics::scatter::Renewal;
use proto::rng::Purpose;
use std::sync::Arc;

/// An effect at certain values of its parameters.
#[derive(Clone, Debug)]
pub(in crate::links) struct ActiveEffect {
    pub(in crate::links) effect: Arc<dyn Effect>,
    /// What registers make of powers with it.
    register: Register,
}

impl ActiveEffect {
    pub(in crate::links) fn new(effect: Box<dyn Effect>, rows: &ModelledLinks) -> Self {
        let register = rows.register_of(&*effect);
        Self { effect: Arc::from(effect), register }
    }

    pub(in crate::links) fn get(&self) -> &dyn Effect {
        &*self.effect
    }

    /// Whether it changes how frames vary about the mean, or which pass at a level.
    pub(in crate::links) fn is_instrument(&self) -> bool {
        self.effect.curve().is_some() || self.effect.scatter().is_some()
    }

    /// Whether it changes nothing but means.
    pub(in crate::links) fn is_plain(&self) -> bool {
        self.register == Register::Exact && !self.is_instrument()
    }
}

/// The effects that change what registers read.
#[derive(Clone, Debug)]
pub(in crate::links) struct AlteredRegister<'a> {
    effects: Vec<&'a dyn Effect>,
    is_bent: bool,
}

impl<'a> AlteredRegister<'a> {
    /// Selects them among the effects of a model's terms.
    pub(in crate::links) fn from_effects(
        effects: &'a [Option<ActiveEffect>],
        rows: &ModelledLinks,
    ) -> Self {
        let all = || effects.iter().flatten();
        let is_bent = rows.is_bent || all().any(|active| active.register == Register::Bent);
        let otherwise = all().filter(|active| active.register != Register::Exact);
        Self { effects: otherwise.map(ActiveEffect::get).collect(), is_bent }
    }

    /// Whether some register does more than shift, its least and greatest reading apart.
    pub(in crate::links) fn is_bent(&self) -> bool {
        self.is_bent
    }

    /// What the register of a row reads of a power (dBm); none where it but shifts.
    pub(in crate::links) fn read<'b>(
        &'b self,
        rows: &'b ModelledLinks,
        row: usize,
    ) -> Option<impl Fn(f64) -> f64 + 'b> {
        (self.is_bent || rows.limits_dbm.is_some()).then_some(move |power_dbm: f64| {
            rows.link(row, |link| self.read_of(rows, link, power_dbm))
        })
    }

    fn read_of(&self, rows: &ModelledLinks, link: &Link<'_>, power_dbm: f64) -> f64 {
        let configured = rows.model.effects.iter().map(|effect| &**effect);
        let effects = configured.chain(self.effects.iter().copied());
        rows.limited_dbm(effects.fold(power_dbm, |dbm, effect| effect.register_dbm(link, dbm)))
    }
}

/// What a model with terms says about a row. `added`: what the terms add.
pub(in crate::links) fn level(
    rows: &ModelledLinks,
    row: usize,
    added: Contribution,
    otherwise: &AlteredRegister<'_>,
) -> RowPrediction {
    let base = &rows.base[row];
    let power_dbm = base.power_dbm + added.power_db;
    let (register_db, range) = if otherwise.is_bent {
        let rssi_dbm = rows.links.rows[row].rssi_dbm;
        rows.link(row, |link| {
            let read = |dbm: f64| otherwise.read_of(rows, link, dbm);
            let register_db = read(power_dbm) - power_dbm;
            let range = if rssi_dbm.is_finite() {
                PowerRange::of_reading(&read, rssi_dbm, rows.links.readings.quantum_db)
            } else {
                PowerRange::shifted(register_db)
            };
            (register_db, range)
        })
    } else {
        // A register that only shifts needs no inversion.
        let shifted_dbm = power_dbm + base.register_db;
        let reading_dbm = otherwise
            .effects
            .iter()
            .fold(shifted_dbm, |dbm, effect| rows.register_dbm(*effect, row, dbm));
        let shift_db = reading_dbm - power_dbm;
        (rows.limited_dbm(reading_dbm) - power_dbm, limited_range(rows, row, shift_db))
    };
    RowPrediction {
        power_dbm,
        register_db,
        range,
        shift_db: base.shift_db + added.shift_db,
        ln_survival: base.ln_survival + added.ln_survival,
        stated: base.stated,
    }
}

/// The range of powers that gives a row's reading, where registers shift by so much (dB) between their least and greatest reading.
fn limited_range(rows: &ModelledLinks, row: usize, shift_db: f64) -> PowerRange {
    let Some([least_dbm, greatest_dbm]) = rows.limits_dbm else {
        return PowerRange::shifted(shift_db);
    };
    let reading_dbm = rows.links.rows[row].rssi_dbm;
    let quantum_db = rows.links.readings.quantum_db;
    if reading_dbm <= least_dbm {
        PowerRange::below(reading_dbm, shift_db, quantum_db)
    } else if greatest_dbm <= reading_dbm {
        PowerRange::above(reading_dbm, shift_db, quantum_db)
    } else {
        PowerRange::shifted(shift_db)
    }
}

/// The spread of a base model.
impl ModelledLinks {
    /// What varies about the base model's mean from frame to frame.
    #[must_use]
    pub fn base_spread(&self) -> PowerMixture {
        self.model
            .scatters()
            .iter()
            .filter(|scatter| scatter.renewal == Renewal::Frame)
            .filter(|scatter| scatter.purpose != Purpose::FrameNoise)
            .fold(PowerMixture::none(), |spread, scatter| {
                spread.and(&PowerMixture::of_law(&scatter.law))
            })
    }
}
