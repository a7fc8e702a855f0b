"""Learns to flock, once under a perfect radio and once under 6TiSCH, and asks what transfers: both policies under both radios.

    pip install "murmuration-sim[env]"
    python train_flocking.py            # a few minutes; --quick: seconds, to see that it works

Training uses environments (murmuration.env.parallel_env) and the cross-entropy method (Rubinstein 1999; de Boer et al. 2005),
which needs no gradients. Evaluation uses recorded runs (murmuration.env.evaluate), each with a network that forms anew.
The same seed prints the same table.
"""

import argparse
import tempfile

import numpy as np

from murmuration.env import evaluate, parallel_env

RADIOS = {
    # Everyone hears everyone in every period.
    "perfect": {"mode": "propagation-only", "phy": {"propagation": "full"}},
    # Motes share 64 slots of 10 ms that they choose themselves: news of a neighbour comes every 0.64 s, if its frame arrives.
    # They use one channel, on which a network forms sooner than on sixteen.
    "6tisch": {
        "mode": "6tisch", "phy": {"propagation": "experimental-randomness"}, "sf": {"kind": "sotdma"}, "swarm": {"transport": "own-cell"},
        "join": {"secure": False}, "rpl": {"dao_ack": False}, "hopping_sequence": [17],
    },
}  # fmt: skip
# Reward of a step: fast together, close together, without collisions.
REWARD = {"flock_speed_mps": 1.0, "cohesion_m": -0.1, "collisions": -0.5}
NEIGHBOURS = 8
RATE_HZ = 10.0
# Start of the search: mean and standard deviation of each parameter.
START = {
    "inertia": (1.0, 0.5), "alignment": (0.5, 0.5), "cohesion": (0.1, 0.3), "separation": (0.5, 0.5), "log_range_m": (0.0, 0.5),
    "log_patience_s": (0.0, 1.0),
}  # fmt: skip


def experiment(radio, agents, duration_s):
    return {
        "experiment": {"name": f"flock-{radio}", "seed": 1, "agents": agents, "duration_s": duration_s, "control_period": {"rate_hz": RATE_HZ}},
        "robotsim": {
            "scenario": {"kind": "square", "side_m": 8.0},
            "dynamics": {"kind": "double-integrator", "speed_cap_mps": 2.0, "acceleration_cap_mps2": 4.0},
        },
        "netsim": RADIOS[radio],
        "output": {"report": False, "links": "none"},
    }  # fmt: skip


class Policy:
    """A velocity from what was heard: keep going, go where others go, come closer, but not too close. Older news counts less."""

    def __init__(self, parameters, layout):
        self.layout = layout
        self.inertia, self.alignment, self.cohesion, self.separation, log_range_m, log_patience_s = parameters
        self.range_m, self.patience_s = np.exp(log_range_m), np.exp(log_patience_s)

    def __call__(self, observations):
        seen = self.layout.split(np.stack(list(observations.values())).astype(float))
        weight = seen["neighbour_mask"] * np.exp(-seen["neighbour_age_s"] / self.patience_s)
        share = (weight / np.maximum(weight.sum(axis=1, keepdims=True), 1e-9))[:, :, None]
        way_m = seen["neighbour_position_m"]
        square_m2 = (way_m**2).sum(axis=2)
        near = (weight * np.exp(-square_m2 / self.range_m**2) / np.sqrt(square_m2 + 1e-6))[:, :, None]
        velocity_mps = (
            self.inertia * seen["velocity_mps"]
            + self.alignment * (share * seen["neighbour_velocity_mps"]).sum(axis=1)
            + self.cohesion * (share * way_m).sum(axis=1)
            - self.separation * (near * way_m).sum(axis=1)
        )
        return dict(zip(observations, np.clip(velocity_mps, -2.0, 2.0)))


def episode(env, policy, seed):
    """Mean reward of a step."""
    observations, _ = env.reset(seed=seed)
    total, steps = 0.0, 0
    while env.agents:
        observations, rewards, *_ = env.step(policy(observations))
        total, steps = total + rewards["robot_0"], steps + 1
    return total / steps


def score(task, duration_s):
    """The same of a recorded run: speed and cohesion are means over steps, collisions are counted over all."""
    steps = duration_s * RATE_HZ
    return sum(weight * task[name] / (steps if name == "collisions" else 1.0) for name, weight in REWARD.items())


def train(env, generations, population, seeds_per_policy, seed):
    """Cross-entropy method: draw policies, keep the best quarter, draw around them."""
    draws = np.random.default_rng(seed)
    mean, sd = (np.array(column) for column in zip(*START.values()))
    for generation in range(generations):
        candidates = mean + sd * draws.standard_normal((population, len(mean)))
        # All candidates of a generation fly the same episodes, which differ from generation to generation.
        seeds = [1_000 + generation * seeds_per_policy + k for k in range(seeds_per_policy)]
        scores = np.array([np.mean([episode(env, Policy(one, env.layout), s) for s in seeds]) for one in candidates])
        elite = candidates[np.argsort(-scores, kind="stable")[: max(2, population // 4)]]
        # Smoothed, so that one lucky generation does not end the search.
        mean, sd = 0.3 * mean + 0.7 * elite.mean(axis=0), 0.3 * sd + 0.7 * elite.std(axis=0)
    return mean


def interval(values, seed=0):
    """Mean and 95 % interval by the bootstrap over evaluation seeds."""
    draws = np.random.default_rng(seed).integers(len(values), size=(10_000, len(values)))
    low, high = np.quantile(np.asarray(values)[draws].mean(axis=1), [0.025, 0.975])
    return np.mean(values), low, high


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="seconds instead of minutes; the policies are poor")
    parser.add_argument("--seed", type=int, default=1, help="of the search")
    options = parser.parse_args()
    agents, duration_s, generations, population, per_policy, n_evaluations = (5, 3.0, 2, 6, 1, 2) if options.quick else (10, 15.0, 10, 20, 1, 8)

    policies = {}
    for radio in RADIOS:
        env = parallel_env(experiment(radio, agents, duration_s), reward=REWARD, neighbours=NEIGHBOURS)
        parameters = train(env, generations, population, per_policy, options.seed)
        env.close()
        policies[radio] = Policy(parameters, env.layout)
        print(f"trained under {radio}: " + ", ".join(f"{name} {value:.2f}" for name, value in zip(START, parameters)), flush=True)

    print(f"\nmean reward of a step in {n_evaluations} recorded runs (95 % interval over their seeds)")
    print(f"{'trained under':<16}" + "".join(f"{'under ' + radio:>26}" for radio in RADIOS))
    with tempfile.TemporaryDirectory() as out:
        for trained, policy in policies.items():
            cells = []
            for radio in RADIOS:
                scores = []
                for seed in range(n_evaluations):
                    config = experiment(radio, agents, duration_s)
                    run = evaluate(config, policy, seed=seed, figures=["collisions"], neighbours=NEIGHBOURS, out=out, replace=True)
                    scores.append(score(run.summary["task"], duration_s))
                mean, low, high = interval(scores)
                cells.append(f"{mean:.3f} ({low:.3f} to {high:.3f})")
            print(f"{trained:<16}" + "".join(f"{cell:>26}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
