//! Which slots are taken, as motes tell their neighbours: an information element of this simulator's own.
//!
//! It is a vendor-specific payload information element (IEEE Std 802.15.4-2015, 7.4.3: group 2), which whoever does not know
//! it passes over. Its content:
//!
//! | bytes | what |
//! |---|---|
//! | 3 | `OUI`, least significant byte first |
//! | 1 | slots that can be taken, minus one |
//! | 1 | number, among the taken slots, of the one that the first tag is for |
//! | 1 for 8 slots | bitmap: the sender hears a neighbour in this slot; slot 0 is bit 0 of the first byte |
//! | 1 each | [`tag`] of who is heard there: for taken slots one after the other, beginning anew after the last one |

use super::sink::{ByteReader, Put, Sink};
use super::{Eui64, Malformed};
use serde::{Deserialize, Serialize};

/// Whose information element it is: nobody's, from the range of locally administered identifiers.
pub(crate) const OUI: u32 = 0x02_0000;

/// Most slots that an announcement lists.
pub const MAX_SLOTS: u16 = 256;

/// A set of slots below [`MAX_SLOTS`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SlotSet([u64; 4]);

impl SlotSet {
    /// Whether a slot is in it.
    #[must_use]
    pub fn has(&self, slot: u16) -> bool {
        slot < MAX_SLOTS && self.0[usize::from(slot / 64)] & 1 << (slot % 64) != 0
    }

    /// Puts a slot into it, which must lie below [`MAX_SLOTS`].
    pub fn insert(&mut self, slot: u16) {
        self.0[usize::from(slot / 64)] |= 1 << (slot % 64);
    }

    /// How many slots are in it.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Whether no slot is in it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0 == [0; 4]
    }

    /// How many slots before this one are in it.
    #[must_use]
    pub fn rank(&self, slot: u16) -> usize {
        let whole = usize::from(slot / 64).min(self.0.len());
        let before: u32 = self.0[..whole].iter().map(|word| word.count_ones()).sum();
        let rest = self.0.get(whole).map_or(0, |word| word & ((1 << (slot % 64)) - 1));
        (before + rest.count_ones()) as usize
    }

    /// Its slots, ascending.
    pub fn iter(&self) -> impl Iterator<Item = u16> + '_ {
        (0..).step_by(64).zip(self.0).flat_map(|(base, word)| {
            let left = |word: u64| Some(word).filter(|&word| word != 0);
            let words = std::iter::successors(left(word), move |word| left(word & (word - 1)));
            words.map(move |word| base + word.trailing_zeros() as u16)
        })
    }

    fn byte(&self, index: u16) -> u8 {
        (self.0[usize::from(index / 8)] >> (8 * (index % 8))) as u8
    }
}

/// What a mote announces of the slots in which it hears its neighbours. Its own slot is the one it says so in.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SlotsRepr {
    /// Slots that can be taken, at most [`MAX_SLOTS`]: those before this one.
    pub n_slots: u16,
    /// Slots that are taken.
    pub taken: SlotSet,
    /// Number among them, from 0, of the slot that the first tag is for.
    pub first: u8,
    /// Tags of who is heard there; fewer than slots where a frame has no room for all.
    pub tags: Vec<u8>,
}

impl SlotsRepr {
    /// The tag of whoever is heard in a slot, if it is among those announced.
    #[must_use]
    pub(crate) fn tag_in(&self, slot: u16) -> Option<u8> {
        let n = self.taken.len();
        if !self.taken.has(slot) {
            return None;
        }
        let place = (self.taken.rank(slot) + n - usize::from(self.first) % n) % n;
        self.tags.get(place).copied()
    }

    /// Parses the content of a vendor-specific information element; `None`: it is another vendor's.
    ///
    /// # Errors
    /// It ends too early, or lists slots beyond its own end.
    pub fn parse(content: &[u8]) -> Result<Option<Self>, Malformed> {
        let mut reader = ByteReader::new(content);
        if reader.take(3)? != &OUI.to_le_bytes()[..3] {
            return Ok(None);
        }
        let n_slots = u16::from(reader.u8()?) + 1;
        let first = reader.u8()?;
        let mut taken = SlotSet::default();
        for (index, &byte) in (0..).zip(reader.take(usize::from(n_slots.div_ceil(8)))?) {
            let _: u16 = index;
            for bit in (0..8).filter(|bit| byte & 1 << bit != 0) {
                if n_slots <= 8 * index + bit {
                    return Err(reader.malformed("a slot beyond the last one"));
                }
                taken.insert(8 * index + bit);
            }
        }
        Ok(Some(Self { n_slots, taken, first, tags: reader.rest().to_vec() }))
    }
}

impl Put for SlotsRepr {
    fn put<S: Sink>(&self, sink: &mut S) {
        sink.put(&OUI.to_le_bytes()[..3]);
        sink.put_u8((self.n_slots - 1) as u8);
        sink.put_u8(self.first);
        for index in 0..self.n_slots.div_ceil(8) {
            sink.put_u8(self.taken.byte(index));
        }
        sink.put(&self.tags);
    }
}

/// Eight bits that stand for a mote in the `epoch`-th slotframe: other motes' differ, but for one in 256, and those of two
/// motes that agree in one slotframe do not in the next.
///
/// The finaliser of SplitMix64 (Steele, Lea, Flood: "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014).
#[must_use]
pub fn tag(address: Eui64, epoch: u64) -> u8 {
    let mut z = address.0.wrapping_add(epoch.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ z >> 31) >> 56) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::ids::MoteId;

    fn repr(n_slots: u16, taken: &[u16], first: u8, tags: &[u8]) -> SlotsRepr {
        let mut set = SlotSet::default();
        taken.iter().for_each(|&slot| set.insert(slot));
        SlotsRepr { n_slots, taken: set, first, tags: tags.to_vec() }
    }

    #[test]
    fn slots_are_listed_and_counted_as_they_were_put_in() {
        for seed in 0..200_u64 {
            let mut set = SlotSet::default();
            let in_it = |slot: u16| (u64::from(slot) * (2 * seed + 1)).is_multiple_of(seed % 9 + 1);
            let slots: Vec<u16> = (0..MAX_SLOTS).filter(|&slot| in_it(slot)).collect();
            slots.iter().for_each(|&slot| set.insert(slot));
            assert!(set.iter().eq(slots.iter().copied()));
            for slot in 0..=MAX_SLOTS {
                let before = slots.iter().filter(|&&other| other < slot).count();
                assert_eq!(set.rank(slot), before, "{slot}");
            }
        }
        assert_eq!(SlotSet::default().iter().count(), 0);
    }

    #[test]
    fn the_octets_are_those_of_the_table() {
        let announced = repr(12, &[0, 9], 1, &[0xaa, 0xbb]);
        let mut bytes = vec![0; crate::wire::sink::length_of(&announced)];
        crate::wire::sink::write(&announced, &mut bytes);
        assert_eq!(bytes, [0x00, 0x00, 0x02, 11, 1, 0b1, 0b10, 0xaa, 0xbb]);
        assert_eq!(SlotsRepr::parse(&bytes), Ok(Some(announced)));
        bytes[6] |= 1 << 4;
        assert_eq!(SlotsRepr::parse(&bytes).unwrap_err().what, "a slot beyond the last one");
        bytes[2] = 7;
        assert_eq!(SlotsRepr::parse(&bytes), Ok(None));
        assert!(SlotsRepr::parse(&bytes[..2]).is_err());
    }

    #[test]
    fn tags_belong_to_taken_slots_in_turn() {
        let announced = repr(256, &[3, 70, 130, 255], 2, &[1, 2, 3]);
        let tags: Vec<_> = announced.taken.iter().map(|slot| announced.tag_in(slot)).collect();
        assert_eq!(tags, [Some(3), None, Some(1), Some(2)]);
        assert_eq!(announced.tag_in(4), None);
        assert_eq!(announced.taken.rank(255), 3);
    }

    #[test]
    fn motes_whose_tags_agree_differ_soon() {
        // A tag is one of 256: of 128,000 pairs 500 agree, with a standard deviation of 22.
        let agree = |a: u32, b: u32, epoch| {
            tag(Eui64::of_mote(MoteId(a)), epoch) == tag(Eui64::of_mote(MoteId(b)), epoch)
        };
        let pairs = || (0..500_u32).flat_map(|a| (1..257).map(move |b| (a, a + b)));
        let n = pairs().filter(|&(a, b)| agree(a, b, 7)).count();
        assert!((380..620).contains(&n), "{n}");
        // Of those, one in 256 agrees in the next slotframe as well: 2 in the mean; 12 or more with a chance below 1e-5.
        let n = pairs().filter(|&(a, b)| agree(a, b, 7) && agree(a, b, 8)).count();
        assert!(n < 12, "{n}");
    }
}
