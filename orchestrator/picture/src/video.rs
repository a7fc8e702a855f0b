//! Pictures that follow each other, encoded as a video.

use crate::colours::Theme;
use crate::gif::GifWriter;
use std::fs::File;
use std::io::{BufWriter, Read as _, Seek as _, Write as _};
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use thiserror::Error;

/// Formats of videos.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// H.264 in MP4, by ffmpeg.
    Mp4,
    /// VP9 in WebM, by ffmpeg.
    Webm,
    /// GIF, by this program.
    Gif,
}

impl Format {
    /// The format that a file name ends with.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "mp4" => Some(Self::Mp4),
            "webm" => Some(Self::Webm),
            "gif" => Some(Self::Gif),
            _ => None,
        }
    }
}

/// A video cannot be made.
#[derive(Debug, Error)]
pub enum VideoError {
    /// The program that encodes it is missing.
    #[error(
        "ffmpeg is not installed, and this format needs it; install ffmpeg, or write a .gif, which needs no other program"
    )]
    NoFfmpeg,
    /// The program that encodes it failed.
    #[error("ffmpeg failed: {0}; a .gif needs no other program")]
    Ffmpeg(String),
    /// It cannot be written.
    #[error("{0}")]
    Write(#[from] std::io::Error),
    /// The user asked to stop.
    #[error("interrupted")]
    Interrupted,
}

impl From<gif::EncodingError> for VideoError {
    fn from(error: gif::EncodingError) -> Self {
        match error {
            gif::EncodingError::Io(error) => Self::Write(error),
            error => Self::Write(std::io::Error::other(error)),
        }
    }
}

/// Encodes pictures of one size.
pub struct VideoWriter {
    encoder: Encoder,
    fps: u32,
    n_frames: u64,
}

enum Encoder {
    Gif(Box<GifWriter<BufWriter<system::File>>>),
    Ffmpeg(Ffmpeg),
}

impl VideoWriter {
    /// Begins a video in a file that exists.
    ///
    /// # Errors
    ///
    /// ffmpeg cannot be started, or the file cannot be written.
    pub fn begin(
        path: &Path,
        format: Format,
        [width, height]: [u16; 2],
        fps: u32,
        theme: &Theme,
    ) -> Result<Self, VideoError> {
        let encoder = if format == Format::Gif {
            let file = BufWriter::new(system::File::create(path)?);
            Encoder::Gif(Box::new(GifWriter::new(file, [width, height], theme)?))
        } else {
            Encoder::Ffmpeg(Ffmpeg::start(path, format, [width, height], fps)?)
        };
        Ok(Self { encoder, fps, n_frames: 0 })
    }

    /// Adds a picture. `rgba`: opaque pixels, row after row.
    ///
    /// # Errors
    ///
    /// It cannot be encoded or written.
    pub fn add(&mut self, rgba: &[u8]) -> Result<(), VideoError> {
        let number = self.n_frames;
        self.n_frames += 1;
        match &mut self.encoder {
            Encoder::Gif(gif) => {
                // Rounded so that the whole lasts as long as it should.
                let begin = |number: u64| number * 100 / u64::from(self.fps);
                gif.add(rgba, (begin(number + 1) - begin(number)) as u16).map_err(Into::into)
            }
            Encoder::Ffmpeg(ffmpeg) => ffmpeg.add(rgba),
        }
    }

    /// Ends the video. `is_interrupted`: whether the user asks to stop.
    ///
    /// # Errors
    ///
    /// It cannot be encoded or written, or the user asks to stop.
    pub fn finish(self, is_interrupted: impl Fn() -> bool) -> Result<(), VideoError> {
        match self.encoder {
            Encoder::Gif(gif) => {
                gif.finish()?.into_inner().map(drop).map_err(|e| e.into_error().into())
            }
            Encoder::Ffmpeg(ffmpeg) => ffmpeg.finish(is_interrupted),
        }
    }
}

/// A running ffmpeg, which is given raw pixels. Ended when dropped.
struct Ffmpeg {
    child: Child,
    /// What it says.
    errors: File,
}

impl Ffmpeg {
    fn start(
        path: &Path,
        format: Format,
        [width, height]: [u16; 2],
        fps: u32,
    ) -> Result<Self, VideoError> {
        let errors = system::unnamed_file()?;
        let mut command = Command::new("ffmpeg");
        command
            .args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y"])
            .args(["-f", "rawvideo", "-pix_fmt", "rgba", "-framerate", &fps.to_string()])
            .args(["-video_size", &format!("{width}x{height}"), "-i", "pipe:0", "-an"])
            // Players take small pictures of no stated colours for those of old television.
            .args(["-vf", "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p"])
            .args(["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"])
            .args(["-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact"]);
        match format {
            Format::Webm => command
                .args(["-c:v", "libvpx-vp9", "-crf", "30", "-b:v", "0", "-row-mt", "1"])
                .args(["-deadline", "good", "-cpu-used", "5", "-f", "webm"]),
            Format::Mp4 | Format::Gif => command
                .args(["-c:v", "libx264", "-crf", "18", "-preset", "medium"])
                .args(["-movflags", "+faststart", "-f", "mp4"]),
        };
        let child = command
            .arg(path)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(errors.try_clone()?)
            // Ctrl-C in a terminal reaches this program alone, which then ends ffmpeg.
            .process_group(0)
            .spawn();
        match child {
            Ok(child) => Ok(Self { child, errors }),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(VideoError::NoFfmpeg),
            Err(error) => Err(VideoError::Ffmpeg(error.to_string())),
        }
    }

    fn add(&mut self, rgba: &[u8]) -> Result<(), VideoError> {
        let written = self.child.stdin.as_mut().map(|stdin| stdin.write_all(rgba));
        match written {
            Some(Ok(())) => Ok(()),
            // It has ended: it says why.
            Some(Err(_)) | None => {
                let _ = self.child.wait();
                Err(VideoError::Ffmpeg(self.said()))
            }
        }
    }

    fn finish(mut self, is_interrupted: impl Fn() -> bool) -> Result<(), VideoError> {
        drop(self.child.stdin.take());
        loop {
            match self.child.try_wait()? {
                Some(status) if status.success() => return Ok(()),
                Some(_) => return Err(VideoError::Ffmpeg(self.said())),
                None if is_interrupted() => return Err(VideoError::Interrupted),
                None => std::thread::sleep(Duration::from_millis(20)),
            }
        }
    }

    /// The beginning of what it said, in one line.
    fn said(&mut self) -> String {
        let mut said = [0; 600];
        let read = self.errors.rewind().and_then(|()| self.errors.read(&mut said));
        let text = String::from_utf8_lossy(&said[..read.unwrap_or_default()]);
        let lines: Vec<&str> =
            text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        if lines.is_empty() { "it does not say why".to_owned() } else { lines.join("; ") }
    }
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        if !matches!(self.child.try_wait(), Ok(Some(_))) {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}
