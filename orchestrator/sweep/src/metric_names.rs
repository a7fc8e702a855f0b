//! The names in `sweep.metrics`: short names, or paths of `summary.json`.

use experiment::Overrides;
use experiment::program_name;
use experiment::sweep::Sweep;
use proto::config::{Node, Problem};
use record::metric::{self, Robots};

/// Names that are no figure, or of a figure that another name has listed before.
pub(crate) fn problems(sweep: &Sweep, robots: Robots) -> Vec<Problem> {
    let names = sweep.metrics.as_deref().unwrap_or_default();
    let problem = |(index, name): (usize, &String)| {
        let wrong = |message: String| {
            Problem::new(format!("sweep.metrics[{index}]"), message).value(format!("{name:?}"))
        };
        if metric::find(name, robots).is_none() {
            let message = format!(
                "must be a short name or a path of summary.json; `{} metrics` lists them",
                program_name()
            );
            let problem = wrong(message);
            return Some(match metric::nearest(name) {
                Some(nearest) => problem.nearest(format!("{nearest:?}")),
                None => problem,
            });
        }
        let path = metric::path_of(name);
        let earlier = names[..index].iter().find(|earlier| metric::path_of(earlier) == path)?;
        Some(wrong(format!("must list each metric only once; {earlier:?} is the same")))
    };
    names.iter().enumerate().filter_map(problem).collect()
}

/// That metrics are of networks with protocols, if any is.
pub(crate) fn of_protocols(sweep: &Sweep) -> Option<String> {
    let names = sweep.metrics.iter().flatten().filter(|name| is_of_protocols(name));
    let names: Vec<&str> = names.map(String::as_str).collect();
    (!names.is_empty()).then(|| {
        format!(
            "sweep.metrics: null in all trials: {}. These are figures of a network with protocols, and netsim.mode =              \"propagation-only\" has none; broadcast_pdr and broadcast_delay are of payloads that robots broadcast",
            names.join(", ")
        )
    })
}

/// Whether a metric is of networks with protocols.
pub(crate) fn is_of_protocols(name: &str) -> bool {
    metric::path_of(name).starts_with("kpis.")
}

/// Whose robot simulator the trials have. `base`: the experiment without what varies.
pub(crate) fn robots(base: &Node, sweep: &Sweep, overrides: &Overrides) -> Robots {
    let keys = ["url", "command"];
    let is_written =
        |key: &&str| base.get("robotsim").is_some_and(|robots| robots.get(key).is_some());
    let cases = sweep.cases.iter().flat_map(|case| case.values.iter().map(|(key, _)| key));
    let mut varied = cases.chain(sweep.lists.iter().map(|(key, _)| key));
    let is_foreign = overrides.robotsim_url.is_some()
        || keys.iter().any(is_written)
        || varied.any(|varied| keys.iter().any(|key| *varied == format!("robotsim.{key}")));
    if is_foreign { Robots::Foreign } else { Robots::BuiltIn }
}

/// The column of a figure: its name in `sweep.metrics`, or else its path.
pub(crate) fn column<'a>(sweep: &'a Sweep, path: &'a str) -> &'a str {
    let names = sweep.metrics.iter().flatten();
    names.map(String::as_str).find(|name| metric::path_of(name) == path).unwrap_or(path)
}
