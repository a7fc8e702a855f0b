"""Captures through Wireshark's dissectors."""

from conftest import succeed

# Context 0 of the header compression and what the network carries: neither is on the air. Checksums are verified.
READ = ["-o", "6lowpan.context0:fd00::/64", "-d", "wpan.panid==0xabcd,6lowpan", "-o", "udp.check_checksum:TRUE"]
# The keys K1 and K2 of [netsim.security], and their indices. They change nothing in captures that are not secured.
K1, K2 = "365469534348206d696e696d616c3135", "4d75726d75726174696f6e204b322e2e"
KEYS = [word for index, key in ((1, K1), (2, K2)) for word in ("-o", f'uat:ieee802154_keys:"{key}","{index}","No hash"')]
# Robots' payloads are octets of their own, in which heuristics would see other protocols.
PAYLOADS = ["-d", "udp.port==61617,data"]

# Frame types, element identifiers, 6P types and ICMPv6 type as the dissectors print them.
BEACON, DATA, ACK = "0x0000", "0x0001", "0x0002"
RPL = "155"
GOOD = "1"

# A slot, and how much of it a frame begins after: macTsTxOffset (IEEE Std 802.15.4-2015, 8.4.3.3.1).
SLOT_NS = 10_000_000
TX_OFFSET_NS = 2_120_000


def dissect(capture, *fields, more=()):
    """Per frame a dictionary: of every field the list of its values."""
    wanted = [word for field in fields for word in ("-e", field)]
    out = succeed(["tshark", "-r", capture, *READ, *KEYS, *more, "-T", "fields", "-E", "aggregator=;", *wanted])
    rows = [line.split("\t") for line in out.split("\n")[:-1]]
    return [{field: value.split(";") if value else [] for field, value in zip(fields, row)} for row in rows]


def troubles(capture):
    """What the dissectors complain about, be it only a note."""
    frames = dissect(capture, "frame.number", "_ws.malformed", "_ws.expert.message")
    return [frame for frame in frames if frame["_ws.malformed"] or frame["_ws.expert.message"]]
