"""The robots of minimal.py over the package murmuration: they drive to within 1 m of the middle of those they heard."""

import sys

import numpy as np

import murmuration.robots


class Gather(murmuration.robots.Robots):
    def reset(self, seed, n):
        self.position_m = np.random.default_rng(seed).uniform(-6, 6, (n, 2))
        return self.position_m

    def step(self, dt_s, heard):
        way_m = heard.mean_position_m(self.position_m) - self.position_m
        away_m = np.linalg.norm(way_m, axis=1, keepdims=True)
        self.position_m += way_m * np.clip(away_m - 1, 0, dt_s) / np.maximum(away_m, 1e-9)  # at 1 m/s
        return self.position_m


murmuration.robots.serve(Gather(), sys.argv[1] if sys.argv[1:] else "127.0.0.1:50061")
