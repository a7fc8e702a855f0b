//! A connection on which something happens.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// What happens to the bytes from the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Disturbance {
    /// The connection ends.
    Cut,
    /// They are held up for half a second.
    Delay,
    /// A block comes twice.
    Duplicate,
    /// A bit is flipped.
    Corrupt,
}

/// Passes bytes on between clients and a server.
pub(crate) struct Proxy {
    /// Where it listens.
    pub(crate) url: String,
    n_bytes: Arc<AtomicU64>,
}

impl Proxy {
    /// In front of the server at `url`; something happens once, when so many bytes have come from the server.
    pub(crate) fn start(url: &str, what: Option<(Disturbance, u64)>) -> anyhow::Result<Self> {
        let server = url.trim_start_matches("http://").to_owned();
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let url = format!("http://{}", listener.local_addr()?);
        let n_bytes = Arc::new(AtomicU64::new(0));
        let counter = Arc::clone(&n_bytes);
        std::thread::spawn(move || {
            for client in listener.incoming() {
                let (Ok(client), Ok(upstream)) = (client, TcpStream::connect(&server)) else {
                    continue;
                };
                // Each write is a step's: it must not wait for more.
                let _ = (client.set_nodelay(true), upstream.set_nodelay(true));
                let (Ok(mut from_client), Ok(mut to_server)) =
                    (client.try_clone(), upstream.try_clone())
                else {
                    continue;
                };
                std::thread::spawn(move || {
                    let _ = std::io::copy(&mut from_client, &mut to_server);
                    let _ = to_server.shutdown(Shutdown::Both);
                });
                let counter = Arc::clone(&counter);
                std::thread::spawn(move || pass_on(upstream, client, &counter, what));
            }
        });
        Ok(Self { url, n_bytes })
    }

    /// Bytes that have come from the server.
    pub(crate) fn n_bytes(&self) -> u64 {
        self.n_bytes.load(Ordering::SeqCst)
    }
}

fn pass_on(
    mut from: TcpStream,
    mut to: TcpStream,
    counter: &AtomicU64,
    what: Option<(Disturbance, u64)>,
) {
    let mut buffer = vec![0; 1 << 16];
    while let Ok(n @ 1..) = from.read(&mut buffer) {
        let before = counter.fetch_add(n as u64, Ordering::SeqCst);
        let happens = what.filter(|&(_, at)| (before..before + n as u64).contains(&at));
        match happens {
            Some((Disturbance::Cut, _)) => break,
            Some((Disturbance::Delay, _)) => std::thread::sleep(Duration::from_millis(500)),
            Some((Disturbance::Corrupt, at)) => {
                let i = (at - before) as usize;
                buffer[i] ^= 1 << (at % 8);
            }
            Some((Disturbance::Duplicate, _)) if to.write_all(&buffer[..n]).is_err() => break,
            Some((Disturbance::Duplicate, _)) | None => {}
        }
        if to.write_all(&buffer[..n]).is_err() {
            break;
        }
    }
    let _ = (from.shutdown(Shutdown::Both), to.shutdown(Shutdown::Both));
}
