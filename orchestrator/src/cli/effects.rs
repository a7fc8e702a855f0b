//! `murmuration effects`.

use super::{Failure, write_json, write_whole};
use clap::Args;
use std::path::PathBuf;
use terminal::say;

#[derive(Args)]
pub(super) struct EffectsArgs {
    /// The effect to explain [default: list all]
    name: Option<String>,
    /// Write the list or the explanation as JSON to this file; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Plot the effect to this file (SVG); - for standard output
    #[arg(long, value_name = "FILE", requires = "name")]
    svg: Option<PathBuf>,
}

/// `murmuration effects`: the list, or what an effect is.
pub(super) fn effects(args: &EffectsArgs) -> Result<(), Failure> {
    let found = match &args.name {
        Some(name) => effects::find(name).map_err(Failure::request)?,
        None => effects::all(),
    };
    if let Some(path) = &args.svg {
        let name = args.name.as_deref().unwrap_or_default();
        let picture = found.iter().find_map(effects::Listed::picture).ok_or_else(|| {
            Failure::request(format!(
                "--svg: {name} acts on robots, and only radio effects have a plot; leave out --svg"
            ))
        })?;
        write_whole("--svg", path, picture.svg(name))?;
    }
    match args.json.as_deref() {
        Some(path) => write_json(Some(path), &effects::answer(&found))?,
        None if args.name.is_none() => say(effects::table()),
        None => {
            let texts: Vec<String> = found.iter().map(effects::Listed::explained).collect();
            say(texts.join("\n\n"));
        }
    }
    Ok(())
}
