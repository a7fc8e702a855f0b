use super::*;

const N: usize = 3;

/// Agent 0 speaks to everyone, agent 2 to agent 1; agents 1 and 2 hear the first, agent 1 the second.
fn told() -> v1::Deliveries {
    v1::Deliveries {
        transmissions: Some(v1::Transmissions {
            sender: vec![0, 2],
            sent_ns: vec![10, 20],
            end_ns: vec![14, 24],
            payloads: Some(Payloads::new(vec![1, 2], Bytes::from_static(b"abc")).unwrap().into()),
            destination: vec![EVERYONE, 1],
        }),
        heard_end: vec![0, 2, 3],
        heard: vec![0, 1, 0],
        received_ns: vec![14, 24, 14],
        rssi_dbm: vec![-60.0, -70.0, -80.0],
        ..v1::Deliveries::default()
    }
}

/// What is said of deliveries that are changed.
fn refused(change: impl FnOnce(&mut v1::Deliveries, &mut v1::Transmissions)) -> String {
    let mut message = told();
    let mut sent = message.transmissions.take().unwrap();
    change(&mut message, &mut sent);
    message.transmissions = Some(sent);
    deliveries(Some(message), N).unwrap_err().to_string()
}

#[test]
fn deliveries_come_back_as_they_were() {
    let read = deliveries(Some(told()), N).unwrap().unwrap();
    assert_eq!(read.transmissions.destination, [EVERYONE, 1]);
    assert_eq!(read.n_deliveries(), 3);
    assert_eq!(v1::Deliveries::from(read), told());
    let broadcasts = |message: &mut v1::Deliveries| {
        message.transmissions.as_mut().unwrap().destination.clear();
    };
    let mut message = told();
    broadcasts(&mut message);
    assert!(deliveries(Some(message), N).unwrap().unwrap().transmissions.destination.is_empty());
    assert_eq!(deliveries(None, N).unwrap(), None);
}

#[test]
fn malformed_deliveries_are_refused_by_the_name_of_what_is_wrong() {
    let all = [
        (
            refused(|_, sent| sent.destination = vec![1]),
            "deliveries.transmissions.destination: must have 2 entries, as sender, got 1",
        ),
        (
            refused(|_, sent| sent.destination[1] = 3),
            "deliveries.transmissions.destination: agents are 0 to 2, and 4294967295 is everyone, got 3",
        ),
        (
            refused(|_, sent| sent.sender[0] = EVERYONE),
            "deliveries.transmissions.sender: agents are 0 to 2, got 4294967295",
        ),
        (
            refused(|_, sent| sent.sent_ns.swap(0, 1)),
            "deliveries.transmissions: must be in the order (sent_ns, sender); entry 1 is not",
        ),
        (
            refused(|_, sent| sent.end_ns[1] = 19),
            "deliveries.transmissions.end_ns: must not be before sent_ns; entry 1 is",
        ),
        (
            refused(|message, _| message.heard[1] = 2),
            "deliveries.heard: receiver 1: indices must ascend and be less than 2",
        ),
        (
            refused(|message, _| message.heard_end[2] = 2),
            "deliveries.heard_end: must end with 3, the length of heard, got 2",
        ),
        (
            refused(|message, _| message.rssi_dbm[2] = f32::NAN),
            "deliveries.rssi_dbm: must be finite, got NaN",
        ),
        (
            refused(|message, _| message.received_ns.truncate(1)),
            "deliveries.received_ns: must be empty or have 3 entries, one per delivery, got 1",
        ),
    ];
    for (said, expected) in all {
        assert_eq!(said, expected);
    }
}
