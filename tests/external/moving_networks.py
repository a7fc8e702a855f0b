"""How much of what motes should have sent arrives where they move: the table of docs/network.md, "Motes that move".

    target/external/venv/bin/python tests/external/moving_networks.py --seeds 5 --jobs 2 --journal moving.jsonl
    target/external/venv/bin/python tests/external/moving_networks.py --function msf orchestra --journal functions.jsonl

What is expected is computed here, from the configuration alone: each sender has one packet in ten seconds, all the time.
A journal that exists is continued.
"""

import argparse
import concurrent.futures
import json
import os
import re
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import pyarrow.parquet as pq

ROOT = Path(__file__).resolve().parents[2]
CASES = {
    "routers-1": 20, "routers-2": 20, "routers-5": 20, "crowd-100-1": 100, "crowd-300-1": 300, "downward-1": 20,
    "routers-0": 20, "downward-0": 20, "crowd-100-0": 100, "crowd-300-0": 300,
}  # fmt: skip
# Of each function, [netsim.sf] in place of that of the configuration; the other keys are kept.
FUNCTIONS = {
    "as-configured": None,
    "minimal": 'kind = "minimal"',
    "msf": 'kind = "msf"',
    "rrsf": 'kind = "rrsf"\nshared_slots = 16',
    "orchestra": 'kind = "orchestra"',
    "sotdma-shared": 'kind = "sotdma"\nslotframe_slots = 97\nshared_slots = 32\nforget_slotframes = 3',
    "oracle": 'kind = "oracle"',
}
# 97.5 % quantiles of Student's t, from one degree of freedom.
T_975 = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262]
WARM_UP_S, END_S, PERIOD_S = 1800, 5400, 10


def configured(case, function, folder):
    """The configuration of a case, with another scheduling function."""
    path = ROOT / "configs" / "mobility" / f"{case}.toml"
    if FUNCTIONS[function] is None:
        return path
    text, n = re.subn(r"\[netsim\.sf\]\n(?:[^\[\n].*\n)*", f"[netsim.sf]\n{FUNCTIONS[function]}\n", path.read_text())
    assert n == 1, "one table of the scheduling function"
    changed = folder / path.name
    changed.write_text(text.replace('file = "', f'file = "{path.parent}/'))
    return changed


def measure(case, seed, function, settings):
    """One run: delivered / expected, latency (s), energy (mC a mote and hour) and when the network had formed."""
    program = os.environ.get("ORCHESTRATOR") or ROOT / "target" / "release" / "murmuration"
    folder = Path(tempfile.mkdtemp(prefix="moving-"))
    try:
        config = configured(case, function, folder)
        command = [program, "run", config, "--seed", str(seed), "--out", folder, "--threads", "1"]
        for setting in settings:
            command += ["--set", setting]
        begun = time.monotonic()
        subprocess.run(command, check=True, capture_output=True, text=True)
        wall_s = time.monotonic() - begun
        run = folder / case
        delivered, latencies_s = set(), []
        columns = ["packet", "kind", "created_ns", "ended_ns", "delivered"]
        for row in pq.read_table(run / "packets.parquet", columns=columns).to_pylist():
            created_s = row["created_ns"] / 1e9
            if row["kind"] == "app" and row["delivered"] and WARM_UP_S <= created_s < END_S and row["packet"] not in delivered:
                delivered.add(row["packet"])
                latencies_s.append((row["ended_ns"] - row["created_ns"]) / 1e9)
        motes = pq.read_table(run / "motes.parquet", columns=["step", "mote", "is_root", "charge_uc", "up_ns", "first_ready_ns"]).to_pylist()
        last = max(row["step"] for row in motes)
        motes = [row for row in motes if row["step"] == last and not row["is_root"]]
        ready_s = [row["first_ready_ns"] / 1e9 for row in motes if row["first_ready_ns"] is not None]
        return {
            "case": case, "seed": seed, "function": function, "settings": settings,
            "ratio": len(delivered) / (CASES[case] * (END_S - WARM_UP_S) / PERIOD_S),
            "median_latency_s": statistics.median(latencies_s) if latencies_s else None,
            "p95_latency_s": sorted(latencies_s)[int(0.95 * len(latencies_s))] if latencies_s else None,
            "mean_current_ma": statistics.mean(row["charge_uc"] / row["up_ns"] * 1e6 for row in motes),
            "share_ready": len(ready_s) / len(motes),
            "formed_s": max(ready_s) if len(ready_s) == len(motes) else None,
            "times_real_time": END_S / wall_s,
        }  # fmt: skip
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def interval(values):
    """95 % interval of the mean by Student's t."""
    if not 2 <= len(values) <= len(T_975) + 1:
        return "–"
    half = T_975[len(values) - 2] * statistics.stdev(values) / len(values) ** 0.5
    return f"{statistics.mean(values) - half:.3f} to {statistics.mean(values) + half:.3f}"


def summary(rows):
    def over(key, digits):
        values = [row[key] for row in rows if row[key] is not None]
        if not values:
            return "–"
        return f"{statistics.mean(values):.{digits}f} ({min(values):.{digits}f}–{max(values):.{digits}f})"

    formed = over("formed_s", 0)
    n_formed = sum(row["formed_s"] is not None for row in rows)
    formed += "" if n_formed == len(rows) else f", {n_formed} of {len(rows)}"
    return f"| `{rows[0]['case']}` | `{rows[0]['function']}` | {over('ratio', 3)} | {interval([row['ratio'] for row in rows])} | {over('median_latency_s', 1)} | {over('p95_latency_s', 1)} | {over('mean_current_ma', 1)} | {formed} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--cases", nargs="*", choices=CASES, default=list(CASES))
    parser.add_argument("--function", nargs="*", choices=FUNCTIONS, default=["as-configured"], dest="functions")
    parser.add_argument("--set", action="append", default=[], dest="settings", metavar="KEY=VALUE")
    parser.add_argument("--journal", type=Path, required=True)
    asked = parser.parse_args()
    done = [json.loads(line) for line in asked.journal.read_text().splitlines()] if asked.journal.exists() else []
    done = [row for row in done if row["settings"] == asked.settings]
    known = {(row["case"], row["seed"], row["function"]) for row in done}
    wanted = [(case, seed, function) for seed in range(1, asked.seeds + 1) for function in asked.functions for case in asked.cases]
    todo = [one for one in wanted if one not in known]
    with concurrent.futures.ThreadPoolExecutor(asked.jobs) as pool:
        runs = [pool.submit(measure, *one, asked.settings) for one in todo]
        for run in concurrent.futures.as_completed(runs):
            done.append(run.result())
            with asked.journal.open("a") as journal:
                journal.write(json.dumps(run.result()) + "\n")
    for function in asked.functions:
        for case in asked.cases:
            rows = [row for row in done if (row["case"], row["function"]) == (case, function)]
            if rows:
                print(summary(rows))


if __name__ == "__main__":
    main()
