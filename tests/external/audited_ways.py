"""How datagrams of a capture went, by what motes say of their ranks and parents."""

from bisect import bisect_left, bisect_right
from collections import defaultdict

from audited_frames import DAO, DIO, mote_of_ip


class Ranks:
    """What a mote said of its rank when, in hops (DAGRank): in DIOs, in join metrics, in packet information."""

    # What is said in a datagram was true when it was put into the queue, that long ago at most.
    QUEUE_NS = 10_000_000_000

    def __init__(self, capture):
        self.said = defaultdict(list)
        for frame in capture.datagrams:
            if frame.is_rpl(DIO):
                self.said[frame.source].append((frame.time_ns, DIO, frame.number_in("icmpv6.rpl.dio.rank") // 256))
            elif frame.sender_rank is not None:
                self.said[frame.source].append((frame.time_ns, "RPI", frame.sender_rank // 256))
        for frame in capture.beacons:
            self.said[frame.source].append((frame.time_ns, "beacon", frame.number_in("wpan.tsch.join_metric") + 1))
        for said in self.said.values():
            said.sort(key=lambda one: one[0])
        self.others = {}

    def but(self, mote, but):
        """When a mote said something of its rank, not counting what it said in one way, and the ranks."""
        if (mote, but) not in self.others:
            said = [(time_ns, rank) for time_ns, way, rank in self.said[mote] if way != but]
            self.others[mote, but] = [time_ns for time_ns, _ in said], [rank for _, rank in said]
        return self.others[mote, but]

    def about(self, frame, but):
        """The lowest and the highest of what its sender said shortly before a frame and shortly after, not counting what it
        said in one way; None: nothing."""
        times_ns, ranks = self.but(frame.source, but)
        after = bisect_right(times_ns, frame.time_ns)
        if after in (0, len(times_ns)):
            return None
        # Within the time of a queue, and at least two before and two after.
        first = min(bisect_left(times_ns, frame.time_ns - self.QUEUE_NS), max(after - 2, 0))
        last = max(bisect_right(times_ns, frame.time_ns + self.QUEUE_NS), after + 2)
        near = ranks[first:last]
        return min(near), max(near)


class Parents:
    """Which parent a mote advertised when: to the root by transit information, or by sending its DAOs there."""

    def __init__(self, capture, storing):
        self.of = defaultdict(list)
        for frame in capture.datagrams:
            if not frame.is_rpl(DAO) or frame.number_in("icmpv6.rpl.opt.transit.pathlifetime") == 0:
                continue
            if storing:
                self.of[frame.source].append((frame.time_ns, frame.destination))
            elif frame.source == frame.ip_source:
                parent = mote_of_ip(frame["icmpv6.rpl.opt.transit.parent"][0])
                self.of[frame.source].append((frame.time_ns, parent))

    def at(self, mote, time_ns):
        told = self.of[mote]
        before = [parent for told_ns, parent in told if told_ns <= time_ns]
        return before[-1] if before else told[0][1] if told else None

    def way(self, frame):
        """Whether a frame goes down the tree; None: the tree that DAOs show has no such link then."""
        goes_up = self.at(frame.source, frame.time_ns) == frame.destination
        goes_down = self.at(frame.destination, frame.time_ns) == frame.source
        return goes_down if goes_up != goes_down else None


def routed(capture):
    """Frames with datagrams from mote to mote, on one of their hops."""
    return [frame for frame in capture.datagrams if frame.is_routed and frame.destination is not None]


def journeys(capture):
    """Of each routed datagram its frames hop by hop, repetitions left out."""
    under_way, ended = defaultdict(list), []
    for frame in routed(capture):
        candidates = under_way[frame.identity]
        hop = (frame.source, frame.destination, frame.sequence)
        if any(hop in ((f.source, f.destination, f.sequence) for f in journey) for journey in candidates):
            continue
        arrived = [journey for journey in candidates if journey[-1].destination == frame.source]
        if arrived:
            arrived[-1].append(frame)
        elif frame.source == frame.ip_source:
            candidates.append([frame])
            ended.append(candidates[-1])
    return ended
