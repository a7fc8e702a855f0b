//! Measured links as the physics sees them.

pub(super) mod blocks;
pub mod covariates;
pub mod passes;
pub mod testable;

use crate::links::likelihood::register::Register;
use crate::thresholds::{MOST_AGENT_POSITIONS, STILL_M};
use measure::Rejections;
use measure::links::{LinkRow, LinkSamples, losses};
use physics::Model;
use physics::effect::Effect;
use physics::link::{Covariates, End, Link, Scene};
use physics::propagation::Reception;
use proto::ids::MoteId;
use proto::site::Site;
use std::collections::BTreeMap;
use std::ops::AddAssign;
use std::sync::Arc;

/// Measured links, and the model that is compared with them.
#[derive(Clone, Debug)]
pub struct ModelledLinks {
    /// The measurements. Rows that the model cannot say anything about have been taken out.
    pub links: LinkSamples,
    /// The model as configured.
    pub model: Arc<Model>,
    /// Walls, obstacles, ground.
    pub site: Arc<Site>,
    /// What the model as configured says about each row.
    pub base: Vec<BasePrediction>,
    /// What registers read more than there is depends on the power, by the model as configured.
    pub is_bent: bool,
    /// The least and the greatest reading (dBm) of every register: weaker and stronger frames read as these.
    pub limits_dbm: Option<[f64; 2]>,
    names: Vec<String>,
    values: Vec<f64>,
    ends: Vec<(End, End)>,
    agents: Arc<[End]>,
    agents_of_row: Vec<(u32, u32)>,
    still: BTreeMap<u32, bool>,
    /// The centre of all places (m).
    centre_m: [f64; 3],
    silent_frames: Vec<f64>,
}

/// Prediction of a row by the configured model, without fading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BasePrediction {
    /// Mean power at the receiver (dBm).
    pub power_dbm: f64,
    /// What the register reads more than that (dB).
    pub register_db: f64,
    /// By how much the reception curve is shifted (dB).
    pub shift_db: f64,
    /// Logarithm of the probability that nothing but weakness loses a frame.
    pub ln_survival: f64,
    /// Probability of reception, where the base model states it whatever the power.
    pub stated: Option<f64>,
}

/// What a term adds to the prediction of a row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contribution {
    /// To the mean power at the receiver (dB).
    pub power_db: f64,
    /// To the shift of the reception curve (dB).
    pub shift_db: f64,
    /// To the logarithm of the probability that nothing but weakness loses a frame.
    pub ln_survival: f64,
}

impl Contribution {
    /// To the mean power only (dB).
    #[must_use]
    pub fn of_power(power_db: f64) -> Self {
        Self { power_db, ..Self::default() }
    }
}

impl AddAssign for Contribution {
    fn add_assign(&mut self, other: Self) {
        self.power_db += other.power_db;
        self.shift_db += other.shift_db;
        self.ln_survival += other.ln_survival;
    }
}

/// A number of frames sent is usual if at least so many rows without a received frame have it; so many numbers count.
const FEWEST_SILENT: usize = 500;
const MOST_SILENT: usize = 4;

impl ModelledLinks {
    /// Holds a model against measurements.
    #[must_use]
    pub fn new(mut links: LinkSamples, model: Model, site: Site, antenna_height_m: f64) -> Self {
        add_antenna_height(&mut links, antenna_height_m);
        Self::of_shared(links, Arc::new(model), Arc::new(site))
    }

    fn of_shared(links: LinkSamples, model: Arc<Model>, site: Arc<Site>) -> Self {
        let tracks = tracks(&links.rows);
        let end = |row: &LinkRow, mote: u32, place: [f64; 3], heading: f64| {
            let place = [place[0], place[1], if place[2].is_nan() { 0.0 } else { place[2] }];
            End {
                id: MoteId(mote),
                position_m: place,
                heading_rad: (!heading.is_nan()).then_some(heading),
                velocity_mps: tracks
                    .get(&(row.run, mote))
                    .and_then(|track| velocity(track, row.time_s)),
            }
        };
        let ends: Vec<(End, End)> = links
            .rows
            .iter()
            .map(|row| {
                (
                    end(row, row.tx, row.tx_m, row.tx_heading_rad),
                    end(row, row.rx, row.rx_m, row.rx_heading_rad),
                )
            })
            .collect();
        let (agents, agents_of_row) = agents(&links.rows, &tracks);
        let names: Vec<String> = links.covariates.iter().map(|(name, _)| name.clone()).collect();
        let values = (0..links.rows.len())
            .flat_map(|row| links.covariates.iter().map(move |(_, column)| column[row]))
            .collect();
        let mut rows = Self {
            links,
            model,
            site,
            base: Vec::new(),
            is_bent: false,
            limits_dbm: None,
            names,
            values,
            ends,
            agents: agents.into(),
            agents_of_row,
            still: BTreeMap::new(),
            centre_m: [0.0; 3],
            silent_frames: Vec::new(),
        };
        rows.base = (0..rows.links.rows.len()).map(|row| rows.base_of(row)).collect();
        let mut registers = rows.model.effects.iter().map(|effect| rows.register_of(&**effect));
        rows.is_bent = registers.any(|register| register == Register::Bent);
        rows.leave_out_unknown();
        if rows.links.readings.is_given {
            rows.links.readings.losses = losses(&rows.links.rows);
        }
        rows.look_through();
        rows
    }

    /// Whether a row has a reading.
    #[must_use]
    pub fn is_received(&self, row: usize) -> bool {
        self.links.rows[row].rssi_dbm.is_finite()
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.base.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.base.is_empty()
    }

    /// The number of a place along each axis, in steps from the centre of all places (m). Coordinates of another origin, mirrored or
    /// turned by a quarter put the same places together.
    #[must_use]
    pub fn square_numbers(&self, place_m: [f64; 3], side_m: f64) -> [i64; 3] {
        std::array::from_fn(|k| ((place_m[k] - self.centre_m[k]) / side_m).round() as i64)
    }

    /// Whether each mote stands still throughout.
    #[must_use]
    pub fn still(&self) -> &BTreeMap<u32, bool> {
        &self.still
    }

    /// Numbers of frames sent that are usual in rows without a received frame.
    #[must_use]
    pub fn silent_frames(&self) -> &[f64] {
        &self.silent_frames
    }

    /// Describes a row as the physics wants it.
    pub fn link<T>(&self, row: usize, see: impl FnOnce(&Link<'_>) -> T) -> T {
        let n = self.names.len();
        let (from, to) = self.agents_of_row[row];
        let scene = Scene {
            site: Some(&self.site),
            agents: &self.agents[from as usize..to as usize],
            covariates: Covariates::Columns {
                names: &self.names,
                values: &self.values[row * n..(row + 1) * n],
            },
            run: Some(self.links.rows[row].run),
            ..Scene::default()
        };
        let measured = &self.links.rows[row];
        let (sender, receiver) = self.ends[row];
        // An unknown time, which is NaN, counts as 0.
        let time_ns = (measured.time_s.max(0.0) * 1e9) as u64;
        see(&self.model.link(&scene, sender, receiver, measured.channel, time_ns))
    }

    /// Both ends of a row.
    #[must_use]
    pub fn ends(&self, row: usize) -> &(End, End) {
        &self.ends[row]
    }

    /// Whether other agents are known at the time of the rows.
    #[must_use]
    pub fn knows_others(&self) -> bool {
        self.agents_of_row.iter().any(|(from, to)| from + 2 < *to)
    }

    /// What an effect adds to the prediction of a row.
    #[must_use]
    pub fn contribution(&self, effect: &dyn Effect, row: usize) -> Contribution {
        let given_dbm = self.given_dbm(row);
        self.link(row, |link| {
            let (power_db, loss) = match given_dbm {
                Some(rssi_dbm) => (0.0, effect.loss_at(link, rssi_dbm)),
                None => (effect.contribution_db(link), effect.loss(link)),
            };
            let shift_db = effect.curve_shift_db(link);
            Contribution { power_db, shift_db, ln_survival: ln_survival(loss) }
        })
    }

    /// What the register reads (dBm) where it would have read `reading_dbm`.
    #[must_use]
    pub fn register_dbm(&self, effect: &dyn Effect, row: usize, reading_dbm: f64) -> f64 {
        self.link(row, |link| effect.register_dbm(link, reading_dbm))
    }

    /// What an effect makes of readings, by those of the first row on which it acts.
    #[must_use]
    pub fn register_of(&self, effect: &dyn Effect) -> Register {
        let acts_on = |&row: &usize| self.link(row, |link| effect.acts_on(link));
        let Some(row) = (0..self.len()).find(acts_on) else { return Register::Exact };
        Register::classify(&|dbm| self.register_dbm(effect, row, dbm))
    }

    /// The level that the reading of a row is taken for (dBm), where readings are given.
    fn given_dbm(&self, row: usize) -> Option<f64> {
        self.links.readings.is_given.then(|| self.links.rows[row].rssi_dbm)
    }

    fn base_of(&self, row: usize) -> BasePrediction {
        let given_dbm = self.given_dbm(row);
        self.link(row, |link| {
            let prediction = self.model.propagation.predict(link);
            let mut base = BasePrediction {
                power_dbm: prediction.rssi_dbm,
                register_db: 0.0,
                shift_db: 0.0,
                ln_survival: 0.0,
                stated: match prediction.reception {
                    Reception::ByCurve => None,
                    Reception::Stated(probability) => Some(probability),
                },
            };
            if let Some(rssi_dbm) = given_dbm {
                base.power_dbm = rssi_dbm;
                for effect in &self.model.effects {
                    base.shift_db += effect.curve_shift_db(link);
                    base.ln_survival += ln_survival(effect.loss_at(link, rssi_dbm));
                }
                return base;
            }
            for effect in &self.model.effects {
                base.power_dbm += effect.contribution_db(link);
                base.shift_db += effect.curve_shift_db(link);
                base.ln_survival += ln_survival(effect.loss(link));
            }
            let reading = self
                .model
                .effects
                .iter()
                .fold(base.power_dbm, |dbm, effect| effect.register_dbm(link, dbm));
            base.register_db = reading - base.power_dbm;
            base
        })
    }

    /// Takes out rows about which the model says nothing: where a place is unknown.
    fn leave_out_unknown(&mut self) {
        if self.links.readings.is_given {
            self.leave_out_unread();
        }
        // Where nobody's place is known, distances are nobody's matter.
        let placed = |row: &LinkRow| row.tx_m[0].is_finite() && row.rx_m[0].is_finite();
        let is_placed = self.links.rows.iter().any(placed);
        let known: Vec<bool> = self
            .base
            .iter()
            .zip(&self.links.rows)
            .map(|(base, row)| base.power_dbm.is_finite() && (!is_placed || placed(row)))
            .collect();
        if known.iter().all(|&known| known) {
            return;
        }
        let mut rejections = Rejections::default();
        for (row, _) in self.links.rows.iter().zip(&known).filter(|(_, known)| !**known) {
            rejections
                .add("the position of an end is unknown, so the model cannot predict it", row.line);
        }
        self.links.rejected.extend(rejections.into_list());
        self.keep(&known);
    }

    /// Takes out rows without a reading that reception could be predicted from, and those that do not say what was received.
    fn leave_out_unread(&mut self) {
        let mut rejections = Rejections::default();
        for row in &self.links.rows {
            if row.rssi_dbm.is_nan() {
                rejections.add(
                    "--given-rssi: no frame was received, so there is no RSSI reading",
                    row.line,
                );
            } else if row.received.is_nan() {
                rejections
                    .add("--given-rssi: it is unknown whether frames were received", row.line);
            }
        }
        let is_known = |row: &LinkRow| row.rssi_dbm.is_finite() && row.received.is_finite();
        let known: Vec<bool> = self.links.rows.iter().map(is_known).collect();
        self.links.rejected.extend(rejections.into_list());
        self.keep(&known);
    }

    /// Only some of the rows; what is known of other agents at their time stays.
    #[must_use]
    pub fn some(&self, kept: &[bool]) -> Self {
        let mut some = self.clone();
        some.keep(kept);
        some.look_through();
        some
    }

    /// The same measurements with other rows in their place, such as rows with other positions or channels; `None`: the model cannot
    /// predict all of them.
    #[must_use]
    pub fn with_rows(&self, rows: Vec<LinkRow>) -> Option<Self> {
        self.with_some_rows(rows.into_iter().enumerate().collect())
    }

    /// Some of the measurements, each by its index, with other rows in their place; `None`: the model cannot predict all of them.
    #[must_use]
    pub fn with_some_rows(&self, rows: Vec<(usize, LinkRow)>) -> Option<Self> {
        let n = rows.len();
        let (indices, rows): (Vec<usize>, Vec<LinkRow>) = rows.into_iter().unzip();
        let column = |(name, values): &(String, Vec<f64>)| {
            (name.clone(), indices.iter().map(|&row| values[row]).collect())
        };
        let LinkSamples { covariates, n_rows, readings, losses_logged, .. } = &self.links;
        let links = LinkSamples {
            rows,
            covariates: covariates.iter().map(column).collect(),
            rejected: self.links.rejected.clone(),
            warnings: self.links.warnings.clone(),
            n_rows: *n_rows,
            readings: *readings,
            losses_logged: *losses_logged,
        };
        let mut changed = Self::of_shared(links, self.model.clone(), self.site.clone());
        changed.limits_dbm = self.limits_dbm;
        (changed.len() == n).then_some(changed)
    }

    /// What every register reads (dBm) where it would have read `reading_dbm`, by its least and greatest reading.
    #[must_use]
    pub fn limited_dbm(&self, reading_dbm: f64) -> f64 {
        self.limits_dbm.map_or(reading_dbm, |[least, greatest]| reading_dbm.clamp(least, greatest))
    }

    /// Finds what holds of all rows together.
    fn look_through(&mut self) {
        self.still = stand_still(&self.ends);
        self.centre_m = centre_m(&self.ends);
        self.silent_frames = silent_frames(&self.links.rows);
    }

    fn keep(&mut self, kept: &[bool]) {
        for_kept(&mut self.links.rows, kept);
        for (_, column) in &mut self.links.covariates {
            for_kept(column, kept);
        }
        let n = self.names.len();
        let mut index = 0;
        self.values.retain(|_| {
            index += 1;
            kept[(index - 1) / n]
        });
        for_kept(&mut self.base, kept);
        for_kept(&mut self.ends, kept);
        for_kept(&mut self.agents_of_row, kept);
    }
}

/// The centre of all places (m): the middle between the least and the greatest coordinate.
fn centre_m(ends: &[(End, End)]) -> [f64; 3] {
    std::array::from_fn(|axis| {
        let of_ends = ends.iter().flat_map(|(tx, rx)| [tx.position_m, rx.position_m]);
        let known = of_ends.map(|place_m| place_m[axis]).filter(|m| m.is_finite());
        let (least, greatest) = known
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), m| (low.min(m), high.max(m)));
        if least <= greatest { 0.5 * (least + greatest) } else { 0.0 }
    })
}

/// The most frequent numbers of frames sent in rows without a received frame.
fn silent_frames(rows: &[LinkRow]) -> Vec<f64> {
    let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.received == 0.0) {
        *counts.entry(row.frames.to_bits()).or_insert(0) += 1;
    }
    let mut usual: Vec<(u64, usize)> =
        counts.into_iter().filter(|&(_, n)| FEWEST_SILENT <= n).collect();
    // The most frequent first, and among equals the smaller number.
    usual.sort_by_key(|&(bits, n)| (usize::MAX - n, bits));
    usual.truncate(MOST_SILENT);
    usual.into_iter().map(|(bits, _)| f64::from_bits(bits)).collect()
}

/// Which motes stand still throughout.
fn stand_still(ends: &[(End, End)]) -> BTreeMap<u32, bool> {
    let mut extents: BTreeMap<u32, ([f64; 3], [f64; 3])> = BTreeMap::new();
    for end in ends.iter().flat_map(|(tx, rx)| [tx, rx]) {
        let (low, high) = extents.entry(end.id.0).or_insert((end.position_m, end.position_m));
        for k in 0..3 {
            low[k] = low[k].min(end.position_m[k]);
            high[k] = high[k].max(end.position_m[k]);
        }
    }
    // Of nodes whose places are unknown nothing says that they move.
    let moves = |low: [f64; 3], high: [f64; 3]| (0..3).any(|k| STILL_M <= high[k] - low[k]);
    extents.into_iter().map(|(id, (low, high))| (id, !moves(low, high))).collect()
}

fn for_kept<T>(values: &mut Vec<T>, known: &[bool]) {
    let mut at = known.iter();
    values.retain(|_| at.next().is_some_and(|known| *known));
}

fn ln_survival(loss: f64) -> f64 {
    if loss == 0.0 {
        return 0.0;
    }
    libm::log((1.0 - loss.clamp(0.0, 1.0)).max(1e-9))
}

/// Gives planar places the height of the antennas.
fn add_antenna_height(links: &mut LinkSamples, antenna_height_m: f64) {
    let is_planar = links
        .rows
        .iter()
        .flat_map(|row| [row.tx_m[2], row.rx_m[2]])
        .all(|z| z.is_nan() || z == 0.0);
    if is_planar && 0.0 < antenna_height_m {
        for row in &mut links.rows {
            row.tx_m[2] = antenna_height_m;
            row.rx_m[2] = antenna_height_m;
        }
    }
}

type Track = Vec<(f64, [f64; 3])>;

/// Where each mote was when, by campaign: sorted, one place per time.
fn tracks(rows: &[LinkRow]) -> BTreeMap<(u32, u32), Track> {
    let mut tracks: BTreeMap<(u32, u32), Track> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.time_s.is_finite()) {
        for (mote, place) in [(row.tx, row.tx_m), (row.rx, row.rx_m)] {
            if place[0].is_finite() && place[1].is_finite() {
                tracks.entry((row.run, mote)).or_default().push((row.time_s, place));
            }
        }
    }
    for track in tracks.values_mut() {
        track.sort_by(|a, b| a.0.total_cmp(&b.0));
        track.dedup_by(|a, b| a.0.total_cmp(&b.0).is_eq());
    }
    tracks
}

/// Velocity (m/s) at a moment, from the places before and after; none where only one place is known.
fn velocity(track: &Track, time_s: f64) -> Option<[f64; 3]> {
    let index = track.partition_point(|(time, _)| *time < time_s);
    let before = &track[index.saturating_sub(1)];
    let after = track.get(index + 1).or(track.get(index))?;
    let span = after.0 - before.0;
    (0.0 < span).then(|| {
        std::array::from_fn(|k| {
            let way = after.1[k] - before.1[k];
            if way.is_nan() { 0.0 } else { way / span }
        })
    })
}

/// Where all motes are at the time of each row.
fn agents(rows: &[LinkRow], tracks: &BTreeMap<(u32, u32), Track>) -> (Vec<End>, Vec<(u32, u32)>) {
    let mut moments: BTreeMap<(u32, u64), (u32, u32)> = BTreeMap::new();
    let mut agents = Vec::new();
    let n_moments = {
        let mut keys: Vec<(u32, u64)> =
            rows.iter().map(|row| (row.run, row.time_s.to_bits())).collect();
        keys.sort_unstable();
        keys.dedup();
        keys.len()
    };
    if MOST_AGENT_POSITIONS < n_moments * tracks.len() || tracks.len() < 3 {
        return (agents, vec![(0, 0); rows.len()]);
    }
    let of_row = rows
        .iter()
        .map(|row| {
            *moments.entry((row.run, row.time_s.to_bits())).or_insert_with(|| {
                let from = agents.len() as u32;
                for ((_, mote), track) in tracks.range((row.run, 0)..=(row.run, u32::MAX)) {
                    if let Some(place) = place_at(track, row.time_s) {
                        agents.push(End::new(MoteId(*mote), place));
                    }
                }
                (from, agents.len() as u32)
            })
        })
        .collect();
    (agents, of_row)
}

/// The place on a track at a moment, between two known places on the straight line; none outside of it.
fn place_at(track: &Track, time_s: f64) -> Option<[f64; 3]> {
    let index = track.partition_point(|(time, _)| *time < time_s);
    let after = track.get(index)?;
    let before = &track[index.saturating_sub(1)];
    let span = after.0 - before.0;
    let part = if 0.0 < span { (time_s - before.0) / span } else { 1.0 };
    Some(std::array::from_fn(|k| {
        let place = before.1[k] + part * (after.1[k] - before.1[k]);
        if place.is_nan() { 0.0 } else { place }
    }))
}
