//! `netsim.phy.standard`: the physical layer, and what follows from it where it is not configured.

use super::MODE_6TISCH;
use crate::mesh::config::STANDARD_SLOT;
use physics::standard::Entry;
use proto::config::{Node, Problem, Value, join};
use proto::time::SimDuration;

/// Reports written channels that the physical layer does not have, even if others are no channels at all.
pub(super) fn check_channels(
    written: Option<&Node>,
    entry: &Entry,
    path: &str,
    problems: &mut Vec<Problem>,
) {
    let Some(Value::List(channels)) = written.map(|node| &node.value) else { return };
    let plan = entry.standard.channels;
    for (index, node) in channels.iter().enumerate() {
        let Value::Integer(channel) = node.value else { continue };
        let is_known = u8::try_from(channel).is_ok_and(|channel| plan.contains(channel));
        // What no physical layer has is reported already.
        if !is_known && (0..=128).contains(&channel) {
            let (first, last) = (plan.first, plan.last);
            let message = format!(
                "must be a channel of phy.standard = {:?}, a whole number from {first} to {last}",
                entry.name
            );
            let problem = Problem::new(join(path, &format!("hopping_sequence[{index}]")), message);
            let nearest = channel.clamp(i64::from(first), i64::from(last));
            problems.push(problem.value(channel).nearest(nearest));
        }
    }
}

/// A problem with a slot of a network that is too short for the longest frame and its acknowledgment.
pub(super) fn check_slot(
    entry: &Entry,
    slot: SimDuration,
    step: SimDuration,
    path: &str,
) -> Option<Problem> {
    let least = SimDuration::from_ns(entry.standard.airtime.least_slot_ns());
    if least <= slot {
        return None;
    }
    let message = format!(
        "must be at least {} s with mode = {MODE_6TISCH:?}, the duration of the longest frame and its acknowledgment",
        least.seconds()
    );
    let mut problem = Problem::new(path, message).value(slot.seconds());
    let nearest =
        if least <= STANDARD_SLOT { Some(STANDARD_SLOT) } else { shortest_slot(least, step) };
    problem.nearest = nearest.map(|slot| slot.seconds().to_string());
    Some(problem)
}

/// The shortest slot of at least `least` that divides a control period, if there is one.
fn shortest_slot(least: SimDuration, step: SimDuration) -> Option<SimDuration> {
    let most = step / least;
    // A search that takes no time; so many slots to a period are beyond any schedule.
    (1..=most.min(1 << 20)).rev().find(|&n| step.ns().is_multiple_of(n)).map(|n| step / n)
}
