"""Measurements in the page that shows a run: what it draws, against the answer and the residuals that the diagnosis wrote."""

import csv
import json
import math
import random
import subprocess

import page_session
import pytest
from conftest import program
from measured_links import HEADER, free_space_dbm, is_received, line
from page_session import opened, serving

N_ROWS = 4000
N_MOTES = 14
# Hidden from the model: a screen that costs 9 dB.
SCREEN = ((4.0, -14.0), (4.0, 14.0))
LOSS_DB = 9.0


@pytest.fixture(scope="module")
def browser():
    with page_session.browser() as started:
        yield started


def crosses(a, b):
    """Whether the way from a to b crosses the screen, which runs north."""
    (x, low), (_, high) = SCREEN
    if (a[0] - x) * (b[0] - x) >= 0:
        return False
    share = (x - a[0]) / (b[0] - a[0])
    return low <= a[1] + share * (b[1] - a[1]) <= high


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A diagnosis of links of which some cross a screen that the model does not know: the folder with its answer and residuals."""
    folder = tmp_path_factory.mktemp("measured")
    draw = random.Random(7)
    places = [(draw.uniform(-18, 22), draw.uniform(-14, 14)) for _ in range(N_MOTES)]
    lines = [f"{HEADER},battery_v"]
    for row in range(N_ROWS):
        tx, rx = draw.sample(range(N_MOTES), 2)
        ends = places[tx], places[rx]
        rssi = free_space_dbm(-5, *ends) - LOSS_DB * crosses(*ends) + draw.gauss(0, 2)
        received = is_received(draw, rssi)
        battery_v = f"{draw.uniform(2.9, 3.1):.3f}"
        lines.append(line(row, 2 * row, (tx, rx), ends, rssi, received, battery_v))
    (folder / "links.csv").write_text("\n".join(lines) + "\n")
    (folder / "model.toml").write_text('[netsim.phy]\npropagation = "friis"\ntx_power_dbm = -5.0\n')
    for command in ("diagnose", "compare"):
        subprocess.run(
            [
                program("murmuration"), command, folder / "model.toml", "--data", folder / "links.csv",
                "--json", folder / f"{command}.json", "--residuals", folder / f"{command}.csv",
            ],
            check=True,
            timeout=600,
        )  # fmt: skip
    return folder


def residuals(path):
    with path.open() as file:
        rows = list(csv.DictReader(file))
    number = lambda text: float(text) if text else math.nan
    return [{name: number(value) for name, value in row.items()} for row in rows]


def means_by_link(rows, column):
    """Rows and mean residual of each pair of motes."""
    found = {}
    for row in rows:
        if math.isfinite(row[column]):
            found.setdefault((min(row["tx"], row["rx"]), max(row["tx"], row["rx"])), []).append(row[column])
    return {pair: (len(values), sum(values) / len(values)) for pair, values in found.items()}


def assert_map(state, rows, column):
    want = means_by_link(rows, column)
    drawn = {(a, b): (count, mean) for a, b, count, mean in state["measured"]}
    assert drawn.keys() == want.keys()
    for pair, (count, mean) in want.items():
        assert drawn[pair][0] == count, pair
        assert drawn[pair][1] == pytest.approx(mean, abs=1e-4), pair


def test_residuals_are_measured_less_predicted(measured):
    rows = residuals(measured / "diagnose.csv")
    answer = json.loads((measured / "diagnose.json").read_text())
    assert len(rows) == answer["searched"]
    for row in rows:
        if math.isfinite(row["residual_db"]):
            assert row["residual_db"] == pytest.approx(row["measured_dbm"] - row["predicted_dbm"], abs=1e-9)
    # Links across the screen are weaker than predicted, by what it costs; with it they are not.
    def mean(column, across):
        inside = [row[column] for row in rows if math.isfinite(row[column]) and is_across(row) == across]
        return sum(inside) / len(inside)

    def is_across(row):
        return crosses((row["tx_x_m"], row["tx_y_m"]), (row["rx_x_m"], row["rx_y_m"]))

    assert mean("residual_db", True) < -0.7 * LOSS_DB
    assert abs(mean("residual_db", False)) < 1
    assert abs(mean("residual_with_effects_db", True)) < 1


def test_a_diagnosis_is_opened_and_a_bin_shows_its_links(browser, flocking, measured):
    rows = residuals(measured / "diagnose.csv")
    answer = json.loads((measured / "diagnose.json").read_text())
    assert answer["missing"] == ["hidden-obstacle"]
    arguments = ["--diagnosis", measured / "diagnose.json", "--residuals", measured / "diagnose.csv"]
    with serving("replay", flocking, *arguments) as (url, _), opened(browser, url) as session:
        session.press("Measurements")
        assert_map(session.wait("s.view === 'measurements' && s.measured.length > 0"), rows, "residual_db")
        session.picture("measurements")
        text = session.page.locator(".measurements").inner_text()
        assert answer["sentence"] in text and "links.csv" in text
        session.page.get_by_label("with what was found").check()
        assert_map(session.wait("s.measured.length > 0"), rows, "residual_with_effects_db")
        session.page.get_by_label("with what was found").uncheck()

        # Each bin, as the drawing says where it is, shows the links of the rows in its range, and of no others.
        chart = session.page.locator(".measurements .sketch")
        box = chart.bounding_box()
        seen = 0
        for y in range(20, int(box["height"]), 12):
            session.page.mouse.move(box["x"] + box["width"] * 0.4, box["y"] + y)
            tip = chart.locator(".tip")
            if not tip.is_visible() or " to " not in tip.inner_text():
                continue
            session.page.mouse.click(box["x"] + box["width"] * 0.4, box["y"] + y)
            state = session.wait("s.measured.length > 0")
            session.until("new URLSearchParams(location.hash.slice(1)).get('bin') !== null")
            status = session.page.locator(".measurements .status").inner_text()
            name, low, high = status.split(":")[0].replace(" to ", " ").split(" ")
            inside = [row for row in rows if float(low) * 0.998 - 0.01 <= row[name] <= float(high) * 1.002 + 0.01]
            assert {tuple(line[:2]) for line in state["measured"]} <= means_by_link(inside, "residual_db").keys()
            n_drawn = sum(line[2] for line in state["measured"])
            assert f": {n_drawn} rows on {len(state['measured'])} links, mean residual" in status and status.endswith(" dB")
            assert 0.8 * N_ROWS / 12 < n_drawn < 1.5 * N_ROWS / 12
            seen += 1
            session.picture("measurements-bin")
            session.page.keyboard.press("Escape")
            assert_map(session.wait("s.measured.length > 0"), rows, "residual_db")
            break
        assert seen == 1, "no bin answered to the pointer"
        svg = session.download("SVG").read_text()
        assert "Residual over" in svg and "Gain of each candidate" in svg
        assert "nat: the unit of natural logarithms" in svg


def test_a_page_by_itself_holds_a_comparison(browser, flocking, measured, tmp_path):
    page = tmp_path / "page.html"
    subprocess.run(
        [
            program("murmuration"), "replay", flocking, "--output", page,
            "--diagnosis", measured / "compare.json", "--residuals", measured / "compare.csv",
        ],
        check=True,
        timeout=60,
    )  # fmt: skip
    with opened(browser, page.as_uri(), dark=True) as session:
        session.press("Measurements")
        assert_map(session.wait("s.measured.length > 0"), residuals(measured / "compare.csv"), "residual_db")
        session.picture("measurements-compare-dark")
        assert [url for url in session.requests if not url.startswith(("blob:", "data:"))] == [page.as_uri()]
