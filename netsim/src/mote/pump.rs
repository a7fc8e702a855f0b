//! What the layers have to say to each other after something happened.

use super::down::{HOP_LIMIT, Wanted};
use super::{CellsKnown, Mote, World};
use crate::app::App;
use crate::lowpan::DropReason;
use crate::mac::tsch::Due;
use crate::rpl;
use crate::sf::{Context, SchedulingFunction, Traffic};
use crate::timer::earliest;
use crate::wire::datagram::{Datagram, Upper};
use crate::wire::frame::Content;
use proto::time::SimTime;

impl Mote {
    /// Lets the scheduling function act, and routing hear of neighbours it has given up.
    pub(super) fn with_sf(
        &mut self,
        world: &mut World<'_>,
        act: impl FnOnce(&mut dyn SchedulingFunction, &mut Context<'_>),
    ) {
        let mut unusable = std::mem::take(&mut self.unusable);
        self.schedule.set_effective(world.effective_asn);
        let mut context = Context {
            own: self.address,
            is_root: self.is_root,
            asn: world.asn,
            now: world.now,
            slot: world.settings.mac.slot,
            n_channels: world.settings.mac.hopping_sequence.len() as u16,
            parent: self.rpl.parent(),
            schedule: &mut self.schedule,
            sixtop: &mut self.sixtop,
            dice: &mut self.dice.scheduling,
            unusable: &mut unusable,
        };
        act(&mut *self.sf, &mut context);
        self.unusable = unusable;
    }

    /// Passes everything on until no layer has anything left to say.
    pub fn pump(&mut self, world: &mut World<'_>) {
        loop {
            let mut moved = false;
            while let Some(peer) = self.sixtop.poll_purge() {
                moved = true;
                let purged = self.mac.take_where(|frame| {
                    frame.destination() == Some(peer)
                        && matches!(frame.frame.content, Content::Sixp(_))
                });
                for frame in &purged {
                    self.lose_frame(world, frame, DropReason::Withdrawn);
                }
                if !purged.is_empty() {
                    self.left_queue(world, peer);
                }
            }
            while let Some((peer, message)) = self.sixtop.poll_transmit() {
                moved = true;
                self.enqueue(world, Wanted::new(Some(peer), Content::Sixp(message)));
            }
            while let Some(event) = self.sixtop.poll_event() {
                moved = true;
                self.with_sf(world, |sf, cx| sf.handle_event(cx, event));
            }
            while let Some(neighbour) = self.unusable.pop() {
                moved = true;
                let (now, dice) = (world.now, &mut self.dice.routing);
                match self.sf.quarantine_ends(neighbour) {
                    Some(until) => {
                        self.rpl.handle_quarantine(neighbour, until, now, dice);
                    }
                    None => self.rpl.handle_unusable(neighbour, now, dice),
                }
            }
            while let Some(event) = self.rpl.poll_event() {
                moved = true;
                self.handle_rpl(world, event);
            }
            while let Some(outgoing) = self.rpl.poll_transmit() {
                moved = true;
                self.send_rpl(world, outgoing);
            }
            moved |= self.pump_join(world);
            if !moved {
                break;
            }
        }
        self.send_announcement(world);
        self.judge_readiness(world);
    }

    fn handle_rpl(&mut self, world: &mut World<'_>, event: rpl::Event) {
        match event {
            rpl::Event::ParentChanged { old, new } => {
                if old.is_some() {
                    self.tally.n_parent_changes += 1;
                }
                if new.is_none() && !world.settings.compat.stale_rank {
                    self.mac.lose_time_source(&world.settings.mac);
                }
                if let Some(parent) = new {
                    self.mac.set_time_source(&world.settings.mac, parent, world.now);
                    self.pledge.handle_proxy(parent);
                    self.with_sf(world, |sf, cx| sf.handle_time_source(cx, Some(parent)));
                }
                self.with_sf(world, |sf, cx| sf.handle_parent(cx, old));
                if let Some(parent) = new {
                    self.reroute_upward(world, parent);
                }
            }
            rpl::Event::ChildAdded(child) => {
                self.with_sf(world, |sf, cx| sf.handle_child(cx, child, true));
            }
            rpl::Event::ChildRemoved(child) => {
                self.with_sf(world, |sf, cx| sf.handle_child(cx, child, false));
            }
            rpl::Event::Joined { .. }
            | rpl::Event::Detached
            | rpl::Event::RankChanged
            | rpl::Event::LocalRepair
            | rpl::Event::TrickleReset => return,
        }
        // The cells that frames waited for may be others now, or none.
        let Self { mac, sf, .. } = self;
        let abandoned = mac.take_where(|queued| {
            let (to, slotframe) = (queued.destination(), queued.slotframe);
            to.zip(slotframe).is_some_and(|(to, slotframe)| sf.abandons(slotframe, to))
        });
        for frame in abandoned {
            self.discard(world, frame, DropReason::NoTxCells);
        }
        let Self { mac, sf, .. } = self;
        mac.place_anew(|queued| {
            sf.slotframe_of(queued.destination().map_or(Traffic::Broadcast, Traffic::Unicast))
        });
    }

    fn send_rpl(&mut self, world: &mut World<'_>, outgoing: rpl::Outgoing) {
        let rpl::Outgoing { destination, next_hop, message } = outgoing;
        let upper = Upper::Rpl(message);
        match next_hop {
            None => self.originate(world, destination, upper, 0),
            Some(next_hop) => {
                let on_link = destination.is_multicast() || destination.is_unicast_link_local();
                let datagram = Datagram {
                    packet: 0,
                    source: if on_link { self.address.link_local() } else { self.address.global() },
                    destination,
                    dscp: 0,
                    hop_limit: HOP_LIMIT,
                    rpi: if on_link { None } else { self.rpl.rpi(false) },
                    route: None,
                    upper,
                };
                self.send_to(world, datagram, Some(next_hop));
            }
        }
    }

    /// Whether the scheduling function has cells enough, asked anew only where the answer may be another one.
    fn has_cells(&mut self, world: &mut World<'_>) -> bool {
        self.schedule.set_effective(world.effective_asn);
        let of = (self.schedule.n_changes(), self.rpl.parent());
        if let CellsKnown(Some((known_of, has_cells))) = self.cells_known
            && known_of == of
        {
            return has_cells;
        }
        let mut has_cells = false;
        self.with_sf(world, |sf, cx| has_cells = sf.is_ready(cx));
        self.cells_known = CellsKnown(Some((of, has_cells)));
        has_cells
    }

    /// Whether everything is there that data need; beacons and applications begin and end with it.
    fn judge_readiness(&mut self, world: &mut World<'_>) {
        let mut ready =
            self.mac.is_synced() && self.joined && (self.is_root || self.rpl.parent().is_some());
        if ready {
            ready = self.has_cells(world);
        }
        // Who joins through this mote is answered through it: it invites nobody before the answer finds its way.
        let reachable = ready && self.rpl.is_reachable() && !self.rpl.is_leaf();
        if reachable != self.invites {
            self.invites = reachable;
            self.mac.enable_beacons(&world.settings.mac, reachable, world.now);
            if reachable {
                self.with_sf(world, |sf, cx| sf.handle_known_to_parent(cx));
            }
        }
        if ready == self.ready {
            return;
        }
        self.ready = ready;
        *world.readiness_changed = true;
        if ready && self.tally.first_ready.is_none() {
            self.tally.first_ready = Some(world.now);
        }
        self.set_apps_ready(world, ready);
    }

    /// The first moment at which some layer wants to act.
    #[must_use]
    pub fn poll_timeout(&self, world_mac: &crate::mac::tsch::Config) -> Option<SimTime> {
        let of_apps = self.apps.iter().filter_map(App::poll_timeout).min();
        earliest([
            self.mac.poll_timeout(world_mac),
            self.sixtop.poll_timeout(),
            self.sf.poll_timeout(),
            self.rpl.poll_timeout(),
            self.lowpan.poll_timeout(),
            self.pledge.poll_timeout(),
            self.in_work.front().map(|(at, _)| *at),
            self.reboots,
            of_apps,
        ])
    }

    /// Time has come to `world.now`.
    pub fn handle_timeout(&mut self, world: &mut World<'_>) {
        let now = world.now;
        let is_due = |deadline: Option<SimTime>| deadline.is_some_and(|deadline| deadline <= now);
        if is_due(self.reboots) {
            return self.reboot(world);
        }
        self.finish_work(world);
        if is_due(self.mac.poll_timeout(&world.settings.mac)) {
            match self.mac.handle_timeout(&world.settings.mac, now) {
                None => {}
                Some(Due::Synchronise(source)) => self.wants_sync = Some(source),
                Some(Due::KeepAlive(source)) => self.keep_alive(world, source),
                Some(Due::SourceLost(source)) if self.rpl.parent() == Some(source) => {
                    self.rpl.handle_unusable(source, now, &mut self.dice.routing);
                }
                Some(Due::SourceLost(_) | Due::Desynchronised) => self.desynchronise(world),
            }
        }
        if is_due(self.sixtop.poll_timeout()) {
            self.sixtop.handle_timeout(now);
        }
        if is_due(self.sf.poll_timeout()) {
            self.with_sf(world, |sf, cx| sf.handle_timeout(cx));
        }
        if is_due(self.rpl.poll_timeout()) {
            self.rpl.handle_timeout(now, &mut self.dice.routing);
        }
        if is_due(self.lowpan.poll_timeout()) {
            for (packet, reason) in self.lowpan.handle_timeout(now) {
                self.lose(world, packet, reason);
            }
        }
        if is_due(self.pledge.poll_timeout()) {
            self.pledge.handle_timeout(now);
        }
        self.run_apps(world);
        self.pump(world);
    }

    /// Loses synchronisation: begins anew.
    pub(super) fn desynchronise(&mut self, world: &mut World<'_>) {
        self.tally.n_desynchronised += 1;
        let frames = self.mac.scan(&world.settings.mac);
        self.leave(world, frames, DropReason::Desynchronised);
        self.tally.start_scanning(world.effective_asn);
    }
}
