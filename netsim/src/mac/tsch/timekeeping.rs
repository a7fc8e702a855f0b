//! Whose time a mote keeps, for how long it does so unheard, and when it asks.

use super::{Config, Due, State, Tsch};
use crate::wire::Eui64;

impl Tsch {
    /// Keeps the time of `source`, whose clock is off by `source_ns`.
    pub fn synchronise(&mut self, config: &Config, source: Eui64, source_ns: i64, now_ns: u64) {
        self.clock.forget_source();
        self.had_time = true;
        self.take_time(config, source, source_ns, now_ns);
        let keep_alive_ns = self.draw_keep_alive(config, now_ns);
        self.drawn_for_ns = Some(now_ns).filter(|_| !config.contends_as_peer);
        self.state = State::Synced { source: Some(source), heard_ns: now_ns, keep_alive_ns };
    }

    /// A neighbour that is nearer to the root has been heard, whose clock is off by `source_ns`: its time is as good as that of the
    /// time source.
    pub fn take_time_beside(&mut self, config: &Config, from: Eui64, source_ns: i64, now_ns: u64) {
        if let State::Synced { heard_ns, .. } = &mut self.state
            && !self.is_root
        {
            *heard_ns = now_ns;
            self.take_time(config, from, source_ns, now_ns);
        }
    }

    /// From now on another neighbour is the time source. A mote whose clock still holds has as long to hear it as if it had just
    /// heard the old one.
    pub fn set_time_source(&mut self, config: &Config, new: Eui64, now_ns: u64) {
        let soon_ns = self.draw_wait(config, config.keep_alive_ns);
        if let State::Synced { source, heard_ns, keep_alive_ns } = &mut self.state
            && !self.is_root
            && *source != Some(new)
        {
            *source = Some(new);
            let silent_ns = now_ns.saturating_sub(*heard_ns);
            let holds_ns = config.runs_free_for(self.clock.runs_free_ns());
            self.patience_ns = silent_ns.saturating_add(config.desynchronise_ns).min(holds_ns);
            // Hear it soon: until then the clock runs as the old one set it. Time is lost `desynchronise_ns` after this.
            let since_ns = if config.contends_as_peer {
                now_ns
            } else {
                heard_ns.saturating_add(self.patience_ns.saturating_sub(config.desynchronise_ns))
            };
            *keep_alive_ns = (*keep_alive_ns).min(since_ns.saturating_add(soon_ns)).max(now_ns);
        }
    }

    /// Nobody leads to the root any more whose time could be kept: two motes would keep each other's, away from all
    /// others'. The mote runs free for as long as its clock is known to hold, so that it hears when there is a way again,
    /// and then looks for a network anew.
    pub fn lose_time_source(&mut self, config: &Config) {
        if let State::Synced { source, keep_alive_ns, .. } = &mut self.state {
            (*source, *keep_alive_ns) = (None, u64::MAX);
            self.patience_ns =
                config.runs_free_for(self.clock.runs_free_ns()).max(self.patience_ns);
        }
    }

    /// Its time source has been heard, whose clock is off by `source_ns`.
    pub(super) fn take_time(
        &mut self,
        config: &Config,
        source: Eui64,
        source_ns: i64,
        now_ns: u64,
    ) {
        if config.max_keep_alive_ns.is_some() {
            self.clock.learn(source, source_ns, now_ns, &mut self.dice);
        } else {
            self.clock.correct(source_ns, now_ns, &mut self.dice);
        }
        self.patience_ns = self.within_ns(config);
    }

    /// How long it does without its present source (ns).
    fn within_ns(&self, config: &Config) -> u64 {
        config.desynchronise_within(self.clock.holds_ns())
    }

    /// The source has not been heard for too long. A mote whose clock still holds gives up the source alone.
    pub(super) fn miss_source(&mut self, config: &Config, heard_ns: u64, now_ns: u64) -> Due {
        let runs_free_ns = config.runs_free_for(self.clock.runs_free_ns());
        match self.time_source() {
            Some(source) if now_ns < heard_ns + runs_free_ns => {
                self.lose_time_source(config);
                Due::SourceLost(source)
            }
            Some(_) | None => Due::Desynchronised,
        }
    }

    /// When to ask for the time of a source that was heard at `heard_ns` (ns).
    fn draw_keep_alive(&mut self, config: &Config, heard_ns: u64) -> u64 {
        let wait_ns = config.keep_alive_within(self.within_ns(config));
        heard_ns.saturating_add(self.draw_wait(config, wait_ns))
    }

    /// How long to wait with a keep-alive (ns): at random in the last quarter of `wait_ns`, so that neighbours that have heard
    /// the same beacon do not ask in the same cell. Without end where there are no keep-alives.
    fn draw_wait(&mut self, config: &Config, wait_ns: u64) -> u64 {
        if config.keep_alive_ns == 0 {
            u64::MAX
        } else if config.contends_as_peer {
            wait_ns
        } else {
            self.dice.duration_ns(wait_ns - wait_ns / 4, wait_ns)
        }
    }

    /// The time has come to consider a keep-alive.
    pub(super) fn ask_for_time(
        &mut self,
        config: &Config,
        source: Eui64,
        heard_ns: u64,
        now_ns: u64,
    ) -> Option<Due> {
        let mut next_ns = now_ns;
        if self.drawn_for_ns != Some(heard_ns) {
            // It has been heard since.
            self.drawn_for_ns = Some(heard_ns);
            let late_ns = if config.contends_as_peer { config.slot_ns } else { 0 };
            next_ns = self.draw_keep_alive(config, heard_ns) + late_ns;
        }
        let mut due = None;
        if next_ns <= now_ns {
            let goes_soon = if config.contends_as_peer {
                self.queue.waits_for(source)
            } else {
                self.queue.goes_soon(source)
            };
            due = (!goes_soon).then_some(Due::KeepAlive(source));
            next_ns = now_ns + self.draw_retry(config);
        }
        if let State::Synced { keep_alive_ns, .. } = &mut self.state {
            *keep_alive_ns = next_ns;
        }
        due
    }

    /// How soon it asks again while its time source is not heard (ns): at random, and so that it has asked at least twice more
    /// before synchronisation is lost.
    fn draw_retry(&mut self, config: &Config) -> u64 {
        let within_ns = self.within_ns(config);
        let wait_ns = config.keep_alive_within(within_ns);
        if config.contends_as_peer {
            return wait_ns;
        }
        let third_ns = within_ns.saturating_sub(wait_ns) / 3;
        self.dice.duration_ns(third_ns / 2, third_ns).max(config.slot_ns)
    }
}
