//! The first of several timers.

/// The earliest of these moments (ns); `None`: no timer runs. Without branches: layers have many timers, and ask often.
pub(crate) fn earliest<const N: usize>(timers: [Option<u64>; N]) -> Option<u64> {
    let (mut runs, mut first_ns) = (false, u64::MAX);
    for timer in timers {
        runs |= timer.is_some();
        first_ns = first_ns.min(timer.unwrap_or(u64::MAX));
    }
    runs.then_some(first_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_earliest_timer_that_runs() {
        assert_eq!(earliest([None, Some(7), Some(3), None]), Some(3));
        assert_eq!(earliest([None, Some(u64::MAX)]), Some(u64::MAX));
        assert_eq!(earliest([None, None]), None);
        assert_eq!(earliest([]), None);
    }
}
