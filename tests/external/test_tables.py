"""The Parquet tables through pyarrow, against docs/outputs.md and against run.mcap."""

import math
import re

import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from conftest import ROOT
from recording import by_topic, heard_by

TABLES = ("steps", "links", "packets", "motes")


@pytest.fixture(scope="module")
def tables(flocking):
    return {path.stem: pq.read_table(path) for path in flocking.glob("*.parquet")}


@pytest.fixture(scope="module")
def topics(flocking):
    return by_topic(flocking / "run.mcap")


def dictionary():
    """Columns by table, from the data dictionary: the first cell of each row below the heading that names the file."""
    columns, table = {}, None
    for line in (ROOT / "docs/outputs.md").read_text().splitlines():
        if line.startswith("#"):
            found = re.search(r"`?(\w+)\.parquet`?", line)
            table = found and found[1]
        elif table and (cell := re.match(r"\|\s*((?:`\w+`[, ]*)+)\s*\|", line)):
            columns.setdefault(table, []).extend(re.findall(r"`(\w+)`", cell[1]))
    return columns


def test_the_tables_have_the_columns_of_the_data_dictionary_in_its_order(tables):
    documented = dictionary()
    assert set(documented) == set(TABLES)
    assert set(tables) <= set(TABLES) and "steps" in tables
    for name, table in tables.items():
        assert table.column_names == documented[name], name


def test_no_number_is_nan_or_infinite(tables):
    for name, table in tables.items():
        for column in table.column_names:
            if str(table[column].type) in ("float", "double"):
                finite = pc.all(pc.is_finite(table[column])).as_py()
                assert finite is not False, f"{name}.{column}"


def test_steps_holds_every_agent_at_every_step_where_the_recording_puts_it(tables, topics):
    table = tables["steps"]
    messages = [entry.message for entry in topics["/robotsim/step"]]
    n = topics["/netsim/configure/request"][0].message.agent_count
    assert table.num_rows == n * len(messages)
    assert table["agent"].to_pylist() == list(range(n)) * len(messages)
    assert table["step"].to_pylist() == [m.step for m in messages for _ in range(n)]
    assert table["time_ns"].to_pylist() == [m.time_ns for m in messages for _ in range(n)]
    for column in ("x_m", "y_m", "z_m"):
        recorded = [value for m in messages for value in getattr(m.states, column)]
        assert table[column].to_pylist() == recorded, column


def test_what_each_agent_heard_is_what_was_delivered(tables, topics):
    n = topics["/netsim/configure/request"][0].message.agent_count
    heard = [
        len(heard_by(entry.message.deliveries, agent, n))
        for entry in topics["/netsim/step"]
        for agent in range(n)
    ]
    assert tables["steps"]["n_heard"].to_pylist() == heard


def test_packets_holds_every_transmission_with_its_receivers(tables, topics):
    n = topics["/netsim/configure/request"][0].message.agent_count
    expected = []
    for entry in topics["/netsim/step"]:
        deliveries = entry.message.deliveries
        receivers = [0] * len(deliveries.transmissions.sender)
        for agent in range(n):
            for index in heard_by(deliveries, agent, n):
                receivers[index] += 1
        expected += zip(deliveries.transmissions.sender, receivers, strict=True)
    table = tables["packets"]
    assert list(zip(table["sender"].to_pylist(), table["n_receivers"].to_pylist(), strict=True)) == expected


def test_links_marked_received_are_the_deliveries_at_the_distance_of_the_states(tables, topics):
    n = topics["/netsim/configure/request"][0].message.agent_count
    states = {entry.message.step: entry.message.states for entry in topics["/robotsim/step"]}
    expected = []
    for entry in topics["/netsim/step"]:
        deliveries = entry.message.deliveries
        for receiver in range(n):
            for index in heard_by(deliveries, receiver, n):
                expected.append((entry.message.step, deliveries.transmissions.sender[index], receiver))
    rows = tables["links"].to_pylist()
    received = [row for row in rows if row["received"]]
    found = [(row["step"], row["sender"], row["receiver"]) for row in received]
    assert sorted(found) == sorted(expected)
    for row in received:
        at = states[row["step"]]
        a, b = ((at.x_m[i], at.y_m[i], at.z_m[i]) for i in (row["sender"], row["receiver"]))
        # Two ways to add three squares in f64 differ by a few units in the last place.
        assert math.isclose(row["distance_m"], math.dist(a, b), rel_tol=1e-12, abs_tol=1e-12)


def test_tables_do_not_say_who_wrote_them_when(flocking):
    # Part of the promise of byte identity: no version, host or time in the files' metadata.
    for path in flocking.glob("*.parquet"):
        metadata = pq.read_metadata(path)
        assert re.fullmatch(r"[a-z]+", metadata.created_by), metadata.created_by
        assert not metadata.metadata, metadata.metadata
