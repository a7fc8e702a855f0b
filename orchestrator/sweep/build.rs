//! The fingerprint of the code that decides the results of a trial.
//!
//! Builds of the same code give the same results, whatever their profile, target and symbols: a stripped program of a wheel and a
//! program that cargo built have the same fingerprint. Code that only prints, draws or fits is not part of it.

use std::path::{Path, PathBuf};

/// Folders of the crates, relative to the workspace.
const CRATES: [&str; 16] = [
    "netsim",
    "netsim/physics",
    "orchestrator/drive",
    "orchestrator/experiment",
    "orchestrator/input",
    "orchestrator/metrics",
    "orchestrator/numbers",
    "orchestrator/record",
    "orchestrator/run",
    "orchestrator/sweep",
    "orchestrator/system",
    "proto/core",
    "proto/derive",
    "proto/host",
    "proto/messages",
    "robotsim",
];

/// The workspace, seen from the folder of this crate, where cargo starts the script.
const WORKSPACE: &str = "../..";

fn main() -> std::io::Result<()> {
    let workspace = Path::new(WORKSPACE);
    // Versions of the libraries of others.
    let mut files = vec![workspace.join("Cargo.lock")];
    for folder in CRATES {
        // What is generated from the contract lies beside the sources.
        for part in ["src", "generated"].map(|part| workspace.join(folder).join(part)) {
            if part.is_dir() {
                println!("cargo::rerun-if-changed={}", part.display());
                add_files(&part, &mut files)?;
            }
        }
    }
    println!("cargo::rerun-if-changed={}", files[0].display());
    files.sort();
    let mut checksum = Checksum::new();
    for source in &files {
        let content = std::fs::read(source)?;
        for part in [source.as_os_str().as_encoded_bytes(), &content] {
            checksum.add(&(part.len() as u64).to_le_bytes());
            checksum.add(part);
        }
    }
    println!("cargo::rustc-env=CODE_OF_RESULTS={:016x}", checksum.0);
    Ok(())
}

/// Adds all files of a folder and of the folders in it.
fn add_files(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            add_files(&entry.path(), files)?;
        } else {
            files.push(entry.path());
        }
    }
    Ok(())
}

/// FNV-1a with 64 bits, after Fowler, Noll and Vo: enough against chance, and it needs no library.
struct Checksum(u64);

impl Checksum {
    const fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn add(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
