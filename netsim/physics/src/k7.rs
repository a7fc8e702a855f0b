//! K7 files: traces of link quality over time, as published with the 6TiSCH simulator.
//!
//! A JSON object on the first line, column names on the second, then one row per link, channel and moment:
//!
//! ```text
//! {"start_date": "2018-01-11T16:32:22.0", "stop_date": …, "node_count": 50, "channels": [11, …], …}
//! datetime,src,dst,channel,mean_rssi,pdr,tx_count
//! 2018-01-11T16:32:22.0,0,18,11,-69.9,1.0,100
//! ```

use proto::bounds::{K7_BYTES, LINE_BYTES};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader, Read as _};

/// A measured trace in the K7 format: its header and its rows in order of time.
#[derive(Clone, Debug, PartialEq)]
pub struct K7 {
    /// What it says about itself.
    pub header: Header,
    /// Its rows, in the order of the file.
    pub rows: Vec<Row>,
}

/// What a trace says about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// How many nodes took part. They are numbered from 0.
    pub node_count: usize,
    /// Channels that were measured, 11 to 26.
    pub channels: Vec<u8>,
    /// From its beginning to its end (ns).
    pub duration_ns: u64,
}

/// One row: what was measured of a link on a channel from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// From when it holds (ns since the beginning). 0 for all rows before the first whose link and channel came before.
    pub from_ns: u64,
    /// Number of the node that sent.
    pub src: u32,
    /// Number of the node that listened.
    pub dst: u32,
    /// On which channel; `None`: on all.
    pub channel: Option<u8>,
    /// Mean RSSI of the frames received (dBm); `None`: there were none.
    pub rssi_dbm: Option<f64>,
    /// Share of frames received, 0 to 1.
    pub pdr: f64,
    /// Frames sent, if the row says so.
    pub tx_count: Option<u32>,
}

/// What is wrong with a K7 file, at which line (from 1).
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct Complaint {
    /// Line of the file, from 1.
    pub line: u64,
    /// What is wrong and what is allowed.
    pub reason: String,
}

/// That many complaints are listed; how many more there are is said.
const MOST_COMPLAINTS: usize = 8;

const COLUMNS: &str = "datetime,src,dst,channel,mean_rssi,pdr,tx_count";

/// What a K7 file, gzipped or plain, says about itself in its first line; `None` if that is none.
#[must_use]
pub fn header(content: &[u8]) -> Option<Header> {
    let mut line = String::new();
    if content.starts_with(&[0x1f, 0x8b]) {
        let unpacked = flate2::read::MultiGzDecoder::new(content);
        BufReader::new(unpacked.take(LINE_BYTES.most)).read_line(&mut line).ok()?;
    } else {
        content.take(LINE_BYTES.most).read_line(&mut line).ok()?;
    }
    Some(read_header(&line).ok()?.0)
}

/// Reads a K7 file, gzipped or plain.
///
/// # Errors
///
/// Everything that is wrong with it, the first few lines of it.
pub fn read(content: &[u8]) -> Result<K7, Vec<Complaint>> {
    let complain = |line: u64, reason: String| vec![Complaint { line, reason }];
    let unpacked = if content.starts_with(&[0x1f, 0x8b]) {
        K7_BYTES.read_text(flate2::read::MultiGzDecoder::new(content))
    } else {
        K7_BYTES.read_text(content)
    };
    let text =
        unpacked.map_err(|error| complain(1, format!("cannot be unpacked as text: {error}")))?;
    let (first, rest) = text.split_once('\n').unwrap_or((&text, ""));
    let (header, start_ns) = read_header(first).map_err(|reason| complain(1, reason))?;
    let (names, rest) = rest.split_once('\n').unwrap_or((rest, ""));
    if names.trim() != COLUMNS {
        return Err(complain(2, format!("must be {COLUMNS:?}, got {:?}", names.trim())));
    }

    let mut rows = Vec::new();
    let mut complaints = Vec::new();
    let mut n_more = 0;
    for (line, text) in (3..).zip(rest.lines()) {
        LINE_BYTES.check(text.len() as u64).map_err(|refusal| complain(line, refusal))?;
        if text.trim().is_empty() {
            continue;
        }
        match read_row(text, &header, start_ns) {
            Ok(row) => rows.push(row),
            Err(reason) if complaints.len() < MOST_COMPLAINTS => {
                complaints.push(Complaint { line, reason });
            }
            Err(_) => n_more += 1,
        }
    }
    if let Some(last) = complaints.last_mut()
        && 0 < n_more
    {
        last.reason.push_str(&format!(" (and {n_more} more lines)"));
    }
    if !complaints.is_empty() {
        return Err(complaints);
    }
    begin_at_zero(&mut rows);
    Ok(K7 { header, rows })
}

/// Rows hold from the beginning until a link and channel comes for the second time.
fn begin_at_zero(rows: &mut [Row]) {
    let mut seen = BTreeSet::new();
    for row in rows {
        if !seen.insert((row.src, row.dst, row.channel)) {
            return;
        }
        row.from_ns = 0;
    }
}

#[derive(Deserialize)]
struct RawHeader {
    start_date: String,
    stop_date: String,
    channels: Vec<u8>,
    node_count: usize,
}

fn read_header(line: &str) -> Result<(Header, i128), String> {
    let raw: RawHeader = serde_json::from_str(line).map_err(|error| {
        format!("must be a JSON object with start_date, stop_date, channels, node_count: {error}")
    })?;
    let date = |key: &str, text: &str| {
        nanoseconds(text)
            .ok_or_else(|| format!("{key} must be a date like 2018-01-11T16:32:22.0, got {text:?}"))
    };
    let start_ns = date("start_date", &raw.start_date)?;
    let stop_ns = date("stop_date", &raw.stop_date)?;
    if stop_ns <= start_ns {
        return Err(format!("stop_date, {}, must be after start_date", raw.stop_date));
    }
    if let Some(channel) = raw.channels.iter().find(|channel| !(11..=26).contains(*channel)) {
        return Err(format!("channels must be 11 to 26, got {channel}"));
    }
    if raw.node_count == 0 || 4096 < raw.node_count {
        return Err(format!("node_count must be from 1 to 4096, got {}", raw.node_count));
    }
    let duration_ns = (stop_ns - start_ns) as u64;
    Ok((Header { node_count: raw.node_count, channels: raw.channels, duration_ns }, start_ns))
}

fn read_row(text: &str, header: &Header, start_ns: i128) -> Result<Row, String> {
    let cells: Vec<&str> = text.trim_end().split(',').map(str::trim).collect();
    let [datetime, src, dst, channel, mean_rssi, pdr, tx_count] = cells[..] else {
        return Err(format!("must have 7 cells, got {}", cells.len()));
    };
    let from_ns = nanoseconds(datetime)
        .ok_or_else(|| format!("datetime must be like 2018-01-11T16:32:22.0, got {datetime:?}"))?
        - start_ns;
    if from_ns < 0 {
        return Err(format!("datetime must not be before start_date, got {datetime}"));
    }
    let node = |key: &str, cell: &str| {
        cell.parse::<u32>().ok().filter(|&node| (node as usize) < header.node_count).ok_or_else(
            || format!("{key} must be from 0 to {}, got {cell:?}", header.node_count - 1),
        )
    };
    let (src, dst) = (node("src", src)?, node("dst", dst)?);
    if src == dst {
        return Err(format!("src and dst must differ, got {src} twice"));
    }
    let channel = match channel {
        "" | "None" => None,
        cell => {
            Some(cell.parse().ok().filter(|channel| header.channels.contains(channel)).ok_or_else(
                || format!("channel must be one of {:?} or empty, got {cell:?}", header.channels),
            )?)
        }
    };
    let rssi_dbm = match mean_rssi {
        "" | "None" => None,
        cell => Some(
            cell.parse::<f64>()
                .ok()
                .filter(|rssi_dbm| rssi_dbm.is_finite())
                .ok_or_else(|| format!("mean_rssi must be a number or empty, got {cell:?}"))?,
        ),
    };
    let pdr = pdr
        .parse::<f64>()
        .ok()
        .filter(|pdr| (0.0..=1.0).contains(pdr))
        .ok_or_else(|| format!("pdr must be from 0 to 1, got {pdr:?}"))?;
    let tx_count = match tx_count {
        "" | "None" => None,
        cell => Some(
            cell.parse().map_err(|_| format!("tx_count must be a whole number, got {cell:?}"))?,
        ),
    };
    Ok(Row { from_ns: from_ns as u64, src, dst, channel, rssi_dbm, pdr, tx_count })
}

/// `2018-01-11T16:32:22.5` as nanoseconds since 1970. A space may stand in place of the T. The fraction has one to six digits, or is
/// left out.
#[must_use]
pub fn nanoseconds(text: &str) -> Option<i128> {
    let (date, time) = text.split_once(['T', ' '])?;
    let number = |text: &str, digits: std::ops::RangeInclusive<usize>| -> Option<i128> {
        let plain = text.bytes().all(|byte| byte.is_ascii_digit());
        (digits.contains(&text.len()) && plain).then(|| text.parse().ok())?
    };
    let mut date = date.split('-');
    let (year, month, day) =
        (number(date.next()?, 4..=4)?, number(date.next()?, 2..=2)?, number(date.next()?, 2..=2)?);
    let mut time = time.split(':');
    let (hour, minute) = (number(time.next()?, 2..=2)?, number(time.next()?, 2..=2)?);
    let seconds = time.next()?;
    let (second, fraction) = seconds.split_once('.').unwrap_or((seconds, "0"));
    let second = number(second, 2..=2)?;
    let micros = number(fraction, 1..=6)? * 10i128.pow(6 - fraction.len() as u32);
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let days_in_month = match month {
        2 => 28 + i128::from(leap),
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => return None,
    };
    let valid = date.next().is_none()
        && time.next().is_none()
        && (1..=days_in_month).contains(&day)
        && hour < 24
        && minute < 60
        && second < 60;
    if !valid {
        return None;
    }
    // Days since the first of March of year 0, the leap day being the last of its year.
    let (y, m) = if month <= 2 { (year - 1, month + 9) } else { (year, month - 3) };
    let days = 365 * y + y / 4 - y / 100 + y / 400 + (153 * m + 2) / 5 + day - 1 - 719_468;
    let total_s = ((days * 24 + hour) * 60 + minute) * 60 + second;
    Some((total_s * 1_000_000 + micros) * 1000)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    const HEADER: &str = "{\"start_date\": \"2018-01-11T16:32:22.0\", \"stop_date\": \
        \"2018-01-13T16:21:30.0\", \"channels\": [11, 12], \"node_count\": 3}\n\
        datetime,src,dst,channel,mean_rssi,pdr,tx_count\n";

    #[test]
    fn dates_are_counted_through_leap_years() {
        assert_eq!(nanoseconds("1970-01-01T00:00:00.0"), Some(0));
        assert_eq!(nanoseconds("2000-03-01T00:00:00"), Some(951_868_800_000_000_000));
        assert_eq!(nanoseconds("2018-01-11T16:32:22.25"), Some(1_515_688_342_250_000_000));
        assert_eq!(nanoseconds("2018-01-11 16:32:22.25"), Some(1_515_688_342_250_000_000));
        for wrong in ["2018-02-29T00:00:00.0", "2018-13-01T00:00:00.0", "2018-01-01_00:00:00", "x"]
        {
            assert_eq!(nanoseconds(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_gzipped_trace_reads_as_the_plain_one() {
        let text = format!("{HEADER}2018-01-11T16:32:22.0,0,2,12,,0.5,\n");
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        packed.write_all(text.as_bytes()).unwrap();
        let plain = read(text.as_bytes()).unwrap();
        assert_eq!(plain, read(&packed.finish().unwrap()).unwrap());
        assert_eq!(plain.header.duration_ns, 172_148_000_000_000);
        let row = plain.rows[0];
        assert_eq!((row.channel, row.rssi_dbm, row.tx_count), (Some(12), None, None));
    }

    #[test]
    fn every_wrong_line_is_named_with_what_is_allowed() {
        let text = format!(
            "{HEADER}2018-01-11T16:32:22.0,0,3,12,-70,0.5,100\n\
             2018-01-11T16:32:21.0,0,1,12,-70,0.5,100\n\
             2018-01-11T16:32:22.0,0,1,13,-70,0.5,100\n\
             2018-01-11T16:32:22.0,0,1,12,nan,0.5,100\n\
             2018-01-11T16:32:22.0,0,1,12,-70,1.5,100\n\
             2018-01-11T16:32:22.0,1,1,12,-70,1.5\n"
        );
        let complaints: Vec<String> =
            read(text.as_bytes()).unwrap_err().iter().map(ToString::to_string).collect();
        insta::assert_snapshot!(complaints.join("\n"), @r#"
        line 3: dst must be from 0 to 2, got "3"
        line 4: datetime must not be before start_date, got 2018-01-11T16:32:21.0
        line 5: channel must be one of [11, 12] or empty, got "13"
        line 6: mean_rssi must be a number or empty, got "nan"
        line 7: pdr must be from 0 to 1, got "1.5"
        line 8: must have 7 cells, got 6
        "#);
        let complaints = read(b"{}\n").unwrap_err();
        insta::assert_snapshot!(complaints[0].to_string(), @"line 1: must be a JSON object with start_date, stop_date, channels, node_count: missing field `start_date` at line 1 column 2");
    }
}
