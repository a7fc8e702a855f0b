//! `[netsim.security]`.

use crate::join::Security;
use crate::mote::compat::Compat;
use crate::wire::security::Keys;
use proto::config::{Problem, Section, TableSpec, join};

/// Description of `[netsim.security]`.
pub(super) const SPEC: TableSpec = Given::SPEC;

/// Link-layer security of IEEE Std 802.15.4 (RFC 8180, § 4.6), and OSCORE for join messages (RFC 9031). Without this table nothing
/// is secured.
#[derive(Section)]
struct Given {
    /// Whether frames are secured. Beacons are then authenticated (level 1, MIC-32), all other frames and acknowledgments are
    /// encrypted and authenticated (level 5, ENC-MIC-32), except those of motes that are not admitted yet. Captures have the true
    /// ciphertext.
    #[key(default = true)]
    enabled: bool,
    /// Key of beacons: 32 hexadecimal digits. The default is "6TiSCH minimal15" in ASCII, as in OpenWSN and Contiki-NG.
    #[key(default = "365469534348206d696e696d616c3135")]
    k1: String,
    /// Key of all other frames: 32 hexadecimal digits.
    #[key(default = "4d75726d75726174696f6e204b322e2e")]
    k2: String,
    /// Key from which the key follows that each mote shares with the join registrar, for join.secure = true: 32 hexadecimal digits.
    #[key(default = "4d75726d75726174696f6e206a6f696e")]
    join_key: String,
}

/// Makes the settings of the checked table; `None`: nothing is secured, or something is wrong, which `problems` says.
pub(super) fn build(
    table: Option<&toml::Table>,
    path: &str,
    compat: Compat,
    problems: &mut Vec<Problem>,
) -> Option<Security> {
    let given = Given::read(table?);
    let mut key = |name, text: &str| {
        let key = parse_key(text);
        if key.is_none() {
            let message = "must be 32 hexadecimal digits: a key of 128 bits";
            let given = format!("{text:?} of length {}", text.chars().count());
            problems.push(Problem::new(join(path, name), message).value(given));
        }
        key
    };
    let (k1, k2) = (key("k1", &given.k1), key("k2", &given.k2));
    let join_key = key("join_key", &given.join_key);
    if !given.enabled {
        return None;
    }
    if compat.no_frame_overhead {
        let message = "requires compat.no_frame_overhead = false: secured frames have headers";
        problems.push(Problem::new(join(path, "enabled"), message).value(true));
    }
    Some(Security { keys: Keys { k1: k1?, k2: k2? }, join_key: join_key? })
}

fn parse_key(text: &str) -> Option<[u8; 16]> {
    let is_hex = text.len() == 32 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_hex.then(|| u128::from_str_radix(text, 16).ok()).flatten().map(u128::to_be_bytes)
}
