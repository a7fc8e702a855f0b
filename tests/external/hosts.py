"""Three hosts on one machine: network namespaces joined by a bridge that stands in a fourth, and certificates."""

import os
import re
import select
import signal
import subprocess
import time

from conftest import succeed

ADDRESSES = {"orchestrator": "10.77.0.1", "netsim": "10.77.0.2", "robotsim": "10.77.0.3"}
START_DEADLINE_S = 60


class Network:
    """Namespaces, one per host, and one with the bridge. Nothing is changed outside of them. Needs root."""

    def __init__(self):
        self.prefix = f"mm{os.getpid()}"
        self.hub = f"{self.prefix}-hub"
        self.made = []

    def __enter__(self):
        try:
            self.add(self.hub)
            self.ip(self.hub, "link", "add", "br0", "type", "bridge")
            self.ip(self.hub, "link", "set", "br0", "up")
            for number, (host, address) in enumerate(ADDRESSES.items()):
                name = self.name(host)
                self.add(name)
                port = f"port{number}"
                self.ip(self.hub, "link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", name)
                self.ip(self.hub, "link", "set", port, "master", "br0", "up")
                self.ip(name, "address", "add", f"{address}/24", "dev", "eth0")
                self.ip(name, "link", "set", "eth0", "up")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for name in reversed(self.made):
            subprocess.run(["ip", "netns", "delete", name], check=False)
        self.made = []

    def name(self, host):
        return f"{self.prefix}-{host}"

    def add(self, name):
        succeed(["ip", "netns", "add", name])
        self.made.append(name)
        self.ip(name, "link", "set", "lo", "up")

    @staticmethod
    def ip(namespace, *words):
        return succeed(["ip", "-n", namespace, *words])

    def on(self, host, command):
        """The command, to be run on that host."""
        return ["ip", "netns", "exec", self.name(host), *map(str, command)]

    def cut_off(self, host):
        """Pulls the cable of a host: what it sends goes nowhere, without an error."""
        self.ip(self.name(host), "link", "set", "eth0", "down")


class Server:
    """A running program, from the moment it prints the address it listens on to the end of the `with`."""

    def __init__(self, command, log, cwd=None):
        self.command, self.log, self.cwd = [str(word) for word in command], log, cwd
        self.address = None

    def __enter__(self):
        with open(self.log, "wb") as log:
            self.process = subprocess.Popen(
                self.command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, cwd=self.cwd,
                start_new_session=True,
            )
        try:
            self.address = self.read_address()
        except BaseException:
            self.__exit__()
            raise
        return self

    def read_address(self):
        """The first `host:port` on its standard output."""
        said = b""
        deadline = time.monotonic() + START_DEADLINE_S
        while time.monotonic() < deadline:
            if select.select([self.process.stdout], [], [], 0.5)[0]:
                part = os.read(self.process.stdout.fileno(), 4096)
                said += part
                if found := re.search(rb"([0-9.]+:[0-9]+)", said):
                    return found[1].decode()
                if not part:
                    break
        raise AssertionError(f"no address from {' '.join(self.command)}\n{said.decode()}\n{self.log.read_text()}")

    def __exit__(self, *_):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGTERM)
            try:
                self.process.wait(timeout=START_DEADLINE_S)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait()
        self.process.stdout.close()


class Authority:
    """A certificate authority made by openssl, and what it signs."""

    def __init__(self, directory, name):
        self.directory = directory
        directory.mkdir()
        self.key, self.certificate = directory / "ca.key", directory / "ca.pem"
        self.openssl(
            "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2",
            "-subj", f"/CN={name}", "-keyout", self.key, "-out", self.certificate,
            "-addext", "basicConstraints=critical,CA:TRUE", "-addext", "keyUsage=critical,keyCertSign",
        )

    def sign(self, name, usage, address=None):
        """Key and certificate for `serverAuth` (of an address) or `clientAuth`: two paths."""
        key, request, signed, extensions = (
            self.directory / f"{name}.{suffix}" for suffix in ("key", "csr", "pem", "ext")
        )
        self.openssl(
            "req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes",
            "-subj", f"/CN={name}", "-keyout", key, "-out", request,
        )
        lines = ["basicConstraints=critical,CA:FALSE", "keyUsage=critical,digitalSignature"]
        lines += [f"extendedKeyUsage={usage}", f"subjectAltName={f'IP:{address}' if address else f'DNS:{name}'}"]
        extensions.write_text("\n".join(lines) + "\n")
        self.openssl(
            "x509", "-req", "-in", request, "-CA", self.certificate, "-CAkey", self.key, "-CAcreateserial",
            "-days", "2", "-extfile", extensions, "-out", signed,
        )
        return key, signed

    @staticmethod
    def openssl(*words):
        succeed(["openssl", *words])
