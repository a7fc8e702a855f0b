//! How many lines robots stand in.

use proto::types::AgentStates;

/// How many straight lines in the plane it takes so that every robot that is alive lies within `within_m` of one.
///
/// Greedy: each line goes through the first robot that lies in no line yet and through another such robot. Of these lines the
/// one that covers most such robots is taken; of equal ones the one through the robot with the lowest number. The result may
/// exceed the least number of lines. A single remaining robot counts as one line.
pub(super) fn n_lines(states: &AgentStates, within_m: f64) -> usize {
    let mut left: Vec<[f64; 2]> =
        states.alive.iter_ones().map(|agent| [states.x_m[agent], states.y_m[agent]]).collect();
    let mut n = 0;
    while let Some(&from) = left.first() {
        n += 1;
        let off = |to: [f64; 2], place: [f64; 2]| {
            let (way, apart) = (between(from, to), between(from, place));
            let length = libm::hypot(way[0], way[1]);
            let across = (way[0] * apart[1] - way[1] * apart[0]) / length;
            if length == 0.0 { libm::hypot(apart[0], apart[1]) } else { across.abs() }
        };
        let covers =
            |to: [f64; 2]| left.iter().filter(|&&place| off(to, place) <= within_m).count();
        let mut best = (0, from);
        for &to in &left {
            let n_covered = covers(to);
            if best.0 < n_covered {
                best = (n_covered, to);
            }
        }
        let kept = left.iter().copied().filter(|&place| within_m < off(best.1, place));
        left = kept.collect();
    }
    n
}

fn between(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
    [to[0] - from[0], to[1] - from[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_counted_whatever_their_order_and_small_errors() {
        let mut places = Vec::new();
        for i in 0..20 {
            let along = f64::from(i);
            let error_m = if i % 2 == 0 { 0.02 } else { -0.02 };
            places.push([along, 0.5 * along + error_m]);
            places.push([along, 7.0 - along + error_m]);
            places.push([3.0 + error_m, along - 9.0]);
        }
        assert_eq!(n_lines(&AgentStates::at_rest(&places), 0.1), 3);
        places.reverse();
        assert_eq!(n_lines(&AgentStates::at_rest(&places), 0.1), 3);
        places.truncate(1);
        assert_eq!(n_lines(&AgentStates::at_rest(&places), 0.1), 1);
        assert_eq!(n_lines(&AgentStates::at_rest(&[]), 0.1), 0);
        // Two in one place, and one elsewhere.
        assert_eq!(n_lines(&AgentStates::at_rest(&[[1.0, 1.0], [1.0, 1.0], [5.0, 2.0]]), 0.1), 1);
    }

    #[test]
    fn the_dead_stand_in_no_line_and_who_is_off_is_a_line_by_itself() {
        let mut states = AgentStates::at_rest(&[
            [0.0, 0.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [3.0, 0.0],
            [1.5, 4.0],
            [9.0, 7.0],
        ]);
        assert_eq!(n_lines(&states, 0.1), 2);
        states.alive.set(4, false);
        assert_eq!(n_lines(&states, 0.1), 2);
        states.alive.set(5, false);
        assert_eq!(n_lines(&states, 0.1), 1);
    }
}
