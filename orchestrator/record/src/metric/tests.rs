use super::*;
use std::collections::BTreeSet;

fn known(name: &str) -> Metric {
    find(name, Robots::BuiltIn).unwrap_or_else(|| panic!("{name} is known"))
}

#[test]
fn paths_come_from_the_types_of_the_summary() {
    for path in [
        "steps",
        "simulated_s",
        "task.complete",
        "task.false_completion",
        "network.delivery_ratio",
        "network.by_distance_is_sampled",
        "kpis.formation.formed_s",
        "kpis.delivery.latency_s.p95",
        // Flattened in the type.
        "kpis.exchanges.success_ratio",
        "kpis.downloads.time_s.max",
        "kpis.packets.app.delivered",
        "kpis.packets.app.drops_by_reason.queue_full",
        "kpis.since_start.frames_by_kind.keep-alive.share",
    ] {
        assert_eq!(known(path).path, path);
    }
    for none in [
        "",
        "task",
        "task.controller",
        "seed",
        "kpis.motes.duty_cycle",
        "network.by_distance",
        "kpis.formation.missing_by_reason.parent",
        "kpis.packets.app",
        "kpis.packets..delivered",
        "kpis.packets.delivered",
        "network.pdr",
        "task.flok_speed_mps",
        "flock_speed_mps",
        "*",
        "kpis.packets.*.created ",
    ] {
        assert!(find(none, Robots::BuiltIn).is_none(), "{none}");
    }
}

#[test]
fn only_robots_of_others_have_figures_that_are_not_known_before() {
    assert!(find("task.wing_beat_hz", Robots::BuiltIn).is_none());
    let metric = find("task.wing_beat_hz", Robots::Foreign).unwrap();
    assert_eq!((metric.path.as_str(), metric.label.as_str()), ("task.wing_beat_hz", "wing beat"));
    assert!(find("network.wing_beat_hz", Robots::Foreign).is_none());
}

#[test]
fn a_short_name_is_of_one_path_that_no_other_has_and_is_no_path() {
    let paths: BTreeSet<&str> = metrics().iter().map(|metric| metric.path.as_str()).collect();
    let mut names = BTreeSet::new();
    let mut of_paths = BTreeSet::new();
    for short in SHORT_NAMES {
        assert!(paths.contains(short.path), "{}: no figure {}", short.name, short.path);
        assert!(!paths.contains(short.name), "{} is a path", short.name);
        assert!(!short.name.contains('.'), "{} may be a key that varies", short.name);
        assert!(names.insert(short.name), "{} is there twice", short.name);
        assert!(of_paths.insert(short.path), "{} has two short names", short.path);
        assert_eq!(known(short.name), known(short.path));
        assert_eq!(known(short.path).name(), short.name);
    }
    // Columns of the table of a sweep that are no figures.
    for column in ["setting", "case", "status", "error"] {
        assert!(!names.contains(column));
    }
    for other in SHORT_NAMES.iter().flat_map(|short| short.also) {
        assert!(!names.contains(other), "{other} is a name, so nobody need be told another");
    }
}

#[test]
fn the_delivery_ratio_counts_what_was_never_sent() {
    let pdr = known("pdr");
    assert_eq!(pdr.path, "kpis.since_start.delivered_of_expected.ratio");
    assert_eq!((pdr.unit, pdr.better), (Some(SHARE), Better::Higher));
    assert_eq!(pdr.null_if.len(), 2, "{:?}", pdr.null_if);
    assert!(pdr.null_if[1].ends_with("as without `[[netsim.app]]`"), "{:?}", pdr.null_if);
}

#[test]
fn unit_and_direction_are_those_of_the_type() {
    let of = |name: &str| (known(name).unit, known(name).better);
    assert_eq!(of("latency"), (Some("s"), Better::Lower));
    assert_eq!(of("throughput"), (Some("bytes/s"), Better::Higher));
    assert_eq!(of("churn"), (Some("1/h"), Better::Lower));
    assert_eq!(of("duty_cycle"), (Some(SHARE), Better::Lower));
    assert_eq!(of("current"), (Some("µA"), Better::Lower));
    assert_eq!(of("lifetime"), (Some("years"), Better::Higher));
    assert_eq!(of("flock_speed"), (Some("m/s"), Better::Higher));
    assert_eq!(of("completed"), (Some(FLAG), Better::Higher));
    assert_eq!(of("steps"), (None, Better::Neither));
    assert_eq!(of("kpis.packets.app.created"), (None, Better::Neither));
    assert_eq!(of("kpis.packets.app.drops_by_reason.x"), (None, Better::Lower));
}

/// `x-better` is text in the types, so a slip of the pen is no error there.
#[test]
fn the_schema_has_no_direction_that_is_none() {
    let generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    let text = generator.into_root_schema_for::<RunSummary>().to_value().to_string();
    let all = text.matches("\"x-better\"").count();
    let known =
        ["higher", "lower"].map(|of| text.matches(&format!("\"x-better\":\"{of}\"")).count());
    assert!(0 < all && all == known.iter().sum::<usize>(), "{all} {known:?}");
}

/// A figure that the type lets be null says when.
#[test]
fn every_figure_has_a_meaning_and_says_when_it_is_null() {
    for metric in metrics() {
        assert!(!metric.meaning.is_empty(), "{}", metric.path);
        assert!(!metric.label.is_empty(), "{}", metric.path);
        let is_never = ["steps", "simulated_s"].contains(&metric.path.as_str());
        assert_eq!(metric.null_if.is_empty(), is_never, "{}", metric.path);
    }
    assert_eq!(known("latency").null_if.len(), 3, "{:?}", known("latency").null_if);
}

#[test]
fn a_name_that_is_none_is_answered_with_the_one_that_is_meant() {
    for (given, meant) in [
        ("network.pdr", "pdr"),
        ("PDR", "pdr"),
        ("packet_delivery_ratio", "pdr"),
        ("task.flok_speed_mps", "task.flock_speed_mps"),
        ("flok_speed", "flock_speed"),
        ("flock_speed_mps", "task.flock_speed_mps"),
        ("polarization", "polarisation"),
        ("delay", "latency"),
        ("latancy", "latency"),
        ("network.flock_speed_mps", "task.flock_speed_mps"),
        ("kpis.delivery.latency_s.meadian", "kpis.delivery.latency_s.median"),
        ("energy", "current"),
    ] {
        assert_eq!(nearest(given), Some(meant), "{given}");
    }
}

#[test]
fn tables_fit_a_terminal_of_80_columns() {
    for text in [table(), explained(&known("pdr")), explained(&known("task.lines"))] {
        for line in text.lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
    let table = table();
    assert!(SHORT_NAMES.iter().all(|short| table.contains(&format!("\n{} ", short.name))));
}
