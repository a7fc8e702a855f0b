//! How long a transaction may take where the scheduling function does not say. RFC 8480, § 3.4.4, leaves it to the
//! scheduling function; this is the rule of the 6TiSCH simulator: the time in which the MAC makes all its attempts with
//! growing back-off, once for every message that is still to come.

use super::Config;
use proto::time::SimDuration;

/// Which side of a transaction waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Who asks.
    Initiator,
    /// Who answers.
    Responder,
}

/// Slotframe · retries · Σ back-off exponents, which grow from 1 to the largest one with each retry; times 1 for a
/// responder and 2 for an initiator, and once more in three steps.
#[must_use]
pub(crate) fn default_for(config: &Config, role: Role, is_three_step: bool) -> SimDuration {
    let (retries, limit) = (u64::from(config.max_retries), u64::from(config.max_be));
    let growing = retries.min(limit);
    let exponents = growing * (growing + 1) / 2 + (retries - growing) * limit;
    let messages = match role {
        Role::Responder => 1,
        Role::Initiator => 2,
    } + u64::from(is_three_step);
    config.slotframe.saturating_mul(retries.saturating_mul(exponents * messages))
}
