use super::*;
use crate::wire::arbitrary;
use crate::wire::cojp::CojpRepr;
use proptest::prelude::*;

proptest! {
    #[test]
    fn what_was_written_is_read(message in arbitrary::coap()) {
        let bytes = message.to_vec();
        prop_assert_eq!(bytes.len(), message.buffer_len());
        prop_assert!(is_application(&bytes));
        prop_assert_eq!(CoapRepr::parse(&bytes), Ok(message));
    }

    #[test]
    fn what_is_read_is_written_the_same(bytes in prop::collection::vec(any::<u8>(), 0..40), kind in 0_u8..2, n_token in 0_u8..16) {
        let bytes = [&[0x40 | kind << 5 | n_token, 1, 0, 7][..], &bytes].concat();
        if let Ok(message) = CoapRepr::parse(&bytes) {
            prop_assert_eq!(message.to_vec(), bytes);
        }
    }

    #[test]
    fn messages_of_the_join_protocol_are_not_taken_for_an_application_s(message in arbitrary::cojp()) {
        prop_assert!(!is_application(&message.to_vec()));
        prop_assert!(CoapRepr::parse(&message.to_vec()).is_err());
    }

    #[test]
    fn messages_of_applications_are_not_taken_for_the_join_protocol_s(message in arbitrary::coap()) {
        prop_assert!(CojpRepr::parse(&message.to_vec()).is_err());
    }
}

/// RFC 7252, appendix A, figures 16 and 17: without a token, and with the token 0x20.
#[test]
fn rfc7252_a_confirmable_requests_and_their_piggybacked_responses() {
    type Example = (u16, &'static [u8], &'static [u8], &'static [u8]);
    let examples: [Example; 2] = [
        (0x7d34, b"", b"\x40\x01\x7d\x34\xbbtemperature", b"\x60\x45\x7d\x34\xff22.3 C"),
        (
            0x7d35,
            b"\x20",
            b"\x41\x01\x7d\x35\x20\xbbtemperature",
            b"\x61\x45\x7d\x35\x20\xff22.3 C",
        ),
    ];
    for (message_id, token, request, response) in examples {
        let token = Token::new(token).unwrap();
        let get = CoapRepr { message_id, token, ..CoapRepr::request(Code::GET, "temperature") };
        assert_eq!(get.to_vec(), request);
        assert_eq!(CoapRepr::parse(request), Ok(get.clone()));
        let payload = bytes::Bytes::from_static(b"22.3 C");
        let content = CoapRepr { payload, ..get.response(Code::CONTENT) };
        assert_eq!(content.to_vec(), response);
        assert!(content.answers(message_id, token));
        assert!(!content.answers(message_id + 1, token));
        assert!(!content.answers(message_id, Token::from(7)));
        assert!(!get.answers(message_id, token), "a request is no answer");
    }
}

#[test]
fn tokens_have_at_most_8_bytes() {
    assert_eq!(Token::from(0x0100_0002).bytes(), [1, 0, 0, 2]);
    assert_eq!(Token::new(&[1; 9]), None);
    let nine = [&[0x49, 1, 0, 7][..], &[1; 9]].concat();
    assert_eq!(CoapRepr::parse(&nine).unwrap_err().what, "a token of more than 8 bytes");
}

/// RFC 7959, 2.2: NUM, M and SZX in a number of 0 to 3 bytes; option deltas of 12 and 23, and 5 to Size2.
#[test]
fn rfc7959_2_2_block_options_are_numbers_in_as_few_bytes_as_they_take() {
    let with = |number, more, szx| CoapRepr {
        block2: Some(Block { number, more, szx }),
        ..CoapRepr::request(Code::GET, "f0")
    };
    assert_eq!(with(0, false, 0).to_vec()[4..], *b"\xb2f0\xc0");
    assert_eq!(with(0, false, 2).to_vec()[4..], *b"\xb2f0\xc1\x02");
    assert_eq!(with(65_535, true, 6).to_vec()[4..], *b"\xb2f0\xc3\x0f\xff\xfe");
    let block2 = Block { number: 1, more: true, szx: 2 };
    assert_eq!(block2.size_bytes(), 64);
    let content = CoapRepr {
        block2: Some(block2),
        size2: Some(4096),
        ..with(0, false, 2).response(Code::CONTENT)
    };
    assert_eq!(content.to_vec()[4..], *b"\xd1\x0a\x1a\x52\x10\x00");
}
