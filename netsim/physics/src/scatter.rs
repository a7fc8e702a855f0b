//! What varies about the mean: random contributions to the strength of a frame, and when each is drawn anew.
//!
//! Every contribution is a pure function of the seed, the link, the moment and the way its ends have travelled. Nothing
//! is stored per link, so a link's values depend neither on other links, nor on how many there are, nor on the steps in
//! which a simulation advances.

use super::standard::ChannelPlan;
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose, normal, ordered_link, uniform, unordered_link};
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// The seeds of an experiment: one, unless it was restored with another one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Seeds {
    /// Of what holds for the whole experiment: contributions that last, or that vary with the place or slowly with time.
    pub lasting: u64,
    /// Of what is drawn for a control period, a frame or a slot, and of the motes' own draws.
    pub passing: u64,
}

impl From<u64> for Seeds {
    fn from(seed: u64) -> Self {
        Self { lasting: seed, passing: seed }
    }
}

/// Distribution of a contribution (dB) about the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Normal with this standard deviation (dB), clipped at ±[`CLIP_SD`] of them.
    Normal {
        /// Standard deviation (dB).
        sd_db: f64,
    },
    /// Uniform from −span/2 to +span/2.
    Uniform {
        /// Span (dB).
        span_db: f64,
    },
    /// Power of a steady wave and many weak ones (Rice): unit mean power, so that the mean in dB lies below 0. Clipped where
    /// the weak ones together exceed [`CLIP_SD`] standard deviations of one component, and at [`DEEPEST_FADE_DB`].
    Rician {
        /// Power of the steady wave to that of the others (dB). Very low: Rayleigh.
        k_factor_db: f64,
    },
    /// What is wrong with the sender's transmitter and with the receiver's receiver: two normal numbers, clipped at
    /// ±[`CLIP_SD`] standard deviations, each the same on all links of its node.
    Nodes {
        /// Standard deviation over transmitters (dB).
        tx_sd_db: f64,
        /// Standard deviation over receivers (dB).
        rx_sd_db: f64,
    },
}

/// Deeper fades (dB) count as this: Rayleigh fading has one in a million.
pub const DEEPEST_FADE_DB: f64 = -60.0;

/// A normal contribution never exceeds this many standard deviations (one draw in 1.7 million would): so that links have
/// a greatest reach.
pub const CLIP_SD: f64 = 5.0;

/// When a contribution is drawn anew.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Renewal {
    /// Never: one value per link.
    Frozen,
    /// In every control period.
    Period,
    /// For every frame.
    Frame,
    /// As the ends move: correlation e^(−Δ/length) over the sum Δ of both ends' ways.
    Coherence {
        /// The way (m) over which the correlation falls to 1/e.
        length_m: f64,
    },
    /// On every channel, and whenever the ends together have moved on by a length. Between channels the correlation is
    /// e^(−|Δf|/coherence).
    Place {
        /// The way (m) after which it is drawn anew.
        length_m: f64,
        /// Difference in frequency (Hz) over which the correlation falls to 1/e.
        coherence_hz: f64,
        /// Channels of the physical layer.
        channels: ChannelPlan,
    },
    /// As time passes: correlation e^(−Δ/length) over the time Δ between the begins of control periods.
    Time {
        /// The time (s) over which the correlation falls to 1/e.
        length_s: f64,
        /// All links share one value.
        is_common: bool,
    },
}

/// A random contribution to the strength of frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// How it is distributed.
    pub law: Law,
    /// When it is drawn anew.
    pub renewal: Renewal,
    /// What the draws are for: keeps them apart from all others.
    pub purpose: Purpose,
    /// Tells several contributions of one purpose apart.
    pub ordinal: u32,
    /// Each direction of a link has values of its own. Otherwise both ends share them.
    pub directed: bool,
}

/// The moment for which a value is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Begin of the control period (ns).
    pub period_ns: u64,
    /// Begin of the frame (ns).
    pub sent_ns: u64,
    /// The way that both ends together have travelled so far (m).
    pub way_m: f64,
    /// IEEE 802.15.4 channel of the frame, 11 to 26, if it is known.
    pub channel: Option<u8>,
}

/// The random words that a pair of motes shares in a control period: whether the frame in either direction is received,
/// and levels that are redrawn each period or frame. One block of the generator serves them all, drawn when first asked.
#[derive(Clone, Copy, Debug, Default)]
pub struct PairBlock {
    seeds: Seeds,
    pair: u64,
    period_ns: u64,
    is_drawn: bool,
    words: [u64; 4],
}

impl PairBlock {
    /// The block of motes `a` and `b` in the period that begins at `period_ns`.
    #[inline]
    #[must_use]
    pub fn new(seeds: impl Into<Seeds>, a: MoteId, b: MoteId, period_ns: u64) -> Self {
        let (seeds, pair) = (seeds.into(), unordered_link(a.0, b.0));
        Self { seeds, pair, period_ns, is_drawn: false, words: [0; 4] }
    }

    /// As [`PairBlock::new`], where the words have been drawn already: see [`draw_blocks`].
    #[inline]
    #[must_use]
    pub fn drawn(seeds: Seeds, a: MoteId, b: MoteId, period_ns: u64, words: [u64; 4]) -> Self {
        Self { words, is_drawn: true, ..Self::new(seeds, a, b, period_ns) }
    }

    /// Uniform in [0, 1): a frame is received if this is less than its probability.
    #[inline]
    pub fn reception(&mut self, sender: MoteId, receiver: MoteId) -> f64 {
        let [low_to_high, high_to_low, ..] = self.words();
        uniform(if sender < receiver { low_to_high } else { high_to_low })
    }

    /// Uniform in [0, 1): the level of this period, or of the frame of this direction.
    #[inline]
    fn level(&mut self, sender: MoteId, receiver: MoteId, per_frame: bool) -> f64 {
        let [_, _, first, second] = self.words();
        uniform(if per_frame && receiver < sender { second } else { first })
    }

    /// Reception from the lower number, from the higher; level of the period and of the frame from the lower number, level
    /// of the frame from the higher.
    #[inline]
    pub fn words(&mut self) -> [u64; 4] {
        if !self.is_drawn {
            let draws = Draws::new(self.seeds.passing, Purpose::Reception);
            self.words = draws.words(self.pair, self.period_ns, 0);
            self.is_drawn = true;
        }
        self.words
    }
}

/// The words of many blocks at once. `pairs`: as [`unordered_link`] names them.
pub fn draw_blocks(seeds: Seeds, pairs: &[u64], period_ns: u64, words: &mut [[u64; 4]]) {
    Draws::new(seeds.passing, Purpose::Reception).words_of(pairs, period_ns, 0, words);
}

/// Which word of a [`PairBlock`] is the level of the period, or of the frame from the lower number; the next one is that
/// of the frame from the higher number.
pub const LEVEL_WORD: usize = 2;

impl Law {
    /// The distribution as levels (dB) with their probabilities: for integrals over it.
    #[must_use]
    pub fn levels(&self) -> Vec<(f64, f64)> {
        let normal = |sd_db: f64| -> Vec<(f64, f64)> {
            let levels: Vec<(f64, f64)> = (-7..=7)
                .map(|step| {
                    let z = f64::from(step) * 3.0 / 7.0;
                    (z * sd_db, libm::exp(-0.5 * z * z))
                })
                .collect();
            let total: f64 = levels.iter().map(|(_, weight)| weight).sum();
            levels.into_iter().map(|(level, weight)| (level, weight / total)).collect()
        };
        match *self {
            Self::Normal { sd_db } => normal(sd_db),
            Self::Nodes { tx_sd_db, rx_sd_db } => normal(libm::hypot(tx_sd_db, rx_sd_db)),
            Self::Uniform { span_db } => {
                let level = |i: u32| (span_db * ((f64::from(i) + 0.5) / 32.0 - 0.5), 1.0 / 32.0);
                (0..32).map(level).collect()
            }
            Self::Rician { k_factor_db } => Waves::from_k_factor(k_factor_db)
                .levels_db(16)
                .into_iter()
                .map(|db| (db, 1.0 / 16.0))
                .collect(),
        }
    }
}

impl Scatter {
    /// The most that it adds (dB).
    #[must_use]
    pub fn max_gain_db(&self) -> f64 {
        match self.law {
            Law::Normal { sd_db } => CLIP_SD * sd_db,
            Law::Uniform { span_db } => 0.5 * span_db,
            Law::Rician { k_factor_db } => {
                let Waves { steady, weak } = Waves::from_k_factor(k_factor_db);
                // A little more than the greatest amplitude: rounding must not exceed it.
                20.0 * libm::log10(steady + CLIP_SD * weak) + 1e-6
            }
            Law::Nodes { tx_sd_db, rx_sd_db } => CLIP_SD * (tx_sd_db + rx_sd_db),
        }
    }

    /// The most that it takes away (dB), 0 or more.
    #[must_use]
    pub fn max_loss_db(&self) -> f64 {
        match self.law {
            Law::Normal { .. } | Law::Uniform { .. } | Law::Nodes { .. } => self.max_gain_db(),
            Law::Rician { k_factor_db } => {
                let Waves { steady, weak } = Waves::from_k_factor(k_factor_db);
                let least = steady - CLIP_SD * weak;
                let deepest_db =
                    if 0.0 < least { 20.0 * libm::log10(least) } else { DEEPEST_FADE_DB };
                1e-6 - deepest_db.max(DEEPEST_FADE_DB)
            }
        }
    }

    /// Whether both directions of a link share the value, on all channels.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        self.is_reciprocal() && !matches!(self.renewal, Renewal::Place { .. })
    }

    /// Whether both directions of a link share the value on the same channel.
    #[must_use]
    pub fn is_reciprocal(&self) -> bool {
        !self.directed && self.renewal != Renewal::Frame && !matches!(self.law, Law::Nodes { .. })
    }

    /// Its value (dB) on a link at a moment.
    #[inline]
    #[must_use]
    pub fn value_db(
        &self,
        block: &mut PairBlock,
        sender: MoteId,
        receiver: MoteId,
        at: Moment,
    ) -> f64 {
        match self.law {
            Law::Uniform { span_db } => span_db * (self.level(block, sender, receiver, at) - 0.5),
            Law::Normal { sd_db } => {
                sd_db * self.deviate(block.seeds, sender, receiver, at).clamp(-CLIP_SD, CLIP_SD)
            }
            Law::Rician { k_factor_db } => {
                let entity = self.entity(sender, receiver);
                let time = match self.renewal {
                    Renewal::Frozen
                    | Renewal::Coherence { .. }
                    | Renewal::Place { .. }
                    | Renewal::Time { .. } => 0,
                    Renewal::Period => at.period_ns,
                    Renewal::Frame => at.sent_ns,
                };
                let draws = self.draws(block.seeds);
                let [a, b, ..] = draws.words(entity, time, u64::from(self.ordinal) << 32);
                Waves::from_k_factor(k_factor_db).power_db(a, b)
            }
            Law::Nodes { tx_sd_db, rx_sd_db } => {
                let draws = self.draws(block.seeds);
                let k = u64::from(self.ordinal) << 32;
                let offset_sd = |node: u32, k: u64| {
                    draws.normal(u64::from(node), 0, k).clamp(-CLIP_SD, CLIP_SD)
                };
                tx_sd_db * offset_sd(sender.0, k) + rx_sd_db * offset_sd(receiver.0, k | 1)
            }
        }
    }

    /// Its span (dB), if it is the level of the period or of the frame in the [`PairBlock`].
    #[must_use]
    pub fn block_span_db(&self) -> Option<f64> {
        match (self.law, self.renewal) {
            (Law::Uniform { span_db }, Renewal::Period | Renewal::Frame) if self.shares_block() => {
                Some(span_db)
            }
            _ => None,
        }
    }

    /// Whether its draws per period and frame are words of the [`PairBlock`].
    fn shares_block(&self) -> bool {
        self.purpose == Purpose::RandomnessLevel && self.ordinal == 0 && !self.directed
    }

    /// A uniform number in [0, 1].
    #[inline]
    fn level(&self, block: &mut PairBlock, sender: MoteId, receiver: MoteId, at: Moment) -> f64 {
        match self.renewal {
            Renewal::Period if self.shares_block() => block.level(sender, receiver, false),
            Renewal::Frame if self.shares_block() => block.level(sender, receiver, true),
            // Gaussian copula: the normal's distribution function makes a uniform number of it.
            Renewal::Frozen
            | Renewal::Period
            | Renewal::Frame
            | Renewal::Coherence { .. }
            | Renewal::Place { .. }
            | Renewal::Time { .. } => {
                let z = self.deviate(block.seeds, sender, receiver, at);
                0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2)
            }
        }
    }

    /// Its draws: what lasts, or varies with the place or slowly with time, keeps the seed that the experiment began with.
    #[inline]
    fn draws(&self, seeds: Seeds) -> Draws {
        let seed = match self.renewal {
            Renewal::Period | Renewal::Frame => seeds.passing,
            Renewal::Frozen
            | Renewal::Coherence { .. }
            | Renewal::Place { .. }
            | Renewal::Time { .. } => seeds.lasting,
        };
        Draws::new(seed, self.purpose)
    }

    /// Whose draws they are.
    #[inline]
    fn entity(&self, sender: MoteId, receiver: MoteId) -> u64 {
        if let Renewal::Time { is_common: true, .. } = self.renewal {
            0
        } else if self.is_reciprocal() {
            unordered_link(sender.0, receiver.0)
        } else {
            ordered_link(sender.0, receiver.0)
        }
    }

    /// A standard normal number.
    fn deviate(&self, seeds: Seeds, sender: MoteId, receiver: MoteId, at: Moment) -> f64 {
        let entity = self.entity(sender, receiver);
        let draws = self.draws(seeds);
        let k = u64::from(self.ordinal) << 32;
        match self.renewal {
            Renewal::Frozen => draws.normal(entity, 0, k),
            Renewal::Period => draws.normal(entity, at.period_ns, k),
            Renewal::Frame => draws.normal(entity, at.sent_ns, k),
            Renewal::Coherence { length_m } => gauss_markov(draws, entity, k, at.way_m / length_m),
            Renewal::Place { length_m, coherence_hz, channels } => {
                let place = (at.way_m / length_m) as u64;
                let rho = libm::exp(-channels.spacing_hz / coherence_hz);
                let first = channels.first;
                let step = at.channel.map_or(0, |channel| u64::from(channel.saturating_sub(first)));
                over_channels(draws, entity, place, k, rho, step)
            }
            Renewal::Time { length_s, .. } => {
                gauss_markov(draws, entity, k, at.period_ns as f64 * 1e-9 / length_s)
            }
        }
    }
}

/// A stationary Gauss–Markov sequence over channels: zero mean, unit variance, correlation ρ from one to the next. Its
/// value on the channel after so many steps from the lowest.
fn over_channels(draws: Draws, entity: u64, place: u64, k: u64, rho: f64, step: u64) -> f64 {
    let fresh = libm::sqrt(1.0 - rho * rho);
    let mut z = 0.0;
    // Two normal numbers of every draw.
    for pair in 0..=step / 2 {
        let [a, b, c, d] = draws.words(entity, place, k | pair);
        let first = normal(a, b);
        z = if pair == 0 { first } else { rho * z + fresh * first };
        if 2 * pair < step {
            z = rho * z + fresh * normal(c, d);
        }
    }
    z
}

/// Amplitudes of waves of unit mean power together.
#[derive(Clone, Copy, Debug)]
struct Waves {
    /// Of the steady one.
    steady: f64,
    /// Standard deviation of each component of the weak ones' sum.
    weak: f64,
}

impl Waves {
    #[inline]
    fn from_k_factor(k_factor_db: f64) -> Self {
        let k = libm::pow(10.0, k_factor_db / 10.0);
        Self { steady: libm::sqrt(k / (k + 1.0)), weak: libm::sqrt(0.5 / (k + 1.0)) }
    }

    /// Levels (dB) into which the waves' power falls equally often: means over `n` equal parts of the distribution.
    fn levels_db(self, n: usize) -> Vec<f64> {
        // Both components at equally likely values: a grid of equal weights.
        const SIDE: u32 = 48;
        /// 2⁶⁴, so many different words there are.
        const WORDS: f64 = 2.0 * (1_u64 << 63) as f64;
        let cell_db = |i: u32, k: u32| {
            let word = |j: u32| ((f64::from(j) + 0.5) / f64::from(SIDE) * WORDS) as u64;
            self.power_db(word(i), word(k))
        };
        let mut all: Vec<f64> =
            (0..SIDE).flat_map(|i| (0..SIDE).map(move |k| cell_db(i, k))).collect();
        all.sort_by(f64::total_cmp);
        let part = all.len() / n;
        (0..n).map(|i| all[i * part..(i + 1) * part].iter().sum::<f64>() / part as f64).collect()
    }

    /// Their power (dB) for two random words.
    #[inline]
    fn power_db(self, a: u64, b: u64) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - uniform(a))).min(CLIP_SD) * self.weak;
        let (sine, cosine) = libm::sincos(std::f64::consts::TAU * uniform(b));
        let (x, y) = (self.steady + radius * cosine, radius * sine);
        (10.0 * libm::log10(x * x + y * y)).max(DEEPEST_FADE_DB)
    }
}

/// A stationary Gauss–Markov process at `way`, in units of its correlation length; 0 or greater.
///
/// # Model
///
/// Zero mean, unit variance, correlation e^(−Δ): the model of Gudmundson (1991) for shadowing along a way. Usually it is
/// computed step by step, z′ = ρ z + √(1 − ρ²) w. Here it is computed at any point without a past, so that links need no
/// state: independent normal numbers stand at multiples of 16 lengths (where the correlation, 10⁻⁷, counts as none), and
/// the process between two known points is refined by halves, for a Gauss–Markov process is, between two points, normal
/// about ρ/(1 + ρ²) (a + b) with variance (1 − ρ²)/(1 + ρ²), ρ = e^(−half). After 12 halvings, 1/256 length apart, it is
/// linear.
///
/// # Validity
///
/// Correlation along the way travelled, not across it: who returns to a place does not find its old value there.
fn gauss_markov(draws: Draws, entity: u64, k: u64, way: f64) -> f64 {
    let cells = way / SPAN_LENGTHS;
    let cell = cells.floor();
    let mut rest = cells - cell;
    let cell = cell as u64;
    let mut left = draws.normal(entity, cell, k);
    let mut right = draws.normal(entity, cell.wrapping_add(1), k);
    let mut node = 1;
    for Halving { mean, sd } in &*HALVINGS {
        let [a, b, ..] = draws.words(entity, cell, k | node);
        let middle = mean * (left + right) + sd * normal(a, b);
        rest *= 2.0;
        node *= 2;
        if rest < 1.0 {
            right = middle;
        } else {
            left = middle;
            rest -= 1.0;
            node += 1;
        }
    }
    left + (right - left) * rest
}

/// What is known of the point in the middle of two.
struct Halving {
    /// The part of the sum of both values that is its mean.
    mean: f64,
    /// Standard deviation about that.
    sd: f64,
}

/// The halvings between two independent points.
static HALVINGS: LazyLock<[Halving; 12]> = LazyLock::new(|| {
    let mut half = SPAN_LENGTHS;
    std::array::from_fn(|_| {
        half *= 0.5;
        let rho = libm::exp(-half);
        let rho_squared = rho * rho;
        Halving {
            mean: rho / (1.0 + rho_squared),
            sd: libm::sqrt((1.0 - rho_squared) / (1.0 + rho_squared)),
        }
    })
});

/// Distance between independent points, in correlation lengths.
const SPAN_LENGTHS: f64 = 16.0;

#[cfg(test)]
mod tests;
