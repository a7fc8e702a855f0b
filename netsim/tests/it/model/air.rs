//! The air, naively: every emission at every ear, link by link, straight from the physics.

use physics::asn::Asn;
use physics::interference::Rule;
use physics::link::{Covariates, End, Scene};
use physics::medium::jam::Jams;
use physics::model::Model;
use physics::scatter::{Moment, PairBlock, Renewal};
use physics::timing::{SYNCHRONISATION_NS, airtime_ns};
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose, ordered_link};
use proto::site::Site;
use proto::time::SimDuration;

/// Something on the air. Times (ns) count from the slot's begin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Emission {
    pub(crate) sender: u32,
    pub(crate) channel: u8,
    pub(crate) begins_ns: i64,
    pub(crate) bytes: u16,
    pub(crate) purpose: Purpose,
}

impl Emission {
    pub(crate) fn ends_ns(&self) -> i64 {
        self.begins_ns + airtime_ns(self.bytes)
    }
}

/// Who listens, on which channel, from when until when a frame may begin (ns after the slot's begin).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ear {
    pub(crate) receiver: u32,
    pub(crate) channel: u8,
    pub(crate) opens_ns: i64,
    pub(crate) closes_ns: i64,
}

/// What became of an ear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Heard {
    Nothing,
    /// It had locked on to this emission.
    Lost(usize),
    Received(usize, f64),
}

/// All that decides what arrives.
pub(crate) struct World<'a> {
    pub(crate) model: &'a Model,
    pub(crate) rule: &'a dyn Rule,
    pub(crate) floor_dbm: f64,
    pub(crate) seed: u64,
    pub(crate) site: &'a Site,
    pub(crate) ends: &'a [End],
    pub(crate) way_m: &'a [f64],
    pub(crate) jams: &'a Jams,
    pub(crate) period_ns: u64,
    pub(crate) asn: Asn,
    pub(crate) slot_ns: u64,
}

/// What of an emission arrives.
#[derive(Clone, Copy)]
struct Arrived {
    which: usize,
    emission: Emission,
    rssi_dbm: f64,
    register_rssi_dbm: f64,
    /// Shifts of the curve taken off.
    signal_dbm: f64,
    probability: f64,
}

impl World<'_> {
    /// What an ear makes of all that is on the air.
    pub(crate) fn outcome(&self, emissions: &[Emission], ear: &Ear) -> Heard {
        let mut arrived: Vec<Arrived> = (0..emissions.len())
            .filter(|&which| emissions[which].channel == ear.channel)
            .filter_map(|which| self.arrive(which, emissions[which], ear.receiver))
            .collect();
        arrived.sort_by_key(|frame| (frame.emission.begins_ns, frame.emission.sender));
        let in_time = |frame: &Arrived| {
            ear.opens_ns <= frame.emission.begins_ns && frame.emission.begins_ns <= ear.closes_ns
        };
        let u = |frame: &Arrived| {
            let link = ordered_link(frame.emission.sender, ear.receiver);
            Draws::new(self.seed, frame.emission.purpose).uniform(link, self.asn.0, 0)
        };
        let mut locked: Option<Arrived> = None;
        for frame in arrived.iter().filter(|frame| in_time(frame)) {
            if let Some(before) = locked {
                let apart_ns = frame.emission.begins_ns - before.emission.begins_ns;
                let is_stronger = before.rssi_dbm + self.rule.capture_db() <= frame.rssi_dbm;
                if SYNCHRONISATION_NS <= apart_ns || !is_stronger {
                    continue;
                }
            }
            // The header is its share of the frame.
            let share = SYNCHRONISATION_NS as f64 / airtime_ns(frame.emission.bytes) as f64;
            let mut probability = frame.probability.powf(share);
            if self.rule.hides_preambles() {
                let header_ends_ns = frame.emission.begins_ns + SYNCHRONISATION_NS;
                probability *= self.survival(frame, &arrived, header_ends_ns);
            }
            if u(frame) < probability {
                locked = Some(*frame);
            }
        }
        let Some(frame) = locked else { return Heard::Nothing };
        let survival = self.survival(&frame, &arrived, frame.emission.ends_ns());
        if u(&frame) < frame.probability * survival {
            Heard::Received(frame.which, frame.register_rssi_dbm)
        } else {
            Heard::Lost(frame.which)
        }
    }

    /// The factor by which all others lower the probability that a frame is received as far as `until_ns`: stretch by
    /// stretch between any two moments at which something begins or ends.
    fn survival(&self, frame: &Arrived, all: &[Arrived], until_ns: i64) -> f64 {
        let begins_ns = frame.emission.begins_ns;
        let mut moments = vec![begins_ns, until_ns];
        for other in all {
            moments.extend([other.emission.begins_ns, other.emission.ends_ns()]);
        }
        moments.retain(|&moment| begins_ns <= moment && moment <= until_ns);
        moments.sort_unstable();
        moments.dedup();
        let mut survival = 1.0;
        for stretch in moments.windows(2) {
            let disturbs = |other: &&Arrived| {
                other.which != frame.which
                    && other.emission.begins_ns <= stretch[0]
                    && stretch[1] <= other.emission.ends_ns()
            };
            let interference_mw: f64 = all
                .iter()
                .filter(disturbs)
                .map(|other| self.rule.disturbance_mw(other.rssi_dbm))
                .sum();
            if 0.0 < interference_mw {
                survival *= self.rule.survival(
                    frame.signal_dbm,
                    interference_mw,
                    stretch[1] - stretch[0],
                    airtime_ns(frame.emission.bytes),
                );
            }
        }
        survival
    }

    fn arrive(&self, which: usize, emission: Emission, receiver: u32) -> Option<Arrived> {
        let place = |mote: u32| self.ends.iter().position(|end| end.id == MoteId(mote));
        let (from, to) = (place(emission.sender)?, place(receiver)?);
        if from == to {
            return None;
        }
        let slot_begins_ns = (self.asn * SimDuration::from_ns(self.slot_ns)).ns();
        let sent_ns = slot_begins_ns.saturating_add_signed(emission.begins_ns);
        let end_ns = slot_begins_ns.saturating_add_signed(emission.ends_ns());
        if self.jams.silence(self.ends[to].position_m, emission.channel, sent_ns, end_ns) {
            return None;
        }
        let mut scene = Scene {
            site: Some(self.site),
            agents: self.ends,
            nearest: None,
            grid: None,
            covariates: Covariates::None,
            run: None,
        };
        self.model.prepare(&mut scene);
        let (sender, end) = (self.ends[from], self.ends[to]);
        let way_m = self.way_m[from] + self.way_m[to];
        let at =
            Moment { period_ns: self.period_ns, sent_ns, way_m, channel: Some(emission.channel) };
        let mut scatter_db = 0.0;
        for scatter in self.model.scatters() {
            let drawn_ns = if scatter.renewal == Renewal::Frame { sent_ns } else { self.period_ns };
            let mut block = PairBlock::new(self.seed, sender.id, end.id, drawn_ns);
            scatter_db += scatter.value_db(&mut block, sender.id, end.id, at);
        }
        let link = self.model.link(&scene, sender, end, Some(emission.channel), sent_ns);
        let budget = self.model.evaluate_at(&link, scatter_db);
        let signal_dbm = budget.rssi_dbm - budget.shift_db;
        let arrives = if budget.is_stated {
            0.0 < budget.reception_probability
        } else {
            self.floor_dbm <= signal_dbm
        };
        arrives.then_some(Arrived {
            which,
            emission,
            rssi_dbm: budget.rssi_dbm,
            register_rssi_dbm: budget.register_rssi_dbm,
            signal_dbm,
            probability: budget.reception_probability,
        })
    }
}
