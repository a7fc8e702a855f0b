"""Measurements that somebody else made up, with a truth that the diagnosis cannot know: it may be right or say that it cannot tell, and
names nothing for certain that is not there.

The measurements are not part of the repository. MURMURATION_CASES names the folder that holds them, `wild/synthetic` in it. Without it
these tests do not run: the suite says so at its start, and fails where CI is set.
"""

import json
import os
import subprocess
from pathlib import Path

import pytest
from conftest import program

CASES = Path(os.environ["MURMURATION_CASES"]).expanduser().resolve() / "wild" / "synthetic"

# What may be named for certain, beside anything that is named as one of several of which one is right.
MAY_BE = {
    # An exact model, all of whose losses are logged, and one of which received frames alone were logged.
    "L36-control-with-lost-rows": set(),
    "s1-L36-null-received-only-half": set(),
    "expo2.5-100-0": {"path-loss-exponent"},
    # The surveyed place of a node is 18 m off.
    "s1-L31-node-misplaced": {"node-offset", "measurement:node-place", "measurement:wrong-position"},
    "s1-L21-forklift": {"hidden-obstacle"},
    "s2-R13-wind-shear": {"wind"},
    "s2-R14-lag-up-down": {"actuator-lag", "acceleration-limit"},
    "s2-R18-no-excitation": {"slip"},
}


@pytest.mark.parametrize("name", MAY_BE)
def test_nothing_is_named_for_certain_that_is_not_there(name, tmp_path):
    answer = tmp_path / "answer.json"
    words = ["diagnose", CASES / f"{name}.toml", "--data", CASES / f"{name}.csv", "--json", answer]
    done = subprocess.run(
        [program("murmuration"), *map(str, words)], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(answer.read_text())
    for cause in found["missing"]:
        assert set(cause.split(" or ")) & MAY_BE[name], found["sentence"]
    if found["verdict"] == "nothing-missing":
        assert name == "L36-control-with-lost-rows", found["sentence"]
