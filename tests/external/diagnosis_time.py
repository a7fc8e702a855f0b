"""Measures how much processor time `murmuration diagnose` takes, by kind and size of the measurements. Not a test.

    diagnosis_time.py --program PATH [--out FOLDER] [--only TEXT,TEXT] [--most-s 300] [-- OPTION ...]

Each campaign has one or two effects hidden, from equations of its own. The options after `--` are passed to `diagnose`. The table has
processor times of one thread, and what was found.
"""

import argparse
import csv
import json
import math
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import halved_campaigns as campaigns

HOLONOMIC = ["time_s", "run", "agent", "x_m", "y_m", "cmd_vx_mps", "cmd_vy_mps"]
FLYERS = ["time_s", "run", "agent", "x_m", "y_m", "z_m", "cmd_ax_mps2", "cmd_ay_mps2", "cmd_az_mps2"]
N_RUNS = campaigns.N_RUNS
PARTS = 10


def runs(seed, n_rows, step_s, begin, move, row):
    """Rows of robots that move alone, a run each. `begin` gives the state of a robot, `move` takes it on by a part of a step under a command
    that is drawn anew every 1.6 s, and `row` measures it."""
    draws = random.Random(seed)
    rows = []
    for run in range(N_RUNS):
        state, command, until_s = begin(draws), None, 0.0
        for k in range(n_rows // N_RUNS):
            if until_s <= k * step_s:
                command, until_s = move(draws, state, None, 0.0), k * step_s + 1.6
            rows.append([f"{k * step_s:.2f}", run, 0, *(f"{value:.4f}" for value in row(draws, state, command))])
            for _ in range(PARTS):
                move(draws, state, command, step_s / PARTS)
    return rows


def holonomic(seed, n_rows):
    """Point masses whose velocity follows with a lag of 0.2 s, in a wind of 0.05 m/s."""

    def move(draws, state, command, part_s):
        if command is None:
            return [draws.uniform(-1, 1), draws.uniform(-1, 1)]
        for axis, wind_mps in enumerate((0.05, 0.0)):
            before = state[2 + axis]
            state[2 + axis] += (command[axis] - before) * (1 - math.exp(-part_s / 0.2))
            state[axis] += part_s * ((before + state[2 + axis]) / 2 + wind_mps)
        return command

    def row(draws, state, command):
        return [state[0] + draws.gauss(0, 0.01), state[1] + draws.gauss(0, 0.01), *command]

    model = '[robotsim.dynamics]\nkind = "point-mass"\n'
    begin = lambda draws: [draws.uniform(0, 20), draws.uniform(0, 20), 0.0, 0.0]
    return model, [HOLONOMIC, *runs(seed, n_rows, 0.2, begin, move, row)]


def flyers(seed, n_rows):
    """Bodies under commands of acceleration that steer them back to where they began, with a linear drag of 0.15 per second."""

    def move(draws, state, command, part_s):
        if command is None:
            home = [draws.uniform(-1.5, 1.5) - 0.3 * state[axis] - 0.6 * state[3 + axis] for axis in range(3)]
            return [max(-3.0, min(3.0, value)) for value in home]
        for axis in range(3):
            before = state[3 + axis]
            state[3 + axis] += part_s * (command[axis] - 0.15 * before)
            state[axis] += part_s * (before + state[3 + axis]) / 2
        return command

    def row(draws, state, command):
        return [*(state[axis] + (10.0 if axis == 2 else 0.0) + draws.gauss(0, 0.01) for axis in range(3)), *command]

    model = '[robotsim.dynamics]\nkind = "double-integrator"\n'
    return model, [FLYERS, *runs(seed, n_rows, 0.1, lambda draws: [0.0] * 6, move, row)]


def unicycles(seed, n_rows, lag_s=0.15):
    """Unicycles that execute 93 % of their speed, with a lag."""
    return campaigns.robots(seed, speed=0.93, lag_s=lag_s, n_steps=n_rows // N_RUNS)


def links(seed, n_rows):
    """Links between nodes that stand, whose path loss has an exponent of 2.3 in place of 2, and which depend on the temperature."""
    return campaigns.links(seed, exponent=2.3, db_per_c=-0.15, n_rows=n_rows)


def one_link(seed, n_rows):
    """One node that drives to and fro before another in half an hour, with a path loss exponent of 2.4 in place of 2."""
    draws = random.Random(seed)
    rows, fading_db = [], 0.0
    for k in range(n_rows):
        time_s = 1800 * k / n_rows
        x_m = 32 + 28 * math.sin(time_s / 40)
        keeps = math.exp(-1800 / n_rows / 2)
        fading_db = keeps * fading_db + math.sqrt(1 - keeps * keeps) * draws.gauss(0, 1.5)
        free_db = 20 * math.log10(4 * math.pi * 2405e6 / 299792458)
        dbm = -free_db - 24 * math.log10(math.hypot(x_m, 3.0)) + fading_db + draws.gauss(0, 1)
        received = draws.random() < campaigns.delivery(dbm)
        rows.append([f"{time_s:.3f}", 0, 1, 11, "0.000", "0.000", "1.000", f"{x_m:.3f}", "3.000", "1.000", round(dbm) if received else "",
                     int(received), "20.00"])
    return campaigns.LINK_MODEL, [campaigns.LINKS, *rows]


# Name, what makes it, rows.
KINDS = [
    ("links", links, (5000, 100_000, 1_000_000)),
    ("one link", one_link, (625, 10_000)),
    ("unicycles", unicycles, (1000, 10_000, 100_000)),
    ("holonomic", holonomic, (1000, 10_000, 100_000)),
    ("flyers", flyers, (1000, 10_000, 100_000)),
]
BETWEEN = ("between unicycles", 10_000)


def write(path, rows):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)


def measured(command, folder, most_s):
    """Processor and wall time (s) of a command, and whether it ended by itself."""
    began_s = time.monotonic()
    process = subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    is_over = False
    while True:
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            break
        if most_s < time.monotonic() - began_s and not is_over:
            process.kill()
            is_over = True
        time.sleep(0.02)
    if status and not is_over:
        sys.exit(f"{' '.join(command)}: {process.stderr.read()}")
    return usage.ru_utime + usage.ru_stime, time.monotonic() - began_s, not is_over


def said(answer):
    """What an answer names, in a few words."""
    names = answer.get("missing") or [change["effect"] for change in answer.get("changed", [])]
    possible = [one if isinstance(one, str) else one["effect"] for one in answer.get("possible", [])]
    doubted = f" (possible: {', '.join(possible)})" if possible else ""
    return f"{answer['verdict']}: {', '.join(names) or 'nothing named'}{doubted}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", required=True, type=Path)
    parser.add_argument("--out", default=Path("diagnosis-time"), type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--most-s", default=300.0, type=float)
    parser.add_argument("options", nargs="*")
    args = parser.parse_args()
    wanted = [text for text in args.only.split(",") if text]
    print("| kind | rows | processor time (s) | wall time (s) | answer |\n|---|---|---|---|---|", flush=True)
    every = [(f"{name} {n_rows}", make, n_rows) for name, make, sizes in KINDS for n_rows in sizes]
    for name, make, n_rows in [*every, (f"{BETWEEN[0]} {BETWEEN[1]}", None, BETWEEN[1])]:
        if wanted and not any(text in name for text in wanted):
            continue
        folder = args.out / name.replace(" ", "-")
        folder.mkdir(parents=True, exist_ok=True)
        program = [str(args.program.resolve()), "diagnose", "model.toml", "--threads", "1", "--json", "answer.json", *args.options]
        if make:
            model, rows = make(1, n_rows)
            write(folder / "data.csv", rows)
            program += ["--data", "data.csv"]
        else:
            for file, seed, lag_s in (("a.csv", 1, 0.15), ("b.csv", 2, 0.3)):
                model, rows = unicycles(seed, n_rows, lag_s)
                write(folder / file, rows)
            program += ["--between", "a.csv", "b.csv"]
        (folder / "model.toml").write_text(model)
        (folder / "answer.json").unlink(missing_ok=True)
        used_s, wall_s, is_done = measured(program, folder, args.most_s)
        answer = said(json.loads((folder / "answer.json").read_text())) if is_done else f"none within {args.most_s:.0f} s"
        print(f"| {name.rsplit(' ', 1)[0]} | {n_rows} | {used_s:.1f} | {wall_s:.1f} | {answer} |", flush=True)


if __name__ == "__main__":
    main()
