"""Cuts the pictures out of a report, one PNG each, named after their headings: for pages of the guide.

    target/external/venv/bin/python tests/external/pictures.py REPORT.html FOLDER [WORDS OF A HEADING ...]
"""

import io
import re
import sys
import tempfile
from pathlib import Path

from browser import visit
from PIL import Image

BOXES = """[...document.querySelectorAll('figure')].map(e => {
    const box = e.getBoundingClientRect();
    return [e.querySelector('h3').innerText, box.left + scrollX, box.top + scrollY, box.right + scrollX, box.bottom + scrollY];
})"""


def main(report, folder, wanted):
    with tempfile.TemporaryDirectory() as profile:
        page = visit(Path(report).resolve().as_uri(), profile, expressions={"boxes": BOXES})
    image = Image.open(io.BytesIO(page.screenshot_png)).convert("RGB")
    found = [box for box in page.values["boxes"] if not wanted or any(words in box[0] for words in wanted)]
    assert found, f"{report} has no picture of {wanted}: there are {[box[0] for box in page.values['boxes']]}"
    for heading, left, top, right, bottom in found:
        name = re.sub(r"[^a-z0-9]+", "-", heading.lower()).strip("-")
        picture = image.crop((int(left), int(top), round(right) + 1, round(bottom) + 1))
        # Few colours: a guide is read over networks.
        picture.quantize(256).save(Path(folder) / f"{name}.png", optimize=True)
        print(Path(folder) / f"{name}.png")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
