//! The page's files, and pages that stand by themselves.

use crate::recorded::RecordedRun;
use crate::view;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use prost::Message as _;
use record::read::ReadError;
use sha2::{Digest as _, Sha256};
use std::io::Write as _;

/// The page, as its sources in `orchestrator/page/` are built.
pub(crate) const INDEX: &str = include_str!("../../page/dist/index.html");
/// Its program.
pub(crate) const SCRIPT: &str = include_str!("../../page/dist/page.js");
/// Its style.
pub(crate) const STYLE: &str = include_str!("../../page/dist/page.css");

/// What the page's file has where its parts belong.
const STYLE_PLACE: &str = "<link rel=\"stylesheet\" href=\"page.css\">";
const SCRIPT_PLACE: &str = "<script src=\"page.js\" defer></script>";
const RECORDING_PLACE: &str = "<!--recording-->";

/// A page that holds the recordings that it shows.
#[derive(Debug)]
pub struct StandalonePage {
    /// The page.
    pub html: String,
    /// Of each run: one frame of so many steps was kept, and how many frames these are.
    pub kept: Vec<(u64, u64)>,
}

/// Makes a page of runs that has at most `most_bytes`: of longer recordings, one frame of every so many steps is kept.
/// `measurements`: what the page also shows, if anything.
///
/// # Errors
///
/// A recording is damaged, or the page would be too large with its first and last frame alone.
pub fn standalone(
    runs: &[RecordedRun],
    measurements: Option<view::Measurements>,
    most_bytes: usize,
) -> Result<StandalonePage, PageError> {
    let measurements = view::Recordings { recordings: Vec::new(), measurements }.encode_to_vec();
    let rest = INDEX.len() + SCRIPT.len() + STYLE.len() + 4096;
    let rest = rest + STANDARD.encode(compressed(&measurements)).len();
    // Base64 makes four bytes of three.
    let room = most_bytes.saturating_sub(rest) / 4 * 3 / runs.len().max(1);
    let mut recordings = Vec::new();
    let mut kept = Vec::new();
    for run in runs {
        let (recording, every, n_frames) = recording(run, room, most_bytes)?;
        recordings.push(recording);
        kept.push((every, n_frames));
    }
    // Messages, one after the other, are one message that has the fields of all.
    recordings.push(measurements);
    let data = STANDARD.encode(compressed(&recordings.concat()));
    let html = assemble(&format!(
        "<script id=\"recording\" type=\"application/octet-stream\">{data}</script>"
    ));
    Ok(StandalonePage { html, kept })
}

/// A page as [`standalone`] makes it, compressed by gzip and written in base64, for a page around it that opens it in a frame.
///
/// # Errors
///
/// As [`standalone`].
pub fn embedded(run: RecordedRun, most_bytes: usize) -> Result<String, PageError> {
    let page = standalone(&[run], None, most_bytes)?;
    Ok(STANDARD.encode(compressed(page.html.as_bytes())))
}

/// Why a page cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// A recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Even a few frames are too large.
    #[error(
        "{run}: {n_frames} frames already need more than the {most_bytes} bytes that the page may have: allow a larger page"
    )]
    TooLarge {
        /// The run.
        run: String,
        /// How many frames were tried.
        n_frames: u64,
        /// The limit.
        most_bytes: usize,
    },
}

/// A recording that needs at most `room` bytes when it is compressed: with the steps per frame and the number of frames.
fn recording(
    run: &RecordedRun,
    room: usize,
    most_bytes: usize,
) -> Result<(Vec<u8>, u64, u64), PageError> {
    let n_steps = run.run().step_count.max(1);
    let mut every = 1;
    loop {
        let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
        let mut frames: Vec<view::Frame> = Vec::new();
        let mut latest_step = 0;
        let mut is_full = false;
        let overview = run.all_frames(every, |frame| {
            latest_step = frame.step;
            // Compressed here to see how much it needs, and once more with all the rest if it has room.
            gzip.write_all(&frame.encode_to_vec()).expect("a vector grows as needed");
            is_full = room < gzip.get_ref().len();
            frames.push(frame.clone());
            !is_full
        })?;
        let n_frames = frames.len() as u64;
        if !is_full {
            let recording = view::Recording {
                run: Some(run.run().clone()),
                overview: Some(overview),
                frames,
                every_steps: every,
            };
            let recordings = view::Recordings { recordings: vec![recording], measurements: None };
            let encoded = recordings.encode_to_vec();
            let n_bytes = compressed(&encoded).len();
            if n_bytes <= room {
                return Ok((encoded, every, n_frames));
            }
            latest_step = n_steps * room as u64 / n_bytes as u64;
        }
        if n_steps <= every {
            let run = run.run().name.clone();
            return Err(PageError::TooLarge { run, n_frames, most_bytes });
        }
        // So many times more as the run is longer than what had room, and some more.
        let factor = (n_steps * 11).div_ceil(latest_step.max(1) * 10).max(2);
        every = every.saturating_mul(factor).min(n_steps);
    }
}

fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
    gzip.write_all(bytes).and_then(|()| gzip.finish()).expect("a vector grows as needed")
}

/// The page with all its parts in it.
fn assemble(recording: &str) -> String {
    let style = format!("<style>{STYLE}</style>");
    let script = format!("<script>{SCRIPT}</script>");
    // Nothing but these parts may run, and nothing may be loaded.
    let policy = format!(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src '{}'; style-src '{}'; img-src data: blob:; \
         base-uri 'none'; form-action 'none'\">",
        source_hash(SCRIPT),
        source_hash(STYLE),
    );
    INDEX
        .replacen("<head>", &format!("<head>{policy}"), 1)
        .replacen(STYLE_PLACE, &style, 1)
        .replacen(SCRIPT_PLACE, &script, 1)
        .replacen(RECORDING_PLACE, recording, 1)
}

/// What a content security policy calls the script of the page.
#[must_use]
pub fn script_source() -> String {
    source_hash(SCRIPT)
}

/// What a content security policy calls a part.
#[must_use]
pub fn source_hash(part: &str) -> String {
    format!("sha256-{}", STANDARD.encode(Sha256::digest(part.as_bytes())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_a_place_for_each_part() {
        for place in ["<head>", STYLE_PLACE, SCRIPT_PLACE, RECORDING_PLACE] {
            assert_eq!(INDEX.matches(place).count(), 1, "{place}");
        }
        assert!(!SCRIPT.contains("</script"), "it would end where it is put into a page");
        assert!(!STYLE.contains("</style"), "it would end where it is put into a page");
    }
}
