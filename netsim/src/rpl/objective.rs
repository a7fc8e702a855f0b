//! Objective functions: how rank follows from links.

use super::link::Etx;
use super::{mrhof, of0};
use serde::{Deserialize, Serialize};

/// The rank of a mote without a path (RFC 6550, § 17).
pub const INFINITE_RANK: u16 = 0xffff;

/// An objective function and its settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Objective {
    /// Objective function zero: RFC 6552, with the step of rank of RFC 8180, § 5.1.1.
    Of0 {
        /// Factor on the step of rank, 1 to 4 (RFC 6552, § 6.3).
        rank_factor: u8,
        /// Added to the step, 0 to 5.
        stretch: u8,
        /// Links beyond this ETX × 128 are not used.
        max_etx_x128: u16,
        /// A parent is left for one that improves rank by more than this (RFC 8180, § 6.4).
        switch_threshold: u16,
    },
    /// Minimum rank with hysteresis, over ETX: RFC 6719.
    Mrhof {
        /// Links beyond this ETX × 128 are not used (MAX_LINK_METRIC).
        max_link_metric: u16,
        /// Paths beyond this cost are not used (MAX_PATH_COST).
        max_path_cost: u16,
        /// A parent is left for one that improves cost by more than this (PARENT_SWITCH_THRESHOLD).
        switch_threshold: u16,
    },
}

impl Objective {
    /// OF0 as RFC 8180 uses it: factor 1, no stretch, a threshold of 640. Links are used up to an ETX of 3.
    #[must_use]
    pub fn of0() -> Self {
        Self::Of0 { rank_factor: 1, stretch: 0, max_etx_x128: 3 * 128, switch_threshold: 640 }
    }

    /// MRHOF with the values of RFC 6719, § 5.
    #[must_use]
    pub fn mrhof() -> Self {
        Self::Mrhof { max_link_metric: 512, max_path_cost: 32768, switch_threshold: 192 }
    }

    /// The objective code point (RFC 6550, § 20.5).
    #[must_use]
    pub fn code(self) -> u16 {
        match self {
            Self::Of0 { .. } => 0,
            Self::Mrhof { .. } => 1,
        }
    }

    /// The function of a code point with the settings that its RFC recommends; `None` if it is not known here.
    #[must_use]
    pub(crate) fn of_code(code: u16) -> Option<Self> {
        [Self::of0(), Self::mrhof()].into_iter().find(|objective| objective.code() == code)
    }

    /// The rank that a neighbour of rank `rank` over a link of `etx` gives; `None` if it cannot be used.
    #[must_use]
    pub(crate) fn rank_via(self, rank: u16, etx: &Etx, min_hop_rank_increase: u16) -> Option<u16> {
        let via = match self {
            Self::Of0 { rank_factor, stretch, max_etx_x128, .. } => {
                let step = of0::step_of_rank(etx, max_etx_x128)?;
                u32::from(rank)
                    + of0::rank_increase(step, rank_factor, stretch, min_hop_rank_increase)
            }
            Self::Mrhof { max_link_metric, max_path_cost, .. } => {
                mrhof::rank_via(rank, etx, max_link_metric, max_path_cost, min_hop_rank_increase)?
            }
        };
        u16::try_from(via).ok().filter(|&via| rank != INFINITE_RANK && via != INFINITE_RANK)
    }

    /// Whether a link is good enough to be used.
    #[must_use]
    pub fn accepts(self, etx: &Etx) -> bool {
        match self {
            Self::Of0 { max_etx_x128, .. } => of0::step_of_rank(etx, max_etx_x128).is_some(),
            Self::Mrhof { max_link_metric, .. } => !etx.exceeds(max_link_metric),
        }
    }

    /// A parent is left for one that improves rank by more than this.
    #[must_use]
    pub(crate) fn switch_threshold(self) -> u16 {
        match self {
            Self::Of0 { switch_threshold, .. } | Self::Mrhof { switch_threshold, .. } => {
                switch_threshold
            }
        }
    }
}
