"""Holds netsim's radio against ns-3's lr-wpan: the same positions, powers and requests go to both.

    python compare.py --ns3 build/ns3-network --orchestrator ../../../target/release/murmuration --output comparison.csv

Compared are the RSSI over distance, the share of frames received over the signal-to-noise ratio, and that over the
signal-to-interference ratio while two robots send at once. Each row of the CSV file is one share, `received` of `sent`, with its
95 % Wilson interval, or one RSSI. What is printed are the rows of the table in docs/validation.md.
"""

import argparse
import contextlib
import csv
import dataclasses
import math
import re
import subprocess
import sys
from pathlib import Path

import grpc
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "python/src"))
from murmuration._contract import common_pb2, netsim_pb2, netsim_pb2_grpc

CARRIER_HZ = 2.44e9  # channel 18
EXPONENT = 3.0
PERIOD_NS = 100_000_000
PAYLOAD_BYTES = 48
# What ns-3 counts the bits of: header 9, payload, checksum 2, and the 6 bytes of synchronisation and PHY header.
PSDU_BYTES = PAYLOAD_BYTES + 11
PPDU_BYTES = PSDU_BYTES + 6
# ns-3's noise: thermal noise (k = 1.3803e-23 J/K, 290 K) in the 5 MHz that it integrates over.
NOISE_DBM = 10 * math.log10(1.3803e-23 * 290 * 5e6 * 1e3)
SNR_DB = np.arange(-1.5, 2.51, 0.125)
SIR_DB = np.concatenate([np.arange(-8.0, 0.0, 0.5), np.arange(0.5, 8.1, 0.5)])
SECONDS_TO_FORM = 900
PERIODS = 2000
SEED = 1


class Network:
    """A network that listens at `address`."""

    def __init__(self, address, config, n, columns=()):
        options = [("grpc.max_receive_message_length", 1 << 28)]
        self.stub, self.n = netsim_pb2_grpc.NetSimServiceStub(grpc.insecure_channel(address, options=options)), n
        self.step, self.time_ns = 0, 0
        self.began = self.stub.Configure(
            netsim_pb2.NetSimServiceConfigureRequest(
                seed=SEED, agent_count=n, step_ns=PERIOD_NS, coupling=common_pb2.COUPLING_SEQUENTIAL, config_toml=config, columns=columns
            )
        )

    def steps(self, position_m, lengths, count, period_ns=PERIOD_NS):
        """Replies to `count` steps in which robots stand at `position_m` and say as many bytes as `lengths` has."""
        alive = np.packbits(np.ones(self.n, bool), bitorder="little").tobytes()
        x_m, y_m, z_m = np.asarray(position_m, float).T.tolist()
        states = common_pb2.AgentStates(alive=alive, x_m=x_m, y_m=y_m, z_m=z_m)
        payloads = common_pb2.Payloads(length_bytes=lengths, data=bytes(sum(lengths)))
        for _ in range(count):
            self.step, self.time_ns = self.step + 1, self.time_ns + period_ns
            yield self.stub.Step(
                netsim_pb2.NetSimServiceStepRequest(step=self.step, until_ns=self.time_ns, states=states, payloads=payloads)
            )


def heard(reply, n):
    """Receivers and transmissions of a reply's deliveries, in the contract's order."""
    given = reply.deliveries
    n_sent = len(given.transmissions.sender)
    if given.heard_bitmap:
        rows = np.frombuffer(given.heard_bitmap, np.uint8).reshape(n, -1)
        return np.nonzero(np.unpackbits(rows, axis=1, count=n_sent, bitorder="little"))
    ends = np.array(given.heard_end, np.int64)
    return np.repeat(np.arange(len(ends)), np.diff(ends, prepend=0)), np.array(given.heard, np.int64)


def ns3_config(**keys):
    """The section [netsim] of ns-3's network. Every frame is sent at once: no slots, no back-off."""
    keys = {"channel": 18, "exponent": EXPONENT, "slot_s": 0.0, "min_be": 0} | keys
    return "\n".join(f"{key} = {str(value).lower() if isinstance(value, bool) else repr(value)}" for key, value in keys.items())


def own_config(reception, tx_power_dbm=0.0, propagation="log-distance", rest=""):
    exponent = f"exponent = {EXPONENT}\n" if propagation == "log-distance" else ""
    return (
        f'{rest}\n[phy]\npropagation = "{propagation}"\n{exponent}carrier_hz = {CARRIER_HZ}\ntx_power_dbm = {tx_power_dbm}\n'
        f"[phy.reception]\n{reception}\n"
    )


def o_qpsk(noise_floor_dbm=NOISE_DBM, frame_bytes=PPDU_BYTES):
    return f'kind = "o-qpsk"\nnoise_floor_dbm = {noise_floor_dbm!r}\nframe_bytes = {frame_bytes}'


def distance_m(rssi_dbm):
    """Where a frame sent with 0 dBm arrives with that power, under the exponent of this comparison."""
    loss_at_1_m_db = 20 * math.log10(4 * math.pi * CARRIER_HZ / 299_792_458)
    return 10 ** ((-loss_at_1_m_db - rssi_dbm) / (10 * EXPONENT))


def share(address, config, position_m, periods):
    """How many of `periods` frames of robot 0 each other robot receives."""
    n = len(position_m)
    network, counts, sent = Network(address, config, n), np.zeros(n, int), 0
    for reply in network.steps(position_m, [PAYLOAD_BYTES] + [0] * (n - 1), periods):
        receivers, _ = heard(reply, n)
        counts += np.bincount(receivers, minlength=n)
        sent += len(reply.deliveries.transmissions.sender)
    return counts[1:], sent


def rssi(address, config, position_m):
    """The RSSI of one frame of robot 0 at every other robot."""
    n = len(position_m)
    network = Network(address, config, n, [common_pb2.DELIVERY_COLUMN_RSSI_DBM])
    (reply,) = network.steps(position_m, [PAYLOAD_BYTES] + [0] * (n - 1), 1)
    receivers, _ = heard(reply, n)
    assert receivers.tolist() == list(range(1, n)), f"{n - 1 - len(receivers)} robots are out of reach"
    return np.array(reply.deliveries.rssi_dbm)


def interference(address, config, position_m, lengths, periods, forming=False):
    """How often each robot but 0 and 1 receives robot 0, and robot 1, when both send at once; and how often they did."""
    n = len(position_m)
    network, counts, sent = Network(address, config, n), np.zeros((2, n), int), 0
    lengths = lengths + [0] * (n - 2)
    if forming:
        step_ns = 1_000_000_000
        for reply in network.steps(position_m, [0] * n, SECONDS_TO_FORM, step_ns):
            if reply.formation.formed:
                break
        else:
            raise RuntimeError(f"the network did not form in {SECONDS_TO_FORM} s")
    for reply in network.steps(position_m, lengths, periods):
        air = reply.deliveries.transmissions
        if list(air.sender) != [0, 1] or air.sent_ns[0] != air.sent_ns[1]:
            continue  # one of them sent something else in that slot
        sent += 1
        receivers, which = heard(reply, n)
        np.add.at(counts, (which, receivers), 1)
    return counts[:, 2:], sent


def wilson(k, n, z=1.959964):
    """The 95 % Wilson interval of a share of k in n."""
    middle, half = (k + z * z / 2) / (n + z * z), z / (n + z * z) * math.sqrt(k * (n - k) / n + z * z / 4)
    return middle - half, middle + half


def crossing(x, counts, n, draws=2000):
    """Where a share rises through one half (dB): the estimate, and its 95 % interval by a parametric bootstrap."""

    def where(share):
        above = int(np.flatnonzero(share >= 0.5)[0])
        low, high = share[above - 1], share[above]
        return x[above - 1] + (0.5 - low) / (high - low) * (x[above] - x[above - 1])

    share_of = counts / n
    rng = np.random.default_rng(1)
    drawn = [where(rng.binomial(n, share_of) / n) for _ in range(draws)]
    return where(share_of), *np.quantile(drawn, [0.025, 0.975])


def line(distances_m):
    return [(0.0, 0.0, 0.0), *((d, 0.0, 0.0) for d in distances_m)]


class Rows:
    """Rows of the CSV file."""

    def __init__(self):
        self.rows = []

    def rssi(self, case, distances_m, rssi_dbm):
        self.rows += [["rssi", case, f"{d:.3f}", "", "", f"{value:.5f}", "", ""] for d, value in zip(distances_m, rssi_dbm)]

    def shares(self, experiment, case, x_db, counts, n):
        for at, k in zip(x_db, counts):
            low, high = wilson(k, n)
            self.rows.append([experiment, case, f"{at:.3f}", k, n, f"{k / n:.4f}", f"{low:.4f}", f"{high:.4f}"])

    def write(self, path):
        with open(path, "w", newline="", encoding="utf-8") as file:
            out = csv.writer(file, lineterminator="\n")
            out.writerow(["experiment", "case", "x", "received", "sent", "value", "low", "high"])
            out.writerows(self.rows)


def compare(ns3, own, csv_rows, periods):
    """Runs everything; returns the rows of the table in docs/validation.md, and its figures by name."""
    rows, figures = [], {}

    # RSSI: both have one formula, so one frame says all.
    far_m = np.geomspace(1.5, 300, 60)
    for propagation in ("log-distance", "friis"):
        theirs = rssi(ns3, ns3_config(propagation=propagation, tx_power_dbm=20.0), line(far_m))
        ours = rssi(own, own_config(o_qpsk(), 20.0, propagation), line(far_m))
        for case, column in ((f"ns-3, {propagation}", theirs), (f"netsim, {propagation}", ours)):
            csv_rows.rssi(case, far_m, column)
        figures[f"rssi, {propagation}"] = worst_db = float(np.abs(theirs - ours).max())
        ends = [" to ".join(minus(f"{column[at]:.2f}") for at in (0, -1)) for column in (theirs, ours)]
        rows.append([f"RSSI, `{propagation}`, 1.5 to 300 m (dBm)", *ends, f"at most {worst_db:.4f} dB"])

    # Noise alone.
    theirs = noise(csv_rows, "ns-3", ns3, ns3_config(), SNR_DB, periods)
    figures["noise, ns-3"] = theirs
    for case, reception, x_db in (
        ("same noise and length", o_qpsk(), SNR_DB),
        ("without PHY header", o_qpsk(frame_bytes=PSDU_BYTES), SNR_DB),
        ("default noise of `o-qpsk`", o_qpsk(-105.0), SNR_DB - 105.0 - NOISE_DBM),
        ("default curve, `table`", 'kind = "table"', SNR_DB - 94.0 - NOISE_DBM),
    ):
        ours = noise(csv_rows, f"netsim, {case}", own, own_config(reception), x_db, periods)
        figures[f"noise, {case}"] = ours
        difference = minus(f"{ours.half_db - theirs.half_db:+.2f} dB")
        rows.append([f"SNR at which half arrive (dB): {case}", theirs.text(), ours.text(), difference])

    # Interference: receivers between two senders, 20 m apart, far above the noise.
    nearer_m = [20.0 / (1 + 10 ** (sir_db / (10 * EXPONENT))) for sir_db in SIR_DB]
    places = [(0.0, 0.0, 0.0), (20.0, 0.0, 0.0), *((d, 0.0, 0.0) for d in nearer_m)]
    for case, config, lengths in (
        ("ns-3", ns3_config(), [PAYLOAD_BYTES] * 2),
        ("ns-3, no propagation delay", ns3_config(propagation_delay=False), [PAYLOAD_BYTES] * 2),
        ("ns-3, interferer ends first", ns3_config(propagation_delay=False), [116, 10]),
    ):
        figures[f"interference, {case}"] = Interference(csv_rows, case, *interference(ns3, config, places, lengths, periods))
    for rejection_db in (0.5, 3.0):
        config = own_config(o_qpsk(), rest=SIXTISCH) + (
            f'[phy.interference]\nkind = "o-qpsk"\nnoise_floor_dbm = {NOISE_DBM!r}\nco_channel_rejection_db = {rejection_db}\n'
        )
        case = f"netsim, rejection {rejection_db:g} dB"
        lengths = [PAYLOAD_BYTES] * 2
        ours = Interference(csv_rows, case, *interference(own, config, places, lengths, periods, forming=True))
        figures[f"interference, {case}"] = ours
        for stronger_db in (0.5, 1.0, 2.0, 3.0):
            (k, n), (own_k, own_n) = figures["interference, ns-3"].stronger(stronger_db), ours.stronger(stronger_db)
            difference = minus(f"{own_k / own_n - k / n:+.3f}")
            what = f"received, {stronger_db:g} dB stronger: rejection of {rejection_db:g} dB"
            rows.append([what, share_text(k, n), share_text(own_k, own_n), difference])
    return rows, figures


@dataclasses.dataclass(frozen=True)
class Half:
    """Where half of the frames arrive (dB), with its 95 % interval; and the shares that it follows from."""

    half_db: float
    low_db: float
    high_db: float
    share: np.ndarray
    sent: int

    def text(self):
        return minus(f"{self.half_db:.2f} ({self.low_db:.2f} to {self.high_db:.2f})")


def noise(csv_rows, case, address, config, snr_db, periods):
    """The shares of frames that arrive over the signal-to-noise ratio."""
    counts, sent = share(address, config, line([distance_m(NOISE_DBM + at) for at in snr_db]), periods)
    csv_rows.shares("noise", case, snr_db, counts, sent)
    return Half(*crossing(snr_db, counts, sent), counts / sent, sent)


class Interference:
    """Frames that arrive of two senders at once, over the power of the one over that of the other."""

    def __init__(self, csv_rows, case, counts, sent):
        # What sender 0 is ahead by, sender 1 is behind by.
        self.counts, self.sent = np.array([counts[0], counts[1][::-1]]), sent
        for sender in (0, 1):
            csv_rows.shares("interference", f"{case}, sender {sender}", SIR_DB, self.counts[sender], sent)

    def of_sender(self, sender, sir_db):
        """How many of how many frames of one of them arrive."""
        return int(self.counts[sender][np.flatnonzero(SIR_DB == sir_db)[0]]), self.sent

    def stronger(self, by_db):
        """How many of how many frames of whoever is stronger by that much arrive."""
        return sum(self.of_sender(sender, by_db)[0] for sender in (0, 1)), 2 * self.sent


def share_text(k, n):
    low, high = wilson(k, n)
    return f"{k / n:.3f} ({low:.3f} to {high:.3f})"


def minus(text):
    """With the sign that the documentation has."""
    return text.replace("-", "−")


# Robots 0 and 1 send at the beginning of a period, in the same slot on the same channel, and nobody else does.
SIXTISCH = """
mode = "6tisch"
hopping_sequence = [18]
[mac]
max_drift_ppm = 0.0
[swarm]
transport = "own-cell"
[sf]
kind = "static"
slotframe_slots = 10
[[sf.cell]]
slot = 5
from = "any"
to = "all"
advertising = true
[[sf.cell]]
slot = 0
from = 0
to = "all"
[[sf.cell]]
slot = 0
from = 1
to = "all"
"""


def worst_z(a, b, n):
    """The largest difference of two shares of n over all points, in standard errors of the difference."""
    pooled = (a + b) / 2
    error = np.sqrt(2 * pooled * (1 - pooled) / n)
    return float(np.max(np.abs(a - b)[error > 0] / error[error > 0]))


@contextlib.contextmanager
def serving(command):
    """A network's program while it runs: its address."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    try:
        said = process.stdout.readline()
        found = re.search(r"[0-9.]+:[0-9]+", said)
        if not found:
            raise SystemExit(f"error: {command[0]} did not say where it listens: {said!r}")
        yield found[0]
    finally:
        process.terminate()
        process.wait()


def measure(ns3_program, orchestrator_program, output, periods=PERIODS):
    """Starts both, compares them, writes the CSV file; returns what `compare` does."""
    csv_rows = Rows()
    own_command = [orchestrator_program, "netsim", "--listen", "127.0.0.1:0"]
    with serving([ns3_program, "127.0.0.1:0"]) as ns3, serving(own_command) as own:
        rows, figures = compare(ns3, own, csv_rows, periods)
    csv_rows.write(output)
    return rows, figures


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ns3", required=True, help="the program ns3-network")
    parser.add_argument("--orchestrator", required=True, help="the program orchestrator, which has netsim inside")
    parser.add_argument("--output", default="comparison.csv", help="the CSV file to write")
    parser.add_argument("--periods", type=int, default=PERIODS, help="frames per point")
    options = parser.parse_args()
    rows, figures = measure(options.ns3, options.orchestrator, options.output, options.periods)
    for row in rows:
        print("|", " | ".join(row), "|")
    z = worst_z(figures["noise, ns-3"].share, figures["noise, same noise and length"].share, options.periods)
    print(f"largest difference of the {len(SNR_DB)} points under the same noise: {z:.1f} standard errors")
    k, n = figures["interference, ns-3, interferer ends first"].of_sender(0, -8.0)
    print(f"ns-3, frame of 133 bytes, the first 27 beside one 8 dB stronger: {k} of {n} received")
    k, n = figures["interference, ns-3, no propagation delay"].of_sender(1, 8.0)
    print(f"ns-3, the later of two frames, 8 dB stronger: {k} of {n} received")


if __name__ == "__main__":
    main()
