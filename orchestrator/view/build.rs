//! Generates the messages of the page from `view.proto`, without `protoc`.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=murmuration");
    println!("cargo::rerun-if-changed=../../proto/cosim");
    let descriptors = protox::compile(["murmuration/view/v1/view.proto"], [".", "../../proto"])?;
    prost_build::Config::new()
        .extern_path(".cosim.v1", "::proto_messages::v1")
        .compile_fds(descriptors)?;
    Ok(())
}
