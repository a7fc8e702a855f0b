use super::*;
use crate::counts::Counts;
use proto::rng::{Draws, Purpose};
use proto::site::{Obstacle, Wall};
use proto::types::{AgentStates, Deliveries, MoteStates};

/// A wall from one place to another, up to a height.
fn wall(from_m: [f64; 2], to_m: [f64; 2], height_m: Option<f64>) -> Site {
    let wall = Wall { from_m, to_m, height_m, material: None };
    Site { wall: vec![wall], ..Site::default() }
}

/// A round obstacle of 1 m radius, with a name.
fn cart(centre_m: [f64; 2]) -> Site {
    let name = Some("cart".to_owned());
    let cart = Obstacle { name, centre_m, radius_m: 1.0, height_m: None, material: None };
    Site { obstacle: vec![cart], ..Site::default() }
}

/// Robots of 0.5 m that meet walls and obstacles so.
fn robots(passage: Passage) -> Task {
    Task { diameter_m: Some(0.5), passages: vec![(1, passage)], ..Task::default() }
}

/// Where a robot is, and the obstacle if that moves.
type Moment = ([f64; 3], Option<[f64; 2]>);

/// How often a robot that is at these places at the ends of steps has met something.
fn met(task: &Task, site: &Site, moments: &[Moment]) -> u64 {
    let mut solids = Solids::from_site(site, task).unwrap();
    let states = moments.iter().map(|&([x, y, z], _)| {
        let mut states = AgentStates::at_rest(&[[x, y]]);
        states.z_m[0] = z;
        states
    });
    let states: Vec<AgentStates> = states.collect();
    let (deliveries, motes) = (Deliveries::default(), MoteStates::default());
    let counts = Counts::from_deliveries(&deliveries, 1);
    for (pair, (_, at_m)) in states.windows(2).zip(&moments[1..]) {
        let moved: Vec<MovedObstacle> = at_m
            .iter()
            .map(|&centre_m| MovedObstacle { name: "cart".to_owned(), centre_m })
            .collect();
        let places = [(0, &pair[0]), (1, &pair[1])];
        let mut period = Period::of_places(1, places, (&deliveries, &counts), &motes);
        period.moved_obstacles = &moved;
        solids.add(task, &period, |_, _| {});
    }
    solids.n_met()
}

/// The same of a robot on the ground among what does not move.
fn met_at(site: &Site, places: &[[f64; 2]]) -> u64 {
    let moments: Vec<Moment> = places.iter().map(|&[x, y]| ([x, y, 0.0], None)).collect();
    met(&robots(Passage::Through), site, &moments)
}

#[test]
fn through_a_wall_counts_once_however_fast_and_along_it_never() {
    let site = wall([0.0, -5.0], [0.0, 5.0], None);
    // In steps of 10 cm, two of which end within the wall's reach on either side; then back.
    let slowly: Vec<[f64; 2]> = (-20..=20).map(|k| [0.1 * f64::from(k), 0.0]).collect();
    assert_eq!(met_at(&site, &slowly), 1);
    let back: Vec<[f64; 2]> = slowly.iter().chain(slowly.iter().rev()).copied().collect();
    assert_eq!(met_at(&site, &back), 2);
    assert_eq!(met_at(&site, &[[-1.0, 0.0], [1.0, 0.0]]), 1);
    assert_eq!(met_at(&site, &[[-1e6, 4.9], [1e6, 4.9]]), 1);
    // Touching it all the way, and grazing its end.
    assert_eq!(met_at(&site, &[[0.25, -9.0], [0.25, 0.0], [0.25, 9.0]]), 0);
    assert_eq!(met_at(&site, &[[-1.0, 5.25], [1.0, 5.25]]), 0);
    assert_eq!(met_at(&site, &[[-1.0, 5.24], [1.0, 5.24]]), 1);
    // In it, along it, and out of it.
    assert_eq!(met_at(&site, &[[-1.0, 0.0], [0.2, 0.0], [0.2, 2.0], [1.0, 2.0]]), 1);
    // One that begins there comes to nothing.
    assert_eq!(met_at(&site, &[[0.1, 0.0], [0.2, 0.0]]), 0);
}

#[test]
fn into_a_disc_and_out_of_it_counts_once() {
    let site = cart([0.0, 0.0]);
    let across = |y: f64, way_m: f64| [[-way_m, y], [-0.5, y], [0.5, y], [way_m, y]];
    assert_eq!(met_at(&site, &across(0.0, 2.0)), 1);
    assert_eq!(met_at(&site, &across(1.25, 2.0)), 0);
    assert_eq!(met_at(&site, &[[-2.0, 1.0], [2.0, 1.0]]), 1);
    assert_eq!(met_at(&site, &[[-2.0, 1.25], [2.0, 1.25]]), 0);
    assert_eq!(met_at(&site, &[[-1.25, 0.0], [-2.0, 0.0], [-1.25, 0.0]]), 0);
}

#[test]
fn an_obstacle_that_moves_meets_robots_however_fast_it_is() {
    let (task, site) = (robots(Passage::Through), cart([-10.0, 0.0]));
    let still = |at_m| ([0.0; 3], Some(at_m));
    let begin = ([0.0; 3], None);
    // It runs a robot over that stands there, in one step or in many, and has then stopped on it.
    assert_eq!(met(&task, &site, &[begin, still([10.0, 0.0])]), 1);
    let steps = (-9..=0).map(|k| still([f64::from(k), 0.0]));
    let slowly: Vec<Moment> = [begin].into_iter().chain(steps).chain([begin, begin]).collect();
    assert_eq!(met(&task, &site, &slowly), 1);
    // Passing it by, and going beside it.
    assert_eq!(met(&task, &site, &[begin, still([0.0, 10.0])]), 0);
    let beside = [([-10.0, 1.5, 0.0], None), ([10.0, 1.5, 0.0], Some([10.0, 0.0]))];
    assert_eq!(met(&task, &site, &beside), 0);
    // Their ways cross, and they are at the crossing at one time, or 4 m apart.
    let crossing = [([0.0, -10.0, 0.0], None), ([0.0, 10.0, 0.0], Some([10.0, 0.0]))];
    assert_eq!(met(&task, &site, &crossing), 1);
    let later = [([0.0, -14.0, 0.0], None), ([0.0, 6.0, 0.0], Some([10.0, 0.0]))];
    assert_eq!(met(&task, &site, &later), 0);
}

#[test]
fn what_robots_fly_over_they_do_not_meet() {
    let (task, site) = (robots(Passage::Through), wall([0.0, -5.0], [0.0, 5.0], Some(2.0)));
    let way = |begin_m, end_m| met(&task, &site, &[(begin_m, None), (end_m, None)]);
    assert_eq!(way([-1.0, 0.0, 1.9], [1.0, 0.0, 1.9]), 1);
    assert_eq!(way([-1.0, 0.0, 2.0], [1.0, 0.0, 2.0]), 0);
    // It sinks below 2 m where x = 0.5, beyond the wall's reach of 0.25 m; where x = 0.1; and from above onto it.
    assert_eq!(way([-1.0, 0.0, 3.5], [1.0, 0.0, 1.5]), 0);
    assert_eq!(way([-1.0, 0.0, 3.1], [1.0, 0.0, 1.1]), 1);
    assert_eq!(way([0.0, 0.0, 3.0], [0.0, 0.0, 1.0]), 1);
    // It rises above 2 m where x = −0.5, and where x = −0.1.
    assert_eq!(way([-1.0, 0.0, 1.5], [1.0, 0.0, 3.5]), 0);
    assert_eq!(way([-1.0, 0.0, 1.1], [1.0, 0.0, 3.1]), 1);
}

#[test]
fn of_robots_that_are_held_up_or_jump_only_an_overlap_that_is_left_counts() {
    let site = wall([0.0, -5.0], [0.0, 5.0], None);
    for passage in [Passage::HeldUp, Passage::Jumping] {
        let task = robots(passage);
        let robot_at = |x: f64| ([x, 0.0, 0.0], None);
        assert_eq!(met(&task, &site, &[robot_at(-1.0), robot_at(1.0)]), 0, "{passage:?}");
        assert_eq!(
            met(&task, &site, &[robot_at(-1.0), robot_at(0.1), robot_at(0.2), robot_at(1.0)]),
            1,
            "{passage:?}"
        );
    }
}

#[test]
fn a_robot_that_comes_to_be_in_a_wall_meets_it_and_one_that_waits_does_not() {
    let (task, site) = (robots(Passage::Through), cart([-10.0, 0.0]));
    let mut solids = Solids::from_site(&site, &task).unwrap();
    let present = AgentStates::at_rest(&[[0.0, 0.0]]);
    let mut absent = present.clone();
    absent.alive.set(0, false);
    let (deliveries, motes) = (Deliveries::default(), MoteStates::default());
    let counts = Counts::from_deliveries(&deliveries, 1);
    let arrived = [MovedObstacle { name: "cart".to_owned(), centre_m: [0.0, 0.0] }];
    // The obstacle comes while robots wait: when they start they are in it already.
    let mut held =
        Period::of_places(1, [(0, &present), (1, &present)], (&deliveries, &counts), &motes);
    (held.held, held.moved_obstacles) = (true, &arrived);
    solids.add(&task, &held, |_, _| {});
    let free = Period::of_places(2, [(1, &present), (2, &present)], (&deliveries, &counts), &motes);
    solids.add(&task, &free, |_, _| {});
    assert_eq!(solids.n_met(), 0);
    let mut met = Vec::new();
    for states in [[&present, &absent], [&absent, &present], [&present, &present]] {
        let places = [(2, states[0]), (3, states[1])];
        let period = Period::of_places(3, places, (&deliveries, &counts), &motes);
        solids.add(&task, &period, |robot, n| met.push((robot, n)));
    }
    assert_eq!((solids.n_met(), solids.n_passed()), (1, 1));
    assert_eq!(met, [(0, 1)]);
}

#[test]
fn looking_at_what_is_near_finds_all_there_is() {
    let draws = Draws::new(7, Purpose::Scenario);
    let draw = |entity: u64, k: u64, most: f64| most * draws.uniform(entity, 0, k);
    let mut solids = Vec::new();
    for number in 0..300u64 {
        let from_m = [draw(number, 0, 50.0), draw(number, 1, 50.0)];
        // Walls in all directions, and discs of which some move.
        let end_m = std::array::from_fn(|i| from_m[i] + draw(number, 2 + i as u64, 12.0) - 6.0);
        let line_m = match number % 3 {
            0 => [[from_m, end_m]; 2],
            1 => [[from_m; 2]; 2],
            _ => [[from_m; 2], [end_m; 2]],
        };
        let radius_m = if number % 3 == 0 { 0.0 } else { draw(number, 4, 2.0) };
        solids.push(Solid { line_m, radius_m, height_m: f64::INFINITY });
    }
    let tree = Tree::build(solids.clone(), 0.2);
    let mut n_all = 0;
    for robot in 1000..2000u64 {
        let begin_m = [draw(robot, 0, 50.0), draw(robot, 1, 50.0), 0.0];
        let end_m = std::array::from_fn(|i| begin_m[i] + draw(robot, 2 + i as u64, 4.0) - 2.0);
        let way = Way { begin_m: Some(begin_m), end_m, is_straight: true };
        let n = solids.iter().filter(|solid| way.meets(solid, 0.2)).count() as u64;
        assert_eq!(tree.n_met(way, 0.2), n, "{way:?}");
        n_all += n;
    }
    assert!(500 < n_all, "{n_all}");
}

#[test]
fn where_nothing_is_solid_nothing_is_looked_for() {
    assert!(Solids::from_site(&Site::default(), &robots(Passage::Through)).is_none());
    assert!(Solids::from_site(&cart([0.0, 0.0]), &Task::default()).is_none());
}
