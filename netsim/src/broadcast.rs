//! Propagation only: in every control period each payload is broadcast once, without any protocol.
//!
//! Control periods follow each other from time 0. A period has n slots; agent i sends in slot i mod n. Every other
//! radio that is on receives with the probability that the physics gives, whatever else is sent in that slot; a radio
//! may send and receive at once. An agent whose payload is empty says nothing. A step carries the frames that begin in it.

use crate::mesh::config::Config;
use crate::place::{self, Place};
use physics::link::{Covariates, Scene};
use physics::medium::{Air, Filters, Frame, Radios, reading, resolve};
use physics::nearest::Grid;
use physics::propagation::Reach;
use physics::scatter::Seeds;
use proto::side::{NetInput, NetOutput};
use proto::site::Site;
use proto::time::{SimDuration, SimTime};
use proto::types::{
    AgentStates, Deliveries, DeliveryColumn, Experiment, Heard, Medium, MoteStates, Payloads,
    Transmissions,
};

/// The network without protocols.
#[derive(Debug)]
pub struct Broadcast {
    experiment: Experiment,
    seeds: Seeds,
    columns: Vec<DeliveryColumn>,
    config: Config,
    filters: Filters,
    reach: Reach,
    place: Place,
    grid: Grid,
}

/// The frames of one period, or of one slot of it.
struct Batch {
    period: SimTime,
    /// Sender and begin, in the order (begin, sender).
    frames: Vec<(u32, SimTime)>,
}

/// What became of the frames of a batch.
struct BatchReception {
    n_frames: usize,
    heard: Heard,
    rssi_dbm: Vec<f32>,
}

impl Broadcast {
    /// A network at time 0.
    #[must_use]
    pub fn new(
        experiment: Experiment,
        config: Config,
        site: Site,
        columns: Vec<DeliveryColumn>,
    ) -> Self {
        let place = Place::new(experiment.agent_count, &config.absent, site);
        Self::with_place(experiment, config, columns, place)
    }

    /// A network in a state that another one of the same configuration reached.
    #[must_use]
    pub(crate) fn with_place(
        experiment: Experiment,
        config: Config,
        columns: Vec<DeliveryColumn>,
        place: Place,
    ) -> Self {
        let filters = Filters::for_channels(&config.model, &config.hopping_sequence);
        let reach = farthest(&config);
        Self {
            seeds: experiment.seed.into(),
            experiment,
            columns,
            config,
            filters,
            reach,
            place,
            grid: Grid::default(),
        }
    }

    /// Draws of periods and frames come from another seed from here on. Lasting scatter keeps the experiment's.
    pub fn reseed(&mut self, seed: u64) {
        self.seeds.passing = seed;
    }

    /// What changes as time goes on.
    #[must_use]
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// The motes now.
    #[must_use]
    pub fn motes(&self) -> MoteStates {
        MoteStates { alive: self.place.alive(), ..MoteStates::default() }
    }

    /// Runs to `input.until_ns`, or to the end of the first slot in which somebody heard something.
    pub fn step(&mut self, input: &NetInput<'_>) -> NetOutput {
        self.place.obey(input.commands);
        self.place.move_obstacles(input.moved_obstacles);
        self.place.travel(input.states);
        let motes = self.motes();
        let on: Vec<u32> = (0..self.experiment.agent_count as u32)
            .filter(|&i| input.states.alive.get(i as usize) && motes.alive.get(i as usize))
            .collect();
        let lift_m = place::lift_m(self.config.antenna_height_m, input.states);

        let mut time_ns = input.until_ns;
        let mut frames = Vec::new();
        let mut outcomes = Vec::new();
        for batch in self.batches(input, &on) {
            let outcome = self.resolve(input.states, lift_m, &on, &batch);
            frames.extend_from_slice(&batch.frames);
            let is_heard = input.stop_at_first_delivery && n_deliveries(&outcome.heard) != 0;
            outcomes.push(outcome);
            if let (true, Some(&(_, sent))) = (is_heard, batch.frames.first()) {
                time_ns = input.until_ns.min((sent + self.config.slot).ns());
                break;
            }
        }
        let deliveries = self.deliveries(&frames, outcomes, input.payloads);
        NetOutput { time_ns, deliveries, motes, ..NetOutput::default() }
    }

    /// The frames that begin within the step, by period; by slot where the first delivery ends the step.
    fn batches(&self, input: &NetInput<'_>, on: &[u32]) -> Vec<Batch> {
        let Config { slot: slot_length, n_slots, .. } = self.config;
        let step = SimDuration::from_ns(self.experiment.step_ns);
        let lengths = input.payloads.length_bytes();
        let mut by_slot: Vec<Vec<u32>> =
            vec![Vec::new(); (n_slots as usize).min(self.experiment.agent_count)];
        for &agent in on.iter().filter(|&&agent| lengths[agent as usize] != 0) {
            by_slot[(u64::from(agent) % n_slots) as usize].push(agent);
        }
        let mut batches: Vec<Batch> = Vec::new();
        let [first, last] =
            [input.from_ns, input.until_ns - 1].map(|ns| SimTime::from_ns(ns) / step);
        for number in first..=last {
            let period = SimTime::START + number * step;
            let mut whole = Batch { period, frames: Vec::new() };
            for (slot, senders) in (0..).zip(&by_slot) {
                let sent = period + slot * slot_length;
                if senders.is_empty()
                    || sent < SimTime::from_ns(input.from_ns)
                    || input.until_ns <= sent.ns()
                {
                    continue;
                }
                let frames = senders.iter().map(|&sender| (sender, sent));
                if input.stop_at_first_delivery {
                    batches.push(Batch { period, frames: frames.collect() });
                } else {
                    whole.frames.extend(frames);
                }
            }
            if !whole.frames.is_empty() {
                batches.push(whole);
            }
        }
        batches
    }

    fn resolve(
        &mut self,
        states: &AgentStates,
        lift_m: f64,
        on: &[u32],
        batch: &Batch,
    ) -> BatchReception {
        let agent_count = self.experiment.agent_count;
        let radios = self.radios(states, lift_m, on, batch);
        let mut scene = Scene {
            site: Some(&self.place.site),
            agents: &radios.ends,
            covariates: Covariates::Agents(&states.covariates),
            ..Scene::default()
        };
        self.config.model.prepare(&mut scene);
        let air = Air {
            model: &self.config.model,
            filters: &self.filters,
            seeds: self.seeds,
            period_ns: batch.period.ns(),
            radios: &radios,
            scene: &scene,
        };
        let heard = resolve::resolve(&air, agent_count, self.reach, &mut self.grid);
        let rssi_dbm = if self.columns.contains(&DeliveryColumn::RssiDbm) {
            reading::register_rssi_dbm(&air, agent_count, &heard)
        } else {
            Vec::new()
        };
        BatchReception { n_frames: batch.frames.len(), heard, rssi_dbm }
    }

    /// Radios that are on: those that send, in the order of their frames, then the others.
    fn radios(&self, states: &AgentStates, lift_m: f64, on: &[u32], batch: &Batch) -> Radios {
        let hopping = &self.config.hopping_sequence;
        let channel = |sent: SimTime| {
            let slot = sent / self.config.slot;
            (!hopping.is_empty()).then(|| hopping[(slot % hopping.len() as u64) as usize])
        };
        let mut sends = vec![false; self.experiment.agent_count];
        for &(sender, _) in &batch.frames {
            sends[sender as usize] = true;
        }
        let senders = batch.frames.iter().map(|&(sender, _)| sender);
        let silent = on.iter().copied().filter(|&agent| !sends[agent as usize]);
        let mut radios = Radios {
            frames: batch
                .frames
                .iter()
                .map(|&(_, sent)| Frame { sent_ns: sent.ns(), channel: channel(sent) })
                .collect(),
            ..Radios::default()
        };
        for id in senders.chain(silent) {
            let end = place::end_of(states, id, lift_m);
            radios.push(end, self.place.way_m[id as usize]);
        }
        radios
    }

    fn deliveries(
        &self,
        frames: &[(u32, SimTime)],
        outcomes: Vec<BatchReception>,
        payloads: &Payloads,
    ) -> Deliveries {
        let n = self.experiment.agent_count;
        let (heard, rssi_dbm) = joined(outcomes, n);
        let end_ns = frames.iter().map(|&(_, sent)| (sent + self.config.slot).ns()).collect();
        let mut deliveries = Deliveries {
            transmissions: Transmissions {
                sender: frames.iter().map(|&(sender, _)| sender).collect(),
                sent_ns: frames.iter().map(|&(_, sent)| sent.ns()).collect(),
                end_ns,
                payloads: sent_payloads(frames, payloads),
                ..Transmissions::default()
            },
            heard,
            rssi_dbm,
            ..Deliveries::default()
        };
        for column in &self.columns {
            match column {
                DeliveryColumn::RssiDbm => {}
                DeliveryColumn::ReceivedNs => {
                    deliveries.received_ns = (0..n)
                        .flat_map(|agent| deliveries.heard_by(agent))
                        .map(|frame| deliveries.transmissions.end_ns[frame])
                        .collect();
                }
                DeliveryColumn::Hops => deliveries.hops = vec![1; deliveries.n_deliveries()],
                DeliveryColumn::Medium => {
                    deliveries.medium = vec![Medium::Radio; deliveries.n_deliveries()];
                }
            }
        }
        deliveries
    }
}

/// The farthest that links reach on any channel in use.
fn farthest(config: &Config) -> Reach {
    let mut farthest = config.model.reach(None);
    for &channel in &config.hopping_sequence {
        farthest = match (farthest, config.model.reach(Some(channel))) {
            (Reach::Within(a), Reach::Within(b)) => Reach::Within(a.max(b)),
            (other, _) => other,
        };
    }
    farthest
}

fn n_deliveries(heard: &Heard) -> usize {
    match heard {
        Heard::Lists { indices, .. } => indices.len(),
        Heard::Rows { bytes, .. } => bytes.iter().map(|byte| byte.count_ones() as usize).sum(),
    }
}

/// The payloads of the frames, in their order.
fn sent_payloads(frames: &[(u32, SimTime)], payloads: &Payloads) -> Payloads {
    let lengths = payloads.length_bytes();
    let mut begins = Vec::with_capacity(lengths.len());
    let mut begin = 0;
    for &length in lengths {
        begins.push(begin);
        begin += length as usize;
    }
    let mut sent_lengths = Vec::with_capacity(frames.len());
    let mut data = Vec::with_capacity(payloads.data().len());
    for &(sender, _) in frames {
        let (begin, length) = (begins[sender as usize], lengths[sender as usize]);
        sent_lengths.push(length);
        data.extend_from_slice(&payloads.data()[begin..begin + length as usize]);
    }
    Payloads::new(sent_lengths, data.into()).expect("as much data as the lengths add up to")
}

/// Outcomes of successive batches as one: frames numbered on, receivers' lists one after the other.
fn joined(mut outcomes: Vec<BatchReception>, agent_count: usize) -> (Heard, Vec<f32>) {
    if outcomes.len() <= 1 {
        return outcomes.pop().map(|only| (only.heard, only.rssi_dbm)).unwrap_or_default();
    }
    let mut parts = Vec::with_capacity(outcomes.len());
    let mut first_frame = 0;
    for BatchReception { n_frames, heard, rssi_dbm } in outcomes {
        let deliveries = Deliveries { heard, ..Deliveries::default() };
        parts.push((first_frame, deliveries, rssi_dbm.into_iter()));
        first_frame += n_frames as u32;
    }
    let mut ends = Vec::with_capacity(agent_count);
    let mut indices = Vec::new();
    let mut rssi_dbm = Vec::new();
    for agent in 0..agent_count {
        for (first_frame, deliveries, readings) in &mut parts {
            let before = indices.len();
            indices.extend(deliveries.heard_by(agent).map(|frame| *first_frame + frame as u32));
            rssi_dbm.extend(readings.take(indices.len() - before));
        }
        ends.push(indices.len() as u32);
    }
    (resolve::shorter(Heard::Lists { ends, indices }, agent_count, first_frame as usize), rssi_dbm)
}
