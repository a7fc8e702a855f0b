"""Diagnoses campaigns whose robots were simulated by MuJoCo, each with three hidden effects, and counts what is named.

    mujoco_loop.py --out FOLDER [--seeds 1-20] [--robots rover,platform] [--models built-in,truth,nominal]

Each campaign is diagnosed against the built-in unicycle or point mass, against MuJoCo with what is hidden, and against MuJoCo
without it (both served by mujoco_truth.py). Every answer is kept in FOLDER; a second call goes on where the first one ended. At
its end the tables of docs/validation.md are printed, of all campaigns in FOLDER.
"""

import argparse
import json
import sys
from collections import Counter
from pathlib import Path

from conftest import program, succeed
from hosts import Server
from mujoco_truth import Truth, drawn, tracks

# What every one of these robots has, hidden or not: motors with inertia, and tyres that creep outwards in turns (-0.0117 s times
# speed times yaw rate, read from the state of MuJoCo).
OWN = {"rover": {"actuator-lag", "actuator-lag (turn)", "yaw-coupling"}, "platform": {"actuator-lag"}}
BODY = {"rover": "unicycle", "platform": "point-mass"}
MODELS = ("built-in", "truth", "nominal")
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


def answered(folder, model):
    """The complete answer that an earlier call left, or `None`."""
    path = folder / f"{model}.json"
    answer = json.loads(path.read_text()) if path.exists() else {"complete": False}
    return answer if answer["complete"] else None


def diagnosed(folder, model, *more):
    """The answer of `diagnose` to the campaign in a folder, that of an earlier call if there is one."""
    if answered(folder, model) is None:
        command = [program("murmuration"), "diagnose", f"{model}.toml", "--data", "data.csv", "--json", f"{model}.json", *more]
        succeed(command, deadline_s=DEADLINE_S, cwd=folder)
    return json.loads((folder / f"{model}.json").read_text())


def judged(answer, truth, own):
    """What an answer names.

    `right`: effects that say a hidden cause, or one of `own`. `tied`: others that the answer lists as indistinguishable from such
    an effect. `wrong`: all others. `missed`: hidden causes of the catalogue that nothing says which is named or possible. `structure`: covariates
    of unexplained structure.
    """
    says = own.union(*truth.names.values())
    ties = {one["effect"]: set(one["indistinguishable_from"]) for one in answer["candidates"] if one["accepted"]}
    found = {"right": [], "tied": [], "wrong": []}
    for names in answer["missing"]:
        name = names.split(" or ")[0]
        kind = "right" if name in says else "tied" if ties.get(name, set()) & says else "wrong"
        found[kind].append(name)
    named = set(found["right"]).union(*(ties[name] for name in found["tied"]))
    named.update(" or ".join(answer.get("possible", [])).split(" or "))
    missed = [key for key, names in truth.names.items() if key != truth.outside and not names & named]
    structure = [one["covariate"] for one in answer["unexplained"]]
    told = {key: answer[key] for key in ("verdict", "sentence", "misfits")}
    return {**told, **found, "missed": missed, "structure": structure}


OUTCOMES = ("all found", "some found", "cannot tell", "uncertain", "falsely certain")


def outcome(found):
    """Of a campaign with something hidden: one of `OUTCOMES`.

    "all found" and "some found" are of the causes in the catalogue, with nothing wrong named. With a wrong name an answer is
    uncertain if it also reports structure or errors that no effect explains, and falsely certain otherwise.
    """
    if found["wrong"]:
        is_open = found["structure"] or found["verdict"] != "missing-effects" or found["misfits"]
        return "uncertain" if is_open else "falsely certain"
    if not found["missed"]:
        return "all found"
    return "some found" if found["right"] or found["tied"] else "cannot tell"


def read(folder):
    """What was found in the campaigns of a folder, by robot and seed."""
    lines = []
    for robot, own in OWN.items():
        places = sorted(folder.glob(f"{robot}-*"), key=lambda place: int(place.name.rsplit("-")[-1]))
        for place in places:
            truth = drawn(robot, int(place.name.rsplit("-")[-1]))
            line = {"robot": robot, "name": place.name, "hidden": truth.hidden, "outside": truth.outside}
            for model in MODELS:
                answer = answered(place, model)
                if answer:
                    line[model] = judged(answer, truth, own if model == "built-in" else set())
            lines.append(line)
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", default="1-20")
    parser.add_argument("--robots", default="rover,platform")
    parser.add_argument("--models", default=",".join(MODELS))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    first, last = map(int, options.seeds.split("-"))
    with served(options.out / "server.log") as server:
        for seed in range(first, last + 1):
            for robot in options.robots.split(","):
                folder = options.out / f"{robot}-{seed}"
                folder.mkdir(exist_ok=True)
                write(folder, drawn(robot, seed), seed)
                for model in options.models.split(","):
                    diagnosed(folder, model, *(() if model == "built-in" else ("--robotsim", f"http://{server.address}")))
    print_tables(read(options.out))


def print_tables(lines):
    """Counts of outcomes, by robot and model, and each campaign with what was named."""
    print(f"| robot | held against | campaigns | {' | '.join(OUTCOMES)} |")
    print("|---|---|---|" + "---|" * len(OUTCOMES))
    for robot in OWN:
        for model in ("built-in", "nominal"):
            found = [outcome(line[model]) for line in lines if line["robot"] == robot and model in line]
            cells = " | ".join(str(found.count(kind)) for kind in OUTCOMES)
            print(f"| {robot} | {model} | {len(found)} | {cells} |")
        structure = [bool(line["built-in"]["structure"]) for line in lines if line["robot"] == robot and "built-in" in line]
        print(f"{robot}, built-in: structure reported in {sum(structure)} of {len(structure)}")
        verdicts = Counter(line["truth"]["verdict"] for line in lines if line["robot"] == robot and "truth" in line)
        print(f"{robot}, held against the truth: {dict(verdicts)}")
    for line in lines:
        hidden = ", ".join(f"{key} {size}" for key, size in line["hidden"].items())
        print(f"{line['name']} ({hidden}; outside: {line['outside']})")
        for model in MODELS:
            if model in line:
                found = line[model]
                print(f"  {model}: {outcome(found) if model != 'truth' else ''}; wrong {found['wrong']}: {found['sentence']}")


if __name__ == "__main__":
    main()
