use super::*;
use ccm::consts::U8;
use physics::asn::Asn;

/// IEEE Std 802.15.4-2006 and later, C.2: the key of all examples.
const KEY: [u8; 16] = [
    0xc0, 0xc1, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xcb, 0xcc, 0xcd, 0xce, 0xcf,
];

#[test]
fn ieee802154_c_2_1_a_beacon_is_authenticated() {
    let nonce = [0xac, 0xde, 0x48, 0, 0, 0, 0, 1, 0, 0, 0, 5, 2];
    let beacon = [
        0x08, 0xd0, 0x84, 0x21, 0x43, 0x01, 0, 0, 0, 0, 0x48, 0xde, 0xac, 0x02, 0x05, 0, 0, 0,
        0x55, 0xcf, 0, 0, 0x51, 0x52, 0x53, 0x54,
    ];
    let mic = seal::<U8>(&KEY, &nonce, &beacon, &mut []);
    assert_eq!(mic[..], [0x22, 0x3b, 0xc1, 0xec, 0x84, 0x1a, 0xb5, 0x53]);
    assert_eq!(unseal::<U8>(&KEY, &nonce, &beacon, &mut [], &mic), Some(()));
    assert_eq!(unseal::<U8>(&KEY, &nonce, &beacon[1..], &mut [], &mic), None);
}

#[test]
fn ieee802154_c_2_3_a_command_is_encrypted_and_authenticated() {
    let nonce = [0xac, 0xde, 0x48, 0, 0, 0, 0, 1, 0, 0, 0, 5, 6];
    let header = [
        0x2b, 0xdc, 0x84, 0x21, 0x43, 0x02, 0, 0, 0, 0, 0x48, 0xde, 0xac, 0xff, 0xff, 0x01, 0, 0,
        0, 0, 0x48, 0xde, 0xac, 0x06, 0x05, 0, 0, 0, 0x01,
    ];
    let mut command = [0xce];
    let mic = seal::<U8>(&KEY, &nonce, &header, &mut command);
    assert_eq!(command, [0xd8]);
    assert_eq!(mic[..], [0x4f, 0xde, 0x52, 0x90, 0x61, 0xf9, 0xc6, 0xf1]);
    assert_eq!(unseal::<U8>(&KEY, &nonce, &header, &mut command, &mic), Some(()));
    assert_eq!(command, [0xce]);
}

#[test]
fn ieee802154_9_3_2_2_the_nonce_is_the_sender_and_the_slot() {
    let nonce = nonce(Eui64(0x0102_0304_0506_0708), Asn(0x0a_0b0c_0d0e));
    assert_eq!(nonce, [1, 2, 3, 4, 5, 6, 7, 8, 0x0a, 0x0b, 0x0c, 0x0d, 0x0e]);
}

#[test]
fn ieee802154_9_4_the_header_has_the_level_and_the_index_of_the_key() {
    let header = |security: FrameSecurity| crate::wire::sink::bytes_of(&security);
    assert!(header(FrameSecurity::Unsecured).is_empty());
    assert_eq!(header(FrameSecurity::K1), [0b0110_1001, 1]);
    assert_eq!(header(FrameSecurity::K2), [0b0110_1101, 2]);
    for security in [FrameSecurity::K1, FrameSecurity::K2] {
        let bytes = header(security);
        assert_eq!(FrameSecurity::parse(&mut ByteReader::new(&bytes)), Ok(security));
        assert_eq!(security.overhead(), 6);
        // Another index; a frame counter that is not suppressed.
        for wrong in [[bytes[0], 3], [bytes[0] & !(1 << 5), bytes[1]]] {
            FrameSecurity::parse(&mut ByteReader::new(&wrong)).unwrap_err();
        }
    }
}
