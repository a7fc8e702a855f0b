//! Faults on a schedule: an operation fails, or the process is killed there.
//!
//! The environment variable `MURMURATION_FAULTS` has the schedule, as text: entries separated by `;`. An operation is named by its
//! kind, its file and how many operations of that kind on that file came before it, so that the same schedule meets the same
//! operation whatever threads do.
//!
//! ```text
//! list FILE                                adds a line for each operation to FILE
//! EIO write 2 .flocking.partial-#/run.mcap   the second write to run.mcap fails
//! ```
//!
//! | fault | what happens |
//! |---|---|
//! | `ENOSPC` | this and all later operations that need space fail |
//! | `short` | half of what is to be written is; then as `ENOSPC` |
//! | `EIO`, `EMFILE`, `EACCES`, `EXDEV` | this operation fails |
//! | `kill` | SIGKILL before the operation |
//! | `torn` | half of what is to be written is; then SIGKILL |
//! | `clock+S`, `clock-S` | from the operation on, the wall clock is off by S seconds |

use nix::errno::Errno;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, SystemTime};

/// The environment variable with the schedule.
pub const VARIABLE: &str = "MURMURATION_FAULTS";

/// What is done to a file or folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Operation {
    /// It is made, or opened to be written.
    Create,
    /// Bytes are written to it.
    Write,
    /// It is brought to the disk.
    Sync,
    /// It is cut off.
    SetLength,
    /// Something is given its name.
    Rename,
    /// A file gets it as a second name.
    Link,
    /// It is removed.
    Remove,
    /// It is made, a folder.
    MakeFolder,
    /// The program reaches a point of this name.
    Point,
}

impl Operation {
    const ALL: [(Self, &str); 9] = [
        (Self::Create, "create"),
        (Self::Write, "write"),
        (Self::Sync, "sync"),
        (Self::SetLength, "set-length"),
        (Self::Rename, "rename"),
        (Self::Link, "link"),
        (Self::Remove, "remove"),
        (Self::MakeFolder, "make-folder"),
        (Self::Point, "point"),
    ];

    /// It may fail for want of space.
    #[must_use]
    pub fn needs_space(self) -> bool {
        matches!(self, Self::Create | Self::Write | Self::Sync | Self::MakeFolder | Self::Link)
    }
}

impl fmt::Display for Operation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = Self::ALL.iter().find(|(operation, _)| operation == self);
        f.write_str(named.map_or("", |(_, name)| name))
    }
}

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The operation fails.
    Fails(Errno),
    /// This operation and all later ones fail that need space.
    Full,
    /// As [`Full`](Self::Full), but half of what is to be written is.
    Short,
    /// The process is killed before the operation.
    Kill,
    /// The process is killed when half of what is to be written is.
    Torn,
    /// From here on the wall clock is off by so much (s).
    Clock(i64),
}

/// Errors that an operation may fail with alone.
const ERRNOS: [(Errno, &str); 4] = [
    (Errno::EIO, "EIO"),
    (Errno::EMFILE, "EMFILE"),
    (Errno::EACCES, "EACCES"),
    (Errno::EXDEV, "EXDEV"),
];

impl FromStr for Fault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(seconds) = text.strip_prefix("clock") {
            return seconds.parse().map(Self::Clock).map_err(|error| format!("{text}: {error}"));
        }
        let errno = ERRNOS.iter().find(|(_, name)| *name == text);
        match (text, errno) {
            (_, Some((errno, _))) => Ok(Self::Fails(*errno)),
            ("ENOSPC", _) => Ok(Self::Full),
            ("short", _) => Ok(Self::Short),
            ("kill", _) => Ok(Self::Kill),
            ("torn", _) => Ok(Self::Torn),
            _ => Err(format!("{text} is no fault")),
        }
    }
}

/// An operation, and what goes wrong there.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Entry {
    fault: Fault,
    operation: Operation,
    /// From 1.
    number: u64,
    file: String,
}

impl FromStr for Entry {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut words = text.splitn(4, ' ');
        let mut word = || words.next().ok_or_else(|| format!("{text:?} is no entry"));
        let (fault, name, number, file) = (word()?, word()?, word()?, word()?);
        let named = Operation::ALL.iter().find(|(_, known)| *known == name);
        Ok(Self {
            fault: fault.parse()?,
            operation: named.ok_or_else(|| format!("{name} is no operation"))?.0,
            number: number.parse().map_err(|error| format!("{number}: {error}"))?,
            file: file.to_owned(),
        })
    }
}

/// The faults of a process.
#[derive(Debug, Default)]
struct Schedule {
    entries: Vec<Entry>,
    list: Option<PathBuf>,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    counts: BTreeMap<(Operation, String), u64>,
    is_full: bool,
    clock_s: i64,
}

/// How an operation goes.
#[derive(Debug)]
pub(crate) enum Course {
    /// As it should.
    Whole,
    /// Half of what is to be written is, then it ends.
    Half(End),
}

/// How an operation ends that is not finished.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum End {
    Error(Errno),
    Kill,
}

impl End {
    pub(crate) fn happen(&self) -> io::Result<()> {
        match self {
            Self::Error(errno) => Err((*errno).into()),
            Self::Kill => loop {
                let _ = kill(Pid::this(), Signal::SIGKILL);
                std::thread::park_timeout(Duration::from_millis(10));
            },
        }
    }
}

impl FromStr for Schedule {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut schedule = Self::default();
        for entry in text.split(';').map(str::trim).filter(|entry| !entry.is_empty()) {
            match entry.strip_prefix("list ") {
                Some(path) => schedule.list = Some(PathBuf::from(path)),
                None => schedule.entries.push(entry.parse()?),
            }
        }
        Ok(schedule)
    }
}

impl Schedule {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How the next operation on a file goes.
    fn next(&self, operation: Operation, file: &str) -> io::Result<Course> {
        let mut state = self.state();
        let count = state.counts.entry((operation, file.to_owned())).or_default();
        *count += 1;
        let number = *count;
        if let Some(list) = &self.list {
            let mut list = std::fs::OpenOptions::new().append(true).create(true).open(list)?;
            list.write_all(format!("{operation} {number} {file}\n").as_bytes())?;
        }
        let here = |entry: &&Entry| {
            entry.operation == operation && entry.number == number && entry.file == file
        };
        for Entry { fault, .. } in self.entries.iter().filter(here) {
            match fault {
                Fault::Fails(errno) => return Err((*errno).into()),
                Fault::Full => state.is_full = true,
                Fault::Short => {
                    state.is_full = true;
                    return Ok(Course::Half(End::Error(Errno::ENOSPC)));
                }
                Fault::Kill => End::Kill.happen()?,
                Fault::Torn => return Ok(Course::Half(End::Kill)),
                Fault::Clock(seconds) => state.clock_s = *seconds,
            }
        }
        if state.is_full && operation.needs_space() {
            return Err(Errno::ENOSPC.into());
        }
        Ok(Course::Whole)
    }
}

/// The schedule of this process.
fn schedule() -> Option<&'static Result<Schedule, String>> {
    static SCHEDULE: OnceLock<Option<Result<Schedule, String>>> = OnceLock::new();
    let read = || std::env::var(VARIABLE).ok().map(|text| text.parse());
    SCHEDULE.get_or_init(read).as_ref()
}

/// Whether this process has a schedule.
pub(crate) fn is_scheduled() -> bool {
    schedule().is_some()
}

/// Called before an operation: how it goes.
pub(crate) fn at(operation: Operation, path: &Path) -> io::Result<Course> {
    match schedule() {
        None => Ok(Course::Whole),
        Some(Ok(schedule)) => schedule.next(operation, &named(path)),
        Some(Err(reason)) => {
            Err(io::Error::new(io::ErrorKind::InvalidInput, format!("{VARIABLE}: {reason}")))
        }
    }
}

/// The program reaches a point at which it may be killed.
pub fn point(name: &str) {
    // Nothing but a kill can happen at a point.
    let _ = at(Operation::Point, Path::new(name));
}

/// A time of the wall clock, as far off as the schedule asks for.
pub(crate) fn shifted(now: SystemTime) -> SystemTime {
    let Some(Ok(schedule)) = schedule() else { return now };
    let seconds = schedule.state().clock_s;
    let by = Duration::from_secs(seconds.unsigned_abs());
    let moved = if seconds < 0 { now.checked_sub(by) } else { now.checked_add(by) };
    moved.unwrap_or(now)
}

/// The name of a file in a schedule: its name and that of its folder, in which `#` stands for numbers and tokens.
fn named(path: &Path) -> String {
    let mut parts: Vec<String> = path
        .components()
        .rev()
        .take(2)
        .map(|part| without_numbers(&part.as_os_str().to_string_lossy()))
        .collect();
    parts.reverse();
    parts.join("/")
}

fn without_numbers(name: &str) -> String {
    let mut text = String::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let run = |is_such: fn(char) -> bool| rest.find(|c| !is_such(c)).unwrap_or(rest.len());
        let digits = run(|c| c.is_ascii_digit());
        let token = run(|c| c.is_ascii_digit() || ('a'..='f').contains(&c));
        let n = if TOKEN_DIGITS <= token { token } else { digits };
        if n == 0 {
            text.push(first);
            rest = &rest[first.len_utf8()..];
        } else {
            text.push('#');
            rest = &rest[n..];
        }
    }
    text
}

/// So many hexadecimal digits are a token.
const TOKEN_DIGITS: usize = 16;

#[cfg(test)]
mod tests {
    use super::*;

    fn errno(course: io::Result<Course>) -> Option<i32> {
        course.err().and_then(|error| error.raw_os_error())
    }

    #[test]
    fn a_fault_meets_the_operation_that_it_names_and_no_other() {
        let schedule: Schedule = "EIO write 2 a/run.mcap; clock-60 rename 1 a/b".parse().unwrap();
        for (operation, file, expected) in [
            (Operation::Write, "a/run.mcap", None),
            (Operation::Write, "a/other", None),
            (Operation::Sync, "a/run.mcap", None),
            (Operation::Write, "a/run.mcap", Some(Errno::EIO as i32)),
            (Operation::Write, "a/run.mcap", None),
            (Operation::Rename, "a/b", None),
        ] {
            assert_eq!(errno(schedule.next(operation, file)), expected, "{operation} {file}");
        }
        assert_eq!(schedule.state().clock_s, -60);
    }

    #[test]
    fn a_full_disk_stays_full_and_files_on_it_can_be_renamed_and_removed() {
        let schedule: Schedule = "short write 1 a/b".parse().unwrap();
        let half = schedule.next(Operation::Write, "a/b").unwrap();
        assert!(matches!(half, Course::Half(End::Error(Errno::ENOSPC))));
        for operation in [Operation::Create, Operation::Write, Operation::Sync] {
            assert_eq!(errno(schedule.next(operation, "c")), Some(Errno::ENOSPC as i32));
        }
        for operation in [Operation::Rename, Operation::Remove] {
            assert_eq!(errno(schedule.next(operation, "c")), None);
        }
    }

    #[test]
    fn a_schedule_that_is_none_says_so() {
        for text in ["EIO write x f", "ENOENT write 1 f", "EIO jump 1 f", "EIO write 1", "clockx"] {
            assert!(text.parse::<Schedule>().is_err(), "{text}");
        }
    }

    #[test]
    fn names_do_not_depend_on_processes() {
        for (path, expected) in [
            ("/tmp/out/.flocking.partial-4711-2/run.mcap", ".flocking.partial-#-#/run.mcap"),
            ("out/.flocking.lock.0123456789abcdef", "out/.flocking.lock.#"),
            ("x", "x"),
        ] {
            assert_eq!(named(Path::new(path)), expected);
        }
    }
}
