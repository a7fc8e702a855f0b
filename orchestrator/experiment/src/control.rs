//! How often robots act.

use proto::config::{Choice, Node, OneOf, Problem, Section};
use proto::types::NS_PER_S;

/// The longest period in slots.
const MAX_SLOTS: u64 = 1_000_000;

/// What `control_period` may be.
#[derive(OneOf)]
pub(super) enum Period {
    /// A period that the network gives.
    OfNetwork(NetworkPeriod),
    /// A period of fixed length.
    Fixed(FixedPeriod),
}

/// A period that the network gives.
#[derive(Choice, Clone, Copy)]
pub(super) enum NetworkPeriod {
    /// One slotframe of the network. Without protocols it has one slot per agent; with them it is that of the scheduling function, or
    /// the broadcast slotframe of the payloads.
    Slotframe,
    /// Until a packet is delivered, at most one slotframe.
    Packet,
}

/// A control period of fixed length; set exactly one of the two keys.
#[derive(Section)]
pub(super) struct FixedPeriod {
    /// Length in slots of the network.
    #[key(range = 1..=MAX_SLOTS)]
    slots: Option<u64>,
    /// Control rate (Hz). The period must be a whole number of slots.
    #[key(above = 0.0, most = 1e6)]
    rate_hz: Option<f64>,
}

/// How often robots act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlPeriod {
    /// Every so many slots.
    Slots(u64),
    /// Once in each slotframe of the network.
    Slotframe,
    /// When a packet was delivered, at the latest after a slotframe.
    Packet,
}

impl ControlPeriod {
    /// The nominal period (ns) with a slotframe of so many slots.
    #[must_use]
    pub fn step_ns(self, slotframe_slots: u64, slot_ns: u64) -> u64 {
        let slots = match self {
            Self::Slots(slots) => slots,
            Self::Slotframe | Self::Packet => slotframe_slots,
        };
        slots.saturating_mul(slot_ns).max(1)
    }
}

/// Slots in the slotframe of a network of that configuration, over which robots act once. Of one that is none of ours
/// nothing is known: a slot for every agent.
pub(super) fn slotframe_slots(netsim: &Node, agents: usize) -> u64 {
    netsim::config::slotframe_slots(netsim, agents, netsim::catalogue::Catalogue::built_in())
}

/// Reads the checked `control_period`.
pub(super) fn read(
    period: &Period,
    agents: usize,
    slot_ns: u64,
    is_parallel: bool,
    problems: &mut Vec<Problem>,
) -> ControlPeriod {
    const PATH: &str = "experiment.control_period";
    match period {
        Period::OfNetwork(NetworkPeriod::Slotframe) => ControlPeriod::Slotframe,
        Period::OfNetwork(NetworkPeriod::Packet) => {
            if is_parallel {
                problems.push(
                    Problem::new(PATH, "must not be \"packet\" with coupling = \"parallel\", in which both simulators run \
                                        at the same time")
                        .value("\"packet\"")
                        .nearest("\"slotframe\""),
                );
            }
            ControlPeriod::Packet
        }
        Period::Fixed(FixedPeriod { slots: Some(slots), rate_hz: None }) => {
            ControlPeriod::Slots(*slots)
        }
        Period::Fixed(FixedPeriod { slots: None, rate_hz: Some(rate_hz) }) => {
            of_rate(*rate_hz, slot_ns, agents, problems)
        }
        Period::Fixed(_) => {
            problems
                .push(Problem::new(PATH, "must have exactly one of the keys slots and rate_hz"));
            ControlPeriod::Slotframe
        }
    }
}

/// Whole slots, or refused with the two nearest rates.
fn of_rate(
    rate_hz: f64,
    slot_ns: u64,
    agents: usize,
    problems: &mut Vec<Problem>,
) -> ControlPeriod {
    let slots_per_s = NS_PER_S as f64 / slot_ns as f64;
    let exact = slots_per_s / rate_hz;
    let whole = libm::round(exact);
    // A rate as people write it (16.67) is not taken for 50/3: only rounding of the division is forgiven.
    if (MAX_SLOTS as f64) < whole {
        problems.push(
            Problem::new(
                "experiment.control_period.rate_hz",
                format!(
                    "must give a period of at most {MAX_SLOTS} slots of {} ms",
                    slot_ns as f64 / 1e6
                ),
            )
            .value(rate_hz)
            .nearest(format!("{} Hz", slots_per_s / MAX_SLOTS as f64)),
        );
        return ControlPeriod::Slots(agents as u64);
    }
    if 1.0 <= whole && libm::fabs(exact - whole) <= 1e-9 * whole {
        return ControlPeriod::Slots(whole as u64);
    }
    let slower = slots_per_s / (libm::floor(exact) + 1.0);
    let faster = if 1.0 <= exact { slots_per_s / libm::floor(exact) } else { slots_per_s };
    let nearest =
        if exact < 1.0 { format!("{faster} Hz") } else { format!("{slower} Hz or {faster} Hz") };
    problems.push(
        Problem::new(
            "experiment.control_period.rate_hz",
            format!("must give a period of whole slots of {} ms", slot_ns as f64 / 1e6),
        )
        .value(rate_hz)
        .nearest(nearest),
    );
    ControlPeriod::Slots(agents as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slots(rate_hz: f64) -> Result<u64, String> {
        let mut problems = Vec::new();
        match of_rate(rate_hz, 10_000_000, 10, &mut problems) {
            ControlPeriod::Slots(slots) if problems.is_empty() => Ok(slots),
            _ => Err(problems[0].to_string()),
        }
    }

    #[test]
    fn a_rate_gives_whole_slots_or_names_its_two_neighbours() {
        assert_eq!(slots(10.0), Ok(10));
        assert_eq!(slots(100.0), Ok(1));
        assert_eq!(slots(100.0 / 3.0), Ok(3));
        assert_eq!(
            slots(30.0).unwrap_err(),
            "experiment.control_period.rate_hz: must give a period of whole slots of 10 ms, got 30 (nearest valid: \
             25 Hz or 33.333333333333336 Hz)"
        );
        assert_eq!(
            slots(400.0).unwrap_err(),
            "experiment.control_period.rate_hz: must give a period of whole slots of 10 ms, got 400 (nearest valid: \
             100 Hz)"
        );
    }
}
