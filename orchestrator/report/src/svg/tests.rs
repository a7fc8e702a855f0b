//! Tests of charts.

use super::axis::wrapped;
use super::*;

#[test]
fn ticks_are_round_and_within_the_axis() {
    let ticks = |min, max, n| Axis::new("", min, max).ticks(n);
    assert_eq!(ticks(0.0, 25.0, 5.0), [0.0, 5.0, 10.0, 15.0, 20.0, 25.0]);
    assert_eq!(ticks(-3.0, 3.0, 4.0), [-2.0, 0.0, 2.0]);
    assert_eq!(Axis::new("", 0.0, 1.0).tick_label(-0.0, 0.2), "0.0");
    assert_eq!(Axis::new("", 0.0, 1.0).tick_label(-20.0, 20.0), "−20");
}

#[test]
fn labels_tell_neighbouring_ticks_apart_and_have_room() {
    let shares = Axis::new("", 0.9985, 1.000_05).percent();
    let labels: Vec<String> =
        shares.labelled_ticks(4.0).into_iter().map(|(_, label)| label).collect();
    assert_eq!(labels, ["99.85 %", "99.90 %", "99.95 %", "100.00 %"]);
    let whole = Axis::new("", 0.0, 1.05).percent().labelled_ticks(4.0);
    assert_eq!(whole.last().map(|(_, label)| label.as_str()), Some("100 %"));
    for (min, max) in [(0.999_999_9, 1.0), (1e-9, 3e-9), (-2e-12, 1e-12), (1e6, 1e6 + 1e-2)] {
        for axis in [Axis::new("", min, max), Axis::new("", min, max).percent()] {
            let labels = axis.labelled_ticks(4.0);
            let differ = labels.windows(2).all(|pair| pair[0].1 != pair[1].1);
            assert!(2 <= labels.len() && differ, "{labels:?}");
            let longest = labels.iter().map(|(_, label)| label.chars().count()).max();
            let chart = Chart::new(Axis::new("", 0.0, 1.0), axis, 540.0, 312.0);
            assert!(DIGIT * longest.unwrap() as f64 + GAP <= chart.left, "{labels:?}");
        }
    }
}

#[test]
fn names_are_broken_into_lines_that_fit() {
    assert_eq!(wrapped("experimental-randomness", 13), ["experimental-", "randomness"]);
    assert_eq!(
        wrapped("two groups, the one between lost", 12),
        ["two groups,", "the one", "between lost"]
    );
    assert_eq!(wrapped("abcdefgh", 5), ["abcde", "fgh"]);
    assert_eq!(fitted("north (m)", 500.0).map(|px| px.0), None);
    assert_eq!(fitted(&"n".repeat(100), 500.0).map(|px| px.0), Some(496.0));
}

#[test]
fn an_axis_of_one_value_has_ends_that_labels_tell_apart() {
    let axis = Axis::new("", 1.0, 1.0 + 1e-12);
    assert_eq!((axis.min, axis.max), (1.0, 2.0));
    assert_eq!((Axis::new("", 0.0, 0.0).max, Axis::new("", -3.0, -3.0).max), (1.0, 0.0));
}

#[test]
fn numbers_are_left_out_where_they_would_cover_each_other() {
    let axis = || Axis::new("", 0.0, 100.0);
    let mut chart = Chart::new(axis(), axis(), 580.0, 572.0);
    chart.numbers([(7, [50.0, 50.0]), (8, [50.1, 50.0]), (9, [20.0, 50.0])]);
    let picture = chart.finish("", "", "").into_string();
    assert!(picture.contains(">7</text>") && picture.contains(">9</text>"));
    assert!(!picture.contains(">8</text>"));
}

#[test]
fn a_path_breaks_where_there_is_nothing_and_reaches_its_last_point() {
    let axis = || Axis::new("", 0.0, 100.0);
    let chart = Chart::new(axis(), axis(), 180.0, 172.0);
    let points = [Some([0.0, 0.0]), None, Some([50.0, 50.0]), Some([50.1, 50.0])];
    assert_eq!(chart.path(points), "M56.0,128.0M106.0,78.0L106.1,78.0");
}
