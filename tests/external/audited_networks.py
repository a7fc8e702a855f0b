"""The networks whose frames wire_audit.py audits: every scheduling function and mode, small and short."""

import functools
from dataclasses import dataclass

from conftest import only_directory, program, succeed

MOTES = 12
HOPPING_SEQUENCE = [17, 23, 15, 25]
# Motes on alternating sides of the root, which is mote 0. Each hears its neighbours only.
LINE_LINKS = [(mote, max(mote - 2, 0)) for mote in range(1, MOTES)]
LINE = """
[robotsim.scenario]
kind = "line"
spacing_m = 2.0
jitter_m = 0.0
[netsim.phy]
propagation = "unit-disk"
radius_m = 2.5
"""
# Motes in reach of others only along these links, from child to parent: a tree with branches below the root.
TREE_M = [(0, 0), (2, 0), (-2, 0), (4, 0), (-4, 0), (2, 2), (-2, 2), (2, -2), (-6, 0), (6, 0), (-6, 2), (6, 2)]
TREE_LINKS = [(1, 0), (2, 0), (3, 1), (4, 2), (5, 1), (6, 2), (7, 1), (8, 4), (9, 3), (10, 8), (11, 9)]
TREE = """
[robotsim.scenario]
kind = "csv"
file = "tree.csv"
[netsim.phy]
propagation = "unit-disk"
radius_m = 2.5
"""
# Links that lose frames, and neighbours to choose between.
LOSSY = """
[robotsim.scenario]
kind = "grid"
spacing_m = 2.0
[netsim.phy]
propagation = "log-distance"
exponent = 5.0
"""
# Datagrams between any two motes turn round at the root, or in storing mode at the first mote above both.
PEERS = """
[[netsim.app]]
kind = "periodic"
destination = "peers"
period_s = {period_s}
payload_bytes = {payload_bytes}
"""


@dataclass(frozen=True)
class Network:
    """An experiment, and what an audit of its frames needs to know of it."""

    sf: str
    # Further tables and keys of the experiment.
    tables: str = ""
    mac: str = ""
    rpl: str = ""
    storing: bool = False
    secured: bool = False
    place: str = LINE
    period_s: float = 30.0
    payload_bytes: int = 30
    duration_s: float = 400.0
    seed: int = 1
    # Nobody moves, no frame is lost but to collisions, nobody is switched off.
    stands: bool = True

    def toml(self, name):
        mode = "storing" if self.storing else "non-storing"
        return f"""
[experiment]
name = "{name}"
seed = {self.seed}
duration_s = {self.duration_s}
agents = {MOTES}
control_period = {{ rate_hz = 1.0 }}
start = "at-once"
[robotsim.controller]
kind = "hold"
[netsim]
mode = "6tisch"
hopping_sequence = {HOPPING_SEQUENCE}
[netsim.mac]
beacon_wait_s = 2.0
beacon_period_s = 2.0
beacon_spacing_s = 0.5
{self.mac}
[netsim.rpl]
mode = "{mode}"
dio_interval_min = 12
{self.rpl}
[netsim.swarm]
transport = "none"
[netsim.sf]
{self.sf}
{self.place}
{PEERS.format(period_s=self.period_s, payload_bytes=self.payload_bytes)}
{"[netsim.security]" if self.secured else ""}
{self.tables}
[output]
pcap = true
mcap = false
steps = false
transmissions = false
links = "none"
schedule = false
neighbours = false
motes = false
report = false
"""


def static_schedule(links):
    """A shared cell for beacons and broadcast frames, then a cell for each direction of each link."""
    ways = [way for child, parent in links for way in ((child, parent), (parent, child))]
    cells = ["[[netsim.sf.cell]]\nslot = 0\nfrom = \"any\"\nto = \"all\"\nadvertising = true"]
    for slot, (sender, receiver) in enumerate(ways, start=1):
        cells.append(f"[[netsim.sf.cell]]\nslot = {slot}\nchannel = {slot % 4}\nfrom = {sender}\nto = {receiver}")
    cells = "\n".join(cells)
    return f'kind = "static"\nslotframe_slots = {len(ways) + 1}\n{cells}'


MSF = 'kind = "msf"\nwait_min_s = 2\nwait_max_s = 4\nquarantine_s = 5'
ORCHESTRA = 'kind = "orchestra"\neb_slots = 41'
# Cells whose delivery ratios differ by chance move, and a mote that comes back finds cells of which it knows nothing.
RESTLESS_MSF = f"{MSF}\nslotframe_slots = 41\nmax_num_cells = 16\nlim_numcellsused_high = 8\nlim_numcellsused_low = 2\nhousekeeping_s = 5\nrelocate_pdr_percent = 3"
LOST_ACKS = """
[[netsim.mac.effect]]
kind = "ack-loss"
probability = 0.2
[[netsim.app]]
senders = [1, 2]
destination = "root"
period_s = 0.4
payload_bytes = 10
"""
# Two of the four channels, 17 and 23, lose half of the frames, and links skip them.
BLACKLIST = 'blacklist = { kind = "mabo-first-best-arm", arms = 2, offsets = 4, spacing = 1 }'
WIFI = "".join(f'[[netsim.phy.effect]]\nkind = "interference"\ncentre_mhz = {centre}\nduty = 0.5\n' for centre in (2437.0, 2462.0))
COMES_AND_GOES = "".join(
    f'[[timeline]]\nat_s = {at_s}\norder = "{order}"\nmotes = {mote}\n'
    for mote, gone_s, back_s in ((1, 400.0, 430.0), (2, 490.0, 530.0), (5, 600.0, 640.0))
    for order, at_s in (("kill", gone_s), ("revive", back_s))
)

NETWORKS = {
    "minimal": Network('kind = "minimal"'),
    "minimal-storing": Network('kind = "minimal"', storing=True, place=TREE),
    "minimal-mrhof": Network('kind = "minimal"', rpl='objective = "mrhof"'),
    "msf": Network(MSF),
    "msf-secured": Network(MSF, secured=True),
    "msf-secured-fragments": Network(MSF, secured=True, payload_bytes=200, period_s=40.0),
    "msf-storing": Network(MSF, storing=True, place=TREE),
    "msf-relocating": Network(RESTLESS_MSF, tables=LOST_ACKS, stands=False, period_s=60.0, duration_s=1500.0),
    "msf-restless": Network(MSF, tables=COMES_AND_GOES, place=LOSSY, stands=False, duration_s=700.0),
    "msf-fragments": Network(MSF, payload_bytes=200, period_s=40.0),
    "msf-fragments-per-hop": Network(
        MSF, payload_bytes=200, period_s=40.0, tables='[netsim.lowpan]\nfragmentation = "per-hop"\nreassembly_buffers = 4'
    ),
    "orchestra": Network(ORCHESTRA),
    "orchestra-secured": Network(ORCHESTRA, secured=True),
    "orchestra-root": Network(
        f'{ORCHESTRA}\nrules = ["eb-per-time-source", "special-for-root", "unicast-non-storing", "default-common"]'
    ),
    "orchestra-storing": Network(
        f'{ORCHESTRA}\nrules = ["eb-per-time-source", "unicast-storing", "default-common"]',
        storing=True,
        place=TREE,
    ),
    "orchestra-link-based": Network(f'{ORCHESTRA}\ncommon_slots = 7\nrules = ["link-based", "default-common"]', storing=True, place=TREE),
    "alice": Network('kind = "alice"\neb_slots = 41', storing=True, place=TREE),
    "llsf": Network(MSF.replace("msf", "llsf")),
    "emsf": Network(f'{MSF.replace("msf", "emsf")}\nmax_num_cells = 16\nlim_numcellsused_low = 2'),
    "rrsf": Network('kind = "rrsf"\nshared_slots = 4'),
    "rrsf-storing": Network('kind = "rrsf"\nshared_slots = 4', storing=True, place=TREE),
    "sotdma": Network('kind = "sotdma"\nslotframe_slots = 32'),
    "sotdma-storing": Network('kind = "sotdma"\nslotframe_slots = 32', storing=True, place=TREE),
    "static": Network(static_schedule(LINE_LINKS)),
    "static-storing": Network(static_schedule(TREE_LINKS), storing=True, place=TREE),
    "msf-blacklists": Network(MSF, tables=WIFI, mac=BLACKLIST, stands=False),
    "static-secured-blacklists": Network(
        static_schedule(TREE_LINKS), tables=WIFI, mac=BLACKLIST, place=TREE, stands=False, secured=True
    ),
    "exact-clocks": Network('kind = "minimal"', mac="max_drift_ppm = 0.0\ncrystal_hz = 1_000_000_000"),
}


@functools.cache
def capture_of(name, folder):
    """Runs a network in a folder of its own and returns the path of its capture. Networks run beside each other."""
    own = folder / name
    own.mkdir()
    positions = "".join(f"{mote},{x_m},{y_m}\n" for mote, (x_m, y_m) in enumerate(TREE_M))
    (own / "tree.csv").write_text(f"agent,x_m,y_m\n{positions}")
    (own / f"{name}.toml").write_text(NETWORKS[name].toml(name))
    succeed([program("murmuration"), "run", own / f"{name}.toml", "--out", own / "runs"])
    return only_directory(own / "runs") / "radio.pcap"
