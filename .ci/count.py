#!/usr/bin/env python3
"""Counts lines of Rust by crate: `.ci/count.py` for the working tree, `.ci/count.py COMMIT` for a commit.

A line of code has something other than white space outside comments. Blank lines, comments and documentation are not
code, not even inside a string or between two parts of an expression. Each line of code is in one column:

  code       all that is in no other column: libraries, programs, build scripts
  tests      items under #[cfg(test)] or #[test], the files of such modules, folders `tests` and `fuzz`
  benches    folders `benches`
  examples   folders `examples`
  generated  folders `generated`, and files that say `@generated` in their first lines

`comments` counts lines with a plain comment (not documentation) in the code of the first column, and gives their share
of its lines. `.ci/count.py --self-test` checks the rules above on difficult input.
"""

import os
import pathlib
import re
import subprocess
import sys

COLUMNS = ["code", "tests", "benches", "examples", "generated"]

# Everything in which a slash, quote or brace can be other than code, longest alternatives first.
TOKEN = re.compile(
    r"""
    (?P<line>//[^\n]*)
  | (?P<block>/\*)
  | (?P<raw>\b[bc]?r(?P<hashes>\#*)".*?"(?P=hashes))
  | (?P<string>"(?:[^"\\]|\\.)*")
  | (?P<char>'(?:[^'\\\n]|\\x[0-9a-fA-F]{2}|\\u\{[^}]*\}|\\.)')
  | (?P<lifetime>'\w+)
    """,
    re.VERBOSE | re.DOTALL,
)
BLOCK_EDGE = re.compile(r"/\*|\*/")
LINE_DOCUMENTATION = re.compile(r"//!|///(?!/)")
BLOCK_DOCUMENTATION = re.compile(r"/\*!|/\*\*(?![*/])")

ATTRIBUTE = re.compile(r"\s*#\s*\[")
TEST_ATTRIBUTE = re.compile(r"#\s*\[\s*(?:cfg\s*\(\s*(?:test|all\s*\(\s*test\b[^\]]*)\s*\)|(?:\w+\s*::\s*)?test)\s*\]")
TEST_FILE = re.compile(r"^\s*#!\s*\[\s*cfg\s*\(\s*test\s*\)\s*\]", re.MULTILINE)
ITEM = re.compile(r"\s*(?:pub\b\s*(?:\([^)]*\)\s*)?)?(?P<keyword>\w+)")
# Items in which a comma is not the end. Those of SEMICOLON can have braces before their end.
KEYWORDS = {"async", "enum", "extern", "fn", "impl", "macro_rules", "mod", "struct", "trait", "union", "unsafe"}
SEMICOLON = {"const", "let", "static", "type", "use"}
MODULE = re.compile(r"\bmod\s+(?:r#)?(?P<name>\w+)\s*(?P<end>[;{])")
PATH = re.compile(r"#\s*\[\s*path\s*=\s*\"(?P<path>[^\"]*)\"\s*\]\s*(?:pub\b\s*(?:\([^)]*\)\s*)?)?$")


def spaces(text):
    """As many spaces, with the line ends where they were."""
    return re.sub(r"[^\n]", " ", text)


def without_comments(text):
    """The text with comments as spaces and the contents of literals as `x`, and the numbers of lines with a plain comment."""
    parts, comments, end = [], set(), 0
    while token := TOKEN.search(text, end):
        parts.append(text[end : token.start()])
        start, end = token.span()
        kind = token.lastgroup if token.lastgroup != "hashes" else "raw"
        if kind == "block":
            depth = 1
            while depth and (edge := BLOCK_EDGE.search(text, end)):
                depth += 1 if edge.group() == "/*" else -1
                end = edge.end()
            end = len(text) if depth else end
        found = text[start:end]
        if kind in ("line", "block"):
            documentation = LINE_DOCUMENTATION if kind == "line" else BLOCK_DOCUMENTATION
            if not documentation.match(found):
                first = text.count("\n", 0, start)
                comments.update(range(first, first + found.count("\n") + 1))
            parts.append(spaces(found))
        elif kind == "lifetime":
            parts.append(found)
        else:
            parts.append(re.sub(r"\S", "x", found))
    parts.append(text[end:])
    return "".join(parts), comments


def closing(code, start):
    """The position after the bracket that closes the one at `start`."""
    depth = 0
    for place in re.finditer(r"[(\[{]|[)\]}]", code[start:]):
        depth += 1 if place.group() in "([{" else -1
        if depth == 0:
            return start + place.end()
    return len(code)


def item_end(code, start):
    """The end of the item, field or statement that follows an attribute."""
    while attribute := ATTRIBUTE.match(code, start):
        start = closing(code, attribute.end() - 1)
    item = ITEM.match(code, start)
    keyword = item["keyword"] if item else ""
    if keyword == "const" and re.match(r"\s*(?:unsafe\s+|async\s+)*fn\b", code[item.end() :]):
        keyword = "fn"
    place = start
    while found := re.compile(r"[(\[{;,)\]}]").search(code, place):
        mark, place = found.group(), found.end()
        if mark in "([{":
            place = closing(code, found.start())
            if mark == "{" and keyword not in SEMICOLON:
                return place
        elif mark == ";" or (mark == "," and keyword not in KEYWORDS | SEMICOLON):
            return place
        elif mark in ")]}":
            return found.start()
    return len(code)


def test_items(code):
    """Start and end of each item that is only compiled for tests."""
    if TEST_FILE.search(code):
        return [(0, len(code))]
    items, end = [], 0
    while attribute := TEST_ATTRIBUTE.search(code, end):
        end = item_end(code, attribute.end())
        items.append((attribute.start(), end))
    return items


def in_items(items, place):
    return any(start <= place < end for start, end in items)


def modules_of(path, text, code):
    """Place in the file, and the two possible files, of each module that another file contains."""
    folder = path.parent
    if path.name not in ("lib.rs", "main.rs", "mod.rs"):
        folder = folder / path.stem
    modules, inline = [], []
    for module in MODULE.finditer(code):
        inline = [(name, end) for name, end in inline if module.start() < end]
        if module["end"] == "{":
            inline.append((module["name"], closing(code, module.end() - 1)))
            continue
        own = folder.joinpath(*(name for name, _ in inline))
        # Literals are masked in `code`, so the file's name is taken from the text.
        named = PATH.search(text, 0, module.start())
        if named:
            candidates = [pathlib.Path(os.path.normpath(path.parent / named["path"]))]
        else:
            name = module["name"]
            candidates = [own / f"{name}.rs", own / name / "mod.rs", path.parent / f"{name}.rs"]
        modules.append((module.start(), candidates))
    return modules


class File:
    """A file of Rust, and where its code is."""

    def __init__(self, path, text):
        self.text = text
        self.code, self.comments = without_comments(text)
        self.tests = test_items(self.code)
        self.modules = modules_of(path, text, self.code)

    def lines(self):
        """Lines of code that are in tests and that are not, and lines with a comment outside tests."""
        own, start = [], 0
        for first, end in self.tests:
            own += [self.code[start:first], spaces(self.code[first:end])]
            start = end
        own = "".join([*own, self.code[start:]]).split("\n")
        is_test = [False] * len(own)
        for first, end in self.tests:
            first, end = self.code.count("\n", 0, first), self.code.count("\n", 0, end)
            is_test[first : end + 1] = [True] * (end + 1 - first)
        n_own = sum(not line.isspace() and line != "" for line in own)
        n_all = sum(not line.isspace() and line != "" for line in self.code.split("\n"))
        return n_all - n_own, n_own, sum(not is_test[line] for line in self.comments)


def files_of_tests(files):
    """The files of modules that are only compiled for tests."""
    found, waiting = set(), []
    for path, file in files.items():
        waiting += [(path, candidates) for place, candidates in file.modules if in_items(file.tests, place)]
    while waiting:
        path, candidates = waiting.pop()
        module = next((candidate for candidate in candidates if candidate in files), None)
        if module is None:
            sys.exit(f"{path}: found no file of a module, looked for {', '.join(map(str, candidates))}")
        if module not in found:
            found.add(module)
            waiting += [(module, candidates) for _, candidates in files[module].modules]
    return found


def column(path, file):
    """The column for all code of a file, by its folder and head; None if only its items decide."""
    folders = path.parts[:-1]
    if "generated" in folders or "@generated" in file.text[:500]:
        return "generated"
    if "examples" in folders:
        return "examples"
    if "benches" in folders:
        return "benches"
    if "tests" in folders or "fuzz" in folders:
        return "tests"
    return None


def count(sources, packages):
    """Lines by crate and column; `packages` has the name of the crate in each folder with a Cargo.toml."""
    files = {path: File(path, text) for path, text in sources.items()}
    of_tests = files_of_tests(files)
    table = {}
    for path, file in sorted(files.items()):
        package = next((packages[folder] for folder in path.parents if folder in packages), "(no crate)")
        row = table.setdefault(package, dict.fromkeys([*COLUMNS, "comments"], 0))
        n_tests, n_own, n_comments = file.lines()
        kind = column(path, file) or ("tests" if path in of_tests else None)
        if kind is None:
            row["code"] += n_own
            row["tests"] += n_tests
            row["comments"] += n_comments
        else:
            row[kind] += n_own + n_tests
    return table


def in_git(*arguments, **options):
    return subprocess.run(["git", *arguments], check=True, capture_output=True, **options).stdout


def read(commit):
    """Text of all files of Rust and all manifests, of a commit or of the working tree."""
    if commit is None:
        names = in_git("ls-files", "-z", "--cached", "--others", "--exclude-standard").decode().split("\0")
    else:
        names = in_git("ls-tree", "-r", "-z", "--name-only", commit).decode().split("\0")
    names = [name for name in names if name.endswith((".rs", "Cargo.toml"))]
    if commit is None:
        paths = (pathlib.Path(name) for name in names)
        return {path: path.read_text(encoding="utf-8") for path in paths if path.is_file()}
    objects = in_git("cat-file", "--batch", input="".join(f"{commit}:{name}\n" for name in names).encode())
    texts, start = {}, 0
    for name in names:
        end = objects.index(b"\n", start)
        size = int(objects[start:end].split()[2])
        texts[pathlib.Path(name)] = objects[end + 1 : end + 1 + size].decode()
        start = end + 2 + size
    return texts


def print_table(table):
    heads = [*COLUMNS, "comments", "share %"]
    print(f"{'crate':24}" + "".join(f"{head:>10}" for head in heads))
    total = {head: sum(row[head] for row in table.values()) for head in [*COLUMNS, "comments"]}
    rows = sorted(table.items(), key=lambda entry: (-entry[1]["code"], entry[0]))
    for name, row in [*rows, ("total", total)]:
        share = 100 * row["comments"] / row["code"] if row["code"] else 0
        cells = "".join(f"{row[head]:>10}" for head in [*COLUMNS, "comments"])
        print(f"{name:24}{cells}{share:>10.1f}")


def self_test():
    """Each case: name, text, lines of code, of tests, and with comments."""
    cases = [
        ("comment signs in strings", 'let a = "// no"; // yes\nlet b = "/*";\nlet c = 1; /* d */\n', 3, 0, 2),
        ("escapes", 'let a = "\\"// no \\\\";\n// yes\nlet b = \'"\'; let c = \'\\\'\'; // yes\n', 2, 0, 2),
        ("raw strings", 'let a = r#"a " // no\n /* no "#;\nlet b = br"\\"; // yes\nlet r#type = 1;\n', 4, 0, 1),
        ("nested block comments", "/* a /* b */ c\n*/ let x = 1;\n/* /* */\n\n*/\n", 1, 0, 5),
        ("documentation", "//! a\n/// b\n/** c\n*/\nfn f() {}\n//// plain\n/*** plain */\n", 1, 0, 2),
        ("lifetimes", "fn f<'a>(x: &'a str) -> &'a str { x } // '\nlet y = 'l: loop { break 'l };\n", 2, 0, 1),
        ("characters", "let a = ['{', '\\u{7b}', '\\x7b', b'{'];\n#[cfg(test)]\nmod t { }\nlet z = '/';\n", 2, 2, 0),
        ("blank lines", "\n  \nlet a = \"x\n\ny\";\n", 2, 0, 0),
        ("test module", "fn f() {}\n#[cfg(test)]\nmod tests {\n    // not counted\n    fn g() { \"}\"; }\n}\nfn h() {}\n", 2, 4, 0),
        ("attributes between", "#[cfg(test)]\n#[expect(a, reason = \"]{\")]\nfn f() {\n}\nfn g() {}\n", 1, 4, 0),
        ("test statements", "#[cfg(test)]\nuse a::{b, c};\n#[cfg(test)]\nconst A: [u8; 2] = [1, 2];\nuse d;\n", 1, 4, 0),
        ("test field", "struct A {\n    #[cfg(test)]\n    a: u8,\n    b: u8,\n}\n", 3, 2, 0),
        ("last test field", "struct A {\n    #[cfg(test)]\n    a: u8\n}\n", 2, 2, 0),
        ("commas in signatures", "#[cfg(test)]\npub(crate) fn f<A, B>(a: A, b: B) {\n    a\n}\nfn g() {}\n", 1, 4, 0),
        ("constant functions", "#[cfg(test)]\npub const fn f() {\n}\nfn g() {}\n", 1, 3, 0),
        ("other conditions", "#[cfg(not(test))]\nfn f() {}\n#[cfg(all(test, unix))]\nfn g() {}\n", 2, 2, 0),
        ("test functions", "#[test]\nfn f() {\n}\n#[tokio::test]\nfn g() {}\n", 0, 5, 0),
        ("attribute in a comment", "// #[cfg(test)]\nfn f() {}\n", 1, 0, 1),
        ("test file", "//! a\n#![cfg(test)]\nfn f() {}\n", 0, 2, 0),
    ]
    for name, text, n_code, n_tests, n_comments in cases:
        found = File(pathlib.Path("a.rs"), text).lines()
        assert found == (n_tests, n_code, n_comments), f"{name}: (tests, code, comments) is {found}"

    sources = {
        "a/src/lib.rs": "mod b;\n#[cfg(test)]\nmod tests;\n#[cfg(test)]\n#[path = \"odd.rs\"]\nmod other;\n",
        "a/src/b.rs": "fn b() {}\nmod c { mod d; }\n#[cfg(test)]\nmod tests;\n",
        "a/src/b/c/d.rs": "fn d() {}\n",
        "a/src/b/tests.rs": "mod deep;\n",
        "a/src/b/tests/deep.rs": "fn deep() {}\n",
        "a/src/tests.rs": "fn t() {}\n",
        "a/src/odd.rs": "fn o() {}\n",
        "a/src/made.rs": "// @generated by a tool\nfn m() {}\n",
        "a/examples/e.rs": "fn e() {}\n",
        "a/benches/e.rs": "fn e() {}\n",
        "a/tests/it.rs": "fn e() {}\n",
        "a/c/src/lib.rs": "fn f() {}\n",
    }
    packages = {pathlib.Path("a"): "one", pathlib.Path("a/c"): "two"}
    table = count({pathlib.Path(name): text for name, text in sources.items()}, packages)
    one = {"code": 4, "tests": 12, "benches": 1, "examples": 1, "generated": 1, "comments": 0}
    two = dict.fromkeys(one, 0) | {"code": 1}
    assert table == {"one": one, "two": two}, table
    print(f"{len(cases) + 1} cases hold")


def main():
    arguments = sys.argv[1:]
    if arguments == ["--self-test"]:
        return self_test()
    if len(arguments) > 1 or any(argument.startswith("-") for argument in arguments):
        sys.exit(__doc__)
    top = in_git("rev-parse", "--show-toplevel", cwd=pathlib.Path(__file__).parent).decode().strip()
    os.chdir(top)
    texts = read(*arguments or [None])
    packages = {}
    for path, text in texts.items():
        name = re.search(r'^\[package\]\s*\n(?:[^\[].*\n)*?name\s*=\s*"([^"]+)"', text, re.MULTILINE)
        if path.name == "Cargo.toml" and name:
            packages[path.parent] = name[1]
    print_table(count({path: text for path, text in texts.items() if path.suffix == ".rs"}, packages))


if __name__ == "__main__":
    main()
