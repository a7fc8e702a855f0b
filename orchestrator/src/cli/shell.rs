//! `completions` and `man`: what a shell and `man` show of the command line.

use super::help::command;
use super::{Failure, on_stdout};
use clap::Args;
use clap_complete::Shell;
use experiment::program_name;
use std::path::PathBuf;
use terminal::say;

#[derive(Args)]
pub(super) struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

#[derive(Args)]
pub(super) struct ManArgs {
    /// Folder to write the pages to; it is made if it does not exist
    dir: PathBuf,
}

/// Prints the completions of a shell.
pub(super) fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command(), program_name(), &mut script);
    on_stdout(&script).map_err(Failure::work)
}

/// Writes a manual page for the program and one for each command.
pub(super) fn man(args: &ManArgs) -> Result<(), Failure> {
    let dir = &args.dir;
    let failed = |error: std::io::Error| Failure::work(format!("{}: {error}", dir.display()));
    system::create_dir_all(dir).map_err(failed)?;
    let command = command().disable_help_subcommand(true);
    let n_pages = 1 + command.get_subcommands().filter(|command| !command.is_hide_set()).count();
    clap_mangen::generate_to(command, dir).map_err(failed)?;
    say(format!("{}: {n_pages} manual pages", dir.display()));
    Ok(())
}
