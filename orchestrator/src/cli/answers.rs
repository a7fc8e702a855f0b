//! Where answers go: to files, written in one piece, or with `-` to standard output.

use super::Failure;
use serde::Serialize;
use std::io::Write as _;
use std::path::Path;
use system::Draft;

/// The answer of a command as JSON, if an option asks for it.
pub(super) fn write_json(path: Option<&Path>, answer: &impl Serialize) -> Result<(), Failure> {
    path.map_or(Ok(()), |path| write_whole("--json", path, record::pretty(answer)))
}

/// Writes a file in one piece: under another name first.
pub(super) fn write_whole(
    option: &str,
    path: &Path,
    content: impl AsRef<[u8]>,
) -> Result<(), Failure> {
    let failed =
        |error: std::io::Error| Failure::work(format!("{option} {}: {error}", path.display()));
    if is_stdout(path) {
        return on_stdout(content.as_ref()).map_err(failed);
    }
    let mut file = place_for(option, path).map_err(Failure::work)?;
    file.write_all(content.as_ref()).map_err(failed)?;
    file.replace(path).map_err(failed)
}

/// Writes a file in one piece, in place of an existing one only if `replace` says so.
pub(super) fn write_new(
    option: &str,
    path: &Path,
    replace: bool,
    content: impl AsRef<[u8]>,
) -> Result<(), Failure> {
    if is_stdout(path) || replace {
        return write_whole(option, path, content);
    }
    let mut file = place_for(option, path).map_err(Failure::work)?;
    let placed = file.write_all(content.as_ref()).and_then(|()| file.place(path));
    placed.map_err(|error| not_placed(option, path, &error))
}

/// Why a file did not get its name.
pub(super) fn not_placed(option: &str, path: &Path, error: &std::io::Error) -> Failure {
    match error.kind() {
        std::io::ErrorKind::AlreadyExists => Failure::request(exists(option, path)),
        _ => Failure::work(format!("{option} {}: {error}", path.display())),
    }
}

/// Refuses a file that exists, before the work, unless `replace` says that it is replaced.
pub(super) fn check_new(option: &str, path: &Path, replace: bool) -> Result<(), Failure> {
    if !is_stdout(path) && !replace && path.symlink_metadata().is_ok() {
        return Err(Failure::request(exists(option, path)));
    }
    check_place(option, path)
}

fn exists(option: &str, path: &Path) -> String {
    format!("{option} {}: the file exists; give another name, or --replace", path.display())
}

/// Whether an option that names a file asks for standard output instead.
pub(super) fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

/// Writes an answer to standard output. That nobody reads it is no failure.
pub(super) fn on_stdout(content: &[u8]) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(content).and_then(|()| out.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

/// Finds out before the work whether an answer can be written there.
pub(super) fn check_place(option: &str, path: &Path) -> Result<(), Failure> {
    if is_stdout(path) {
        return Ok(());
    }
    place_for(option, path).map(|_| ()).map_err(Failure::request)
}

/// The same of `--json`, if it is given.
pub(super) fn check_json(path: Option<&Path>) -> Result<(), Failure> {
    path.map_or(Ok(()), |path| check_place("--json", path))
}

/// A file beside the one that is to be written, to become it.
pub(super) fn place_for(option: &str, path: &Path) -> Result<Draft, String> {
    if path.is_dir() {
        return Err(format!("{option} {}: is a folder; give the path of a file", path.display()));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        let folder = folder.display();
        return Err(format!(
            "{option} {}: there is no folder {folder}; make it first",
            path.display()
        ));
    }
    Draft::beside(path).map_err(|error| {
        format!("{option} {}: {}", path.display(), std::io::Error::from(error.kind()))
    })
}
