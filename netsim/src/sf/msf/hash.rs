//! Where autonomous cells lie: RFC 9033, § 3 and appendix A.

use crate::wire::Eui64;

/// Left shift of the hash (appendix A: l_bit).
const LEFT_BITS: u32 = 0;
/// Right shift of the hash (appendix A: r_bit).
const RIGHT_BITS: u32 = 1;

/// SAX, shift-add-xor (Ramakrishna and Zobel, DASFAA 1997), over the octets of an address: a number below `table_slots`.
/// The remainder is taken after every octet.
fn sax(address: Eui64, table_slots: u32, left_bits: u32, right_bits: u32) -> u32 {
    let step = |hash: u64, octet: u8| {
        let sum = (hash << left_bits) + (hash >> right_bits) + u64::from(octet);
        (hash ^ sum) % u64::from(table_slots)
    };
    address.octets().into_iter().fold(0, step) as u32
}

/// Slot and channel offset of the cell in which a mote receives from anyone (§ 3): every slot but the first, every channel.
///
/// # Panics
///
/// If the slotframe has fewer than two slots, or there is no channel.
#[must_use]
pub fn autonomous_cell(address: Eui64, slotframe_slots: u16, n_channels: u16) -> (u16, u16) {
    assert!(slotframe_slots >= 2 && n_channels != 0, "there is a slot beside the minimal cell's");
    let hash = |table: u16| sax(address, u32::from(table), LEFT_BITS, RIGHT_BITS) as u16;
    (1 + hash(slotframe_slots - 1), hash(n_channels))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ADDRESSES: [Eui64; 6] = [
        Eui64(0),
        Eui64(0x0200_0000_0001_0000),
        Eui64(0x0200_0000_0000_0001),
        Eui64(0x0200_0000_0000_000a),
        Eui64(0x0123_4567_89ab_cdef),
        Eui64(u64::MAX),
    ];

    #[test]
    fn rfc9033_appendix_a_rounds_take_the_remainder_after_every_octet() {
        // The vectors of eight octets, 16 bits kept after each, with the shifts of the 6TiSCH simulator. It feeds a zero
        // before every octet and cuts at the end only: other cells than the standard's.
        let expected = [0, 20_582, 27_694, 27_669, 11_935, 31_580];
        assert_eq!(ADDRESSES.map(|address| sax(address, 1 << 16, 5, 2)), expected);
        let of_motes =
            [27_694, 27_693, 27_692, 27_667, 27_666, 27_665, 27_664, 27_671, 27_670, 27_669];
        let motes = std::array::from_fn(|k| Eui64(0x0200_0000_0000_0001 + k as u64));
        assert_eq!(motes.map(|address| sax(address, 1 << 16, 5, 2)), of_motes);
    }

    #[test]
    fn rfc9033_appendix_a_cells_with_its_own_shifts() {
        let expected = [(1, 0), (1, 0), (2, 1), (11, 10), (74, 15), (64, 1)];
        assert_eq!(ADDRESSES.map(|address| autonomous_cell(address, 101, 16)), expected);
    }

    proptest! {
        #[test]
        fn rfc9033_3_autonomous_cells_leave_the_first_slot_free(
            address: u64,
            slots in 2u16..500,
            n_channels in 1u16..=16,
        ) {
            let (slot, channel) = autonomous_cell(Eui64(address), slots, n_channels);
            prop_assert!((1..slots).contains(&slot));
            prop_assert!(channel < n_channels);
        }
    }
}
