//! The barrier's digests: SHA-256 over what was exchanged. `cosim/v1/common.proto` defines the byte strings. [`full`] covers
//! everything, [`of_step`] positions and deliveries.

pub mod full;
mod parts;

use crate::types::{AgentStates, Deliveries, Heard};
use sha2::{Digest as _, Sha256};

/// A SHA-256 digest.
pub type Digest = [u8; 32];

/// The digest of a step that reached `time_ns`, given the states that the network used and the deliveries that the
/// robots were given (`None` in step 1).
#[must_use]
pub fn of_step(
    step: u64,
    time_ns: u64,
    states: &AgentStates,
    deliveries: Option<&Deliveries>,
) -> Digest {
    let mut hash = Sha256::new();
    hash.update(step.to_le_bytes());
    hash.update(time_ns.to_le_bytes());
    hash.update(states.alive.as_bytes());
    for column in [&states.x_m, &states.y_m, &states.z_m] {
        update(&mut hash, column, |value| value.to_le_bytes());
    }
    if let Some(Deliveries { transmissions, heard, .. }) = deliveries {
        update(&mut hash, &transmissions.sender, |value| value.to_le_bytes());
        update(&mut hash, &transmissions.sent_ns, |value| value.to_le_bytes());
        update(&mut hash, &transmissions.end_ns, |value| value.to_le_bytes());
        update(&mut hash, transmissions.payloads.length_bytes(), |value| value.to_le_bytes());
        hash.update(transmissions.payloads.data());
        match heard {
            Heard::Lists { ends, indices } => {
                update(&mut hash, ends, |value| value.to_le_bytes());
                update(&mut hash, indices, |value| value.to_le_bytes());
            }
            Heard::Rows { bytes, .. } => hash.update(bytes),
        }
    }
    hash.finalize().into()
}

/// SHA-256 of some bytes: the checksum of what is stored.
#[must_use]
pub fn of_bytes(bytes: &[u8]) -> Digest {
    Sha256::digest(bytes).into()
}

/// Lower-case hexadecimal.
#[must_use]
pub fn hex(digest: &[u8]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Feeds a column in blocks, so that the hash sees more than a few bytes at a time.
fn update<T: Copy, const N: usize>(hash: &mut Sha256, column: &[T], bytes: impl Fn(T) -> [u8; N]) {
    let mut block = [0u8; 4096];
    for part in column.chunks(4096 / N) {
        for (slot, &value) in block.chunks_exact_mut(N).zip(part) {
            slot.copy_from_slice(&bytes(value));
        }
        hash.update(&block[..part.len() * N]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Bitmap;

    #[test]
    fn the_worked_example_of_the_proto_file_holds() {
        let states = AgentStates {
            alive: Bitmap::filled(2, true),
            x_m: vec![0.0, 1.5],
            y_m: vec![0.0, -2.0],
            z_m: vec![0.0, 0.0],
            ..AgentStates::default()
        };
        let digest = hex(&of_step(1, 100_000_000, &states, None));
        assert_eq!(digest, "1a6b36f92f4bb3089267b7047a25683d1803dbf826dbcf1d7bd3cc425c9828ed");
        let file = include_str!("../../cosim/v1/common.proto");
        assert!(file.contains(&digest), "common.proto states another digest");
    }
}
