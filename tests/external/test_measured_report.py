"""The page of a diagnosis and of a comparison in a browser: it stands alone, shows its pictures and says what they mean."""

import io
import random
import subprocess

import pytest
from browser import visit
from conftest import program
from figure_tools import BUTTONS, PREPARE, rows_of, saved
from measured_links import HEADER, free_space_dbm, is_received, line
from PIL import Image
from test_report import LOOK

N_ROWS = 3000
WORDS = LOOK | {
    "captions": """[...document.querySelectorAll('figcaption')].map(e =>
        [...e.querySelectorAll('p')].map(p => p.innerText.trim().length))""",
}


@pytest.fixture(scope="module")
def links(tmp_path_factory):
    """Links among ten motes, weaker by 0.4 dB for each degree above 20, which the model does not know."""
    folder = tmp_path_factory.mktemp("measured")
    draw = random.Random(1)
    places = [(draw.uniform(0, 60), draw.uniform(0, 40)) for _ in range(10)]
    lines = [f"{HEADER},temperature_c"]
    for row in range(N_ROWS):
        tx, rx = draw.sample(range(10), 2)
        ends = places[tx], places[rx]
        temperature_c = 20 + 10 * ((row // 150) % 5 - 2) / 2
        rssi = free_space_dbm(-14, *ends) - 0.4 * (temperature_c - 20) + draw.gauss(0, 2)
        received = is_received(draw, rssi)
        lines.append(line(row, row, (tx, rx), ends, rssi, received, temperature_c))
    (folder / "links.csv").write_text("\n".join(lines) + "\n")
    (folder / "model.toml").write_text('[netsim.phy]\npropagation = "friis"\ntx_power_dbm = -14.0\n')
    return folder


def page_of(command, links):
    report = links / f"{command}.html"
    subprocess.run(
        [program("murmuration"), command, links / "model.toml", "--data", links / "links.csv", "--report", report],
        check=True,
        timeout=300,
    )
    return report


@pytest.fixture(scope="module", params=["compare", "diagnose"])
def report(request, links):
    return page_of(request.param, links)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width_px", [1200, 400], ids=["wide", "narrow"])
def test_the_page_renders_alone_and_without_complaint(report, tmp_path, width_px, dark):
    page = visit(report.as_uri(), tmp_path, expressions=WORDS, width_px=width_px, dark=dark)
    beyond = [url for url in page.requests if not url.startswith(("data:", "blob:"))]
    assert beyond == [report.as_uri()], "the page asked for something other than itself"
    assert page.complaints == []
    assert page.values["overflow_px"] <= 0, "the page is wider than the window"
    image = Image.open(io.BytesIO(page.screenshot_png)).convert("RGB")
    colors = image.getcolors(maxcolors=1 << 24)
    assert (sum(max(colors)[1]) / 3 < 128) == dark


def test_each_picture_has_shapes_a_description_and_words(report, tmp_path):
    values = visit(report.as_uri(), tmp_path, expressions=WORDS).values
    assert len(values["pictures"]) >= 6, values["pictures"]
    for picture in values["pictures"]:
        # A ladder of few rungs is low.
        assert picture["height"] > 40 and picture["shapes"] >= 2, picture
        assert picture["described"] and not picture["not_finite"], picture
    assert all(len(words) == 2 and min(words) > 20 for words in values["captions"]), values["captions"]
    text = values["text"].lower()
    for topic in ("predicted against measured", "error over", "map", "reception", "90 %"):
        assert topic in text, f"the page does not mention {topic}"
    for accident in ("nan", "undefined", "inf", "null"):
        assert accident not in text.split(), f"the page says {accident}"


def test_each_picture_has_its_tools_and_its_data(report, tmp_path):
    wanted = {"prepared": PREPARE, "figures": BUTTONS, "table": saved("over-temperature_c", "CSV"), "picture": saved("against", "SVG")}
    values = visit(report.as_uri(), tmp_path, expressions=wanted).values
    assert len(values["figures"]) >= 6
    assert all(figure["buttons"] == ["SVG", "CSV"] and figure["dead_keys"] == 0 for figure in values["figures"]), values["figures"]
    rows = rows_of(values["table"])
    means = [row for row in rows if row["series"].startswith("mean of a bin, as configured")]
    # Weaker by 0.4 dB for each degree: the means of the bins fall from about 8 dB to about -8 dB.
    assert len(means) >= 3 and all(row["point"].startswith("n = ") for row in means)
    errors = [float(row["measured less predicted (dB)"]) for row in means]
    temperatures = [float(row["temperature (°C)"]) for row in means]
    slope = (errors[-1] - errors[0]) / (temperatures[-1] - temperatures[0])
    assert slope == pytest.approx(-0.4, abs=0.05)
    assert len(rows) > 1000 and "var(" not in values["picture"]


def test_a_diagnosis_names_what_was_hidden_and_draws_the_ladder(links, tmp_path):
    values = visit(page_of("diagnose", links).as_uri(), tmp_path, expressions=WORDS).values
    text = values["text"]
    assert "Missing: temperature" in text
    for part in ("+ temperature", "db_per_c", "Error, effect by effect", "What each candidate gains", "Unexplained structure"):
        assert part in text, f"{part} is not on the page"
