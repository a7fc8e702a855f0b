"""Draws pictures of docs/paper.md from what the sweeps of configs/paper leave.

    pip install matplotlib pandas pyarrow
    python docs/images/paper_figures.py runs docs/images [measured.csv.gz]

The first argument is the folder of the sweeps, the second is where pictures go. With a table of measured links as
docs/missing-physics.md describes it (columns distance_m and rssi_dbm) the third one adds them to the levels over distance.
"""

import math
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import pandas as pd

plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
AT_1_M_DBM = -40.19  # Friis at 1 m and 2.44 GHz, 0 dBm


def settings(folder):
    """The folders of kept runs, by the name of their case."""
    trials = pd.read_parquet(folder / "trials.parquet")
    firsts = trials.drop_duplicates("setting")
    runs = {}
    for row in firsts.itertuples():
        found = sorted((folder / "runs").glob(f"setting-{row.setting}-seed-*"))
        runs[row.case] = found[0]
    return runs


def links(folder, out):
    """Whom the robot in the middle reaches, under each model."""
    runs = settings(folder / "links")
    cases = ["line of sight", "unit disk, 10 m", "Friis - 40 dB", "experimental randomness"]
    figure, axes = plt.subplots(1, 4, figsize=(11, 3), sharex=True, sharey=True)
    for axis, case in zip(axes, cases):
        places = pd.read_parquet(runs[case] / "steps.parquet").query("step == 1")
        middle = (places.x_m.abs() + places.y_m.abs()).idxmin()
        me = places.loc[middle]
        heard = pd.read_parquet(runs[case] / "links.parquet").query("received")
        steps = heard.step.nunique()
        share = heard[heard.sender == me.agent].groupby("receiver").size() / steps
        for row in places.itertuples():
            part = share.get(row.agent, 0.0)
            if part > 0:
                axis.plot([me.x_m, row.x_m], [me.y_m, row.y_m], color="#2a78b8", lw=0.5, alpha=min(1, part))
        axis.scatter(places.x_m, places.y_m, s=3, color="0.5", zorder=2)
        axis.scatter([me.x_m], [me.y_m], s=18, color="#c43c3c", zorder=3)
        if case == "line of sight":
            axis.plot([-3, 6], [4, 4], color="black", lw=2)
            axis.add_patch(plt.Circle((-5, -3), 1, color="black"))
        axis.set_title(f"{case}: {len(share)} of {len(places) - 1}", fontsize=9)
        axis.set_aspect("equal")
        axis.set_xlabel("x (m)")
    axes[0].set_ylabel("y (m)")
    figure.tight_layout()
    figure.savefig(out / "paper-links.png", dpi=110)


def levels(folder, out, measured):
    """Received level over distance."""
    runs = settings(folder / "links")
    figure, axis = plt.subplots(figsize=(6, 3.6))
    drawn = pd.read_parquet(runs["experimental randomness"] / "links.parquet").query("received")
    drawn = drawn.drop_duplicates(["sender", "receiver"]).sample(4000, random_state=1)
    if measured:
        table = pd.read_csv(measured).sample(4000, random_state=1)
        axis.scatter(table.distance_m, table.rssi_dbm, s=2, color="#d08a2a", label="measured")
    axis.scatter(drawn.distance_m, drawn.rssi_dbm, s=2, color="#9bbbd8", label="experimental randomness, as received")
    distances = [0.3 * 1.05**k for k in range(100) if 0.3 * 1.05**k <= 40]
    friis = [AT_1_M_DBM - 20 * math.log10(distance) for distance in distances]
    axis.plot(distances, friis, color="#2a78b8", label="Friis")
    axis.plot(distances, [level - 40 for level in friis], color="#c43c3c", label="Friis − 40 dB")
    axis.axhline(-97, color="0.6", lw=0.8, ls=":")
    axis.set(xscale="log", xlabel="distance (m)", ylabel="received level (dBm)", xlim=(0.3, 60), ylim=(-105, -25))
    axis.legend(frameon=False, markerscale=4)
    figure.tight_layout()
    figure.savefig(out / "paper-levels.png", dpi=110)


def triptych(folder, out):
    """Beginning, middle and end of a line of 25 robots."""
    runs = settings(folder / "triptych")
    figure, axes = plt.subplots(2, 3, figsize=(8, 5.4), sharex=True, sharey=True)
    for row, case in zip(axes, ["experimental randomness", "unit disk, 3 m"]):
        steps = pd.read_parquet(runs[case] / "steps.parquet")
        last = steps.step.max()
        for axis, step in zip(row, [0, last // 3, last]):
            places = steps[steps.step == step]
            axis.scatter(places.x_m, places.y_m, s=12, color="#2a78b8")
            axis.set_title(f"{case}, step {step}", fontsize=9)
            axis.set_aspect("equal")
    for axis in axes[1]:
        axis.set_xlabel("x (m)")
    for axis in axes[:, 0]:
        axis.set_ylabel("y (m)")
    figure.tight_layout()
    figure.savefig(out / "paper-triptych.png", dpi=110)


def formation(folder, out):
    """Steps until done and error against the number of robots, at both densities."""
    figure, axes = plt.subplots(2, 2, figsize=(9, 6), sharex=True)
    names = {"formation-code-density": "0.22 per m²", "formation-paper-density": "5 per m²"}
    for column, (name, density) in enumerate(names.items()):
        trials = pd.read_parquet(folder / name / "trials.parquet")
        for case, rows in trials.groupby("case", sort=False):
            by_n = rows.groupby("experiment.agents")
            for axis, figure_name in zip(axes[:, column], ["task.completed_at_step", "task.line_residual_log10"]):
                spread = by_n[figure_name].quantile([0.25, 0.5, 0.75]).unstack()
                line = axis.plot(spread.index, spread[0.5], marker="o", ms=3, label=case)[0]
                axis.fill_between(spread.index, spread[0.25], spread[0.75], alpha=0.2, color=line.get_color(), lw=0)
        axes[0, column].set(title=density, yscale="log", xscale="log")
        axes[1, column].set(xlabel="robots")
    axes[0, 0].set_ylabel("steps until nobody moves")
    axes[1, 0].set_ylabel("log10 of the residual (m²)")
    axes[0, 0].legend(frameon=False, fontsize=7)
    figure.tight_layout()
    figure.savefig(out / "paper-formation.png", dpi=110)


def swarm_slots(folder, out):
    """Age of what is heard and flock speed against the number of robots, by schedule. Prints the table, too."""
    trials = pd.read_parquet(folder / "swarm-slots" / "trials.parquet")
    trials = trials[trials.case.str.endswith("following a leader")]
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4))
    for case, rows in trials.groupby("case", sort=False):
        name = case.split(",")[0]
        for axis, key in zip(axes, ["network.mean_age_s", "task.flock_speed_mps"]):
            by_n = rows.groupby("experiment.agents")[key]
            line = axis.plot(by_n.median(), marker="o", ms=4, label=name)[0]
            axis.plot(rows["experiment.agents"], rows[key], ".", ms=4, alpha=0.5, color=line.get_color())
        for n, of_n in rows.groupby("experiment.agents"):
            speeds = sorted(of_n["task.flock_speed_mps"])
            print(name, n, [f"{speed:.3g}" for speed in speeds])
    axes[1].axhline(0.1, ls=":", color="grey", lw=1)
    axes[0].set(xscale="log", yscale="log", xlabel="robots", ylabel="age of what is heard (s)")
    axes[1].set(xscale="log", xlabel="robots", ylabel="flock speed (m/s)", ylim=(0, None))
    axes[1].text(500, 0.1, "the leader's", ha="right", va="bottom", fontsize=7, color="grey")
    axes[0].legend(frameon=False)
    figure.tight_layout()
    figure.savefig(out / "swarm-slots.png", dpi=110)


def central_mote(folder, out):
    """What a radio that is dead for a while costs: the most central mote's, and another's. Every trial is a point."""
    trials = pd.read_parquet(folder / "central-mote" / "trials.parquet")
    dead = trials["timeline[1].at_s"] - 10.0
    keys = {
        "task.speed_along_leader_mps": "speed along the leader's way (m/s)",
        "task.leader_connected_ratio": "connected to the leader",
        "kpis.since_start.joined_ratio": "time in the network",
    }
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.4))
    times = sorted(dead.unique())
    for axis, (key, title) in zip(axes, keys.items()):
        undisturbed = trials[trials.case == "nobody's"][key].median()
        axis.axhline(undisturbed, color="0.6", lw=0.8, ls=":")
        axis.text(1, undisturbed, "nobody's", ha="center", va="bottom", fontsize=7, color="0.4")
        for case, color, side in [("the most central mote's radio", "#c43c3c", -1), ("another's radio", "#2a78b8", 1)]:
            for place, time in enumerate(times):
                values = trials[(trials.case == case) & (dead == time)][key]
                spread = [place + side * (0.08 + 0.2 * k / len(values)) for k in range(len(values))]
                axis.plot(spread, sorted(values), ".", ms=5, alpha=0.6, color=color)
                axis.plot([place + side * 0.05, place + side * 0.3], [values.median()] * 2, color=color, lw=1.5)
            axis.plot([], [], "o", ms=4, color=color, label=case)
        axis.set_xticks(range(len(times)), [f"{time:g}" for time in times])
        axis.set(xlabel="dead for (s)", title=title, ylim=(0, None))
    axes[0].legend(frameon=False, fontsize=7, loc="lower left")
    figure.tight_layout()
    figure.savefig(out / "paper-central-mote.png", dpi=110)


def transfer(folder, out):
    """Gains chosen under one model, used under another. Prints the table, too."""
    trials = pd.read_parquet(folder / "transfer" / "trials.parquet")
    gains = ["robotsim.controller.flock_radius_m", "robotsim.controller.collision_radius_m"]
    median = trials.groupby(["case", *gains], sort=False)[
        ["task.speed_along_leader_mps", "task.collisions", "task.leader_connected_ratio"]
    ].median()
    cases = list(trials.case.unique())
    chosen = {}
    for case in cases:
        of_case = median.loc[case]
        safe = of_case[of_case["task.collisions"] <= 50]
        chosen[case] = (safe if len(safe) else of_case)["task.speed_along_leader_mps"].idxmax()
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4))
    rows = []
    for tuned in cases:
        rows.append([median.loc[(used, *chosen[tuned])] for used in cases])
    for axis, key, title in [
        (axes[0], "task.speed_along_leader_mps", "speed along the leader's way (m/s)"),
        (axes[1], "task.collisions", "collisions"),
    ]:
        values = [[cell[key] for cell in row] for row in rows]
        shade = [[min(1, v / 7) if key.startswith("task.speed") else 1 - min(1, v / 50) for v in row] for row in values]
        axis.imshow(shade, cmap="RdYlGn", vmin=0, vmax=1, alpha=0.6)
        for y, row in enumerate(values):
            for x, value in enumerate(row):
                axis.text(x, y, f"{value:.3g}", ha="center", va="center")
        axis.set_xticks(range(len(cases)), cases, rotation=30, ha="right")
        axis.set_yticks(range(len(cases)), [f"{c}: {chosen[c][0]:g}, {chosen[c][1]:g} m" for c in cases])
        axis.set(xlabel="used under", title=title)
    axes[0].set_ylabel("tuned under: r_flock, r_c")
    figure.tight_layout()
    figure.savefig(out / "paper-transfer.png", dpi=110)
    for tuned, row in zip(cases, rows):
        cells = [f"{c['task.speed_along_leader_mps']:.3g}; {c['task.collisions']:.0f}; {c['task.leader_connected_ratio']:.3g}" for c in row]
        print("|", tuned, "|", "{:g}; {:g}".format(*chosen[tuned]), "|", " | ".join(cells), "|")


def main():
    folder, out = Path(sys.argv[1]), Path(sys.argv[2])
    measured = sys.argv[3] if len(sys.argv) > 3 else None
    draw = {
        "links": lambda: (links(folder, out), levels(folder, out, measured)),
        "triptych": lambda: triptych(folder, out),
        "formation-paper-density": lambda: formation(folder, out),
        "swarm-slots": lambda: swarm_slots(folder, out),
        "central-mote": lambda: central_mote(folder, out),
        "transfer": lambda: transfer(folder, out),
    }
    for name, picture in draw.items():
        if (folder / name / "trials.parquet").exists():
            picture()
        else:
            print(f"no {folder / name}: murmuration sweep configs/paper/{name}.toml makes it")


if __name__ == "__main__":
    main()
