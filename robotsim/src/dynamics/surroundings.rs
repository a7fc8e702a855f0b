//! What is around a robot, as far as its motion depends on it.

use proto::ids::AgentId;
use proto::rng::Draws;
use proto::site::Terrain;

/// What is around robots during a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Surroundings<'a> {
    /// The robot's number.
    pub agent: AgentId,
    /// The measured run, where measurements are compared with the model.
    pub run: Option<u32>,
    /// The ground. `None`: it is level.
    pub terrain: Option<&'a Terrain>,
    /// The others, as they were at `others_at_s`.
    pub others: &'a [Other],
    /// When (s) the others were there.
    pub others_at_s: f64,
    /// The measured covariates, where measurements are compared with the model.
    pub columns: Columns<'a>,
    /// Draws for gusts. `None`: there are no gusts.
    pub draws: Option<Draws>,
}

/// Columns of measurements, and the row at which a robot is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Columns<'a> {
    /// Names, and the values row by row; NaN where there is none.
    pub all: &'a [(String, Vec<f64>)],
    /// Index of the row of measurements.
    pub row: usize,
}

impl Columns<'_> {
    /// The value of a column, if it has one.
    #[must_use]
    pub fn value(&self, name: &str) -> Option<f64> {
        let (_, values) = self.all.iter().find(|(known, _)| known == name)?;
        values.get(self.row).copied().filter(|value| !value.is_nan())
    }
}

/// Another robot as an effect sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Other {
    /// Where it was (m).
    pub position_m: [f64; 3],
    /// With which velocity (m/s) it goes on from there.
    pub velocity_mps: [f64; 3],
}

/// All other robots but this one.
pub(super) fn all_but(others: &[(AgentId, Other)], agent: AgentId) -> Vec<Other> {
    others.iter().filter(|(number, _)| *number != agent).map(|(_, other)| *other).collect()
}
