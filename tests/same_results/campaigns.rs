//! Campaigns with something hidden, small ones, and what is asked about each.

use crate::campaign::{self, Drive, Fleet, Hidden, Layout, RobotHidden, Size};

/// What is measured, and what is hidden in it.
#[derive(Clone, Copy, Debug)]
pub enum Campaign {
    /// Links in the standard layout: seed, rows.
    Links(u64, usize, &'static [(Hidden, Size)]),
    /// Links in a layout drawn from the seed: seed, rows.
    DrawnLinks(u64, usize, &'static [(Hidden, Size)]),
    /// Robots of the kind that shows the first effect: seed, rows.
    Robots(u64, usize, &'static [(RobotHidden, Size)]),
}

impl Campaign {
    /// Draws it.
    #[must_use]
    pub fn draw(self) -> campaign::Campaign {
        match self {
            Self::Links(seed, rows, hidden) => {
                campaign::Campaign::link(seed, &Layout::standard(), hidden, rows)
            }
            Self::DrawnLinks(seed, rows, hidden) => {
                campaign::Campaign::link(seed, &Layout::drawn(seed), hidden, rows)
            }
            Self::Robots(seed, rows, hidden) => {
                let standard = Fleet::standard(Drive::Velocity);
                let fleet = hidden.first().map_or(standard, |(kind, _)| Fleet::showing(*kind));
                campaign::Campaign::robots(seed, &fleet, hidden, rows)
            }
        }
    }
}
