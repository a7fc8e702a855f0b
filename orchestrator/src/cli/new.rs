//! `new`: writes a starter experiment.

use super::Failure;
use clap::Args;
use demo::starters::StarterKind;
use experiment::{as_file_name, is_file_name, program_name, quoted};
use std::path::{Path, PathBuf};
use system::DraftFolder;
use terminal::say;

#[derive(Args)]
pub(super) struct NewArgs {
    /// Folder to make. Its last part is the name of the experiment: letters, digits, '-', '_' and '.'
    name: PathBuf,
    /// What the experiment is about
    #[arg(long, value_name = "KIND", value_enum, default_value_t = StarterKind::Flocking)]
    kind: StarterKind,
}

/// Writes the starter, or nothing.
pub(super) fn new(args: &NewArgs) -> Result<(), Failure> {
    let folder = &args.name;
    let name = checked_name(folder)?;
    if folder.symlink_metadata().is_ok() {
        let text = format!("{}: exists already; give another name", folder.display());
        return Err(Failure::request(text));
    }
    let files = args.kind.files(&name, program_name()).map_err(Failure::work)?;
    let failed = |error: std::io::Error| Failure::work(format!("{}: {error}", folder.display()));
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty());
    let parent = parent.unwrap_or(Path::new("."));
    if !parent.is_dir() {
        return Err(Failure::request(format!(
            "{}: the folder {} does not exist; make it first",
            folder.display(),
            parent.display()
        )));
    }
    // Beside its place, so that a failure leaves no half of it.
    let made = DraftFolder::beside(folder).map_err(failed)?;
    for file in &files {
        system::write(&made.path().join(file.name), &file.text).map_err(failed)?;
    }
    made.place(folder).map_err(failed)?;
    let shown = |path: &Path| quoted(&path.to_string_lossy());
    let names: Vec<&str> = files.iter().map(|file| file.name).collect();
    say(format!("made {}: {}", shown(folder), names.join(", ")));
    say(format!("\nNext:\n  cd {}", shown(folder)));
    for command in args.kind.next_commands() {
        say(format!("  {} {command}", program_name()));
    }
    say(format!(
        "\nThe comments in {} explain the keys, and list what to try after that.",
        names[0]
    ));
    Ok(())
}

/// The name of the experiment, if it can be one.
fn checked_name(folder: &Path) -> Result<String, Failure> {
    let last = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if is_file_name(&last) {
        return Ok(last);
    }
    Err(Failure::request(format!(
        "{:?}: the name must be 1 to 100 letters, digits, '-', '_' or '.', not starting with '.' or '-'; use {}",
        folder.display().to_string(),
        as_file_name(&last)
    )))
}
