//! The distributed coordination function of IEEE 802.11 for broadcast frames, event by event.
//!
//! # Model
//!
//! IEEE Std 802.11-2016, 10.3.4. A station senses whether the medium is busy. Its back-off counts down by one for every slot in
//! which the medium has been idle, from DIFS after the medium became idle on; it stops while the medium is busy and goes on with
//! the same value. At 0 the station sends what it has. After each of its frames it draws a new back-off from 0 to W − 1, whether
//! or not another frame waits. A frame that finds the medium idle for DIFS or longer and the back-off over is sent at once; if
//! the medium is not idle, the station draws a back-off first. Broadcast frames are neither acknowledged nor repeated, so the
//! window stays W.
//!
//! # Validity
//!
//! A station senses another one from the instant after that one begins: two collide only if they begin at the same instant, or
//! do not sense each other.

use crate::second::carried::{Carried, CarriedFrame};
use bytes::Bytes;
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Times and sizes of DCF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Timing {
    /// Slot time.
    pub slot: SimDuration,
    /// Idle time before the back-off counts.
    pub difs: SimDuration,
    /// Duration of preamble and PHY header.
    pub preamble: SimDuration,
    /// Duration of a bit (ns).
    pub bit_ns: f64,
    /// Bytes of headers and checksum with each payload.
    pub overhead_bytes: u32,
    /// Size of the contention window.
    pub window: u32,
}

impl Timing {
    /// Duration of the frame of a payload, at least 1.
    #[must_use]
    pub(crate) fn airtime(&self, payload_bytes: usize) -> SimDuration {
        let bits = 8.0 * (f64::from(self.overhead_bytes) + payload_bytes as f64);
        (self.preamble + SimDuration::from_ns((bits * self.bit_ns).round() as u64))
            .max(SimDuration::from_ns(1))
    }
}

/// Whom a transmission concerns.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct HeardBy {
    /// Stations that sense it, without the sender.
    pub sensed: Vec<u32>,
    /// Those of them that receive it if nothing disturbs it, with the power (dBm).
    pub received: Vec<(u32, f32)>,
}

/// Stations, and what is on the air.
#[derive(Clone, Debug)]
pub(crate) struct Dcf {
    timing: Timing,
    state: State,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct State {
    stations: Vec<Station>,
    on_air: Vec<OnAir>,
    /// Number of the next transmission.
    next: u64,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Station {
    /// Slots of back-off that were left when the medium last became busy.
    backoff: u64,
    /// Back-offs drawn so far.
    n_drawn: u64,
    /// When the medium became idle the last time; `None`: it has never been busy, and no back-off was drawn.
    idle_since: Option<SimTime>,
    /// Transmissions that it senses, its own among them.
    n_sensed: u32,
    /// What waits, and since when.
    waiting: Option<(SimTime, Bytes)>,
    /// Number of the transmission that it receives, so far undisturbed.
    receives: Option<u64>,
    /// Grows when the planned begin of its frame is no longer right.
    version: u64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct OnAir {
    number: u64,
    sender: MoteId,
    sent: SimTime,
    end: SimTime,
    payload: Bytes,
    sensed: Vec<u32>,
    received: Vec<(u32, f32)>,
}

/// What happens next. Of what happens at the same time frames end first, then payloads arrive, then frames begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    End { number: u64 },
    Arrival { place: usize },
    Begin { station: u32, version: u64 },
}

type Events = BinaryHeap<Reverse<(SimTime, Event)>>;

impl Dcf {
    /// Stations on an idle medium, with nothing to send and no back-off.
    #[must_use]
    pub(crate) fn new(timing: Timing, n_stations: usize) -> Self {
        let stations = vec![Station::default(); n_stations];
        Self { timing, state: State { stations, on_air: Vec::new(), next: 0 } }
    }

    /// All that changes with time.
    #[must_use]
    pub(crate) fn state(&self) -> Vec<u8> {
        postcard::to_stdvec(&self.state).expect("plain data in memory")
    }

    /// Puts a state back. `false`: it is one of another number of stations.
    pub(crate) fn resume(&mut self, state: &[u8]) -> bool {
        let n = self.state.stations.len();
        let exists = |id: u32| (id as usize) < n;
        let Ok(state) = postcard::from_bytes::<State>(state) else { return false };
        let fits = state.stations.len() == n
            && state.on_air.iter().all(|frame| {
                exists(frame.sender.0)
                    && frame.sensed.iter().all(|&id| exists(id))
                    && frame.received.iter().all(|&(id, _)| exists(id))
            });
        if fits {
            self.state = state;
        }
        fits
    }

    /// A station is off: it has nothing to send and receives nothing.
    pub(crate) fn silence(&mut self, station: u32) {
        let station = &mut self.state.stations[station as usize];
        station.waiting = None;
        station.receives = None;
    }

    /// Runs to `until`: frames begin before it and end by it. `arrivals`: payloads by time and station, ascending, all before
    /// `until`.
    pub(crate) fn run(
        &mut self,
        arrivals: Vec<(SimTime, u32, Bytes)>,
        until: SimTime,
        seed: u64,
        heard_by: &mut dyn FnMut(MoteId) -> HeardBy,
        carried: &mut Carried,
    ) {
        let draws = Draws::new(seed, Purpose::SecondMediumBackoff);
        let mut events = Events::new();
        for (place, &(at, ..)) in arrivals.iter().enumerate() {
            events.push(Reverse((at, Event::Arrival { place })));
        }
        for frame in &self.state.on_air {
            events.push(Reverse((frame.end, Event::End { number: frame.number })));
        }
        for station in 0..self.state.stations.len() as u32 {
            self.plan(station, &mut events);
        }
        let mut beginning = Vec::new();
        while let Some(&Reverse((now, event))) = events.peek() {
            let is_end = matches!(event, Event::End { .. });
            if until < now || (until == now && !is_end) {
                break;
            }
            events.pop();
            match event {
                Event::End { number } => self.end(number, draws, &mut events, carried),
                Event::Arrival { place } => {
                    let (at, station, payload) = arrivals[place].clone();
                    self.arrive(station, at, payload, draws, &mut events);
                }
                Event::Begin { station, version } => {
                    if self.state.stations[station as usize].version == version {
                        beginning.push(station);
                    }
                    let is_last = !matches!(
                        events.peek(),
                        Some(&Reverse((next, Event::Begin { .. }))) if next == now
                    );
                    if is_last && !beginning.is_empty() {
                        self.begin(&beginning, now, heard_by, &mut events);
                        beginning.clear();
                    }
                }
            }
        }
    }

    /// Plans the begin of a station's frame, if it has one and the medium is idle.
    fn plan(&mut self, id: u32, events: &mut Events) {
        let station = &mut self.state.stations[id as usize];
        station.version += 1;
        let (Some((arrived, _)), 0) = (&station.waiting, station.n_sensed) else { return };
        let wait = self.timing.difs + station.backoff * self.timing.slot;
        let over = station.idle_since.map_or(SimTime::START, |since| since + wait);
        let begin = Event::Begin { station: id, version: station.version };
        events.push(Reverse((over.max(*arrived), begin)));
    }

    fn draw(&mut self, id: u32, draws: Draws) {
        let station = &mut self.state.stations[id as usize];
        let drawn = draws.uniform(id.into(), station.n_drawn, 0);
        station.backoff = (drawn * f64::from(self.timing.window)) as u64;
        station.n_drawn += 1;
    }

    /// A payload arrives; one that waits is replaced.
    fn arrive(&mut self, id: u32, at: SimTime, payload: Bytes, draws: Draws, events: &mut Events) {
        let difs = self.timing.difs;
        let station = &mut self.state.stations[id as usize];
        if let Some((_, waiting)) = &mut station.waiting {
            *waiting = payload;
            return;
        }
        station.waiting = Some((at, payload));
        let is_idle =
            station.n_sensed == 0 && station.idle_since.is_none_or(|since| since + difs <= at);
        if station.backoff == 0 && !is_idle {
            self.draw(id, draws);
        }
        self.plan(id, events);
    }

    /// The medium becomes busy for a station, or busier.
    fn sense(&mut self, id: u32, now: SimTime) {
        let timing = self.timing;
        let station = &mut self.state.stations[id as usize];
        if station.n_sensed == 0 {
            let counts_from = station.idle_since.map_or(now, |ns| ns + timing.difs);
            let n_idle = now.saturating_since(counts_from) / timing.slot;
            station.backoff = station.backoff.saturating_sub(n_idle);
            station.version += 1;
        }
        station.n_sensed += 1;
    }

    /// Frames of these stations begin.
    fn begin(
        &mut self,
        senders: &[u32],
        now: SimTime,
        heard_by: &mut dyn FnMut(MoteId) -> HeardBy,
        events: &mut Events,
    ) {
        let mut begun = Vec::with_capacity(senders.len());
        for &sender in senders {
            let station = &mut self.state.stations[sender as usize];
            let Some((_, payload)) = station.waiting.take() else { continue };
            station.receives = None;
            self.sense(sender, now);
            begun.push((sender, payload));
        }
        for (sender, payload) in begun {
            let HeardBy { sensed, received } = heard_by(MoteId(sender));
            let number = self.state.next;
            self.state.next += 1;
            let mut possible = received.iter().map(|&(id, _)| id).peekable();
            for &id in &sensed {
                while possible.next_if(|&other| other < id).is_some() {}
                let is_in_range = possible.peek() == Some(&id);
                let station = &mut self.state.stations[id as usize];
                let is_free = station.n_sensed == 0;
                station.receives = (is_free && is_in_range).then_some(number);
                self.sense(id, now);
            }
            let end = now + self.timing.airtime(payload.len());
            events.push(Reverse((end, Event::End { number })));
            let sent = now;
            let frame =
                OnAir { number, sender: MoteId(sender), sent, end, payload, sensed, received };
            self.state.on_air.push(frame);
        }
    }

    /// A frame ends.
    fn end(&mut self, number: u64, draws: Draws, events: &mut Events, carried: &mut Carried) {
        let on_air = &mut self.state.on_air;
        let Some(place) = on_air.iter().position(|frame| frame.number == number) else { return };
        let frame = on_air.swap_remove(place);
        let stations = &mut self.state.stations;
        let mut receivers = frame.received;
        receivers.retain(|&(id, _)| stations[id as usize].receives == Some(number));
        self.draw(frame.sender.0, draws);
        for id in frame.sensed.iter().copied().chain([frame.sender.0]) {
            let station = &mut self.state.stations[id as usize];
            if station.receives == Some(number) {
                station.receives = None;
            }
            station.n_sensed -= 1;
            if station.n_sensed == 0 {
                station.idle_since = Some(frame.end);
                self.plan(id, events);
            }
        }
        let (sender, sent, end) = (frame.sender, frame.sent, frame.end);
        let payload = frame.payload;
        carried.frames.push(CarriedFrame { sender, sent, end, payload, receivers });
    }
}

#[cfg(test)]
mod tests;
