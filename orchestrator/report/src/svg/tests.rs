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

#[test]
fn neighbouring_ticks_differ_where_all_values_are_the_same_or_nearly() {
    let labels = |axis: Axis| -> Vec<String> {
        axis.labelled_ticks(4.0).into_iter().map(|(_, label)| label).collect()
    };
    for (min, max) in [(1.0, 1.0), (0.999_96, 1.0), (0.0, 0.0), (1.0 - 1e-15, 1.0)] {
        for axis in [Axis::new("", min, max), Axis::new("", min, max).percent()] {
            let labels = labels(axis);
            let differ = labels.windows(2).all(|pair| pair[0] != pair[1]);
            assert!(2 <= labels.len() && differ, "{min} to {max}: {labels:?}");
        }
    }
    let shares = labels(Axis::new("", 0.999_96, 1.0).percent());
    assert_eq!(shares, ["99.996 %", "99.997 %", "99.998 %", "99.999 %", "100.000 %"]);
    // Values of a list that ten digits do not tell apart.
    let list = Axis::new("", 0.0, 1.0).ticks_at(&[0.1, 0.1 + 1e-12]);
    let list = labels(list);
    assert!(list[0] != list[1], "{list:?}");
}

#[test]
fn equal_ratios_have_equal_distances_and_labels_that_do_not_overlap() {
    let axis = || Axis::new("", 1.0, 100.0).log();
    assert!((axis().share(10.0) - 0.5).abs() < 1e-12);
    for (min, max) in [(1.0, 100.0), (0.5, 3.0), (1e-9, 1e9), (4.9, 5.1), (10.0, 300.0)] {
        let chart =
            Chart::new(Axis::new("", min, max).log(), Axis::new("", 0.0, 1.0), 345.0, 244.0);
        let axes = chart.axes().into_string();
        let places: Vec<(f64, usize)> = axes
            .split("<text class=\"tick\"")
            .filter(|part| part.split('>').next().is_some_and(|mark| mark.contains("middle")))
            .filter_map(|part| {
                let x = part.split("x=\"").nth(1)?.split('"').next()?.parse().ok()?;
                let label = part.split('>').nth(1)?.split('<').next()?;
                Some((x, label.chars().count()))
            })
            .collect();
        assert!(2 <= places.len(), "{min} to {max}: {axes}");
        for pair in places.windows(2) {
            let room = 7.0 * (pair[0].1 + pair[1].1) as f64 / 2.0;
            assert!(room <= pair[1].0 - pair[0].0, "{min} to {max}: {places:?}");
        }
    }
    // Without a place for 0 there is no such scale.
    assert!((Axis::new("", 0.0, 10.0).log().share(5.0) - 0.5).abs() < 1e-12);
}

#[test]
fn a_chart_keeps_what_it_draws_as_exact_numbers() {
    let mut chart = Chart::new(
        Axis::new("time (s)", 0.0, 1.0),
        Axis::new("share (%)", 0.0, 1.0).percent(),
        540.0,
        312.0,
    );
    chart.item("agent 7");
    chart.line("path", [Some([0.1, 0.2]), None, Some([1.0 / 3.0, 0.5])]);
    chart.item("");
    chart.names(["seed 1".to_owned()]);
    chart.dots("trial", [[0.5, 0.25]]);
    chart.dots("trial", [[0.6, 0.26]]);
    chart.guides("zero", [[[0.0, 0.5], [1.0, 0.5]]]);
    chart.interval(0.5, 0.25, [0.2, 0.3], "n = 5");
    let json = chart.data.json([0.0; 4], &chart.x, &chart.y);
    let series = json["series"].as_array().unwrap();
    assert_eq!(series.len(), 3, "{json}");
    assert_eq!(series[0]["item"], "agent 7");
    assert_eq!(series[0]["columns"].to_string(), "[[0.1,null,0.3333333333333333],[0.2,null,0.5]]");
    assert_eq!(series[1]["columns"].to_string(), "[[0.5,0.6],[0.25,0.26]]");
    assert_eq!(series[1]["names"].to_string(), "[\"seed 1\"]");
    assert_eq!(series[2]["columns"].to_string(), "[[0.5],[0.25],[0.2],[0.3]]");
    assert_eq!(json["y"]["percent"], true);
    let page = chart.finish("a", "", "").into_string();
    assert!(page.contains("</svg><script class=\"figure-data\" type=\"text/plain\">"), "{page}");
    // A file by itself has no script.
    let chart = Chart::new(Axis::new("", 0.0, 1.0), Axis::new("", 0.0, 1.0), 540.0, 312.0);
    assert!(!chart.finish_file("a", "", "", "").contains("<script"));
}
