//! Warnings about figures of a task: runs whose figures may look good although the robots failed, or did what no real ones could.

use super::run_summary::TaskSummary;
use metrics::headline::{Better, Headline};
use metrics::task::{Goal, Task};
use numbers::format::{count_of, number};

/// A share so little above its floor is at it.
const AT_FLOOR_RATIO: f64 = 0.05;
/// A length that is better than its floor by less than this share of it is at it.
const AT_FLOOR_SHARE: f64 = 0.05;
/// A length below this (m) is good, whatever its floor: robots that begin in formation have nothing to improve.
const GOOD_M: f64 = 0.1;

/// What to check before the figures of a task are trusted, a sentence each.
pub(super) fn of(task: &Task, summary: &TaskSummary) -> Vec<String> {
    [thrashing(summary), collisions(task, summary), floor(task, summary), false_completion(summary)]
        .into_iter()
        .flatten()
        .collect()
}

/// Robots that move much faster than their flock and their leader.
fn thrashing(task: &TaskSummary) -> Option<String> {
    let speed = |name: &str| Some(format!("{} m/s", number(task.number(name)?)));
    if !task.is_set("thrashing") {
        return None;
    }
    Some(format!(
        "the robots thrash: each moves at {} on average, all together at {} along the direction of their leader, whose speed is \
         {}; task.flock_speed_mps = {} counts oscillation",
        speed("mean_speed_mps")?,
        speed("speed_along_leader_mps")?,
        speed("leader_speed_mps")?,
        speed("flock_speed_mps")?
    ))
}

/// Robots that were in one place, where that is not their goal.
fn collisions(task: &Task, summary: &TaskSummary) -> Option<String> {
    task.headline().filter(|headline| headline.counts_collisions())?;
    let n = summary.number("collisions").filter(|n| 0.0 < *n)?;
    let diameter_m = task.diameter_m?;
    Some(format!(
        "{} between robots: they came closer than robotsim.diameter_m = {} m, as real robots of that size cannot",
        count_of(n as u64, "collision"),
        number(diameter_m)
    ))
}

/// A first figure that robots would have reached that do nothing.
fn floor(task: &Task, summary: &TaskSummary) -> Option<String> {
    let headline = task.headline()?;
    let first = headline.first.iter().find(|shown| shown.of_task().is_some())?;
    let value = summary.number(first.of_task()?)?;
    if task.measured_goal() == Goal::Explore {
        let is_alone = summary.number("map_delay_s").is_none();
        return is_alone.then(|| {
            "the base's map holds nothing that another robot saw: task.mapped_ratio is at its floor"
                .to_owned()
        });
    }
    let floor = summary.number(headline.floor?.strip_prefix("task.")?)?;
    let is_at_floor = match headline.better {
        Better::Greater if first.is_pure() => value < floor + AT_FLOOR_RATIO,
        Better::Greater => value < (1.0 + AT_FLOOR_SHARE) * floor,
        Better::Less => GOOD_M < value && (1.0 - AT_FLOOR_SHARE) * floor < value,
    };
    is_at_floor.then(|| {
        format!(
            "{} = {} is at its floor: {} is {}",
            first.path,
            first.text(value),
            first.text(floor),
            without(headline)
        )
    })
}

/// What reaches the floor.
fn without(headline: &Headline) -> &'static str {
    if headline.goals.contains(&Goal::FollowLeader) {
        "what the leader reaches alone"
    } else if headline.goals.contains(&Goal::Align) {
        "what robots with independent headings reach"
    } else {
        "what robots reach that stay where they start"
    }
}

/// Robots that regard a shape as formed that is not.
fn false_completion(task: &TaskSummary) -> Option<String> {
    task.is_set("false_completion").then(|| {
        "the robots regard their task as done, but do not stand in one shape: task.false_completion"
            .to_owned()
    })
}
