//! What a search reports while it works. The caller words it, and knows the time.

/// One step of a search.
#[derive(Clone, Debug, PartialEq)]
pub enum SearchProgress<'a> {
    /// A round begins: every candidate is tried on top of what was accepted.
    Round {
        /// From 1.
        round: usize,
    },
    /// A candidate was tried.
    Tried {
        /// The round, from 1.
        round: usize,
        /// Candidates tried in this round, this one included.
        done: usize,
        /// Candidates of the round.
        of: usize,
        /// Name of the candidate.
        name: &'a str,
    },
    /// A candidate was accepted.
    Accepted {
        /// Its name.
        name: &'a str,
    },
    /// A candidate was accepted in place of others.
    Exchanged {
        /// The name of the new one.
        new: &'a str,
        /// The names of those that it replaces.
        old: Vec<&'a str>,
    },
    /// An accepted term was removed: it gains nothing beside what was accepted after it.
    Removed {
        /// Its name.
        name: &'a str,
    },
    /// The search has ended; candidates that are indistinguishable from the accepted ones are collected.
    Ties,
    /// A model of the whole network is being simulated under many seeds.
    Simulating {
        /// Which model, in words.
        what: &'a str,
    },
    /// Campaigns that have an effect are being simulated, and each is tested for it.
    Campaigns {
        /// The parameter that is the size of the effect.
        parameter: &'a str,
        /// Its value.
        value: f64,
        /// How many campaigns.
        campaigns: u64,
    },
}
