"""Opens one page in headless Chromium over the DevTools pipe and notes everything it asks for and complains about."""

import base64
import fcntl
import json
import os
import select
import signal
import subprocess
import time
from dataclasses import dataclass, field

FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--remote-debugging-pipe",
]
DEADLINE_S = 60


@dataclass
class Page:
    """What was seen of a page."""

    requests: list = field(default_factory=list)
    complaints: list = field(default_factory=list)
    screenshot_png: bytes = b""
    values: dict = field(default_factory=dict)


def visit(url, profile_dir, width_px=1200, dark=False, expressions=None):
    """Renders a page and returns what it requested, what it logged, a picture of all of it, and the values (JSON) of
    the given JavaScript expressions, by name."""
    to_read, to_write = os.pipe()
    from_read, from_write = os.pipe()
    # Chromium speaks on file descriptors 3 and 4. The shell moves them there, from numbers that lie above both.
    to_read, from_write = moved_up(to_read), moved_up(from_write)
    shell = f'exec 3<&{to_read} 4>&{from_write}; exec chromium "$@"'
    browser = subprocess.Popen(
        ["bash", "-c", shell, "chromium", *FLAGS, f"--user-data-dir={profile_dir}", "about:blank"],
        pass_fds=(to_read, from_write),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    os.close(to_read)
    os.close(from_write)
    try:
        with os.fdopen(to_write, "wb", buffering=0) as out, os.fdopen(from_read, "rb", buffering=0) as into:
            return Devtools(out, into).visit(url, width_px, dark, expressions or {})
    finally:
        os.killpg(browser.pid, signal.SIGKILL)
        browser.wait()


def moved_up(descriptor):
    """The same end of a pipe under a number that the shell uses for nothing else, whatever else is open."""
    moved = fcntl.fcntl(descriptor, fcntl.F_DUPFD, 300)
    os.close(descriptor)
    return moved


class Devtools:
    """The DevTools protocol: JSON messages, each ended by a zero byte."""

    def __init__(self, out, into):
        self.out, self.into = out, into
        self.buffer = b""
        self.number = 0
        self.events = []
        self.session = None
        os.set_blocking(into.fileno(), False)

    def visit(self, url, width_px, dark, expressions):
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Network", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width_px, height=900, deviceScaleFactor=1, mobile=False,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.navigate", url=url)
        self.wait_for("Page.loadEventFired")
        page = Page()
        for name, expression in expressions.items():
            answer = self.call(
                "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
            )
            assert "exceptionDetails" not in answer, f"{name}: {answer['exceptionDetails']}"
            page.values[name] = answer["result"].get("value")
        picture = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=True)
        page.screenshot_png = base64.b64decode(picture["data"])
        for event in self.events:
            parameters = event.get("params", {})
            match event["method"]:
                case "Network.requestWillBeSent":
                    page.requests.append(parameters["request"]["url"])
                case "Network.webSocketCreated":
                    page.requests.append(parameters["url"])
                case "Runtime.exceptionThrown":
                    page.complaints.append(parameters["exceptionDetails"]["text"])
                case "Runtime.consoleAPICalled" if parameters["type"] in ("error", "warning", "assert"):
                    page.complaints.append(json.dumps(parameters["args"]))
                case "Log.entryAdded" if parameters["entry"]["level"] in ("error", "warning"):
                    page.complaints.append(parameters["entry"]["text"])
        return page

    def call(self, method, **parameters):
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        self.out.write(json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + DEADLINE_S
        while True:
            answer = self.receive(deadline, method)
            if answer.get("id") == self.number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]

    def wait_for(self, event):
        deadline = time.monotonic() + DEADLINE_S
        while not any(seen["method"] == event for seen in self.events):
            self.receive(deadline, event)

    def receive(self, deadline, awaited):
        """The next message; events are kept."""
        while b"\0" not in self.buffer:
            assert time.monotonic() < deadline, f"Chromium did not answer: {awaited}"
            select.select([self.into], [], [], 1)
            part = self.into.read(1 << 20)  # None: nothing there yet
            assert part != b"", f"Chromium ended before it answered: {awaited}"
            self.buffer += part or b""
        text, self.buffer = self.buffer.split(b"\0", 1)
        message = json.loads(text)
        if "method" in message:
            self.events.append(message)
        return message
