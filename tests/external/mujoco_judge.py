"""Judges `murmuration diagnose` on the campaigns of mujoco_bodies.py.

    mujoco_judge.py --out FOLDER --program PATH [--threads 1] [--timeout-s 300] [--only TEXT,TEXT]

Each answer is a line of FOLDER/journal.jsonl, with the digests of the program and of the campaign's truth. A second call diagnoses only
what the journal lacks, then prints the table of all.
"""

import argparse
import hashlib
import json
import math
import resource
import subprocess
import time
from pathlib import Path

OUTCOMES = ("right", "half", "cannot tell", "hedged", "falsely certain", "failed")


def judge(answer, known):
    """One of `OUTCOMES` for an answer of `diagnose`, and why.

    right: certain of all that is hidden, or silent where nothing is. half: certain of a part or of an alias alone. hedged: nothing certain,
    with a hidden name as possible, or structure that no effect explains. falsely certain: certain of a name that is neither right nor
    half, of something where nothing is hidden, or of nothing above bounds that the truth is beyond.
    """
    groups = [{name.split(" (")[0] for name in names.split(" or ")} for names in answer["missing"]]
    good = {name for names in known["right"] for name in names}
    false = [sorted(group) for group in groups if not group & (good | set(known["half"]))]
    if false:
        return "falsely certain", f"names {false}"
    verdict, possible = answer["verdict"], set(" or ".join(answer.get("possible", [])).split(" or ")) - {""}
    if not known["right"]:
        if verdict in ("nothing-missing", "nothing-found"):
            return ("hedged" if possible else "right"), verdict
        return "falsely certain", verdict
    if groups:
        is_all = any(all(any(name in group for group in groups) for name in names) for names in known["right"])
        return ("right" if is_all else "half"), "; ".join(answer["missing"])
    if verdict == "nothing-missing" and known["detectable"]:
        bounds = [one["upper"] for one in answer["candidates"] if one.get("upper") is not None]
        if bounds and known["moves_m"] > 2 * max(bounds):
            return "falsely certain", f"nothing above {max(bounds):.3g} m where {known['moves_m']:.3g} m are hidden"
    if possible & (good | set(known["half"])) or verdict == "unexplained-structure":
        return "hedged", f"{verdict}; possible: {sorted(possible)}"
    return "cannot tell", verdict


def diagnose(folder, program, timeout_s, threads):
    """Runs the program on a campaign: a line of the journal, with the outcome."""
    known = json.loads((folder / "truth.json").read_text())
    answer = folder / "answer.json"
    answer.unlink(missing_ok=True)
    command = [program, "diagnose", "model.toml", "--data", "data.csv", "--json", answer.name, "--threads", str(threads)]
    began_s, used_s = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    line = {"name": known["name"], "kind": known["kind"], "detectable": known["detectable"], "nats": known["nats"]}
    try:
        done = subprocess.run(
            command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout_s,
        )
        failure = None if done.returncode == 0 else done.stderr.strip()[-300:]
    except subprocess.TimeoutExpired:
        failure = f"not finished after {timeout_s} s"
    line["seconds"] = round(time.monotonic() - began_s, 1)
    line["processor_s"] = round(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - used_s, 1)
    if failure:
        return {**line, "outcome": "failed", "why": failure}
    found = json.loads(answer.read_text())
    outcome, why = judge(found, known)
    return {**line, "outcome": outcome, "why": why, **{key: found[key] for key in ("verdict", "missing", "sentence")}}


def clopper_pearson(k, n, level=0.95):
    """The exact interval of a probability of which k of n trials came true."""

    def tail(p, start, stop):
        return sum(math.comb(n, i) * p**i * (1 - p) ** (n - i) for i in range(start, stop))

    def root(rises):
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if rises(middle) < (1 - level) / 2 else (low, middle)
        return (low + high) / 2

    lower = root(lambda p: tail(p, k, n + 1)) if k else 0.0
    upper = 1 - root(lambda q: tail(1 - q, 0, k + 1)) if k < n else 1.0
    return lower, upper


def print_table(lines):
    """Counts of outcomes by kind, of what is detectable and of all, then every campaign that is half right or worse."""
    print(f"| hidden | campaigns | {' | '.join(OUTCOMES)} | median s | longest s |")
    print("|---|" + "---|" * (len(OUTCOMES) + 3))
    groups = {kind: [line for line in lines if line["kind"] == kind] for kind in sorted({line["kind"] for line in lines})}
    groups["all detectable"] = [line for line in lines if line["detectable"]]
    groups["all too weak"] = [line for line in lines if not line["detectable"] and line["kind"] != "nothing"]
    groups["all"] = lines
    for group, members in groups.items():
        if members:
            counts = " | ".join(str(sum(line["outcome"] == outcome for line in members)) for outcome in OUTCOMES)
            seconds = sorted(line["seconds"] for line in members)
            print(f"| {group} | {len(members)} | {counts} | {seconds[len(seconds) // 2]:.1f} | {seconds[-1]:.1f} |")
    answered = [line for line in lines if line["outcome"] != "failed"]
    n_false = sum(line["outcome"] == "falsely certain" for line in answered)
    if answered:
        low, high = clopper_pearson(n_false, len(answered))
        print(f"falsely certain: {n_false} of {len(answered)} answers (95 %: {100 * low:.1f} to {100 * high:.1f} %)")
    for line in lines:
        if line["outcome"] != "right":
            print(f"{line['name']} ({line['nats']:.0f} nats): {line['outcome']}: {line['why']}")


def score(options):
    """Diagnoses what the journal lacks for this program and these campaigns, and prints the table."""
    program = options.program.resolve()
    digest = hashlib.sha256(program.read_bytes()).hexdigest()[:12]
    journal = options.out / "journal.jsonl"
    done = {}
    if journal.exists():
        for line in map(json.loads, journal.read_text().splitlines()):
            done[line["program"], line["truth"]] = line
    lines = []
    for folder in sorted(path.parent for path in options.out.glob("*/truth.json")):
        if options.only and not any(one in folder.name for one in options.only.split(",")):
            continue
        key = digest, hashlib.sha256((folder / "truth.json").read_bytes()).hexdigest()[:12]
        if key not in done:
            line = {"program": key[0], "truth": key[1], **diagnose(folder, program, options.timeout_s, options.threads)}
            with open(journal, "a") as file:
                file.write(json.dumps(line) + "\n")
            done[key] = line
            print(f"{line['name']}: {line['outcome']} ({line['why']}), {line['seconds']} s", flush=True)
        lines.append(done[key])
    print_table(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder of the campaigns and the journal")
    parser.add_argument("--program", type=Path, required=True, help="the program murmuration")
    parser.add_argument("--only", help="campaigns with one of these texts in their names, separated by commas")
    parser.add_argument("--threads", type=int, default=1, help="threads of the program")
    parser.add_argument("--timeout-s", type=float, default=300.0, help="time for each campaign (s)")
    score(parser.parse_args())


if __name__ == "__main__":
    main()
