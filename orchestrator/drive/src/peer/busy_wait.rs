//! Busy-waiting: most answers come within microseconds, and to block and be woken can take longer than that.

use std::time::{Duration, Instant};

/// The longest busy-wait. One in vain costs no more processor time than this.
const LONGEST: Duration = Duration::from_millis(1);
/// What the first answer is expected to take.
const AT_FIRST: Duration = Duration::from_micros(100);
/// A busy-wait ends when the answer takes this many times as long as expected.
const LATE: u32 = 3;
/// Latest answers that the expectation looks back on.
const MEMORY: u32 = 8;

/// How long to busy-wait for answers of one side: as long as its answers have been coming soon.
#[derive(Clone, Copy, Debug)]
pub(super) struct BusyWait {
    /// The processor has nothing else to do.
    is_allowed: bool,
    expected: Duration,
}

impl BusyWait {
    /// `is_busy`: other work waits for the processor. Where there is but one, the side itself does.
    pub(super) fn new(is_busy: bool) -> Self {
        Self { is_allowed: !is_busy && 1 < proto_host::cores(), expected: AT_FIRST }
    }

    /// How long to busy-wait for the next answer.
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
        let mut busy_wait = BusyWait { is_allowed: true, expected: AT_FIRST };
        for &(n, took) in answers {
            (0..n).for_each(|_| busy_wait.saw(took));
        }
        busy_wait.limit()
    }

    #[test]
    fn answers_that_come_soon_are_busy_waited_for() {
        assert_eq!(after(&[]), AT_FIRST * LATE);
        let limit = after(&[(100, SOON)]);
        assert!((SOON * 2..SOON * 4).contains(&limit), "{limit:?}");
        assert_eq!(after(&[(10, LATER)]), Duration::ZERO);
        assert!(Duration::ZERO < after(&[(1000, LATER), (20, SOON)]));
    }

    #[test]
    fn nobody_busy_waits_while_other_work_waits() {
        let busy_wait = BusyWait::new(true);
        assert_eq!(busy_wait.limit(), Duration::ZERO);
    }
}
