//! Which format a file has, by its first bytes.

use crate::formats::csv::{text, with_point};
use crate::time::{self, Dates, NoTime, Time};
use std::fmt::Write as _;

/// A format, its keys as a mapping writes them, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Form {
    /// Name of the format.
    pub format: &'static str,
    /// Its keys with their values, as TOML.
    pub keys: Vec<(&'static str, toml::Value)>,
    /// How the format was recognised.
    pub reason: String,
}

impl Form {
    fn new(format: &'static str, reason: impl Into<String>) -> Self {
        Self { format, keys: Vec::new(), reason: reason.into() }
    }

    fn with(mut self, key: &'static str, value: impl Into<toml::Value>) -> Self {
        self.keys.push((key, value.into()));
        self
    }
}

/// Formats that the program does not read, by how they begin, and what reads them.
const OTHERS: &[(&[u8], &str)] = &[
    (b"#ROSBAG", BAG),
    (b"\x89MCAP0\r\n", BAG),
    (b"SQLite format 3", BAG),
    (b"ULog\x01\x12\x35", ULOG),
    (
        b"\xa3\x95",
        "an ArduPilot DataFlash log; write it as CSV first (mavlogdump.py --format csv, of pymavlink)",
    ),
    (b"\x89HDF", "an HDF5 file; write its tables as CSV first (h5dump, or pandas in Python)"),
    (
        b"MATLAB 5.0",
        "a MATLAB file; write its variables as CSV first (writetable, or scipy.io in Python)",
    ),
    (b"\x93NUMPY", "a NumPy array; write it as CSV first (numpy.savetxt)"),
    (b"\xd4\xc3\xb2\xa1", PCAP),
    (b"\xa1\xb2\xc3\xd4", PCAP),
    (b"\x0a\x0d\x0d\x0a", PCAP),
    (b"PK\x03\x04", "a ZIP archive or a spreadsheet; unpack it, or save its table as CSV, first"),
    (b"BZh", "compressed by bzip2; decompress it first"),
    (b"\x28\xb5\x2f\xfd", "compressed by Zstandard; decompress it first"),
    (b"\xfd7zXZ", "compressed by xz; decompress it first"),
    (b"%PDF", "a PDF"),
    (b"\xff\xd8\xff", "a picture (JPEG)"),
    (b"\x89PNG", "a picture (PNG)"),
    (b"\xff\xfe", "text in UTF-16; save it as UTF-8 first"),
    (b"\xfe\xff", "text in UTF-16; save it as UTF-8 first"),
];
const BAG: &str = "a ROS bag, which the Python package reads: pip install 'murmuration-sim[rosbags]', then \
                   python -m murmuration.importers FILE --output table.csv";
const ULOG: &str = "a PX4 ULog, which the Python package reads: pip install 'murmuration-sim[ulog]', then \
                    python -m murmuration.importers FILE --output table.csv";
const PCAP: &str =
    "a packet capture; write its fields as CSV first (tshark -T fields -E header=y -E separator=,)";

/// The format of a file.
///
/// * `begin`: what it begins with, decompressed.
///
/// # Errors
///
/// The program reads no such file: what it is, and what reads it.
pub fn sniff(begin: &[u8]) -> Result<Form, String> {
    if begin.starts_with(b"PAR1") {
        return Ok(Form::new("parquet", "it begins with PAR1"));
    }
    if let Some((_, what)) = OTHERS.iter().find(|(magic, _)| begin.starts_with(magic)) {
        return Err((*what).to_owned());
    }
    if begin.iter().filter(|byte| **byte == 0).count() * 100 > begin.len() {
        return Err("no text, and of no binary format that is known".to_owned());
    }
    // A letter may be cut where the beginning ends.
    let whole = match std::str::from_utf8(begin) {
        Err(error) if begin.len() < error.valid_up_to() + 4 => &begin[..error.valid_up_to()],
        _ => begin,
    };
    let text = text(whole);
    let is_of_old_ends = !text.contains('\n') && text.contains('\r');
    let text = if is_of_old_ends { text.replace('\r', "\n").into() } else { text };
    let lines: Vec<&str> = whole_lines(&text);
    let first =
        lines.iter().find(|line| !line.trim().is_empty()).copied().unwrap_or_default().trim();
    if first.starts_with('{') {
        let is_k7 =
            first.contains("start_date") && lines.get(1).is_some_and(|line| line.contains("src"));
        return Ok(if is_k7 {
            Form::new("k7", "its first line is a JSON object with start_date")
        } else {
            json(first)
        });
    }
    if first.starts_with('[') {
        let n_bytes = first.split(']').next().unwrap_or_default().split(',').count();
        if n_bytes == 38 {
            return Ok(Form::new("openwsn-packets", "each line begins with 38 bytes in brackets"));
        }
        if text.trim_start().trim_start_matches('[').trim_start().starts_with('{') {
            return Ok(json(first.trim_start_matches('[').trim_start()));
        }
    }
    let is_contiki = |line: &&&str| line.contains("Sending request ") && line.contains(" to ");
    if lines.iter().filter(is_contiki).count() > 0 {
        return Ok(Form::new("contiki-packets", "lines say \"Sending request … to …\""));
    }
    // Other lines of its log modules have no fixed form.
    if 5 * lines.iter().filter(|line| line.contains("[INFO: ")).count() > lines.len() {
        return Err("a log of Contiki-NG in which no line says \"Sending request … to …\": when packets were sent and received cannot be known. \
                    Write these times as CSV first"
            .to_owned());
    }
    delimited(&lines)
}

/// Lines that are complete; the last one may not be.
fn whole_lines(text: &str) -> Vec<&str> {
    let mut lines: Vec<&str> = text.lines().collect();
    if 1 < lines.len() && !text.ends_with('\n') {
        lines.pop();
    }
    lines
}

/// JSON, with the list of receptions in its objects if they have one.
fn json(first: &str) -> Form {
    let form = Form::new("json-lines", "its lines are objects of JSON");
    let mut values = serde_json::Deserializer::from_str(first).into_iter::<serde_json::Value>();
    let Some(Ok(serde_json::Value::Object(object))) = values.next() else { return form };
    let is_list = |value: &&serde_json::Value| {
        let list = value.as_array().and_then(|list| list.first());
        list.is_some_and(serde_json::Value::is_object)
    };
    let mut lists = object.iter().filter(|(_, value)| is_list(value));
    match (lists.next(), lists.next()) {
        (Some((name, _)), None) => {
            let reason = format!(
                "its lines are objects of JSON, each with a list {name}: a row for each entry"
            );
            Form { reason, ..form }.with("each", name.clone())
        }
        _ => form,
    }
}

/// Lines of fields.
fn delimited(lines: &[&str]) -> Result<Form, String> {
    const DELIMITERS: [(char, &str); 6] = [
        ('\t', "tabs"),
        (';', "semicolons"),
        ('|', "bars"),
        (',', "commas"),
        (' ', "spaces"),
        (':', "colons"),
    ];
    let is_comment = |line: &&str| line.trim_start().starts_with('#');
    let has_comments = lines.iter().any(is_comment);
    let rows: Vec<&str> = lines
        .iter()
        .copied()
        .filter(|line| !line.trim().is_empty() && !is_comment(line))
        .take(200)
        .collect();
    if rows.len() < 2 {
        return Err("text with fewer than two rows".to_owned());
    }
    // Preambles and the ends of files may have other numbers of fields.
    let usual = |delimiter: char| {
        let counts: Vec<usize> = rows.iter().map(|line| fields(line, delimiter).len()).collect();
        let most =
            counts.iter().copied().max_by_key(|n| (counts.iter().filter(|c| *c == n).count(), *n));
        let most = most.unwrap_or(1);
        (most, counts.iter().filter(|n| **n == most).count())
    };
    let found = DELIMITERS.into_iter().map(|(delimiter, name)| (delimiter, name, usual(delimiter)));
    let fitting: Vec<_> = found.filter(|(_, _, (n, _))| 1 < *n).collect();
    let is_regular = |rows_of: usize| 10 * rows_of >= 9 * rows.len().saturating_sub(10).max(1);
    let chosen = fitting.iter().find(|(_, _, (_, rows_of))| is_regular(*rows_of));
    let chosen = chosen.or_else(|| fitting.iter().max_by_key(|(_, _, (_, rows_of))| *rows_of));
    let Some(&(delimiter, name, (n_fields, _))) = chosen else {
        if rows.iter().filter(|row| time::parse(row, 1).is_some()).count() * 2 > rows.len() {
            return Err("lines of one number each: which sender, receiver or robot they belong to cannot be known".to_owned());
        }
        return Err(
            "text without columns: no delimiter divides its lines into the same number of fields"
                .to_owned(),
        );
    };

    let is_row = |line: &str| {
        !line.trim().is_empty() && !is_comment(&line) && fields(line, delimiter).len() == n_fields
    };
    let at = lines.iter().position(|line| is_row(line)).unwrap_or(0);
    let header = fields(lines[at], delimiter);
    let body: Vec<Vec<String>> = rows
        .iter()
        .map(|line| fields(line, delimiter))
        .filter(|row| row.len() == n_fields)
        .collect();
    let mut form = Form::new("csv", format!("fields between {name}"));
    if delimiter != ',' {
        form = form.with("delimiter", delimiter.to_string());
    }
    let is_decimal_comma = delimiter != ',' && {
        let all = || body.iter().flatten();
        let n_commas = all().filter(|field| with_point(field).is_some()).count();
        let n_points =
            all().filter(|field| field.contains('.') && field.parse::<f64>().is_ok()).count();
        0 < n_commas && n_points < n_commas
    };
    if is_decimal_comma {
        form = form.with("decimal", "comma");
        form.reason.push_str(", decimal commas");
    }
    // A comment just above the rows may be their header.
    let is_value = |field: &String| is_value(field.as_str());
    let has_header = !header.iter().any(is_value);
    let above = lines[..at]
        .iter()
        .rev()
        .find(|line| !line.trim().is_empty())
        .filter(|line| is_comment(line));
    let commented =
        above.map(|line| fields(line.trim_start().trim_start_matches('#').trim_start(), delimiter));
    let names = commented
        .filter(|names| !has_header && names.len() == n_fields && !names.iter().any(is_value));
    if has_comments {
        form = form.with("comment", "#");
    }
    // What the reader skips as comments need not be skipped by number.
    let preamble =
        lines[..at].iter().filter(|line| !line.trim().is_empty() && !is_comment(line)).count();
    let names = match names {
        Some(names) => Some(names),
        None if !has_header => {
            Some((1..=n_fields).map(|number| format!("column_{number}")).collect())
        }
        None => distinct(&header),
    };
    let n_skipped = match &names {
        _ if preamble == 0 && (names.is_none() || !has_header) => 0,
        Some(_) if has_header => at + 1,
        _ => at,
    };
    if 0 < n_skipped {
        form = form.with("skip_lines", n_skipped as i64);
        let _ = write!(form.reason, ", after {n_skipped} lines of other text");
    }
    if let Some(names) = names {
        if !has_header {
            form.reason.push_str(", no line with names of columns");
        }
        form = form.with("names", toml::Value::from(names));
    }
    Ok(form)
}

/// Other names, if some are repeated.
fn distinct(header: &[String]) -> Option<Vec<String>> {
    let mut names: Vec<String> = Vec::new();
    for name in header {
        let mut distinct = name.trim_start_matches('\u{feff}').to_owned();
        let mut number = 2;
        while !distinct.is_empty() && names.contains(&distinct) {
            distinct = format!("{name}_{number}");
            number += 1;
        }
        names.push(distinct);
    }
    let is_same = names.iter().zip(header).all(|(a, b)| a == b.trim_start_matches('\u{feff}'));
    (!is_same).then_some(names)
}

/// Whether a field is a number or a time, and no name of a column.
fn is_value(field: &str) -> bool {
    field.parse::<f64>().is_ok()
        || with_point(field).is_some()
        || matches!(
            time::read(field, 1, Dates::default()),
            Ok(Time::Date(_) | Time::OfDay(_)) | Err(NoTime::Ambiguous)
        )
}

/// The fields of a line.
pub(super) fn fields(line: &str, delimiter: char) -> Vec<String> {
    if delimiter == ' ' {
        return line.split_whitespace().map(str::to_owned).collect();
    }
    let mut fields = vec![String::new()];
    let mut is_quoted = false;
    for c in line.trim_end_matches(['\r', '\n']).chars() {
        match c {
            '"' => is_quoted = !is_quoted,
            c if c == delimiter && !is_quoted => fields.push(String::new()),
            c => fields.last_mut().into_iter().for_each(|field| field.push(c)),
        }
    }
    fields.into_iter().map(|field| field.trim().to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(form: &Form, key: &str) -> Option<String> {
        form.keys.iter().find(|(known, _)| *known == key).map(|(_, value)| value.to_string())
    }

    #[test]
    fn delimiters_headers_and_preambles_are_recognised() {
        let form = |text: &str| sniff(text.as_bytes()).unwrap();
        let plain = form("t,tx,rssi\n0,1,-70\n1,2,-71\n");
        assert_eq!((plain.format, plain.keys.len()), ("csv", 0));
        let german =
            form("Zeit;Sender;RSSI\n04.03.2025 14:02:00;1;-70,5\n04.03.2025 14:02:01;1;-71,5\n");
        assert_eq!(key(&german, "delimiter").as_deref(), Some("\";\""));
        assert_eq!(key(&german, "decimal").as_deref(), Some("\"comma\""));
        let bare = form("2019-07-31T00:06:24Z\t5\t1.0\n2019-07-31T00:11:28Z\t5\t1.0\n");
        assert_eq!(
            key(&bare, "names").as_deref(),
            Some("[\"column_1\", \"column_2\", \"column_3\"]")
        );
        let commented = form("# made by me\n# timestamp tx ty\n1.5 2.0 3.0\n1.6 2.0 3.0\n");
        assert_eq!(key(&commented, "names").as_deref(), Some("[\"timestamp\", \"tx\", \"ty\"]"));
        assert_eq!(key(&commented, "comment").as_deref(), Some("\"#\""));
        let preamble = form("Logger v2\nserial 7\nt,tx,rssi\n0,1,-70\n1,2,-71\n2,2,-72\n");
        assert_eq!(key(&preamble, "skip_lines").as_deref(), Some("2"));
        let twice = form("t,x,x\n0,1,2\n1,2,3\n");
        assert_eq!(key(&twice, "names").as_deref(), Some("[\"t\", \"x\", \"x_2\"]"));
        assert_eq!(key(&twice, "skip_lines").as_deref(), Some("1"));
    }

    #[test]
    fn other_formats_are_recognised_or_named() {
        let format = |text: &str| sniff(text.as_bytes()).map(|form| form.format);
        assert_eq!(format("{\"start_date\": \"2018\"}\ndatetime,src,dst\n"), Ok("k7"));
        assert_eq!(format("{\"t\": 1}\n{\"t\": 2}\n"), Ok("json-lines"));
        let each = sniff(b"{\"t\": 1, \"rxInfo\": [{\"rssi\": -70}]}\n").unwrap();
        assert_eq!(key(&each, "each").as_deref(), Some("\"rxInfo\""));
        let bytes = format!("[{}] 0:00:01\n", ["1"; 38].join(", "));
        assert_eq!(format(&bytes), Ok("openwsn-packets"));
        assert_eq!(
            format("00:01.5 ID:2 [INFO: App] Sending request 1 to fd00::1\n"),
            Ok("contiki-packets")
        );
        assert!(sniff(b"1 2 [INFO: Main ] Node ID: 2\n").unwrap_err().contains("Sending request"));
        assert!(sniff(b"#ROSBAG V2.0\n").unwrap_err().contains("[rosbags]"));
        assert!(sniff(b"ULog\x01\x12\x35\x01").unwrap_err().contains("[ulog]"));
        assert!(sniff(b"-70\n-71\n-72\n").unwrap_err().contains("one number each"));
        assert!(sniff(&[1, 0, 2, 0, 0, 0]).unwrap_err().contains("no text"));
    }
}
