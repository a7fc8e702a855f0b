"""report.html in a browser: it shows something, on its own, in light and dark, on wide and narrow screens."""

import io
import json
import subprocess
import xml.etree.ElementTree as ElementTree

import pyarrow.parquet
import pytest
from browser import visit
from conftest import program
from figure_tools import BUTTONS, PREPARE, rows_of, saved
from PIL import Image

SVG = "{http://www.w3.org/2000/svg}"

# What a reader can see of the pictures, as the page itself reports it.
LOOK = {
    "text": "document.body.innerText",
    "title": "document.title",
    "language": "document.documentElement.lang",
    "overflow_px": "document.scrollingElement.scrollWidth - window.innerWidth",
    "pictures": """[...document.querySelectorAll('svg, canvas, img')].map(e => ({
        width: e.getBoundingClientRect().width,
        height: e.getBoundingClientRect().height,
        shapes: e.querySelectorAll('path, polyline, polygon, circle, line, rect').length,
        not_finite: /NaN|Infinity|undefined/.test(e.outerHTML),
        described: !!(e.getAttribute('aria-label') || e.getAttribute('aria-labelledby') || e.getAttribute('alt')
            || e.querySelector('title')),
    })).filter(e => e.width > 200)""",
}


def look_at(page_path, profile_dir, **how):
    return visit(page_path.as_uri(), profile_dir, expressions=LOOK, **how)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width_px", [1200, 400], ids=["wide", "narrow"])
def test_the_report_renders_alone_and_without_complaint(flocking, tmp_path, width_px, dark):
    page = look_at(flocking / "report.html", tmp_path, width_px=width_px, dark=dark)
    beyond = [url for url in page.requests if not url.startswith(("data:", "blob:"))]
    assert beyond == [(flocking / "report.html").as_uri()], "the report asked for something other than itself"
    assert page.complaints == []
    assert page.values["overflow_px"] <= 0, "the page is wider than the window"

    image = Image.open(io.BytesIO(page.screenshot_png)).convert("RGB")
    assert image.width >= width_px and image.height >= 900
    colors = image.getcolors(maxcolors=1 << 24)
    background = max(colors)[0] / (image.width * image.height)
    # A blank page has one colour. Text and lines on a plain ground take up between 1 and 60 % of it.
    assert len(colors) > 20 and 0.4 < background < 0.99, f"{len(colors)} colours, background {background:.3f}"
    brightness = sum(max(colors)[1]) / 3
    assert (brightness < 128) == dark, f"background brightness {brightness} of 255 with dark = {dark}"


def test_the_report_has_the_four_pictures_each_with_shapes_and_a_description(flocking, tmp_path):
    values = look_at(flocking / "report.html", tmp_path).values
    assert values["title"] and values["language"] == "en"
    assert len(values["pictures"]) >= 4, values["pictures"]
    for picture in values["pictures"]:
        assert picture["height"] > 100 and picture["shapes"] >= 5, picture
        assert picture["described"] and not picture["not_finite"], picture
    text = values["text"].lower()
    for topic in ("trajector", "speed", "neighbo", "distance", "seed"):
        assert topic in text, f"the report does not mention {topic}"
    for accident in ("nan", "undefined", "inf"):
        assert accident not in text.split(), f"the report says {accident}"


def tools(page_path, profile_dir, expressions, **how):
    """The values of expressions on a page, in their order."""
    return visit(page_path.as_uri(), profile_dir, expressions={"prepared": PREPARE} | expressions, **how).values


def test_every_figure_has_buttons_for_picture_and_data_and_switches(flocking, tmp_path):
    figures = tools(flocking / "report.html", tmp_path, {"figures": BUTTONS})["figures"]
    assert len(figures) == 4
    for figure in figures:
        assert figure["buttons"] == ["SVG", "CSV"] and figure["dead_keys"] == 0, figure
    assert "median" in figures[1]["words"] and "250 steps" in figures[1]["words"], figures[1]
    # Without a script there is nothing to press, and the pictures are there all the same.
    source = (flocking / "report.html").read_text()
    assert source.count("<svg viewBox") + source.count("<svg class") >= 4 and "<button" not in source.split("<script")[0]


def test_a_saved_table_has_exactly_what_the_run_wrote(flocking, tmp_path):
    values = tools(
        flocking / "report.html",
        tmp_path,
        {"delivery": saved("delivery", "CSV"), "paths": saved("trajectories", "CSV"), "names": "savedNames"},
    )
    assert values["names"] == ["flocking-delivery.csv", "flocking-trajectories.csv"]
    shares = [row for row in rows_of(values["delivery"]) if row["series"].startswith("share delivered")]
    bins = json.loads((flocking / "summary.json").read_text())["network"]["by_distance"]
    assert len(shares) == len(bins)
    for row, of in zip(shares, bins):
        assert float(row["distance between sender and receiver (m)"]) == (of["from_m"] + of["to_m"]) / 2
        assert float(row["share delivered (%)"]) == pytest.approx(100 * of["ratio"], rel=1e-14)
        low, high = (float(row[f"share delivered, {end} (%)"]) for end in ("low", "high"))
        assert [low, high] == pytest.approx([100 * end for end in of["ratio_interval_95"]], rel=1e-14)
        assert f"{of['deliveries']:,} of {of['attempts']:,} delivered" in row["point"]
    ends = {row["point"]: row for row in rows_of(values["paths"]) if row["series"] == "end"}
    steps = pyarrow.parquet.read_table(flocking / "steps.parquet").to_pylist()
    last = {step["agent"]: step for step in steps if step["step"] == max(step["step"] for step in steps)}
    assert len(ends) >= 8
    for name, row in ends.items():
        step = last[int(name.removeprefix("agent "))]
        assert (float(row["east (m)"]), float(row["north (m)"])) == (step["x_m"], step["y_m"]), name


def test_a_saved_picture_stands_by_itself_and_is_light_in_the_dark(flocking, tmp_path):
    expressions = {"picture": saved("flock-speed", "SVG")}
    light, dark = (
        tools(flocking / "report.html", tmp_path / str(dark), expressions, dark=dark)["picture"] for dark in (False, True)
    )
    assert light == dark
    for missing in ("var(", "class=", "<script", "<style", "NaN"):
        assert missing not in light, missing
    root = ElementTree.fromstring(light)
    assert root.tag == f"{SVG}svg" and float(root.get("width")) >= 540 and float(root.get("height")) >= 312
    assert any(path.get("stroke") == "rgb(36, 104, 178)" for path in root.iter(f"{SVG}path")), "the colour of the swarm"
    assert "time" in "".join(text.text or "" for text in root.iter(f"{SVG}text"))
    # It shows the same in a program that has not the page's style sheet.
    alone = tmp_path / "alone.svg"
    alone.write_text(light)
    image = Image.open(io.BytesIO(visit(alone.as_uri(), tmp_path / "alone").screenshot_png)).convert("RGB")
    assert len(image.getcolors(maxcolors=1 << 24)) > 20


def test_values_are_read_by_pointer_by_touch_and_by_keys(flocking, tmp_path):
    first = "centre(pictureOf('delivery').querySelector('g.interval circle'))"
    ask = "(async () => {{ fire('delivery', 'pointerenter', {at}); await pause(200); {do}; await pause(100); return shown('delivery'); }})()"
    values = tools(
        flocking / "report.html",
        tmp_path,
        {
            "pointer": ask.format(at=first, do=f"fire('delivery', 'pointermove', {first})"),
            "away": ask.format(at=first, do="fire('delivery', 'pointerleave', [0, 0])"),
            "touch": ask.format(at=first, do=f"fire('delivery', 'pointerdown', {first}, {{ pointerType: 'touch' }})"),
            "focus": "(() => { const svg = pictureOf('delivery'); svg.focus(); return [document.activeElement === svg, svg.tabIndex]; })()",
            "key": ask.format(at=first, do="key('delivery', 'Escape'); await pause(20); key('delivery', 'ArrowRight')"),
            "next": ask.format(at=first, do="key('delivery', 'ArrowRight')"),
        },
    )
    assert values["pointer"] and "share delivered" in values["pointer"] and " m" in values["pointer"] and "%" in values["pointer"]
    assert values["away"] is None and values["touch"] == values["pointer"]
    assert values["focus"] == [True, 0]
    assert values["key"] and values["next"] and values["key"] != values["next"]


def test_a_switch_of_the_legend_hides_its_series_and_shows_it_again(flocking, tmp_path):
    state = """(() => { const button = figureOf('neighbours').querySelector('.key button'); if (%s) button.click();
        const line = pictureOf('neighbours').querySelector('.marks .line');
        return [button.getAttribute('aria-pressed'), getComputedStyle(line).display !== 'none', button.innerText.trim()]; })()"""
    values = tools(
        flocking / "report.html",
        tmp_path,
        {"before": state % "false", "off": state % "true", "picture": saved("neighbours", "SVG"), "on": state % "true"},
    )
    assert values["before"] == values["on"] == ["true", True, "median over agents"]
    assert values["off"] == ["false", False, "median over agents"]
    assert 'stroke="rgb(36, 104, 178)"' not in values["picture"], "what is hidden is not in the saved picture"


def test_zoom_has_finer_ticks_and_comes_back(flocking, tmp_path):
    ticks = "[...pictureOf('flock-speed').querySelectorAll('.tick')].map(t => t.textContent)"
    look = f"({{ ticks: {ticks}, marks: pictureOf('flock-speed').querySelector('.marks').innerHTML, reset: figureOf('flock-speed').querySelector('.tools button').hidden }})"
    drag = """(async () => { fire('flock-speed', 'pointerenter', [0, 0]); await pause(200); const [a, b] = [[200, 120], [300, 122]];
        pictureOf('flock-speed').setPointerCapture = () => {};
        fire('flock-speed', 'pointerdown', a, { button: 0 }); await pause(20); fire('flock-speed', 'pointermove', b); fire('flock-speed', 'pointermove', b);
        fire('flock-speed', 'pointerup', b); return true; })()"""
    values = tools(
        flocking / "report.html",
        tmp_path,
        {
            "before": look,
            "drag": drag,
            "dragged": look,
            "reset": "(() => { fire('flock-speed', 'dblclick', [250, 120]); return true; })()",
            "after": look,
            "scroll": "(() => { fire('flock-speed', 'wheel', [250, 120], { deltaY: -1 }); return true; })()",
            "scrolled": look,
            "wheel": "(() => { for (let k = 0; k < 4; k += 1) fire('flock-speed', 'wheel', [250, 120], { deltaY: -1, ctrlKey: true }); return true; })()",
            "turned": look,
        },
    )
    before, dragged, turned = (values[name] for name in ("before", "dragged", "turned"))
    assert before["reset"] and not dragged["reset"]
    assert dragged["ticks"] != before["ticks"] and dragged["marks"] != before["marks"]
    assert values["after"]["ticks"] == before["ticks"] and values["after"]["reset"]
    assert values["scrolled"]["ticks"] == before["ticks"], "the wheel alone scrolls the page"
    assert turned["ticks"] != before["ticks"] and len(set(turned["ticks"])) == len(turned["ticks"])


@pytest.fixture(scope="module")
def radius(tmp_path_factory):
    """A sweep over a radius and two radios, with three seeds."""
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "radius.toml").write_text(
        "[experiment]\nname = 'radius'\nseed = 1\nduration_s = 5.0\nagents = 6\n[robotsim.scenario]\nkind = 'line'\nspacing_m = 2.0\n"
        "[robotsim.controller]\nkind = 'flocking'\nflock_radius_m = 10.0\n[netsim.phy]\npropagation = 'full'\n[sweep]\nseeds = 3\n"
        "metrics = ['flock_speed', 'broadcast_pdr', 'task.collisions']\n[sweep.vary]\nnetsim.phy.propagation = ['full', 'probabilistic-disk']\n"
        "robotsim.controller.flock_radius_m = [1.0, 10.0, 100.0]\n"
    )
    subprocess.run([program("murmuration"), "sweep", "radius.toml"], cwd=folder, check=True, timeout=300, capture_output=True)
    return folder / "runs" / "radius"


def test_a_sweep_begins_with_its_question_figure_and_answer_on_the_first_screen(radius, tmp_path):
    bottom = "document.querySelector('{}').getBoundingClientRect().bottom"
    values = tools(
        radius / "report.html",
        tmp_path,
        {
            "question": "document.querySelector('h2').innerText",
            "answer": "document.querySelector('.verdict').innerText",
            "bottoms": f"[{bottom.format('.verdict')}, {bottom.format('figure .panels')}]",
            "open": "[...document.querySelectorAll('main > details')].map(d => [d.open, d.querySelector('summary').innerText])",
            "height": "document.scrollingElement.scrollHeight",
            "figures": BUTTONS,
        },
        width_px=1280,
    )
    assert values["question"] == "How does the flock radius change flock speed?"
    assert "(range of 3)" in values["answer"] and "overlap" in values["answer"], values["answer"]
    assert max(values["bottoms"]) <= 900 and values["height"] < 1600, values
    assert not any(is_open for is_open, _ in values["open"])
    assert [words for _, words in values["open"]][:2] == [
        "How does the flock radius change delivery ratio?",
        "How does the flock radius change collisions?",
    ]
    assert all(figure["buttons"] == ["SVG", "CSV"] and figure["dead_keys"] == 0 for figure in values["figures"])
    assert "n = 3" in values["figures"][0]["words"] and "range of the trials" in values["figures"][0]["words"]


def test_the_table_of_a_sweep_has_every_trial_with_its_seed_and_panel(radius, tmp_path):
    values = tools(radius / "report.html", tmp_path, {"csv": saved("figure-0-0-0", "CSV"), "svg": saved("figure-0-0-0", "SVG")})
    rows = [row for row in rows_of(values["csv"]) if row["series"] == "trial"]
    table = pyarrow.parquet.read_table(radius / "trials.parquet").to_pylist()
    expected = sorted(
        (f"base propagation model: {trial['netsim.phy.propagation']}", trial["robotsim.controller.flock_radius_m"], f"seed {trial['experiment.seed']}", trial["flock_speed"])
        for trial in table
    )
    assert sorted((row["panel"], float(row["flock radius (m)"]), row["point"], float(row["flock speed (m/s)"])) for row in rows) == expected
    panels = ElementTree.fromstring(values["svg"]).findall(f"{SVG}svg")
    assert len(panels) == 2
    # From 1 m to 100 m the axis is logarithmic: the value in the middle is in the middle.
    ticks = {text.text: float(text.get("x")) for text in panels[0].iter(f"{SVG}text") if text.text in ("1", "10", "100")}
    assert ticks["10"] - ticks["1"] == pytest.approx(ticks["100"] - ticks["10"], abs=0.2)


def test_the_summary_of_three_trials_names_their_range(radius):
    for setting in json.loads((radius / "summary.json").read_text())["settings"]:
        figure = setting["metrics"]["flock_speed"]
        assert figure["interval"] == {"low": figure["min"], "high": figure["max"], "kind": "range"}
        assert figure["median_interval_95"] is None and figure["n"] == 3


def test_the_browser_check_would_have_found_a_request_and_an_error(tmp_path):
    # Guards the tests above: both lists must be able to fill.
    page_path = tmp_path / "bad.html"
    page_path.write_text('<img src="http://127.0.0.1:9/x.png"><script>console.error("a fault")</script>')
    page = look_at(page_path, tmp_path / "profile")
    assert "http://127.0.0.1:9/x.png" in page.requests
    assert any("a fault" in complaint for complaint in page.complaints)
