//! Generates the services from the `.proto` files, without `protoc`. Their messages are those of `proto-messages`.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=../cosim");
    let files = ["cosim/v1/robotsim.proto", "cosim/v1/netsim.proto"];
    tonic_prost_build::configure()
        .disable_comments(["."])
        .extern_path(".cosim.v1", "::proto_messages::v1")
        .codec_path("crate::codec::Codec")
        .compile_fds(protox::compile(files, [".."])?)?;
    Ok(())
}
