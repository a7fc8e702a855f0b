"""The documentation site: does mdBook build it without warnings, and do all links, anchors and images in it lead somewhere?"""

import os
import subprocess
import sys

import browser
import pytest
import site_check
from conftest import ROOT

DEADLINE_S = 300


def built(folder):
    done = subprocess.run(
        [sys.executable, ROOT / "docs" / "build.py", folder],
        capture_output=True, text=True, timeout=DEADLINE_S, check=False, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site, and what mdBook printed."""
    folder = tmp_path_factory.mktemp("site") / "book"
    return folder, built(folder)


def test_mdbook_builds_the_site_without_warnings(site):
    folder, printed = site
    assert "WARN" not in printed and "ERROR" not in printed, printed
    assert (folder / "index.html").is_file()


def test_all_links_anchors_and_images_lead_somewhere_and_nothing_is_loaded_from_elsewhere(site):
    wrong, n_links, n_images = site_check.deviations(site[0])
    assert not wrong, "\n".join(wrong)
    assert n_links > 3000 and n_images > 10, (n_links, n_images)


def test_all_pages_are_searchable(site):
    index = next(site[0].glob("searchindex-*.js")).read_text(encoding="utf-8")
    pages = [page.stem for page in (ROOT / "docs").glob("*.md") if page.stem not in ("README", "SUMMARY")]
    assert len(pages) > 30
    assert [page for page in pages if f"{page}.html" not in index] == []


def test_the_check_finds_what_is_broken(tmp_path):
    (tmp_path / "a.html").write_text('<a href="b.html#there"></a><a href="c.html"></a><img src="https://x.org/y.png" alt="y">')
    (tmp_path / "b.html").write_text('<p id="here"><a href="a.html"></a><img src="d.png">')
    wrong, n_links, _ = site_check.deviations(tmp_path)
    assert n_links == 4
    assert len(wrong) == 5, wrong
    for part in ("b.html#there", "c.html", "loads https://x.org/y.png", "d.png, which is not there", "d.png has no text"):
        assert any(part in line for line in wrong), part


@pytest.mark.parametrize(("width_px", "dark"), [(1280, False), (400, True)])
def test_pages_in_a_browser_load_nothing_from_a_network_and_fit_the_screen(site, tmp_path, width_px, dark):
    over = {"over": "document.documentElement.scrollWidth - innerWidth"}
    for name in ("index", "configuration", "comparison", "files/configs/faults.toml"):
        seen = browser.visit(f"file://{site[0]}/{name}.html", tmp_path / "profile", width_px, dark, over)
        assert [url for url in seen.requests if not url.startswith(("file:", "data:"))] == []
        assert seen.complaints == []
        assert seen.values["over"] <= 0, (name, width_px)
