//! Where robots were measured: places over time, straight between them.

use input::Reading;
use input::result::ResultFolder;
use measure::DataError;
use measure::ranges::of_column;
use measure::table::DataTable;
use numbers::statistics::median_high;
use proto::types::AgentStates;
use std::fmt::Write as _;
use std::path::Path;

/// The tracks of all robots.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracks {
    /// By agent: times (s), ascending, and places (m).
    of_agent: Vec<Vec<(f64, [f64; 3])>>,
    /// By agent: where it faces in its first place (rad), if that is known.
    faces_rad: Vec<Option<f64>>,
}

impl Tracks {
    /// Reads tracks: a table with `time_s` (or `time_ns`), `agent`, `x_m`, `y_m` and, where they are not 0, `z_m`; or
    /// the folder of a run, which has them in its steps.
    ///
    /// # Errors
    ///
    /// It cannot be read, is none, or is of a result and not what the run wrote.
    pub fn read(path: &Path, reading: impl Into<Reading>) -> Result<Self, DataError> {
        Self::with_table(path, reading.into()).map(|(tracks, _)| tracks)
    }

    /// The same, and the table in which they stand.
    ///
    /// # Errors
    ///
    /// See [`Self::read`].
    pub fn with_table(path: &Path, reading: Reading) -> Result<(Self, DataTable), DataError> {
        let table = if path.is_dir() {
            let run = ResultFolder::open(path, reading)?;
            DataTable::of_result(&run, "steps.parquet", reading.budget)?
        } else {
            DataTable::read(path, reading)?
        };
        let tracks = Self::from_table(&table)
            .map_err(|message| DataError::Format { path: table.path.clone(), message })?;
        Ok((tracks, table))
    }

    /// The tracks of a table.
    ///
    /// # Errors
    ///
    /// It has none, in words for its author.
    pub fn from_table(table: &DataTable) -> Result<Self, String> {
        let column = |name: &str| {
            table.column(name).ok_or_else(|| table.lacking("positions", &[name.to_owned()]))
        };
        let times_s: Vec<f64> = match table.column("time_ns") {
            Some(times_ns) => times_ns.iter().map(|ns| ns * 1e-9).collect(),
            None => column("time_s")?.to_vec(),
        };
        let (agents, x_m, y_m) = (column("agent")?, column("x_m")?, column("y_m")?);
        let (z_m, heading_rad) = (table.column("z_m"), table.column("heading_rad"));
        let mut of_agent: Vec<Vec<(f64, [f64; 3])>> = Vec::new();
        let mut faced: Vec<Option<(f64, f64)>> = Vec::new();
        for (row, &time_s) in times_s.iter().enumerate() {
            let z_m = z_m.map_or(0.0, |z_m| if z_m[row].is_nan() { 0.0 } else { z_m[row] });
            let place = [x_m[row], y_m[row], z_m];
            let agent = agents[row];
            for (name, value) in
                ["time_s", "x_m", "y_m", "z_m"].iter().zip([time_s, place[0], place[1], place[2]])
            {
                let range = of_column(name);
                if value.is_finite() && !range.contains(value) {
                    return Err(format!(
                        "line {}: {name} is {value:?}, but must be {}",
                        table.line(row),
                        range.describe()
                    ));
                }
            }
            let is_agent = agent.fract() == 0.0 && (0.0..1e6).contains(&agent);
            if is_agent && time_s.is_finite() && place.iter().all(|part| part.is_finite()) {
                let agent = agent as usize;
                of_agent.resize(of_agent.len().max(agent + 1), Vec::new());
                of_agent[agent].push((time_s, place));
                let heading_rad = heading_rad.map_or(f64::NAN, |heading_rad| heading_rad[row]);
                faced.resize(of_agent.len(), None);
                if faced[agent].is_none_or(|(first_s, _)| time_s < first_s) {
                    faced[agent] = Some((time_s, heading_rad));
                }
            }
        }
        let known = |faced: Option<(f64, f64)>| faced.map(|(_, rad)| rad).filter(|r| r.is_finite());
        let faces_rad = faced.into_iter().map(known).collect();
        for track in &mut of_agent {
            track.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        if of_agent.is_empty() {
            Err("no row has a position".to_owned())
        } else {
            Ok(Self { of_agent, faces_rad })
        }
    }

    /// Agents of `n` that were never seen.
    #[must_use]
    pub fn unseen(&self, n: usize) -> Vec<u32> {
        let is_unseen = |agent: &usize| self.of_agent.get(*agent).is_none_or(Vec::is_empty);
        (0..n).filter(is_unseen).map(|agent| agent as u32).collect()
    }

    /// One more than the greatest number of an agent.
    #[must_use]
    pub fn n_agents(&self) -> usize {
        self.of_agent.len()
    }

    /// The last time of which every agent that was seen has a place (s).
    #[must_use]
    pub fn until_s(&self) -> f64 {
        let lasts = self.of_agent.iter().filter_map(|track| track.last());
        let last_s = lasts.map(|(at_s, _)| *at_s).fold(f64::INFINITY, f64::min);
        if last_s.is_finite() { last_s } else { 0.0 }
    }

    /// Median time between two places of an agent (s), 0 where no agent has two.
    #[must_use]
    pub fn spacing_s(&self) -> f64 {
        let pairs = self.of_agent.iter().flat_map(|track| track.windows(2));
        let mut spacings_s: Vec<f64> = pairs.map(|pair| pair[1].0 - pair[0].0).collect();
        spacings_s.sort_by(f64::total_cmp);
        if spacings_s.is_empty() { 0.0 } else { median_high(&spacings_s) }
    }

    /// The same from a time on, which becomes 0.
    ///
    /// # Errors
    ///
    /// Some agent has no place after it, in words for its author.
    pub fn since(&self, from_s: f64) -> Result<Self, String> {
        let mut states = AgentStates::at_origin(self.of_agent.len());
        self.place(from_s, &mut states);
        let mut tracks = self.clone();
        for (agent, track) in tracks.of_agent.iter_mut().enumerate() {
            if track.is_empty() {
                continue;
            }
            track.retain(|(at_s, _)| from_s < *at_s);
            track.iter_mut().for_each(|(at_s, _)| *at_s -= from_s);
            if track.is_empty() {
                return Err(format!("agent {agent} has no position after {from_s} s"));
            }
            track.insert(0, (0.0, states.position_m(agent)));
        }
        Ok(tracks)
    }

    /// Others' places at the times of these, each coordinate with an error.
    ///
    /// * `error_m`: by agent, number of the place, axis.
    #[must_use]
    pub fn measured_of(&self, others: &Self, error_m: &dyn Fn(u64, u64, u64) -> f64) -> Self {
        let mut measured = self.clone();
        for (agent, track) in measured.of_agent.iter_mut().enumerate() {
            let mut cursor = 0;
            for (k, (at_s, place)) in track.iter_mut().enumerate() {
                let Some(there) = others.position_at(agent, *at_s, &mut cursor) else { continue };
                *place = blurred(there, &|axis| error_m(agent as u64, k as u64, axis));
            }
        }
        measured
    }

    /// Position of an agent at a time (m), interpolated linearly; `cursor`: how many of its places lie before, for times that ascend.
    fn position_at(&self, agent: usize, time_s: f64, cursor: &mut usize) -> Option<[f64; 3]> {
        let track = self.of_agent.get(agent)?;
        while track.get(*cursor).is_some_and(|(at_s, _)| *at_s <= time_s) {
            *cursor += 1;
        }
        match (cursor.checked_sub(1).map(|k| track[k]), track.get(*cursor)) {
            (Some((from_s, from)), Some((to_s, to))) => {
                let share = (time_s - from_s) / (to_s - from_s);
                Some(std::array::from_fn(|axis| from[axis] + share * (to[axis] - from[axis])))
            }
            (Some((_, only)), None) => Some(only),
            (None, first) => first.map(|(_, only)| *only),
        }
    }

    /// Where agents begin, each coordinate with an error, and nothing more.
    ///
    /// * `error_m`: by agent, axis.
    #[must_use]
    pub fn begin(&self, error_m: &dyn Fn(u64, u64) -> f64) -> Self {
        let mut begin = self.clone();
        for (agent, track) in begin.of_agent.iter_mut().enumerate() {
            track.truncate(1);
            for (_, place) in track {
                *place = blurred(*place, &|axis| error_m(agent as u64, axis));
            }
        }
        begin
    }

    /// Where agents begin, as the file of a scenario `csv`.
    #[must_use]
    pub fn begin_csv(&self) -> String {
        let faces = self.faces_rad.iter().all(Option::is_some);
        let mut text = format!("agent,x_m,y_m,z_m{}\n", if faces { ",heading_rad" } else { "" });
        for (agent, track) in self.of_agent.iter().enumerate() {
            let Some((_, [x_m, y_m, z_m])) = track.first() else { continue };
            let _ = write!(text, "{agent},{x_m},{y_m},{z_m}");
            if let (true, Some(rad)) = (faces, self.faces_rad[agent]) {
                let _ = write!(text, ",{rad}");
            }
            text.push('\n');
        }
        text
    }

    /// Adds where agents are later than at all times so far.
    pub fn push(&mut self, time_s: f64, states: &AgentStates) {
        for (agent, track) in self.of_agent.iter_mut().enumerate().take(states.len()) {
            track.push((time_s, states.position_m(agent)));
        }
    }

    /// Puts agents where they were at a time: before their first place and after their last one, there.
    pub fn place(&self, time_s: f64, states: &mut AgentStates) {
        for agent in 0..self.of_agent.len().min(states.len()) {
            let mut cursor = self.of_agent[agent].partition_point(|(at_s, _)| *at_s <= time_s);
            if let Some(place) = self.position_at(agent, time_s, &mut cursor) {
                [states.x_m[agent], states.y_m[agent], states.z_m[agent]] = place;
            }
        }
    }
}

/// A place measured with errors. Robots in the plane are known to be in it.
fn blurred(place: [f64; 3], error_m: &dyn Fn(u64) -> f64) -> [f64; 3] {
    let [x_m, y_m, z_m] = place;
    [x_m + error_m(0), y_m + error_m(1), if z_m == 0.0 { z_m } else { z_m + error_m(2) }]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_two_places_the_way_is_straight_and_before_and_after_they_stand() {
        let text = "time_s,agent,x_m,y_m\n10,1,0,0\n20,1,10,-20\n0,0,5,5\n";
        let table = DataTable::of_csv(Path::new("p.csv"), text.as_bytes()).unwrap();
        let tracks = Tracks::from_table(&table).unwrap();
        assert_eq!(tracks.unseen(3), [2]);
        let mut states = AgentStates::at_origin(3);
        for (time_s, x_m, y_m) in [(0.0, 0.0, 0.0), (12.5, 2.5, -5.0), (99.0, 10.0, -20.0)] {
            tracks.place(time_s, &mut states);
            assert_eq!((states.x_m[1], states.y_m[1]), (x_m, y_m), "{time_s}");
            assert_eq!((states.x_m[0], states.y_m[0]), (5.0, 5.0));
        }
    }

    #[test]
    fn a_task_begins_between_two_places_and_others_are_measured_at_the_same_times() {
        let text = "time_s,agent,x_m,y_m,heading_rad\n10,0,0,0,0.5\n20,0,10,-20,0.7\n30,0,0,0,0\n";
        let read = |text: &str| {
            let table = DataTable::of_csv(Path::new("p.csv"), text.as_bytes()).unwrap();
            Tracks::from_table(&table).unwrap()
        };
        let since = read(text).since(15.0).unwrap();
        assert_eq!(
            since.of_agent[0],
            [(0.0, [5.0, -10.0, 0.0]), (5.0, [10.0, -20.0, 0.0]), (15.0, [0.0; 3])]
        );
        assert_eq!((since.until_s(), since.spacing_s(), since.n_agents()), (15.0, 10.0, 1));
        let mut begin = since.begin(&|_, axis| axis as f64 + 1.0);
        assert_eq!(begin.begin_csv(), "agent,x_m,y_m,z_m,heading_rad\n0,6,-8,0,0.5\n");
        begin.push(1.0, &AgentStates::at_origin(1));
        assert_eq!(begin.of_agent[0], [(0.0, [6.0, -8.0, 0.0]), (1.0, [0.0; 3])]);
        let others = read("time_s,agent,x_m,y_m\n0,0,0,0\n10,0,100,0\n");
        let seen = since.measured_of(&others, &|_, k, axis| if axis == 0 { k as f64 } else { 0.0 });
        let x_m: Vec<f64> = seen.of_agent[0].iter().map(|(_, place)| place[0]).collect();
        assert_eq!(x_m, [0.0, 51.0, 102.0]);
        assert!(read(text).since(31.0).unwrap_err().contains("agent 0"));
    }
}
