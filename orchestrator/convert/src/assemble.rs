//! From the files of a mapping to a table.

use crate::account::{self, Account, RejectedRows};
use crate::aggregate;
use crate::channels::{self, ChannelShare};
use crate::derive;
use crate::files::{self, Found};
use crate::formats::{Melted, Rows, WithFields};
use crate::frame::{self, Fields, Frame};
use crate::geodesy::TangentPlane;
use crate::join::{self, Joined};
use crate::labels::Labels;
use crate::lost::{self, Added};
use crate::mapping::{Input, JoinKind, Mapping, Start};
use crate::sequence::SequenceGaps;
use crate::tables::{COLUMNS, Content, TableKind, known};
use crate::{Conversion, ConvertError, Converted, InputReport, SCHEMA};
use input::Reading;
use input::result::Trust;
use measure::formats::open;
use measure::links::LOSSES_LOGGED;
use measure::memory::Memory;
use measure::table::DataTable;
use measure::time_of_day;
use proto::bounds::{CELLS, ROWS};
use proto::config::Problem;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Converts logs as a mapping says.
///
/// # Errors
///
/// The mapping does not fit the logs: every problem with its place in the mapping file. Or a log cannot be read, or needs more memory
/// than the budget.
pub fn convert(mapping: &Mapping, reading: impl Into<Reading>) -> Result<Converted, ConvertError> {
    let reading = reading.into();
    let files = files_of(mapping)?;
    check_fields(mapping, &files, reading)?;
    let mut state = State {
        mapping,
        files: &files,
        labels: Labels::default(),
        plane: mapping.origin_deg.map(TangentPlane::at),
        inputs: vec![InputState::default(); mapping.inputs.len()],
        n_lost: 0,
        n_unshared: 0,
        memory: Memory::new(reading.budget),
        trust: reading.trust,
    };
    let mut rows = Table::default();
    let (mut gaps, mut channels, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    for run in 0..files[0].len() {
        let frame = state.run(run, &mut gaps, &mut warnings)?;
        channels.extend(channels::shares(&frame, run as u32 + 1));
        rows.append(frame, run)?;
    }
    Ok(state.finish(rows, gaps, channels, warnings))
}

/// The files of each input; those of further inputs in the order of the runs.
///
/// # Errors
///
/// An input has none, or has not one for each run: every problem with its place in the mapping file.
pub fn files_of(mapping: &Mapping) -> Result<Vec<Vec<PathBuf>>, ConvertError> {
    let folder = mapping.path.parent().unwrap_or(Path::new(""));
    let mut problems = Vec::new();
    let mut found: Vec<Vec<Found>> = Vec::new();
    for (number, input) in mapping.inputs.iter().enumerate() {
        found.push(files::find(folder, &input.files).unwrap_or_else(|message| {
            let path = format!("input[{number}].files");
            problems.push(Problem::new(path, message).value(format!("{:?}", input.files)));
            Vec::new()
        }));
    }
    let (first, further) = found.split_at(1.min(found.len()));
    let runs = first.first().map_or(&[][..], |runs| &runs[..]);
    let mut files = vec![runs.iter().map(|found| found.path.clone()).collect::<Vec<_>>()];
    for (number, candidates) in (1..).zip(further) {
        let has_wildcards = files::is_pattern(&mapping.inputs[number].files);
        let mut of_input = Vec::new();
        for run in runs {
            let fits = |found: &&Found| !has_wildcards || found.wildcards == run.wildcards;
            match candidates.iter().find(fits) {
                Some(found) => of_input.push(found.path.clone()),
                None if candidates.is_empty() => {}
                None => problems.push(
                    Problem::new(
                        format!("input[{number}].files"),
                        format!(
                            "has no file in which the wildcards stand for {:?}, as in {}",
                            run.wildcards.join(", "),
                            run.path.display()
                        ),
                    )
                    .value(format!("{:?}", mapping.inputs[number].files)),
                ),
            }
        }
        files.push(of_input);
    }
    if problems.is_empty() { Ok(files) } else { Err(mapping.refuse(problems).into()) }
}

/// Whether the first file of each input has the fields that columns are filled from.
fn check_fields(
    mapping: &Mapping,
    files: &[Vec<PathBuf>],
    reading: Reading,
) -> Result<(), ConvertError> {
    let mut problems = Vec::new();
    for (number, (input, files)) in mapping.inputs.iter().zip(files).enumerate() {
        if let Some(file) = files.first() {
            let rows = rows_of(input, file, reading)?;
            let path = format!("input[{number}]");
            problems.extend(
                frame::check_fields(input, &path, rows.names(), file).err().unwrap_or_default(),
            );
        }
    }
    if problems.is_empty() { Ok(()) } else { Err(mapping.refuse(problems).into()) }
}

fn rows_of(input: &Input, file: &Path, reading: Reading) -> Result<Box<dyn Rows>, ConvertError> {
    let rows = (input.format.open)(file, open(file, reading)?, &input.keys)?;
    let rows = match files::fields(&input.files, file) {
        fields if fields.is_empty() => rows,
        fields => Box::new(WithFields::new(rows, fields)),
    };
    Ok(match &input.melt[..] {
        [] => rows,
        patterns => Box::new(Melted::new(rows, patterns)),
    })
}

/// What is kept over the runs.
struct State<'a> {
    mapping: &'a Mapping,
    files: &'a [Vec<PathBuf>],
    labels: Labels,
    plane: Option<TangentPlane>,
    inputs: Vec<InputState>,
    /// Lost packets or frames that were added for gaps.
    n_lost: usize,
    /// Senders of whose frames none was logged by two receivers.
    n_unshared: usize,
    /// What all rows take.
    memory: Memory,
    /// Whether logs that are files of a result are believed.
    trust: Trust,
}

#[derive(Clone, Default)]
struct InputState {
    n_read: usize,
    rejected: Vec<RejectedRows>,
    joined: Joined,
    /// The file that was read last, which may serve several runs.
    last: Option<(PathBuf, Frame)>,
}

impl State<'_> {
    /// The rows of a run.
    fn run(
        &mut self,
        run: usize,
        gaps: &mut Vec<SequenceGaps>,
        warnings: &mut Vec<String>,
    ) -> Result<Frame, ConvertError> {
        let mut base = self.read(0, run)?;
        if self.mapping.table == TableKind::Links && self.mapping.is_lost_from_gaps {
            let added = self.add_lost_frames(&mut base, run)?;
            self.n_lost += added.n_lost;
            gaps.extend(added.gaps);
            self.n_unshared += added.n_unshared;
        }
        for number in 1..self.mapping.inputs.len() {
            self.join(&mut base, number, run)?;
        }
        let file = &self.files[0][run];
        let input = &self.mapping.inputs[0];
        let state = &mut self.inputs[0];
        let mut account = Account { file, n_read: 0, rejected: &mut state.rejected };
        derive::start_at_zero(&mut base, self.mapping.start, &mut account);
        if input.is_cumulative {
            derive::differences(&mut base, &mut account);
        }
        derive::delivery_ratio(&mut base, &mut account);
        if let Some(period_ns) = self.mapping.aggregate_ns {
            if self.mapping.is_lost_from_gaps {
                warnings.extend(derive::drop_partial_channels(&mut base));
            }
            aggregate::aggregate(&mut base, period_ns, &mut account);
        }
        if self.mapping.table == TableKind::Packets && base.column("sequence").is_some() {
            let modulus = self.mapping.sequence_modulus;
            let found = derive::sequence_gaps(&mut base, run as u32 + 1, modulus, &mut account);
            if self.mapping.is_lost_from_gaps {
                self.n_lost += derive::add_lost_packets(&mut base, &found)
                    .map_err(|refusal| crate::formats::refused(file, refusal))?;
            }
            gaps.extend(found.into_iter().map(|(counts, _)| counts));
        }
        if base.n_rows() == 0 {
            warnings.push(format!("{} has no usable row", file.display()));
        }
        Ok(base)
    }

    /// Adds rows of frames that receivers did not log, before other inputs are joined onto all rows.
    fn add_lost_frames(&mut self, base: &mut Frame, run: usize) -> Result<Added, ConvertError> {
        let file = &self.files[0][run];
        let mut account = Account { file, n_read: 0, rejected: &mut self.inputs[0].rejected };
        if self.mapping.start == Start::Automatic && base.start_ns.is_none() {
            derive::reject_unset_clock(base, &mut account);
        }
        let modulus = self.mapping.sequence_modulus;
        let memory = &mut self.memory;
        lost::add_lost_frames(base, run as u32 + 1, modulus, &mut account, memory)
            .map_err(|refusal| crate::formats::refused(file, refusal).into())
    }

    /// Reads a file of an input.
    fn read(&mut self, number: usize, run: usize) -> Result<Frame, ConvertError> {
        let input = &self.mapping.inputs[number];
        let file = &self.files[number][run];
        let state = &mut self.inputs[number];
        if let Some((_, frame)) = state.last.as_ref().filter(|(last, _)| last == file) {
            return Ok(frame.clone());
        }
        let reading = Reading { budget: self.memory.left(), trust: self.trust };
        let mut rows = rows_of(input, file, reading)?;
        let mut account = Account { file, n_read: state.n_read, rejected: &mut state.rejected };
        let fields = Fields {
            dates: self.mapping.dates,
            is_without_repeats: self.mapping.is_without_repeats,
        };
        let (labels, memory) = (&mut self.labels, &mut self.memory);
        let mut frame = frame::read(input, &mut *rows, fields, labels, &mut account, memory)?;
        frame::project(&mut frame, &mut self.plane, &mut account);
        state.n_read = account.n_read;
        if 0 < number {
            state.last = Some((file.clone(), frame.clone()));
        }
        Ok(frame)
    }

    /// Joins a further input.
    fn join(&mut self, base: &mut Frame, number: usize, run: usize) -> Result<(), ConvertError> {
        let other = self.read(number, run)?;
        let input = &self.mapping.inputs[number];
        let joined = &mut self.inputs[number].joined;
        if input.has("node") {
            for (end, prefix) in [("tx", "tx_"), ("rx", "rx_")] {
                join::join(base, &other, input.join, Some((end, "node")), prefix, joined);
            }
            return Ok(());
        }
        let is_by_agent = base.column("agent").is_some() && input.has("agent");
        let keys = is_by_agent.then_some(("agent", "agent"));
        let found = join::join(base, &other, input.join, keys, "", joined);
        let file = &self.files[0][run];
        let mut account = Account { file, n_read: 0, rejected: &mut self.inputs[0].rejected };
        let within_s = input.join.within_ns as f64 / 1e9;
        let reason = match input.join.kind {
            JoinKind::Latest => format!("no row of input[{number}] in the {within_s} s before"),
            JoinKind::Nearest => format!("no row of input[{number}] within {within_s} s"),
            JoinKind::Interpolated => {
                format!("no row of input[{number}] within {within_s} s before and after")
            }
        };
        base.reject(&mut account, |_, row| (!found[row]).then(|| reason.clone()));
        Ok(())
    }

    /// The table, with the rows that the commands can use, and the answer.
    fn finish(
        mut self,
        rows: Table,
        mut gaps: Vec<SequenceGaps>,
        channels: Vec<ChannelShare>,
        mut warnings: Vec<String>,
    ) -> Converted {
        let numbers = self.labels.numbers(&self.mapping.names);
        for gaps in &mut gaps {
            gaps.source = numbers[gaps.source as usize];
            gaps.receiver = gaps.receiver.map(|receiver| numbers[receiver as usize]);
        }
        gaps.sort_by_key(|gaps| (gaps.run, gaps.source, gaps.receiver));
        let Table { columns, places } = rows;
        let targets = self.mapping.inputs.iter().flat_map(|input| &input.columns);
        let labels: BTreeSet<&str> = targets
            .filter(|target| target.content == Content::Label)
            .map(|target| &*target.name)
            .collect();
        let columns = columns.into_iter().map(|(name, mut values)| {
            if labels.contains(&*name) {
                for value in values.iter_mut().filter(|value| value.is_finite()) {
                    *value = f64::from(numbers[*value as usize]);
                }
            }
            (name, values)
        });
        let mut columns: Vec<(String, Vec<f64>)> = columns.collect();
        if self.files[0].len() == 1 && !self.mapping.inputs[0].has("run") {
            columns.retain(|(name, _)| name != "run");
        }
        let losses_logged = derive::losses_logged(&columns, self.mapping, &mut warnings);
        let n_rows = places.len();
        columns.extend(losses_logged.map(|is_logged| {
            (LOSSES_LOGGED.to_owned(), vec![f64::from(u8::from(is_logged)); n_rows])
        }));
        if 0 < self.n_unshared {
            warnings.push(format!(
                "no frame of {} senders was logged by two receivers, although several logged some. If each frame is for one receiver, the others \
                 did not lose it: write lost_from_gaps = false",
                self.n_unshared
            ));
        }
        let order = |name: &str| {
            let position = COLUMNS.iter().position(|column| column.name == name);
            position.or((name == LOSSES_LOGGED).then_some(COLUMNS.len()))
        };
        columns.retain(|(name, _)| known(name).is_none_or(|column| !column.is_intermediate));
        columns.retain(|(name, values)| {
            name != time_of_day::START || values.iter().any(|start_s| start_s.is_finite())
        });
        columns.sort_by_key(|(name, _)| order(name).unwrap_or(usize::MAX));
        let (names, values): (Vec<String>, Vec<Vec<f64>>) = columns.into_iter().unzip();
        let mut table = DataTable::of_columns(names, values);
        let mut refusal = None;
        match self.mapping.table.read(&table) {
            Ok(verdict) => {
                let used: BTreeSet<usize> = verdict.used.into_iter().collect();
                let lines: Vec<usize> = (0..table.n_rows()).map(|row| table.line(row)).collect();
                for rejected in verdict.rejected {
                    let (file, line) = places[rejected.first_line - lines[0]];
                    let file = &self.files[0][file as usize];
                    let list = &mut self.inputs[0].rejected;
                    account::add(list, &rejected.reason, file, line);
                    if let Some(known) = list.iter_mut().find(|r| r.reason == rejected.reason) {
                        known.rows += rejected.rows - 1;
                    }
                }
                let keep: Vec<bool> = lines.iter().map(|line| used.contains(line)).collect();
                table = kept(&table, &keep);
            }
            Err(reason) => refusal = Some(reason),
        }
        warnings.extend(derive::small_ratios(&table));
        let reports = self.inputs.into_iter().zip(&self.mapping.inputs).zip(self.files);
        let inputs: Vec<InputReport> = reports
            .enumerate()
            .map(|(number, ((state, input), files))| InputReport {
                files: distinct(files),
                format: input.format.variant.name,
                read: state.n_read,
                rejected: state.rejected,
                join: (0 < number).then(|| state.joined.report()),
            })
            .collect();
        let answer = Conversion {
            schema: SCHEMA,
            table: self.mapping.table,
            columns: table.names().to_vec(),
            read: inputs.first().map_or(0, |input| input.read),
            written: table.n_rows(),
            lost_from_gaps: self.n_lost,
            losses_logged,
            inputs,
            names: self.labels.named(&numbers).into_iter().collect(),
            origin_deg: self.plane.map(|plane| plane.origin_deg),
            gaps,
            channels,
            warnings,
        };
        Converted { table, answer, refusal }
    }
}

fn distinct(files: &[PathBuf]) -> Vec<String> {
    let mut names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    names.dedup();
    names
}

/// Rows of a table for which `keep` has true.
fn kept(table: &DataTable, keep: &[bool]) -> DataTable {
    let columns = table.names().iter().map(|name| {
        let values = table.column(name).unwrap_or_default().iter().zip(keep);
        values.filter(|(_, keep)| **keep).map(|(value, _)| *value).collect()
    });
    DataTable::of_columns(table.names().to_vec(), columns.collect())
}

/// The rows of all runs so far.
#[derive(Default)]
struct Table {
    columns: Vec<(String, Vec<f64>)>,
    /// Number of the file of the first input, and line in it.
    places: Vec<(u32, usize)>,
}

impl Table {
    fn append(&mut self, mut frame: Frame, run: usize) -> Result<(), ConvertError> {
        let n_rows = frame.n_rows();
        for (name, times_ns) in std::mem::take(&mut frame.times_ns) {
            let seconds = |ns: i64| if ns == frame::NO_TIME { f64::NAN } else { ns as f64 / 1e9 };
            frame.columns.push((name, times_ns.into_iter().map(seconds).collect()));
        }
        if frame.column("run").is_none() {
            frame.columns.push(("run".to_owned(), vec![run as f64 + 1.0; n_rows]));
        }
        self.places.extend(frame.lines.iter().map(|&line| (run as u32, line)));
        let rows = self.places.len() as u64;
        let cells = rows.saturating_mul(frame.columns.len() as u64);
        ROWS.check(rows)
            .and_then(|()| CELLS.check(cells))
            .map_err(|refusal| crate::formats::refused(Path::new("the table"), refusal))?;
        for (name, values) in frame.columns {
            match self.columns.iter_mut().find(|(known, _)| *known == name) {
                Some((_, column)) => column.extend(values),
                None => self.columns.push((name, values)),
            }
        }
        Ok(())
    }
}
