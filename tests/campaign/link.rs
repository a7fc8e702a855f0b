//! Link campaigns: the strengths that make the sizes asked for, and the frames.

use super::draws::Draws;
use super::effect::{Change, Curve, Effect, Register};
use super::hidden::{Hidden, Size};
use super::world::{Layout, World, rounded};
use super::{Campaign, Scores, Truth, oracle};

impl Campaign {
    /// A link campaign with this hidden in it, of at most `n_rows` rows, in whole frames.
    ///
    /// The transmit power is such that a share of the frames, drawn between 61 and 84 %, is received.
    #[must_use]
    pub fn link(seed: u64, layout: &Layout, hidden: &[(Hidden, Size)], n_rows: usize) -> Self {
        let made = Made::new(seed, layout, hidden, n_rows);
        let changes: Vec<&Change> = made.changes.iter().collect();
        let truth: Vec<Truth> = (0..hidden.len())
            .map(|k| {
                let size = made.air.size(&made.effects, &changes, k, made.tx_power_dbm);
                made.effects[k].truth(made.strengths[k], size)
            })
            .collect();
        let diffraction = hidden.iter().position(|&(kind, _)| kind == Hidden::Diffraction);
        let wall_height_m = diffraction.map(|k| made.strengths[k]);
        let n_received = made.readings.iter().flatten().count();
        Self {
            csv: made.air.world.csv(&made.readings),
            config_toml: made.air.world.config(made.tx_power_dbm, wall_height_m),
            truth,
            oracle: made.scores(0.0),
            received: n_received as f64 / made.readings.len() as f64,
        }
    }
}

/// All of a campaign, before it is written.
pub(crate) struct Made {
    air: Air,
    effects: Vec<Effect>,
    strengths: Vec<f64>,
    changes: Vec<Change>,
    tx_power_dbm: f64,
    /// Per row what was read (dBm), if the frame was received.
    readings: Vec<Option<f64>>,
}

impl Made {
    pub(crate) fn new(
        seed: u64,
        layout: &Layout,
        hidden: &[(Hidden, Size)],
        n_rows: usize,
    ) -> Self {
        let kinds: Vec<Hidden> = hidden.iter().map(|(kind, _)| *kind).collect();
        let air = Air::new(seed, layout, World::new(seed, layout, &kinds, n_rows));
        let effects: Vec<Effect> =
            kinds.iter().map(|&kind| Effect::new(kind, seed, &air.world)).collect();
        let sizes: Vec<Size> = hidden.iter().map(|(_, size)| *size).collect();
        let strengths = air.settled(&effects, &sizes);
        let changes: Vec<Change> = effects
            .iter()
            .zip(&strengths)
            .map(|(effect, &s)| effect.change(s, &air.world))
            .collect();
        let all: Vec<&Change> = changes.iter().collect();
        let tx_power_dbm = rounded(air.tx_power_dbm(&all), 2);
        let law = Law::combine(&all);
        let readings: Vec<Option<f64>> = (0..air.world.rows.len())
            .map(|row| {
                let power_dbm = tx_power_dbm + air.level(&all, row) + air.noise_db[row];
                (air.luck[row] < law.delivery(&all, row, power_dbm))
                    .then(|| law.register.reading(power_dbm).round())
            })
            .collect();
        Self { air, effects, strengths, changes, tx_power_dbm, readings }
    }

    /// The scores of the true model, but for a transmit power that is off by this much (dB).
    pub(crate) fn scores(&self, off_db: f64) -> Scores {
        let changes: Vec<&Change> = self.changes.iter().collect();
        oracle::scores(&self.air, &changes, self.tx_power_dbm + off_db, &self.readings)
    }
}

/// What the changes make of reception and reading, together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Law {
    pub(crate) curve: Curve,
    pub(crate) register: Register,
}

impl Law {
    /// Of some changes, of which at most one has a curve and at most one a register.
    pub(crate) fn combine(changes: &[&Change]) -> Self {
        Self {
            curve: changes.iter().find_map(|change| change.curve).unwrap_or(Curve::Table(0.0)),
            register: changes.iter().find_map(|change| change.register).unwrap_or(Register::EXACT),
        }
    }

    /// Probability of reception at a received power.
    pub(crate) fn delivery(self, changes: &[&Change], row: usize, power_dbm: f64) -> f64 {
        self.curve.probability(power_dbm) * (1.0 - loss(changes, row))
    }
}

/// Probability that a row's frame is lost for another reason than its strength.
pub(crate) fn loss(changes: &[&Change], row: usize) -> f64 {
    let passed = |change: &&Change| change.loss.get(row).map_or(1.0, |loss| 1.0 - loss);
    1.0 - changes.iter().map(passed).product::<f64>()
}

/// What is drawn once for a campaign, whatever is hidden in it.
pub(crate) struct Air {
    /// Gain of the base model, per row (dB).
    gain_db: Vec<f64>,
    noise_db: Vec<f64>,
    /// Uniform draws that decide reception.
    luck: Vec<f64>,
    /// Standard deviation of the noise (dB).
    pub(crate) noise_sd_db: f64,
    /// Share of frames to be received.
    share: f64,
    pub(crate) world: World,
}

impl Air {
    fn new(seed: u64, layout: &Layout, world: World) -> Self {
        let (mut noise, mut luck) = (Draws::new(seed, "noise"), Draws::new(seed, "reception"));
        let base = |row: &super::world::Row| world.base.gain_db(row.distance_m(), row.channel);
        Self {
            gain_db: world.rows.iter().map(base).collect(),
            noise_db: world.rows.iter().map(|_| layout.noise_db * noise.normal()).collect(),
            luck: world.rows.iter().map(|_| luck.uniform()).collect(),
            noise_sd_db: layout.noise_db,
            share: Draws::new(seed, "share").between(0.61, 0.84),
            world,
        }
    }

    /// Received power of a row at a transmit power of 0 dBm, without noise (dB).
    fn level(&self, changes: &[&Change], row: usize) -> f64 {
        let added = changes.iter().map(|change| change.power_db.get(row).unwrap_or(&0.0));
        self.gain_db[row] + added.sum::<f64>()
    }

    /// The same, of what is no random draw.
    pub(crate) fn known_level(&self, changes: &[&Change], row: usize) -> f64 {
        let known: Vec<&Change> =
            changes.iter().copied().filter(|change| change.random.is_none()).collect();
        self.level(&known, row)
    }

    /// The transmit power (dBm) at which the share asked for is received.
    fn tx_power_dbm(&self, changes: &[&Change]) -> f64 {
        let n = self.gain_db.len();
        let law = Law::combine(changes);
        let levels: Vec<f64> =
            (0..n).map(|row| self.level(changes, row) + self.noise_db[row]).collect();
        let passes: Vec<f64> = (0..n).map(|row| 1.0 - loss(changes, row)).collect();
        bisected(-80.0, 60.0, 22, |power_dbm| {
            let one = |(level, pass): (&f64, &f64)| law.curve.probability(power_dbm + level) * pass;
            levels.iter().zip(&passes).map(one).sum::<f64>() < self.share * n as f64
        })
    }

    /// The size of one of the effects: as [`Truth::size`], where a received row counts by the probability of its reception,
    /// so that it changes smoothly.
    fn size(&self, effects: &[Effect], changes: &[&Change], of: usize, tx_power_dbm: f64) -> f64 {
        let law = Law::combine(changes);
        let change = changes[of];
        let mut others = changes.to_vec();
        others.remove(of);
        let without = Law::combine(&others);
        let [mut squares, mut weights, mut lost] = [0.0; 3];
        for row in 0..self.gain_db.len() {
            let power_dbm = tx_power_dbm + self.level(changes, row) + self.noise_db[row];
            let weight = law.delivery(changes, row, power_dbm);
            let added = match change.register {
                Some(register) => register.reading(power_dbm) - power_dbm,
                None => change.power_db.get(row).copied().unwrap_or(0.0),
            };
            squares += weight * added * added;
            weights += weight;
            lost += without.delivery(&others, row, power_dbm) - weight;
        }
        if effects[of].hidden.is_of_reception() {
            lost / self.gain_db.len() as f64
        } else {
            (squares / weights).sqrt() / self.noise_sd_db
        }
    }

    /// The strengths at which the effects have these sizes.
    fn settled(&self, effects: &[Effect], sizes: &[Size]) -> Vec<f64> {
        let world = &self.world;
        let mut strengths: Vec<f64> = effects.iter().map(|effect| effect.strengths()[0]).collect();
        // Each changes what of the other is received; a third round moves a strength by less than a hundredth.
        let n_rounds = if effects.len() == 1 { 1 } else { 3 };
        for _ in 0..n_rounds {
            for (k, effect) in effects.iter().enumerate() {
                let wanted = if effect.hidden.is_of_reception() {
                    sizes[k].of_delivery()
                } else {
                    sizes[k].of_noise()
                };
                let mut changes: Vec<Change> =
                    effects.iter().zip(&strengths).map(|(e, &s)| e.change(s, world)).collect();
                let mut size = |strength: f64| {
                    changes[k] = effect.change(strength, world);
                    let all: Vec<&Change> = changes.iter().collect();
                    self.size(effects, &all, k, self.tx_power_dbm(&all))
                };
                strengths[k] = settled_one(&effect.strengths(), wanted, &mut size);
            }
        }
        strengths
    }
}

/// The smallest strength at which the size is as wanted, or where it is greatest: an obstacle that nothing passes leaves no
/// received row to see it in.
pub(crate) fn settled_one(steps: &[f64], wanted: f64, size: &mut impl FnMut(f64) -> f64) -> f64 {
    let mut best = (f64::NEG_INFINITY, steps[0]);
    let mut before = steps[0];
    for &step in steps {
        let here = size(step);
        if wanted <= here {
            return bisected(before, step, 20, |strength| size(strength) < wanted);
        }
        if best.0 < here {
            best = (here, step);
        }
        before = step;
    }
    best.1
}

/// Where something that holds below a value ceases to hold.
pub(crate) fn bisected(
    low: f64,
    high: f64,
    n_steps: u32,
    mut is_below: impl FnMut(f64) -> bool,
) -> f64 {
    let (mut low, mut high) = (low, high);
    for _ in 0..n_steps {
        let middle = (low + high) / 2.0;
        if is_below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low + high) / 2.0
}
