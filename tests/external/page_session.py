"""The page that shows runs: a server of ours, and a browser that opens it."""

import contextlib
import os
import re
import signal
import subprocess
import time
from pathlib import Path

from conftest import ROOT, program
from playwright.sync_api import sync_playwright

# Pictures of the page are kept for whoever reviews.
PICTURES = Path(os.environ.get("CARGO_TARGET_DIR") or ROOT / "target") / "external" / "page"
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking"]
ADDRESS = re.compile(r"http://127\.0\.0\.1:\d+/\?token=[0-9a-f]{32}")


@contextlib.contextmanager
def browser():
    """Debian's Chromium."""
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
        try:
            yield started
        finally:
            started.close()


@contextlib.contextmanager
def serving(*arguments, folder=ROOT):
    """The orchestrator with these arguments, until it is interrupted, and the address that it printed."""
    command = [program("murmuration"), *map(str, arguments)]
    process = subprocess.Popen(
        command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        said = ""
        while not ADDRESS.search(said):
            line = process.stdout.readline()
            assert line, f"{' '.join(command)} ended without an address: {said}"
            said += line
        yield ADDRESS.search(said).group(), process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(timeout=60)
            finally:
                process.kill()


class Session:
    """A page that is open, and everything that went wrong in it."""

    def __init__(self, browser, url, size=(1280, 720), dark=False, touch=False, moving=False):
        """`touch`: a phone or a tablet. `moving`: the page may play by itself; else its viewer wants reduced motion."""
        self.context = browser.new_context(
            viewport={"width": size[0], "height": size[1]},
            color_scheme="dark" if dark else "light",
            reduced_motion="no-preference" if moving else "reduce",
            has_touch=touch,
            is_mobile=touch,
            accept_downloads=True,
        )
        self.page = self.context.new_page()
        self.page.set_default_timeout(60_000)
        self.complaints, self.requests = [], []
        self.page.on("console", lambda message: self.complaints.append(message.text) if message.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(url)
        self.until("window.murmuration !== undefined")
        self.page.evaluate("window.murmuration.ready")

    def state(self):
        """What is drawn now."""
        return self.page.evaluate("window.murmuration.state()")

    def seek(self, time_ns):
        """What is drawn at a time (ns)."""
        self.page.evaluate(f"window.murmuration.seek({time_ns})")
        return self.state()

    def until(self, expression, seconds=60):
        """Until an expression is true. Asked from outside: the page's policy forbids what Playwright's own waiting needs."""
        deadline = time.monotonic() + seconds
        while not self.page.evaluate(expression):
            assert time.monotonic() < deadline, f"not within {seconds} s: {expression}"
            self.page.wait_for_timeout(20)

    def wait(self, condition, seconds=60):
        """Until a condition on the state, named `s`, holds."""
        self.until(f"(() => {{ const s = window.murmuration.state(); return {condition}; }})()", seconds)
        return self.state()

    def picture(self, name):
        """Keeps a picture."""
        PICTURES.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=PICTURES / f"{name}.png")

    def press(self, name):
        """Presses a button by its label."""
        self.page.get_by_role("button", name=name, exact=True).first.click()

    def download(self, name):
        """The file that a button hands over."""
        with self.page.expect_download() as download:
            self.press(name)
        return Path(download.value.path())

    def close(self):
        """Closes the page, which must not have complained."""
        self.context.close()
        assert self.complaints == []


@contextlib.contextmanager
def opened(browser, url, **options):
    """A page that must not complain until it is closed."""
    session = Session(browser, url, **options)
    yield session
    session.close()
