"""The JSON Schema of an experiment, by a validator that knows JSON Schema and not us."""

import copy
import json
import tomllib

import pytest
from conftest import ROOT, program, succeed
from jsonschema_rs import Draft202012Validator, meta

ANSWERS = ["check", "compare", "compare-runs", "convert", "diagnose", "extend", "power", "run", "simulate", "sweep", "verify"]
CONFIGS = sorted((ROOT / "configs").glob("**/*.toml"))


@pytest.fixture(scope="session")
def schema():
    return json.loads(succeed([program("murmuration"), "schema"]))


def read(path):
    return tomllib.loads(path.read_text())


def test_there_are_experiments_to_check():
    assert ROOT / "configs" / "flocking.toml" in CONFIGS
    assert ROOT / "configs" / "external-robots.toml" in CONFIGS


def test_the_schema_is_a_valid_one_of_draft_2020_12(schema):
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    meta.validate(schema)


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.name)
def test_every_ready_experiment_satisfies_the_schema(schema, path):
    problems = [
        f"{'.'.join(map(str, error.instance_path))}: {error.message}"
        for error in Draft202012Validator(schema).iter_errors(read(path))
    ]
    assert problems == []


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.name)
def test_the_program_accepts_every_ready_experiment(path):
    succeed([program("murmuration"), "check", path], cwd=ROOT)


@pytest.mark.parametrize(
    ("section", "key", "value"),
    [
        ("experiment", "sede", 1),
        ("experiment", "seed", -1),
        ("experiment", "seed", "one"),
        ("experiment", "duration_s", -2.0),
        ("experiment", "duration_s", True),
    ],
)
def test_schema_and_program_refuse_the_same_mistakes(schema, tmp_path, section, key, value):
    # Guards the tests above: a schema that allows everything would pass them.
    config = copy.deepcopy(read(ROOT / "configs/flocking.toml"))
    config[section][key] = value
    assert not Draft202012Validator(schema).is_valid(config), f"the schema accepts {section}.{key} = {value!r}"
    assignment = f"{section}.{key}={json.dumps(value)}"
    with pytest.raises(AssertionError, match="exit status 2"):
        succeed([program("murmuration"), "check", "configs/flocking.toml", "--set", assignment], cwd=ROOT)


def test_the_schema_explains_every_key(schema):
    # A key without a description is of no use to somebody whose editor shows the schema.
    silent = []

    def walk(node, path):
        if isinstance(node, dict):
            for key, child in node.get("properties", {}).items():
                if not explained(schema, child):
                    silent.append(f"{path}.{key}")
            for key, child in node.items():
                walk(child, f"{path}.{key}")
        elif isinstance(node, list):
            for index, child in enumerate(node):
                walk(child, f"{path}[{index}]")

    walk(schema, "")
    assert silent == []


@pytest.mark.parametrize("name", ANSWERS)
def test_the_schema_of_every_answer_is_a_valid_one_of_draft_2020_12(name):
    answer = json.loads(succeed([program("murmuration"), "schema", "--of", name]))
    assert answer["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    meta.validate(answer)
    # A schema that allows everything would be valid, too.
    assert not Draft202012Validator(answer).is_valid({})


@pytest.mark.parametrize("name", ["flocking", "sensors-minimal"])
def test_the_summary_of_a_run_satisfies_its_schema(result_of, name):
    answer = json.loads(succeed([program("murmuration"), "schema", "--of", "run"]))
    Draft202012Validator(answer).validate(json.loads((result_of(name) / "summary.json").read_text()))


def explained(schema, node):
    """Whether a key says what it is: itself, where it refers to, or each of the forms that it may have."""
    forms = node.get("anyOf") or node.get("oneOf")
    return bool(
        node.get("description")
        or resolve(schema, node).get("description")
        or "const" in node
        or (forms and all(explained(schema, form) for form in forms))
    )


def resolve(schema, node):
    """The node that a local `$ref` points to."""
    while "$ref" in node:
        target = schema
        for part in node["$ref"].removeprefix("#/").split("/"):
            target = target[part]
        node = target
    return node
