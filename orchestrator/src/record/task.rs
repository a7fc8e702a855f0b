//! What the robots were asked to do, as far as their effective configuration tells.

/// The robots' task. A simulator of a stranger has other keys: then nothing is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Task {
    /// Name of the controller.
    pub controller: Option<String>,
    /// The agent that leads.
    pub leader: Option<usize>,
    /// Speed at which the leader moves (m/s).
    pub leader_speed_mps: Option<f64>,
    /// Its velocity: x, y (m/s).
    pub leader_velocity_mps: Option<[f64; 2]>,
    /// Robots that come closer than this collide (m).
    pub diameter_m: Option<f64>,
    /// The robots know the true state of all others: a baseline that no radio can reach.
    pub is_truth_baseline: bool,
}

impl Task {
    /// Reads the robots' effective configuration.
    pub(crate) fn of(robotsim_toml: &str) -> Self {
        let Ok(config) = robotsim_toml.parse::<toml::Table>() else { return Self::default() };
        let controller = config.get("controller").and_then(toml::Value::as_table);
        let of_controller = |key: &str| controller.and_then(|controller| controller.get(key));
        let kind = of_controller("kind").and_then(toml::Value::as_str);
        let velocity = of_controller("leader_velocity_mps").and_then(toml::Value::as_array);
        let is_leaderless =
            of_controller("leaderless").and_then(toml::Value::as_bool) == Some(true);
        let leads = kind == Some("flocking") && !is_leaderless;
        let number = |value: &toml::Value| {
            value.as_float().or_else(|| value.as_integer().map(|value| value as f64))
        };
        Self {
            controller: kind.map(str::to_owned),
            leader: of_controller("leader")
                .and_then(toml::Value::as_integer)
                .and_then(|leader| usize::try_from(leader).ok())
                .or(leads.then_some(0))
                .filter(|_| leads),
            leader_speed_mps: velocity.filter(|_| leads).map(|components| {
                libm::sqrt(components.iter().filter_map(number).map(|v| v * v).sum())
            }),
            leader_velocity_mps: velocity
                .filter(|_| leads && of_controller("leader_path_m").is_none())
                .and_then(|components| {
                    let [vx, vy] = components.as_slice() else { return None };
                    Some([number(vx)?, number(vy)?])
                }),
            diameter_m: config.get("diameter_m").and_then(number),
            is_truth_baseline: config.get("knowledge").and_then(toml::Value::as_str)
                == Some("truth"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flock_has_a_leader_with_a_speed() {
        let task = Task::of(
            "knowledge = \"truth\"\n[controller]\nkind = \"flocking\"\nleader_velocity_mps = [3, -4.0]",
        );
        assert_eq!((task.leader, task.leader_speed_mps), (Some(0), Some(5.0)));
        assert!(task.is_truth_baseline);
    }

    #[test]
    fn of_a_stranger_nothing_is_known() {
        assert_eq!(Task::of("swarm = 3"), Task::default());
        assert_eq!(Task::of("not toml ="), Task::default());
    }
}
