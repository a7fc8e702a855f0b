//! Messages about arguments that the program does not take.

use clap::Args;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};

/// The error of a command line, with the tips that help here.
///
/// clap proposes to pass any unknown option as a value, which no command takes. An option that was removed gets a tip of its own.
pub(super) fn with_tips(mut error: Error) -> Error {
    if error.kind() != ErrorKind::UnknownArgument {
        return error;
    }
    let mut tips = match error.remove(ContextKind::Suggested) {
        Some(ContextValue::StyledStrs(tips)) => tips,
        _ => Vec::new(),
    };
    tips.retain(|tip| !tip.to_string().contains("as a value"));
    let usage = error.get(ContextKind::Usage).map(ToString::to_string).unwrap_or_default();
    let option = error.get(ContextKind::InvalidArg).map(ToString::to_string);
    if option.as_deref() == Some("--watch") && usage.contains(" run ") {
        error.remove(ContextKind::SuggestedArg);
        tips.push(StyledStr::from("--live shows the run in a browser"));
    }
    if !tips.is_empty() {
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(tips));
    }
    error
}

/// Reads a whole number from 0 to `MOST`.
pub(super) fn whole_number<const MOST: u64>(text: &str) -> Result<u64, String> {
    let number = text.parse().ok().filter(|&number: &u64| number <= MOST);
    number.ok_or_else(|| format!("must be a whole number from 0 to {MOST}"))
}

/// The greatest seed of an experiment: TOML has signed numbers.
pub(super) const MOST_SEED: u64 = i64::MAX as u64;

/// How many threads a search uses.
#[derive(Args, Clone, Copy)]
pub(super) struct ThreadsArgs {
    /// Number of threads; results do not depend on it [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) threads: Option<u16>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::command;

    /// The message about a command line.
    fn message(line: &str) -> String {
        let words = ["murmuration"].into_iter().chain(line.split(' '));
        with_tips(command().try_get_matches_from(words).unwrap_err()).to_string()
    }

    #[test]
    fn an_option_that_was_removed_leads_to_the_one_that_replaces_it() {
        let removed = message("run x.toml --watch");
        assert!(removed.contains("unexpected argument '--watch'"), "{removed}");
        assert!(removed.contains("tip: --live shows the run in a browser"), "{removed}");
        for line in ["run x.toml --watch", "run x.toml --no-such", "verify runs/x --watch"] {
            let message = message(line);
            assert!(!message.contains("as a value"), "{message}");
            assert!(message.contains("unexpected argument"), "{message}");
        }
        let similar = message("run x.toml --jsn -");
        assert!(similar.contains("'--json'"), "{similar}");
    }

    #[test]
    fn a_seed_that_is_none_is_refused_with_the_range_of_seeds() {
        for seed in ["-3", "1.5", "9223372036854775808", "x"] {
            let refused = message(&format!("run x.toml --seed {seed}"));
            let range = "must be a whole number from 0 to 9223372036854775807";
            assert!(refused.contains(range), "{seed}: {refused}");
        }
        let refused = message("simulate x.toml --like l.csv --output o.csv --seed -3");
        assert!(refused.contains("from 0 to 18446744073709551615"), "{refused}");
    }
}
