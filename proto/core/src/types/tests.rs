use super::*;
use proptest::prelude::*;

#[test]
fn a_bitmap_with_a_spare_bit_set_is_refused() {
    assert!(Bitmap::from_bytes(&[0b0000_0111], 3).is_some());
    assert!(Bitmap::from_bytes(&[0b0000_1111], 3).is_none());
    assert!(Bitmap::from_bytes(&[1, 0], 3).is_none());
}

proptest! {
    #[test]
    fn lists_and_rows_say_the_same(heard in prop::collection::vec(prop::collection::vec(any::<bool>(), 11), 0..9)) {
        let mut ends = vec![];
        let mut indices = vec![];
        let mut bytes = vec![];
        for row in &heard {
            let mut bits = Bitmap::filled(11, false);
            for (index, &value) in row.iter().enumerate() {
                bits.set(index, value);
                if value { indices.push(index as u32); }
            }
            ends.push(indices.len() as u32);
            bytes.extend_from_slice(bits.as_bytes());
        }
        let lists = Deliveries { heard: Heard::Lists { ends, indices }, ..Deliveries::default() };
        let rows = Deliveries { heard: Heard::Rows { bytes: bytes.into(), row_bytes: 2 }, ..Deliveries::default() };
        prop_assert_eq!(lists.n_deliveries(), rows.n_deliveries());
        for receiver in 0..heard.len() {
            prop_assert!(lists.heard_by(receiver).eq(rows.heard_by(receiver)));
        }
    }
}
