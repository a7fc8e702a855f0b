"""What `release/make` makes: an archive that needs nothing else, packed the same way twice, and files about it that others can read."""

import configparser
import hashlib
import os
import re
import shutil
import subprocess
import tarfile
import tomllib
from pathlib import Path

import pytest
import yaml
from conftest import BUILT, ROOT, only_directory, program, succeed
from recording import same_recording

SIDES = ("netsim", "robotsim")
VERSION = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
NAME = f"murmuration-{VERSION}-x86_64-linux"
TESTED = Path(program("murmuration"))

# The static program, where a maintainer has built it. CI packs the one that every test uses.
STATIC = BUILT.parent / "x86_64-unknown-linux-musl" / "dist" / "murmuration"
PACKED = STATIC if STATIC.exists() else TESTED


def make(out, *options, epoch="1700000000", **settings):
    command = [ROOT / "release/make", "--program", PACKED, "--no-wheel", "--out", out, *options]
    succeed(command, env={**os.environ, "SOURCE_DATE_EPOCH": epoch}, **settings)
    return out / f"{NAME}.tar.gz"


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    return make(tmp_path_factory.mktemp("dist"))


@pytest.fixture(scope="module")
def unpacked(archive, tmp_path_factory):
    where = tmp_path_factory.mktemp("unpacked")
    with tarfile.open(archive) as file:
        file.extractall(where, filter="data")
    return where / NAME


def copied(context, root):
    """Assembles the file system that the Containerfile of an archive describes. Returns the words of its entry point and its
    working directory."""
    entry, directory = None, "/"
    lines = [line for line in (context / "Containerfile").read_text().splitlines() if line and not line.startswith("#")]
    assert lines[0] == "FROM scratch"
    for line in lines[1:]:
        instruction, _, rest = line.partition(" ")
        if instruction == "COPY":
            source, target = (Path(word) for word in rest.split())
            to = root / target.relative_to("/")
            to.parent.mkdir(parents=True, exist_ok=True)
            if (context / source).is_dir():
                shutil.copytree(context / source, to)
            else:
                shutil.copy(context / source, to)
        elif instruction == "WORKDIR":
            directory = rest
            (root / rest.lstrip("/")).mkdir(parents=True, exist_ok=True)
        elif instruction == "ENTRYPOINT":
            entry = re.findall(r'"([^"]*)"', rest)
        else:
            raise AssertionError(f"this test does not know the instruction {instruction}")
    return entry, directory


def add_libraries(binary, root):
    """A program that is not static also needs its shared libraries."""
    linked = subprocess.run(["ldd", binary], capture_output=True, text=True, check=False).stdout
    for library in re.findall(r"(/\S+) \(0x", linked):
        to = root / library.lstrip("/")
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(library, to)


@pytest.fixture(scope="module")
def container(unpacked, tmp_path_factory):
    """Runs a command in the container's file system, with nothing mounted but /proc, as a container engine does."""
    root = tmp_path_factory.mktemp("root")
    entry, directory = copied(unpacked, root)
    if PACKED is TESTED:
        add_libraries(TESTED, root)
    (root / "proc").mkdir()

    def run(*words):
        inside = ["chroot", root, *entry, *words]
        return succeed(["unshare", "--mount", "--pid", "--fork", f"--mount-proc={root}/proc", *inside], env={"PATH": "/usr/sbin:/usr/bin:/sbin:/bin"})

    return root, directory, run


def test_the_sums_are_those_of_the_files(archive):
    lines = (archive.parent / "SHA256SUMS").read_text().splitlines()
    assert dict(reversed(line.split("  ")) for line in lines) == {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in archive.parent.iterdir() if path.name != "SHA256SUMS"
    }


def test_two_runs_make_the_same_bytes(archive, tmp_path):
    again = make(tmp_path / "again", cwd=tmp_path, umask=0o077)
    assert again.read_bytes() == archive.read_bytes()
    assert make(tmp_path / "later", epoch="1700000001").read_bytes() != archive.read_bytes()


def test_the_archive_names_no_owner_and_no_other_time(archive):
    with tarfile.open(archive) as file:
        members = file.getmembers()
    assert {(member.uid, member.gid, member.uname, member.gname, member.mtime) for member in members} == {(0, 0, "", "", 1_700_000_000)}
    assert {oct(member.mode) for member in members if not member.issym()} <= {"0o644", "0o755"}
    assert [member.name for member in members] == sorted(
        (member.name for member in members), key=lambda name: name.split("/")
    )


def test_the_archive_has_what_it_should(unpacked):
    files = {str(path.relative_to(unpacked)) for path in unpacked.rglob("*") if not path.is_dir()}
    doc = {f"share/doc/murmuration/{name}" for name in ("README.md", "CHANGELOG.md", "LICENSE-APACHE", "LICENSE-MIT", "CITATION.cff", "hosts.md")}
    units = {f"lib/systemd/system/murmuration-{side}@.service" for side in SIDES}
    assert {"bin/murmuration", "bin/orchestrator", "Containerfile"} | doc | units <= files
    configs = succeed(["git", "ls-files", "configs"], cwd=ROOT).split()
    assert {f"share/murmuration/{name}" for name in configs} <= files
    assert os.readlink(unpacked / "bin/orchestrator") == "murmuration"
    for name in ("murmuration", "orchestrator"):
        assert succeed([unpacked / "bin" / name, "--version"]) == f"{name} {VERSION}\n"

    shells = ("bash-completion/completions/murmuration", "zsh/site-functions/_murmuration", "fish/vendor_completions.d/murmuration.fish")
    for name in shells:
        assert "murmuration" in (unpacked / "share" / name).read_text(), name
    assert {f"share/man/man1/murmuration{page}.1.gz" for page in ("", "-run", "-diagnose")} <= files


def test_a_folder_that_is_no_release_is_not_touched(tmp_path):
    (tmp_path / "mine").write_text("mine")
    done = subprocess.run(
        [ROOT / "release/make", "--program", PACKED, "--no-wheel", "--out", tmp_path], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2 and "exists and is no release" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_the_container_needs_nothing_else(container, flocking):
    root, directory, run = container
    assert VERSION in run("--version")
    run("run", "/configs/flocking.toml", "--out", f"{directory}/runs")
    same_recording(only_directory(root / directory.lstrip("/") / "runs"), flocking)


@pytest.mark.parametrize("side", SIDES)
def test_the_units_restrict_what_the_simulator_may_do(side, unpacked, tmp_path):
    name = f"murmuration-{side}@.service"
    text = (unpacked / "lib/systemd/system" / name).read_text()
    unit = configparser.RawConfigParser(strict=False, comment_prefixes=("#",), delimiters=("=",))
    unit.optionxform = str
    unit.read_string(text)
    service = unit["Service"]
    assert service["DynamicUser"] == service["NoNewPrivileges"] == service["ProtectHome"] == "yes"
    assert service["ProtectSystem"] == "strict" and service["CapabilityBoundingSet"] == ""
    assert service["EnvironmentFile"] == f"/etc/murmuration/{side}-%i.env"

    # Every option of the command is one that the program has.
    words = service["ExecStart"].split()
    assert words[:2] == ["/usr/local/bin/murmuration", side]
    known = succeed([unpacked / "bin/murmuration", side, "--help"])
    options = {word for word in words if word.startswith("--")}
    assert options and all(f"{option} <" in known for option in options)

    # systemd itself reads it. It looks for the program, which is not installed here.
    installed = tmp_path / name.replace("@", "@1")
    installed.write_text(text.replace(words[0], "/bin/true"))
    verify = subprocess.run(["systemd-analyze", "verify", installed], capture_output=True, text=True, check=False)
    assert verify.returncode == 0 and not verify.stderr, verify.stderr


def test_the_citation_has_what_the_format_requires():
    """docs/releasing.md has the full check, by cffconvert, whose libraries are older than those of other tests."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["cff-version"] == "1.2.0" and citation["type"] == "software"
    assert citation["message"] and citation["title"] and citation["abstract"]
    assert citation["authors"] == [{"name": "Murmuration maintainers"}]
    assert citation["license"] == ["Apache-2.0", "MIT"]
    assert citation["version"] == VERSION
    (paper,) = citation["references"]
    assert paper["type"] == "article" and paper["title"] and paper["authors"]
    assert "arXiv:2108.13606" in [identifier["value"] for identifier in paper["identifiers"]]
