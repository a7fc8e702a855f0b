//! Generates the messages and services in Rust from the `.proto` files, without `protoc`.
//!
//! `cargo run --manifest-path proto/generate/Cargo.toml` writes them to the folders `generated` of their crates, which are
//! committed. With `-- --check` it writes nothing, and fails if a committed file is not what the `.proto` files give.

use prost::Message as _;
use std::error::Error;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Generates the files of one crate. Arguments: the root of the repository, and the folder to write to.
type Generate = fn(&Path, &Path) -> Result<()>;

/// Folders with generated files, relative to the root of the repository.
const FOLDERS: [(&str, Generate); 4] = [
    ("proto/messages/generated", messages),
    ("proto/host/generated", services),
    ("orchestrator/record/generated", scene),
    ("orchestrator/view/generated", page),
];

/// Files of the contract; they import the rest of it.
const CONTRACT: [&str; 2] = ["cosim/v1/robotsim.proto", "cosim/v1/netsim.proto"];

fn main() -> Result<ExitCode> {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let check = match arguments.as_slice() {
        [] => false,
        [option] if option == "--check" => true,
        _ => return Err("the only option is --check".into()),
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize()?;
    let new = std::env::temp_dir().join(format!("murmuration-generate-{}", std::process::id()));
    let done = FOLDERS.iter().try_fold(Vec::new(), |mut differing, (folder, generate)| {
        let (committed, new) = (root.join(folder), new.join(folder));
        std::fs::create_dir_all(&new)?;
        generate(&root, &new)?;
        if check {
            differing.append(&mut differences(&committed, &new)?);
        } else {
            replace(&committed, &new)?;
        }
        Ok::<_, Box<dyn Error>>(differing)
    });
    std::fs::remove_dir_all(&new)?;
    let differing = done?;
    for path in &differing {
        eprintln!("{} is not what the .proto files give", path.display());
    }
    if differing.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }
    eprintln!("run: cargo run --manifest-path proto/generate/Cargo.toml");
    Ok(ExitCode::FAILURE)
}

/// Messages of the contract, and their descriptors.
fn messages(root: &Path, out: &Path) -> Result<()> {
    let descriptors = protox::compile(CONTRACT, [root.join("proto")])?;
    std::fs::write(out.join("cosim.v1.bin"), descriptors.encode_to_vec())?;
    // Without a generator of services, those of the files are passed over.
    prost_build::Config::new().out_dir(out).bytes(["."]).compile_fds(descriptors)?;
    Ok(())
}

/// Services of the contract. Their messages are those of `proto-messages`.
fn services(root: &Path, out: &Path) -> Result<()> {
    tonic_prost_build::configure()
        .out_dir(out)
        .disable_comments(["."])
        .extern_path(".cosim.v1", "::proto_messages::v1")
        .codec_path("crate::codec::Codec")
        .compile_fds(protox::compile(CONTRACT, [root.join("proto")])?)?;
    Ok(())
}

/// Foxglove's messages of `scene.mcap`, and their descriptors.
fn scene(root: &Path, out: &Path) -> Result<()> {
    let files = ["SceneUpdate", "PosesInFrame", "FrameTransforms", "Log"]
        .map(|name| format!("foxglove/{name}.proto"));
    let descriptors = protox::compile(files, [root.join("orchestrator/record")])?;
    std::fs::write(out.join("foxglove.bin"), descriptors.encode_to_vec())?;
    prost_build::Config::new().out_dir(out).compile_fds(descriptors)?;
    Ok(())
}

/// Messages of the page that shows a run.
fn page(root: &Path, out: &Path) -> Result<()> {
    let include = [root.join("orchestrator/view"), root.join("proto")];
    let descriptors = protox::compile(["murmuration/view/v1/view.proto"], include)?;
    prost_build::Config::new()
        .out_dir(out)
        .extern_path(".cosim.v1", "::proto_messages::v1")
        .compile_fds(descriptors)?;
    Ok(())
}

/// Names of the files of a folder, in order; none if the folder is missing.
fn names(folder: &Path) -> Result<Vec<OsString>> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name()));
    let mut names = entries.collect::<std::io::Result<Vec<_>>>()?;
    names.sort();
    Ok(names)
}

/// Files that only one of the folders has, or that differ.
fn differences(committed: &Path, new: &Path) -> Result<Vec<PathBuf>> {
    let mut all = [names(committed)?, names(new)?].concat();
    all.sort();
    all.dedup();
    let differs = |name: &OsString| {
        std::fs::read(committed.join(name)).ok() != std::fs::read(new.join(name)).ok()
    };
    Ok(all.iter().filter(|name| differs(name)).map(|name| committed.join(name)).collect())
}

/// Puts the new files in place of the committed ones.
fn replace(committed: &Path, new: &Path) -> Result<()> {
    if committed.exists() {
        std::fs::remove_dir_all(committed)?;
    }
    std::fs::create_dir_all(committed)?;
    for name in names(new)? {
        std::fs::copy(new.join(&name), committed.join(&name))?;
    }
    Ok(())
}
