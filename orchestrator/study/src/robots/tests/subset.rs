//! A subset of the windows, against all of them.

use super::*;
use crate::view::Viewed as _;

/// One block of time in four.
fn quarter(whole: &RobotStudy) -> RobotStudy {
    whole.thinned_to(whole.n_rows() / 4).unwrap()
}

#[test]
fn a_subset_predicts_its_windows_as_all_windows_are_predicted() {
    let whole = study(&lagging(1000, 0.2));
    let subset = quarter(&whole);
    let share = subset.n_rows() as f64 / whole.n_rows() as f64;
    assert!((0.2..0.3).contains(&share), "{share}");
    let lag = index(&whole, "actuator-lag");
    let fit = whole.fit(&[lag], &whole.fitted_rows(), Level::Time, None);
    let [all, some] = [&whole, &subset].map(|study| study.view(&fit));
    let lines = |study: &RobotStudy| -> Vec<[usize; 2]> {
        study.windows().into_iter().map(|window| window.map(|sample| sample.line)).collect()
    };
    let (of_all, mut row) = (lines(&whole), 0);
    for (of_subset, window) in lines(&subset).into_iter().enumerate() {
        row += of_all[row..].iter().position(|other| *other == window).unwrap();
        let off_m = all.predicted[row] - some.predicted[of_subset];
        // What was before the stretch has faded in what actuators do and, by the gain, in the position.
        assert!(off_m.abs() < 0.1 * NOISE_M, "{of_subset}: {off_m}");
    }
}

#[test]
fn a_fit_to_a_subset_starts_one_to_all_and_agrees_with_it() {
    let whole = study(&lagging(2000, 0.2));
    let subset = quarter(&whole);
    let lag = index(&subset, "actuator-lag");
    let found = subset.fit(&[lag], &subset.fitted_rows(), Level::Time, None);
    let fit = whole.fit(&[lag], &whole.fitted_rows(), Level::Time, Some(&found));
    let [of_subset, of_all] = [(&subset, &found), (&whole, &fit)].map(|(study, fit)| {
        let (estimates, _) = study.estimates(fit, lag);
        estimates[0].clone()
    });
    let width = |estimate: &Estimate| estimate.high - estimate.low;
    assert!((of_subset.value - of_all.value).abs() < width(&of_subset), "{of_subset:?} {of_all:?}");
    // Four times the windows halve the interval.
    let ratio = width(&of_subset) / width(&of_all);
    assert!((1.4..2.8).contains(&ratio), "{of_subset:?} {of_all:?}");
}

#[test]
fn blocks_of_a_subset_are_apart_and_lie_all_over_each_track() {
    let whole = study(&lagging(2000, 0.2));
    let subset = quarter(&whole);
    let blocks = subset.blocks(Level::Time);
    // A quarter of 200 s, in blocks of 2 s.
    assert!((20..=30).contains(&blocks.n_blocks()), "{}", blocks.n_blocks());
    // Each window belongs to one block, and windows of a block follow each other.
    assert!(blocks.of_row.windows(2).all(|pair| pair[0] <= pair[1] && pair[1] <= pair[0] + 1));
    let tracks = &subset.model.tracks;
    for (number, range) in tracks.robots.tracks.iter().enumerate() {
        let of_track = tracks.windows.iter().filter(|window| window.track as usize == number);
        let starts: Vec<usize> = of_track.map(|window| window.start as usize).collect();
        for quarter in 0..4 {
            let [first, end] = [quarter, quarter + 1].map(|k| range.start + k * range.len() / 4);
            assert!(starts.iter().any(|start| (first..end).contains(start)), "{number} {quarter}");
        }
    }
}

#[test]
fn what_is_hardly_more_than_a_search_needs_is_searched_as_a_whole() {
    let whole = study(&lagging(400, 0.2));
    assert!(whole.thinned_to(whole.n_rows() * 9 / 10).is_none());
    assert!(whole.thinned().is_none());
}
