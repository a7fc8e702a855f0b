//! `docs`: opens the documentation site.

use super::Failure;
use clap::Args;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use terminal::say;

/// The variable that names the site: its folder, or its first page.
const VARIABLE: &str = "MURMURATION_DOCS";

/// The first page of the site, within its folder.
const FIRST_PAGE: &str = "index.html";

/// Programs that open a page in a browser, after the one that the variable BROWSER names.
const OPENERS: [&str; 3] = ["xdg-open", "open", "wslview"];

#[derive(Args)]
pub(super) struct DocsArgs {
    /// Print the path of the site's first page, and open nothing
    #[arg(long)]
    print: bool,
}

/// Opens the site, or prints where it is.
pub(super) fn docs(args: &DocsArgs) -> Result<(), Failure> {
    let page = first_page()?;
    if args.print {
        say(page.display());
        return Ok(());
    }
    open(&page);
    Ok(())
}

/// Opens a page in a browser, or prints where it is.
pub(super) fn open(page: &Path) {
    let browser = std::env::var_os("BROWSER").filter(|browser| !browser.is_empty());
    let openers = browser.into_iter().chain(OPENERS.map(OsString::from));
    let is_open = openers.into_iter().any(|opener| {
        let mut command = Command::new(opener);
        command.arg(page).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    });
    if is_open {
        say(format!("opened {}", page.display()));
    } else {
        say(format!("no browser could be started; open {}", page.display()));
    }
}

/// The first page of the site.
fn first_page() -> Result<PathBuf, Failure> {
    if let Some(named) = std::env::var_os(VARIABLE).filter(|named| !named.is_empty()) {
        let named = PathBuf::from(named);
        let page = if named.is_dir() { named.join(FIRST_PAGE) } else { named };
        return if page.is_file() {
            Ok(page)
        } else {
            Err(Failure::request(format!(
                "{VARIABLE}: {} does not exist; name the folder of the site, or unset the variable",
                page.display()
            )))
        };
    }
    let executable = std::env::current_exe().ok().and_then(|path| path.canonicalize().ok());
    let folder = std::env::current_dir().ok();
    let places = places(executable.as_deref(), folder.as_deref());
    if let Some(page) = places.iter().find(|page| page.is_file()) {
        return Ok(page.clone());
    }
    let looked: String = places.iter().map(|page| format!("\n  {}", page.display())).collect();
    Err(Failure::work(format!(
        "the documentation site is not installed. Looked for:{looked}\nIn a checkout of the source, `python3 docs/build.py` builds \
         it in target/book. The pages are also readable there as they are, beginning with docs/README.md. If the site is \
         elsewhere, name its folder in {VARIABLE}"
    )))
}

/// Where the first page may be: installed beside the program, or built in a checkout that the program or the user is in.
fn places(executable: Option<&Path>, folder: Option<&Path>) -> Vec<PathBuf> {
    let bin = executable.and_then(Path::parent);
    let installed = bin
        .and_then(Path::parent)
        .map(|prefix| prefix.join("share/doc/murmuration/book").join(FIRST_PAGE));
    let checkouts = [bin, folder].into_iter().flatten().filter_map(|start| {
        let root = start.ancestors().find(|root| root.join("docs/README.md").is_file())?;
        Some(root.join("target/book").join(FIRST_PAGE))
    });
    let mut places: Vec<PathBuf> = installed.into_iter().chain(checkouts).collect();
    places.dedup();
    places
}
