"""The three programs on three hosts, over TLS, leave the recording that one host leaves, byte for byte."""

import contextlib
import re
import subprocess
import time

import pytest
from conftest import ROOT, RUN_DEADLINE_S, only_directory, program, succeed
from hosts import ADDRESSES, Authority, Network, Server
from recording import same_recording

PORTS = {"netsim": 50051, "robotsim": 50052}

# Of two sides that are wrong, the one that is named is the one that was called first.
EITHER_SIDE = "(netsim|robotsim): "

# After a cable is pulled, nothing more arrives and no error either. The run must notice by its own deadlines.
CUT_OFF_DEADLINE_S = 60


@pytest.fixture(scope="module")
def network():
    with Network() as network:
        yield network


@pytest.fixture(scope="module")
def authority(tmp_path_factory):
    return Authority(tmp_path_factory.mktemp("tls") / "ours", "Murmuration test authority")


@pytest.fixture(scope="module")
def certificates(authority):
    """Key and certificate of each side, by name; `orchestrator` has those of a client."""
    signed = {side: authority.sign(side, "serverAuth", ADDRESSES[side]) for side in PORTS}
    signed["orchestrator"] = authority.sign("orchestrator", "clientAuth")
    return signed


def listen(side):
    return ["--listen", f"{ADDRESSES[side]}:{PORTS[side]}"]


@contextlib.contextmanager
def sides(network, tmp_path, options):
    """Both simulators, each on its host, started with `options(side)`."""
    with contextlib.ExitStack() as stack:
        for side in PORTS:
            command = network.on(side, [program(side), *listen(side), *options(side)])
            server = stack.enter_context(Server(command, tmp_path / f"{side}.log"))
            assert server.address == f"{ADDRESSES[side]}:{PORTS[side]}"
        yield


def orchestrate(network, out, scheme="https", options=(), config="configs/flocking.toml"):
    """The command of a run on the orchestrator's host."""
    urls = [
        word for side in PORTS for word in (f"--{side}", f"{scheme}://{ADDRESSES[side]}:{PORTS[side]}")
    ]
    command = [program("murmuration"), "run", config, *urls, "--out", out, *options]
    return network.on("orchestrator", command)


def refuse(command, *patterns):
    """Runs a command that must fail within its deadline, saying something that fits each pattern. Returns its exit
    status."""
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=RUN_DEADLINE_S, cwd=ROOT
    )
    said = done.stdout + done.stderr
    assert done.returncode in (1, 2), f"exit status {done.returncode}: {said}"
    for pattern in patterns:
        assert re.search(pattern, said), f"nothing like {pattern!r}: {said}"
    return done.returncode


def server_tls(certificates, side):
    key, certificate = certificates[side]
    return ["--tls-cert", certificate, "--tls-key", key]


def client_tls(certificates):
    key, certificate = certificates["orchestrator"]
    return ["--tls-cert", certificate, "--tls-key", key]


def test_over_tls_the_recording_is_that_of_one_host(network, authority, certificates, flocking, tmp_path):
    out = tmp_path / "out"
    with sides(network, tmp_path, lambda side: server_tls(certificates, side)):
        succeed(orchestrate(network, out, options=["--tls-ca", authority.certificate]), cwd=ROOT)
    same_recording(flocking, only_directory(out))


def test_with_certificates_on_both_ends_the_recording_is_that_of_one_host(
    network, authority, certificates, flocking, tmp_path
):
    out = tmp_path / "out"

    def options(side):
        return [*server_tls(certificates, side), "--tls-client-ca", authority.certificate]

    with sides(network, tmp_path, options):
        tls = ["--tls-ca", authority.certificate]
        refuse(orchestrate(network, out, options=tls), EITHER_SIDE, "--tls-cert")
        succeed(orchestrate(network, out, options=[*tls, *client_tls(certificates)]), cwd=ROOT)
    same_recording(flocking, only_directory(out))


def test_a_server_signed_by_another_authority_is_refused(network, certificates, tmp_path):
    other = Authority(tmp_path / "other", "Another authority")
    with sides(network, tmp_path, lambda side: server_tls(certificates, side)):
        refuse(
            orchestrate(network, tmp_path / "out", options=["--tls-ca", other.certificate]),
            EITHER_SIDE, "certificate",
        )


def test_a_server_with_the_certificate_of_another_address_is_refused(
    network, authority, certificates, tmp_path
):
    swapped = {"netsim": "robotsim", "robotsim": "netsim"}
    with sides(network, tmp_path, lambda side: server_tls(certificates, swapped[side])):
        refuse(
            orchestrate(network, tmp_path / "out", options=["--tls-ca", authority.certificate]),
            EITHER_SIDE, "certificate",
        )


@pytest.mark.parametrize("side", PORTS)
def test_off_loopback_a_side_without_tls_refuses_to_listen(network, side):
    command = network.on(side, [program(side), *listen(side)])
    assert refuse(command, re.escape(ADDRESSES[side]), "--tls-cert", "--insecure-no-tls") == 2


def test_without_tls_but_with_the_flag_that_says_so_the_recording_is_that_of_one_host(
    network, flocking, tmp_path
):
    out = tmp_path / "out"
    with sides(network, tmp_path, lambda _: ["--insecure-no-tls"]):
        succeed(orchestrate(network, out, scheme="http"), cwd=ROOT)
    same_recording(flocking, only_directory(out))


@pytest.mark.parametrize("side", PORTS)
def test_a_host_that_is_cut_off_ends_the_run_with_its_name(
    network, authority, certificates, tmp_path, side
):
    out = tmp_path / "out"
    with sides(network, tmp_path, lambda name: server_tls(certificates, name)):
        options = ["--tls-ca", authority.certificate, "--set", "experiment.duration_s=1e6"]
        run = subprocess.Popen(
            orchestrate(network, out, options=options),
            cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )
        try:
            wait_until_recording(out, run)
            network.cut_off(side)
            said, _ = run.communicate(timeout=CUT_OFF_DEADLINE_S)
        finally:
            network.ip(network.name(side), "link", "set", "eth0", "up")
            run.kill()
            run.wait()
    assert run.returncode == 1, said
    assert f"{side}: " in said, said
    assert (only_directory(out) / "summary.json").exists(), "what was recorded is kept"


def wait_until_recording(out, run):
    """Returns when a recording has grown several times, so that the run is under way."""
    deadline = time.monotonic() + 60
    sizes = set()
    while time.monotonic() < deadline and run.poll() is None:
        sizes.add(sum(path.stat().st_size for path in out.glob("**/*.mcap")))
        if len(sizes) > 3:
            return
        time.sleep(0.05)
    raise AssertionError(f"nothing is recorded below {out}: {run.poll()}")
