//! Waiting awake: most answers come within microseconds, and to fall asleep and be woken can take longer than that.

use std::time::{Duration, Instant};

/// The longest wait that is spent awake: one that the processor pays for in vain loses no more than this.
const LONGEST: Duration = Duration::from_millis(1);
/// What the first answer is expected to take.
const AT_FIRST: Duration = Duration::from_micros(100);
/// An answer is waited for awake until it is late by this factor.
const LATE: u32 = 3;
/// Latest answers that the expectation looks back on.
const MEMORY: u32 = 8;

/// How long to wait awake for answers of one side: as long as they have been coming soon, and no longer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Awake {
    /// The processor has nothing else to do.
    is_allowed: bool,
    expected: Duration,
}

impl Awake {
    /// `is_busy`: other work waits for the processor. Where there is but one, the side itself does.
    pub(super) fn new(is_busy: bool) -> Self {
        Self { is_allowed: !is_busy && 1 < proto_host::cores(), expected: AT_FIRST }
    }

    /// How long the next answer is to be waited for awake.
    fn limit(self) -> Duration {
        let limit = self.expected * LATE;
        if self.is_allowed && limit <= LONGEST { limit } else { Duration::ZERO }
    }

    /// An answer took so long.
    pub(super) fn saw(&mut self, took: Duration) {
        // One that took seconds is not to be remembered for minutes.
        self.expected = (self.expected * (MEMORY - 1) + took.min(LONGEST)) / MEMORY;
    }

    /// Gives everything else its turn, without sleeping, until an answer would be late.
    pub(super) async fn stay(self) {
        let begun = Instant::now();
        let limit = self.limit();
        while begun.elapsed() < limit {
            tokio::task::yield_now().await;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOON: Duration = Duration::from_micros(50);
    const LATER: Duration = Duration::from_secs(2);

    fn after(answers: &[(usize, Duration)]) -> Duration {
        let mut awake = Awake { is_allowed: true, expected: AT_FIRST };
        for &(n, took) in answers {
            (0..n).for_each(|_| awake.saw(took));
        }
        awake.limit()
    }

    #[test]
    fn answers_are_waited_for_awake_while_they_come_soon() {
        assert_eq!(after(&[]), AT_FIRST * LATE);
        let limit = after(&[(100, SOON)]);
        assert!((SOON * 2..SOON * 4).contains(&limit), "{limit:?}");
        assert_eq!(after(&[(10, LATER)]), Duration::ZERO);
        assert!(Duration::ZERO < after(&[(1000, LATER), (20, SOON)]));
    }

    #[test]
    fn nobody_waits_awake_while_other_work_waits() {
        let awake = Awake::new(true);
        assert_eq!(awake.limit(), Duration::ZERO);
    }
}
