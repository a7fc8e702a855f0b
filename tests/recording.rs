//! The recording of a run: what the promise of identical bytes is about.

use std::collections::BTreeMap;
use std::path::Path;

/// Everything that must be identical: per file, its content; of `run.mcap` the messages with topic, time and schema.
///
/// # Panics
///
/// If a file cannot be read.
#[must_use]
pub fn read_recording(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut parts = BTreeMap::new();
    for entry in std::fs::read_dir(dir).expect("a folder of results") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().and_then(|name| name.to_str()).expect("a name").to_owned();
        if name.ends_with(".parquet") || ["summary.json", "radio.pcap"].contains(&name.as_str()) {
            parts.insert(name, std::fs::read(&path).expect("a readable file"));
        } else if name == "run.mcap" {
            parts.insert(name, messages(&path));
        }
    }
    parts
}

/// The messages of an MCAP file, one after the other.
fn messages(path: &Path) -> Vec<u8> {
    let bytes = std::fs::read(path).expect("a readable file");
    let mut content = Vec::new();
    for message in mcap::MessageStream::new(&bytes).expect("an MCAP file") {
        let message = message.expect("a whole message");
        content.extend_from_slice(message.channel.topic.as_bytes());
        content.extend_from_slice(
            message.channel.schema.as_ref().map_or("", |schema| &schema.name).as_bytes(),
        );
        content.extend_from_slice(&message.sequence.to_le_bytes());
        content.extend_from_slice(&message.log_time.to_le_bytes());
        content.extend_from_slice(&message.publish_time.to_le_bytes());
        content.extend_from_slice(&message.data);
    }
    content
}

/// Asserts that two runs left the same recording, naming the file and the first byte that differ.
///
/// # Panics
///
/// If they differ.
pub fn assert_same(a: &Path, b: &Path) {
    let (in_a, in_b) = (read_recording(a), read_recording(b));
    assert_eq!(in_a.keys().collect::<Vec<_>>(), in_b.keys().collect::<Vec<_>>(), "other files");
    assert!(
        in_a.contains_key("run.mcap") && in_a.contains_key("summary.json"),
        "{:?}",
        in_a.keys()
    );
    for (name, content) in &in_a {
        let other = &in_b[name];
        let first = content.iter().zip(other).position(|(x, y)| x != y);
        assert!(
            content == other,
            "{name} of {} and {} differ: {} and {} bytes, first at {first:?}",
            a.display(),
            b.display(),
            content.len(),
            other.len()
        );
    }
}
