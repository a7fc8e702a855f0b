#!/usr/bin/env python3
"""Build the documentation site with mdBook: `python3 docs/build.py [FOLDER]` writes it to FOLDER (`target/book`).

The pages link to files outside `docs/`, such as experiments and sources. mdBook knows only the pages in its source folder.
This script therefore stages a copy of `docs/`, in which each of these files is a page below `files/`, and runs mdBook on it.
Notebooks become pages as well. The site needs no network. `MDBOOK` names the program mdBook; the default is `mdbook`.
"""

import base64
import json
import os
import posixpath
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
# Larger files and files of other kinds are listed on the page of their folder, and have no page.
LARGEST_FILE_BYTES = 100_000
LANGUAGES = {
    ".cc": "cpp", ".csv": "text", ".json": "json", ".proto": "protobuf", ".py": "python", ".rs": "rust", ".sh": "sh",
    ".toml": "toml", ".ts": "typescript", ".txt": "text", "": "text",
}
# A link with the name of a page as its text.
NAMED_LINK = re.compile(r"\[([a-z0-9-]+\.md)\]\(((?:[^)\s#]*/)?\1)(#[^)\s]*)?\)")
LINK = re.compile(r"(\]\()([^)\s]+)(\))")
FENCE = re.compile(r"^(```+|~~~+)")
URL = re.compile(r"^[a-z][a-z0-9+.-]*:", re.IGNORECASE)


class Broken(Exception):
    """A link of a page leads nowhere, or the table of contents is incomplete."""


def page_of(path):
    """The place in the staged folder of the page that shows a file or a folder of the repository."""
    inside = posixpath.relpath(path, "docs")
    if inside == ".":
        return "index.md"
    if not inside.startswith("../"):
        name = posixpath.join(posixpath.dirname(inside), posixpath.basename(inside).replace("README.md", "index.md"))
        if name.endswith(".ipynb"):
            return name.removesuffix(".ipynb") + ".md"
        return name
    staged = posixpath.join("files", path)
    if (REPOSITORY / path).is_dir():
        return posixpath.join(staged, "folder.md")
    if path.endswith(".md"):
        return staged.replace("README.md", "index.md")
    return staged + ".md"


class Stage:
    """Copies pages to a folder and follows their links to other files of the repository."""

    def __init__(self, folder):
        self.folder = folder
        self.waiting = []
        self.staged = set()
        summary = (REPOSITORY / "docs" / "SUMMARY.md").read_text(encoding="utf-8")
        self.titles = {target: text for text, target in re.findall(r"\[([^\]]+)\]\(([^)]+)\)", summary)}

    def write(self, place, text):
        target = self.folder / place
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")

    def link(self, path, page, target):
        """The link on the staged `page` in place of `target`, which stands on `path`."""
        if URL.match(target) or target.startswith("#"):
            return target
        name, hash_mark, anchor = target.partition("#")
        goal = posixpath.normpath(posixpath.join(posixpath.dirname(path), name))
        if goal.startswith("..") or not (REPOSITORY / goal).exists():
            raise Broken(f"{path} links to {target}, which does not exist")
        self.want(goal)
        return posixpath.relpath(page_of(goal), posixpath.dirname(page) or ".") + hash_mark + anchor

    def titled(self, path, found):
        """A link to a page of the guide by its title, in place of its file's name."""
        goal = posixpath.relpath(posixpath.normpath(posixpath.join(posixpath.dirname(path), found[2])), "docs")
        return f"[{self.titles.get(goal, found[1])}]({found[2]}{found[3] or ''})"

    def want(self, path):
        if path not in self.staged:
            self.staged.add(path)
            self.waiting.append(path)

    def rewrite(self, path, page, text):
        """The text of a page with the links that hold in the staged folder. Code is left as it is."""
        lines, fence = [], None
        for line in text.splitlines():
            mark = FENCE.match(line.strip())
            if fence is None and not mark:
                # Every second part is code.
                parts = re.split(r"(`+[^`]*`+)", line)
                for place in range(0, len(parts), 2):
                    parts[place] = NAMED_LINK.sub(lambda found: self.titled(path, found), parts[place])
                    parts[place] = LINK.sub(lambda found: found[1] + self.link(path, page, found[2]) + found[3], parts[place])
                line = "".join(parts)
            elif mark:
                fence = mark[1] if fence is None else None if line.strip() == fence else fence
            lines.append(line)
        return "\n".join(lines) + "\n"

    def stage(self, path):
        page = page_of(path)
        source = REPOSITORY / path
        if source.is_dir():
            if path != "docs":
                self.write(page, self.folder_page(path, page))
        elif path.endswith(".md"):
            self.write(page, self.rewrite(path, page, source.read_text(encoding="utf-8")))
        elif path.endswith(".ipynb"):
            self.write(page, self.rewrite(path, page, self.notebook(source, page)))
        elif path.startswith("docs/"):
            target = self.folder / page
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
        else:
            text = source.read_text(encoding="utf-8")
            language = LANGUAGES.get(source.suffix, "text")
            self.write(page, f"# {path}\n\n``````{language}\n{text.rstrip()}\n``````\n")

    def folder_page(self, path, page):
        lines = [f"# {path}", ""]
        for child in sorted((REPOSITORY / path).iterdir()):
            name = f"{path}/{child.name}"
            if child.name.startswith(".") or child.name == "__pycache__":
                continue
            if child.is_dir() or (child.suffix in {".md", *LANGUAGES} and child.stat().st_size <= LARGEST_FILE_BYTES):
                lines.append(f"- [{child.name}]({self.link(name, page, child.name)})")
            else:
                lines.append(f"- {child.name}")
        return "\n".join(lines) + "\n"

    def notebook(self, source, page):
        """A notebook as the text of a page: its words, its code, and what the code printed and drew."""
        blocks, n_images = [], 0
        for cell in json.loads(source.read_text(encoding="utf-8"))["cells"]:
            text = "".join(cell["source"])
            blocks.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
            for output in cell.get("outputs", []):
                data = output.get("data", {})
                if "image/png" in data:
                    n_images += 1
                    image = f"{Path(page).stem}-{n_images}.png"
                    target = self.folder / posixpath.dirname(page) / image
                    target.parent.mkdir(parents=True, exist_ok=True)
                    target.write_bytes(base64.b64decode(data["image/png"]))
                    blocks.append(f"<img src=\"{image}\" alt=\"Picture {n_images} of the notebook\">")
                else:
                    text = "".join(output.get("text", data.get("text/plain", [])))
                    blocks.append(f"```text\n{text.rstrip()}\n```")
        return "\n\n".join(blocks) + "\n"

    def title(self, path):
        return "README" if path == "README.md" else path

    def pages_beside(self):
        """The table of contents of the pages below `files/`."""
        lines = ["", "# Files", "", "- [Files of the repository](files/list.md)"]
        beside = sorted(path for path in self.staged if page_of(path).startswith("files/"))
        listed = set(self.contents())
        for path in beside:
            if page_of(path) not in listed:
                lines.append(f"  - [{self.title(path)}]({page_of(path)})")
        self.write("files/list.md", "# Files of the repository\n\nThe guide links to these files.\n\n" + "\n".join(
            f"- [{self.title(path)}]({posixpath.relpath(page_of(path), 'files')})" for path in beside) + "\n")
        return "\n".join(lines) + "\n"

    def contents(self):
        return [found[2] for found in LINK.finditer((self.folder / "SUMMARY.md").read_text(encoding="utf-8"))]

    def all(self):
        """Stages the guide and everything that it links to."""
        docs = REPOSITORY / "docs"
        self.want("docs/SUMMARY.md")
        for page in sorted(docs.glob("*.md")):
            self.want(f"docs/{page.name}")
        while self.waiting:
            self.stage(self.waiting.pop())
        listed = self.contents()
        for page in sorted(docs.glob("*.md")):
            name = page_of(f"docs/{page.name}")
            if name != "SUMMARY.md" and listed.count(name) != 1:
                raise Broken(f"docs/SUMMARY.md lists {page.name} {listed.count(name)} times; list it once")
        before, rule, after = (self.folder / "SUMMARY.md").read_text(encoding="utf-8").rpartition("\n---\n")
        self.write("SUMMARY.md", before + self.pages_beside() + rule + after)
        for name in ("book.toml", "site.css"):
            shutil.copyfile(docs / name, self.folder / name)


def build(out, mdbook):
    """Writes the site to the folder `out`, and returns what mdBook printed."""
    with tempfile.TemporaryDirectory() as folder:
        Stage(Path(folder)).all()
        if out.exists():
            # Only an earlier site is replaced.
            if any(out.iterdir()) and not ((out / "toc.html").is_file() and (out / "print.html").is_file()):
                raise Broken(f"{out} is not empty and is no earlier site: choose another folder")
            shutil.rmtree(out)
        command = [mdbook, "build", folder, "--dest-dir", str(out)]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if done.returncode != 0:
        raise Broken(done.stdout)
    (out / "book.toml").unlink(missing_ok=True)
    return done.stdout


def main():
    out = Path(sys.argv[1] if sys.argv[1:] else REPOSITORY / "target" / "book").resolve()
    try:
        print(build(out, os.environ.get("MDBOOK", "mdbook")), end="")
    except Broken as error:
        sys.exit(f"error: {error}")
    except FileNotFoundError:
        sys.exit("error: mdBook is not installed: cargo install mdbook --no-default-features --features search")
    print(f"open {out / 'index.html'}")


if __name__ == "__main__":
    main()
