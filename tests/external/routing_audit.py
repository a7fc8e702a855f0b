"""An audit on the wire: datagrams of every scheduling function and mode, hop by hop, against 6LoWPAN's, RPL's and CoJP's RFCs."""

from collections import Counter, defaultdict

from audited_frames import DAO, DAO_ACK, DIO, DIS, expect_none, faults_of
from audited_networks import MOTES
from audited_ways import Parents, Ranks, journeys, routed

ROOT = 0
# After a network has formed, links still learn how good they are.
SETTLED_NS = 60_000_000_000


# Packet information.


def test_every_routed_datagram_has_packet_information(audited):
    # RFC 6550, section 11.2; RFC 9008, section 4.
    faults_of(audited, routed(audited), lambda frame: frame.goes_down is not None, lambda frame: "no RPI", 200)


def test_the_o_bit_is_set_on_the_way_down_and_clear_on_the_way_up(audited):
    # RFC 6550, section 11.2: 'O' is set if the packet is expected to progress down, which routers update.
    parents = Parents(audited, audited.network.storing)
    ways = [(frame, parents.way(frame)) for frame in routed(audited)]
    clear = [(frame, way) for frame, way in ways if way is not None and frame.goes_down is not None]
    # Motes that change parents are between two trees for a while; in a network that stands nobody does.
    assert len(clear) >= len(ways) * (1.0 if audited.network.stands else 0.8), f"{len(ways) - len(clear)} of {len(ways)}"
    faults = (
        audited.says(frame, f"goes {'down' if way else 'up'} from {frame.source} to {frame.destination}, O bit {frame.goes_down}")
        for frame, way in clear
        if frame.goes_down != way and not frame.forwarding_error
    )
    expect_none(faults, len(clear), 200)
    directions = Counter(way for _, way in clear)
    assert min(directions[True], directions[False]) > 50, directions


def test_a_network_that_stands_marks_no_rank_error_and_no_forwarding_error(audited):
    # RFC 6550, section 11.2.2.2 and 11.2.2.3. Ranks that a neighbour has not heard of yet are errors while a network forms.
    frames = routed(audited)
    marked = [frame for frame in frames if frame.rank_error or frame.forwarding_error]
    if audited.network.stands:
        formed = [frame for frame in frames if audited.formed_ns + SETTLED_NS < frame.time_ns]
        faults = (
            audited.says(frame, f"R {frame.rank_error}, F {frame.forwarding_error}") for frame in formed if frame in marked
        )
        expect_none(faults, len(formed), 100)
    assert len(marked) <= len(frames) // 20, f"{audited.path}: {len(marked)} of {len(frames)} are marked"


def check_ranks(audited, way, frames, rank_in):
    """Ranks said in one way lie between what the mote says in other ways just before and just after."""
    ranks = Ranks(audited)
    faults, checked = [], 0
    for frame in frames:
        bounds = ranks.about(frame, way)
        if bounds is None or not audited.network.stands:
            continue
        checked += 1
        if not bounds[0] <= rank_in(frame) <= bounds[1]:
            faults.append(audited.says(frame, f"mote {frame.source} says {rank_in(frame)} hops, and otherwise {bounds}"))
    # A rank may change and change back between two beacons.
    if len(faults) > checked // 50:
        expect_none(faults, checked)
    assert checked > 200 or not audited.network.stands


def test_the_sender_rank_is_the_senders(audited):
    # RFC 6550, section 11.2.
    check_ranks(audited, "RPI", routed(audited), lambda frame: frame.sender_rank // 256)


def test_join_metrics_are_ranks_in_hops_less_one(audited):
    # RFC 8180, section 6.1: DAGRank(rank) - 1.
    check_ranks(audited, "beacon", audited.beacons, lambda frame: frame.number_in("wpan.tsch.join_metric") + 1)


def test_sender_ranks_fall_on_the_way_up_and_rise_on_the_way_down(audited):
    faults, checked = [], 0
    for journey in journeys(audited):
        for before, after in zip(journey, journey[1:]):
            if None in (before.sender_rank, after.sender_rank) or after.time_ns < audited.formed_ns + SETTLED_NS:
                continue
            # Where a datagram turns, it has come from below. A parent whose rank has just risen may have its child's.
            checked += 1
            down = after.goes_down and before.goes_down
            if before.sender_rank < after.sender_rank if not down else after.sender_rank < before.sender_rank:
                faults.append(audited.says(after, f"rank {before.sender_rank} then {after.sender_rank}, O bit {after.goes_down}"))
    if audited.network.stands:
        expect_none(faults, checked, 100)
    assert len(faults) <= checked // 20, faults[:10]


# Hop by hop.


def test_hop_limits_fall_by_one_from_hop_to_hop(audited):
    # RFC 8200, section 3. Inside a tunnel that of the datagram stays, and the tunnel's falls: RFC 2473, section 3.1; RFC 8138,
    # section 7. The mote where the tunnel begins forwards the datagram, too.
    faults, checked = [], 0
    for journey in journeys(audited):
        for before, after in zip(journey, journey[1:]):
            checked += 1
            outer, inner = before.tunnel_hop_limit, before.hop_limit
            in_tunnel = outer is not None and after.tunnel_hop_limit is not None
            expected = (outer - 1, inner) if in_tunnel else (after.tunnel_hop_limit, inner - 1)
            if (after.tunnel_hop_limit, after.hop_limit) != expected:
                faults.append(
                    audited.says(
                        after,
                        f"hop limits {(after.tunnel_hop_limit, after.hop_limit)} (tunnel, datagram) "
                        f"after {(outer, inner)} in frame {before.number}",
                    )
                )
    expect_none(faults, checked, 100)


def test_source_routes_lead_to_the_next_hop_and_every_hop_takes_itself_off(audited):
    # RFC 6554, section 4.2; RFC 8138, sections 5.5 and 5.6.
    frames = [frame for frame in routed(audited) if frame.source_route]
    assert not audited.network.storing or not frames

    def is_right(frame):
        return frame.source_route[0] == frame.destination and frame.source_route[-1] == frame.ip_destination

    if not audited.network.storing:
        faults_of(audited, frames, is_right, lambda frame: f"{frame.source_route} to {frame.destination}", 100)
    pairs = [pair for journey in journeys(audited) for pair in zip(journey, journey[1:]) if pair[0].source_route]
    faults = (
        audited.says(after, f"{after.source_route} after {before.source_route}")
        for before, after in pairs
        if after.source_route != before.source_route[1:]
    )
    expect_none(faults, len(pairs), 0 if audited.network.storing else 50)


def test_datagrams_turn_round_at_the_root_and_go_down_encapsulated(audited):
    tunnels = [frame for frame in routed(audited) if frame.tunnel_hop_limit is not None]
    assert len(tunnels) == 0 if audited.network.storing else len(tunnels) > 50, len(tunnels)
    assert {frame.ip_source for frame in tunnels} <= set(range(1, MOTES))


def test_storing_motes_turn_datagrams_round_below_the_root(audited):
    def turns_below(journey):
        ends = {frame.source for frame in journey} | {journey[-1].destination}
        return ROOT not in ends and {frame.goes_down for frame in journey} == {False, True}

    turned = [journey for journey in journeys(audited) if turns_below(journey)]
    if audited.network.storing:
        assert len(turned) > 20, len(turned)
    else:
        expect_none((audited.says(journey[0], "turns below the root") for journey in turned), len(journeys(audited)))


# Fragments.


def test_datagrams_of_several_frames_were_put_together(captures):
    for name in ("msf-fragments", "msf-fragments-per-hop"):
        whole = [frame for frame in captures[name].datagrams if frame["udp.length"] == ["208"]]
        assert len(whole) > 100, (name, len(whole))
        tunnels = [frame for frame in whole if frame.tunnel_hop_limit is not None]
        assert len(tunnels) > 20, (name, len(tunnels))


def test_fragments_state_the_size_before_compression(captures):
    # RFC 4944, section 5.3. IPv6, RPL option, UDP; for a tunnel another IPv6 header, and a routing header if hops follow.
    alone = 40 + 8 + 8 + 200
    for name in ("msf-fragments", "msf-fragments-per-hop"):
        capture = captures[name]
        whole = [frame for frame in capture.datagrams if frame["udp.length"] == ["208"]]
        size = {frame.number: frame.number_in("6lowpan.frag.size") for frame in capture.frames}

        def is_right(frame, size=size):
            hops = frame.source_route
            if not hops:
                return size[frame.number] == alone
            tunnel = 0 if frame.tunnel_hop_limit is None else 40
            return size[frame.number] >= alone + tunnel + (16 if len(hops) > 1 else 0)

        faults_of(capture, whole, is_right, lambda frame: f"{size[frame.number]} bytes, route {frame.source_route}", 100)


# RPL's messages.


def test_dios_turn_on_compression_of_routing_headers(audited):
    # RFC 9035, section 3: the 'T' flag, bit 2 of the flags counted from the most significant.
    told = [frame for frame in audited.datagrams if frame["icmpv6.rpl.opt.config.flag"]]
    flag = "icmpv6.rpl.opt.config.flag"
    faults_of(audited, told, lambda frame: frame.number_in(flag) & 0x20, lambda frame: f"flags {frame[flag]}", 20)


def test_dios_state_mode_objective_and_prefix(audited):
    # RFC 6550, section 6.3.1, 6.7.6, 6.7.10 and 20.3: 1 is non-storing, 2 storing without multicast.
    ocp = 1 if "mrhof" in audited.network.rpl else 0

    def is_right(frame):
        return (
            frame.number_in("icmpv6.rpl.dio.flag.mop") == (2 if audited.network.storing else 1)
            and frame["icmpv6.rpl.dio.dagid"] == ["fd00::1:0"]
            and frame["icmpv6.rpl.dio.version"] == capture_version(audited)
            and frame.number_in("icmpv6.rpl.opt.config.ocp") == ocp
            and frame.number_in("icmpv6.rpl.opt.config.min_hop_rank_inc") == 256
            and frame["icmpv6.rpl.opt.type"] == ["4", "8"]
            and frame["icmpv6.rpl.opt.prefix"] == ["fd00::"]
            and frame["icmpv6.rpl.opt.prefix.length"] == ["64"]
        )

    dios = [frame for frame in audited.datagrams if frame.is_rpl(DIO)]
    faults_of(audited, dios, is_right, lambda frame: f"MOP {frame['icmpv6.rpl.dio.flag.mop']}, {frame['icmpv6.rpl.opt.type']}", 20)


def capture_version(audited):
    return next(frame["icmpv6.rpl.dio.version"] for frame in audited.datagrams if frame.is_rpl(DIO))


def test_link_local_rpl_messages_stay_on_the_link(audited):
    # RFC 6550, section 6: DIS and DIO, and in storing mode DAO and DAO-ACK, between link-local addresses.
    codes = (DIS, DIO, DAO, DAO_ACK) if audited.network.storing else (DIS, DIO)
    local = [frame for frame in audited.datagrams if any(frame.is_rpl(code) for code in codes)]

    def is_right(frame):
        to = frame["ipv6.dst"][-1]
        return frame["ipv6.src"][-1].startswith("fe80:") and to.startswith(("fe80:", "ff02::1a")) and frame.goes_down is None

    faults_of(audited, local, is_right, lambda frame: f"{frame['ipv6.src']} to {frame['ipv6.dst']}", 40)


def test_daos_name_target_parent_and_lifetime(audited):
    # RFC 6550, section 6.4, 6.7.7, 6.7.8 and 9.
    daos = [frame for frame in audited.datagrams if frame.is_rpl(DAO)]

    def is_right(frame):
        parent = frame["icmpv6.rpl.opt.transit.parent"]
        return (
            frame["icmpv6.rpl.opt.target.prefix"]
            and all(length == "128" for length in frame["icmpv6.rpl.opt.target.prefix_length"])
            and bool(parent) != audited.network.storing
            and frame.number_in("icmpv6.rpl.opt.transit.pathlifetime") in (0, 30)
            and frame["icmpv6.rpl.dao.flag.d"][0] in ("0", "False")
            and frame["icmpv6.rpl.opt.transit.flag.e"][0] in ("0", "False")
        )

    faults_of(audited, daos, is_right, lambda frame: f"{frame['icmpv6.rpl.opt.type']}", 11)


def test_daos_have_an_active_bit_of_path_control(audited):
    # RFC 6550, section 9.9: no DAO is sent without active bits of path control; with a size of 0 there is one, the leftmost.
    daos = [frame for frame in audited.datagrams if frame.is_rpl(DAO)]
    field = "icmpv6.rpl.opt.transit.pathctl"
    faults_of(audited, daos, lambda frame: frame.number_in(field) == 0x80, lambda frame: f"path control {frame[field]}", 11)


def test_dao_acks_answer_daos(audited):
    # RFC 6550, section 6.5: DAOSequence is that of the DAO.
    faults, checked, asked = [], 0, defaultdict(set)
    for frame in audited.datagrams:
        if frame.is_rpl(DAO) and frame.source == frame.ip_source and frame["icmpv6.rpl.dao.flag.k"][0] in ("1", "True"):
            asked[frame.source].add(frame.number_in("icmpv6.rpl.dao.sequence"))
        elif frame.is_rpl(DAO_ACK):
            checked += 1
            if frame.number_in("icmpv6.rpl.daoack.sequence") not in asked[frame.ip_destination]:
                faults.append(audited.says(frame, f"{frame['icmpv6.rpl.daoack.sequence']}, asked {asked[frame.ip_destination]}"))
    expect_none(faults, checked, 11)


# Join messages.


def test_join_messages_have_their_classes(audited):
    # RFC 9031, sections 6.1.1 and 6.1.2: AF43 for requests that proxies forward, AF42 for responses to proxies.
    def is_right(frame):
        expected = "0" if not frame.is_routed else "38" if frame["coap.code"] == ["2"] else "36"
        return frame["ipv6.tclass.dscp"][-1] == expected

    messages = [frame for frame in audited.datagrams if frame["coap.code"]]
    faults_of(audited, messages, is_right, lambda frame: f"{frame['coap.code']} of class {frame['ipv6.tclass.dscp']}", 40)
