"""Texts of the program in the terms of Python: options as keyword arguments."""

from __future__ import annotations

import re

# Keywords whose names differ from those of the options.
_KEYWORDS = {"budget": "budget_s"}
# Options that are switched on.
_FLAGS = "all|allow-command|replace|restart|unverified"
# Options with a value that a text may advise.
_WITH_VALUE = "allow-file|allow-url|memory-budget|netsim|out|robotsim|seed|threads"
# What the program adds for those who type its commands.
_OF_SHELL = re.compile(r"(?:\n+Usage: [^\n]*)?\n+For more information, try '--help'\.$")
# How the program reports a trial that failed while others still ran, and all of them at the end.
_FAILED_TRIAL = re.compile(r"warning: trial \S+ failed twice: ")
_FAILED_TRIALS = re.compile(r"warning: \d+ of \d+ trials failed and have no figures")
# A command without arguments is a function; one with arguments is for a shell.
_COMMAND = re.compile(r"`?\bmurmuration (run|sweep|compare|diagnose|extend|simulate|power|metrics)\b(?! [-\w./]*[/.-]\w)`?")
_METRICS = "`murmuration metrics` lists the short names, `murmuration metrics --all` all paths"


def with_keywords(text: str) -> str:
    """A text whose options are keyword arguments, without hints for a shell."""
    text = _OF_SHELL.sub("", text.strip()).removeprefix("error: ").replace(_METRICS, "murmuration.metrics() lists all names")
    return "\n".join(_line(line) for line in text.splitlines())


def failure(said: str) -> str:
    """Why the program failed, from all that it wrote to standard error: the error first, and then what it warned of before."""
    lines = said.splitlines()
    at = next((place for place, line in enumerate(lines) if line.startswith("error: ")), 0)
    before = lines[:at]
    if any(_FAILED_TRIALS.match(line) for line in before):
        # Those are in the account of all trials that failed.
        before = [line for line in before if not _FAILED_TRIAL.match(line)]
    # The last lines of a simulator that crashed are quoted in the error.
    quoted = {line.strip() for line in lines[at:]}
    before = [line for line in before if line.strip() not in quoted]
    parts = [with_keywords("\n".join(lines[at:])), with_keywords("\n".join(before))]
    return "\n".join(part for part in parts if part)


def keyword_of(key: str) -> str:
    """A dotted key as a keyword argument. Entries of lists have none."""
    return key if "[" in key else key.replace(".", "__")


def _line(line: str) -> str:
    line = re.sub(r"^invalid value '(.*)' for '--([a-z-]+) <[^>]*>': (.*)$", _refused_value, line)
    line = re.sub(r"'--([a-z-]+)(?: <[^>]*>)?'", lambda found: _argument(found[1]), line)
    line = re.sub(rf"--({_FLAGS})\b", lambda found: f"{_argument(found[1])}=True", line)
    line = line.replace("with --losses, or in a column", "in a column")
    line = _COMMAND.sub(r"murmuration.\1", line)
    line = re.sub(r"--set '?([\w.]+)=([^\s']+)'?", lambda found: f"{keyword_of(found[1])}={found[2]}", line)
    line = re.sub(r"--set\b", "a keyword argument", line)
    line = re.sub(rf"--({_WITH_VALUE}) '([^']+)'", lambda found: f"{_argument(found[1])}='{found[2]}'", line)
    line = re.sub(rf"--({_WITH_VALUE}) ([\w./:-]*[\w/])", lambda found: f"{_argument(found[1])}='{found[2]}'", line)
    return re.sub(rf"--({_WITH_VALUE})\b", lambda found: _argument(found[1]), line)


def _refused_value(found: re.Match[str]) -> str:
    value = found[1] if re.fullmatch(r"[-+.\de]+", found[1]) else repr(found[1])
    return f"{_argument(found[2])} {found[3]}, got {value}"


def _argument(option: str) -> str:
    return _KEYWORDS.get(option, option.replace("-", "_"))
