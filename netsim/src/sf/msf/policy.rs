//! What functions that negotiate cells as MSF does may decide otherwise: how many cells, and where.

use super::MsfConfig;
use crate::mac::CellOptions;
use crate::sf::Context;
use crate::wire::Eui64;
use crate::wire::sixp::SixpCell;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Debug;

/// Decisions of a function that negotiates as [`super::Msf`] does. Each is RFC 9033's unless it is replaced.
pub trait Policy:
    Clone + Debug + PartialEq + Serialize + DeserializeOwned + Send + Sync + 'static
{
    /// Puts free slots in the order in which they are offered to the parent: for cells in which this mote transmits
    /// ([`CellOptions::TX`]) or receives. RFC 9033, § 8: at random.
    fn order_candidates(
        &self,
        cx: &mut Context<'_>,
        _parent: Option<Eui64>,
        _options: CellOptions,
        free: &mut [u16],
    ) {
        cx.dice.shuffle(free);
    }

    /// Puts offered cells that are free here in the order in which they are granted. RFC 9033, § 8: at random.
    fn order_grants(&self, cx: &mut Context<'_>, usable: &mut [SixpCell]) {
        cx.dice.shuffle(usable);
    }

    /// Which cells are offered for deletion, of which the parent chooses `n`. RFC 9033 leaves that open: all, at random.
    fn order_spare(
        &self,
        cx: &mut Context<'_>,
        _parent: Eui64,
        _options: CellOptions,
        _n: usize,
        own: &mut Vec<SixpCell>,
    ) {
        cx.dice.shuffle(own);
    }

    /// How many cells to add and how many to delete, after MAX_NUM_CELLS have elapsed of which `used` carried a frame. `own`:
    /// negotiated cells in this direction. `least`: how many of them stay; with 0 the autonomous cell serves where there are
    /// none. RFC 9033, § 5.1: one at a time.
    fn judge(&self, config: &MsfConfig, used: u64, own: u16, least: u16) -> (u16, u16) {
        let is_busy = u64::from(config.lim_numcellsused_high) < used;
        let is_idle = used < u64::from(config.lim_numcellsused_low);
        (u16::from(is_busy), u16::from(is_idle && least < own))
    }
}

/// The decisions of RFC 9033.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Rfc9033;

impl Policy for Rfc9033 {}
