"""How much of what motes should have sent arrives where they move, beside TSCH-Sim on the same positions and traffic.

    git clone https://github.com/edi-riga/tsch-sim /tmp/tsch-sim
    target/external/venv/bin/python tests/external/mobility_beside_tsch_sim.py /tmp/tsch-sim --seeds 5 --jobs 2

Cases are configs/mobility/trail.toml and warehouse.toml. Our run moves the motes, and TSCH-Sim replays their positions, once a second.
Radios are unit disks of the same radius on both sides. What is expected is computed here, from the configuration alone.
A path exists where the positions join a sender to the root by links within the radius: no protocol can deliver more at once.
Needs Node.js. The checkout is copied, and only the copy is changed.
TSCH-Sim (commit 20890b2) does not restore the order of its timers when one is cancelled, so that others fire late, packet sources
among them. Each scheduler therefore runs twice: as released, and with the order restored.
"""

import argparse
import collections
import concurrent.futures
import json
import os
import re
import shutil
import statistics
import subprocess
import tempfile
import tomllib
from pathlib import Path

import pyarrow.parquet as pq

ROOT = Path(__file__).resolve().parents[2]
CASES = ["trail", "warehouse"]
WARM_UP_S = 1800
# Names of our scheduling functions: the configuration's ending, and settings.
TIMERS = [
    "netsim.mac.beacon_spacing_s=0", "netsim.mac.beacon_wait_s=0", "netsim.mac.rejoin_wait_s=0", "netsim.mac.neighbours_to_wait=1",
    "netsim.mac.max_retries=7", "netsim.mac.queue_frames=16", "netsim.mac.max_backoff_exponent=5", "netsim.mac.keep_alive_s=60",
    "netsim.mac.desynchronise_s=120", "netsim.mac.adaptive_synchronization=false", "netsim.mac.max_drift_ppm=0",
    "netsim.rpl.dio_interval_min=12", "netsim.rpl.dio_interval_doublings=8", "netsim.rpl.dio_redundancy=0", "netsim.rpl.dis_period_s=30",
    'netsim.rpl.solicitation="multicast"', "netsim.rpl.dao_delay_s=4",
]  # fmt: skip
OURS = {
    "orchestra": ("", []),
    "orchestra, with admission": ("", ["netsim.join.secure=true"]),
    "orchestra, our defaults": ("", ['netsim.sf={ kind = "orchestra" }', 'netsim.rpl.mode="non-storing"', 'netsim.rpl.objective="of0"']),
    "orchestra, TSCH-Sim's timers": ("", TIMERS),
    "minimal": ("", ['netsim.sf={ kind = "minimal" }']),
    "sotdma, netsim.mobility": ("-sotdma", []),
}
# Names of TSCH-Sim's schedulers, with the routing that each is made for.
THEIRS = {
    "Orchestra": {"SCHEDULING_ALGORITHM": "Orchestra"},
    "6tischMin": {"SCHEDULING_ALGORITHM": "6tischMin"},
    "LeafAndForwarder": {"SCHEDULING_ALGORITHM": "LeafAndForwarder", "ROUTING_ALGORITHM": "LeafAndForwarderRouting"},
}
REPLAY = """
import fs from 'fs';
import config from './config.mjs';
import * as time from './time.mjs';

/* Puts every node where the table has it: a row for each second, a pair of coordinates for each node. */
export class MobilityModel {
    constructor(network) {
        this.network = network;
        this.table = JSON.parse(fs.readFileSync(config.POSITION_TABLE));
        this.row = -1;
    }

    update_positions() {
        const row = Math.min(Math.floor(time.timeline.seconds), this.table.length - 1);
        if (row === this.row) return;
        this.row = row;
        for (const [id, node] of this.network.nodes) {
            [node.pos_x, node.pos_y] = this.table[row][id - 1];
        }
        this.network.nodes.forEach((node) => this.network.update_node_links(node));
    }
}
"""
HEAP = """
import { heap_insert, heap_extract_min } from './heap_released.mjs';
export { heap_insert, heap_extract_min };

/* Exchanges the element with its parents up to the root, and takes it from there: the order of all others is kept. */
export function heap_remove_at(heap, i, less_than) {
    while (i > 0) {
        const parent = (i - 1) >> 1;
        [heap[i], heap[parent]] = [heap[parent], heap[i]];
        heap[i].heap_position = i;
        i = parent;
    }
    heap_extract_min(heap, less_than);
}
"""


class Case:
    """What a configuration says of radio, traffic and time."""

    def __init__(self, name):
        config = tomllib.loads((ROOT / "configs" / "mobility" / f"{name}.toml").read_text())
        self.name, self.end_s, self.n_motes = name, config["experiment"]["duration_s"], config["experiment"]["agents"]
        self.radius_m = config["netsim"]["phy"]["radius_m"]
        (app,) = config["netsim"]["app"]
        self.senders, self.period_s, self.bytes = app["senders"], app["period_s"], app["payload_bytes"]
        self.expected = len(self.senders) * (self.end_s - WARM_UP_S) / self.period_s

    def counts(self, created_s):
        return WARM_UP_S <= created_s < self.end_s

    def result(self, function, seed, n_created, latencies_s, losses):
        losses["not created"] = self.expected - n_created
        losses["unaccounted"] = self.expected - len(latencies_s) - losses.total()
        return {
            "case": self.name, "function": function, "seed": seed, "ratio": len(latencies_s) / self.expected,
            "median_s": statistics.median(latencies_s) if latencies_s else None,
            "losses": {why: n / self.expected for why, n in losses.items()},
        }  # fmt: skip


def run_ours(case, function, seed, folder):
    """Delivered / expected, latency and losses of one run of the orchestrator; its files are in `folder`."""
    program = os.environ.get("ORCHESTRATOR") or ROOT / "target" / "release" / "murmuration"
    ending, settings = OURS[function]
    config = ROOT / "configs" / "mobility" / f"{case.name}{ending}.toml"
    command = [program, "run", config, "--seed", str(seed), "--out", folder, "--threads", "1"]
    command += [f"--set={setting}" for setting in ["output.every_steps=1", *settings]]
    subprocess.run(command, check=True, capture_output=True, text=True)
    latencies_s, losses = {}, collections.Counter()
    for row in pq.read_table(folder / config.stem / "packets.parquet").to_pylist():
        if row["kind"] == "app" and case.counts(row["created_ns"] / 1e9):
            if row["delivered"]:
                latencies_s.setdefault(row["packet"], (row["ended_ns"] - row["created_ns"]) / 1e9)
            else:
                losses[row["drop_reason"]] += 1
    return case.result(f"netsim: {function}", seed, len(latencies_s) + losses.total(), list(latencies_s.values()), losses)


def read_positions(case, folder):
    """For each second, where each mote is (m): the network of a step has the positions at the step's end."""
    table = [[None] * case.n_motes for _ in range(int(case.end_s) + 1)]
    for row in pq.read_table(folder / case.name / "steps.parquet", columns=["step", "agent", "x_m", "y_m"]).to_pylist():
        table[row["step"]][row["agent"]] = [row["x_m"], row["y_m"]]
    return table[1:]


def share_with_path(case, positions):
    """The share of senders that are joined to the root by links within the radius, mean over time."""
    n_joined = 0
    for row in positions[WARM_UP_S:]:
        joined, edge = {0}, [0]
        while edge:
            x_m, y_m = row[edge.pop()]
            near = [i for i, (x, y) in enumerate(row) if i not in joined and (x - x_m) ** 2 + (y - y_m) ** 2 <= case.radius_m**2]
            joined.update(near)
            edge += near
        n_joined += sum(sender in joined for sender in case.senders)
    return n_joined / (len(positions[WARM_UP_S:]) * len(case.senders))


def run_theirs(case, function, seed, positions, checkout, folder, in_order):
    """The same of one run of TSCH-Sim on these positions, from its log; `in_order`: with the order of timers restored."""
    copy, out = folder / f"tsch-sim-{in_order}", folder / f"{function}-{in_order}"
    if not copy.exists():
        shutil.copytree(checkout, copy, ignore=shutil.ignore_patterns(".git", "results"))
        (copy / "source" / "mobility.mjs").write_text(REPLAY)
        if in_order:
            (copy / "source" / "heap.mjs").rename(copy / "source" / "heap_released.mjs")
            (copy / "source" / "heap.mjs").write_text(HEAP)
        (folder / "positions.json").write_text(json.dumps(positions))
    out.mkdir()
    # Motes are numbered from 0 here, from 1 there. Standing motes are forwarders, as is each where all move.
    first = case.senders[0]
    links = [{"NODE_TYPE": name, "LINK_MODEL": "UDGM"} for name in ("standing", "moving")]
    moving = {
        "NAME": "moving", "START_ID": first + 1, "COUNT": len(case.senders), "CONNECTIONS": links,
        "APP_PACKETS": {"APP_PACKET_PERIOD_SEC": case.period_s, "APP_WARMUP_PERIOD_SEC": 0, "TO_ID": 1},
        "ROUTING_IS_LEAF": function == "LeafAndForwarder" and first > 1,
    }  # fmt: skip
    config = {
        "SIMULATION_DURATION_SEC": case.end_s, "SIMULATION_SEED": seed, "RESULTS_DIR": str(out), "POSITION_TABLE": str(folder / "positions.json"),
        "MOBILITY_MODEL": "Replay", "UDGM_TRANSMIT_RANGE_M": case.radius_m, "UDGM_CONSTANT_LOSS": True, "UDGM_RX_SUCCESS": 1.0,
        "APP_PACKET_SIZE": case.bytes, "APP_WARMUP_PERIOD_SEC": 0, "LOG_LEVELS": {"Main": 1, "Node": 1, "TSCH": 1, "RPL": 1, "Link": 1},
        "NODE_TYPES": [{"NAME": "standing", "START_ID": 1, "COUNT": first, "CONNECTIONS": links}, moving],
        "POSITIONS": [{"ID": i + 1, "X": x, "Y": y} for i, (x, y) in enumerate(positions[0])],
        **THEIRS[function],
    }  # fmt: skip
    (out / "config.json").write_text(json.dumps(config))
    subprocess.run(["node", "source/main.mjs", out / "config.json"], check=True, cwd=copy, stdout=subprocess.DEVNULL)
    created_s, latencies_s, losses = {}, {}, {}
    line = re.compile(r"asn=(\d+)\s+id=(\d+)\s+App\s+(generate a packet|rx app packet|dropping app packet),? seqnum=(\d+)(?: from=(\d+))?.*?(?:: (.*))?$")
    found = filter(None, map(line.match, (out / "log.txt").read_text().splitlines()))
    for asn, node, what, number, source, why in (match.groups() for match in found):
        now_s = int(asn) / 100
        if what == "generate a packet":
            created_s[node, number] = now_s
        elif what == "rx app packet" and case.counts(created_s[source, number]):
            latencies_s.setdefault((source, number), now_s - created_s[source, number])
        elif what == "dropping app packet":
            # The log names the node that drops a packet, not its source: the time of the drop says whether it counts.
            losses.setdefault((now_s, node, number), re.sub(r"=\d+", "", why))
    lost = collections.Counter(why for (now_s, _, _), why in losses.items() if case.counts(now_s))
    n_created = sum(map(case.counts, created_s.values()))
    label = "TSCH-Sim, timers in order" if in_order else "TSCH-Sim"
    return case.result(f"{label}: {function}", seed, n_created, list(latencies_s.values()), lost)


def measure(case, seed, checkout):
    """All runs of one case and seed, on the same positions, and the share of senders with a path."""
    folder = Path(tempfile.mkdtemp(prefix="beside-"))
    try:
        rows = [run_ours(case, function, seed, folder / str(i)) for i, function in enumerate(OURS)]
        positions = read_positions(case, folder / "0")
        for in_order in (False, True):
            rows += [run_theirs(case, function, seed, positions, checkout, folder, in_order) for function in THEIRS]
        return rows, share_with_path(case, positions)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def summary(rows):
    ratios = [row["ratio"] for row in rows]
    medians = [row["median_s"] for row in rows if row["median_s"] is not None]
    latency = f"{statistics.mean(medians):.2f}" if medians else "–"
    losses = sum((collections.Counter(row["losses"]) for row in rows), collections.Counter())
    most = ", ".join(f"{why} {n / len(rows):.3f}" for why, n in losses.most_common(4) if n / len(rows) > 0.0005)
    ratio = f"{statistics.mean(ratios):.3f} | {min(ratios):.3f} | {max(ratios):.3f}"
    return f"| {rows[0]['case']} | {rows[0]['function']} | {len(rows)} | {ratio} | {latency} | {most} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkout", type=Path, help="a checkout of TSCH-Sim")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--cases", nargs="*", choices=CASES, default=CASES)
    asked = parser.parse_args()
    print("| case | program: scheduling function | seeds | delivered / expected | least | greatest | median latency (s) | losses, of expected |")
    print("|---|---|---|---|---|---|---|---|")
    with concurrent.futures.ThreadPoolExecutor(asked.jobs) as pool:
        for name in asked.cases:
            case = Case(name)
            runs = [pool.submit(measure, case, seed, asked.checkout) for seed in range(1, asked.seeds + 1)]
            results = [run.result() for run in runs]
            for rows in zip(*(rows for rows, _ in results), strict=True):
                print(summary(rows))
            print(f"| {name} | a path exists | {len(runs)} | {statistics.mean(share for _, share in results):.3f} | | | | |", flush=True)


if __name__ == "__main__":
    main()
