//! Messages about arguments that the program does not take.

use super::command;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};
use clap::{Args, Command};
use proto::config::most_similar;

/// The error of a command line, with the tips that help here.
///
/// clap proposes to pass any unknown option as a value, which no command takes. An option that was removed gets a tip of its own, and so
/// does a word that is no command.
pub(super) fn with_tips(mut error: Error) -> Error {
    let tips = match error.kind() {
        ErrorKind::UnknownArgument => of_argument(&mut error),
        ErrorKind::InvalidSubcommand => of_command(&mut error),
        _ => return error,
    };
    if !tips.is_empty() {
        let tips = tips.into_iter().map(StyledStr::from).collect();
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(tips));
    }
    error
}

fn of_argument(error: &mut Error) -> Vec<String> {
    let mut tips: Vec<String> = match error.remove(ContextKind::Suggested) {
        Some(ContextValue::StyledStrs(tips)) => tips.iter().map(ToString::to_string).collect(),
        _ => Vec::new(),
    };
    tips.retain(|tip| !tip.contains("as a value"));
    let usage = error.get(ContextKind::Usage).map(ToString::to_string).unwrap_or_default();
    let option = error.get(ContextKind::InvalidArg).map(ToString::to_string);
    if option.as_deref() == Some("--watch") && usage.contains(" run ") {
        error.remove(ContextKind::SuggestedArg);
        tips.push("--live shows the run in a browser".to_owned());
    }
    tips
}

/// Words that people try as commands, and what does it.
const NO_COMMANDS: [(&[&str], &str); 6] = [
    (
        &["report", "reports"],
        "`run` and `sweep` write report.html into the folder of their results; `compare` and `diagnose` write a page with --report FILE",
    ),
    (
        &["plot", "plots", "draw", "graph", "chart", "figures", "video"],
        "`figure` draws figures of runs, sweeps and answers, `render` a recorded run from above, `effects NAME --svg FILE` an effect",
    ),
    (
        &["view", "show", "watch", "list", "ls"],
        "`open` lists the results of a folder in a browser, `replay` shows a recorded run, and `run --live` one that runs",
    ),
    (
        &["validate", "lint", "info", "describe"],
        "`check` checks an experiment, and `check --data FILE` measurements",
    ),
    (
        &["fit", "calibrate"],
        "`extend` fits an effect to measurements, and `diagnose` searches for one",
    ),
    (&["init", "create"], "`new` writes a starter experiment"),
];

/// What to do in place of a word that is no command.
fn of_command(error: &mut Error) -> Vec<String> {
    let word = error.get(ContextKind::InvalidSubcommand).map(ToString::to_string);
    let word = word.unwrap_or_default().to_lowercase();
    error.remove(ContextKind::SuggestedSubcommand);
    error.remove(ContextKind::Suggested);
    if let Some((_, tip)) = NO_COMMANDS.iter().find(|(words, _)| words.contains(&&*word)) {
        return vec![(*tip).to_owned()];
    }
    let program = command();
    let names = program.get_subcommands().filter(|it| !it.is_hide_set()).map(Command::get_name);
    match most_similar(&word, names) {
        Some(name) => vec![format!("did you mean `{name}`?")],
        None => Vec::new(),
    }
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
    fn a_word_that_is_no_command_leads_to_the_command_that_does_it() {
        for (word, command) in [
            ("rnu", "`run`"),
            ("swep", "`sweep`"),
            ("diagnos", "`diagnose`"),
            ("comprae", "`compare`"),
            ("report", "report.html"),
            ("plot", "`figure`"),
            ("list", "`open`"),
            ("Fit", "`extend`"),
        ] {
            let message = message(word);
            assert!(message.contains("unrecognized subcommand"), "{message}");
            assert!(message.contains("tip: ") && message.contains(command), "{message}");
        }
        assert!(!message("xyzzy").contains("tip"));
    }

    #[test]
    fn every_command_that_a_tip_names_exists() {
        let program = command();
        for (words, tip) in NO_COMMANDS {
            for named in tip.split('`').skip(1).step_by(2) {
                let name = named.split(' ').next().unwrap();
                assert!(program.find_subcommand(name).is_some(), "{words:?}: {named}");
            }
            for word in words {
                assert!(program.find_subcommand(word).is_none(), "{word} is a command");
            }
        }
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
