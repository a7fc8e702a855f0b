"""The page that shows the results of a folder, in Chromium: sorting, filtering, the chart, pages of results, phones, live runs."""

import csv
import gzip
import json
import signal
import subprocess
import time
import xml.etree.ElementTree as ET

import page_session
import pyarrow.parquet as pq
import pytest
from conftest import ROOT, program, succeed
from page_session import PICTURES, serving

EXPERIMENT = """
[experiment]
name = "NAME"
seed = 2
duration_s = 20.0
agents = 10
control_period = { rate_hz = 10.0 }
[robotsim.scenario]
kind = "line"
[robotsim.controller]
kind = "flocking"
flock_radius_m = 5.0
[netsim.phy]
propagation = "unit-disk"
radius_m = RADIUS
"""
RADII = {"near": 4.0, "middle": 6.0, "wide": 8.0, "wider": 10.0, "widest": 12.0}
SIZES = [(390, 844), (820, 1180), (1280, 800), (1920, 1080)]


@pytest.fixture(scope="module")
def browser():
    with page_session.browser() as started:
        yield started


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Five runs that differ in the radius, a sweep and an answer."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "walk.toml").write_text(EXPERIMENT.replace("NAME", "walk").replace("RADIUS", "12.0"))
    for name, radius_m in RADII.items():
        changes = [f"experiment.name={name}", f"netsim.phy.radius_m={radius_m}"]
        words = [word for change in changes for word in ("--set", change)]
        succeed([program("murmuration"), "run", "walk.toml", *words], cwd=folder)
    sweep = EXPERIMENT.replace("NAME", "swept").replace("RADIUS", "12.0").replace("20.0", "2.0")
    sweep += '[sweep]\nseeds = 2\nmetrics = ["flock_speed"]\n[sweep.vary]\n"netsim.phy.radius_m" = [3.0, 6.0, 12.0]\n'
    (folder / "sweep.toml").write_text(sweep)
    succeed([program("murmuration"), "sweep", "sweep.toml"], cwd=folder)
    ladder = [{"model": "as it is", "rmse": 6.5}, {"model": "with wall-attenuation", "rmse": 3.25}]
    answer = {"schema": "diagnose/2", "kind": "link", "sentence": "The model lacks wall-attenuation.", "warnings": [], "ladder": ladder}
    (folder / "runs" / "lab.json").write_text(json.dumps(answer))
    return folder


@pytest.fixture(scope="module")
def served(folder):
    with serving("open", folder=folder) as (url, _):
        yield url


class Results:
    """The page, open, and everything that went wrong in it."""

    def __init__(self, browser, url, size=(1280, 800), dark=False, fragment=""):
        scheme = "dark" if dark else "light"
        viewport = {"width": size[0], "height": size[1]}
        self.context = browser.new_context(viewport=viewport, color_scheme=scheme, accept_downloads=True)
        self.page = self.context.new_page()
        self.complaints = []
        self.page.on("console", lambda message: self.complaints.append(message.text) if message.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.goto(url + fragment)
        self.until("window.murmurationRuns !== undefined")
        self.page.evaluate("window.murmurationRuns.ready")

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        self.context.close()
        assert kind is not None or self.complaints == []

    def state(self):
        return self.page.evaluate("window.murmurationRuns.state()")

    def until(self, expression, seconds=60):
        deadline = time.monotonic() + seconds
        while not self.page.evaluate(expression):
            assert time.monotonic() < deadline, f"not within {seconds} s: {expression}"
            self.page.wait_for_timeout(50)

    def wait(self, condition):
        """Until a condition on the state, named `s`, holds."""
        self.until(f"(() => {{ const s = window.murmurationRuns.state(); return {condition}; }})()")
        return self.state()

    def heading(self, name):
        return self.page.locator("th").filter(has=self.page.get_by_role("button", name=name, exact=True))

    def select(self, *names):
        for name in names:
            self.page.get_by_role("checkbox", name=f"Select {name} for the chart").check()
        return self.wait(f"s.curves.filter((curve) => curve.points > 0).length === {len(names)}")

    def picture(self, name):
        PICTURES.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=PICTURES / f"{name}.png")

    def download(self, name):
        with self.page.expect_download() as download:
            self.page.get_by_role("button", name=name, exact=True).click()
        return download.value.path()


def test_every_result_has_a_row_and_columns_are_what_differs(browser, served):
    with Results(browser, served) as results:
        state = results.state()
        assert sorted(state["rows"]) == sorted([*RADII, "swept", "lab.json"])
        assert set(state["statuses"].values()) == {"complete"}
        settings = [key for key in state["columns"] if "." in key]
        assert settings == ["netsim.phy.radius_m"]
        row = results.page.get_by_role("row").filter(has_text="lab.json")
        assert "3.25 dB" in row.inner_text() and "The model lacks wall-attenuation." in row.inner_text()
        # What differs stands right after the first figure, and the example of a filter is of columns that are there.
        assert state["columns"][3:5] == ["first", "netsim.phy.radius_m"]
        assert "radius_m=" in results.page.get_by_role("searchbox", name="Filter").get_attribute("placeholder")
        # An answer has no page: its name opens all that is known of it.
        row.get_by_role("button", name="lab.json", exact=True).click()
        dialog = results.page.get_by_role("dialog")
        assert "with wall-attenuation" in dialog.inner_text() and "3.25 dB" in dialog.inner_text()
        dialog.get_by_role("button", name="Close").click()
        # The best setting of a sweep is named.
        swept = results.page.get_by_role("row").filter(has_text="swept")
        assert "best: radius_m" in swept.inner_text() and "3 settings, medians" in swept.inner_text()


def test_a_column_is_found_by_its_name(browser, served):
    with Results(browser, served) as results:
        results.page.get_by_text("Columns", exact=True).click()
        results.page.get_by_role("searchbox", name="Find a column").fill("duty")
        boxes = results.page.locator(".menu-body label:visible")
        assert boxes.count() < results.page.locator(".menu-body label").count()
        results.page.get_by_role("searchbox", name="Find a column").fill("flock_speed")
        results.page.get_by_role("checkbox", name="flock_speed").check()
        assert "flock_speed" in results.state()["columns"]


def test_a_ninth_run_is_refused_and_its_box_stays_empty(browser, served, folder):
    names = [f"more-{number}" for number in range(4)]
    for number, name in enumerate(names):
        changes = [f"experiment.name={name}", f"experiment.seed={number + 7}", "experiment.duration_s=2.0"]
        succeed([program("murmuration"), "run", "walk.toml", *(word for change in changes for word in ("--set", change))], cwd=folder)
    with Results(browser, served) as results:
        results.select(*[*RADII, *names][:8])
        top = results.page.get_by_role("row").filter(has_text="widest").bounding_box()["y"]
        ninth = results.page.get_by_role("checkbox", name=f"Select {names[3]} for the chart")
        ninth.click()
        assert "at most 8 runs" in results.page.get_by_role("alert").inner_text()
        assert not ninth.is_checked() and len(results.state()["selected"]) == 8
        assert results.page.get_by_role("row").filter(has_text="widest").bounding_box()["y"] == top
        results.page.get_by_role("button", name="Clear", exact=True).click()
        assert results.page.locator("tbody input:checked").count() == 0
        ninth.click()
        assert ninth.is_checked() and results.state()["selected"] == [names[3]]
    subprocess.run(["rm", "-r", *(str(folder / "runs" / name) for name in names)], check=True)


def test_sorting_by_a_click_and_by_keys(browser, served):
    with Results(browser, served) as results:
        results.page.get_by_role("button", name="radius_m", exact=True).click()
        by_radius = sorted(RADII, key=RADII.get)
        # Results without a value come last.
        assert results.state()["rows"][:5] == by_radius
        assert results.heading("radius_m").get_attribute("aria-sort") == "ascending"
        results.page.get_by_role("button", name="radius_m", exact=True).press("Enter")
        assert results.state()["rows"][:5] == by_radius[::-1]
        assert results.heading("radius_m").get_attribute("aria-sort") == "descending"
        assert results.heading("name").get_attribute("aria-sort") == "none"
        # The heading has kept the focus; arrow keys go from row to row.
        assert results.page.evaluate("document.activeElement.dataset.sort") == "netsim.phy.radius_m"
        results.page.get_by_role("checkbox", name="Select widest for the chart").focus()
        results.page.keyboard.press("ArrowDown")
        assert "wider" in results.page.evaluate("document.activeElement.getAttribute('aria-label')")


def test_a_filter_has_words_and_conditions(browser, served):
    with Results(browser, served) as results:
        search = results.page.get_by_role("searchbox", name="Filter")
        for text, expected in [
            ("radius_m<8", ["near", "middle", "swept"]),
            ("radius_m<8 kind=run", ["near", "middle"]),
            ("wid radius_m>8", ["wider", "widest"]),
            ("kind=sweep", ["swept"]),
            ("lacks", ["lab.json"]),
            ("netsim.phy.radius_m=3", ["swept"]),
            ("", [*RADII, "swept", "lab.json"]),
        ]:
            search.fill(text)
            assert sorted(results.state()["rows"]) == sorted(expected), text
        for text, words in [
            ("raduis_m=8", "There is no column raduis_m (nearest: netsim.phy.radius_m)."),
            ("pdr<98%", "There is no column pdr (nearest: broadcast_pdr)."),
            ("when>1", "when>1: when is compared with a date"),
            ('name="wid', "A quotation mark is not closed."),
        ]:
            search.fill(text)
            assert words in results.page.inner_text("#filter-words"), text
        search.fill("raduis_m=8")
        assert "No result passes the filter." in results.page.inner_text(".nothing")
        results.page.get_by_role("button", name="Clear the filter").click()
        assert len(results.state()["rows"]) == 7


def test_the_chart_has_the_series_of_the_tables(browser, served, folder):
    with Results(browser, served) as results:
        results.select("near", "widest")
        table = pq.read_table(folder / "runs" / "near" / "steps.parquet").to_pylist()
        with open(results.download("CSV"), newline="") as file:
            rows = list(csv.reader(file))
        assert rows[0] == ["time_s", "near speed of the flock (m/s)", "widest speed of the flock (m/s)"]
        assert len(rows) == 1 + 200
        for step in (1, 77, 200):
            robots = [row for row in table if row["step"] == step]
            mean = [sum(row[key] for row in robots) / len(robots) for key in ("vx_mps", "vy_mps")]
            assert float(rows[step][0]) == pytest.approx(robots[0]["time_ns"] / 1e9)
            assert float(rows[step][1]) == pytest.approx((mean[0] ** 2 + mean[1] ** 2) ** 0.5, rel=1e-4)
        picture = ET.parse(results.download("SVG"))
        assert len(picture.findall("{http://www.w3.org/2000/svg}polyline")) == 2
        words = [text.text for text in picture.findall("{http://www.w3.org/2000/svg}text")]
        assert {"simulated time (s)", "speed of the flock (m/s)", "near: radius_m 4", "widest: radius_m 12"} <= set(words)
        # Table and legend have the same mean, which is that of the run.
        summary = json.loads((folder / "runs" / "near" / "summary.json").read_text())
        mean = float(results.page.locator(".runs-legend .value").first.inner_text().removeprefix("mean ").removesuffix(" m/s"))
        assert mean == pytest.approx(summary["task"]["flock_speed_mps"], rel=1e-3)
        assert f"{mean:.3g} m/s" in results.page.get_by_role("row").filter(has_text="near").inner_text()
        # A curve is switched off: it is not saved either.
        results.page.get_by_title("Switch the curve of near off or on").click()
        assert [curve["on"] for curve in results.state()["curves"]] == [False, True]
        curves = ET.parse(results.download("SVG")).findall("{http://www.w3.org/2000/svg}polyline")
        assert len(curves) == 1
        # Values at the pointer.
        box = results.page.locator(".chart-box").bounding_box()
        results.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        assert results.page.inner_text(".overlay .at").startswith("at ")
        # The place of the pointer is another time once a span is enlarged.
        results.page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 20)
        start = float(results.page.inner_text(".overlay .at").split()[1])
        results.page.mouse.down()
        results.page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 20, steps=4)
        before = float(results.page.inner_text(".overlay .at").split()[1])
        results.page.mouse.up()
        after = float(results.page.inner_text(".overlay .at").split()[1])
        assert start < after < before - 1
        results.page.mouse.dblclick(box["x"] + box["width"] / 2, box["y"] + 20)
        results.page.locator(".overlay-head > .field select").select_option("neighbours")
        with open(results.download("CSV"), newline="") as file:
            assert next(csv.reader(file)) == ["time_s", "widest neighbours heard, mean"]


def test_the_address_keeps_what_was_chosen(browser, served):
    with Results(browser, served) as results:
        results.page.get_by_role("button", name="name", exact=True).click()
        results.page.get_by_role("searchbox", name="Filter").fill("radius_m>=6")
        results.select("wide")
        fragment = results.page.evaluate("location.hash")
        rows = results.state()["rows"]
    with Results(browser, served, fragment=fragment) as results:
        state = results.wait("s.curves.length === 1 && s.curves[0].points > 0")
        assert (state["rows"], state["selected"]) == (rows, ["wide"])


def test_a_report_opens_and_may_do_nothing_but_show_itself(browser, served):
    with Results(browser, served) as results:
        row = results.page.get_by_role("row").filter(has_text="widest")
        with results.context.expect_page() as opened:
            row.get_by_role("link", name="Report of widest").click()
        report = opened.value
        report.wait_for_load_state()
        assert "widest" in report.title()
        assert report.evaluate("self.origin") == "null"
        asked = "fetch('/api/about').then(() => 'answered', () => 'refused')"
        assert report.evaluate(asked) == "refused"
        report.close()


def test_a_run_is_played_on_the_same_server(browser, served):
    with Results(browser, served) as results:
        row = results.page.get_by_role("row").filter(has_text="widest")
        with results.context.expect_page() as opened:
            row.get_by_role("link", name="Play widest").click()
        player = opened.value
        player.wait_for_load_state()
        player.evaluate("window.murmuration.ready")
        player.evaluate("window.murmuration.seek(10_000_000_000)")
        assert player.evaluate("window.murmuration.state()")["step"] == 100
        player.close()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("dark", [False, True])
def test_every_size_fits_and_shows_what_matters(browser, served, size, dark):
    with Results(browser, served, size=size, dark=dark) as results:
        results.select("near", "widest")
        results.until("document.querySelectorAll('.spark .line').length > 0")
        results.picture(f"results-{size[0]}-{'dark' if dark else 'light'}")
        # Nothing is wider than the window, but the table, which scrolls in its own frame.
        assert results.page.evaluate("document.documentElement.scrollWidth") == size[0]
        cards = results.page.evaluate("document.querySelector('.scroller').classList.contains('cards')")
        assert cards == (size[0] < 760)
        if cards:
            assert results.page.evaluate("document.querySelector('.scroller').scrollWidth") <= size[0]
            # A card has everything in it.
            overfull = "[...document.querySelectorAll('tbody tr:not(.spacer)')].some((row) => row.scrollHeight > row.clientHeight + 1)"
            assert not results.page.evaluate(overfull)
            results.page.get_by_label("Sort by").select_option("netsim.phy.radius_m")
            assert results.state()["rows"][0] == "near"


def test_a_run_appears_while_it_is_recorded_and_keeps_filter_and_selection(browser, folder):
    with serving("open", folder=folder) as (url, _), Results(browser, url, fragment="#filter=kind%3Drun&run=near") as results:
        command = [program("murmuration"), "run", "walk.toml", "--set", "experiment.name=lasting", "--set", "experiment.duration_s=1e7"]
        run = subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            results.wait("s.statuses['lasting'] === 'running'")
            assert results.page.get_by_role("row").filter(has_text="lasting").get_by_role("progressbar").count() == 1
        finally:
            run.send_signal(signal.SIGINT)
            run.wait(timeout=60)
        state = results.wait("s.statuses['lasting'] === 'interrupted'")
        assert state["selected"] == ["near"] and "swept" not in state["rows"]
    subprocess.run(["rm", "-r", str(folder / "runs" / "lasting")], check=True)


def test_the_bundle_is_small():
    """At most 40 kB travel when they are compressed, as a server in front of this one would."""
    files = [ROOT / "orchestrator" / "page" / "dist" / name for name in ("runs.html", "runs.js", "runs.css")]
    assert sum(len(gzip.compress(file.read_bytes())) for file in files) <= 40_000
