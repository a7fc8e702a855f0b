"""Journal figures through readers of PDF and SVG that are not ours: sizes, embedded fonts, words, and what is seen."""

import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target" / "release" / "murmuration"
SWEEP = """
[experiment]
name = "s"
seed = 1
duration_s = 2.0
agents = 5
control_period = { rate_hz = 10.0 }
[robotsim.scenario]
kind = "line"
[robotsim.controller]
kind = "flocking"
flock_radius_m = 5.0
[netsim.phy]
propagation = "unit-disk"
radius_m = 6.0
[sweep]
seeds = 6
metrics = ["task.flock_speed_mps", "network.delivery_ratio"]
[sweep.vary]
netsim.phy.radius_m = [3.0, 6.0, 90.0]
"""


def call(*command, folder):
    answer = subprocess.run([str(part) for part in command], capture_output=True, text=True, cwd=folder)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    return answer.stdout


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    """A folder with a figure as PDF, SVG and PNG."""
    folder = tmp_path_factory.mktemp("figures")
    (folder / "s.toml").write_text(SWEEP)
    call(PROGRAM, "sweep", "s.toml", folder=folder)
    for ending in ("pdf", "svg", "png"):
        call(PROGRAM, "figure", "runs/s", "--output", f"f.{ending}", folder=folder)
    return folder


def test_a_pdf_is_one_page_of_a_column_with_its_words_in_embedded_fonts(figures):
    described = dict(line.split(":", 1) for line in call("pdfinfo", "f.pdf", folder=figures).splitlines() if ":" in line)
    assert described["Pages"].strip() == "1"
    width = float(described["Page size"].split()[0])
    assert abs(width - 88 / 25.4 * 72) < 1, described
    assert described["Title"].strip().startswith("Flock speed")
    _, _, *fonts = call("pdffonts", "f.pdf", folder=figures).splitlines()
    assert len(fonts) == 1
    # Type, encoding; embedded, subset, known in Unicode.
    assert "CID TrueType" in fonts[0] and fonts[0].split()[-5:-2] == ["yes", "yes", "yes"], fonts
    words = call("pdftotext", "-layout", "f.pdf", "-", folder=figures)
    for part in ("flock speed (m/s)", "phy radius (m)", "(a)", "(b)", "100 %"):
        assert part in words, words


def test_pdf_and_png_show_the_same(figures):
    # Each as gray levels of as many pixels.
    call("pdftoppm", "-r", "100", "-gray", "-singlefile", "f.pdf", "pdf", folder=figures)
    picture = (figures / "pdf.pgm").read_bytes()
    head, size, _, levels = picture.split(b"\n", 3)
    assert head == b"P5"
    width, height = map(int, size.split())
    png = figures / "f.png"
    call("ffmpeg", "-y", "-loglevel", "error", "-i", png, "-vf", f"scale={width}:{height}:flags=area,format=gray", "-f", "rawvideo", "png.raw", folder=figures)
    other = (figures / "png.raw").read_bytes()
    assert len(other) == len(levels) == width * height
    dark = [sum(255 - level for level in each) / (255 * width * height) for each in (levels, other)]
    assert 0.005 < dark[0] and abs(dark[0] - dark[1]) < 0.15 * dark[0], dark
    different = sum(abs(a - b) > 96 for a, b in zip(levels, other, strict=True)) / (width * height)
    assert different < 0.02, different


def test_an_svg_is_well_formed_and_says_what_it_shows(figures):
    root = ElementTree.parse(figures / "f.svg").getroot()
    space = "{http://www.w3.org/2000/svg}"
    assert root.find(f"{space}title").text.startswith("Flock speed")
    assert "n = 6 trials each" in root.find(f"{space}desc").text
    words = [text.text for text in root.iter(f"{space}text")]
    assert {"flock speed (m/s)", "phy radius (m)"} <= set(words), words
