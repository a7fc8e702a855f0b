use super::*;
use crate::wire::arbitrary;
use proptest::prelude::*;

proptest! {
    #[test]
    fn what_was_written_is_read(message in arbitrary::rpl()) {
        let bytes = message.to_vec();
        prop_assert_eq!(bytes.len(), message.buffer_len());
        prop_assert_eq!(RplMessage::parse(message.code(), &bytes), Ok(message));
    }

    #[test]
    fn any_bytes_are_read_or_refused(code in 0_u8..5, bytes in proptest::collection::vec(any::<u8>(), 0..90)) {
        if let Ok(message) = RplMessage::parse(code, &bytes) {
            prop_assert_eq!(RplMessage::parse(code, &message.to_vec()), Ok(message));
        }
    }
}

fn dio() -> DioRepr {
    DioRepr {
        instance: 0,
        version: 240,
        rank: 768,
        grounded: true,
        mode: 1,
        preference: 3,
        dtsn: 240,
        dodag_id: "fd00::1:0".parse().unwrap(),
        configuration: None,
        prefix: None,
    }
}

#[test]
fn rfc6550_6_3_1_the_base_of_a_dio_has_24_bytes() {
    let bytes = RplMessage::Dio(dio()).to_vec();
    assert_eq!(bytes[..8], [0, 240, 3, 0, 0x8b, 240, 0, 0]);
    assert_eq!(bytes[8..], [0xfd, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0]);
}

#[test]
fn rfc6550_6_7_6_the_configuration_option_has_14_bytes_of_content() {
    let configuration = Some(DodagConfiguration {
        dio_interval_doublings: 9,
        dio_interval_min: 14,
        dio_redundancy: 3,
        max_rank_increase: 0x0700,
        min_hop_rank_increase: 256,
        objective: 0,
        default_lifetime: 30,
        lifetime_unit_s: 60,
    });
    let bytes = RplMessage::Dio(DioRepr { configuration, ..dio() }).to_vec();
    assert_eq!(bytes[24..], [4, 14, 0x30, 9, 14, 3, 7, 0, 1, 0, 0, 0, 0, 30, 0, 60]);
}

#[test]
fn rfc6550_6_7_10_the_prefix_option_has_30_bytes_of_content() {
    let prefix = Some(0xfd00_0000_0000_0000);
    let bytes = RplMessage::Dio(DioRepr { prefix, ..dio() }).to_vec();
    assert_eq!(bytes.len(), 24 + 32);
    assert_eq!(bytes[24..28], [8, 30, 64, 0x40]);
    assert_eq!(bytes[40..42], [0xfd, 0]);
}

#[test]
fn rfc6550_6_4_a_non_storing_dao_has_target_and_parent() {
    let dao = DaoRepr {
        instance: 0,
        ack_request: true,
        sequence: 241,
        targets: vec!["fd00::5".parse().unwrap()],
        path_sequence: 242,
        path_lifetime: 30,
        parent: Some("fd00::1:0".parse().unwrap()),
    };
    let bytes = RplMessage::Dao(dao.clone()).to_vec();
    assert_eq!(bytes[..8], [0, 0x80, 0, 241, 5, 18, 0, 128]);
    // § 9.9: of the eight bits of path control one is active, the most preferred.
    assert_eq!(bytes[24..30], [6, 20, 0, 0x80, 242, 30]);
    assert_eq!(bytes.len(), 4 + 20 + 22);
    let storing = RplMessage::Dao(DaoRepr { parent: None, ..dao });
    assert_eq!(storing.to_vec()[24..], [6, 4, 0, 0x80, 242, 30]);
}

#[test]
fn rfc6550_6_7_1_unknown_options_and_padding_are_skipped() {
    let mut bytes = RplMessage::Dio(dio()).to_vec();
    bytes.extend_from_slice(&[0, 1, 2, 0, 0, 77, 1, 9]);
    assert_eq!(RplMessage::parse(1, &bytes), Ok(RplMessage::Dio(dio())));
    bytes.push(77);
    RplMessage::parse(1, &bytes).unwrap_err();
}

#[test]
fn rfc6550_6_5_1_an_acknowledgment_echoes_the_sequence() {
    let ack = DaoAckRepr { instance: 0, sequence: 241, status: 128 };
    assert_eq!(RplMessage::DaoAck(ack).to_vec(), [0, 0, 241, 128]);
    assert_eq!(RplMessage::Dis(DisRepr {}).to_vec(), [0, 0]);
}
