//! The real program answers.

use std::process::Command;

#[test]
fn it_prints_a_schema_and_refuses_what_it_does_not_know() {
    let orchestrator = || Command::new(env!("CARGO_BIN_EXE_murmuration"));
    let output = orchestrator().arg("schema").output().unwrap();
    assert!(output.status.success());
    let schema: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(schema["properties"]["experiment"]["properties"]["seed"]["type"], "integer");
    assert_eq!(orchestrator().arg("fly").output().unwrap().status.code(), Some(2));
}
