"""ns-3 as the network: netsim/examples/ns3 keeps the contract, drives a run, and agrees with netsim as far as docs/validation.md says."""

import importlib.util
import os
import subprocess

import pyarrow.parquet as pq
import pytest
from conftest import ROOT, only_directory, program, succeed
from hosts import Server

EXAMPLE = ROOT / "netsim/examples/ns3"
# A full build takes about 30 s of processor time, on two cores 20 s.
BUILD_DEADLINE_S = 90
# 33 ratios beside each other: two equal programs show more once in 500 comparisons.
MOST_STANDARD_ERRORS = 4.0
# Both estimates have a standard error of 0.01 dB (2000 frames per point).
HALF_WITHIN_DB = 0.04


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The example's program, built from nothing with Debian's packages."""
    folder = tmp_path_factory.mktemp("ns3-build")
    before = os.times()
    succeed(["make", "-j2", "-C", EXAMPLE, f"BUILD={folder}"], 4 * BUILD_DEADLINE_S)
    after = os.times()
    used_s = after.children_user + after.children_system - before.children_user - before.children_system
    assert used_s < BUILD_DEADLINE_S, f"the example took {used_s:.0f} s of processor time to build"
    return folder / "ns3-network"


@pytest.fixture(scope="module")
def ns3(built, tmp_path_factory):
    """The example, running: its address."""
    with Server([built, "127.0.0.1:0"], tmp_path_factory.mktemp("ns3") / "log", cwd="/") as server:
        yield server.address


@pytest.fixture(scope="module")
def compared(built, tmp_path_factory):
    """What the example's script found: rows as in the documentation, figures by name."""
    spec = importlib.util.spec_from_file_location("ns3_compare", EXAMPLE / "compare.py")
    compare = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(compare)
    output = tmp_path_factory.mktemp("ns3-compare") / "comparison.csv"
    rows, figures = compare.measure(str(built), program("murmuration"), output)
    return compare, rows, figures, output


def run(address, out, *options):
    succeed([program("murmuration"), "run", ROOT / "configs/external-ns3.toml", "--netsim", address, "--out", out, *options])
    return only_directory(out)


def heard(folder):
    return pq.read_table(folder / "steps.parquet", columns=["step", "agent", "n_heard"])["n_heard"].to_numpy()


def test_it_keeps_the_contract(ns3):
    said = succeed([program("murmuration"), "conformance", "netsim", f"http://{ns3}"])
    assert "0 failed" in said and "BROKEN" not in said and "lax" not in said, said


def test_a_run_over_it_is_reproducible_and_its_path_loss_matters(ns3, tmp_path):
    url = f"http://{ns3}"
    near, again = run(url, tmp_path / "near"), run(url, tmp_path / "again")
    assert (near / "run.mcap").read_bytes() == (again / "run.mcap").read_bytes()
    # Ten robots on a line, 2 m apart, all in reach of each other; with 40 dB less only neighbours are.
    assert heard(near).mean() > 8.5
    assert 0.5 < heard(run(url, tmp_path / "far", "--set", "netsim.tx_power_dbm=-40.0")).mean() < 8.0


def test_it_listens_where_the_environment_says(built, compared, tmp_path):
    compare = compared[0]
    address = f"unix:{tmp_path / 'ns3.sock'}"
    process = subprocess.Popen([built], env=os.environ | {"MURMURATION_LISTEN": address}, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == f"listening on {address}\n"
        asked = compare.netsim_pb2.NetSimServiceDescribeRequest()
        with compare.grpc.insecure_channel(address) as channel:
            described = compare.netsim_pb2_grpc.NetSimServiceStub(channel).Describe(asked, timeout=60)
        assert described.name == "ns3-network" and described.contract_version == 1
    finally:
        process.terminate()
        process.wait()


def test_wrong_keys_are_refused_all_at_once(ns3, tmp_path):
    config = tmp_path / "wrong.toml"
    config.write_text((ROOT / "configs/external-ns3.toml").read_text() + "channel = 27\nnoise = 3\n")
    done = subprocess.run([program("murmuration"), "run", config, "--netsim", f"http://{ns3}", "--out", tmp_path / "out"],
                          capture_output=True, text=True, timeout=60)  # fmt: skip
    assert done.returncode != 0
    assert "channel: must be an integer from 11 to 26" in done.stderr and "noise: unknown key" in done.stderr, done.stderr


def test_rssi_is_the_same(compared):
    _, _, figures, _ = compared
    assert figures["rssi, log-distance"] < 0.01 and figures["rssi, friis"] < 0.01


def test_as_many_frames_arrive_under_the_same_noise(compared):
    compare, _, figures, _ = compared
    theirs, ours = figures["noise, ns-3"], figures["noise, same noise and length"]
    assert theirs.sent == ours.sent == compare.PERIODS
    assert compare.worst_z(theirs.share, ours.share, theirs.sent) < MOST_STANDARD_ERRORS
    assert abs(theirs.half_db - ours.half_db) < HALF_WITHIN_DB
    default = figures["noise, default noise of `o-qpsk`"]
    assert abs(default.half_db - theirs.half_db - (-105.0 - compare.NOISE_DBM)) < HALF_WITHIN_DB


def test_of_two_frames_as_many_arrive_as_if_the_other_were_noise(compared):
    compare, _, figures, _ = compared
    theirs, ours = figures["interference, ns-3"], figures["interference, netsim, rejection 0.5 dB"]
    assert ours.sent > 0.95 * compare.PERIODS
    for stronger_db in (1.0, 1.5, 2.0, 3.0, 5.0):
        (k, n), (own_k, own_n) = theirs.stronger(stronger_db), ours.stronger(stronger_db)
        low, high = compare.wilson(k, n, z=MOST_STANDARD_ERRORS)
        own_low, own_high = compare.wilson(own_k, own_n, z=MOST_STANDARD_ERRORS)
        assert low < own_high and own_low < high, f"{stronger_db} dB: {k}/{n}, {own_k}/{own_n}"


def test_where_ns3_differs_it_differs_as_documented(compared):
    compare, _, figures, _ = compared
    ends_first = figures["interference, ns-3, interferer ends first"]
    assert ends_first.of_sender(0, -8.0) == (compare.PERIODS, compare.PERIODS)
    assert figures["interference, ns-3, no propagation delay"].of_sender(1, 8.0) == (0, compare.PERIODS)


def test_the_documentation_has_these_figures(compared):
    compare, rows, figures, output = compared
    page = (ROOT / "docs/validation.md").read_text()
    z = compare.worst_z(figures["noise, ns-3"].share, figures["noise, same noise and length"].share, compare.PERIODS)
    assert f"at most {z:.1f} standard errors" in page
    default = figures["interference, netsim, rejection 3 dB"]
    half_db = compare.crossing(compare.SIR_DB, default.counts.sum(axis=0), 2 * default.sent)[0]
    assert f"from {half_db:.1f} dB on" in page
    missing = [row for row in ("| " + " | ".join(cells) + " |" for cells in rows) if row not in page]
    assert not missing, missing
    assert len(output.read_text().splitlines()) > 500

