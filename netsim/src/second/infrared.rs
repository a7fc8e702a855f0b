//! Infrared light between robots in line of sight.

use super::around::{Around, Reach};
use super::carried::{Carried, CarriedFrame};
use super::{BuildContext, Entry, SecondMedium, problem};
use bytes::Bytes;
use proto::config::{Range, Section, variant};
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose, ordered_link};
use proto::time::{SimDuration, SimTime};
use proto::types::NS_PER_S;
use serde::{Deserialize, Serialize};

/// `kind = "infrared"`.
pub const ENTRY: Entry = Entry { variant: variant::<Keys>("infrared"), build };

/// Short-range infrared: robots in line of sight receive, and time slots avoid collisions (TDMA).
#[derive(Section)]
struct Keys {
    /// Maximum distance (m), itself included.
    #[key(range = Range::LENGTH, default = 2.0)]
    range_m: f64,
    /// Angle off the sender's heading (rad) at which it radiates half as much as straight ahead. Absent: a ring of emitters, alike
    /// in all directions.
    #[key(range = 0.01..=1.57)]
    half_angle_rad: Option<f64>,
    /// Whether the bodies of other robots block the path.
    #[key(default = true)]
    robots_block: bool,
    /// Radius of a robot's body, a ball around its antenna (m). Used with robots_block only.
    #[key(range = Range::LENGTH, default = 0.1)]
    body_radius_m: f64,
    /// Probability that a frame is lost although nothing is in its way, for each receiver by itself.
    #[key(range = Range::FRACTION, default = 0.0)]
    loss: f64,
    /// Bit rate (bit/s). 115200: the highest of IrDA SIR.
    #[key(range = 1.0..=1e9, default = 115_200.0)]
    bit_rate_bps: f64,
    /// Bytes of preamble, header and checksum before and after each payload.
    #[key(range = 0..=65_535, default = 10)]
    overhead_bytes: u32,
    /// The longest payload (bytes), for which a slot has room. Longer ones are not sent.
    #[key(range = 1..=65_535, default = 100)]
    max_payload_bytes: u32,
    /// Slots of the TDMA frame: robot i sends in slot i modulo this number. Absent: one for each robot. With fewer, robots share
    /// slots, and a receiver that two senders of a slot reach receives neither.
    #[key(range = 1..=1_000_000)]
    slots: Option<u64>,
    /// Received power at the maximum distance (dBm), for the RSSI reading only.
    #[key(range = -200.0..=100.0, default = -40.0)]
    sensitivity_dbm: f64,
}

/// Infrared light between robots.
///
/// # Model
///
/// A frame is received in line of sight within the range of its direction ([`Reach`]), unless `loss` takes it. Access is ideal
/// TDMA: clocks are exact and slots have no guard times. A slot lasts 8 (overhead + longest payload) / bit rate. A control
/// period begins with a slot and has as many whole slots as fit in; the numbers of slots go on from period to period. A robot
/// sends the payload of the present control period in its first slot of that period, if there is one. It cannot receive while it
/// sends.
///
/// # Validity
///
/// No reflections, sunlight, or half-received frames. Slots are given to all robots, near or far: `slots` less than their number
/// stands for spatial reuse.
#[derive(Clone, Debug)]
pub(crate) struct Infrared {
    reach: Reach,
    loss: f64,
    slot: SimDuration,
    n_slots: u64,
    max_payload_bytes: usize,
    state: State,
}

/// All that changes with time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct State {
    /// By robot, the number of the control period after the last one whose payload it sent.
    sent_before: Vec<u64>,
    /// Begin of the slot on the air, and who sends what in it.
    on_air: Option<(SimTime, Vec<(u32, Bytes)>)>,
}

fn build(table: &toml::Table, context: &mut BuildContext<'_>) -> Option<Box<dyn SecondMedium>> {
    let keys = Keys::read(table);
    let bits = 8.0 * f64::from(keys.overhead_bytes + keys.max_payload_bytes);
    let slot = SimDuration::from_ns((bits / keys.bit_rate_bps * NS_PER_S as f64).ceil() as u64);
    if context.step < slot {
        let step_s = context.step.seconds();
        let least_bps = (bits / step_s).ceil();
        let message = format!(
            "must be at least {least_bps}, so that a slot for the longest payload fits in the control period, {step_s} s"
        );
        let problem = problem(context, "bit_rate_bps", message);
        context.problems.push(problem.value(keys.bit_rate_bps).nearest(least_bps));
        return None;
    }
    Some(Box::new(Infrared {
        reach: Reach {
            range_m: keys.range_m,
            half_angle_rad: keys.half_angle_rad,
            walls_block: true,
            body_radius_m: keys.robots_block.then_some(keys.body_radius_m),
            edge_dbm: keys.sensitivity_dbm,
        },
        loss: keys.loss,
        slot,
        n_slots: keys.slots.unwrap_or(context.agent_count as u64),
        max_payload_bytes: keys.max_payload_bytes as usize,
        state: State { sent_before: vec![0; context.agent_count], on_air: None },
    }))
}

impl Infrared {
    /// Sends what the owners of a slot have to say.
    fn begin_slot(&mut self, around: &Around<'_>, owner: u64, begin: SimTime) {
        let period = begin / around.step;
        let n = around.agent_count() as u64;
        let mut frames = Vec::new();
        for id in (owner..n).step_by(self.n_slots as usize) {
            if period < self.state.sent_before[id as usize] {
                continue;
            }
            let payload = around.payload(id as u32);
            if let Some(payload) = payload.filter(|bytes| bytes.len() <= self.max_payload_bytes) {
                self.state.sent_before[id as usize] = period + 1;
                frames.push((id as u32, payload));
            }
        }
        if !frames.is_empty() {
            self.state.on_air = Some((begin, frames));
        }
    }

    /// Decides who receives the frames of the slot on the air.
    fn end_slot(&mut self, surroundings: &Surroundings<'_>, carried: &mut Carried) {
        let Some((begin, sent)) = self.state.on_air.take() else { return };
        let around = surroundings.around;
        let lit = (&surroundings.scene, &surroundings.grid);
        let mut reached: Vec<Vec<(u32, f64)>> = sent
            .iter()
            .map(|&(sender, _)| {
                let end = around.end(sender);
                end.map_or_else(Vec::new, |end| self.reach.receivers(around, lit, end))
            })
            .collect();
        if 1 < sent.len() {
            let mut all: Vec<u32> = reached.iter().flatten().map(|&(id, _)| id).collect();
            all.sort_unstable();
            let is_clear = |id: u32| {
                let first = all.partition_point(|&other| other < id);
                all.get(first + 1) != Some(&id)
                    && sent.binary_search_by_key(&id, |&(sender, _)| sender).is_err()
            };
            for receivers in &mut reached {
                receivers.retain(|&(id, _)| is_clear(id));
            }
        }
        let draws = Draws::new(around.seed, Purpose::SecondMediumLoss);
        for ((sender, payload), receivers) in sent.into_iter().zip(reached) {
            let receivers = receivers
                .into_iter()
                .filter(|&(id, _)| {
                    self.loss == 0.0
                        || self.loss <= draws.uniform(ordered_link(sender, id), begin.ns(), 0)
                })
                .map(|(id, power_dbm)| (id, power_dbm as f32))
                .collect();
            let end = begin + self.slot;
            carried.frames.push(CarriedFrame {
                sender: MoteId(sender),
                sent: begin,
                end,
                payload,
                receivers,
            });
        }
    }
}

/// What light meets in a step.
struct Surroundings<'a> {
    around: &'a Around<'a>,
    scene: physics::link::Scene<'a>,
    grid: physics::nearest::Grid,
}

impl SecondMedium for Infrared {
    fn carry(&mut self, around: &Around<'_>, from: SimTime, until: SimTime, carried: &mut Carried) {
        let surroundings = Surroundings {
            around,
            scene: around.scene(self.reach.body_radius_m.is_some()),
            grid: around.grid(self.reach.range_m),
        };
        let step = around.step;
        let (number, per_period) = (from / step, step / self.slot);
        let period = SimTime::START + number * step;
        let mut slot = (from - period).div_ceil(self.slot);
        // After one TDMA frame everyone has had a slot of the period.
        let last = per_period.min(slot.saturating_add(self.n_slots));
        loop {
            let begin = period + slot * self.slot;
            if let Some(&(sent, _)) = self.state.on_air.as_ref()
                && sent + self.slot <= begin.min(until)
            {
                self.end_slot(&surroundings, carried);
            }
            if last <= slot || until <= begin {
                break;
            }
            let owner = number.wrapping_mul(per_period).wrapping_add(slot) % self.n_slots;
            self.begin_slot(around, owner, begin);
            slot += 1;
        }
    }

    fn boxed(&self) -> Box<dyn SecondMedium> {
        Box::new(self.clone())
    }

    fn state(&self) -> Vec<u8> {
        postcard::to_stdvec(&self.state).expect("plain data in memory")
    }

    fn resume(&mut self, state: &[u8]) -> bool {
        let n = self.state.sent_before.len();
        match postcard::from_bytes::<State>(state) {
            Ok(state) if state.sent_before.len() == n => {
                let exists = |&(id, _): &(u32, Bytes)| (id as usize) < n;
                let fits = state.on_air.as_ref().is_none_or(|(_, sent)| sent.iter().all(exists));
                self.state = state;
                fits
            }
            _ => false,
        }
    }
}
