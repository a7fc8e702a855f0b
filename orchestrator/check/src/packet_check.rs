//! What a file of measured packets holds: the answer that programs read as JSON and people as text.

use crate::words;
use diagnose::json_number;
use measure::account::DataAccount;
use measure::packets::{self, MeasuredPacket};
use measure::table::DataTable;
use numbers::format::rounded;
use numbers::statistics::median_high;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeSet;
use study::open::file_of;

/// What the schema of the answer is called.
pub(super) const SCHEMA: &str = "check-packets/1";

/// What a file of measured packets holds.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct PacketCheck {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// Range of creation times (s).
    pub time_s: [f64; 2],
    /// Motes that created packets.
    pub sources: BTreeSet<u32>,
    /// Motes that packets were for.
    pub destinations: BTreeSet<u32>,
    /// Packets that arrived.
    pub arrived: usize,
    /// Median latency of the packets that arrived (s); null if none did.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub latency_s: f64,
    /// Range of the number of hops; null where it is unknown.
    pub hops: Option<[u32; 2]>,
    /// The measurements.
    #[serde(flatten)]
    pub account: DataAccount,
}

/// Looks at a file of measured packets.
///
/// # Errors
///
/// What makes the whole file useless, in words for its author.
pub fn packets(table: &DataTable) -> Result<PacketCheck, String> {
    let read = packets::read(table).map_err(|why| format!("{}: {why}", table.path.display()))?;
    let of = |value: fn(&MeasuredPacket) -> u32| read.packets.iter().map(value).collect();
    let mut latencies: Vec<f64> =
        read.packets.iter().filter_map(|p| Some(p.received_s? - p.time_s)).collect();
    latencies.sort_by(f64::total_cmp);
    let hops = || read.packets.iter().filter_map(|packet| packet.hops);
    let times = || read.packets.iter().map(|packet| packet.time_s);
    Ok(PacketCheck {
        schema: SCHEMA,
        time_s: [times().fold(f64::INFINITY, f64::min), times().fold(0.0, f64::max)],
        sources: of(|packet| packet.source),
        destinations: of(|packet| packet.destination),
        arrived: latencies.len(),
        latency_s: if latencies.is_empty() { f64::NAN } else { median_high(&latencies) },
        hops: hops().min().zip(hops().max()).map(|(least, most)| [least, most]),
        account: DataAccount {
            data: file_of(table),
            rows: read.n_rows,
            used: read.packets.len(),
            rejected: read.rejected,
            warnings: read.warnings,
            predicted_by: None,
        },
    })
}

impl PacketCheck {
    /// What was found as a person reads it on a terminal.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = "packets: one row per packet, from end to end\n".to_owned();
        let short = |value: f64| rounded(value, 4);
        let motes = |motes: &BTreeSet<u32>| {
            let shown: Vec<String> = motes.iter().take(20).map(u32::to_string).collect();
            let more = if shown.len() < motes.len() { ", …" } else { "" };
            format!("{} ({}{more})", motes.len(), shown.join(", "))
        };
        let facts = [
            ("time", format!("{} to {} s", short(self.time_s[0]), short(self.time_s[1]))),
            ("sources", motes(&self.sources)),
            ("destinations", motes(&self.destinations)),
            ("arrived", format!("{} of {}", self.arrived, self.account.used)),
            (
                "latency",
                if self.latency_s.is_finite() {
                    format!("{} s (median)", short(self.latency_s))
                } else {
                    "unknown".to_owned()
                },
            ),
            (
                "hops",
                self.hops.map_or_else(
                    || "unknown".to_owned(),
                    |[least, most]| format!("{least} to {most}"),
                ),
            ),
        ];
        for (label, words) in facts {
            words::fact(&mut text, label, &words);
        }
        text
    }
}
