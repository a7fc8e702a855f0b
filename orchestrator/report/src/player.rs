//! The player at the top of a run's page: the same page that `murmuration replay` shows, in a frame. It is unpacked when it is opened;
//! without a script there is no player, and nothing else is missing.

use maud::{Markup, PreEscaped, html};
use record::FinishedRun;
use record::result::ResultFolder;
use view::page::{self, PageError};
use view::recorded::RecordedRun;

/// A recording of more bytes is not read again for its report: `murmuration replay` shows it.
const MOST_RECORDED_BYTES: u64 = 20_000_000;
/// The player has at most so many bytes before it is compressed: of a longer recording it holds one frame of every so many steps.
const MOST_BYTES: usize = 600_000;

/// The line in place of the player of a run that is too long for the page.
fn too_long() -> Markup {
    html! { p.player { "The run is too long to be played here: " code { "murmuration replay ." } " in this folder plays it." } }
}

/// Unpacks the player into its frame, and makes buttons of the words that lead to moments of the run.
const OPEN: &str = r#"(() => {
  const player = document.getElementById("player");
  const frame = player.querySelector("iframe");
  let isReady = false;
  let waiting = null;
  const jump = (moment) => {
    if (isReady) frame.contentWindow.postMessage({ jump: moment }, "*");
    else waiting = moment;
    player.open = true;
    frame.scrollIntoView({ block: "nearest" });
  };
  window.addEventListener("message", ({ source, data }) => {
    if (source !== frame.contentWindow || data?.murmuration !== "ready") return;
    isReady = true;
    if (waiting !== null) jump(waiting);
    waiting = null;
  });
  for (const words of document.querySelectorAll("[data-moment]")) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "moment";
    button.title = "Show in the player; press again for the next";
    button.append(...words.childNodes);
    button.addEventListener("click", () => jump(words.dataset.moment));
    words.replaceWith(button);
  }
  player.addEventListener("toggle", async () => {
    if (!player.open || frame.srcdoc) return;
    const packed = Uint8Array.from(atob(document.getElementById("packed-player").textContent), (c) => c.charCodeAt(0));
    const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    frame.srcdoc = await new Response(unpacked).text();
  });
})();"#;

/// The scripts of the section, as a content security policy calls them: its own, and that of the player, whose frame is under the
/// policy of the page around it.
pub(super) fn scripts() -> [String; 2] {
    [page::source_hash(OPEN), page::script_source()]
}

pub(super) fn section(contents: &FinishedRun<'_>) -> Option<Markup> {
    let recorded = contents.dir.join("run.mcap");
    let n_bytes = std::fs::metadata(recorded).ok()?.len();
    if MOST_RECORDED_BYTES < n_bytes {
        return Some(too_long());
    }
    let run = RecordedRun::open(&ResultFolder::unchecked(contents.dir))
        .ok()?
        .named(&contents.header.name);
    let packed = match page::embedded(run, MOST_BYTES) {
        Ok(packed) => packed,
        Err(PageError::TooLarge { .. }) => return Some(too_long()),
        Err(PageError::Read(_)) => return None,
    };
    Some(html! {
        details #player.player {
            summary { "Play the run" }
            iframe title="Player of the run" sandbox="allow-scripts allow-downloads" {}
        }
        script #packed-player type="application/octet-stream" { (packed) }
        script { (PreEscaped(OPEN)) }
    })
}
