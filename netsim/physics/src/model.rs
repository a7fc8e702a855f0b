//! The radio as configured: a base model, effects, a reception curve; and what they together say about a link.

use super::effect::Effect;
use super::link::{End, Link, Scene};
use super::propagation::{FREE_SPACE_EXPONENT, Prediction, Propagation, Radio, Reach, Reception};
use super::reception::Curve;
use super::scatter::{Law, Renewal, Scatter};
use super::standard::{ChannelPlan, o_qpsk_2450};
use proto::effect::FromModel;
use proto::rng::Purpose;

/// What the radio makes of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkBudget {
    /// Power of the frame at the receiver (dBm).
    pub rssi_dbm: f64,
    /// What the receiver's register reads (dBm).
    pub register_rssi_dbm: f64,
    /// Probability that the frame is received.
    pub reception_probability: f64,
    /// By how much (dB) effects demand that frames be stronger.
    pub shift_db: f64,
    /// The base model states the probability, whatever the power.
    pub is_stated: bool,
}

/// The radio as configured.
#[derive(Debug)]
pub struct Model {
    /// The propagation model, to which effects are added.
    pub propagation: Box<dyn Propagation>,
    /// Effects, in the order of the configuration.
    pub effects: Vec<Box<dyn Effect>>,
    /// From power to reception.
    pub curve: Box<dyn Curve>,
    /// Settings that all propagation models share: power, frequency, noise.
    pub radio: Radio,
    /// Distances below this (m) count as this.
    pub min_distance_m: f64,
    /// Channels of the physical layer, and their frequencies.
    pub channels: ChannelPlan,
    /// First what both directions of a link share, then the rest, then what acts on some links only.
    scatters: Vec<Scatter>,
    n_symmetric: usize,
    /// Places in `effects` of the last scatters' effects, in their order.
    limited: Vec<usize>,
}

impl Model {
    /// A radio. `noise_sd_db`: normal noise on the strength of every frame (dB), if there is any.
    #[must_use]
    pub fn new(
        propagation: Box<dyn Propagation>,
        effects: Vec<Box<dyn Effect>>,
        curve: Box<dyn Curve>,
        radio: Radio,
        min_distance_m: f64,
        noise_sd_db: Option<f64>,
    ) -> Self {
        let noise = noise_sd_db.filter(|&sd_db| 0.0 < sd_db).map(|sd_db| Scatter {
            law: Law::Normal { sd_db },
            renewal: Renewal::Frame,
            purpose: Purpose::FrameNoise,
            ordinal: 0,
            directed: true,
        });
        let mut scatters: Vec<Scatter> = propagation
            .scatter()
            .into_iter()
            .chain(effects.iter().filter(|it| !it.is_limited()).filter_map(|it| it.scatter()))
            .chain(noise)
            .collect();
        scatters.sort_by_key(|scatter| !scatter.is_symmetric());
        let n_symmetric = scatters.iter().filter(|scatter| scatter.is_symmetric()).count();
        let mut limited = Vec::new();
        for (place, effect) in effects.iter().enumerate().filter(|(_, it)| it.is_limited()) {
            if let Some(scatter) = effect.scatter() {
                limited.push(place);
                scatters.push(scatter);
            }
        }
        let channels = o_qpsk_2450::CHANNELS;
        Self {
            propagation,
            effects,
            curve,
            radio,
            min_distance_m,
            channels,
            scatters,
            n_symmetric,
            limited,
        }
    }

    /// The same radio with the channels of another physical layer than 2.4 GHz O-QPSK.
    #[must_use]
    pub fn with_channels(mut self, channels: ChannelPlan) -> Self {
        for scatter in &mut self.scatters {
            if let Renewal::Place { channels: of_scatter, .. } = &mut scatter.renewal {
                *of_scatter = channels;
            }
        }
        Self { channels, ..self }
    }

    /// Describes a link. `channel`: its number, if it is known.
    #[inline]
    #[must_use]
    pub fn link<'a>(
        &self,
        scene: &'a Scene<'a>,
        sender: End,
        receiver: End,
        channel: Option<u8>,
        time_ns: u64,
    ) -> Link<'a> {
        Link {
            sender,
            receiver,
            distance_m: sender.distance_squared_m2(&receiver).sqrt().max(self.min_distance_m),
            channel,
            frequency_hz: self.frequency_hz(channel),
            time_ns,
            scene,
        }
    }

    /// Frequency (Hz) of a channel, or of the carrier where no channel is known.
    #[must_use]
    pub fn frequency_hz(&self, channel: Option<u8>) -> f64 {
        channel.map_or(self.radio.carrier_hz, |channel| self.channels.centre_hz(channel))
    }

    /// What the radio makes of a link at its mean level. [`Model::scatters`] says how it varies about that.
    #[must_use]
    pub fn evaluate(&self, link: &Link<'_>) -> LinkBudget {
        self.evaluate_at(link, 0.0)
    }

    /// What the radio makes of a link whose level lies `scatter_db` above the mean.
    #[must_use]
    pub fn evaluate_at(&self, link: &Link<'_>, scatter_db: f64) -> LinkBudget {
        let prediction = self.propagation.predict(link);
        let rssi_dbm = self.rssi_dbm(&prediction, link, scatter_db);
        let mut shift_db = 0.0;
        let mut survival = 1.0;
        for effect in &self.effects {
            shift_db += effect.curve_shift_db(link);
            survival *= 1.0 - effect.loss_at(link, rssi_dbm);
        }
        let reception = match prediction.reception {
            Reception::ByCurve => self.curve_of(link).reception_probability(rssi_dbm - shift_db),
            Reception::Stated(probability) => probability,
        };
        LinkBudget {
            rssi_dbm,
            register_rssi_dbm: self.reading_dbm(link, rssi_dbm),
            reception_probability: survival * reception,
            shift_db,
            is_stated: matches!(prediction.reception, Reception::Stated(_)),
        }
    }

    /// What the receiver's register reads (dBm): as [`Model::evaluate_at`] says, without asking what is received.
    #[must_use]
    pub fn register_dbm(&self, link: &Link<'_>, scatter_db: f64) -> f64 {
        let rssi_dbm = self.rssi_dbm(&self.propagation.predict(link), link, scatter_db);
        self.reading_dbm(link, rssi_dbm)
    }

    #[inline]
    fn rssi_dbm(&self, prediction: &Prediction, link: &Link<'_>, scatter_db: f64) -> f64 {
        let mut rssi_dbm = prediction.rssi_dbm;
        for effect in &self.effects {
            rssi_dbm += effect.contribution_db(link);
        }
        rssi_dbm + scatter_db
    }

    #[inline]
    fn reading_dbm(&self, link: &Link<'_>, rssi_dbm: f64) -> f64 {
        self.effects.iter().fold(rssi_dbm, |read_dbm, effect| effect.register_dbm(link, read_dbm))
    }

    /// The curve from power to reception: the configured one, or that of an effect that acts on all links.
    #[must_use]
    pub fn reception_curve(&self) -> &dyn Curve {
        let unlimited = self.effects.iter().rev().filter(|effect| !effect.is_limited());
        let own = unlimited.filter_map(|effect| effect.curve()).next();
        own.unwrap_or(&*self.curve)
    }

    /// The curve from power to reception on a link.
    #[inline]
    fn curve_of(&self, link: &Link<'_>) -> &dyn Curve {
        let mut effects = self.effects.iter().rev();
        let own = effects.find_map(|effect| effect.curve().filter(|_| effect.acts_on(link)));
        own.unwrap_or(&*self.curve)
    }

    /// The power (dBm) below which no frame is received on any link.
    #[must_use]
    pub fn floor_dbm(&self) -> f64 {
        let limited = self.effects.iter().filter(|effect| effect.is_limited());
        limited
            .filter_map(|effect| effect.curve())
            .map(Curve::floor_dbm)
            .fold(self.reception_curve().floor_dbm(), f64::min)
    }

    /// What varies at random about the mean level: first what both directions of a link share, then the rest, then what acts on
    /// some links only.
    #[must_use]
    pub fn scatters(&self) -> &[Scatter] {
        &self.scatters
    }

    /// The part of [`Model::scatters`] that acts on all links.
    #[must_use]
    pub fn unlimited_scatters(&self) -> &[Scatter] {
        &self.scatters[..self.n_unlimited()]
    }

    /// Whether some scatter acts on some links only.
    #[must_use]
    pub fn has_limited_scatter(&self) -> bool {
        !self.limited.is_empty()
    }

    /// The part of [`Model::scatters`] that acts on some links only and does on this one.
    pub fn limited_scatters(&self, link: &Link<'_>) -> impl Iterator<Item = &Scatter> {
        let limited = self.limited.iter().zip(&self.scatters[self.n_unlimited()..]);
        limited
            .filter(move |(effect, _)| self.effects[**effect].acts_on(link))
            .map(|(_, scatter)| scatter)
    }

    fn n_unlimited(&self) -> usize {
        self.scatters.len() - self.limited.len()
    }

    /// The part of [`Model::unlimited_scatters`] that both directions of a link share.
    #[must_use]
    pub fn symmetric_scatters(&self) -> &[Scatter] {
        &self.scatters[..self.n_symmetric]
    }

    /// The part of [`Model::unlimited_scatters`] that each direction of a link has for itself.
    #[must_use]
    pub fn directed_scatters(&self) -> &[Scatter] {
        &self.scatters[self.n_symmetric..self.n_unlimited()]
    }

    /// The most that scatter adds (dB).
    #[must_use]
    pub fn max_scatter_db(&self) -> f64 {
        self.scatters.iter().map(Scatter::max_gain_db).sum()
    }

    /// The most that scatter takes away (dB).
    #[must_use]
    pub fn max_scatter_loss_db(&self) -> f64 {
        self.scatters.iter().map(Scatter::max_loss_db).sum()
    }

    /// How far links may reach.
    #[must_use]
    pub fn reach(&self, channel: Option<u8>) -> Reach {
        self.reach_of(self.floor_dbm(), channel)
    }

    /// How far frames may reach with at least this power (dBm), shifts of the curve taken off.
    #[must_use]
    pub fn reach_of(&self, power_dbm: f64, channel: Option<u8>) -> Reach {
        let gain_db: f64 = self.effects.iter().map(|effect| effect.max_gain_db()).sum();
        let floor_dbm = power_dbm - gain_db - self.max_scatter_db();
        match self.propagation.reach(floor_dbm, self.frequency_hz(channel)) {
            // Whatever lies below the least distance counts as lying there.
            Reach::Within(distance_m) => Reach::Within(distance_m.max(self.min_distance_m)),
            reach @ (Reach::Unlimited | Reach::Listed) => reach,
        }
    }

    /// Whether, scatter apart, links differ by nothing but distance and frequency.
    #[must_use]
    pub fn is_isotropic(&self) -> bool {
        self.propagation.is_isotropic() && self.effects.iter().all(|effect| effect.is_isotropic())
    }

    /// Whether every frame arrives, whatever the link.
    #[must_use]
    pub fn is_certain(&self) -> bool {
        self.propagation.is_certain() && self.is_isotropic()
    }

    /// A property of this radio that an effect of it repeats as one of its keys. None: what the effect has by default holds.
    #[must_use]
    pub fn property(&self, property: FromModel) -> Option<f64> {
        let base = self.propagation.path_loss();
        match property {
            FromModel::PathLossExponent => {
                let added: f64 = self.effects.iter().map(|effect| effect.added_exponent()).sum();
                Some(base.map_or(FREE_SPACE_EXPONENT, |base| base.exponent) + added)
            }
            FromModel::ReferenceDistance => base.map(|base| base.reference_distance_m),
            FromModel::Mass => None,
        }
    }

    /// Computes, once per moment, what the base model and the effects ask of the scene.
    pub fn prepare(&self, scene: &mut Scene<'_>) {
        self.propagation.prepare(scene);
        for effect in &self.effects {
            effect.prepare(scene);
        }
    }
}
