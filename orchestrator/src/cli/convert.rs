//! `murmuration convert`: logs become a table of measurements.

use super::answers::{check_new, not_placed};
use super::{AllowFileArgs, Failure, ReadArgs, check_json, place_for, write_json};
use ::convert::channels::ChannelShare;
use ::convert::mapping::Mapping;
use ::convert::output::{self, OutputFormat};
use ::convert::tables::TableKind;
use ::convert::{Conversion, ConvertError, Converted, InputReport, RejectedRows, listed};
use clap::Args;
use experiment::Capability;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use terminal::{say, warn, warn_all};

#[derive(Args)]
pub(super) struct ConvertArgs {
    /// The mapping file (TOML): which logs there are, and which of their columns fill those of the table
    mapping: PathBuf,
    /// Write the table to this file (.csv, .csv.gz or .parquet) [default: the mapping's name, ending in .csv]
    #[arg(long, value_name = "FILE", alias = "out")]
    output: Option<PathBuf>,
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    allow: AllowFileArgs,
    /// Replace the file of --output if it exists
    #[arg(long)]
    replace: bool,
    /// Write what was read, written and rejected as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// `murmuration convert`.
pub(super) fn convert(args: &ConvertArgs) -> Result<(), Failure> {
    let out = args.output.clone().unwrap_or_else(|| args.mapping.with_extension("csv"));
    let format = OutputFormat::of_path(&out).ok_or_else(|| {
        Failure::request(format!(
            "--output {}: the file name must end in .csv, .csv.gz or .parquet; use {}.csv",
            out.display(),
            out.with_extension("").display()
        ))
    })?;
    check_new("--output", &out, args.replace)?;
    check_json(args.json.as_deref())?;
    let mapping = Mapping::read(&args.mapping).map_err(Failure::request)?;
    let failed = |error| match error {
        ConvertError::Mapping(refusal) => Failure::request(refusal),
        ConvertError::Log(error) => Failure::of_data(&error),
    };
    let files = ::convert::files_of(&mapping).map_err(failed)?;
    let refused = args.allow.consent().refusals(&outside(&mapping, &files));
    if !refused.is_empty() {
        return Err(Failure::request(mapping.refuse(refused)));
    }
    let converted = checked(::convert::convert(&mapping, args.read.reading()))?;
    let mut logs = converted.answer.inputs.iter().flat_map(|input| &input.files);
    if logs.any(|log| is_same(Path::new(log), &out)) {
        let text = format!("--output {}: is one of the logs; give another name", out.display());
        return Err(Failure::request(text));
    }
    let failed =
        |error: std::io::Error| Failure::work(format!("--output {}: {error}", out.display()));
    let mut file = place_for("--output", &out).map_err(Failure::work)?;
    output::write(&converted.table, format, &mut file).map_err(failed)?;
    let written = if args.replace { file.replace(&out) } else { file.place(&out) };
    written.map_err(|error| not_placed("--output", &out, &error))?;
    print(&out, &converted.answer);
    write_json(args.json.as_deref(), &converted.answer)
}

/// What was converted, if any of it can be used.
pub(super) fn checked(converted: Result<Converted, ConvertError>) -> Result<Converted, Failure> {
    let converted = converted.map_err(|error| match error {
        ConvertError::Mapping(refusal) => Failure::request(refusal),
        ConvertError::Log(error) => Failure::of_data(&error),
    })?;
    let answer = &converted.answer;
    let mut problems = Vec::new();
    for (number, input) in answer.inputs.iter().enumerate() {
        let unjoined = input.join.as_ref().filter(|join| join.matched == 0 && 0 < join.unmatched);
        if unjoined.is_some() {
            problems.push(format!(
                "input[{number}] ({}) was joined onto no row: its times or nodes are none of those of input[0]",
                input.files.join(", ")
            ));
        }
    }
    if let Some(reason) = &converted.refusal {
        problems.push(format!("none of {} rows can be used: {reason}", answer.read));
    } else if answer.written == 0 {
        problems.push(format!("none of {} rows can be used", answer.read));
        let rejected = answer.inputs.iter().flat_map(|input| &input.rejected);
        problems.extend(rejected.take(5).map(|rejected| {
            let RejectedRows { rows, reason, file, first_line } = rejected;
            format!("  {rows} rows: {reason} (first on line {first_line} of {file})")
        }));
        problems.extend(answer.warnings.iter().map(|warning| format!("  {warning}")));
    }
    if problems.is_empty() {
        return Ok(converted);
    }
    problems.push("no table was written".to_owned());
    Err(Failure::work(problems.join("\n")))
}

/// What a mapping reads outside of its own folder: a file of an input, or the folder of several.
fn outside(mapping: &Mapping, files: &[Vec<PathBuf>]) -> Vec<Capability> {
    let base = mapping.path.parent().unwrap_or(Path::new(""));
    let mut found = Vec::new();
    for (number, files) in files.iter().enumerate() {
        let mut of_folder: BTreeMap<&Path, Vec<&PathBuf>> = BTreeMap::new();
        for file in files {
            of_folder.entry(file.parent().unwrap_or(Path::new(""))).or_default().push(file);
        }
        for (folder, files) in of_folder {
            let asked = |path| Capability::of_file(format!("input[{number}].files"), path, base);
            let mut outside = files.into_iter().filter_map(|file| asked(file));
            let first = outside.next();
            found.extend(if outside.next().is_some() { asked(folder).or(first) } else { first });
        }
    }
    found
}

fn is_same(log: &Path, out: &Path) -> bool {
    log.canonicalize().is_ok_and(|log| out.canonicalize().is_ok_and(|out| log == out))
}

pub(super) fn print(out: &Path, answer: &Conversion) {
    let table = answer.table.name();
    let [read, written] = [answer.read, answer.written];
    say(format!("{}: {written} rows of {table} from {read} rows of logs", out.display()));
    say(format!("  columns   {}", answer.columns.join(", ")));
    for (number, input) in answer.inputs.iter().enumerate() {
        print_input(number, input);
    }
    if !answer.names.is_empty() {
        let names: Vec<String> =
            answer.names.iter().map(|(name, number)| format!("{name} = {number}")).collect();
        say(format!("  names     {}", listed(names.iter().map(String::as_str))));
    }
    if let Some([latitude, longitude]) = answer.origin_deg {
        say(format!("  origin    latitude {latitude}, longitude {longitude} (degrees)"));
    }
    let mut runs: BTreeMap<u32, [usize; 3]> = BTreeMap::new();
    for gaps in &answer.gaps {
        let sums = runs.entry(gaps.run).or_default();
        for (sum, value) in sums.iter_mut().zip([gaps.arrived, gaps.missing, gaps.restarts]) {
            *sum += value;
        }
    }
    for (run, [arrived, missing, restarts]) in runs {
        let sent = arrived + missing;
        let percent = 100.0 * missing as f64 / (sent as f64).max(1.0);
        let what = match answer.table {
            TableKind::Links => "frames were not logged, over all receivers",
            TableKind::Robots | TableKind::Packets => "sequence numbers are missing",
        };
        say(format!(
            "  gaps      run {run}: {missing} of {sent} {what} ({percent:.1} %), restarts: {restarts}"
        ));
    }
    if 0 < answer.lost_from_gaps {
        let what = if answer.table == TableKind::Links { "frames" } else { "packets" };
        say(format!("  lost      {} rows of lost {what} added for gaps", answer.lost_from_gaps));
    }
    if let Some(is_logged) = answer.losses_logged {
        let what = if is_logged {
            "losses_logged = 1: the table has"
        } else {
            "losses_logged = 0: the table lacks"
        };
        say(format!("  losses    {what} the frames that were lost"));
    }
    for run in answer.channels.chunk_by(|a, b| a.run == b.run) {
        say(channels(run));
    }
    warn_all(&answer.warnings);
}

/// The channels of a run on which fewer or more hops were received than on the mean channel.
fn channels(run: &[ChannelShare]) -> String {
    let listed = |word: &str, is_such: &dyn Fn(&ChannelShare) -> bool| {
        let such: Vec<String> = run
            .iter()
            .filter(|share| is_such(share))
            .map(|s| format!("{} ({:.2}, {:.2} to {:.2})", s.channel, s.relative, s.low, s.high))
            .collect();
        if such.is_empty() { format!("none {word}") } else { format!("{word} {}", such.join(", ")) }
    };
    format!(
        "  channels  run {}: hops received relative to the mean channel, with 95 % intervals: {}; {}",
        run.first().map_or(0, |share| share.run),
        listed("below it", &|share| share.high < 1.0),
        listed("above it", &|share| 1.0 < share.low)
    )
}

fn print_input(number: usize, input: &InputReport) {
    let files = match &input.files[..] {
        [one] => one.clone(),
        [first, .., last] => format!("{} files, {first} to {last}", input.files.len()),
        [] => String::new(),
    };
    say(format!(
        "  input[{number}]  {files}: {} rows read, {} rejected",
        input.read,
        input.n_rejected()
    ));
    if let Some(join) = &input.join {
        let age = match (join.median_age_s, join.greatest_age_s) {
            (Some(median), Some(greatest)) => {
                format!(", {median:.3} s apart in the median, {greatest:.3} s at most")
            }
            _ => String::new(),
        };
        say(format!(
            "            joined onto {} rows, not onto {}{age}",
            join.matched, join.unmatched
        ));
    }
    for rejected in &input.rejected {
        warn(format!(
            "input[{number}]: {} rows rejected: {} (first on line {} of {})",
            rejected.rows, rejected.reason, rejected.first_line, rejected.file
        ));
    }
}
