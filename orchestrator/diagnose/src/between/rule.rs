//! The verdict on two campaigns. `nothing-changed` requires all evidence to agree.

use super::BetweenVerdict;
use study::thresholds::{DOUBTFUL_LEVEL, FAMILY_ERROR};

/// What the verdict follows from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Evidence {
    /// Number of changes that these data distinguish from every other explanation.
    pub changes: usize,
    /// Number of changes that an effect in both campaigns explains as well.
    pub possible: usize,
    /// Number of defects of the measurement in either file, which may look like changes.
    pub defects: usize,
    /// Number of constants by which B is off and that no change explains.
    pub unexplained: usize,
    /// Probability of as great a change of the error by chance, whatever A is compared by; none where the data are too few for a test.
    pub error_p_value: Option<f64>,
    /// The least such probability.
    pub doubtful_p_value: Option<f64>,
    /// Whether the greatest difference that may be hidden is smaller than the noise.
    pub is_sharp: bool,
    /// Whether each campaign has enough independent blocks.
    pub suffices: bool,
    /// Whether the search came to its end.
    pub is_complete: bool,
}

/// The verdict.
#[must_use]
pub(super) fn verdict(evidence: &Evidence) -> BetweenVerdict {
    let Evidence { changes, possible, unexplained, error_p_value, .. } = *evidence;
    let is_clean = evidence.defects == 0;
    if 0 < changes && is_clean {
        BetweenVerdict::Changed
    } else if 0 < changes + possible || !is_clean {
        BetweenVerdict::CannotTell
    } else if 0 < unexplained || error_p_value.is_some_and(|p_value| p_value < FAMILY_ERROR) {
        BetweenVerdict::SomethingChanged
    } else if evidence.is_sharp
        && evidence.suffices
        && evidence.is_complete
        && evidence.doubtful_p_value.is_some_and(|p_value| DOUBTFUL_LEVEL <= p_value)
    {
        BetweenVerdict::NothingChanged
    } else {
        BetweenVerdict::NothingFound
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use BetweenVerdict::{CannotTell, Changed, NothingChanged, NothingFound, SomethingChanged};

    const QUIET: Evidence = Evidence {
        changes: 0,
        possible: 0,
        defects: 0,
        unexplained: 0,
        error_p_value: Some(0.5),
        doubtful_p_value: Some(0.5),
        is_sharp: true,
        suffices: true,
        is_complete: true,
    };

    #[test]
    fn nothing_changed_only_where_all_speaks_for_it() {
        assert_eq!(verdict(&QUIET), NothingChanged);
        assert_eq!(verdict(&Evidence { is_sharp: false, ..QUIET }), NothingFound);
        assert_eq!(verdict(&Evidence { suffices: false, ..QUIET }), NothingFound);
        assert_eq!(verdict(&Evidence { is_complete: false, ..QUIET }), NothingFound);
        assert_eq!(verdict(&Evidence { doubtful_p_value: None, ..QUIET }), NothingFound);
    }

    #[test]
    fn a_greater_error_is_a_change_and_a_doubtful_one_is_not_nothing() {
        let of_both = |certain, doubtful| {
            let (error_p_value, doubtful_p_value) = (Some(certain), Some(doubtful));
            verdict(&Evidence { error_p_value, doubtful_p_value, ..QUIET })
        };
        let of = |p_value| of_both(p_value, p_value);
        assert_eq!(of_both(0.1, 0.001), NothingFound);
        assert_eq!(of(0.0049), SomethingChanged);
        assert_eq!(of(0.0051), NothingFound);
        assert_eq!(of(0.049), NothingFound);
        assert_eq!(of(0.051), NothingChanged);
    }

    #[test]
    fn a_defect_of_the_measurement_lets_nothing_be_certain() {
        let defect = Evidence { defects: 1, ..QUIET };
        assert_eq!(verdict(&defect), CannotTell);
        assert_eq!(verdict(&Evidence { changes: 1, ..defect }), CannotTell);
        assert_eq!(verdict(&Evidence { changes: 1, ..QUIET }), Changed);
    }

    #[test]
    fn what_is_certain_goes_before_what_is_possible_and_that_before_what_is_unexplained() {
        let all = Evidence { changes: 1, possible: 1, unexplained: 1, ..QUIET };
        assert_eq!(verdict(&all), Changed);
        assert_eq!(verdict(&Evidence { changes: 0, ..all }), CannotTell);
        assert_eq!(verdict(&Evidence { changes: 0, possible: 0, ..all }), SomethingChanged);
        // A certain change stands, however few the data.
        let few = Evidence { suffices: false, is_sharp: false, ..all };
        assert_eq!(verdict(&few), Changed);
    }
}
