//! Generates the messages and services from the `.proto` files, without `protoc`.

use prost::Message as _;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=../cosim");
    let descriptors = protox::compile(["cosim/v1/robotsim.proto", "cosim/v1/netsim.proto"], [".."])?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("cosim.v1.bin"), descriptors.encode_to_vec())?;
    tonic_prost_build::configure()
        .disable_comments(["."])
        .bytes(".")
        .codec_path("crate::codec::Codec")
        .compile_fds(descriptors)?;
    Ok(())
}
