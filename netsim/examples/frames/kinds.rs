//! One frame of every kind.

use netsim::wire::coap::{Block, CoapRepr, Code};
use netsim::wire::cojp::CojpRepr;
use netsim::wire::datagram::{Datagram, RpiRepr, SourceRoute, UdpRepr, Upper, code_points};
use netsim::wire::fragment::LowpanRepr;
use netsim::wire::frame::{
    BeaconRepr, BeaconSlotframe, Content, FrameRepr, NETWORK_PAN, payload_room,
};
use netsim::wire::rpl::{DaoAckRepr, DaoRepr, DioRepr, DisRepr, DodagConfiguration, RplMessage};
use netsim::wire::security::FrameSecurity;
use netsim::wire::sixp::{
    AnswerContent, CellOptions, CellRequest, ReturnCode, SixpAnswer, SixpBody, SixpCell, SixpRepr,
    SixpRequest,
};
use netsim::wire::slots::{SlotSet, SlotsRepr};
use netsim::wire::{Eui64, address};
use physics::asn::Asn;
use proto::ids::MoteId;
use std::sync::Arc;

/// One frame of every kind, as motes 0 (the root), 1, 2 and 3 on a line send them, then a datagram without and one with
/// RPL packet information, in fragments of three.
pub(crate) fn frames() -> Vec<FrameRepr> {
    let beacon = frame(0, None, Content::Beacon(beacon()));
    let mut frames = vec![beacon, frame(1, Some(0), Content::KeepAlive)];
    frames.extend(sixp().map(|message| frame(1, Some(0), Content::Sixp(message))));
    frames.extend(rpl());
    frames.extend(join());
    frames.extend(data());
    frames.extend(announcements());
    frames.extend(blacklists());
    frames.extend(exchanges());
    frames
}

/// The root asks mote 1, which answers; mote 2 downloads 80 bytes in two blocks.
fn exchanges() -> impl Iterator<Item = FrameRepr> {
    let sent = |message: CoapRepr, datagram: Datagram| Datagram {
        upper: Upper::Udp(UdpRepr {
            source_port: 5683,
            destination_port: 5683,
            payload: message.to_vec().into(),
        }),
        ..datagram
    };
    let get =
        CoapRepr { message_id: 0x7d34, token: 5.into(), ..CoapRepr::request(Code::GET, "s0") };
    let content = CoapRepr { payload: vec![0; 16].into(), ..get.response(Code::CONTENT) };
    let asked = [
        unfragmented(0, Some(1), sent(get, Datagram { rpi: rpi(true, 256), ..udp(0, 1, 0) })),
        unfragmented(1, Some(0), sent(content, Datagram { rpi: rpi(false, 800), ..udp(1, 0, 0) })),
    ];
    let blocks = (0..2_u32).flat_map(move |number| {
        let get = CoapRepr {
            message_id: number as u16,
            token: (0x0100_0000 + number).into(),
            block2: Some(Block { number, more: false, szx: 1 }),
            ..CoapRepr::request(Code::GET, "f1")
        };
        let content = CoapRepr {
            block2: Some(Block { number, more: number == 0, szx: 1 }),
            size2: (number == 0).then_some(48),
            payload: vec![7; if number == 0 { 32 } else { 16 }].into(),
            ..get.response(Code::CONTENT)
        };
        let route = down(udp(0, 2, 0), &[2]);
        [
            unfragmented(1, Some(0), sent(get, Datagram { hop_limit: 63, ..up(udp(2, 0, 0)) })),
            unfragmented(1, Some(2), sent(content, Datagram { hop_limit: 63, ..route })),
        ]
    });
    asked.into_iter().chain(blocks)
}

/// A beacon, a frame with nothing else in it, and a datagram, each with what mote 2 knows of slots.
fn announcements() -> impl Iterator<Item = FrameRepr> {
    let mut taken = SlotSet::default();
    [0, 9, 57].into_iter().for_each(|slot| taken.insert(slot));
    let slots = SlotsRepr { n_slots: 58, taken, first: 1, tags: vec![1, 2, 3] };
    let said = data().into_iter().find(|frame| frame.destination.is_none());
    let said = said.map_or(Content::KeepAlive, |frame| frame.content);
    [Content::Beacon(beacon()), Content::KeepAlive, said].into_iter().map(move |content| {
        FrameRepr { slots: Some(Box::new(slots.clone())), ..frame(2, None, content) }
    })
}

/// A frame with nothing else in it, a 6P message and a datagram, each with the channels that its link skips.
fn blacklists() -> impl Iterator<Item = FrameRepr> {
    let said = data().into_iter().find(|frame| frame.destination.is_some());
    let contents = sixp().take(1).map(Content::Sixp).chain(said.map(|frame| frame.content));
    [Content::KeepAlive]
        .into_iter()
        .chain(contents)
        .map(|content| FrameRepr { blacklist: Some(0x0ff3), ..frame(2, Some(0), content) })
}

fn frame(from: u32, to: Option<u32>, content: Content) -> FrameRepr {
    FrameRepr {
        source: Eui64::of_mote(MoteId(from)),
        destination: to.map(MoteId).map(Eui64::of_mote),
        sequence: 1,
        ack_request: to.is_some(),
        pending: false,
        security: FrameSecurity::Unsecured,
        slots: None,
        blacklist: None,
        content,
    }
}

fn unfragmented(from: u32, to: Option<u32>, datagram: Datagram) -> FrameRepr {
    frame(from, to, Content::Lowpan(LowpanRepr::Whole(Arc::new(datagram))))
}

fn beacon() -> BeaconRepr {
    let slotframe = BeaconSlotframe { handle: 0, slots: 101, links: vec![(0, 0, 0b1111)] };
    BeaconRepr {
        asn: Asn::FIRST,
        join_metric: 0,
        timeslot_id: 0,
        hopping_sequence_id: 0,
        slotframes: vec![slotframe],
    }
}

/// Every request, an answer to each, a confirmation.
fn sixp() -> impl Iterator<Item = SixpRepr> {
    let options = CellOptions(1);
    let cells = |slots: std::ops::Range<u16>| -> Vec<SixpCell> {
        slots.map(|slot| SixpCell { slot, channel: 3 }).collect()
    };
    let wanted = CellRequest { metadata: 2, options, num_cells: 2, cells: cells(10..15) };
    let (relocation, candidates) = (cells(10..12), cells(20..25));
    let (metadata, payload) = (2, vec![1, 2, 3]);
    let requests = [
        SixpRequest::Add(wanted.clone()),
        SixpRequest::Delete(wanted),
        SixpRequest::Relocate { metadata, options, num_cells: 2, relocation, candidates },
        SixpRequest::Count { metadata, options },
        SixpRequest::List { metadata, options, offset: 0, max_num_cells: 10 },
        SixpRequest::Signal { metadata, payload: payload.clone() },
        SixpRequest::Clear { metadata },
    ];
    let answers = [
        AnswerContent::Cells(cells(10..12)),
        AnswerContent::Cells(cells(10..12)),
        AnswerContent::Cells(cells(20..22)),
        AnswerContent::Count(4),
        AnswerContent::Cells(cells(10..14)),
        AnswerContent::Payload(payload),
        AnswerContent::Nothing,
    ];
    let answer = |content| SixpAnswer { code: ReturnCode::Success, content };
    let message = |seqnum, body| SixpRepr { version: 0, sfid: 0, seqnum, body };
    let mut messages = Vec::new();
    for (seqnum, (request, content)) in (1..).zip(requests.into_iter().zip(answers)) {
        messages.push(message(seqnum, SixpBody::Request(request)));
        messages.push(message(seqnum, SixpBody::Response(answer(content))));
    }
    let confirmation = answer(AnswerContent::Cells(cells(10..11)));
    messages.push(message(8, SixpBody::Confirmation(confirmation)));
    messages.into_iter()
}

fn rpl() -> [FrameRepr; 5] {
    let root = Eui64::of_mote(MoteId(0)).global();
    let configuration = DodagConfiguration {
        dio_interval_doublings: 9,
        dio_interval_min: 14,
        dio_redundancy: 3,
        max_rank_increase: 1792,
        min_hop_rank_increase: 256,
        objective: 0,
        default_lifetime: 30,
        lifetime_unit_s: 60,
    };
    let dio = DioRepr {
        instance: 0,
        version: 240,
        rank: 256,
        grounded: true,
        mode: 1,
        preference: 0,
        dtsn: 240,
        dodag_id: root,
        configuration: Some(configuration),
        prefix: Some(address::GLOBAL_PREFIX),
    };
    let dao = DaoRepr {
        instance: 0,
        ack_request: true,
        sequence: 240,
        targets: vec![Eui64::of_mote(MoteId(2)).global()],
        path_sequence: 240,
        path_lifetime: 30,
        parent: Some(Eui64::of_mote(MoteId(1)).global()),
    };
    let ack = RplMessage::DaoAck(DaoAckRepr { instance: 0, sequence: 240, status: 0 });
    let on_link = |mote: u32, to, message| Datagram {
        source: Eui64::of_mote(MoteId(mote)).link_local(),
        destination: to,
        upper: Upper::Rpl(message),
        hop_limit: 255,
        ..udp(mote, 0, 0)
    };
    let dao = Datagram { upper: Upper::Rpl(RplMessage::Dao(dao)), ..up(udp(2, 0, 0)) };
    let ack = Datagram { upper: Upper::Rpl(ack), ..down(udp(0, 2, 0), &[1, 2]) };
    let all = address::ALL_RPL_NODES;
    [
        unfragmented(1, None, on_link(1, all, RplMessage::Dis(DisRepr {}))),
        unfragmented(0, None, on_link(0, all, RplMessage::Dio(dio.clone()))),
        unfragmented(
            0,
            Some(1),
            on_link(0, Eui64::of_mote(MoteId(1)).link_local(), RplMessage::Dio(dio)),
        ),
        unfragmented(2, Some(1), dao),
        unfragmented(0, Some(1), ack),
    ]
}

/// A pledge's request through a proxy, and the answer.
fn join() -> [FrameRepr; 4] {
    let pledge = Eui64::of_mote(MoteId(3));
    let request = |proxy_state| CojpRepr::Request {
        message_id: 1,
        pledge,
        proxy_state,
        network_id: NETWORK_PAN,
    };
    let response = |proxy_state| CojpRepr::Response {
        message_id: 1,
        pledge,
        proxy_state,
        key_index: 1,
        keys: None,
        join_rate_bytes_s: None,
    };
    let coap = |message: CojpRepr, datagram: Datagram| Datagram {
        upper: Upper::Udp(UdpRepr {
            source_port: 5683,
            destination_port: 5683,
            payload: message.to_vec().into(),
        }),
        ..datagram
    };
    let marked = |dscp, datagram: Datagram| Datagram { dscp, ..datagram };
    let local = |from, to| Datagram {
        source: Eui64::of_mote(from).link_local(),
        destination: Eui64::of_mote(to).link_local(),
        ..udp(from.0, to.0, 0)
    };
    [
        unfragmented(3, Some(2), coap(request(None), local(MoteId(3), MoteId(2)))),
        unfragmented(
            2,
            Some(1),
            marked(code_points::AF43, coap(request(Some(pledge)), up(udp(2, 0, 0)))),
        ),
        unfragmented(
            1,
            Some(2),
            marked(code_points::AF42, coap(response(Some(pledge)), down(udp(0, 2, 0), &[2]))),
        ),
        unfragmented(2, Some(3), coap(response(None), local(MoteId(2), MoteId(3)))),
    ]
}

/// To the neighbour, up, down by source route, from mote to mote by the root, to everyone; in fragments.
fn data() -> Vec<FrameRepr> {
    let everyone = Datagram {
        source: Eui64::of_mote(MoteId(1)).link_local(),
        destination: address::ALL_NODES,
        hop_limit: 1,
        ..udp(1, 0, 20)
    };
    let across = Datagram { hop_limit: 62, ..down(udp(1, 3, 20), &[1, 2, 3]) };
    let mut frames = vec![
        unfragmented(1, Some(0), udp(1, 0, 20)),
        unfragmented(1, Some(0), Datagram { hop_limit: 63, ..up(udp(2, 0, 20)) }),
        unfragmented(0, Some(1), down(udp(0, 3, 20), &[1, 2, 3])),
        unfragmented(0, Some(1), across),
        unfragmented(1, None, everyone),
    ];
    for datagram in [udp(1, 0, 200), up(udp(2, 0, 200))] {
        let room = payload_room(Some(Eui64::of_mote(MoteId(0))), FrameSecurity::Unsecured);
        let tag = datagram.rpi.map_or(1, |_| 2);
        let fragments = Arc::new(datagram).fragment(tag, room).unwrap_or_default();
        for fragment in fragments {
            let part = if fragment.offset == 0 { LowpanRepr::First } else { LowpanRepr::Next };
            frames.push(frame(1, Some(0), Content::Lowpan(part(fragment))));
        }
    }
    frames
}

fn udp(from: u32, to: u32, payload: usize) -> Datagram {
    Datagram {
        packet: 0,
        source: Eui64::of_mote(MoteId(from)).global(),
        destination: Eui64::of_mote(MoteId(to)).global(),
        dscp: 0,
        hop_limit: 64,
        rpi: None,
        route: None,
        upper: Upper::Udp(UdpRepr {
            source_port: 61_617,
            destination_port: 61_617,
            payload: vec![0x55; payload].into(),
        }),
    }
}

fn rpi(down: bool, sender_rank: u16) -> Option<RpiRepr> {
    Some(RpiRepr { down, rank_error: false, forwarding_error: false, instance: 0, sender_rank })
}

fn up(datagram: Datagram) -> Datagram {
    Datagram { rpi: rpi(false, 1300), ..datagram }
}

fn down(datagram: Datagram, hops: &[u32]) -> Datagram {
    let hops = hops.iter().map(|&mote| Eui64::of_mote(MoteId(mote)).global()).collect();
    let root = Eui64::of_mote(MoteId(0)).global();
    let tunnel_hop_limit = (datagram.source != root).then_some(64);
    let route = Some(SourceRoute { root, hops, tunnel_hop_limit });
    Datagram { rpi: rpi(true, 256), route, ..datagram }
}
