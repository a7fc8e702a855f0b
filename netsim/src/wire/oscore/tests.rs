use super::*;
use proto::ids::MoteId;

/// RFC 8613, appendix C: master secret and master salt of all examples.
const SECRET: [u8; 16] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16];
const SALT: [u8; 8] = [0x9e, 0x7c, 0xa9, 0x22, 0x23, 0x78, 0x63, 0x40];

fn hex(text: &str) -> Vec<u8> {
    let digit = |at: usize| u8::from_str_radix(&text[at..at + 2], 16).unwrap();
    (0..text.len()).step_by(2).map(digit).collect()
}

#[test]
fn rfc8613_c_1_the_keys_of_client_and_server() {
    let client = Context::derive(&SECRET, &SALT, None, &[], &[1]);
    assert_eq!(client.sender_key[..], hex("f0910ed7295e6ad4b54fc793154302ff"));
    assert_eq!(client.recipient_key[..], hex("ffb14e093c94c9cac9471648b4f98710"));
    assert_eq!(client.common_iv[..], hex("4622d4dd6d944168eefb54987c"));
    let server = Context::derive(&SECRET, &SALT, None, &[1], &[]);
    assert_eq!(server.sender_key, client.recipient_key);
    assert_eq!(server.recipient_key, client.sender_key);
}

#[test]
fn rfc8613_c_3_the_keys_with_an_id_context() {
    let id_context = hex("37cbf3210017a2d3");
    let client = Context::derive(&SECRET, &SALT, Some(&id_context), &[], &[1]);
    assert_eq!(client.sender_key[..], hex("af2a1300a5e95788b356336eeecd2b92"));
    assert_eq!(client.recipient_key[..], hex("e39a0c7c77b43f03b4b39ab9a268699f"));
    assert_eq!(client.common_iv[..], hex("2ca58fb85ff1b81c0b7181b85e"));
}

#[test]
fn rfc8613_c_4_a_request_is_protected() {
    // GET, Uri-Path "tv1"; Partial IV 20.
    let client = Context::derive(&SECRET, &SALT, None, &[], &[1]);
    let mut message = hex("01b3747631");
    client.protect_request(20, &mut message);
    assert_eq!(message, hex("612f1092f1776f1c1668b3825e"));
    let server = Context::derive(&SECRET, &SALT, None, &[1], &[]);
    assert_eq!(server.unprotect_request(20, &message), Some(hex("01b3747631")));
    assert_eq!(server.unprotect_request(21, &message), None);
    assert_eq!(server.unprotect_request(20, &message[..7]), None);
}

#[test]
fn rfc8613_c_7_a_response_has_the_nonce_of_its_request() {
    // 2.05, "Hello World!".
    let server = Context::derive(&SECRET, &SALT, None, &[1], &[]);
    let mut message = hex("45ff48656c6c6f20576f726c6421");
    server.protect_response(20, &mut message);
    assert_eq!(message, hex("dbaad1e9a7e7b2a813d3c31524378303cdafae119106"));
    let client = Context::derive(&SECRET, &SALT, None, &[], &[1]);
    assert_eq!(client.unprotect_response(20, &message), Some(hex("45ff48656c6c6f20576f726c6421")));
    assert_eq!(client.unprotect_response(19, &message), None);
}

#[test]
fn each_pledge_has_a_key_of_its_own() {
    let key = |mote| pre_shared_key(&SECRET, Eui64::of_mote(mote));
    assert_ne!(key(MoteId(1)), key(MoteId(2)));
    let mut message = vec![1, 2, 3];
    Context::of_pledge(&SECRET, Eui64::of_mote(MoteId(1))).protect_request(0, &mut message);
    let read = |mote| {
        let registrar = Context::of_registrar(&SECRET, Eui64::of_mote(mote));
        registrar.unprotect_request(0, &message)
    };
    assert_eq!(read(MoteId(1)), Some(vec![1, 2, 3]));
    assert_eq!(read(MoteId(2)), None);
}

#[test]
fn rfc8613_6_1_a_partial_iv_has_no_leading_zeros() {
    assert_eq!(partial_iv(0), [0]);
    assert_eq!(partial_iv(255), [255]);
    assert_eq!(partial_iv(256), [1, 0]);
    assert_eq!(partial_iv(0x1234_5678), [0x12, 0x34, 0x56, 0x78]);
}
