//! `murmuration diagnose --between A B`: what changed between two campaigns.

use super::inputs::{Watching, table};
use super::stop::Stopper;
use super::{Failure, ReadArgs};
use clap::Args;
use diagnose::between::{Between, BetweenError, BetweenRequest, words};
use measure::config::Compared;
use std::path::{Path, PathBuf};
use study::choices::Choices;
use terminal::say;

/// Two campaigns in place of one.
#[derive(Args)]
pub(super) struct BetweenArgs {
    /// Find what changed between two campaigns of the same site or robots: fit the model to A, and list the changes
    /// that are needed to predict B. Links and robots only
    #[arg(
        long,
        num_args = 2,
        value_names = ["A", "B"],
        conflicts_with_all = ["split", "fit_runs", "score_runs", "losses", "given_rssi"]
    )]
    between: Option<Vec<PathBuf>>,
}

impl BetweenArgs {
    /// Whether two campaigns are to be compared.
    pub(super) fn is_asked(&self) -> bool {
        self.between.is_some()
    }

    /// Refuses `--data` beside `--between`. Clap's own message names the conflict, but not the choice.
    pub(super) fn refuse_data(&self, data: Option<&Path>) -> Result<(), Failure> {
        match data {
            Some(data) if self.is_asked() => Err(Failure::request(format!(
                "{}: does not apply with --data {}; give either --data FILE to diagnose one file, or --between A B to \
                 compare two",
                self.words(),
                data.display()
            ))),
            _ => Ok(()),
        }
    }

    /// The option, as it would be typed.
    pub(super) fn words(&self) -> String {
        let files = self.between.iter().flatten();
        files.fold("--between".to_owned(), |words, file| format!("{words} {}", file.display()))
    }

    /// Finds what changed and prints it.
    pub(super) fn diagnose(
        &self,
        config: Compared,
        (choices, is_thorough): (Choices, bool),
        read: ReadArgs,
        stopper: &Stopper,
    ) -> Result<Between, Failure> {
        let [a, b] = self.between.as_deref().unwrap_or_default() else {
            return Err(Failure::request(
                "--between: requires two files, as in --between A.csv B.csv",
            ));
        };
        let [a, b] = [a, b].map(|path| table(path, read));
        let request = BetweenRequest { config: &config, tables: [&a?, &b?], choices, is_thorough };
        let watching = Watching::new(Some(stopper));
        let found = diagnose::between(&request, &watching).map_err(|error| match error {
            BetweenError::Open(error) => Failure::of_diagnosis(error),
            error @ BetweenError::Packets { .. } => Failure::request(format!("--between {error}")),
            error @ BetweenError::Mismatch(_) => Failure::request(format!("--between: {error}")),
        })?;
        watching.clear();
        say(words::text(&found));
        Ok(found)
    }
}
