//! The name of the program, for messages that tell the user which command to type.

use std::sync::OnceLock;

/// The names under which the program is installed. The first one is the default.
const NAMES: [&str; 2] = ["murmuration", "orchestrator"];

static NAME: OnceLock<&'static str> = OnceLock::new();

/// Sets the name from the first argument of the process, which may be a path. Only the first call has an effect.
pub fn set_program_name(first_argument: Option<&std::ffi::OsStr>) {
    let file_name = first_argument.map(std::path::Path::new).and_then(|path| path.file_name());
    let known = NAMES.into_iter().find(|&name| file_name.is_some_and(|given| given == name));
    NAME.get_or_init(|| known.unwrap_or(NAMES[0]));
}

/// The name that the user called the program by: `murmuration` or `orchestrator`.
#[must_use]
pub fn program_name() -> &'static str {
    NAME.get().copied().unwrap_or(NAMES[0])
}
