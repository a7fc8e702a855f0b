"""Reads a built site: which links, anchors and images lead nowhere, and what would be loaded from elsewhere."""

from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# Attributes that make a browser load something, by element. `a` only leads somewhere.
LOADED = {"img": "src", "script": "src", "link": "href", "iframe": "src", "source": "src", "video": "src", "audio": "src"}


class Page(HTMLParser):
    """What one page names: anchors, links and loaded files."""

    def __init__(self, path):
        super().__init__()
        self.anchors, self.links, self.loaded, self.without_text = set(), [], [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        for name in ("id", "name"):
            if given.get(name):
                self.anchors.add(given[name])
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if given.get(LOADED.get(tag, "")):
            self.loaded.append(given[LOADED[tag]])
        if tag == "img" and not given.get("alt"):
            self.without_text.append(given.get("src", ""))


def is_elsewhere(link):
    return bool(urlsplit(link).scheme or link.startswith("//"))


def deviations(site):
    """Lines that name what is wrong with the site in this folder, and the number of its links and images."""
    site = Path(site).resolve()
    pages = {path: Page(path) for path in sorted(site.rglob("*.html"))}
    wrong, n_links, n_images = [], 0, 0
    for path, page in pages.items():
        # Its parts link as on their own pages, from other folders.
        if path.name == "print.html":
            continue
        place = path.relative_to(site)
        # A server shows it at any address, so that its links begin at the top of the site.
        folder = site if path.name == "404.html" else path.parent
        for link in page.loaded:
            if is_elsewhere(link) and not link.startswith("data:"):
                wrong.append(f"{place} loads {link}")
        for link in page.without_text:
            wrong.append(f"{place}: the image {link} has no text")
        n_images += sum(link.endswith((".png", ".svg", ".gif")) for link in page.loaded)
        for link in page.links + page.loaded:
            if is_elsewhere(link):
                continue
            n_links += 1
            parts = urlsplit(link)
            target = (folder / unquote(parts.path).lstrip("/")).resolve() if parts.path else path
            if target.is_dir():
                target = target / "index.html"
            if not target.is_file() or site not in target.parents:
                wrong.append(f"{place} links to {link}, which is not there")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
                wrong.append(f"{place} links to {link}: that page has no such anchor")
    return wrong, n_links, n_images
