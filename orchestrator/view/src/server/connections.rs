//! How many connections there may be, and for how long.
//!
//! Every user of this machine can connect. Who has not shown the token gives way to others who connect, and is not served for long.

use nix::sys::resource::{Resource, getrlimit};
use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;

/// Connections in all, if the program may open enough files.
const MOST: usize = 128;
/// Of the files that the program may open, connections are at most so many.
const PART_OF_FILES: usize = 8;
/// The headers of a request must have arrived after this time, the first or one on a connection that was idle.
pub(super) const HEADERS: Duration = Duration::from_secs(10);
/// The body of a request must have arrived after this time.
pub(super) const BODY: Duration = Duration::from_secs(10);
/// A connection over which no token came is closed after this time.
pub(super) const WITHOUT_TOKEN: Duration = Duration::from_secs(30);

/// The connections that are open, the oldest first.
#[derive(Clone)]
pub(super) struct Connections {
    /// How many there may be; of one address, half of them.
    most: usize,
    open: Arc<Mutex<Open>>,
}

#[derive(Default)]
struct Open {
    next: u64,
    all: BTreeMap<u64, Entry>,
}

struct Entry {
    peer: IpAddr,
    shared: Arc<Shared>,
}

#[derive(Default)]
struct Shared {
    has_token: AtomicBool,
    must_close: Notify,
}

/// A connection that counts until it is dropped.
pub(super) struct Connection {
    number: u64,
    shared: Arc<Shared>,
    among: Connections,
}

/// Notes on a connection that the token came over it.
#[derive(Clone)]
pub(super) struct Trust(Arc<Shared>);

impl Connections {
    /// None yet, and so many at most that the program can open files beside them.
    pub(super) fn new() -> Self {
        let files = getrlimit(Resource::RLIMIT_NOFILE).map_or(0, |(files, _)| files);
        let files = usize::try_from(files).unwrap_or(usize::MAX);
        Self::at_most((files / PART_OF_FILES).clamp(2, MOST))
    }

    fn at_most(most: usize) -> Self {
        Self { most, open: Arc::default() }
    }

    /// Counts one more connection. If there are too many, the oldest without the token is closed for it; `None`: all have it.
    pub(super) fn add(&self, peer: IpAddr) -> Option<Connection> {
        let mut open = self.open();
        let n_of_peer = open.all.values().filter(|entry| entry.peer == peer).count();
        let is_peer_full = self.most / 2 <= n_of_peer;
        if is_peer_full || self.most <= open.all.len() {
            let oldest = open.all.iter().find(|(_, entry)| {
                (!is_peer_full || entry.peer == peer)
                    && !entry.shared.has_token.load(Ordering::Relaxed)
            });
            let number = *oldest?.0;
            open.all.remove(&number)?.shared.must_close.notify_one();
        }
        let number = open.next;
        open.next += 1;
        let shared = Arc::new(Shared::default());
        open.all.insert(number, Entry { peer, shared: Arc::clone(&shared) });
        drop(open);
        Some(Connection { number, shared, among: self.clone() })
    }

    fn open(&self) -> MutexGuard<'_, Open> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Connection {
    /// What notes that the token came.
    pub(super) fn trust(&self) -> Trust {
        Trust(Arc::clone(&self.shared))
    }

    /// Waits until the connection must be closed: another takes its place, or no token came in time.
    pub(super) async fn must_close(&self) {
        let too_long = async {
            tokio::time::sleep(WITHOUT_TOKEN).await;
            if self.shared.has_token.load(Ordering::Relaxed) {
                std::future::pending::<()>().await;
            }
        };
        tokio::select! {
            () = self.shared.must_close.notified() => {}
            () = too_long => {}
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.among.open().all.remove(&self.number);
    }
}

impl Trust {
    /// Notes that the token came.
    pub(super) fn has_token(&self) {
        self.0.has_token.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    fn peer(number: u8) -> IpAddr {
        Ipv4Addr::new(127, 0, 0, number).into()
    }

    #[test]
    fn who_has_no_token_gives_way_and_who_has_stays() {
        let connections = Connections::at_most(128);
        let trusted: Vec<Connection> = (0..2).filter_map(|_| connections.add(peer(1))).collect();
        trusted.iter().for_each(|connection| connection.trust().has_token());
        let others: Vec<Connection> = (0..200).filter_map(|_| connections.add(peer(1))).collect();
        assert_eq!((others.len(), connections.open().all.len()), (200, 64));
        assert!(trusted.iter().all(|it| connections.open().all.contains_key(&it.number)));
        let of_others: Vec<Connection> =
            (2..202).filter_map(|number| connections.add(peer(number))).collect();
        assert_eq!((of_others.len(), connections.open().all.len()), (200, 128));
        drop((others, of_others));
        assert_eq!(connections.open().all.len(), 2);
    }

    #[test]
    fn where_all_have_the_token_no_more_are_let_in() {
        let connections = Connections::at_most(128);
        let all: Vec<Connection> = (0..64)
            .filter_map(|_| connections.add(peer(1)))
            .inspect(|connection| connection.trust().has_token())
            .collect();
        assert_eq!(all.len(), 64);
        assert!(connections.add(peer(1)).is_none() && connections.add(peer(2)).is_some());
    }
}
