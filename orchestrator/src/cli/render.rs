//! `murmuration render`.

use super::answer_file::Answer;
use super::{
    Failure, ReadArgs, check_json, check_place, place_for, replay, write_json, write_whole,
};
use clap::{ArgGroup, Args, ValueEnum};
use numbers::format::{count, count_of, trimmed};
use picture::colours::Theme;
use picture::layout::{Layout, LinkColour, Style};
use picture::raster::{Canvas, png};
use picture::span::FrameSpan;
use picture::stage::{Director, Stage, TRAIL_NS};
use picture::svg::svg;
use picture::video::{Format, VideoError, VideoWriter};
use proto::types::{NS_PER_S, seconds};
use run::interrupt::on_signal;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use terminal::{ProgressDisplay, say};
use view::recorded::RecordedRun;

#[derive(Args)]
#[command(group(ArgGroup::new("what").required(true).args(["at", "video"])))]
pub(super) struct RenderArgs {
    /// Folder of a recorded run
    run: PathBuf,
    /// Draw a picture of the last step at or before this simulated time (s)
    #[arg(long, value_name = "S", requires = "output", allow_negative_numbers = true, value_parser = time_s)]
    at: Option<f64>,
    /// Write the picture to this file, which ends in .svg or .png
    #[arg(long, value_name = "FILE", requires = "at")]
    output: Option<PathBuf>,
    /// Write the drawn positions (m), links and trails as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE", requires = "at")]
    json: Option<PathBuf>,
    /// Write a video to this file, which ends in .mp4, .webm (both need ffmpeg) or .gif
    #[arg(long, value_name = "FILE")]
    video: Option<PathBuf>,
    /// Simulated seconds per second of the video
    #[arg(long, value_name = "FACTOR", requires = "video", default_value_t = 1.0, allow_negative_numbers = true, value_parser = speed)]
    speed: f64,
    /// Frames per second of the video: 1 to 60, for .gif at most 50
    #[arg(long, value_name = "N", requires = "video", default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..=60))]
    fps: u32,
    /// Begin the video at this simulated time (s) [default: 0]
    #[arg(long, value_name = "S", requires = "video", allow_negative_numbers = true, value_parser = time_s)]
    from: Option<f64>,
    /// End the video at this simulated time (s) [default: the end of the run]
    #[arg(long, value_name = "S", requires = "video", allow_negative_numbers = true, value_parser = time_s)]
    until: Option<f64>,
    /// Quantity that the colour of links shows
    #[arg(long, value_name = "BY", default_value = "delivery")]
    links: LinksBy,
    /// Keep this robot in the middle
    #[arg(long, value_name = "ROBOT")]
    follow: Option<u32>,
    /// Show at least this many metres around the followed robot [default: the largest distance of any other robot
    /// from it]
    #[arg(long, value_name = "M", requires = "follow", allow_negative_numbers = true, value_parser = span_m)]
    span: Option<f64>,
    /// Also draw the places that an answer of `diagnose --json` estimates
    #[arg(long, value_name = "FILE")]
    diagnosis: Option<PathBuf>,
    /// Width and height in pixels, from 320x240 to 4096x4096 [default: what is drawn fills the picture]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,
    /// Show all places that robots visit in the run, so that pictures of different times have the same axes
    #[arg(long, conflicts_with = "follow")]
    whole_run: bool,
    /// Draw on a dark background
    #[arg(long)]
    dark: bool,
    #[command(flatten)]
    read: ReadArgs,
}

/// What colours links.
#[derive(Clone, Copy, ValueEnum)]
enum LinksBy {
    /// Received signal strength of the last delivered frame, from -100 to -50 dBm
    Rssi,
    /// Share of the sender's broadcast frames that were delivered
    Delivery,
    /// Draw no links
    None,
}

/// Most frames of a video.
const MOST_FRAMES: u64 = 20_000;
/// Least and greatest width and height (px).
const LEAST_SIZE: [u32; 2] = [320, 240];
const MOST_SIZE: u32 = 4096;
/// Most frames per second of a GIF: players show shorter frames for longer.
const MOST_GIF_FPS: u32 = 50;

fn time_s(text: &str) -> Result<f64, String> {
    let time_s: Option<f64> = text.parse().ok();
    time_s
        .filter(|time_s| (0.0..=1e9).contains(time_s))
        .ok_or_else(|| "must be a number of seconds from 0 to 1e9".to_owned())
}

fn speed(text: &str) -> Result<f64, String> {
    let speed: Option<f64> = text.parse().ok();
    speed
        .filter(|speed| (1e-3..=1e6).contains(speed))
        .ok_or_else(|| "must be a number from 0.001 to 1000000".to_owned())
}

fn span_m(text: &str) -> Result<f64, String> {
    let span_m: Option<f64> = text.parse().ok();
    span_m
        .filter(|span_m| (1.0..=1e6).contains(span_m))
        .ok_or_else(|| "must be a number of metres from 1 to 1000000".to_owned())
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let [least_width, least_height] = LEAST_SIZE;
    text.split_once('x')
        .and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]))
        .filter(|[width, height]| {
            (least_width..=MOST_SIZE).contains(width) && (least_height..=MOST_SIZE).contains(height)
        })
        .ok_or_else(|| {
            format!(
                "must be a width and a height in pixels from {least_width}x{least_height} to {MOST_SIZE}x{MOST_SIZE}, as in 1280x720"
            )
        })
}

/// Draws a recorded run.
pub(super) fn render(args: &RenderArgs) -> Result<(), Failure> {
    match (&args.at, &args.output, &args.video) {
        (Some(at_s), Some(output), _) => picture(args, *at_s, output),
        (_, _, Some(path)) => video(args, path),
        // The command line requires one of the two.
        _ => Err(Failure::request("--at with --output, or --video: give one of them")),
    }
}

impl RenderArgs {
    fn style(&self) -> Style {
        let links = match self.links {
            LinksBy::Rssi => LinkColour::Rssi,
            LinksBy::Delivery => LinkColour::Delivery,
            LinksBy::None => LinkColour::None,
        };
        Style { size: self.size, is_dark: self.dark, links }
    }

    /// The run, with what was estimated of its place.
    fn open(&self) -> Result<RecordedRun, Failure> {
        let mut run = replay::open(&self.read.open(&self.run)?)?;
        if let Some(path) = &self.diagnosis {
            run.add_estimates(&Answer::of_option(path)?.estimates());
        }
        Ok(run)
    }

    /// What pictures of a span have in common.
    fn stage(&self, run: &RecordedRun, shown_ns: [u64; 2]) -> Result<Stage, Failure> {
        let follow = self.follow.map(|robot| robot as usize);
        let shown_ns = if self.whole_run { [0, run.run().end_ns] } else { shown_ns };
        let mut stage = Stage::new(run, follow, shown_ns).map_err(Failure::work)?;
        if let Some(span_m) = self.span {
            stage.set_span(span_m);
        }
        Ok(stage)
    }

    fn check_follow(&self, run: &RecordedRun) -> Result<(), Failure> {
        let n = run.run().agent_count;
        match self.follow.filter(|robot| n <= *robot) {
            Some(robot) => Err(Failure::request(format!(
                "--follow {robot}: robots of this run have numbers from 0 to {}",
                n.saturating_sub(1)
            ))),
            None => Ok(()),
        }
    }
}

/// A simulated time within the run (ns).
fn time_ns(option: &str, time_s: f64, run: &RecordedRun) -> Result<u64, Failure> {
    let time_ns = libm::round(time_s * NS_PER_S as f64) as u64;
    let end_ns = run.run().end_ns;
    if end_ns < time_ns {
        return Err(Failure::request(format!(
            "{option} {}: the run ends at {end} s; give a time from 0 to {end}",
            trimmed(time_s, 9),
            end = trimmed(seconds(end_ns), 9)
        )));
    }
    Ok(time_ns)
}

/// Draws one moment.
fn picture(args: &RenderArgs, at_s: f64, output: &Path) -> Result<(), Failure> {
    let extension = output.extension().unwrap_or_default().to_ascii_lowercase();
    let is_svg = extension == "svg";
    if !is_svg && extension != "png" {
        return Err(Failure::request(format!(
            "--output {}: a picture is written as .svg or .png; end the name with one of them",
            output.display()
        )));
    }
    check_place("--output", output)?;
    check_json(args.json.as_deref())?;
    let run = args.open()?;
    args.check_follow(&run)?;
    let at_ns = time_ns("--at", at_s, &run)?;
    let stage = args.stage(&run, [at_ns, at_ns])?;
    let mut director = Director::new(&stage);
    let mut trail = FrameSpan::every(&run, at_ns.saturating_sub(TRAIL_NS), at_ns, TRAIL_NS / 60);
    while let Some(frame) = trail.next_frame().map_err(Failure::work)? {
        director.pass(&frame);
    }
    let frames = run.frames(at_ns, at_ns, 0).map_err(Failure::work)?;
    let scene = frames.first().map(|frame| director.scene(frame)).unwrap_or_default();
    let drawing = Layout::new(&stage, args.style()).drawing(&scene);
    if is_svg {
        write_whole("--output", output, svg(&drawing))?;
    } else {
        let mut canvas = Canvas::new(&drawing).ok_or_else(no_room)?;
        write_whole("--output", output, png(canvas.paint(&drawing, false)))?;
    }
    write_json(args.json.as_deref(), &scene)?;
    let n_alive = scene.robots.iter().filter(|robot| robot.alive).count();
    say(format!(
        "{}: step {} at {} s, {}, {}",
        output.display(),
        count(scene.step),
        trimmed(scene.time_s, 9),
        count_of(n_alive as u64, "robot"),
        count_of(scene.links.len() as u64, "link")
    ));
    Ok(())
}

fn no_room() -> Failure {
    Failure::work("there is no room for the picture")
}

/// When the frames of a video are (ns).
struct Schedule {
    from_ns: u64,
    spacing_ns: f64,
    n_frames: u64,
}

impl Schedule {
    fn new(args: &RenderArgs, run: &RecordedRun) -> Result<Self, Failure> {
        let end_ns = run.run().end_ns;
        let from_ns = time_ns("--from", args.from.unwrap_or_default(), run)?;
        let until_ns = args.until.map_or(Ok(end_ns), |until| time_ns("--until", until, run))?;
        if until_ns < from_ns {
            return Err(Failure::request(format!(
                "--until {until}: is before --from {from}; give a time from {from} to {end}",
                until = trimmed(seconds(until_ns), 9),
                from = trimmed(seconds(from_ns), 9),
                end = trimmed(seconds(end_ns), 9)
            )));
        }
        let span_ns = (until_ns - from_ns) as f64;
        let spacing_ns = args.speed / f64::from(args.fps) * NS_PER_S as f64;
        // The last step is shown though the spacing is not exact.
        let n_frames = libm::floor(span_ns / spacing_ns + 1e-6) as u64 + 1;
        if MOST_FRAMES < n_frames {
            let least_speed =
                span_ns / NS_PER_S as f64 * f64::from(args.fps) / (MOST_FRAMES - 1) as f64;
            let least_speed = libm::ceil(least_speed * 1000.0) / 1000.0;
            return Err(Failure::request(format!(
                "--video: {} frames are more than {}; raise --speed to at least {}, lower --fps, or choose a shorter span by --from and --until",
                count(n_frames),
                count(MOST_FRAMES),
                trimmed(least_speed, 3)
            )));
        }
        Ok(Self { from_ns, spacing_ns, n_frames })
    }

    fn at_ns(&self, number: u64) -> u64 {
        self.from_ns + libm::round(number as f64 * self.spacing_ns) as u64
    }
}

/// Makes a video.
fn video(args: &RenderArgs, path: &Path) -> Result<(), Failure> {
    let format = format_of(args, path)?;
    let file = place_for("--video", path).map_err(Failure::request)?;
    let run = args.open()?;
    args.check_follow(&run)?;
    let schedule = Schedule::new(args, &run)?;
    let style = args.style();
    let failed = |error: VideoError| Failure::work(format!("--video {}: {error}", path.display()));
    let interrupt = Arc::new(AtomicBool::new(false));
    let set = Arc::clone(&interrupt);
    // The work ends after the frame under way, and removes what it wrote.
    on_signal(move |_| set.store(true, Ordering::Relaxed)).map_err(Failure::work)?;
    let is_interrupted = || interrupt.load(Ordering::Relaxed);
    let last_ns = schedule.at_ns(schedule.n_frames - 1);
    let stage = args.stage(&run, [schedule.from_ns, last_ns])?;
    let theme = Theme::new(style.is_dark);
    let layout = Layout::new(&stage, style);
    let size = layout.size().map(|pixels| pixels as u16);
    let mut writer =
        VideoWriter::begin(file.path(), format, size, args.fps, &theme).map_err(failed)?;

    let mut director = Director::new(&stage);
    // Trails begin before the video does.
    let before_ns = schedule.from_ns.saturating_sub(TRAIL_NS);
    let mut frames = FrameSpan::every(&run, before_ns, last_ns, schedule.spacing_ns as u64);
    let mut canvas: Option<Canvas> = None;
    let mut latest = None;
    let mut before = None;
    let mut progress = ProgressDisplay::new(schedule.n_frames);
    for number in 0..schedule.n_frames {
        while let Some(frame) = frames.next_until(schedule.at_ns(number)).map_err(Failure::work)? {
            if let Some(passed) = latest.replace(frame) {
                director.pass(&passed);
            }
        }
        if is_interrupted() {
            return Err(interrupted(path, number, &schedule));
        }
        let Some(frame) = &latest else { continue };
        let scene = director.scene(frame);
        let drawing = layout.drawing(&scene);
        if canvas.is_none() {
            canvas = Canvas::new(&drawing);
        }
        let canvas = canvas.as_mut().ok_or_else(no_room)?;
        let is_fixed =
            before.as_ref().is_some_and(|before| layout.is_fixed_between(before, &scene));
        writer.add(canvas.paint(&drawing, is_fixed).data()).map_err(failed)?;
        before = Some(scene);
        progress.frames(number + 1, schedule.n_frames);
    }
    progress.finish();
    match writer.finish(is_interrupted) {
        Err(VideoError::Interrupted) => {
            return Err(interrupted(path, schedule.n_frames, &schedule));
        }
        ended => ended.map_err(failed)?,
    }
    file.replace(path).map_err(|error| failed(error.into()))?;
    let shown_s = seconds(last_ns - schedule.from_ns);
    say(format!(
        "{}: {} at {} frames/s, {} s of the run at {} times its speed",
        path.display(),
        count_of(schedule.n_frames, "frame"),
        args.fps,
        trimmed(shown_s, 3),
        trimmed(args.speed, 3)
    ));
    Ok(())
}

fn interrupted(path: &Path, done: u64, schedule: &Schedule) -> Failure {
    Failure::work(format!(
        "interrupted after {} of {}; {} was not written",
        count(done),
        count_of(schedule.n_frames, "frame"),
        path.display()
    ))
}

/// The format of a video, if it can be made as asked for.
fn format_of(args: &RenderArgs, path: &Path) -> Result<Format, Failure> {
    let format = Format::of(path).ok_or_else(|| {
        Failure::request(format!(
            "--video {}: a video is written as .mp4, .webm or .gif; end the name with one of them",
            path.display()
        ))
    })?;
    if format == Format::Gif && MOST_GIF_FPS < args.fps {
        return Err(Failure::request(format!(
            "--fps {}: a .gif has at most {MOST_GIF_FPS} frames per second; give 1 to {MOST_GIF_FPS}, or write .mp4 or .webm",
            args.fps
        )));
    }
    if let Some(size) = args.size.filter(|_| format != Format::Gif) {
        let even = size.map(|pixels| pixels & !1);
        if even != size {
            return Err(Failure::request(format!(
                "--size {}x{}: width and height of .mp4 and .webm must be even; give {}x{}",
                size[0], size[1], even[0], even[1]
            )));
        }
    }
    Ok(format)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_bounded() {
        assert_eq!(size("1280x720"), Ok([1280, 720]));
        assert_eq!(size("4096x4096"), Ok([4096, 4096]));
        for text in ["4097x720", "1280x239", "0x0", "1280", "axb", "-1x9", "1280x720x3"] {
            let error = size(text).unwrap_err();
            assert!(error.contains("from 320x240 to 4096x4096"), "{text}: {error}");
        }
    }

    #[test]
    fn times_and_speeds_are_finite_and_not_negative() {
        assert_eq!(time_s("12.5"), Ok(12.5));
        assert_eq!(speed("2"), Ok(2.0));
        for text in ["-1", "NaN", "inf", "soon"] {
            assert!(time_s(text).is_err() && speed(text).is_err() && span_m(text).is_err());
        }
        assert!(speed("0").is_err());
    }
}
