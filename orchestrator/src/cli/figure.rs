//! `murmuration figure`.

use super::answers::{check_new, not_placed};
use super::{Failure, ReadArgs, check_json, place_for, write_json};
use ::figure::content::Figure;
use ::figure::paint::{COLUMN_MM, PAGE_MM, drawing};
use ::figure::{FigureError, Request, figure as figure_of, is_kind_of_run, table};
use clap::Args;
use picture::pdf::pdf;
use picture::raster::{Canvas, png};
use picture::svg::svg;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use terminal::say;

#[derive(Args)]
pub(super) struct FigureArgs {
    /// Folder of a run or of a sweep, or an answer of compare, diagnose or power (--json)
    result: PathBuf,
    /// Of a run or an answer: the figure, such as trajectories; without one, those that there are are listed. Of a sweep:
    /// metrics such as pdr, each in a panel of its own [default: those of sweep.metrics]. Before it, further runs, whose
    /// curves are drawn over those of the first: `figure runs/a runs/b flock_speed`
    #[arg(value_name = "KIND")]
    words: Vec<String>,
    /// Write the figure to this file, which ends in .pdf, .svg or .png, or its numbers to one that ends in .csv
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Width: column (88 mm), page (180 mm), or a number of millimetres from 40 to 400
    #[arg(long, value_name = "WIDTH", default_value = "column", value_parser = width_mm)]
    width: f32,
    /// Of a sweep: what lies along the axis, a key that varies, or case [default: the first that varies]
    #[arg(long, value_name = "KEY")]
    x: Option<String>,
    /// Of a sweep: what colours tell apart [default: everything else that varies]
    #[arg(long, value_name = "KEY")]
    by: Option<String>,
    /// Of a run: from this simulated time on (s) [default: 0; of curves over time, when the robots start]. Of runs whose
    /// robots start at different times: since then
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = time_s)]
    from: Option<f64>,
    /// Of a run: until this simulated time (s)
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = time_s)]
    until: Option<f64>,
    #[command(flatten)]
    read: ReadArgs,
    /// Replace the file of --output if it exists
    #[arg(long)]
    replace: bool,
    /// Write what the figure shows as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl FigureArgs {
    /// The results, and the KINDs after them: of the words, those before the first that is no folder.
    fn results_and_kinds(&self) -> (Vec<PathBuf>, Vec<String>) {
        let is_result = |word: &&String| {
            !is_kind_of_run(word) && (word.contains('/') || Path::new(word).is_dir())
        };
        let n_further = self.words.iter().take_while(is_result).count();
        let (further, kinds) = self.words.split_at(n_further);
        let first = std::iter::once(self.result.clone());
        (first.chain(further.iter().map(PathBuf::from)).collect(), kinds.to_vec())
    }
}

/// Pixels per inch of a picture of pixels.
const PIXELS_PER_INCH: f32 = 300.0;
const POINTS_PER_INCH: f32 = 72.0;

fn width_mm(text: &str) -> Result<f32, String> {
    match text {
        "column" => Ok(COLUMN_MM),
        "page" => Ok(PAGE_MM),
        text => text.parse().ok().filter(|width| (40.0..=400.0).contains(width)).ok_or_else(|| {
            "must be column, page, or a number of millimetres from 40 to 400".to_owned()
        }),
    }
}

fn time_s(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|time_s| (0.0..=1e9).contains(time_s))
        .ok_or_else(|| "must be a number of seconds from 0 to 1e9".to_owned())
}

/// How a figure is written.
#[derive(Clone, Copy)]
enum Format {
    Pdf,
    Svg,
    Png,
    Csv,
}

impl Format {
    fn of_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_lowercase().as_str() {
            "pdf" => Some(Self::Pdf),
            "svg" => Some(Self::Svg),
            "png" => Some(Self::Png),
            "csv" => Some(Self::Csv),
            _ => None,
        }
    }

    fn bytes(self, figure: &Figure, width_mm: f32) -> Result<Vec<u8>, String> {
        let drawing = drawing(figure, width_mm);
        Ok(match self {
            Self::Pdf => pdf(&drawing),
            Self::Svg => svg(&drawing).into_bytes(),
            Self::Csv => table::csv(figure).into_bytes(),
            Self::Png => {
                let drawing = drawing.scaled(PIXELS_PER_INCH / POINTS_PER_INCH);
                let mut canvas = Canvas::new(&drawing).ok_or("is too large for pixels")?;
                png(canvas.paint(&drawing, false))
            }
        })
    }
}

/// Draws a figure of a run, a sweep or an answer.
pub(super) fn figure(args: &FigureArgs) -> Result<(), Failure> {
    let output = args.output.as_deref();
    let format = output
        .map(|path| {
            Format::of_path(path).ok_or_else(|| {
                Failure::request(format!(
                    "--output {}: the file name must end in .pdf, .svg, .png or .csv; use {}",
                    path.display(),
                    path.with_extension("pdf").display()
                ))
            })
        })
        .transpose()?;
    if let Some(path) = output {
        check_new("--output", path, args.replace)?;
    }
    check_json(args.json.as_deref())?;
    let (results, kinds) = args.results_and_kinds();
    let request = Request {
        kinds,
        x: args.x.clone(),
        by: args.by.clone(),
        from_s: args.from,
        until_s: args.until,
    };
    let figure =
        figure_of(&results, &request, args.read.reading()).map_err(|error| match error {
            FigureError::Request(text) => Failure::request(text),
            FigureError::Unbelieved(error) => Failure::work(error),
        })?;
    if args.output.is_none() && args.json.is_none() {
        return Err(Failure::request(
            "give --output FILE (.pdf, .svg, .png or .csv), or --json FILE",
        ));
    }
    if let (Some(path), Some(format)) = (output, format) {
        let bytes = format.bytes(&figure, args.width).map_err(|problem| {
            Failure::request(format!("--output {}: {problem}", path.display()))
        })?;
        let mut file = place_for("--output", path).map_err(Failure::work)?;
        file.write_all(&bytes)
            .map_err(|error| Failure::work(format!("--output {}: {error}", path.display())))?;
        let written = if args.replace { file.replace(path) } else { file.place(path) };
        written.map_err(|error| not_placed("--output", path, &error))?;
        say(format!("{}: {}", path.display(), figure.title));
        say(numbers::format::wrapped(&figure.caption, "  ", 80));
    }
    write_json(args.json.as_deref(), &figure)
}
