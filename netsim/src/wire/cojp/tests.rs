use super::*;
use crate::wire::arbitrary;
use crate::wire::oscore::Context;
use crate::wire::security::Keys;
use proptest::prelude::*;
use proto::ids::MoteId;

proptest! {
    #[test]
    fn what_was_written_is_read(message in arbitrary::cojp()) {
        let bytes = message.to_vec();
        prop_assert_eq!(bytes.len(), message.buffer_len());
        prop_assert_eq!(CojpRepr::parse(&bytes), Ok(message));
    }

    #[test]
    fn what_was_protected_is_read(message in arbitrary::protected_cojp(), keep in 0.0..1.0) {
        let bytes = message.to_vec();
        prop_assert_eq!(bytes.len(), message.buffer_len());
        prop_assert_eq!(CojpRepr::parse(&bytes), Ok(message));
        let _ = CojpRepr::parse(&bytes[..(bytes.len() as f64 * keep) as usize]);
    }

    #[test]
    fn cut_off_messages_are_refused(message in arbitrary::cojp(), keep in 0.0..1.0) {
        let bytes = message.to_vec();
        let kept = (bytes.len() as f64 * keep) as usize;
        prop_assert!(CojpRepr::parse(&bytes[..kept]).is_err());
    }
}

#[test]
fn rfc9031_8_1_1_a_join_request_is_a_post_to_j_at_6tisch_arpa() {
    let pledge = Eui64::of_mote(MoteId(5));
    let request =
        CojpRepr::Request { message_id: 0x0102, pledge, proxy_state: None, network_id: 0xabcd };
    let mut expected = vec![0x58, 0x02, 0x01, 0x02, 2, 0, 0, 0, 0, 0, 0, 5, 0x3b];
    expected.extend_from_slice(b"6tisch.arpa\x81j\xd4\x0fcoap\xff\xa1\x05\x42\xab\xcd");
    assert_eq!(request.to_vec(), expected);
}

#[test]
fn rfc8974_3_a_proxy_keeps_its_state_in_the_token_and_takes_the_scheme_off() {
    let pledge = Eui64::of_mote(MoteId(5));
    let proxied = Some(pledge);
    let request =
        |proxy_state| CojpRepr::Request { message_id: 7, pledge, proxy_state, network_id: 1 };
    let bytes = request(proxied).to_vec();
    assert_eq!(bytes[4..12], [3, 0, 0, 0, 0, 0, 0, 5]);
    assert_eq!(bytes[12..27], *b"\x3b6tisch.arpa\x81j\xff");
    assert_eq!(bytes.len() + 6, request(None).buffer_len());
    assert_eq!(CojpRepr::parse(&bytes), Ok(request(proxied)));
}

#[test]
fn rfc9031_8_4_a_join_response_has_a_key_set_of_one() {
    let pledge = Eui64::of_mote(MoteId(5));
    let response = |key_index| CojpRepr::Response {
        message_id: 7,
        pledge,
        proxy_state: None,
        key_index,
        keys: None,
        join_rate_bytes_s: None,
    };
    let bytes = response(1).to_vec();
    assert_eq!(bytes[..12], [0x58, 0x44, 0, 7, 2, 0, 0, 0, 0, 0, 0, 5]);
    assert_eq!(bytes[12..18], [0xff, 0xa1, 0x02, 0x82, 0x01, 0x50]);
    assert_eq!(bytes.len(), 18 + 16);
    assert_eq!(response(200).buffer_len(), bytes.len() + 1);
}

#[test]
fn rfc9031_8_4_2_a_join_response_may_tell_the_join_rate() {
    let pledge = Eui64::of_mote(MoteId(5));
    for (rate, written) in [
        (0, &[7, 0][..]),
        (23, &[7, 23]),
        (24, &[7, 0x18, 24]),
        (256, &[7, 0x19, 1, 0]),
        (65_536, &[7, 0x1a, 0, 1, 0, 0]),
    ] {
        let response = CojpRepr::Response {
            message_id: 7,
            pledge,
            proxy_state: None,
            key_index: 1,
            keys: None,
            join_rate_bytes_s: Some(rate),
        };
        let bytes = response.to_vec();
        assert_eq!(bytes[12..14], [0xff, 0xa2]);
        assert_eq!(bytes[34..], *written);
        assert_eq!(CojpRepr::parse(&bytes), Ok(response));
    }
}

const JOIN_KEY: [u8; 16] = *b"a key of nobody.";

/// A request under OSCORE, and the contexts of both ends.
fn protected(sequence: u32, proxy_state: Option<Eui64>) -> (CojpRepr, [Context; 2]) {
    let pledge = Eui64::of_mote(MoteId(5));
    let of_pledge = Context::of_pledge(&JOIN_KEY, pledge);
    let request = CojpRepr::Request { message_id: 7, pledge, proxy_state, network_id: 0xabcd };
    let request = request.protect(&of_pledge, sequence);
    (request, [of_pledge, Context::of_registrar(&JOIN_KEY, pledge)])
}

#[test]
fn rfc9031_8_1_1_a_protected_request_names_the_pledge_in_the_oscore_option() {
    let (request, [_, registrar]) = protected(1, None);
    let bytes = request.to_vec();
    assert_eq!(bytes[..4], [0x50, 0x02, 0, 7]);
    assert_eq!(bytes[4..16], *b"\x3b6tisch.arpa");
    // Option 9 of 11 bytes: flags, Partial IV, ID context; the key identifier is empty.
    assert_eq!(bytes[16..28], [0x6b, 0x19, 1, 8, 2, 0, 0, 0, 0, 0, 0, 5]);
    assert_eq!(bytes[28..35], *b"\xd4\x11coap\xff");
    // Code, Uri-Path, payload marker, map of five bytes; tag.
    assert_eq!(bytes.len(), 35 + 1 + 2 + 1 + 5 + 8);
    assert_eq!(CojpRepr::parse(&bytes).as_ref(), Ok(&request));
    let read = request.unprotect_request(&registrar);
    assert!(matches!(read, Some(CojpRepr::Request { network_id: 0xabcd, .. })), "{read:?}");
    let (proxied, _) = protected(1, Some(Eui64::of_mote(MoteId(5))));
    assert_eq!(proxied.buffer_len(), bytes.len() + 8 - 6);
    assert_eq!(CojpRepr::parse(&proxied.to_vec()), Ok(proxied));
}

#[test]
fn rfc9031_8_4_3_a_protected_response_brings_both_keys_and_nobody_else_reads_it() {
    let pledge = Eui64::of_mote(MoteId(5));
    let (_, [of_pledge, registrar]) = protected(300, None);
    let keys = Some(Keys { k1: [1; 16], k2: [2; 16] });
    let (key_index, join_rate_bytes_s, proxy_state) = (1, None, None);
    let plain = CojpRepr::Response {
        message_id: 7,
        pledge,
        proxy_state,
        key_index,
        keys,
        join_rate_bytes_s,
    };
    let response = plain.clone().protect(&registrar, 300);
    let bytes = response.to_vec();
    assert_eq!(bytes[..6], [0x50, 0x44, 0, 7, 0x90, 0xff]);
    // Code, payload marker, map with an array of six; tag.
    assert_eq!(bytes.len(), 6 + 1 + 1 + 3 + 2 * (2 + 17) + 8);
    assert_eq!(CojpRepr::parse(&bytes).as_ref(), Ok(&response));
    assert_eq!(response.unprotect_response(&of_pledge, 298..=301, pledge), Some(plain));
    assert_eq!(response.unprotect_response(&of_pledge, 301..=310, pledge), None);
    let other = Context::of_pledge(&JOIN_KEY, Eui64::of_mote(MoteId(6)));
    assert_eq!(response.unprotect_response(&other, 300..=300, pledge), None);
}
