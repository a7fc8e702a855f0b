//! M2, M4 to M6, M8, M11, M12: the minimal scheduling function in whole networks.

use super::bench::{
    Bench, EAGER, FULL, LINE, NO_KEEP_ALIVES, SLOT_NS, What, line, settings, trace,
};
use netsim::app::packets::Packets;
use netsim::mac::tsch::Done;
use netsim::mac::{CellOptions, CellRef};
use netsim::mote::up::Arrived;
use netsim::mote::{Mote, World};
use netsim::sf::msf::Msf;
use netsim::sf::msf::hash::autonomous_cell;
use netsim::sf::msf::{AUTONOMOUS, NEGOTIATED, SFID};
use netsim::wire::Eui64;
use netsim::wire::datagram::{Datagram, UdpRepr, Upper, code_points};
use netsim::wire::fragment::LowpanRepr;
use netsim::wire::frame::{Content, FrameRepr};
use netsim::wire::security::FrameSecurity;
use netsim::wire::sixp::{AnswerContent, ReturnCode, SixpAnswer, SixpBody, SixpRepr, SixpRequest};
use physics::asn::Asn;
use proto::ids::MoteId;
use proto::time::SimDuration;
use proto::types::MoteOrder;

const MSF: &str = "[sf]\nkind = \"msf\"\n";
/// Use is judged after ten cells, as the vectors have it.
const HASTY: &str = "max_num_cells = 10\nlim_numcellsused_high = 7\nlim_numcellsused_low = 2\n";

/// Negotiated cells of a mote with a neighbour: to transmit, to receive.
fn negotiated(bench: &Bench, mote: usize, peer: u32) -> (usize, usize) {
    let with = |at: &CellRef| at.cell.neighbour == Some(Eui64::of_mote(MoteId(peer)));
    let cells: Vec<CellRef> = bench.cells(mote, NEGOTIATED).into_iter().filter(with).collect();
    let n = |options| cells.iter().filter(|at| at.cell.options == options).count();
    (n(CellOptions::TX), n(CellOptions::RX))
}

/// The commands of the requests that a mote sent, each once, with their receivers.
fn requests(bench: &Bench, mote: u32) -> Vec<(&'static str, u32)> {
    let mut last = None;
    let mut requests = Vec::new();
    for frame in bench.sent(mote, |what| matches!(what, What::Sixp(_))) {
        let What::Sixp(message) = &frame.what else { continue };
        let SixpBody::Request(request) = &message.body else { continue };
        let name = match request {
            SixpRequest::Add(_) => "ADD",
            SixpRequest::Delete(_) => "DELETE",
            SixpRequest::Relocate { .. } => "RELOCATE",
            SixpRequest::Clear { .. } => "CLEAR",
            SixpRequest::Count { .. } | SixpRequest::List { .. } | SixpRequest::Signal { .. } => {
                "?"
            }
        };
        // An attempt more is the same frame again.
        if last != Some((frame.destination, frame.sequence)) {
            requests.push((name, frame.destination.expect("6P is between neighbours")));
        }
        last = Some((frame.destination, frame.sequence));
    }
    requests
}

/// Both ends of all negotiated cells of two motes say the same.
fn assert_agreement(bench: &Bench, one: usize, other: usize) {
    let places = |mote: usize, peer: usize, options| {
        let cells = bench.cells(mote, NEGOTIATED).into_iter().map(|at| at.cell);
        let peer = Some(Eui64::of_mote(MoteId(peer as u32)));
        let of = cells.filter(|cell| cell.neighbour == peer && cell.options == options);
        of.map(|cell| (cell.slot, cell.channel)).collect::<Vec<_>>()
    };
    for (a, b) in [(one, other), (other, one)] {
        assert_eq!(places(a, b, CellOptions::TX), places(b, a, CellOptions::RX), "{a} to {b}");
    }
}

/// A packet a slotframe from `from` to `to`.
fn traffic(bench: &mut Bench, from: u32, to: u32, n_slotframes: usize) {
    for _ in 0..n_slotframes {
        bench.send(from, to, 10);
        bench.run(101);
    }
}

#[test]
fn m2_the_root_listens_in_its_autonomous_cell_from_the_start_and_others_once_they_keep_time() {
    let mut bench = Bench::new(&line(2), &format!("{FULL}{EAGER}{MSF}"));
    let listens = |bench: &Bench, mote: usize| -> Vec<(u16, u16)> {
        let rx = |at: &CellRef| at.cell.options == CellOptions::RX;
        bench
            .cells(mote, AUTONOMOUS)
            .into_iter()
            .filter(rx)
            .map(|at| (at.cell.slot, at.cell.channel))
            .collect()
    };
    bench.run(1);
    let expected = [0, 1].map(|mote| autonomous_cell(Eui64::of_mote(MoteId(mote)), 101, 16));
    assert_eq!(listens(&bench, 0), [expected[0]]);
    while bench.mote(1).mac.is_scanning() {
        assert!(bench.mote(1).schedule.slotframes().is_empty());
        bench.run(1);
    }
    assert_eq!(listens(&bench, 1), [expected[1]]);
}

#[test]
fn m4_a_packet_per_slotframe_gets_a_second_cell_and_loses_it_afterwards() {
    let config = format!("{FULL}{EAGER}{NO_KEEP_ALIVES}{MSF}{HASTY}");
    let mut bench = Bench::new(&line(2), &config);
    bench.form();
    bench.run(101 * 20);
    assert_eq!(negotiated(&bench, 1, 0), (1, 0));
    // At most ten slotframes until use begins to be judged anew, ten that are judged, and two for ADD and its response.
    traffic(&mut bench, 1, 0, 22);
    assert_eq!(negotiated(&bench, 1, 0), (2, 0), "{:?}", requests(&bench, 1));
    assert_agreement(&bench, 1, 0);
    bench.run(101 * 60);
    assert_eq!(negotiated(&bench, 1, 0), (1, 0));
    assert_agreement(&bench, 1, 0);
    assert_eq!(requests(&bench, 1), [("ADD", 0), ("ADD", 0), ("DELETE", 0)]);
}

#[test]
fn m5_a_new_parent_is_asked_for_cells_and_the_old_one_told_to_clear_them() {
    // A line on which three of ten frames up are lost: hops of 512. From 6000 s on its end has a perfect link to the root,
    // and is better off with it even before that is measured.
    let mut rows = Vec::new();
    for near in 0..6 {
        rows.extend([(0, near, near + 1, 1.0), (0, near + 1, near, 0.7)]);
    }
    // The row that repeats another ends the head of the trace, which holds from the beginning.
    rows.extend([(6000, 0, 1, 1.0), (6000, 0, 6, 1.0), (6000, 6, 0, 1.0)]);
    let rpl = "[rpl]\ndio_interval_doublings = 1\n";
    let app = "[[app]]\nkind = \"periodic\"\nperiod_s = 10.0\nsenders = [6]\n";
    let mut bench = Bench::over_trace(7, trace(7, &rows), &format!("{EAGER}{rpl}{MSF}{app}"));
    bench.form();
    let is_settled = |bench: &Bench| bench.parent(6) == Some(5) && 1 <= negotiated(bench, 6, 5).0;
    assert!(bench.asn < Asn(500_000));
    bench.run_to(Asn(500_000));
    bench.run_until(101, 99_000, is_settled);
    bench.run_to(Asn(599_900));
    assert!(is_settled(&bench));
    let before = negotiated(&bench, 6, 5);
    bench.frames.clear();
    bench.run_until(101, 50_000, |bench| bench.parent(6) == Some(0));
    bench.run_until(101, 5_000, |bench| {
        let old = [negotiated(bench, 6, 5), negotiated(bench, 5, 6)];
        before.0 <= negotiated(bench, 6, 0).0 && old == [(0, 0); 2]
    });
    let asked = requests(&bench, 6);
    let add = asked.iter().position(|asked| *asked == ("ADD", 0)).unwrap();
    let clear = asked.iter().position(|asked| *asked == ("CLEAR", 5)).unwrap();
    assert!(add < clear, "RFC 9033, 5.2: cells with the new parent come first: {asked:?}");
    assert_agreement(&bench, 6, 0);
}

#[test]
fn m6_a_schedule_without_a_free_slot_is_noticed_and_nothing_is_asked() {
    // Slot 0 is the minimal cell's, the other one both autonomous cells'.
    let config = format!("{FULL}{EAGER}{MSF}slotframe_slots = 2\n");
    let mut bench = Bench::new(&line(2), &config);
    bench.run_until(101, 100_000, |bench| bench.parent(1).is_some());
    // Before the wait of 30 to 60 s is over.
    bench.run(2_900);
    let msf = bench.mote(1).sf.as_kind::<Msf>().expect("MSF was configured");
    assert_eq!(msf.n_full(), 1);
    assert_eq!(requests(&bench, 1), []);
    assert!(!bench.mote(1).ready);
}

#[test]
fn m8_a_parent_that_is_dead_is_given_up_and_its_cells_go() {
    let app = "[[app]]\nkind = \"periodic\"\nperiod_s = 5.0\n";
    // Nobody loses synchronisation: only use of the link can tell.
    let mut bench = Bench::new(&line(3), &format!("{LINE}{EAGER}{NO_KEEP_ALIVES}{MSF}{app}"));
    bench.form();
    bench.run(5_000);
    assert_eq!(bench.parent(1), Some(0));
    assert_ne!(negotiated(&bench, 1, 0), (0, 0));
    bench.order(MoteOrder::Kill(0));
    bench.run_until(101, 50_000, |bench| bench.parent(1).is_none());
    bench.run_until(101, 100_000, |bench| negotiated(bench, 1, 0) == (0, 0));
    assert!(!bench.mote(1).ready);
}

#[test]
fn m11_traffic_down_gets_cells_to_receive_and_loses_them_again() {
    let config = format!("{FULL}{EAGER}{NO_KEEP_ALIVES}{MSF}");
    let mut bench = Bench::new(&line(2), &config);
    bench.form();
    bench.run_until(101, 20_000, |bench| bench.mote(0).rpl.routes().len() == 1);
    let end_asn = bench.asn + 50_000;
    while bench.asn < end_asn {
        traffic(&mut bench, 0, 1, 1);
    }
    assert_eq!(negotiated(&bench, 1, 0), (1, 2));
    assert_agreement(&bench, 1, 0);
    bench.run(50_000);
    assert_eq!(negotiated(&bench, 1, 0), (1, 0));
    assert_agreement(&bench, 1, 0);
}

#[test]
fn m12_who_keeps_time_and_must_be_admitted_has_a_cell_to_its_proxy() {
    let root = Eui64::of_mote(MoteId(0));
    let expected = autonomous_cell(root, 101, 16);
    for secure in [true, false] {
        let join = format!("[join]\nsecure = {secure}\n[rpl]\nsolicitation = \"off\"\n");
        let mut bench = Bench::new(&line(2), &format!("{FULL}{EAGER}{join}{MSF}"));
        bench.run_until(1, 100_000, |bench| bench.mote(1).mac.is_synced());
        let cells = bench.cells(1, AUTONOMOUS).into_iter().map(|at| at.cell);
        let tx: Vec<_> = cells.filter(|cell| cell.options.tx).collect();
        assert_eq!(tx.len(), usize::from(secure));
        if let [cell] = tx[..] {
            assert_eq!((cell.slot, cell.channel), expected);
            assert_eq!((cell.options, cell.neighbour), (CellOptions::TX_SHARED, Some(root)));
            assert_ne!(cell.slot, 0);
        }
    }
}

/// A mote taken out of its network, to be given frames of its root by hand.
struct Lone<'a> {
    bench: &'a Bench,
    config: &'a str,
    mote: Mote,
    asn: Asn,
    sequence: u8,
}

impl Lone<'_> {
    /// Lets the mote do something in its present slot.
    fn does<T>(&mut self, act: impl FnOnce(&mut Mote, &mut World<'_>) -> T) -> T {
        let settings = settings(self.config);
        let mut world = World {
            settings: &settings,
            addresses: self.bench.mesh.addresses(),
            packets: &mut Packets::default(),
            seed: 1,
            asn: self.asn,
            now: self.asn * SimDuration::from_ns(SLOT_NS),
            received: self.asn * SimDuration::from_ns(SLOT_NS),
            effective_asn: self.asn,
            readiness_changed: &mut false,
            swarm: &mut Vec::new(),
        };
        act(&mut self.mote, &mut world)
    }

    /// The root sends it something, in a cell that is none of its schedule's. Returns whether it is acknowledged, and whether
    /// it goes up.
    fn hears(&mut self, content: Content) -> (bool, bool) {
        self.hears_at(None, content)
    }

    fn hears_at(&mut self, at: Option<CellRef>, content: Content) -> (bool, bool) {
        self.sequence = self.sequence.wrapping_add(1);
        let frame = FrameRepr {
            source: Eui64::of_mote(MoteId(0)),
            destination: Some(Eui64::of_mote(MoteId(1))),
            sequence: self.sequence,
            ack_request: true,
            pending: false,
            security: FrameSecurity::Unsecured,
            slots: None,
            blacklist: None,
            content,
        };
        self.does(|mote, world| {
            let arrived =
                Arrived { frame: &frame, at, channel: 11, source_ns: 0, rssi_dbm: f64::NAN };
            let verdict = mote.handle_frame(world, &arrived);
            mote.pump(world);
            (verdict.acknowledge, verdict.deliver)
        })
    }
}

#[test]
fn rfc9031_6_1_1_requests_that_proxies_forward_do_not_count_as_use_of_cells() {
    let config = format!("{FULL}{EAGER}{NO_KEEP_ALIVES}{MSF}");
    let mut bench = Bench::new(&line(2), &config);
    bench.form();
    let cell = |handle, options| {
        let of = bench.cells(1, handle).into_iter().find(|at| at.cell.options == options);
        of.expect("a cell to the root, and the mote's own")
    };
    let to_root = cell(NEGOTIATED, CellOptions::TX);
    let own = cell(AUTONOMOUS, CellOptions::RX);
    let mote = bench.mote(1).clone();
    let mut lone = Lone { bench: &bench, config: &config, mote, asn: bench.asn, sequence: 100 };
    let used = |lone: &Lone<'_>| {
        let msf = lone.mote.sf.as_kind::<Msf>().expect("MSF was configured");
        msf.cells_used()
    };
    let [tx, rx] = used(&lone);
    for (dscp, n) in [(code_points::AF43, 0), (code_points::AF42, 1), (0, 2)] {
        let upper = UdpRepr { source_port: 1, destination_port: 2, payload: vec![0; 8].into() };
        let datagram = Datagram {
            packet: 0,
            source: Eui64::of_mote(MoteId(0)).link_local(),
            destination: Eui64::of_mote(MoteId(1)).link_local(),
            dscp,
            hop_limit: 64,
            rpi: None,
            route: None,
            upper: Upper::Udp(upper),
        };
        let content = Content::Lowpan(LowpanRepr::Whole(datagram.into()));
        assert_eq!(content.dscp(), dscp);
        assert_eq!(lone.hears_at(Some(own), content), (true, true));
        lone.does(|mote, world| {
            let done = Done::Retry { destination: Eui64::of_mote(MoteId(0)), dscp };
            mote.handle_done(world, Some(to_root), done, false);
        });
        assert_eq!(used(&lone), [tx + n, rx + n], "{dscp}");
    }
}

#[test]
fn rfc9033_12_frames_of_a_neighbour_in_quarantine_are_dropped_for_as_long_as_it_lasts() {
    let config = format!("{FULL}{EAGER}{NO_KEEP_ALIVES}{MSF}");
    let mut bench = Bench::new(&line(2), &config);
    let root = Eui64::of_mote(MoteId(0));
    bench.run_until(1, 300_000, |bench| bench.mote(1).sixtop.is_busy(root));
    let mote = bench.mote(1).clone();
    let mut lone = Lone { bench: &bench, config: &config, mote, asn: bench.asn, sequence: 100 };
    assert_eq!(lone.hears(Content::KeepAlive), (true, true));

    let seqnum = lone.mote.sixtop.seqnum(root);
    let answer = SixpAnswer { code: ReturnCode::Error, content: AnswerContent::Nothing };
    let body = SixpBody::Response(answer);
    let refusal = Content::Sixp(SixpRepr { version: 0, sfid: SFID, seqnum, body });
    assert_eq!(lone.hears(refusal), (true, true));
    assert_eq!(lone.hears(Content::KeepAlive), (false, false));
    // Nor does routing think of it before.
    let known = lone.mote.rpl.neighbours().iter().find(|known| known.address == root).unwrap();
    assert_eq!(known.unusable_until, lone.mote.sf.quarantine_ends(root));
    assert!(known.unusable_until.is_some());

    // QUARANTINE_DURATION is five minutes.
    for (after_s, expected) in [(299, (false, false)), (2, (true, true))] {
        lone.asn += after_s * 100;
        lone.does(|mote, world| mote.handle_timeout(world));
        assert!(lone.mote.mac.is_synced());
        assert_eq!(lone.hears(Content::KeepAlive), expected, "{after_s} s later");
    }
}
