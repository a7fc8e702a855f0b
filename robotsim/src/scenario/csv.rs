//! Places from a file.

use super::{Entry, Place, Scenario};
use crate::context::Context;
use proto::config::{FilePath, Problem, Section, most_similar, variant};
use proto::ids::AgentId;
use proto::rng::Draws;

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Keys>("csv"),
    build: |table, context, problems| {
        let FilePath(file) = &Keys::read(table).file?;
        let Some(content) = context.files.get(file) else {
            problems.push(context.problem("file", "was not provided").value(format!("{file:?}")));
            return None;
        };
        match read(content, context.n_agents) {
            Ok(places) => Some(Box::new(Csv { places })),
            Err(mut wrong) => {
                let n_more = wrong.len().saturating_sub(SHOWN);
                wrong.truncate(SHOWN);
                if n_more != 0 {
                    wrong.push(format!("and {n_more} more problems"));
                }
                problems.extend(wrong.into_iter().map(|wrong| in_file(context, file, &wrong)));
                None
            }
        }
    },
};

/// Positions from a CSV file: a header agent,x_m,y_m\[,z_m\]\[,heading_rad\], then one line per agent in any order. Lines that begin with #
/// are comments.
#[derive(Section)]
struct Keys {
    /// The file, relative to the configuration.
    #[key(required)]
    file: Option<FilePath>,
}

/// Of the problems within a file, at most this many are shown.
const SHOWN: usize = 20;

/// After so many problems the rest of the file is not read.
const MOST_WRONG: usize = 1000;

/// Coordinates must lie within this of the origin (m): a quarter of the Earth's circumference.
const FARTHEST_M: f64 = 1e7;

const COLUMNS: [&str; 5] = ["agent", "x_m", "y_m", "z_m", "heading_rad"];

/// Places by agent.
#[derive(Debug)]
struct Csv {
    places: Vec<Place>,
}

impl Scenario for Csv {
    fn place(&self, agent: AgentId, _n_agents: usize, _draws: Draws) -> Place {
        self.places[agent.index()]
    }
}

fn in_file(context: &Context<'_>, file: &str, wrong: &str) -> Problem {
    context.problem("file", format!("{file}: {wrong}"))
}

/// One place per agent, or everything that is wrong.
fn read(content: &[u8], n_agents: usize) -> Result<Vec<Place>, Vec<String>> {
    let content = content.strip_prefix(b"\xef\xbb\xbf").unwrap_or(content);
    let mut reader = ::csv::ReaderBuilder::new()
        .flexible(true)
        .trim(::csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(content);
    let columns = match reader.headers() {
        Ok(headers) => columns(headers)?,
        Err(error) => return Err(vec![error.to_string()]),
    };
    let mut wrong = Vec::new();
    let mut rows: Vec<Option<(u64, Place)>> = vec![None; n_agents];
    for record in reader.records() {
        if MOST_WRONG <= wrong.len() {
            wrong.push("no further lines are read".to_owned());
            return Err(wrong);
        }
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                wrong.push(error.to_string());
                continue;
            }
        };
        let line = record.position().map_or(0, |position| line(content, position));
        let before = wrong.len();
        let row = read_row(&record, columns, n_agents, &mut wrong);
        for text in &mut wrong[before..] {
            text.insert_str(0, &format!("line {line}: "));
        }
        let Some((agent, place)) = row else { continue };
        if let Some((first, _)) = rows[agent] {
            wrong.push(format!(
                "line {line}: agent {agent} already has a position, in line {first}"
            ));
        } else {
            rows[agent] = Some((line, place));
        }
    }
    let missing: Vec<String> = (0..n_agents)
        .filter(|&agent| rows[agent].is_none())
        .map(|agent| agent.to_string())
        .collect();
    if !missing.is_empty() {
        let listed = missing[..missing.len().min(10)].join(", ");
        let more = if 10 < missing.len() { ", ..." } else { "" };
        wrong.push(format!(
            "must have a valid line for each of {n_agents} agents; {} have none: {listed}{more}",
            missing.len()
        ));
    }
    coincidences(&rows, &mut wrong);
    if wrong.is_empty() {
        Ok(rows.into_iter().flatten().map(|row| row.1).collect())
    } else {
        Err(wrong)
    }
}

/// The line that a record stands in: its position is where the reader began to look, before comments and empty lines.
fn line(content: &[u8], position: &::csv::Position) -> u64 {
    let rest = content.get(position.byte() as usize..).unwrap_or_default();
    let n_skipped = rest
        .split(|&byte| byte == b'\n')
        .take_while(|line| line.first().is_none_or(|&byte| byte == b'#' || byte == b'\r'))
        .count();
    position.line() + n_skipped as u64
}

/// Where each of [`COLUMNS`] stands.
fn columns(headers: &::csv::StringRecord) -> Result<[Option<usize>; 5], Vec<String>> {
    let mut wrong = Vec::new();
    for (index, header) in headers.iter().enumerate() {
        if !COLUMNS.contains(&header) {
            let nearest = most_similar(header, COLUMNS)
                .map_or_else(String::new, |nearest| format!(" (nearest valid: {nearest})"));
            wrong.push(format!("line 1: {header:?} is not a known column{nearest}"));
        } else if headers.iter().take(index).any(|other| other == header) {
            wrong.push(format!("line 1: column {header} occurs twice"));
        }
    }
    let found = COLUMNS.map(|column| headers.iter().position(|header| header == column));
    for (column, index) in COLUMNS.iter().zip(found).take(3) {
        if index.is_none() {
            wrong.push(format!("line 1: column {column} is missing"));
        }
    }
    if wrong.is_empty() { Ok(found) } else { Err(wrong) }
}

/// An agent and its place, or `None` after saying what is wrong.
fn read_row(
    record: &::csv::StringRecord,
    columns: [Option<usize>; 5],
    n_agents: usize,
    wrong: &mut Vec<String>,
) -> Option<(usize, Place)> {
    let [agent_column, x, y, z, heading] = columns;
    let n_columns = columns.iter().flatten().count();
    if record.len() != n_columns {
        wrong.push(format!("must have {n_columns} entries, got {}", record.len()));
        return None;
    }
    let text = agent_column.map_or("", |index| &record[index]);
    let agent = text.parse().ok().filter(|&agent: &usize| agent < n_agents);
    if agent.is_none() {
        wrong.push(format!("agent must be a whole number from 0 to {}, got {text}", n_agents - 1));
    }
    let mut number = |name: &str, column: Option<usize>, largest: f64| {
        let Some(index) = column else { return Some(0.0) };
        // Adding 0 makes 0 of -0, so that equal places are equal.
        let number = record[index].parse::<f64>().ok().map(|number| number + 0.0);
        let number = number.filter(|number| number.is_finite() && number.abs() <= largest);
        if number.is_none() {
            let text = &record[index];
            wrong.push(format!("{name} must be a number from -{largest} to {largest}, got {text}"));
        }
        number
    };
    let position_m =
        [number("x_m", x, FARTHEST_M), number("y_m", y, FARTHEST_M), number("z_m", z, FARTHEST_M)];
    let turn = number("heading_rad", heading, 1e3);
    let heading_rad = heading.and(turn);
    let [x_m, y_m, z_m] = position_m;
    turn?;
    Some((agent?, Place { position_m: [x_m?, y_m?, z_m?], heading_rad }))
}

/// Two robots cannot stand in one place.
fn coincidences(rows: &[Option<(u64, Place)>], wrong: &mut Vec<String>) {
    let mut places: Vec<([f64; 3], usize, u64)> = rows
        .iter()
        .enumerate()
        .filter_map(|(agent, row)| row.map(|(line, place)| (place.position_m, agent, line)))
        .collect();
    places.sort_by(|a, b| {
        let by_axis = a.0.iter().zip(&b.0).map(|(a, b)| a.total_cmp(b));
        by_axis.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then).then(a.1.cmp(&b.1))
    });
    for pair in places.windows(2) {
        let [(first_m, first, first_line), (second_m, second, second_line)] = pair else {
            continue;
        };
        if first_m == second_m {
            wrong.push(format!(
                "line {second_line}: agent {second} has the same position as agent {first} of line {first_line}, \
                 {first_m:?} m"
            ));
        }
    }
}
