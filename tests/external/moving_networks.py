"""How much of what motes should have sent arrives where they move: the tables of docs/network.md, "Motes that move".

    target/external/venv/bin/python tests/external/moving_networks.py --auto --seeds 5 --jobs 2 --journal auto.jsonl
    target/external/venv/bin/python tests/external/moving_networks.py --seeds 5 --jobs 2 --journal moving.jsonl
    target/external/venv/bin/python tests/external/moving_networks.py --function msf orchestra --journal functions.jsonl

What is expected is computed here, from the configuration alone: each sender has one packet in ten seconds, all the time.
With --auto, cases have no setting of the network but the radio and the traffic, robots wait until it has formed, and the quarter of an
hour after that counts.
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
# With --auto, by case: the configuration that it comes from, how many move, how fast (m/s).
AUTO = {
    **{f"routers-{speed}": ("routers", 20, speed) for speed in (1, 2, 5)},
    **{f"crowd-{n}-{speed}": ("crowd", n, speed) for n in (50, 100) for speed in (1, 2, 5)},
    "crowd-300-1": ("crowd", 300, 1),
    "trail": ("trail", 10, 1),
    "warehouse": ("warehouse", 20, 2),
}
# Of the square in crowd-300.csv (m).
SIDE_300_M = 105.0
CHOSEN = ("mac", "sf", "rpl", "join", "mobility")
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


def automatic(case, folder):
    """A case without what the profile chooses. A crowd has 100 robots in a square of 60 m, or as many to the square metre."""
    source, n_moving, speed_mps = AUTO[case]
    text = (ROOT / "configs" / "mobility" / f"{source}.toml").read_text()
    for table in CHOSEN:
        text = re.sub(rf"\[netsim\.{table}\]\n(?:[^\[\n].*\n)*\n?", "", text)
    text = re.sub(r"\n(hopping_sequence|start) = .*", "", text)
    text = re.sub(r"\nduration_s = .*", "\nduration_s = 900.0\nformation_limit_s = 20000.0", text)
    positions = re.search(r'\nfile = "(.*)"', text)[1]
    if source in ("routers", "crowd"):
        text = re.sub(r"(slowest|fastest)_mps = .*", rf"\1_mps = {speed_mps:.1f}", text)
    if source == "crowd":
        side_m = 60 * (n_moving / 100) ** 0.5
        text = text.replace("agents = 101", f"agents = {n_moving + 1}").replace("count = 100", f"count = {n_moving}")
        text = text.replace("side_m = 60.0", f"side_m = {side_m:.1f}")
        positions = "crowd-300.csv"
    lines = (ROOT / "configs" / "mobility" / positions).read_text().splitlines()
    lines = [line for line in lines if not line.startswith("#")]
    if source == "crowd":
        rows = [row.split(",") for row in lines[1 : n_moving + 2]]
        lines = [lines[0], *(f"{agent},{side_m / SIDE_300_M * float(x):.2f},{side_m / SIDE_300_M * float(y):.2f}" for agent, x, y in rows)]
    (folder / "positions.csv").write_text("\n".join(lines) + "\n")
    path = folder / f"{source}.toml"
    path.write_text(re.sub(r'\nfile = ".*"', '\nfile = "positions.csv"', text))
    return path


def measure_automatic(case, seed, settings):
    """One run: delivered / expected since the robots started, when the network had formed, and for how long it was simulated."""
    folder = Path(tempfile.mkdtemp(prefix="moving-"))
    try:
        config = automatic(case, folder)
        command = [program(), "run", config, "--seed", str(seed), "--out", folder / "out", "--threads", "1"]
        for setting in settings:
            command += ["--set", setting]
        subprocess.run(command, check=True, capture_output=True, text=True)
        kpis = json.loads((folder / "out" / config.stem / "summary.json").read_text())["kpis"]
        return {
            "case": case, "seed": seed, "function": "auto", "settings": settings,
            "ratio": kpis["since_start"]["delivered_of_expected"]["ratio"],
            "median_latency_s": kpis["since_start"]["delivery"]["latency_s"]["median"], "formed_s": kpis["formation"]["formed_s"],
        }  # fmt: skip
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def program():
    return os.environ.get("ORCHESTRATOR") or ROOT / "target" / "release" / "murmuration"


def measure(case, seed, function, settings):
    """One run: delivered / expected, latency (s), energy (mC a mote and hour) and when the network had formed."""
    folder = Path(tempfile.mkdtemp(prefix="moving-"))
    try:
        config = configured(case, function, folder)
        command = [program(), "run", config, "--seed", str(seed), "--out", folder, "--threads", "1"]
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


def over_seeds(rows, key, digits):
    """Mean, least and greatest."""
    values = [row[key] for row in rows if row[key] is not None]
    if not values:
        return "–"
    return f"{statistics.mean(values):.{digits}f} ({min(values):.{digits}f}–{max(values):.{digits}f})"


def summary_automatic(rows):
    return f"| `{rows[0]['case']}` | {over_seeds(rows, 'ratio', 3)} | {interval([row['ratio'] for row in rows])} | {over_seeds(rows, 'median_latency_s', 1)} | {over_seeds(rows, 'formed_s', 0)} | {len(rows)} |"


def summary(rows):
    def over(key, digits):
        return over_seeds(rows, key, digits)

    formed = over("formed_s", 0)
    n_formed = sum(row["formed_s"] is not None for row in rows)
    formed += "" if n_formed == len(rows) else f", {n_formed} of {len(rows)}"
    return f"| `{rows[0]['case']}` | `{rows[0]['function']}` | {over('ratio', 3)} | {interval([row['ratio'] for row in rows])} | {over('median_latency_s', 1)} | {over('p95_latency_s', 1)} | {over('mean_current_ma', 1)} | {formed} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--auto", action="store_true", help="the cases without settings of the network")
    parser.add_argument("--cases", nargs="*", choices=[*CASES, *(case for case in AUTO if case not in CASES)], metavar="CASE")
    parser.add_argument("--function", nargs="*", choices=FUNCTIONS, default=["as-configured"], dest="functions")
    parser.add_argument("--set", action="append", default=[], dest="settings", metavar="KEY=VALUE")
    parser.add_argument("--journal", type=Path, required=True)
    asked = parser.parse_args()
    if asked.auto:
        asked.functions = ["auto"]
    asked.cases = asked.cases or list(AUTO if asked.auto else CASES)
    done = [json.loads(line) for line in asked.journal.read_text().splitlines()] if asked.journal.exists() else []
    done = [row for row in done if row["settings"] == asked.settings]
    known = {(row["case"], row["seed"], row["function"]) for row in done}
    wanted = [(case, seed, function) for seed in range(1, asked.seeds + 1) for function in asked.functions for case in asked.cases]
    todo = [one for one in wanted if one not in known]
    with concurrent.futures.ThreadPoolExecutor(asked.jobs) as pool:
        runs = [
            pool.submit(measure_automatic, case, seed, asked.settings) if asked.auto else pool.submit(measure, case, seed, function, asked.settings)
            for case, seed, function in todo
        ]
        for run in concurrent.futures.as_completed(runs):
            done.append(run.result())
            with asked.journal.open("a") as journal:
                journal.write(json.dumps(run.result()) + "\n")
    for function in asked.functions:
        for case in asked.cases:
            rows = [row for row in done if (row["case"], row["function"]) == (case, function)]
            if rows:
                print(summary_automatic(rows) if asked.auto else summary(rows))


if __name__ == "__main__":
    main()
