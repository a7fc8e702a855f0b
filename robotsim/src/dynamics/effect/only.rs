//! Effects that act on some robots only, or at some times: the table `only` of a `[[robotsim.dynamics.effect]]`.

use super::{Common, Drive, Effect, Localization, Part, Pendulum, Shape, Situation, formula};
use proto::config::{Problem, Section};
use proto::effect::Named;
use proto::effect::only::{self, MOST_ENTRIES, Span};

/// The robots and times at which an effect acts: all keys given must hold.
#[derive(Section)]
pub(super) struct Keys {
    /// Numbers of the robots on which the effect acts.
    #[key(length = 1..=MOST_ENTRIES)]
    agents: Option<Vec<u32>>,
    #[key(flatten)]
    span: Span,
    /// Condition on the robot, such as "commanded_speed_mps > 1 and x_m < 5". It compares expressions by < <= > >= == !=, joined by and,
    /// or, not, and uses the names of the effect formula (time_s, x_m, speed_mps, heading_rad, …), agent, commanded_speed_mps,
    /// commanded_turn (yaw rate in rad/s or steering in rad), commanded_direction_rad and columns of the measurements. The effect does
    /// not act where a missing value decides.
    #[key(name = "where")]
    condition: Option<String>,
}

/// What a condition is asked about.
#[derive(Clone, Copy, Debug)]
pub(in crate::dynamics) struct Moment<'a> {
    /// The robot and what is around it.
    pub(in crate::dynamics) at: Situation<'a>,
    /// How it is commanded.
    pub(in crate::dynamics) shape: Shape,
    /// The last command, whether it acts already or not. `None`: it is not a motion, but an acceleration.
    pub(in crate::dynamics) command: Option<Drive>,
}

/// Reads a number that stays between two commands.
type ReadCommand = fn(&Moment<'_>) -> Option<f64>;

/// Reads a number off a robot.
#[derive(Clone, Copy, Debug)]
enum Read {
    /// As the effect formula does. It changes as the robot moves or time passes.
    Situation(fn(&Situation<'_>) -> f64),
    /// What stays between two commands.
    Command(ReadCommand),
}

/// Names that a condition may use beside those of the effect formula, and the bodies that have them.
const NAMES: [(&str, ReadCommand, Has); 4] = [
    ("agent", |moment| Some(f64::from(moment.at.surroundings.agent.0)), Has::Any),
    (
        "commanded_speed_mps",
        |moment| {
            let [x, y, z] = moment.command?;
            Some(if moment.shape.is_turning() { x } else { libm::sqrt(x * x + y * y + z * z) })
        },
        Has::Commanded,
    ),
    ("commanded_turn", |moment| Some(moment.command?[1]), Has::Turning),
    (
        "commanded_direction_rad",
        |moment| {
            let [x, y, _] = moment.command?;
            (x != 0.0 || y != 0.0).then(|| libm::atan2(y, x))
        },
        Has::Velocity,
    ),
];

/// Which bodies have a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Has {
    Any,
    /// Those that are commanded by a motion.
    Commanded,
    /// Those that are commanded to turn.
    Turning,
    /// Those that are commanded by a velocity.
    Velocity,
}

fn names() -> Vec<(&'static str, Read)> {
    let of_formula = formula::NAMES.iter().map(|&(name, read)| (name, Read::Situation(read)));
    of_formula.chain(NAMES.map(|(name, read, _)| (name, Read::Command(read)))).collect()
}

/// Reads the table `only` of a checked effect that stands at `path`, if it has one without problems.
fn read(effect: &toml::Table, path: &str, problems: &mut Vec<Problem>) -> Option<only::Only<Read>> {
    let Keys { agents, span, condition } = Common::read(effect).only?;
    let limits = only::Limits { members: ("agents", agents), span, condition };
    only::read(limits, path, &names(), problems)
}

/// Adds what is wrong with the table `only` of a checked effect that stands at `path`.
pub(super) fn check(effect: &toml::Table, path: &str, problems: &mut Vec<Problem>) {
    read(effect, path, problems);
}

/// A table `only` as a program writes it, checked. `path`: of the effect, for problems.
pub fn checked(limits: &toml::Table, path: &str, problems: &mut Vec<Problem>) -> toml::Table {
    only::checked(limits, &Keys::SPEC, check, path, problems)
}

/// The effect where its checked table limits it, and as it is where not. Nothing where the limits are wrong.
pub(super) fn limited(effect: Box<dyn Effect>, table: &toml::Table) -> Option<Box<dyn Effect>> {
    if !table.contains_key(only::KEY) {
        return Some(effect);
    }
    let only = read(table, "", &mut Vec::new())?;
    Some(Box::new(Limited { effect, limits: Limits(only) }))
}

/// Adds a problem for every effect of `tables` that is limited by what a simulation does not have: runs and columns of
/// measurements. They stand at `path[0]`, `path[1]`, …
pub(crate) fn refuse_measured(tables: &[&toml::Table], path: &str, problems: &mut Vec<Problem>) {
    only::refuse_runs(tables.iter().copied(), path, problems);
    for (index, table) in tables.iter().enumerate() {
        let columns = columns(table);
        if !columns.is_empty() {
            let message = format!(
                "must not use {} in a simulation, which has no columns of measurements; remove the condition to simulate the effect",
                columns.join(", ")
            );
            problems.push(Problem::new(format!("{path}[{index}].only.where"), message));
        }
    }
}

/// Columns of measurements that the table `only` of an effect names.
#[must_use]
pub fn columns(effect: &toml::Table) -> Vec<String> {
    let names = names();
    let effect = only::checked_within(effect, &Keys::SPEC);
    let only = read(&effect, "", &mut Vec::new());
    let is_column = |name: &&String| !names.iter().any(|(known, _)| known == name);
    only.iter().flat_map(|only| only.names().iter().filter(is_column)).cloned().collect()
}

/// What limits an effect.
#[derive(Debug)]
pub struct Limits(only::Only<Read>);

impl Limits {
    /// Whether the effect acts at a moment.
    pub(in crate::dynamics) fn allow(&self, moment: &Moment<'_>) -> bool {
        let Self(only) = self;
        let around = moment.at.surroundings;
        let read = |read: &Read| match read {
            Read::Situation(read) => Some(read(&moment.at)),
            Read::Command(read) => read(moment),
        };
        only.concerns(&[around.agent.0])
            && only.acts_in(around.run)
            && only.acts_at(moment.at.time_s)
            && only.holds(read, |column| around.columns.value(column))
    }

    /// The first time (s) after `time_s` at which the effect begins or ceases to act for good.
    pub(in crate::dynamics) fn next_change_s(&self, time_s: f64) -> f64 {
        self.0.next_change_s(time_s)
    }

    /// Whether it may begin or cease to act at any time, as the robot moves or time passes.
    pub(in crate::dynamics) fn vary_on_the_way(&self) -> bool {
        let of_formula = |name: &String| formula::NAMES.iter().any(|(known, _)| known == name);
        self.0.names().iter().any(of_formula)
    }

    /// The name of its condition, if there is one, that a body does not have.
    pub(in crate::dynamics) fn unknown_to(&self, shape: Shape, is_inertial: bool) -> Option<&str> {
        let has = |has: Has| match has {
            Has::Any => true,
            Has::Commanded => !is_inertial,
            Has::Turning => shape.is_turning(),
            Has::Velocity => !is_inertial && !shape.is_turning(),
        };
        let lacks = |name: &&String| {
            NAMES.iter().any(|&(known, _, needed)| known == name.as_str() && !has(needed))
        };
        self.0.names().iter().find(lacks).map(String::as_str)
    }
}

/// An effect that acts on some robots only, or at some times.
///
/// # Model
///
/// That of the effect while all keys of its table hold, and nothing otherwise. [`Physics`](crate::dynamics::physics::Physics) asks the
/// limits, so that what has no situation of its own, such as a lag, is limited as well.
#[derive(Debug)]
struct Limited {
    effect: Box<dyn Effect>,
    limits: Limits,
}

impl Named for Limited {
    fn name(&self) -> &'static str {
        self.effect.name()
    }
}

impl Effect for Limited {
    fn limits(&self) -> Option<&Limits> {
        Some(&self.limits)
    }

    fn delay_s(&self, part: Part) -> f64 {
        self.effect.delay_s(part)
    }

    fn shape(&self, shape: Shape, demand: Drive) -> Drive {
        self.effect.shape(shape, demand)
    }

    fn lag_s(&self, part: Part) -> f64 {
        self.effect.lag_s(part)
    }

    fn limit_per_s(&self, part: Part) -> f64 {
        self.effect.limit_per_s(part)
    }

    fn course_rad(&self) -> f64 {
        self.effect.course_rad()
    }

    fn sideways_s(&self) -> f64 {
        self.effect.sideways_s()
    }

    fn slowdown_s(&self) -> f64 {
        self.effect.slowdown_s()
    }

    fn ground_scale(&self, from_m: [f64; 3], to_m: [f64; 3]) -> f64 {
        self.effect.ground_scale(from_m, to_m)
    }

    fn drift_mps(&self, at: &Situation<'_>) -> [f64; 3] {
        self.effect.drift_mps(at)
    }

    fn thrust_gain(&self, at: &Situation<'_>) -> f64 {
        self.effect.thrust_gain(at)
    }

    fn thrust_gains(&self) -> [f64; 2] {
        self.effect.thrust_gains()
    }

    fn tilt_rad(&self) -> [f64; 2] {
        self.effect.tilt_rad()
    }

    fn force_mps2(&self, at: &Situation<'_>) -> [f64; 3] {
        self.effect.force_mps2(at)
    }

    fn most_force_mps2(&self) -> f64 {
        self.effect.most_force_mps2()
    }

    fn load(&self) -> Option<Pendulum> {
        self.effect.load()
    }

    fn drifts(&self) -> bool {
        self.effect.drifts()
    }

    fn varies_on_the_way(&self) -> bool {
        self.effect.varies_on_the_way()
    }

    fn is_uniform(&self, position_m: [f64; 3], reach_m: f64) -> bool {
        self.effect.is_uniform(position_m, reach_m)
    }

    fn force_varies(&self) -> bool {
        self.effect.force_varies()
    }

    fn heeds_others(&self) -> bool {
        self.effect.heeds_others()
    }

    fn localization(&self) -> Option<Localization> {
        self.effect.localization()
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use super::columns;
    use crate::catalogue::Catalogue;
    use crate::dynamics::Dynamics;
    use crate::dynamics::body::Drive;
    use crate::dynamics::physics::{Order, Physics, Robot};
    use crate::dynamics::surroundings::{Columns, Surroundings};
    use proto::ids::AgentId;

    /// Where a robot comes to from the origin within 4 s under commands, each from its time (s) on.
    fn end(physics: &Physics, orders: &[(f64, Drive)], around: &Surroundings<'_>) -> Robot {
        let orders: Vec<Order> =
            orders.iter().map(|&(from_s, demand)| Order { from_s, demand }).collect();
        let mut robot = Robot::default();
        let mut next = 0;
        // Steps of a run, which are no multiples of what changes.
        for step in 0..16 {
            let [from_s, until_s] = [step, step + 1].map(|n| 0.25 * f64::from(n));
            physics.advance(&mut robot, &orders, &mut next, from_s, until_s, around);
        }
        robot
    }

    fn x_m(text: &str, orders: &[(f64, Drive)], around: &Surroundings<'_>) -> f64 {
        end(&physics(text), orders, around).position_m[0]
    }

    const EAST: &[(f64, Drive)] = &[(0.0, [1.0, 0.0, 0.0])];
    const NOTHING: Surroundings<'static> = Surroundings {
        agent: AgentId(0),
        run: None,
        terrain: None,
        others: &[],
        others_at_s: 0.0,
        columns: Columns { all: &[], row: 0 },
        draws: None,
    };

    #[test]
    fn robots_and_runs_that_are_not_listed_move_as_without_it() {
        let text = "[[effect]]\nkind = 'slip'\nscale = 0.5\nonly = { agents = [3, 1], runs = [2] }";
        for (agent, run, expected_m) in [
            (3, Some(2), 2.0),
            (1, Some(2), 2.0),
            (2, Some(2), 4.0),
            (3, Some(1), 4.0),
            (3, None, 4.0),
        ] {
            let around = Surroundings { agent: AgentId(agent), run, ..NOTHING };
            assert_eq!(x_m(text, EAST, &around), expected_m, "{agent} {run:?}");
        }
    }

    #[test]
    fn it_begins_and_ends_at_its_times() {
        let slip = "[[effect]]\nkind = 'slip'\nscale = 0.5\nonly = { from_s = 1.1, until_s = 2.3 }";
        // 1.2 s at half the speed.
        assert!((x_m(slip, EAST, &NOTHING) - 3.4).abs() < 1e-12);
        // What has no situation of its own is limited, too: 1.3 s of a lag from rest, then at once.
        let lag = "[[effect]]\nkind = 'actuator-lag'\ntau_s = 0.5\nonly = { until_s = 1.3 }";
        let behind_m = 0.5 * (1.0 - (-2.6f64).exp());
        assert!((x_m(lag, EAST, &NOTHING) - (4.0 - behind_m)).abs() < 1e-12);
        let late = "[[effect]]\nkind = 'dead-time'\ndelay_s = 1.0\nonly = { agents = [1] }";
        assert_eq!(x_m(late, EAST, &NOTHING), 4.0);
        assert_eq!(x_m(late, EAST, &Surroundings { agent: AgentId(1), ..NOTHING }), 3.0);
    }

    #[test]
    fn a_condition_may_ask_for_the_command_the_place_and_columns() {
        let limited = |only: &str| format!("[[effect]]\nkind = 'slip'\nscale = 0.5\nonly = {only}");
        let orders = [(0.0, [1.0, 0.0, 0.0]), (1.1, [3.0, 0.0, 0.0]), (2.1, [1.0, 0.0, 0.0])];
        let fast = limited("{ where = 'commanded_speed_mps > 1' }");
        assert!((x_m(&fast, &orders, &NOTHING) - (1.1 + 1.5 + 1.9)).abs() < 1e-12);
        // From x = 2 on, found within 10 ms at 1 m/s.
        let far = limited("{ where = 'x_m >= 2' }");
        assert!((x_m(&far, EAST, &NOTHING) - 3.0).abs() < 0.011);
        let warm = limited("{ where = 'temperature_c > 30' }");
        let all = [("temperature_c".to_owned(), vec![31.0, 30.0, f64::NAN])];
        for (row, expected_m) in [(0, 2.0), (1, 4.0), (2, 4.0)] {
            let around = Surroundings { columns: Columns { all: &all, row }, ..NOTHING };
            assert_eq!(x_m(&warm, EAST, &around), expected_m);
        }
        assert_eq!(x_m(&limited("{ where = 'agent == 0' }"), EAST, &NOTHING), 2.0);
        let east = limited("{ where = 'abs(commanded_direction_rad) < 0.1' }");
        assert_eq!(x_m(&east, EAST, &NOTHING), 2.0);
        let north = end(&physics(&east), &[(0.0, [0.0, 1.0, 0.0])], &NOTHING);
        assert_eq!(north.position_m[1], 4.0);
        let turning = format!("kind = 'unicycle'\n{}", limited("{ where = 'commanded_turn > 0' }"));
        let around = |turn: f64| end(&physics(&turning), &[(0.0, [1.0, turn, 0.0])], &NOTHING);
        let (left, right) = (around(0.5).position_m, around(-0.5).position_m);
        assert!((2.0 * left[0] - right[0]).abs() < 1e-12, "{left:?} {right:?}");
        let table = "only = { where = 'temperature_c > 30 and agent == 1' }".parse().unwrap();
        assert_eq!(columns(&table), ["temperature_c"]);
    }

    #[test]
    fn several_effects_of_one_kind_act_each_on_its_own_robots() {
        let text = "[[effect]]\nkind = 'speed-limit'\nlimit_mps = 0.5\nonly = { agents = [1] }\n\
                    [[effect]]\nkind = 'speed-limit'\nlimit_mps = 0.25\nonly = { agents = [2] }\n\
                    [[effect]]\nkind = 'actuator-lag'\ntau_s = 0.5\nonly = { agents = [3] }\n\
                    [[effect]]\nkind = 'actuator-lag'\ntau_s = 1.0\nonly = { agents = [4] }";
        let behind_m = |tau_s: f64| tau_s * (1.0 - (-4.0 / tau_s).exp());
        let expected_m = [4.0, 2.0, 1.0, 4.0 - behind_m(0.5), 4.0 - behind_m(1.0)];
        for (agent, expected_m) in (0..).map(AgentId).zip(expected_m) {
            let reached_m = x_m(text, EAST, &Surroundings { agent, ..NOTHING });
            assert!((reached_m - expected_m).abs() < 1e-12, "{agent}: {reached_m}");
        }
    }

    #[test]
    fn an_effect_that_always_acts_is_the_effect_without_limits() {
        let body = "kind = 'unicycle'\n";
        let effects = |only: &str| {
            format!(
                "{body}[[effect]]\nkind = 'actuator-lag'\ntau_s = 0.3\n{only}\n\
                 [[effect]]\nkind = 'slip'\nscale = 0.9\n{only}\n\
                 [[effect]]\nkind = 'heading-bias'\nangle_rad = 0.1\n{only}\n\
                 [[effect]]\nkind = 'wind'\nvelocity_mps = [0.1, 0.2, 0.0]\n{only}"
            )
        };
        let orders = [(0.0, [1.0, 0.3, 0.0]), (1.5, [2.0, -0.4, 0.0])];
        let plain = end(&physics(&effects("")), &orders, &NOTHING);
        let always = end(&physics(&effects("only = { agents = [0] }")), &orders, &NOTHING);
        let near =
            plain.position_m.iter().zip(always.position_m).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(near, "{plain:?} {always:?}");
        let never = end(&physics(&effects("only = { agents = [9] }")), &orders, &NOTHING);
        assert_eq!(never, end(&physics(body), &orders, &NOTHING));
        assert!(!physics(&effects("only = { where = 'x_m > 0' }")).is_alike_everywhere());
    }

    /// What is wrong with a `[dynamics]` of these keys.
    fn problems(text: &str) -> String {
        let mut problems = Vec::new();
        let node = proto::config::parse(text).unwrap();
        let (spec, catalogue) = (&crate::dynamics::SPEC, Catalogue::built_in());
        let lists = catalogue.lists();
        let table = proto::config::check(&node, "dynamics", spec, &lists, &mut problems).table;
        if problems.is_empty() {
            Dynamics::build(&table, "dynamics", &catalogue.effects, &mut problems);
        }
        problems.iter().map(|problem| format!("{problem}\n")).collect()
    }

    #[test]
    fn what_is_wrong_with_it_is_refused_at_its_place() {
        for (body, only, expected) in [
            (
                "point-mass",
                "{ nodes = [1] }",
                "only.nodes: is not a known key (nearest valid: agents)",
            ),
            ("point-mass", "{ runs = [] }", "only.runs: must have 1 to 10000 entries, got []"),
            (
                "point-mass",
                "{ from_s = 5, until_s = 5 }",
                "only.until_s: must be greater than from_s = 5, got 5",
            ),
            (
                "point-mass",
                "{ where = 'comanded_speed_mps > 1' }",
                "only.where: unknown name comanded_speed_mps; did you mean commanded_speed_mps?",
            ),
            (
                "point-mass",
                "{ where = 'commanded_turn > 1' }",
                "only.where: must not use commanded_turn, which this kind of body does not have",
            ),
            (
                "double-integrator",
                "{ where = 'commanded_speed_mps > 1' }",
                "only.where: must not use commanded_speed_mps, which this kind of body does not have",
            ),
            (
                "car",
                "{ where = 'commanded_direction_rad > 1' }",
                "only.where: must not use commanded_direction_rad",
            ),
        ] {
            let text =
                format!("kind = '{body}'\n[[effect]]\nkind = 'slip'\nscale = 0.5\nonly = {only}");
            let problems = problems(&text);
            let expected = format!("dynamics.effect[0].{expected}");
            assert!(problems.starts_with(&expected), "{only}: {problems}");
        }
    }
}
