"""A K7 trace of the links that measured packets took, from a table that `convert` makes of the log of an OpenWSN root.

    python3 tests/external/packet_links.py packets.csv links.k7 [--lossless] [--as-others 11,12,13,14]

Without options the links are as measured. `--lossless` gives every link the delivery ratio 1. `--as-others` gives the listed
channels the mean success of the other channels, as if nothing disturbed them.

The delivery ratio p of a link is that of a geometric distribution, truncated after the most transmissions K, whose mean is the mean
number of transmissions on that link. This is the maximum-likelihood estimate, because the distribution is an exponential family in
that number. A channel's ratio is p times the hops received on that channel over the mean of the channels, and at most 1: hops received on
a channel are proportional to its delivery ratio if transmissions are spread evenly over the channels. Links are taken to be the same
both ways, since a root's log has no frame towards the motes. Pairs with fewer than 20 hops do not hear each other.
"""

import argparse
import csv
import json
from collections import defaultdict

MOST_TRANSMISSIONS = 3
FEWEST_HOPS = 20
CHANNELS = range(11, 27)


def hops_of(table):
    """Of every packet that arrived with its whole route: a list of (sender, receiver, transmissions, channel, RSSI in dBm)."""
    packets = []
    with open(table, newline="") as lines:
        for row in csv.DictReader(lines):
            if not row["hops"]:
                continue
            hops = []
            for hop in range(1, int(row["hops"]) + 1):
                values = [float(row[f"hop{hop}_{name}"]) for name in ("node", "transmissions", "channel", "rssi_dbm")]
                hops.append(values)
            receivers = [hop[0] for hop in hops[1:]] + [float(row["destination"])]
            ends = zip(hops, receivers)
            packets.append([(int(hop[0]), int(to), int(hop[1]), int(hop[2]), hop[3]) for hop, to in ends])
    return packets


def mean_transmissions(success):
    """The mean of a geometric distribution, truncated after MOST_TRANSMISSIONS."""
    weights = [success * (1.0 - success) ** before for before in range(MOST_TRANSMISSIONS)]
    return sum(number * weight for number, weight in enumerate(weights, 1)) / sum(weights)


def success_of(transmissions):
    """The success of a transmission with this mean number of them."""
    low, high = 1e-6, 1.0
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if transmissions < mean_transmissions(middle) else (low, middle)
    return (low + high) / 2.0


def channel_shares(packets):
    """Hops received by channel, over the mean of the channels."""
    counts = dict.fromkeys(CHANNELS, 0)
    for hop in (hop for packet in packets for hop in packet):
        counts[hop[3]] += 1
    mean = sum(counts.values()) / len(counts)
    return {channel: count / mean for channel, count in counts.items()}


def links_of(packets):
    """By pair of motes: success of a transmission, and mean RSSI (dBm). The way with more hops counts for both."""
    measured = defaultdict(list)
    for sender, receiver, transmissions, _, rssi_dbm in (hop for packet in packets for hop in packet):
        measured[sender, receiver].append((transmissions, rssi_dbm))
    links = {}
    for (sender, receiver), values in sorted(measured.items(), key=lambda link: len(link[1])):
        if FEWEST_HOPS <= len(values):
            count, rssi = zip(*values)
            links[frozenset((sender, receiver))] = success_of(sum(count) / len(count)), sum(rssi) / len(rssi)
    return links


def write(packets, path, lossless=False, as_others=()):
    """Writes the trace; returns how many motes there are."""
    shares = channel_shares(packets)
    others = [share for channel, share in shares.items() if channel not in as_others]
    for channel in as_others:
        shares[channel] = sum(others) / len(others)
    motes = 1 + max(mote for packet in packets for hop in packet for mote in hop[:2])
    header = {"node_count": motes, "channels": list(CHANNELS), "tx_length": 100, "interframe_duration": 0, "location": ""}
    header |= {"start_date": "2016-01-01T00:00:00.0", "stop_date": "2016-01-02T00:00:00.0"}
    with open(path, "w") as trace:
        print(json.dumps(header), "datetime,src,dst,channel,mean_rssi,pdr,tx_count", sep="\n", file=trace)
        for pair, (success, rssi_dbm) in sorted(links_of(packets).items(), key=lambda link: sorted(link[0])):
            one, other = sorted(pair)
            for sender, receiver in ((one, other), (other, one)):
                for channel in CHANNELS:
                    pdr = 1.0 if lossless else min(1.0, success * shares[channel])
                    row = [header["start_date"], sender, receiver, channel, f"{rssi_dbm:.1f}", f"{pdr:.4f}", 100]
                    print(*row, sep=",", file=trace)
    return motes


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table")
    parser.add_argument("trace")
    parser.add_argument("--lossless", action="store_true")
    parser.add_argument("--as-others", default="")
    words = parser.parse_args()
    as_others = [int(channel) for channel in words.as_others.split(",") if channel]
    if not set(as_others) < set(CHANNELS):
        parser.error(f"--as-others {words.as_others}: channels are 11 to 26, and at least one must be left out")
    motes = write(hops_of(words.table), words.trace, words.lossless, as_others)
    print(f"{words.trace}: {motes} motes")


if __name__ == "__main__":
    main()
