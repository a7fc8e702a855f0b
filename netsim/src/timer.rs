//! The first of several timers.

use proto::time::SimTime;

/// The earliest of these moments; `None`: no timer runs. Without branches: layers have many timers, and ask often.
pub(crate) fn earliest<const N: usize>(timers: [Option<SimTime>; N]) -> Option<SimTime> {
    let (mut runs, mut first) = (false, SimTime::NEVER);
    for timer in timers {
        runs |= timer.is_some();
        first = first.min(timer.unwrap_or(SimTime::NEVER));
    }
    runs.then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_earliest_timer_that_runs() {
        assert_eq!(
            earliest([None, Some(SimTime::from_ns(7)), Some(SimTime::from_ns(3)), None]),
            Some(SimTime::from_ns(3))
        );
        assert_eq!(earliest([None, Some(SimTime::NEVER)]), Some(SimTime::NEVER));
        assert_eq!(earliest([None, None]), None);
        assert_eq!(earliest([]), None);
    }
}
