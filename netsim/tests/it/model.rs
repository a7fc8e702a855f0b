//! The full network against plain statements of what it should do.
//!
//! | module | what |
//! |---|---|
//! | [`scenario`] | networks drawn at random: settings, places, faults, moves, traffic |
//! | [`plain`] | a network that looks at everybody in every slot |
//! | [`air`] | what arrives at whom, pair by pair |
//! | [`against_plain`] | the network under test beside the plain one |
//! | [`mac`] | one mote's MAC beside its rules |
//! | [`agreement`] | cells on which two motes have agreed |

mod against_plain;
mod agreement;
mod air;
mod mac;
mod plain;
pub(crate) mod scenario;

use proptest::prelude::ProptestConfig;

/// So many cases in an ordinary run; `PROPTEST_CASES` says otherwise.
fn config(ordinary: u32) -> ProptestConfig {
    let default = ProptestConfig::default();
    let is_asked = std::env::var_os("PROPTEST_CASES").is_some();
    let cases = if is_asked { default.cases } else { ordinary };
    ProptestConfig { cases, failure_persistence: None, ..default }
}
