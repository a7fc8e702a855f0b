//! Sequence counters that begin in a straight line and go on in a circle: RFC 6550, § 7.2.

use std::cmp::Ordering;

/// How far apart two counters may be to be compared (SEQUENCE_WINDOW).
pub(crate) const SEQUENCE_WINDOW: u8 = 16;
/// Where a counter begins after a restart: 256 less the window.
pub(crate) const INITIAL: u8 = 0u8.wrapping_sub(SEQUENCE_WINDOW);
/// First value of the straight part; below lies the circle.
const STRAIGHT: u8 = 128;

/// The next value: 255 and 127 are both followed by 0.
#[must_use]
pub fn next(counter: u8) -> u8 {
    match counter {
        127 | 255 => 0,
        _ => counter + 1,
    }
}

/// Which of two counters is the later one; `None` if they are too far apart to tell (§ 7.2, rule 3).
#[must_use]
pub fn compare(a: u8, b: u8) -> Option<Ordering> {
    match (STRAIGHT <= a, STRAIGHT <= b) {
        (true, false) => Some(across(a, b)),
        (false, true) => Some(across(b, a).reverse()),
        (true, true) => (a.abs_diff(b) <= SEQUENCE_WINDOW).then(|| a.cmp(&b)),
        (false, false) => {
            let ahead = a.wrapping_sub(b) % STRAIGHT;
            if ahead == 0 {
                Some(Ordering::Equal)
            } else if ahead <= SEQUENCE_WINDOW {
                Some(Ordering::Greater)
            } else if STRAIGHT - ahead <= SEQUENCE_WINDOW {
                Some(Ordering::Less)
            } else {
                None
            }
        }
    }
}

/// Whether `a` is later than `b`, for certain.
#[must_use]
pub(crate) fn is_newer(a: u8, b: u8) -> bool {
    compare(a, b) == Some(Ordering::Greater)
}

/// One counter on the straight part, one in the circle: the circle is later if the straight one can have led there.
fn across(straight: u8, circle: u8) -> Ordering {
    if 256 + u16::from(circle) - u16::from(straight) <= u16::from(SEQUENCE_WINDOW) {
        Ordering::Less
    } else {
        Ordering::Greater
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rfc6550_7_2_a_counter_begins_at_240_and_never_returns_to_the_straight_part() {
        let mut counter = INITIAL;
        assert_eq!(counter, 240);
        for _ in 0..16 {
            counter = next(counter);
        }
        assert_eq!(counter, 0);
        for _ in 0..1000 {
            counter = next(counter);
            assert!(counter < 128);
        }
    }

    #[test]
    fn rfc6550_7_2_the_examples_of_the_standard() {
        // "if A is 240 and B is 5": 256 + 5 - 240 = 21, more than the window: 240 is the later one.
        assert_eq!(compare(240, 5), Some(Ordering::Greater));
        assert_eq!(compare(5, 240), Some(Ordering::Less));
        // 250 and 5: 11, within the window: 5 is the later one.
        assert_eq!(compare(250, 5), Some(Ordering::Less));
        assert_eq!(compare(5, 250), Some(Ordering::Greater));
    }

    #[test]
    fn rfc6550_7_2_a_counter_is_older_than_its_next_sixteen_and_beyond_that_unknown() {
        for first in 0..=255u8 {
            let mut later = first;
            for _ in 0..SEQUENCE_WINDOW {
                later = next(later);
                assert!(is_newer(later, first), "{first} {later}");
                assert!(!is_newer(first, later), "{first} {later}");
            }
        }
        assert_eq!(compare(20, 60), None);
        assert_eq!(compare(130, 200), None);
        assert_eq!(compare(7, 7), Some(Ordering::Equal));
        assert_eq!(compare(3, 125), Some(Ordering::Greater));
    }

    #[test]
    fn rfc6550_7_2_a_restarted_counter_wins_over_the_circle_it_left() {
        for circle in 1..128 {
            assert!(is_newer(INITIAL, circle), "{circle}");
        }
    }
}
