//! Generates the messages from the `.proto` files, without `protoc`.

use prost::Message as _;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=../cosim");
    let files = ["cosim/v1/robotsim.proto", "cosim/v1/netsim.proto"];
    let descriptors = protox::compile(files, [".."])?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("cosim.v1.bin"), descriptors.encode_to_vec())?;
    // Without a generator of services, those of the files are passed over.
    prost_build::Config::new().bytes(["."]).compile_fds(descriptors)?;
    Ok(())
}
