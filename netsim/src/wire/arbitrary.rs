//! Any message of every kind, for property tests.

use super::Eui64;
use super::coap::{Block, CoapRepr, Code, Token, Type};
use super::cojp::CojpRepr;
use super::datagram::{Datagram, RpiRepr, SourceRoute, UdpRepr, Upper};
use super::fragment::LowpanRepr;
use super::frame::{AckRepr, BeaconRepr, BeaconSlotframe, Content, FrameRepr};
use super::rpl::{DaoAckRepr, DaoRepr, DioRepr, DisRepr, DodagConfiguration, RplMessage};
use super::security::{FrameSecurity, Keys};
use super::sixp::{
    AnswerContent, CellOptions, CellRequest, ReturnCode, SixpAnswer, SixpBody, SixpCell, SixpRepr,
    SixpRequest,
};
use super::slots::{SlotSet, SlotsRepr};
use physics::asn::Asn;
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use proto::ids::MoteId;
use std::net::Ipv6Addr;
use std::sync::Arc;

/// Motes' addresses, addresses that IPHC makes of short ones, and any.
pub(crate) fn eui64() -> impl Strategy<Value = Eui64> {
    prop_oneof![
        4 => (0_u32..70_000).prop_map(|mote| Eui64::of_mote(MoteId(mote))),
        1 => any::<u16>().prop_map(|short| Eui64(0x0200_00ff_fe00_0000 | u64::from(short))),
        1 => any::<u64>().prop_map(Eui64),
    ]
}

fn unicast() -> impl Strategy<Value = Ipv6Addr> {
    prop_oneof![
        3 => eui64().prop_map(Eui64::global),
        2 => eui64().prop_map(Eui64::link_local),
        1 => any::<u128>()
            .prop_map(Ipv6Addr::from_bits)
            .prop_filter("unicast", |address| !address.is_multicast()),
    ]
}

fn multicast() -> impl Strategy<Value = Ipv6Addr> {
    let bits = |kept: u128| {
        any::<u128>().prop_map(move |bits| Ipv6Addr::from_bits(0xff << 120 | bits & kept))
    };
    prop_oneof![
        any::<u8>().prop_map(|low| Ipv6Addr::from_bits(0xff02 << 112 | u128::from(low))),
        bits(0xff << 112 | 0xff_ffff),
        bits(0xff << 112 | 0xff_ffff_ffff),
        bits(u128::MAX),
    ]
}

fn cells() -> impl Strategy<Value = Vec<SixpCell>> {
    vec((any::<u16>(), any::<u16>()), 0..6).prop_map(|cells| {
        cells.into_iter().map(|(slot, channel)| SixpCell { slot, channel }).collect()
    })
}

fn cell_request() -> impl Strategy<Value = CellRequest> {
    (any::<u16>(), any::<u8>(), any::<u8>(), cells()).prop_map(
        |(metadata, options, num_cells, cells)| CellRequest {
            metadata,
            options: CellOptions(options),
            num_cells,
            cells,
        },
    )
}

fn request() -> impl Strategy<Value = SixpRequest> {
    prop_oneof![
        cell_request().prop_map(SixpRequest::Add),
        cell_request().prop_map(SixpRequest::Delete),
        (any::<u16>(), any::<u8>(), cells(), cells()).prop_map(
            |(metadata, options, relocation, candidates)| SixpRequest::Relocate {
                metadata,
                options: CellOptions(options),
                num_cells: relocation.len() as u8,
                relocation,
                candidates,
            }
        ),
        (any::<u16>(), any::<u8>()).prop_map(|(metadata, options)| SixpRequest::Count {
            metadata,
            options: CellOptions(options)
        }),
        any::<(u16, u8, u16, u16)>().prop_map(|(metadata, options, offset, max_num_cells)| {
            SixpRequest::List { metadata, options: CellOptions(options), offset, max_num_cells }
        }),
        any::<u16>().prop_map(|metadata| SixpRequest::Clear { metadata }),
        (any::<u16>(), vec(any::<u8>(), 0..9))
            .prop_map(|(metadata, payload)| SixpRequest::Signal { metadata, payload }),
    ]
}

/// Answers whose content shows by its length.
fn answer() -> impl Strategy<Value = SixpAnswer> {
    let content = prop_oneof![
        Just(AnswerContent::Nothing),
        cells().prop_filter("a cell", |cells| !cells.is_empty()).prop_map(AnswerContent::Cells),
        any::<u16>().prop_map(AnswerContent::Count),
        vec(any::<u8>(), 0..3).prop_map(|mut payload| {
            payload.push(1);
            payload.resize(payload.len() / 2 * 2 + 1, 7);
            AnswerContent::Payload(payload)
        }),
    ];
    (0_u8..10, content).prop_map(|(code, content)| SixpAnswer {
        code: ReturnCode::from_number(code).expect("there are ten"),
        content,
    })
}

pub(crate) fn sixp() -> impl Strategy<Value = SixpRepr> {
    let body = prop_oneof![
        request().prop_map(SixpBody::Request),
        answer().prop_map(SixpBody::Response),
        answer().prop_map(SixpBody::Confirmation),
    ];
    (0_u8..16, any::<u8>(), any::<u8>(), body).prop_map(|(version, sfid, seqnum, body)| SixpRepr {
        version,
        sfid,
        seqnum,
        body,
    })
}

fn configuration() -> impl Strategy<Value = DodagConfiguration> {
    any::<(u8, u8, u8, u16, u16, u16, u8, u16)>().prop_map(|(a, b, c, d, e, f, g, h)| {
        DodagConfiguration {
            dio_interval_doublings: a,
            dio_interval_min: b,
            dio_redundancy: c,
            max_rank_increase: d,
            min_hop_rank_increase: e,
            objective: f,
            default_lifetime: g,
            lifetime_unit_s: h,
        }
    })
}

pub(crate) fn rpl() -> impl Strategy<Value = RplMessage> {
    let flags = (any::<bool>(), 0_u8..8, 0_u8..8);
    let options = (option::of(configuration()), option::of(any::<u64>()));
    let dio = (any::<(u8, u8, u16, u8)>(), flags, unicast(), options);
    let targets = vec(unicast(), 0..4);
    let dao = (any::<(u8, bool, u8, u8, u8)>(), targets, option::of(unicast()));
    prop_oneof![
        Just(RplMessage::Dis(DisRepr {})),
        dio.prop_map(|(base, flags, dodag_id, (configuration, prefix))| {
            RplMessage::Dio(DioRepr {
                instance: base.0,
                version: base.1,
                rank: base.2,
                grounded: flags.0,
                mode: flags.1,
                preference: flags.2,
                dtsn: base.3,
                dodag_id,
                configuration,
                prefix,
            })
        }),
        dao.prop_map(|(base, targets, parent)| {
            RplMessage::Dao(DaoRepr {
                instance: base.0,
                ack_request: base.1,
                sequence: base.2,
                targets,
                path_sequence: base.3,
                path_lifetime: base.4,
                parent,
            })
        }),
        any::<(u8, u8, u8)>().prop_map(|(instance, sequence, status)| {
            RplMessage::DaoAck(DaoAckRepr { instance, sequence, status })
        }),
    ]
}

pub(crate) fn cojp() -> impl Strategy<Value = CojpRepr> {
    let rate = option::of((any::<u32>(), 0..32).prop_map(|(rate, shift)| rate >> shift));
    let keys = option::of(any::<([u8; 16], [u8; 16])>());
    (any::<(bool, bool)>(), any::<(u16, u16, u8)>(), eui64(), (rate, keys)).prop_map(
        |((is_request, is_proxied), (message_id, network_id, key_index), pledge, (rate, keys))| {
            let pledge = Eui64(pledge.0 & !(1 << 56));
            let proxy_state = is_proxied.then_some(pledge);
            if is_request {
                CojpRepr::Request { message_id, pledge, proxy_state, network_id }
            } else {
                CojpRepr::Response {
                    message_id,
                    pledge,
                    proxy_state,
                    key_index: if keys.is_some() { 1 } else { key_index },
                    keys: keys.map(|(k1, k2)| Keys { k1, k2 }),
                    join_rate_bytes_s: rate,
                }
            }
        },
    )
}

pub(crate) fn protected_cojp() -> impl Strategy<Value = CojpRepr> {
    let sequence = (any::<u32>(), 0..32).prop_map(|(sequence, shift)| sequence >> shift);
    (any::<(bool, bool, u16)>(), eui64(), sequence, vec(any::<u8>(), 0..64)).prop_map(
        |((is_request, is_proxied, message_id), pledge, sequence, ciphertext)| {
            let pledge = Eui64(pledge.0 & !(1 << 56));
            let proxy_state = is_proxied.then_some(pledge);
            if is_request {
                CojpRepr::ProtectedRequest { message_id, pledge, sequence, proxy_state, ciphertext }
            } else {
                CojpRepr::ProtectedResponse { message_id, proxy_state, ciphertext }
            }
        },
    )
}

fn udp(payload: usize) -> impl Strategy<Value = UdpRepr> {
    let port = || prop_oneof![0xf0b0_u16..=0xf0bf, 0xf000_u16..=0xf0ff, any::<u16>()];
    (port(), port(), vec(any::<u8>(), 0..=payload)).prop_map(
        |(source_port, destination_port, payload)| UdpRepr {
            source_port,
            destination_port,
            payload: payload.into(),
        },
    )
}

fn rpi() -> impl Strategy<Value = RpiRepr> {
    (any::<(bool, bool, bool)>(), prop_oneof![Just(0), any::<u8>()], any::<u16>(), any::<bool>())
        .prop_map(|(flags, instance, rank, whole)| RpiRepr {
            down: flags.0,
            rank_error: flags.1,
            forwarding_error: flags.2,
            instance,
            sender_rank: if whole { rank & 0xff00 } else { rank },
        })
}

/// A datagram, and the hop that it is on. Its route is the root's own or encapsulates.
pub(crate) fn datagram(payload: usize) -> impl Strategy<Value = (Datagram, Eui64, Option<Eui64>)> {
    let upper = prop_oneof![rpl().prop_map(Upper::Rpl), udp(payload).prop_map(Upper::Udp)];
    let ends = (
        prop_oneof![9 => unicast(), 1 => Just(Ipv6Addr::UNSPECIFIED)],
        prop_oneof![3 => unicast(), 1 => multicast()],
    );
    let limit = prop_oneof![Just(1), Just(64), Just(255), any::<u8>()];
    let tunnel = option::of((unicast(), any::<u8>()));
    let headers = (option::of(rpi()), option::of((vec(unicast(), 1..40), tunnel)));
    let hop = (eui64(), option::of(eui64()), any::<(bool, bool)>());
    let dscp = prop_oneof![Just(0_u8), 0_u8..64];
    (ends, (limit, dscp), headers, upper, hop).prop_map(
        |((source, destination), (hop_limit, dscp), (rpi, route), upper, hop)| {
            let (hop_source, hop_destination, derived) = hop;
            let source = if derived.0 { hop_source.global() } else { source };
            let destination = match hop_destination {
                Some(hop) if derived.1 => hop.link_local(),
                _ => destination,
            };
            let route = route.map(|(hops, tunnel)| SourceRoute {
                root: tunnel.map_or(source, |(root, _)| root),
                hops,
                tunnel_hop_limit: tunnel.map(|(_, hop_limit)| hop_limit),
            });
            let packet = 0;
            let datagram =
                Datagram { packet, source, destination, dscp, hop_limit, rpi, route, upper };
            (datagram, hop_source, hop_destination)
        },
    )
}

fn slots() -> impl Strategy<Value = SlotsRepr> {
    (1_u16..=256, vec(any::<u16>(), 0..9), any::<u8>(), vec(any::<u8>(), 0..9)).prop_map(
        |(n_slots, slots, first, tags)| {
            let mut taken = SlotSet::default();
            slots.iter().for_each(|slot| taken.insert(slot % n_slots));
            SlotsRepr { n_slots, taken, first, tags }
        },
    )
}

fn slotframe() -> impl Strategy<Value = BeaconSlotframe> {
    (any::<u8>(), any::<u16>(), vec(any::<(u16, u16, u8)>(), 0..4))
        .prop_map(|(handle, slots, links)| BeaconSlotframe { handle, slots, links })
}

/// A frame that is whole, and the root that its content may refer to.
pub(crate) fn frame() -> impl Strategy<Value = (FrameRepr, Option<Ipv6Addr>)> {
    let ids = (any::<u8>(), any::<u8>());
    let beacon = (0_u64..1 << 40, any::<u8>(), ids, vec(slotframe(), 0..4)).prop_map(
        |(asn, join_metric, (timeslot_id, hopping_sequence_id), slotframes)| {
            Content::Beacon(BeaconRepr {
                asn: Asn(asn),
                join_metric,
                timeslot_id,
                hopping_sequence_id,
                slotframes,
            })
        },
    );
    let link = prop_oneof![
        (beacon, eui64(), option::of(eui64())).prop_map(|(c, s, d)| (c, s, d, None)).boxed(),
        (sixp(), eui64(), option::of(eui64()))
            .prop_map(|(c, s, d)| (Content::Sixp(c), s, d, None))
            .boxed(),
        (eui64(), option::of(eui64())).prop_map(|(s, d)| (Content::KeepAlive, s, d, None)).boxed(),
        datagram(80)
            .prop_map(|(datagram, source, destination)| {
                let root = datagram.route.as_ref().map(|route| route.root);
                let content = Content::Lowpan(LowpanRepr::Whole(Arc::new(datagram)));
                (content, source, destination, root)
            })
            .boxed(),
    ];
    (link, any::<(u8, bool, bool, Option<u16>)>(), option::of(slots())).prop_map(
        |(
            (content, source, destination, root),
            (sequence, ack_request, pending, blacklist),
            slots,
        )| {
            let slots = slots.map(Box::new);
            let security = FrameSecurity::Unsecured;
            let frame = FrameRepr {
                source,
                destination,
                sequence,
                ack_request,
                pending,
                security,
                slots,
                blacklist,
                content,
            };
            (frame, root)
        },
    )
}

pub(crate) fn ack() -> impl Strategy<Value = AckRepr> {
    (eui64(), any::<u8>(), -2048_i16..2048).prop_map(|(destination, sequence, correction)| {
        let security = FrameSecurity::Unsecured;
        AckRepr { destination, sequence, time_correction_us: correction, security }
    })
}

pub(crate) fn coap() -> impl Strategy<Value = CoapRepr> {
    let kind = prop_oneof![Just(Type::Confirmable), Just(Type::Acknowledgment)];
    let path = "[a-zé0-9/]{0,30}";
    let token = vec(any::<u8>(), 0..=8).prop_map(|bytes| Token::new(&bytes).unwrap_or_default());
    let block = (0_u32..1 << 20, any::<bool>(), 0_u8..7).prop_map(|(number, more, szx)| Block {
        number,
        more,
        szx,
    });
    let options = (option::of(path), option::of(block), option::of(any::<u32>()));
    (kind, any::<(u8, u16)>(), token, options, vec(any::<u8>(), 0..40)).prop_map(
        |(kind, (code, message_id), token, (path, block2, size2), payload)| CoapRepr {
            kind,
            code: Code(code),
            message_id,
            token,
            path,
            block2,
            size2,
            payload: payload.into(),
        },
    )
}
