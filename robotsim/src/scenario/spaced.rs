//! At random, but not too close.

use super::{Entry, LENGTH, Place, Scenario};
use proto::config::{Section, variant};
use proto::ids::AgentId;
use proto::rng::{Draws, uniform};

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Spaced>("spaced"),
    build: |table, context, problems| {
        let this = Spaced::read(table);
        // Discs of half the distance, of which random placing fills 0.547 of the plane at most; half of that leaves room.
        let area_m2 = (this.side_m + this.min_distance_m) * (this.side_m + this.min_distance_m);
        let disc_m2 = std::f64::consts::PI / 4.0 * this.min_distance_m * this.min_distance_m;
        let filled = context.n_agents as f64 * disc_m2 / area_m2;
        if MOST_FILLED < filled {
            let fits = libm::sqrt(MOST_FILLED / filled) * this.min_distance_m;
            problems.push(
                context
                    .problem(
                        "min_distance_m",
                        format!(
                            "must be smaller, or the square larger: {} robots at this distance do not fit in a square of {} m",
                            context.n_agents, this.side_m
                        ),
                    )
                    .value(format!("{} m", this.min_distance_m))
                    .nearest(format!("{:.3} m", 0.95 * fits)),
            );
        }
        Some(Box::new(this))
    },
};

/// Share of the plane that may be filled: half the saturation density of random sequential addition of discs (Feder 1980).
const MOST_FILLED: f64 = 0.27;

/// At random in a square around the origin, with a minimum distance between robots.
///
/// One after another, each uniform in the square, drawn again while it is too close to one before (random sequential
/// addition). A robot's place depends on those of lower number alone.
#[derive(Debug, Section)]
struct Spaced {
    /// Side of the square (m).
    #[key(kind = LENGTH)]
    side_m: f64,
    /// Minimum distance between robots (m).
    #[key(kind = LENGTH)]
    min_distance_m: f64,
}

impl Spaced {
    /// Where `agent` begins, after those before it.
    fn next(&self, agent: AgentId, before: &[Place], draws: Draws) -> Place {
        let mut attempt = 0;
        loop {
            let [a, b, ..] = draws.words(u64::from(agent.0), 0, attempt);
            let [x_m, y_m] = [a, b].map(|word| self.side_m * (uniform(word) - 0.5));
            let is_free = before.iter().all(|place| {
                let [x, y, _] = place.position_m;
                self.min_distance_m <= libm::hypot(x - x_m, y - y_m)
            });
            // There is room: the configuration was checked.
            if is_free || attempt == MOST_ATTEMPTS {
                return Place { position_m: [x_m, y_m, 0.0], heading_rad: None };
            }
            attempt += 1;
        }
    }
}

/// With a quarter of the plane filled and three quarters of it barred, a place is found in four attempts on average.
const MOST_ATTEMPTS: u64 = 1_000_000;

impl Scenario for Spaced {
    fn place(&self, agent: AgentId, _n_agents: usize, draws: Draws) -> Place {
        self.places(agent.index() + 1, draws).pop().unwrap_or_default()
    }

    fn places(&self, n_agents: usize, draws: Draws) -> Vec<Place> {
        let mut places = Vec::with_capacity(n_agents);
        for agent in AgentId::first(n_agents) {
            let next = self.next(agent, &places, draws);
            places.push(next);
        }
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::Purpose;

    #[test]
    fn nobody_is_too_close_and_the_first_stay_where_they_are() {
        let spaced = Spaced { side_m: 20.0, min_distance_m: 1.2 };
        let draws = Draws::new(3, Purpose::Scenario);
        let places = spaced.places(100, draws);
        for (i, a) in places.iter().enumerate() {
            assert!(a.position_m.iter().all(|x| x.abs() <= 10.0));
            for b in &places[..i] {
                let [x, y, _] = a.position_m;
                assert!(1.2 <= (x - b.position_m[0]).hypot(y - b.position_m[1]));
            }
        }
        assert_eq!(spaced.places(40, draws), places[..40]);
        assert_eq!(spaced.place(AgentId(39), 100, draws), places[39]);
    }
}
