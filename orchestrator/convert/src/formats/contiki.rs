//! Packets of Contiki-NG motes that print when they send a request and when they receive one, as its examples do.
//!
//! ```text
//! 00:12.345  ID:3  [INFO: App       ] Sending request 7 to fd00::201:1:1:1
//! 00:12.501  ID:1  [INFO: App       ] Received request 'hello 7' from fd00::203:3:3:3
//! ```
//!
//! Before the brackets stand time and mote, in the form of the Cooja simulator (`00:12.345 ID:3`, `12345000 3` in µs), or of a testbed
//! (`1583411880.123456;m3-95;`). A mote's address is the one that it prints at its start ("Tentative link-local IPv6 address"), or as Cooja
//! assigns it, with the number of the mote as its last group.

use super::{Format, Row, Rows, UNCHECKED, refused};
use crate::time;
use measure::DataError;
use measure::formats::Content;
use proto::bounds::{LINE_BYTES, ROWS};
use proto::config::Variant;
use std::collections::BTreeMap;
use std::io::{BufRead as _, Read as _};
use std::net::Ipv6Addr;
use std::path::Path;

/// The format.
pub const FORMAT: Format = Format {
    variant: Variant {
        name: "contiki-packets",
        doc: "The lines of Contiki-NG motes, each with time and mote, that print \"Sending request 7 to …\" and \"Received request 'hello 7' from …\".",
        fields: &[],
    },
    columns: &[
        ("time_s", "time_s"),
        ("source", "source"),
        ("destination", "destination"),
        ("received_s", "received_s"),
        ("sequence", "sequence"),
    ],
    check: UNCHECKED,
    open,
};

const NAMES: [&str; 5] = ["time_s", "source", "destination", "received_s", "sequence"];
/// What a request takes until the log is read (bytes).
const BYTES_OF_REQUEST: u64 = 256;

fn open<'a>(
    path: &Path,
    content: Content<'a>,
    _: &toml::Table,
) -> Result<Box<dyn Rows + 'a>, DataError> {
    let (mut content, mut memory) = content.uncounted();
    let mut log = Log::default();
    let mut text = Vec::new();
    for line in 1.. {
        text.clear();
        let n = (&mut content)
            .take(LINE_BYTES.most + 1)
            .read_until(b'\n', &mut text)
            .map_err(|source| DataError::Read { path: path.to_owned(), source })?;
        if n == 0 {
            break;
        }
        let failed = |refusal: String| refused(path, format!("line {line}: {refusal}"));
        LINE_BYTES.check(n as u64).map_err(failed)?;
        if log.read(line, &String::from_utf8_lossy(&text)) {
            memory.take(BYTES_OF_REQUEST, "the requests").map_err(failed)?;
            ROWS.check(log.requests.len() as u64).map_err(failed)?;
        }
    }
    if log.requests.is_empty() {
        let message = "no line says \"Sending request … to\" behind a time and a mote";
        return Err(refused(path, message));
    }
    let names = NAMES.map(str::to_owned).into();
    Ok(Box::new(Packets { rows: log.finish().into_iter(), names }))
}

/// Requests that were sent, and by whom they were received.
#[derive(Default)]
struct Log {
    requests: Vec<Request>,
    /// Receptions: time (ns), receiver, address of the sender, number.
    receptions: Vec<(i64, String, Ipv6Addr, u64)>,
    /// Motes by the last half of their addresses.
    motes: BTreeMap<u64, String>,
}

struct Request {
    line: usize,
    time_ns: i64,
    mote: String,
    to: Ipv6Addr,
    sequence: u64,
}

impl Log {
    /// Reads a line. Returns whether something is kept of it.
    fn read(&mut self, line: usize, text: &str) -> bool {
        let Some((time_ns, mote, message)) = prefix(text) else { return false };
        if let Some((_, address)) = message.split_once("link-local IPv6 address") {
            let address = address.trim_start_matches([':', ' ']).trim();
            if let Ok(address) = address.parse::<Ipv6Addr>() {
                self.motes.insert(interface(address), mote.to_owned());
            }
            return true;
        }
        if let Some((_, request)) = message.split_once("Sending request ")
            && let Some((number, to)) = request.split_once(" to ")
            && let (Ok(sequence), Ok(to)) = (number.trim().parse(), to.trim().parse())
        {
            self.requests.push(Request { line, time_ns, mote: mote.to_owned(), to, sequence });
            return true;
        }
        if let Some((_, request)) = message.split_once("Received request ")
            && let Some((payload, from)) = request.rsplit_once(" from ")
            && let Some(from) = from.split_whitespace().next().and_then(|from| from.parse().ok())
            && let Some(sequence) = last_number(payload)
        {
            self.receptions.push((time_ns, mote.to_owned(), from, sequence));
            return true;
        }
        false
    }

    /// The mote that has an address.
    fn mote(&self, address: Ipv6Addr) -> String {
        let known = self.motes.get(&interface(address)).cloned();
        known.unwrap_or_else(|| address.segments()[7].to_string())
    }

    /// The rows, in the order of the requests: line, and fields by [`NAMES`].
    fn finish(mut self) -> Vec<(usize, [String; 5])> {
        let mut arrivals: BTreeMap<(String, u64), Vec<(i64, String)>> = BTreeMap::new();
        for (time_ns, receiver, from, sequence) in std::mem::take(&mut self.receptions) {
            arrivals.entry((self.mote(from), sequence)).or_default().push((time_ns, receiver));
        }
        arrivals.values_mut().for_each(|list| list.sort());
        let seconds =
            |ns: i64| format!("{}.{:09}", ns / 1_000_000_000, ns.rem_euclid(1_000_000_000));
        let row = |request: &Request| {
            // Numbers begin anew when a mote starts anew, so the first arrival afterwards is meant.
            let list = arrivals.get_mut(&(request.mote.clone(), request.sequence));
            let found = list.and_then(|list| {
                let at = list.iter().position(|(time_ns, _)| request.time_ns <= *time_ns)?;
                Some(list.remove(at))
            });
            let destination = self.mote(request.to);
            let received =
                found.as_ref().map_or_else(String::new, |(time_ns, _)| seconds(*time_ns));
            let fields = [
                seconds(request.time_ns),
                request.mote.clone(),
                destination,
                received,
                request.sequence.to_string(),
            ];
            (request.line, fields)
        };
        self.requests.iter().map(row).collect()
    }
}

/// Time (ns), mote and message of a line.
fn prefix(line: &str) -> Option<(i64, &str, &str)> {
    let line = line.trim();
    let is_between = |c: char| c.is_whitespace() || c == ';' || c == ',';
    let (time, rest) = line.split_once(is_between)?;
    let (mote, message) = rest.trim_start_matches(is_between).split_once(is_between)?;
    // Cooja's plain numbers are microseconds, the numbers of testbeds have a point.
    let is_count = time.bytes().all(|byte| byte.is_ascii_digit());
    let time_ns = match time.split_once(':') {
        Some((minutes, rest)) if !rest.contains(':') => {
            time::parse(&format!("0:{minutes}:{rest}"), time::NS_PER_S)?
        }
        _ => time::parse(time, if is_count { 1000 } else { time::NS_PER_S })?,
    };
    let mote = mote.strip_prefix("ID:").unwrap_or(mote);
    (!mote.is_empty()).then_some((time_ns, mote, message))
}

/// The last half of an address, which is of the mote alone. Its universal/local bit differs between the forms of an address.
fn interface(address: Ipv6Addr) -> u64 {
    address.to_bits() as u64 & !(1 << 57)
}

/// The last number in a text.
fn last_number(text: &str) -> Option<u64> {
    let end = text.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = text[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| at + text[at..].chars().next().map_or(1, char::len_utf8));
    text[start..end].parse().ok()
}

struct Packets {
    rows: std::vec::IntoIter<(usize, [String; 5])>,
    names: Vec<String>,
}

impl Rows for Packets {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn next(&mut self, row: &mut Row) -> Result<bool, DataError> {
        let Some((line, fields)) = self.rows.next() else { return Ok(false) };
        row.line = line;
        row.problem = None;
        row.fields.clear();
        fields.iter().for_each(|field| row.fields.push_field(field));
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use measure::memory::MemoryBudget;

    fn rows(text: &str) -> Vec<(usize, String)> {
        let content = Content::new(text.as_bytes(), MemoryBudget::default());
        let mut rows = open(Path::new("x.log"), content, &toml::Table::new()).unwrap();
        let (mut row, mut found) = (Row::default(), Vec::new());
        while rows.next(&mut row).unwrap() {
            found.push((row.line, row.fields.iter().collect::<Vec<_>>().join(",")));
        }
        found
    }

    #[test]
    fn requests_are_packets_and_arrive_where_they_are_received() {
        let text = "00:00.500\tID:1\t[INFO: Main      ] Starting Contiki-NG\n\
                    00:12.345\tID:10\t[INFO: App       ] Sending request 7 to fd00::201:1:1:1\n\
                    00:12.501\tID:1\t[INFO: App       ] Received request 'hello 7' from fd00::20a:a:a:a\n\
                    01:02.000\tID:10\t[INFO: App       ] Sending request 8 to fd00::201:1:1:1\n";
        let expected = [
            (2, "12.345000000,10,1,12.501000000,7".to_owned()),
            (4, "62.000000000,10,1,,8".to_owned()),
        ];
        assert_eq!(rows(text), expected);
        let text = "12345000 10 [INFO: App ] Sending request 7 to fd00::201:1:1:1\n";
        assert_eq!(rows(text), [(1, "12.345000000,10,1,,7".to_owned())]);
    }

    #[test]
    fn motes_of_a_testbed_have_the_addresses_that_they_print() {
        let text = "1583411880.5;m3-95;[INFO: Main ] Tentative link-local IPv6 address: fe80::a876\n\
                    1583411880.6;m3-1;[INFO: Main ] Tentative link-local IPv6 address: fe80::b081\n\
                    1583411890.25;m3-95;[INFO: App ] Sending request 1 to fd00::b081\n\
                    1583411890.75;m3-1;[INFO: App ] Received request 'hello 1' from fd00::a876\n";
        assert_eq!(
            rows(text),
            [(3, "1583411890.250000000,m3-95,m3-1,1583411890.750000000,1".to_owned())]
        );
    }
}
