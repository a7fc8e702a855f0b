//! What the built-in robots say.
//!
//! A payload is 48 bytes: six IEEE 754 binary64 numbers, little-endian, in the order x, y, z of the position (m) and
//! x, y, z of the velocity over the step just taken (m/s), axes as everywhere (east, north, up). To the network it is
//! opaque. Payloads of another length, or with a number that is not finite, come from someone else: they are not read.

use proto::types::{AgentStates, Payloads};

/// Length of a payload (bytes).
pub const LENGTH_BYTES: usize = 48;

/// Where a robot was and how it moved, by its own account.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Motion {
    /// Position (m).
    pub position_m: [f64; 3],
    /// Velocity (m/s).
    pub velocity_mps: [f64; 3],
}

/// Reads a payload; `None` if it is not one of ours.
#[must_use]
pub fn decode(payload: &[u8]) -> Option<Motion> {
    let (words, []) = payload.as_chunks::<8>() else { return None };
    let words: &[[u8; 8]; LENGTH_BYTES / 8] = words.try_into().ok()?;
    let numbers = words.map(f64::from_le_bytes);
    let [x, y, z, vx, vy, vz] = numbers;
    numbers
        .iter()
        .all(|number| number.is_finite())
        .then_some(Motion { position_m: [x, y, z], velocity_mps: [vx, vy, vz] })
}

/// What each agent says of its state. Agents that are not alive say nothing.
#[must_use]
pub fn encode(states: &AgentStates) -> Payloads {
    let mut length_bytes = Vec::with_capacity(states.len());
    let mut data = Vec::with_capacity(states.len() * LENGTH_BYTES);
    let columns =
        [&states.x_m, &states.y_m, &states.z_m, &states.vx_mps, &states.vy_mps, &states.vz_mps];
    for agent in 0..states.len() {
        if states.alive.get(agent) {
            let mut payload = [0; LENGTH_BYTES];
            for (word, column) in payload.as_chunks_mut::<8>().0.iter_mut().zip(columns) {
                *word = column[agent].to_le_bytes();
            }
            data.extend_from_slice(&payload);
            length_bytes.push(LENGTH_BYTES as u32);
        } else {
            length_bytes.push(0);
        }
    }
    Payloads::new(length_bytes, data.into()).expect("lengths were counted as data was written")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_robot_says_another_reads() {
        let mut states = AgentStates::at_origin(2);
        states.x_m[1] = 1.5;
        states.vy_mps[1] = -2.0;
        let payloads = encode(&states);
        let motion = decode(payloads.iter().nth(1).unwrap()).unwrap();
        assert_eq!(motion.position_m, [1.5, 0.0, 0.0]);
        assert_eq!(motion.velocity_mps, [0.0, -2.0, 0.0]);
        assert_eq!(&payloads.data()[48..56], &1.5f64.to_le_bytes());
    }

    #[test]
    fn a_robot_that_is_not_alive_says_nothing() {
        let mut states = AgentStates::at_origin(2);
        states.alive.set(0, false);
        assert_eq!(encode(&states).length_bytes(), [0, 48]);
    }

    #[test]
    fn a_foreign_payload_is_not_read() {
        assert_eq!(decode(&[0; 47]), None);
        assert_eq!(decode(&[0; 56]), None);
        assert_eq!(decode(&[0xff; 48]), None, "0xff.. is not a number");
    }
}
