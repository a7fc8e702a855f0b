//! Where robots were measured: places over time, straight between them.

use crate::measure::table::Table;
use proto::types::AgentStates;
use std::path::Path;

/// The tracks of all robots.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracks {
    /// By agent: times (s), ascending, and places (m).
    of_agent: Vec<Vec<(f64, [f64; 3])>>,
}

impl Tracks {
    /// Reads tracks: a table with `time_s` (or `time_ns`), `agent`, `x_m`, `y_m` and, where they are not 0, `z_m`; or
    /// the folder of a run, which has them in its steps.
    ///
    /// # Errors
    ///
    /// It cannot be read, or is none, in words for its author.
    pub fn read(path: &Path) -> Result<Self, String> {
        let file = if path.is_dir() { path.join("steps.parquet") } else { path.to_owned() };
        let table = Table::read(&file).map_err(|error| error.to_string())?;
        Self::of(&table).map_err(|error| format!("{}: {error}", file.display()))
    }

    /// The tracks of a table.
    ///
    /// # Errors
    ///
    /// It has none, in words for its author.
    pub fn of(table: &Table) -> Result<Self, String> {
        let column = |name: &str| {
            table.column(name).ok_or_else(|| format!("no positions: the file lacks {name}"))
        };
        let times_s: Vec<f64> = match table.column("time_ns") {
            Some(times_ns) => times_ns.iter().map(|ns| ns * 1e-9).collect(),
            None => column("time_s")?.to_vec(),
        };
        let (agents, x_m, y_m) = (column("agent")?, column("x_m")?, column("y_m")?);
        let z_m = table.column("z_m");
        let mut of_agent: Vec<Vec<(f64, [f64; 3])>> = Vec::new();
        for (row, &time_s) in times_s.iter().enumerate() {
            let z_m = z_m.map_or(0.0, |z_m| if z_m[row].is_nan() { 0.0 } else { z_m[row] });
            let place = [x_m[row], y_m[row], z_m];
            let agent = agents[row];
            let is_agent = agent.fract() == 0.0 && (0.0..1e6).contains(&agent);
            if is_agent && time_s.is_finite() && place.iter().all(|part| part.is_finite()) {
                let agent = agent as usize;
                of_agent.resize(of_agent.len().max(agent + 1), Vec::new());
                of_agent[agent].push((time_s, place));
            }
        }
        for track in &mut of_agent {
            track.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        if of_agent.is_empty() {
            Err("no row has a place".to_owned())
        } else {
            Ok(Self { of_agent })
        }
    }

    /// Agents of `n` that were never seen.
    #[must_use]
    pub fn unseen(&self, n: usize) -> Vec<u32> {
        let is_unseen = |agent: &usize| self.of_agent.get(*agent).is_none_or(Vec::is_empty);
        (0..n).filter(is_unseen).map(|agent| agent as u32).collect()
    }

    /// Puts agents where they were at a time: before their first place and after their last one, there.
    pub fn place(&self, time_s: f64, states: &mut AgentStates) {
        for (agent, track) in self.of_agent.iter().take(states.len()).enumerate() {
            let after = track.partition_point(|(at_s, _)| *at_s <= time_s);
            let place = match (after.checked_sub(1).map(|k| track[k]), track.get(after)) {
                (Some((from_s, from)), Some((to_s, to))) => {
                    let share = (time_s - from_s) / (to_s - from_s);
                    [0, 1, 2].map(|k| from[k] + share * (to[k] - from[k]))
                }
                (Some((_, only)), None) => only,
                (None, Some((_, only))) => *only,
                (None, None) => continue,
            };
            [states.x_m[agent], states.y_m[agent], states.z_m[agent]] = place;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_two_places_the_way_is_straight_and_before_and_after_they_stand() {
        let text = "time_s,agent,x_m,y_m\n10,1,0,0\n20,1,10,-20\n0,0,5,5\n";
        let table = Table::of_csv(Path::new("p.csv"), text.as_bytes()).unwrap();
        let tracks = Tracks::of(&table).unwrap();
        assert_eq!(tracks.unseen(3), [2]);
        let mut states = AgentStates::at_origin(3);
        for (time_s, x_m, y_m) in [(0.0, 0.0, 0.0), (12.5, 2.5, -5.0), (99.0, 10.0, -20.0)] {
            tracks.place(time_s, &mut states);
            assert_eq!((states.x_m[1], states.y_m[1]), (x_m, y_m), "{time_s}");
            assert_eq!((states.x_m[0], states.y_m[0]), (5.0, 5.0));
        }
    }
}
