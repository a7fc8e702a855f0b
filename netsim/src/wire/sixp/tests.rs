use super::*;
use crate::wire::arbitrary;
use proptest::prelude::*;

proptest! {
    #[test]
    fn what_was_written_is_read(message in arbitrary::sixp()) {
        let bytes = message.to_vec();
        prop_assert_eq!(bytes.len(), message.buffer_len());
        prop_assert_eq!(SixpRepr::parse(&bytes), Ok(message));
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..64)) {
        if let Ok(message) = SixpRepr::parse(&bytes) {
            prop_assert_eq!(SixpRepr::parse(&message.to_vec()), Ok(message));
        }
    }
}

fn message(body: SixpBody) -> SixpRepr {
    SixpRepr { version: 0, sfid: 0, seqnum: 5, body }
}

#[test]
fn rfc8480_3_3_1_an_add_request_has_metadata_options_number_and_cells() {
    let cells = vec![SixpCell { slot: 0x0102, channel: 0x0304 }, SixpCell { slot: 7, channel: 15 }];
    let request = CellRequest { metadata: 2, options: CellOptions(1), num_cells: 1, cells };
    let message = message(SixpBody::Request(SixpRequest::Add(request)));
    let header = [0x00, 0x01, 0x00, 0x05];
    let body = [0x02, 0x00, 0x01, 0x01, 0x02, 0x01, 0x04, 0x03, 7, 0, 15, 0];
    assert_eq!(message.to_vec(), [&header[..], &body].concat());
}

#[test]
fn rfc8480_3_3_5_a_list_request_has_a_reserved_byte() {
    let metadata = 0;
    let options = CellOptions(2);
    let request = SixpRequest::List { metadata, options, offset: 3, max_num_cells: 0x0110 };
    let bytes = message(SixpBody::Request(request)).to_vec();
    assert_eq!(bytes, [0, 5, 0, 5, 0, 0, 2, 0, 3, 0, 0x10, 0x01]);
}

#[test]
fn rfc8480_3_2_2_type_and_version_share_the_first_byte() {
    let answer = SixpAnswer { code: ReturnCode::ErrorSeqnum, content: AnswerContent::Nothing };
    let response = message(SixpBody::Response(answer.clone()));
    assert_eq!(response.to_vec(), [0x10, 6, 0, 5]);
    let confirmation = SixpRepr { version: 3, ..message(SixpBody::Confirmation(answer)) };
    assert_eq!(confirmation.to_vec(), [0x23, 6, 0, 5]);
    assert_eq!(SixpRepr::parse(&[0x30, 0, 0, 0]).unwrap_err().what, "reserved type of 6P message");
}

#[test]
fn an_answer_is_read_by_the_command_it_answers() {
    let parse = |bytes: &[u8], command| match SixpRepr::parse_answer(bytes, command).unwrap().body {
        SixpBody::Response(answer) => answer.content,
        other => panic!("{other:?}"),
    };
    let empty = [0x10, 0, 0, 1];
    assert_eq!(parse(&empty, SixpCommand::Add), AnswerContent::Cells(vec![]));
    assert_eq!(parse(&empty, SixpCommand::Clear), AnswerContent::Nothing);
    let four = [0x10, 0, 0, 1, 1, 0, 2, 0];
    assert_eq!(
        parse(&four, SixpCommand::List),
        AnswerContent::Cells(vec![SixpCell { slot: 1, channel: 2 }])
    );
    assert_eq!(parse(&four, SixpCommand::Signal), AnswerContent::Payload(vec![1, 0, 2, 0]));
    let error = [0x10, 8, 0, 1];
    assert_eq!(parse(&error, SixpCommand::Add), AnswerContent::Nothing);
    SixpRepr::parse_answer(&four, SixpCommand::Count).unwrap_err();
}
