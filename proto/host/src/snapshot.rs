//! The envelope of a snapshot: who wrote it, in which version, and a checksum over all of it.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | [`MAGIC`], with the format of the envelope as its last byte |
//! | 32 | SHA-256 of everything after it |
//! | 1 + n | length and text of the writer, such as `netsim 0.1.0` |
//! | rest | the state |
//!
//! A state is read only after its checksum was found right: no mutation of a snapshot reaches a simulator.

use proto::digest;
use proto::side::NotASnapshot;

/// What every snapshot begins with. The last byte is the format of the envelope.
const MAGIC: [u8; 8] = *b"cosim\0\x53\x01";
/// Length of a SHA-256 digest.
const CHECKSUM: usize = 32;

/// The state in its envelope. `writer` is the simulator's name and version, at most 255 bytes.
pub(crate) fn seal(writer: &str, state: &[u8]) -> Vec<u8> {
    let writer = &writer.as_bytes()[..writer.len().min(usize::from(u8::MAX))];
    let mut sealed = Vec::with_capacity(MAGIC.len() + CHECKSUM + 1 + writer.len() + state.len());
    sealed.extend(MAGIC);
    sealed.extend([0; CHECKSUM]);
    sealed.push(writer.len() as u8);
    sealed.extend(writer);
    sealed.extend(state);
    let checksum = digest::of_bytes(&sealed[MAGIC.len() + CHECKSUM..]);
    sealed[MAGIC.len()..MAGIC.len() + CHECKSUM].copy_from_slice(&checksum);
    sealed
}

/// The state that [`seal`] put into an envelope.
///
/// # Errors
///
/// Not a snapshot, one of another format, a damaged one, or one of another writer, which is named.
pub(crate) fn open<'a>(writer: &str, sealed: &'a [u8]) -> Result<&'a [u8], NotASnapshot> {
    let wrong = |reason: String| Err(NotASnapshot(reason));
    let Some((magic, rest)) = sealed.split_at_checked(MAGIC.len()) else {
        return wrong(format!("it has {} bytes", sealed.len()));
    };
    let format = MAGIC.len() - 1;
    if magic[..format] != MAGIC[..format] {
        return wrong("it does not begin as one".to_owned());
    }
    if magic[format] != MAGIC[format] {
        return wrong(format!(
            "it has format {}, and this program reads format {}",
            magic[format], MAGIC[format]
        ));
    }
    let Some((checksum, content)) = rest.split_at_checked(CHECKSUM) else {
        return wrong("it is cut short".to_owned());
    };
    if checksum != digest::of_bytes(content) {
        return wrong("its checksum is wrong: it is damaged or cut short".to_owned());
    }
    let written = content.split_first().and_then(|(&n, rest)| rest.split_at_checked(n.into()));
    let Some((found, state)) = written else { return wrong("it names no writer".to_owned()) };
    if found != writer.as_bytes() {
        let found = String::from_utf8_lossy(found);
        return wrong(format!("it was written by {found}, and this is {writer}"));
    }
    Ok(state)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_snapshot_comes_back_and_none_that_was_changed_does() {
        let sealed = seal("netsim 0.1.0", b"state");
        assert_eq!(open("netsim 0.1.0", &sealed), Ok(&b"state"[..]));
        for i in 0..sealed.len() {
            for bit in 0..8 {
                let mut changed = sealed.clone();
                changed[i] ^= 1 << bit;
                assert!(open("netsim 0.1.0", &changed).is_err(), "byte {i}, bit {bit}");
            }
            assert!(open("netsim 0.1.0", &sealed[..i]).is_err(), "{i} bytes");
        }
        assert!(open("netsim 0.1.0", &[&sealed[..], b"x"].concat()).is_err());
    }

    #[test]
    fn a_snapshot_of_another_version_is_refused_with_the_version_that_wrote_it() {
        let refused = open("netsim 0.2.0", &seal("netsim 0.1.0", b"state")).unwrap_err();
        assert_eq!(refused.0, "it was written by netsim 0.1.0, and this is netsim 0.2.0");
    }
}
