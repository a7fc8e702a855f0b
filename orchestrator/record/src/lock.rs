//! The lock of a result: one program at a time writes it, on one host or on several that share the file system.
//!
//! The lock is a file, `OUT/.<name>.lock`, that names its holder. It comes into being by link(2), or by O_EXCL where the
//! file system has no hard links; both are atomic on shared file systems, which flock(2) is not. A lock is stale if its
//! process has ended (same host), or if its holder has not touched it for two minutes (other hosts). A program that
//! takes over a stale lock first takes the lock of that very lock, so that of several only one removes it.

use super::RecordError;
use super::bounded::read_file;
use chrono::DateTime;
use nix::errno::Errno;
use nix::sys::signal::kill;
use nix::unistd::Pid;
use proto::bounds::LOCK_BYTES;
use proto::digest::hex;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use std::fmt;
use std::fs;
use std::io::{self, ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use system::File;

/// How often the holder of a lock touches it, so that other hosts see that it lives.
const TOUCH_EVERY: Duration = Duration::from_secs(15);
/// A lock of another host that was not touched for so long is stale.
pub(crate) const STALE_AFTER: Duration = Duration::from_secs(120);
/// A lock without readable content is being written, unless it is older.
const UNREADABLE_AFTER: Duration = Duration::from_secs(30);
/// How deep locks of stale locks go.
const MOST_NESTED: u32 = 4;
/// Hexadecimal digits of a token.
const TOKEN_DIGITS: usize = 16;
/// What the suffix of the lock of a stale lock begins with; that of a lock that is being placed is its token.
const STALE: &str = "stale-";

/// Who holds a lock.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LockHolder {
    /// Name of its host.
    pub host: String,
    /// Its process id.
    pub process: u32,
    /// Since when it holds the lock (Unix time, s).
    pub since_unix_s: u64,
    /// Its host's boot and its process namespace; null where the system does not tell.
    scope: Option<String>,
    /// When its process was started (clock ticks since boot), which tells it from a later process with the same id.
    started_ticks: Option<u64>,
    /// Tells this lock from every other one.
    token: String,
}

impl fmt::Display for LockHolder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { host, process, .. } = self;
        write!(f, "process {process} on host {host} since {}", utc(self.since_unix_s))
    }
}

/// Unix time as text, UTC; 1970 for one that is no date.
pub(crate) fn utc(unix_s: u64) -> String {
    let time = i64::try_from(unix_s).ok().and_then(DateTime::from_timestamp_secs);
    time.unwrap_or_default().format("%Y-%m-%d %H:%M:%S UTC").to_string()
}

/// The time now (s, Unix time, with fractions).
pub(crate) fn now() -> Duration {
    system::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

impl LockHolder {
    /// This process, with a new token.
    fn this() -> Self {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let host = fs::read_to_string("/proc/sys/kernel/hostname")
            .map_or_else(|_| "unknown".to_owned(), |name| name.trim().to_owned());
        let process = std::process::id();
        let (scope, now) = (scope(), now());
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let unique = format!("{host} {process} {scope:?} {} {count}", now.as_nanos());
        Self {
            started_ticks: status_of(process).map(|(_, ticks)| ticks),
            token: hex(&Sha256::digest(unique))[..TOKEN_DIGITS].to_owned(),
            since_unix_s: now.as_secs(),
            host,
            process,
            scope,
        }
    }

    /// Whether its process lives; `None`: that cannot be told from here.
    fn lives(&self) -> Option<bool> {
        let here = scope()?;
        if self.scope.as_ref() != Some(&here) {
            return None;
        }
        let id = Pid::from_raw(i32::try_from(self.process).ok()?);
        if kill(id, None) == Err(Errno::ESRCH) {
            return Some(false);
        }
        // It exists. Another user's may be hidden: then it lives as far as can be seen.
        Some(status_of(self.process).is_none_or(|(state, ticks)| {
            !matches!(state, 'Z' | 'X') && self.started_ticks.is_none_or(|known| known == ticks)
        }))
    }
}

/// Where process ids have one meaning: this boot of this kernel, and the namespace of process ids.
fn scope() -> Option<String> {
    let boot = fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    let namespace = fs::read_link("/proc/self/ns/pid").ok()?;
    Some(format!("{} {}", boot.trim(), namespace.display()))
}

/// State and start (clock ticks since boot) of a process.
fn status_of(process: u32) -> Option<(char, u64)> {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name stands in parentheses and may hold anything.
    let mut fields = text.rsplit_once(')')?.1.split_whitespace();
    let state = fields.next()?.chars().next()?;
    Some((state, fields.nth(18)?.parse().ok()?))
}

/// Who is writing the result `name` in the folder `out`, if a program that lives is.
#[must_use]
pub fn writer_of(out: &Path, name: &str) -> Option<LockHolder> {
    let path = out.join(format!(".{name}.lock"));
    let Ok(Found::Holder(holder)) = read(&path) else { return None };
    let is_fresh = || age(&path, Some(system::now())) < STALE_AFTER;
    holder.lives().unwrap_or_else(is_fresh).then_some(holder)
}

/// A lock that this process holds. Given back when dropped.
#[derive(Debug)]
pub struct ResultLock {
    path: PathBuf,
    holder: LockHolder,
    heart: Option<(Sender<()>, JoinHandle<()>)>,
}

/// Why a lock cannot be had.
enum Refused {
    Held(Box<LockHolder>),
    System(PathBuf, io::Error),
}

impl ResultLock {
    /// Takes the lock of the result `name` in the folder `out`, which exists.
    ///
    /// # Errors
    ///
    /// Another program that lives holds it, or the file cannot be written.
    pub fn take(out: &Path, name: &str) -> Result<Self, RecordError> {
        let path = out.join(format!(".{name}.lock"));
        let holder = LockHolder::this();
        match take(&path, &holder, 0) {
            Ok(()) => {}
            Err(Refused::Held(holder)) => {
                return Err(RecordError::Locked { path: out.join(name), holder });
            }
            Err(Refused::System(path, source)) => return Err(RecordError::Create { path, source }),
        }
        remove_abandoned(&path);
        let (stop, stopped) = channel();
        let (lock, mine) = (path.clone(), holder.clone());
        let beat = move || {
            while stopped.recv_timeout(TOUCH_EVERY) == Err(RecvTimeoutError::Timeout) {
                touch(&lock, &mine);
            }
        };
        let thread = std::thread::Builder::new().name("lock".to_owned()).spawn(beat);
        Ok(Self { path, holder, heart: thread.ok().map(|thread| (stop, thread)) })
    }

    /// Whether it is still held: a process that was stopped for long may have lost it to another host.
    #[must_use]
    pub fn is_held(&self) -> bool {
        matches!(read(&self.path), Ok(Found::Holder(holder)) if holder.token == self.holder.token)
    }
}

impl Drop for ResultLock {
    fn drop(&mut self) {
        if let Some((stop, thread)) = self.heart.take() {
            drop(stop);
            let _ = thread.join();
        }
        if self.is_held() {
            let _ = system::remove_file(&self.path);
        }
    }
}

/// Writes the same content again: the time of the change is that of the file server.
fn touch(path: &Path, holder: &LockHolder) {
    let is_mine = matches!(read(path), Ok(Found::Holder(found)) if found.token == holder.token);
    if is_mine && let Ok(mut file) = File::overwrite(path) {
        // That it fails once does no harm.
        let _ = file.write_all(&content(holder));
        let _ = file.sync_all();
    }
}

fn content(holder: &LockHolder) -> Vec<u8> {
    let mut content = serde_json::to_vec(holder).unwrap_or_default();
    content.push(b'\n');
    content
}

/// What stands where a lock is to go.
#[derive(PartialEq, Eq)]
enum Found {
    Nothing,
    Unreadable,
    Holder(LockHolder),
}

fn read(path: &Path) -> io::Result<Found> {
    match read_file(&LOCK_BYTES, path) {
        Ok(content) => {
            Ok(serde_json::from_slice(&content).map_or(Found::Unreadable, Found::Holder))
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Found::Nothing),
        Err(error) => Err(error),
    }
}

fn take(path: &Path, me: &LockHolder, depth: u32) -> Result<(), Refused> {
    let failed = |source| Refused::System(path.to_owned(), source);
    let mut other = None;
    for _ in 0..200 {
        let now = match place(path, me).map_err(failed)? {
            Placed::Here => return Ok(()),
            Placed::Occupied(now) => now,
        };
        let found = read(path).map_err(failed)?;
        let (is_stale, token) = match &found {
            Found::Nothing => continue,
            Found::Holder(holder) if holder.token == me.token => return Ok(()),
            Found::Holder(holder) => {
                let lives = holder.lives().unwrap_or_else(|| age(path, now) < STALE_AFTER);
                other = Some(holder.clone());
                (!lives, holder.token.clone())
            }
            Found::Unreadable => (UNREADABLE_AFTER <= age(path, now), "unreadable".to_owned()),
        };
        if !is_stale {
            match found {
                Found::Holder(holder) => return Err(Refused::Held(Box::new(holder))),
                _ => std::thread::park_timeout(Duration::from_millis(100)),
            }
            continue;
        }
        if depth == MOST_NESTED {
            return Err(failed(io::Error::other("too many stale locks; remove the file")));
        }
        let inner = suffixed(path, &format!("{STALE}{token}"));
        match take(&inner, me, depth + 1) {
            Ok(()) => {
                // Nobody else removes this stale lock. If it is gone, another one has removed it before.
                let is_same = read(path).map_err(failed)? == found;
                if is_same && (found != Found::Unreadable || UNREADABLE_AFTER <= age(path, now)) {
                    let _ = system::remove_file(path);
                }
                let _ = system::remove_file(&inner);
            }
            // Another one is taking it over.
            Err(Refused::Held(_)) => std::thread::park_timeout(Duration::from_millis(20)),
            Err(error) => return Err(error),
        }
    }
    match other {
        Some(holder) => Err(Refused::Held(Box::new(holder))),
        None => Err(failed(io::Error::other("the lock cannot be read; remove the file"))),
    }
}

/// What came of placing a lock.
enum Placed {
    Here,
    /// One stands there. With the time of the file server now.
    Occupied(Option<SystemTime>),
}

/// Places a lock whole, if there is none.
fn place(path: &Path, me: &LockHolder) -> io::Result<Placed> {
    let draft = suffixed(path, &me.token);
    let mut file = File::create(&draft)?;
    let written = file.write_all(&content(me)).and_then(|()| file.sync_all());
    let now = file.metadata().and_then(|metadata| metadata.modified()).ok();
    let linked = written.and_then(|()| system::hard_link(&draft, path));
    let _ = system::remove_file(&draft);
    match linked {
        Ok(()) => Ok(Placed::Here),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(Placed::Occupied(now)),
        Err(error) if error.kind() == ErrorKind::NotFound => Err(error),
        // A file system without hard links.
        Err(_) => match File::create_new(path) {
            Ok(mut file) => {
                file.write_all(&content(me)).and_then(|()| file.sync_all())?;
                Ok(Placed::Here)
            }
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(Placed::Occupied(now)),
            Err(error) => Err(error),
        },
    }
}

/// Removes what processes that were killed while they placed or took over a lock have left beside it. The lock is held: nobody else
/// needs these files, and that one cannot be removed does no harm.
fn remove_abandoned(path: &Path) {
    let prefix = suffixed(path, "");
    let prefix = prefix.file_name().unwrap_or_default().to_string_lossy();
    let now = fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
    let folder = path.parent().unwrap_or(Path::new("."));
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some(suffix) = name.to_str().and_then(|name| name.strip_prefix(&*prefix)) else {
            continue;
        };
        let is_token =
            suffix.len() == TOKEN_DIGITS && suffix.chars().all(|c| c.is_ascii_hexdigit());
        if !is_token && !suffix.starts_with(STALE) {
            continue;
        }
        let path = entry.path();
        let is_abandoned = match read(&path) {
            Ok(Found::Holder(holder)) => {
                !holder.lives().unwrap_or_else(|| age(&path, now) < STALE_AFTER)
            }
            Ok(Found::Unreadable) => UNREADABLE_AFTER <= age(&path, now),
            Ok(Found::Nothing) | Err(_) => false,
        };
        if is_abandoned {
            let _ = system::remove_file(&path);
        }
    }
}

/// How long ago a file was changed, by the clock of its file server.
fn age(path: &Path, now: Option<SystemTime>) -> Duration {
    let changed = fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
    let age = now.zip(changed).and_then(|(now, changed)| now.duration_since(changed).ok());
    age.unwrap_or_default()
}

fn suffixed(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push("-");
    name.push(suffix);
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;
    use std::sync::atomic::AtomicU32;

    fn names(dir: &Path) -> Vec<String> {
        let entries = fs::read_dir(dir).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    /// A holder whose process has ended.
    fn dead() -> LockHolder {
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let process = child.id();
        child.wait().unwrap();
        LockHolder { process, ..LockHolder::this() }
    }

    #[test]
    fn a_lock_is_held_by_one_and_given_back() {
        let out = tempfile::tempdir().unwrap();
        let lock = ResultLock::take(out.path(), "run").unwrap();
        assert!(lock.is_held());
        let error = ResultLock::take(out.path(), "run").unwrap_err();
        let RecordError::Locked { holder, .. } = &error else { panic!("{error}") };
        assert_eq!(holder.process, std::process::id());
        assert_eq!(writer_of(out.path(), "run").as_ref(), Some(&**holder));
        assert_eq!(writer_of(out.path(), "ru"), None);
        assert!(error.to_string().contains(&format!("process {}", holder.process)), "{error}");
        let other = ResultLock::take(out.path(), "other").unwrap();
        drop((lock, other));
        assert_eq!(names(out.path()), Vec::<String>::new());
    }

    #[test]
    fn of_many_that_take_over_a_stale_lock_one_gets_it() {
        let out = tempfile::tempdir().unwrap();
        for _ in 0..20 {
            fs::write(out.path().join(".run.lock"), content(&dead())).unwrap();
            assert_eq!(writer_of(out.path(), "run"), None);
            let (start, done) = (Barrier::new(8), Barrier::new(8));
            let n_held = AtomicU32::new(0);
            std::thread::scope(|scope| {
                for _ in 0..8 {
                    scope.spawn(|| {
                        start.wait();
                        let lock = ResultLock::take(out.path(), "run");
                        n_held.fetch_add(u32::from(lock.is_ok()), Ordering::Relaxed);
                        // Nobody gives it back before all have tried.
                        done.wait();
                    });
                }
            });
            assert_eq!(n_held.into_inner(), 1);
            assert_eq!(names(out.path()), Vec::<String>::new());
        }
    }

    #[test]
    fn what_a_killed_process_left_of_a_lock_is_removed_with_the_next_one() {
        let out = tempfile::tempdir().unwrap();
        let token = "0123456789abcdef";
        for name in [format!(".run.lock-{token}"), format!(".run.lock-stale-{token}")] {
            fs::write(out.path().join(name), content(&dead())).unwrap();
        }
        // One that is being written, and locks of others.
        let others = [".run.lock-fedcba9876543210", ".run.lock-b.lock", ".run2.lock"];
        for name in others {
            fs::write(out.path().join(name), "").unwrap();
        }
        drop(ResultLock::take(out.path(), "run").unwrap());
        let left = names(out.path());
        assert!(left.len() == 3 && others.iter().all(|name| left.contains(&(*name).to_owned())));
    }

    #[test]
    fn a_process_that_has_the_id_of_an_ended_one_does_not_hold_its_lock() {
        let out = tempfile::tempdir().unwrap();
        let this = LockHolder::this();
        let before = LockHolder { started_ticks: this.started_ticks.map(|t| t - 1), ..this };
        fs::write(out.path().join(".run.lock"), content(&before)).unwrap();
        assert!(ResultLock::take(out.path(), "run").is_ok());
    }

    #[test]
    fn a_lock_of_another_host_is_stale_once_nobody_touches_it() {
        let out = tempfile::tempdir().unwrap();
        let path = out.path().join(".run.lock");
        let elsewhere = Some("another boot".to_owned());
        let other = LockHolder { host: "elsewhere".to_owned(), scope: elsewhere, ..dead() };
        fs::write(&path, content(&other)).unwrap();
        let error = ResultLock::take(out.path(), "run").unwrap_err();
        assert!(error.to_string().contains("on host elsewhere since 2"), "{error}");
        let file = fs::File::options().write(true).open(&path).unwrap();
        let long_ago = file.metadata().unwrap().modified().unwrap() - 2 * STALE_AFTER;
        file.set_modified(long_ago).unwrap();
        // Its holder lives after all.
        touch(&path, &other);
        assert!(ResultLock::take(out.path(), "run").is_err());
        file.set_modified(long_ago).unwrap();
        let lock = ResultLock::take(out.path(), "run").unwrap();
        // Whoever has lost its lock leaves that of the other one alone.
        fs::write(&path, content(&other)).unwrap();
        assert!(!lock.is_held());
        drop(lock);
        assert_eq!(names(out.path()), [".run.lock"]);
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (unix_s, text) in [
            (0, "1970-01-01 00:00:00 UTC"),
            (951_782_399, "2000-02-28 23:59:59 UTC"),
            (951_782_400, "2000-02-29 00:00:00 UTC"),
            (1_735_689_600, "2025-01-01 00:00:00 UTC"),
        ] {
            assert_eq!(utc(unix_s), text);
        }
    }
}
