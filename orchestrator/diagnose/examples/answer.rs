//! Which effect a radio model lacks: `cargo run --release -p diagnose --example answer -- model.toml links.csv`
#![expect(clippy::disallowed_methods, clippy::print_stdout, reason = "a program, not a core")]

use diagnose::{Request, Unobserved};
use measure::{config::Compared, memory::MemoryBudget, table::DataTable};
use proto::bounds::CONFIGURATION_BYTES;
use std::{error::Error, fs::File, path::Path};

fn main() -> Result<(), Box<dyn Error>> {
    let mut files = std::env::args().skip(1);
    let [model, data] = [(); 2].map(|()| files.next().unwrap_or_default());
    let text = CONFIGURATION_BYTES.read_text(File::open(&model)?)?;
    let config = Compared::of_text(Path::new(&model), text, &[])?;
    let table = DataTable::read(Path::new(&data), MemoryBudget::default())?;
    let found = diagnose::diagnose(&Request::new(&config, &table), &Unobserved)?.answer;
    println!("{}", diagnose::words::text(&found));
    Ok(())
}
