//! `murmuration replay`.

use super::answer_file::Answer;
use super::{Failure, ReadArgs, check_place, on_runtime, residuals, write_whole};
use clap::Args;
use record::result::ResultFolder;
use run::interrupt::Interrupt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::sync_channel;
use terminal::{complain, say};
use view::page;
use view::recorded::RecordedRun;
use view::server::{RunSource, Server, Shown};

#[derive(Args)]
pub(super) struct ReplayArgs {
    /// Folder of a recorded run
    run: PathBuf,
    /// Folder of a second run, to show both side by side at the same simulated time
    #[arg(long, value_name = "RUN")]
    with: Option<PathBuf>,
    /// Also show an answer of `diagnose --json` or `compare --json`: its verdict, its scores and, on the map, the
    /// places that it estimates
    #[arg(long, value_name = "FILE")]
    diagnosis: Option<PathBuf>,
    /// With --diagnosis: also show the residuals that the same command wrote with --residuals, on the map and over
    /// each covariate
    #[arg(long, value_name = "FILE", requires = "diagnosis")]
    residuals: Option<PathBuf>,
    /// Write one HTML page that contains the recording and needs no server; - for standard output
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// With --output: largest size of the HTML page (MB), from 1 to 500. If the recording is larger, the page skips frames
    /// at regular intervals
    #[arg(long, value_name = "MB", default_value_t = 20, requires = "output", value_parser = clap::value_parser!(u16).range(1..=500))]
    max_size: u16,
    /// Port of the page [default: any free port]
    #[arg(long, value_name = "PORT", conflicts_with = "output")]
    port: Option<u16>,
    #[command(flatten)]
    read: ReadArgs,
}

/// Shows recorded runs in a browser.
pub(super) fn replay(args: &ReplayArgs) -> Result<(), Failure> {
    if let Some(output) = &args.output {
        check_place("--output", output)?;
    }
    let folders = std::iter::once(&args.run).chain(&args.with);
    let mut runs: Vec<RecordedRun> =
        folders.map(|folder| open(&args.read.open(folder)?)).collect::<Result<_, _>>()?;
    let mut measurements = None;
    if let Some(path) = &args.diagnosis {
        let answer = Answer::of_option(path)?;
        // Of robots a row is a window of the track, of which an answer does not say how many there are.
        let n_rows = answer.is_of_links().then(|| answer.n_rows());
        let read = |path: &Path| residuals::read(path, n_rows, answer.has_effects(), args.read);
        let rows = args.residuals.as_deref().map(read).transpose();
        let rows = rows.map_err(|problem| Failure::request(format!("--residuals {problem}")))?;
        let estimates = answer.estimates();
        runs.iter_mut().for_each(|run| run.add_estimates(&estimates));
        measurements = Some(answer.shown(rows));
    }
    if let Some(output) = &args.output {
        let page = page::standalone(&runs, measurements, usize::from(args.max_size) * 1_000_000)
            .map_err(Failure::work)?;
        write_whole("--output", output, &page.html)?;
        for (run, (every, n_frames)) in runs.iter().zip(&page.kept) {
            let kept = match every {
                1 => "every step".to_owned(),
                every => format!("one of {every} steps"),
            };
            say(format!("{}: {n_frames} frames, {kept}", run.run().name));
        }
        say(format!("open {}", output.display()));
        return Ok(());
    }
    let runs: Vec<Arc<RecordedRun>> = runs.into_iter().map(Arc::new).collect();
    runs.iter().for_each(|run| run.read_in_background(|failure: &str| complain(failure)));
    let shown = Shown::new(runs.into_iter().map(RunSource::Recorded).collect())
        .with_measurements(measurements);
    let serving = Serving::begin(args.port, &shown)?;
    let words = format!("open {}\npress Ctrl-C to end", serving.url());
    serving.until_interrupted(&words)
}

/// Opens a recorded run.
pub(super) fn open(folder: &ResultFolder) -> Result<RecordedRun, Failure> {
    RecordedRun::open(folder).map_err(|error| Failure::of_reading(&error))
}

/// A page that is served by a thread of its own.
pub(super) struct Serving {
    url: String,
}

impl Serving {
    /// Begins to serve what is shown.
    pub(super) fn begin(port: Option<u16>, shown: &Shown) -> Result<Self, Failure> {
        let shown = shown.clone();
        Self::of(port, move |port| Server::bind(port, shown))
    }

    /// Begins to serve what `bind` makes of a port.
    pub(super) fn of<Binding: Future<Output = std::io::Result<Server>>>(
        port: Option<u16>,
        bind: impl FnOnce(u16) -> Binding + Send + 'static,
    ) -> Result<Self, Failure> {
        let port = port.unwrap_or_default();
        let failed = move |error: std::io::Error| {
            Failure::work(format!("cannot serve a page on 127.0.0.1:{port}: {error}"))
        };
        let (tell, told) = sync_channel(1);
        let serve = move || {
            let served = on_runtime(async {
                match bind(port).await {
                    Ok(server) => {
                        let _ = tell.send(Ok(server.url().to_owned()));
                        server.serve().await;
                    }
                    Err(error) => {
                        let _ = tell.send(Err(error));
                    }
                }
            });
            if let Err(error) = served {
                tracing::error!(%error, "the page is not served");
            }
        };
        std::thread::Builder::new().name("page".to_owned()).spawn(serve).map_err(&failed)?;
        let url = told.recv().map_err(Failure::work)?.map_err(&failed)?;
        Ok(Self { url })
    }

    /// The address of the page.
    pub(super) fn url(&self) -> &str {
        &self.url
    }

    /// Shows a run that has ended, until someone presses Ctrl-C.
    pub(super) fn replay(self, shown: &Shown, folder: &Path) -> Result<(), Failure> {
        let run = Arc::new(open(&ResultFolder::unchecked(folder))?);
        run.read_in_background(|failure: &str| complain(failure));
        shown.replace(RunSource::Recorded(run));
        let words = format!("replay the run at {}; press Ctrl-C to end", self.url);
        self.until_interrupted(&words)
    }

    /// Says what there is to see, and serves until someone presses Ctrl-C or ends the program.
    pub(super) fn until_interrupted(self, words: &str) -> Result<(), Failure> {
        on_runtime(async {
            // Listens before it says so: whoever reads the words may interrupt at once. A run before has caught the signals, so that
            // they end nothing by themselves any more.
            let mut interrupt = Interrupt::listen();
            say(words);
            interrupt.first().await;
        })
    }
}
