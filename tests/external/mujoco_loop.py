"""Diagnoses campaigns whose robots were simulated by MuJoCo, each with three hidden effects, and counts what is named.

    mujoco_loop.py --out FOLDER [--seeds 20] [--robots rover,platform]

Each campaign is diagnosed three times: against the built-in unicycle or point mass, against MuJoCo without what is hidden, and
against MuJoCo with it (both served by mujoco_truth.py). FOLDER/found.jsonl has a line per campaign, written when it is done; a
second call goes on where the first one ended. At its end the table of docs/validation.md is printed.
"""

import argparse
import json
import sys
import time
from collections import Counter
from pathlib import Path

from conftest import program, succeed
from hosts import Server
from mujoco_truth import Truth, drawn, tracks

# What every one of these robots has, hidden or not: motors with inertia, and tyres that creep outwards in turns (-0.0117 s times
# speed times yaw rate, read from the state of MuJoCo).
OWN = {"rover": {"actuator-lag", "actuator-lag (turn)", "yaw-coupling"}, "platform": {"actuator-lag"}}
BODY = {"rover": "unicycle", "platform": "point-mass"}
# Longest time that a diagnosis may take (s), on a machine that does other work, too.
DEADLINE_S = 3000


def served(log):
    """The robots of mujoco_truth.py, to be started."""
    return Server([sys.executable, Path(__file__).parent / "mujoco_truth.py", "127.0.0.1:0"], log, cwd="/")


def write(folder, truth, seed):
    """A campaign, and the configurations that it is held against."""
    (folder / "data.csv").write_text(tracks(truth, seed))
    (folder / "built-in.toml").write_text(f'[robotsim.dynamics]\nkind = "{BODY[truth.robot]}"\n')
    (folder / "nominal.toml").write_text(Truth(truth.robot, {}, {}, "").toml())
    (folder / "truth.toml").write_text(truth.toml())


def diagnosed(folder, model, *more):
    """The answer of `diagnose` to the campaign in a folder."""
    answer = f"{model}.json"
    command = [program("orchestrator"), "diagnose", f"{model}.toml", "--data", "data.csv", "--json", answer, *more]
    succeed(command, deadline_s=DEADLINE_S, cwd=folder)
    return json.loads((folder / answer).read_text())


def judged(answer, truth, own):
    """What an answer names.

    `right`: effects that say a hidden cause, or one of `own`. `tied`: others that the answer lists as indistinguishable from such
    an effect. `wrong`: all others. `missed`: hidden causes of the catalogue that nothing named says. `structure`: covariates of
    unexplained structure.
    """
    says = own.union(*truth.names.values())
    ties = {one["effect"]: set(one["indistinguishable_from"]) for one in answer["candidates"] if one["accepted"]}
    found = {"right": [], "tied": [], "wrong": []}
    for name in answer["missing"]:
        kind = "right" if name in says else "tied" if ties.get(name, set()) & says else "wrong"
        found[kind].append(name)
    named = set(found["right"]).union(*(ties.get(name, set()) for name in found["right"] + found["tied"]))
    missed = [key for key, names in truth.names.items() if key != truth.outside and not names & named]
    structure = [one["covariate"] for one in answer["unexplained"]]
    return {"verdict": answer["verdict"], **found, "missed": missed, "structure": structure, "sentence": answer["sentence"]}


def outcome(found):
    """Of a campaign with something hidden: "falsely certain", "all found", "some found" or "cannot tell"."""
    if found["wrong"]:
        return "falsely certain"
    if not found["missed"]:
        return "all found"
    return "some found" if found["right"] or found["tied"] else "cannot tell"


def campaign(robot, seed, folder, url):
    """Everything about one campaign."""
    truth = drawn(robot, seed)
    write(folder, truth, seed)
    found = {"robot": robot, "seed": seed, "hidden": truth.hidden, "outside": truth.outside}
    for model, own, more in (("built-in", OWN[robot], ()), ("truth", set(), ("--robotsim", url)), ("nominal", set(), ("--robotsim", url))):
        begun_s = time.monotonic()
        found[model] = judged(diagnosed(folder, model, *more), truth, own)
        found[model]["wall_s"] = round(time.monotonic() - begun_s, 1)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--robots", default="rover,platform")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    kept = options.out / "found.jsonl"
    lines = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    done = {(line["robot"], line["seed"]) for line in lines}
    with served(options.out / "server.log") as server:
        for seed in range(1, options.seeds + 1):
            for robot in options.robots.split(","):
                if (robot, seed) in done:
                    continue
                folder = options.out / f"{robot}-{seed}"
                folder.mkdir(exist_ok=True)
                lines.append(campaign(robot, seed, folder, f"http://{server.address}"))
                with kept.open("a") as file:
                    file.write(json.dumps(lines[-1]) + "\n")
    print_table(lines)


def print_table(lines):
    """Counts of outcomes, by robot and model, and every campaign in which something wrong was named."""
    print("| robot | held against | campaigns | all found | some found | cannot tell | falsely certain |")
    print("|---|---|---|---|---|---|---|")
    for robot in OWN:
        own = [line for line in lines if line["robot"] == robot]
        for model in ("built-in", "nominal"):
            counts = Counter(outcome(line[model]) for line in own)
            cells = " | ".join(str(counts[kind]) for kind in ("all found", "some found", "cannot tell", "falsely certain"))
            print(f"| {robot} | {model} | {len(own)} | {cells} |")
        quiet = sum(not line["truth"]["right"] + line["truth"]["tied"] + line["truth"]["wrong"] for line in own)
        clean = sum(line["truth"]["verdict"] in ("nothing-missing", "nothing-found") for line in own)
        print(f"{robot}, held against the truth: no effect named in {quiet} of {len(own)}, nothing significant at all in {clean}")
    for line in lines:
        for model in ("built-in", "nominal", "truth"):
            found = line[model]
            if found["wrong"] or (model == "truth" and found["verdict"] not in ("nothing-missing", "nothing-found")):
                print(f"{line['robot']} {line['seed']} {line['hidden']} {model}: {found['sentence']}")


if __name__ == "__main__":
    main()
