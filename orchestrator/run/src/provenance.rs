//! Where a result comes from: everything that is outside the promise of identical bytes.

use super::start::{SideIdentity, StartOptions};
use experiment::{Plan, SideConfig};
use proto::types::seconds;
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use std::time::UNIX_EPOCH;

pub(super) struct Provenance {
    value: Value,
}

impl Provenance {
    pub(super) fn gather(plan: &Plan, sides: [&SideIdentity; 2], start: &StartOptions) -> Self {
        let unix_s = system::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        let side = |side: &SideIdentity, config: &SideConfig| {
            let mut value = json!({
                "name": side.name,
                "version": side.version,
                "url": side.url,
                "started_here": side.is_child,
                "transport": if side.streams { "stream" } else { "unary" },
                "digest": if side.is_compared_whole { "whole exchange" } else { "positions and deliveries" },
            });
            if let Some(command) = &config.command {
                value["command"] = json!(command.words);
                value["working_directory"] = json!(command.folder);
            }
            value
        };
        let files: Vec<Value> = plan
            .robotsim
            .files
            .iter()
            .chain(&plan.netsim.files)
            .map(|(path, content)| json!({ "path": path, "sha256": sha256(content), "bytes": content.len() }))
            .collect();
        let value = json!({
            "schema": "provenance/1",
            "orchestrator": { "version": env!("CARGO_PKG_VERSION"), "contract_version": proto_messages::CONTRACT_VERSION },
            "robotsim": side(sides[0], &plan.robotsim),
            "netsim": side(sides[1], &plan.netsim),
            "command_line": std::env::args().collect::<Vec<_>>(),
            "config_file": { "path": plan.path, "sha256": sha256(plan.text.as_bytes()) },
            "files": files,
            "host": std::fs::read_to_string("/proc/sys/kernel/hostname").map(|name| name.trim().to_owned()).ok(),
            "os": std::env::consts::OS,
            "architecture": std::env::consts::ARCH,
            "cores": proto_host::cores(),
            "threads": start.threads,
            "started_unix_s": unix_s,
        });
        Self { value }
    }

    /// Adds the steps after which the run went on from a checkpoint.
    pub(super) fn resumed(&mut self, steps: &[u64]) {
        if !steps.is_empty() {
            self.value["resumed_after_steps"] = json!(steps);
        }
    }

    /// Adds what only the end knows.
    pub(super) fn finish(mut self, n_steps: u64, time_ns: u64, wall_s: f64) -> Value {
        self.value["wall_s"] = json!(wall_s);
        self.value["steps_per_s"] = json!(if wall_s > 0.0 { n_steps as f64 / wall_s } else { 0.0 });
        self.value["simulated_over_wall"] =
            json!(if wall_s > 0.0 { seconds(time_ns) / wall_s } else { 0.0 });
        self.value
    }
}

/// How the log of a run begins.
pub(super) fn opening(plan: &Plan) -> String {
    let command: Vec<String> = std::env::args().collect();
    format!(
        "orchestrator {} runs {} with seed {}, process {}: {}",
        env!("CARGO_PKG_VERSION"),
        plan.name,
        plan.experiment.seed,
        std::process::id(),
        command.join(" ")
    )
}

fn sha256(bytes: &[u8]) -> String {
    proto::digest::hex(&Sha256::digest(bytes))
}
