"""Measures environments of the Python package: steps per second, and what a reset takes. No test: for docs/performance.md.

    MURMURATION_PROGRAM=target/release/murmuration PYTHONPATH=python/src python tests/external/environment_speed.py
"""

import argparse
import statistics
import time

import numpy as np

from murmuration.env import parallel_env

NETWORKS = {
    "propagation-only": {"phy": {"propagation": "friis"}},
    "6tisch": {
        "mode": "6tisch", "phy": {"propagation": "friis"}, "sf": {"kind": "msf"}, "swarm": {"transport": "broadcast-slotframe"},
        "join": {"secure": False}, "rpl": {"dao_ack": False},
    },
}  # fmt: skip


def experiment(network, agents):
    """Robots at 0.22 per m², as in the other tables, that act once in a slotframe with a slot for each."""
    return {
        "experiment": {"name": "speed", "seed": 1, "agents": agents, "duration_s": 1e6, "control_period": {"slots": agents}},
        "robotsim": {"scenario": {"kind": "disc", "density_per_m2": 0.22}},
        "netsim": NETWORKS[network],
    }


def measured(network, agents, batches, batch_s):
    """Steps per second of each batch, and the resets (ms)."""
    env = parallel_env(experiment(network, agents))
    actions = {agent: np.zeros(2) for agent in env.possible_agents}
    resets_ms = []
    for seed in range(21):
        begun = time.perf_counter()
        env.reset(seed=seed)
        # The first reset starts the processes and forms the network.
        if seed:
            resets_ms.append(1e3 * (time.perf_counter() - begun))
    rates = []
    for _ in range(batches):
        begun, steps = time.perf_counter(), 0
        while time.perf_counter() - begun < batch_s:
            env.step(actions)
            steps += 1
        rates.append(steps / (time.perf_counter() - begun))
    env.close()
    return rates, resets_ms


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--agents", type=int, nargs="+", default=[10, 50, 200])
    parser.add_argument("--batches", type=int, default=7)
    parser.add_argument("--batch-s", type=float, default=1.0)
    options = parser.parse_args()
    print(f"{'network':<18}{'agents':>7}{'steps/s':>9}{'least':>8}{'most':>8}{'reset (ms)':>12}")
    for network in NETWORKS:
        for agents in options.agents:
            rates, resets_ms = measured(network, agents, options.batches, options.batch_s)
            print(
                f"{network:<18}{agents:>7}{statistics.median(rates):>9.0f}{min(rates):>8.0f}{max(rates):>8.0f}"
                f"{statistics.median(resets_ms):>12.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
