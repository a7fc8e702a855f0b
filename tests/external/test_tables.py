"""The Parquet tables through pyarrow, against docs/outputs.md and against run.mcap."""

import math
import re

import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from conftest import ROOT
from recording import by_topic, heard_by

# What docs/outputs.md calls a type, and what Arrow calls it.
ARROW_TYPES = {"u64": "uint64", "u32": "uint32", "bool": "bool", "f64": "double", "f32": "float", "text": "string"}


@pytest.fixture(scope="module")
def tables(flocking):
    return {path.stem: pq.read_table(path) for path in flocking.glob("*.parquet")}


@pytest.fixture(scope="module")
def topics(flocking):
    return by_topic(flocking / "run.mcap")


@pytest.fixture(scope="module")
def agent_count(topics):
    return topics["/netsim/configure/request"][0].message.agent_count


def dictionary():
    """By table: name, type and null rule of each column, from the data dictionary."""
    columns, table = {}, None
    for line in (ROOT / "docs/outputs.md").read_text().splitlines():
        if line.startswith("#"):
            found = re.fullmatch(r"#+ `(\w+)\.parquet`", line)
            table = found and found[1]
        elif table and line.startswith("| `"):
            name, kind, _, null_when = (cell.strip() for cell in line.strip("|").split("|"))
            columns.setdefault(table, []).append((name.strip("`"), ARROW_TYPES[kind], null_when))
    return columns


def test_the_tables_have_the_columns_of_the_data_dictionary(tables):
    documented = dictionary()
    # Without protocols there are no packets, schedules, neighbours and frames to record.
    assert set(tables) == {"steps", "links", "transmissions", "motes"}
    assert set(documented) == set(tables) | {"packets", "schedule", "neighbours", "frames"}
    for name, table in tables.items():
        found = [(field.name, str(field.type)) for field in table.schema]
        assert found == [(column, kind) for column, kind, _ in documented[name]], name
        for column, _, null_when in documented[name]:
            if null_when == "never":
                assert table[column].null_count == 0, f"{name}.{column}"


def test_no_number_is_nan_or_infinite(tables):
    for name, table in tables.items():
        for column in table.column_names:
            if str(table[column].type) in ("float", "double"):
                finite = pc.all(pc.is_finite(table[column])).as_py()
                assert finite is not False, f"{name}.{column}"


@pytest.fixture(scope="module")
def moments(topics):
    """(step, time in ns, states) of the beginning and of every step."""
    begin = topics["/robotsim/configure/response"][0].message.states
    steps = [(m.step, m.time_ns, m.states) for m in (entry.message for entry in topics["/robotsim/step"])]
    return [(0, 0, begin), *steps]


def test_steps_holds_every_agent_at_every_step_where_the_recording_puts_it(tables, agent_count, moments):
    table = tables["steps"]
    assert table["agent"].to_pylist() == list(range(agent_count)) * len(moments)
    assert table["step"].to_pylist() == [step for step, _, _ in moments for _ in range(agent_count)]
    assert table["time_ns"].to_pylist() == [time_ns for _, time_ns, _ in moments for _ in range(agent_count)]
    for column in ("x_m", "y_m", "z_m"):
        recorded = [value for _, _, states in moments for value in getattr(states, column)]
        assert table[column].to_pylist() == recorded, column
    alive = [bool(s.alive[i // 8] >> (i % 8) & 1) for _, _, s in moments for i in range(agent_count)]
    assert table["alive"].to_pylist() == alive


def test_what_each_agent_heard_is_what_was_delivered(tables, topics, agent_count):
    heard = [0] * agent_count
    for entry in topics["/netsim/step"]:
        deliveries = entry.message.deliveries
        for agent in range(agent_count):
            indices = heard_by(deliveries, agent, agent_count)
            heard.append(len({deliveries.transmissions.sender[index] for index in indices}))
    assert tables["steps"]["n_heard"].to_pylist() == heard


def test_motes_holds_every_mote_at_every_step(tables, agent_count, moments):
    rows = [(step, time_ns, mote) for step, time_ns, _ in moments for mote in range(agent_count)]
    table = tables["motes"]
    columns = (table[name].to_pylist() for name in ("step", "time_ns", "mote"))
    assert list(zip(*columns, strict=True)) == rows


def test_transmissions_holds_every_transmission_with_its_receivers(tables, topics, agent_count):
    expected = []
    for entry in topics["/netsim/step"]:
        deliveries = entry.message.deliveries
        sent = deliveries.transmissions
        receivers = [0] * len(sent.sender)
        for agent in range(agent_count):
            for index in heard_by(deliveries, agent, agent_count):
                receivers[index] += 1
        steps = [entry.message.step] * len(sent.sender)
        everyone = 0xFFFF_FFFF
        destinations = [None if agent == everyone else agent for agent in sent.destination] or [None] * len(sent.sender)
        expected += zip(
            steps,
            sent.sender,
            sent.sent_ns,
            sent.end_ns,
            sent.payloads.length_bytes,
            receivers,
            destinations,
            strict=True,
        )
    names = ("step", "sender", "sent_ns", "end_ns", "payload_bytes", "n_receivers", "destination")
    columns = (tables["transmissions"][name].to_pylist() for name in names)
    assert list(zip(*columns, strict=True)) == expected


def test_links_are_the_deliveries_at_the_distance_of_the_states(tables, topics, agent_count):
    states = {entry.message.step: entry.message.states for entry in topics["/robotsim/step"]}
    expected = []
    for entry in topics["/netsim/step"]:
        deliveries = entry.message.deliveries
        for receiver in range(agent_count):
            for index in heard_by(deliveries, receiver, agent_count):
                expected.append((entry.message.step, deliveries.transmissions.sender[index], receiver))
    rows = [row for row in tables["links"].to_pylist() if row["received"]]
    assert sorted((row["step"], row["sender"], row["receiver"]) for row in rows) == sorted(expected)
    for row in rows:
        at = states[row["step"]]
        ends = ([getattr(at, axis)[row[end]] for axis in ("x_m", "y_m", "z_m")] for end in ("sender", "receiver"))
        # Two ways to add three squares in f64 differ by a few units in the last place.
        assert math.isclose(row["distance_m"], math.dist(*ends), rel_tol=1e-12, abs_tol=1e-12)
        assert row["sent_ns"] < row["received_ns"] <= row["time_ns"]


def test_signal_strength_falls_with_distance_and_is_there_for_every_delivery(tables):
    links = tables["links"].filter(tables["links"]["received"])
    assert links["rssi_dbm"].null_count == 0
    near = pc.mean(links.filter(pc.less(links["distance_m"], 2))["rssi_dbm"]).as_py()
    far = pc.mean(links.filter(pc.greater(links["distance_m"], 8))["rssi_dbm"]).as_py()
    # Free space takes 12 dB from 2 to 8 m. Up to half of it may be made up for: of the far ones, the strong are heard.
    assert near > far + 6


def test_tables_do_not_say_who_wrote_them_or_when(flocking):
    # Part of the promise of byte identity: no version, host or time in the files' metadata.
    for path in flocking.glob("*.parquet"):
        metadata = pq.read_metadata(path)
        assert re.fullmatch(r"[A-Za-z]+", metadata.created_by), metadata.created_by
        assert not metadata.metadata, metadata.metadata
