//! Broadcast frames of WiFi: contention by DCF, without acknowledgments.

use super::around::{Around, Reach};
use super::carried::Carried;
use super::{BuildContext, Entry, SecondMedium, problem};
use dcf::{Dcf, Timing};
use proto::config::{Choice, Range, Section, variant};
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose};
use proto::time::{SimDuration, SimTime};
use proto::types::NS_PER_S;

pub mod dcf;

/// `kind = "wifi-broadcast"`.
pub const ENTRY: Entry = Entry { variant: variant::<Keys>("wifi-broadcast"), build };

/// Broadcast frames of WiFi: stations contend by DCF (IEEE Std 802.11-2016, 10.3), without acknowledgments.
#[derive(Section)]
struct Keys {
    /// Maximum distance (m), itself included, at which an undisturbed frame is received.
    #[key(range = Range::LENGTH, default = 50.0)]
    range_m: f64,
    /// Maximum distance (m) at which a transmission is sensed, and at which it destroys another frame. Absent: twice range_m.
    #[key(range = Range::LENGTH)]
    carrier_sense_m: Option<f64>,
    /// Whether walls and obstacles of \[site\] block frames and carrier sense.
    #[key(default = false)]
    walls_block: bool,
    /// Bit rate of broadcast frames (bit/s). 1e6: the lowest basic rate at 2.4 GHz.
    #[key(range = 1e3..=1e10, default = 1e6)]
    bit_rate_bps: f64,
    /// Duration of preamble and PHY header (s). 192e-6: the long one of DSSS.
    #[key(range = 0.0..=0.1, default = 192e-6)]
    preamble_s: f64,
    /// Bytes of headers and checksum with each payload. 64: MAC 28, LLC and SNAP 8, IPv4 20, UDP 8.
    #[key(range = 0..=65_535, default = 64)]
    overhead_bytes: u32,
    /// Size W of the contention window: back-off is drawn from 0 to W - 1 slots. 16: aCWmin 15 of ERP. It never grows, because
    /// broadcast frames are not repeated.
    #[key(range = 1..=65_536, default = 16)]
    contention_window: u32,
    /// Slot time (s).
    #[key(range = 1e-6..=1e-3, default = 20e-6)]
    slot_s: f64,
    /// Idle time (s) before the back-off counts. 50e-6: SIFS and two slots.
    #[key(range = 1e-6..=1e-2, default = 50e-6)]
    difs_s: f64,
    /// When in a control period robots hand over their payloads.
    #[key(default = Phase::Random)]
    phase: Phase,
    /// Received power at the maximum distance (dBm), for the RSSI reading only.
    #[key(range = -200.0..=100.0, default = -82.0)]
    sensitivity_dbm: f64,
}

/// When in a control period robots hand over their payloads.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Each at its own constant time, drawn uniformly.
    Random,
    /// All at the beginning, which makes frames collide.
    Aligned,
}

/// Broadcast frames of WiFi.
///
/// # Model
///
/// Every robot is a station with a queue of one payload, where a new one replaces the old one. Contention is simulated event by
/// event: [`Dcf`]. A frame lasts its preamble and 8 (overhead + payload) / bit rate. Robots within `range_m` receive it unless
/// they send, or sense another transmission while it lasts. Hidden stations follow from the geometry.
///
/// # Validity
///
/// No fading, no capture, no EIFS after destroyed frames, no propagation delay, no beacons or other traffic. Who reaches whom is
/// decided where robots are when the frame begins.
#[derive(Clone, Debug)]
pub(crate) struct WifiBroadcast {
    range: Reach,
    sense: Reach,
    phase: Phase,
    dcf: Dcf,
}

fn build(table: &toml::Table, context: &mut BuildContext<'_>) -> Option<Box<dyn SecondMedium>> {
    let keys = Keys::read(table);
    let sense_m = keys.carrier_sense_m.unwrap_or(2.0 * keys.range_m);
    if sense_m < keys.range_m {
        let message = format!("must be at least range_m, {}", keys.range_m);
        let problem = problem(context, "carrier_sense_m", message);
        context.problems.push(problem.value(sense_m).nearest(keys.range_m));
        return None;
    }
    let duration = SimDuration::from_seconds;
    let timing = Timing {
        slot: duration(keys.slot_s),
        difs: duration(keys.difs_s),
        preamble: duration(keys.preamble_s),
        bit_ns: NS_PER_S as f64 / keys.bit_rate_bps,
        overhead_bytes: keys.overhead_bytes,
        window: keys.contention_window,
    };
    let step = context.step;
    let header_s = timing.airtime(0).ns() as f64 / NS_PER_S as f64;
    if step < timing.airtime(0) {
        let key = if step <= timing.preamble { "preamble_s" } else { "bit_rate_bps" };
        let message = format!(
            "makes the headers of a frame last {header_s} s, longer than the control period, {} s",
            step.seconds()
        );
        let problem = problem(context, key, message);
        let bits = 8.0 * f64::from(keys.overhead_bytes);
        let spare_s = step.saturating_sub(timing.preamble).seconds();
        context.problems.push(match key {
            "preamble_s" => problem.value(keys.preamble_s).nearest(192e-6),
            _ => problem.value(keys.bit_rate_bps).nearest((bits / spare_s).ceil()),
        });
        return None;
    }
    let range = Reach {
        range_m: keys.range_m,
        half_angle_rad: None,
        walls_block: keys.walls_block,
        body_radius_m: None,
        edge_dbm: keys.sensitivity_dbm,
    };
    Some(Box::new(WifiBroadcast {
        range,
        sense: Reach { range_m: sense_m, ..range },
        phase: keys.phase,
        dcf: Dcf::new(timing, context.agent_count),
    }))
}

/// Robots that sense a transmission, and those that may receive it.
fn heard_by(
    (sense, range): (&Reach, &Reach),
    around: &Around<'_>,
    scene: (&physics::Scene<'_>, &physics::nearest::Grid),
    sender: MoteId,
) -> dcf::HeardBy {
    let Some(sender) = around.end(sender.0) else { return dcf::HeardBy::default() };
    let sensed = sense.receivers(around, scene, sender);
    let received = sensed
        .iter()
        .filter_map(|&(id, _)| {
            let power_dbm = range.power_dbm(scene.0, sender, around.end(id)?)?;
            Some((id, power_dbm as f32))
        })
        .collect();
    dcf::HeardBy { sensed: sensed.into_iter().map(|(id, _)| id).collect(), received }
}

impl SecondMedium for WifiBroadcast {
    fn carry(&mut self, around: &Around<'_>, from: SimTime, until: SimTime, carried: &mut Carried) {
        let (scene, grid) = (around.scene(false), around.grid(self.sense.range_m));
        let period = SimTime::START + from / around.step * around.step;
        let draws = Draws::new(around.seed, Purpose::SecondMediumPhase);
        let phase = |id: u32| match self.phase {
            Phase::Aligned => SimDuration::ZERO,
            Phase::Random => {
                // Less than the period, because draws are less than 1.
                let phase_ns = draws.uniform(id.into(), 0, 0) * around.step.ns() as f64;
                SimDuration::from_ns(phase_ns as u64)
            }
        };
        let mut arrivals = Vec::new();
        for id in 0..around.agent_count() as u32 {
            let at = period + phase(id);
            if !around.is_on(id) {
                self.dcf.silence(id);
            } else if (from..until).contains(&at)
                && let Some(payload) = around.payload(id)
            {
                arrivals.push((at, id, payload));
            }
        }
        arrivals.sort_unstable_by_key(|&(at, id, _)| (at, id));
        let (sense, range) = (self.sense, self.range);
        let mut heard_by = |id| heard_by((&sense, &range), around, (&scene, &grid), id);
        self.dcf.run(arrivals, until, around.seed, &mut heard_by, carried);
    }

    fn boxed(&self) -> Box<dyn SecondMedium> {
        Box::new(self.clone())
    }

    fn state(&self) -> Vec<u8> {
        self.dcf.state()
    }

    fn resume(&mut self, state: &[u8]) -> bool {
        self.dcf.resume(state)
    }
}
