"""report.html in a browser: it shows something, on its own, in light and dark, on wide and narrow screens."""

import io

import pytest
from browser import visit
from PIL import Image

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


def test_the_browser_check_would_have_found_a_request_and_an_error(tmp_path):
    # Guards the tests above: both lists must be able to fill.
    page_path = tmp_path / "bad.html"
    page_path.write_text('<img src="http://127.0.0.1:9/x.png"><script>console.error("a fault")</script>')
    page = look_at(page_path, tmp_path / "profile")
    assert "http://127.0.0.1:9/x.png" in page.requests
    assert any("a fault" in complaint for complaint in page.complaints)
