use super::*;
use crate::convert::records;
use proto::types::{Bitmap, NetRecord};

const N: usize = 9;

fn sent() -> Packets {
    let kind = |name: &str, is_application| PacketKind {
        name: name.to_owned(),
        is_application,
        created: 7,
    };
    Packets {
        id: vec![4, 3],
        kind: vec![0, 1],
        source: vec![8, 0],
        destination: vec![0, u32::MAX],
        created_ns: vec![10, 20],
        ended_ns: vec![20, 30],
        hops: vec![2, 0],
        payload_bytes: vec![90, 24],
        outcome: vec![0, 1],
        kinds: vec![kind("app", true), kind("location", false)],
        reasons: vec!["queue_full".to_owned()],
    }
}

fn counted() -> MoteStatistics {
    let mut known = Bitmap::filled(N, true);
    known.set(3, false);
    let column = |name: &str, known| Statistic {
        name: name.to_owned(),
        unit: "ns".to_owned(),
        values: vec![0.5; N],
        known,
    };
    MoteStatistics { columns: vec![column("up_ns", None), column("first_joined_ns", Some(known))] }
}

fn cells() -> Schedule {
    Schedule {
        mote: vec![0, 0, 8],
        slotframe: vec![0, 1, 0],
        slotframe_slots: vec![101, 11, 101],
        slot: vec![0, 10, 100],
        channel_offset: vec![0, 3, 15],
        options: vec![7, 1, 2],
        neighbour: vec![u32::MAX, 8, 0],
    }
}

fn links() -> HeardLinks {
    HeardLinks {
        receiver: vec![0, 0, 8],
        sender: vec![1, 8, 0],
        frames: vec![3, 1, 9],
        rssi_dbm: vec![-60.0, -90.5, -89.0],
    }
}

fn on_air() -> Frames {
    Frames {
        sent_ns: vec![10, 10, 30],
        sender: vec![0, 8, 0],
        destination: vec![u32::MAX, 0, 8],
        channel: vec![11, 26, 15],
        channel_offset: vec![0, 3, u32::MAX],
        kind: vec![0, 1, 1],
        length_bytes: vec![60, 127, 90],
        packet: vec![0, 4, 4],
        attempt: vec![1, 2, 1],
        n_received: vec![5, 1, 0],
        n_missed: vec![1, 0, 1],
        outcome: vec![FrameOutcome::Broadcast, FrameOutcome::Acknowledged, FrameOutcome::Lost],
        kinds: vec!["beacon".to_owned(), "data".to_owned()],
    }
}

fn missing() -> Formation {
    let reasons = vec!["hears no beacon".to_owned(), "has not joined".to_owned()];
    Formation { formed_ns: None, missing: vec![1, 8], reason: vec![1, 0], reasons }
}

#[test]
fn every_record_crosses_the_contract_unchanged() {
    assert_eq!(packets(Some(sent().into()), N), Ok(Some(sent())));
    assert_eq!(statistics(Some(counted().into()), N), Ok(Some(counted())));
    assert_eq!(schedule(Some(cells().into()), N), Ok(Some(cells())));
    assert_eq!(heard_links(Some(links().into()), N), Ok(Some(links())));
    assert_eq!(frames(Some(on_air().into()), N), Ok(Some(on_air())));
    assert_eq!(formation(Some(missing().into()), N), Ok(Some(missing())));
    let formed = Formation { formed_ns: Some(5), ..Formation::default() };
    assert_eq!(formation(Some(formed.clone().into()), N), Ok(Some(formed)));
}

#[test]
fn every_kind_of_record_has_a_number_and_others_have_none() {
    use NetRecord::{Capture, Frames, HeardLinks, Packets, Schedule, Statistics};
    let kinds = [Packets, Capture, Statistics, Schedule, HeardLinks, Frames];
    let numbers = kinds.map(|kind| v1::NetRecord::from(kind).into());
    assert_eq!(records(&numbers), Ok(kinds.to_vec()));
    assert!(records(&[0]).is_err() && records(&[99]).is_err());
}

/// What is said of a message after a change.
fn refusal<M, T: std::fmt::Debug>(
    mut message: M,
    change: impl FnOnce(&mut M),
    read: impl FnOnce(Option<M>, usize) -> Result<T>,
) -> String {
    change(&mut message);
    read(Some(message), N).unwrap_err().to_string()
}

#[test]
fn packets_that_make_no_sense_are_refused_by_name() {
    let refusal_of = |change: fn(&mut v1::Packets)| refusal(sent().into(), change, packets);
    let said = [
        refusal_of(|m| m.hops.truncate(1)),
        refusal_of(|m| m.source[0] = 9),
        refusal_of(|m| m.destination[0] = 9),
        refusal_of(|m| m.kind[0] = 2),
        refusal_of(|m| m.outcome[0] = 2),
        refusal_of(|m| m.ended_ns[1] = 20),
        refusal_of(|m| m.created_ns[0] = 21),
        refusal_of(|m| m.kinds[1].name = "app".to_owned()),
    ];
    assert_eq!(
        said,
        [
            "packets.hops: must have 2 entries, as id, got 1",
            "packets.source: motes are 0 to 8, got 9",
            "packets.destination: motes are 0 to 8, got 9",
            "packets.kind: must be less than 2, got 2",
            "packets.outcome: must be less than 2, got 2",
            "packets.id: must be in the order (ended_ns, id); entry 1 is not",
            "packets.ended_ns: must not be before created_ns; entry 0 is",
            "packets.kinds: names must be unique and not empty, got \"app\"",
        ]
    );
}

#[test]
fn states_that_make_no_sense_are_refused_by_name() {
    let of_statistics =
        |change: fn(&mut v1::MoteStatistics)| refusal(counted().into(), change, statistics);
    let of_cells = |change: fn(&mut v1::Schedule)| refusal(cells().into(), change, schedule);
    let of_links = |change: fn(&mut v1::HeardLinks)| refusal(links().into(), change, heard_links);
    let of_frames = |change: fn(&mut v1::Frames)| refusal(on_air().into(), change, frames);
    let of_formation =
        |change: fn(&mut v1::Formation)| refusal(missing().into(), change, formation);
    let said = [
        of_statistics(|m| m.columns[0].name = "Up".to_owned()),
        of_statistics(|m| m.columns[1].values[0] = f64::NAN),
        of_statistics(|m| m.columns[1].name = "up_ns".to_owned()),
        of_cells(|m| m.slot[1] = 11),
        of_cells(|m| m.mote[2] = 9),
        of_cells(|m| m.slotframe[0] = 2),
        of_links(|m| m.sender[1] = 1),
        of_links(|m| m.rssi_dbm[1] = f32::INFINITY),
        of_frames(|m| m.attempt.truncate(2)),
        of_frames(|m| m.sender[1] = 9),
        of_frames(|m| m.kind[0] = 2),
        of_frames(|m| m.sent_ns[2] = 9),
        of_frames(|m| m.outcome[0] = 4),
        of_formation(|m| m.formed = true),
        of_formation(|m| m.missing[0] = 8),
        of_formation(|m| m.reason[0] = 2),
    ];
    let fields: Vec<&str> = said.iter().filter_map(|text| text.split(':').next()).collect();
    assert_eq!(
        fields,
        [
            "statistics.columns[0].name",
            "statistics.columns[1].values",
            "statistics.columns",
            "schedule.slot",
            "schedule.mote",
            "schedule.mote",
            "heard_links.receiver",
            "heard_links.rssi_dbm",
            "frames.attempt",
            "frames.sender",
            "frames.kind",
            "frames.sent_ns",
            "frames.outcome",
            "formation.missing",
            "formation.missing",
            "formation.reason",
        ]
    );
}
