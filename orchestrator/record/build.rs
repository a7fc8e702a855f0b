//! Generates the messages of `scene.mcap` from Foxglove's `.proto` files, without `protoc`.

use prost::Message as _;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=foxglove");
    let files = ["SceneUpdate", "PosesInFrame", "FrameTransforms", "Log"]
        .map(|name| format!("foxglove/{name}.proto"));
    let descriptors = protox::compile(files, ["."])?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("foxglove.bin"), descriptors.encode_to_vec())?;
    prost_build::Config::new().compile_fds(descriptors)?;
    Ok(())
}
