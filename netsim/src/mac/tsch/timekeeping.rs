//! Whose time a mote keeps, for how long it does so unheard, and when it asks.

use super::{Config, Due, State, Tsch};
use crate::wire::Eui64;
use proto::time::{SimDuration, SimTime};

impl Tsch {
    /// Keeps the time of `source`, whose clock is off by `source_ns`.
    pub fn synchronise(&mut self, config: &Config, source: Eui64, source_ns: i64, now: SimTime) {
        self.clock.forget_source();
        self.had_time = true;
        self.take_time(config, source, source_ns, now);
        let keep_alive = self.draw_keep_alive(config, now);
        self.drawn_for = Some(now).filter(|_| !config.contends_as_peer);
        self.state = State::Synced { source: Some(source), heard: now, keep_alive };
    }

    /// A neighbour that is nearer to the root has been heard, whose clock is off by `source_ns`: its time is as good as that of the
    /// time source.
    pub(crate) fn take_time_beside(
        &mut self,
        config: &Config,
        from: Eui64,
        source_ns: i64,
        now: SimTime,
    ) {
        if let State::Synced { heard, .. } = &mut self.state
            && !self.is_root
        {
            *heard = now;
            self.take_time(config, from, source_ns, now);
        }
    }

    /// From now on another neighbour is the time source. A mote whose clock still holds has as long to hear it as if it had just
    /// heard the old one.
    pub fn set_time_source(&mut self, config: &Config, new: Eui64, now: SimTime) {
        let soon = self.draw_wait(config, config.keep_alive);
        if let State::Synced { source, heard, keep_alive } = &mut self.state
            && !self.is_root
            && *source != Some(new)
        {
            *source = Some(new);
            let silent = now.saturating_since(*heard);
            let holds = config.runs_free_for(self.clock.runs_free());
            self.patience = silent.saturating_add(config.desynchronise).min(holds);
            // Hear it soon: until then the clock runs as the old one set it. Time is lost `desynchronise` after this.
            let since = if config.contends_as_peer {
                now
            } else {
                heard.saturating_add(self.patience.saturating_sub(config.desynchronise))
            };
            *keep_alive = (*keep_alive).min(since.saturating_add(soon)).max(now);
        }
    }

    /// Nobody leads to the root any more whose time could be kept: two motes would keep each other's, away from all
    /// others'. The mote runs free for as long as its clock is known to hold, so that it hears when there is a way again,
    /// and then looks for a network anew.
    pub fn lose_time_source(&mut self, config: &Config) {
        if let State::Synced { source, keep_alive, .. } = &mut self.state {
            (*source, *keep_alive) = (None, SimTime::NEVER);
            self.patience = config.runs_free_for(self.clock.runs_free()).max(self.patience);
        }
    }

    /// Its time source has been heard, whose clock is off by `source_ns`.
    pub(super) fn take_time(
        &mut self,
        config: &Config,
        source: Eui64,
        source_ns: i64,
        now: SimTime,
    ) {
        if config.max_keep_alive.is_some() {
            self.clock.learn(source, source_ns, now, &mut self.dice);
        } else {
            self.clock.correct(source_ns, now, &mut self.dice);
        }
        self.patience = self.within(config);
    }

    /// How long it does without its present source.
    fn within(&self, config: &Config) -> SimDuration {
        config.desynchronise_within(self.clock.holds())
    }

    /// The source has not been heard for too long. A mote whose clock still holds gives up the source alone.
    pub(super) fn miss_source(&mut self, config: &Config, heard: SimTime, now: SimTime) -> Due {
        let runs_free = config.runs_free_for(self.clock.runs_free());
        match self.time_source() {
            Some(source) if now < heard + runs_free => {
                self.lose_time_source(config);
                Due::SourceLost(source)
            }
            Some(_) | None => Due::Desynchronised,
        }
    }

    /// When to ask for the time of a source that was heard at `heard`.
    fn draw_keep_alive(&mut self, config: &Config, heard: SimTime) -> SimTime {
        let wait = config.keep_alive_within(self.within(config));
        heard.saturating_add(self.draw_wait(config, wait))
    }

    /// How long to wait with a keep-alive: at random in the last quarter of `wait`, so that neighbours that have heard
    /// the same beacon do not ask in the same cell. Without end where there are no keep-alives.
    fn draw_wait(&mut self, config: &Config, wait: SimDuration) -> SimDuration {
        if config.keep_alive.is_zero() {
            SimDuration::MAX
        } else if config.contends_as_peer {
            wait
        } else {
            self.dice.duration(wait - wait / 4, wait)
        }
    }

    /// The time has come to consider a keep-alive.
    pub(super) fn ask_for_time(
        &mut self,
        config: &Config,
        source: Eui64,
        heard: SimTime,
        now: SimTime,
    ) -> Option<Due> {
        let mut next = now;
        if self.drawn_for != Some(heard) {
            // It has been heard since.
            self.drawn_for = Some(heard);
            let late = if config.contends_as_peer { config.slot } else { SimDuration::ZERO };
            next = self.draw_keep_alive(config, heard) + late;
        }
        let mut due = None;
        if next <= now {
            let goes_soon = if config.contends_as_peer {
                self.queue.waits_for(source)
            } else {
                self.queue.goes_soon(source)
            };
            due = (!goes_soon).then_some(Due::KeepAlive(source));
            next = now + self.draw_retry(config);
        }
        if let State::Synced { keep_alive, .. } = &mut self.state {
            *keep_alive = next;
        }
        due
    }

    /// How soon it asks again while its time source is not heard: at random, and so that it has asked at least twice more
    /// before synchronisation is lost.
    fn draw_retry(&mut self, config: &Config) -> SimDuration {
        let within = self.within(config);
        let wait = config.keep_alive_within(within);
        if config.contends_as_peer {
            return wait;
        }
        let third = within.saturating_sub(wait) / 3;
        self.dice.duration(third / 2, third).max(config.slot)
    }
}
