"""Figures of a task, step by step and over an episode, as docs/metrics.md defines them.

Of each, the time mean over the steps of an episode, or the last, least or total value, is what `task` of summary.json has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from murmuration._names import path_of
from murmuration._program import InvalidInput
from murmuration.robots import Heard

# Speeds and distances below this have no direction (m/s, m).
NO_DIRECTION = 1e-9


class Step:
    """Where the robots are at the end of a step, how they moved in it, and who heard whom; what follows is computed when asked for."""

    def __init__(
        self, position_m: np.ndarray, velocity_mps: np.ndarray, heard: Heard, contacts_before: np.ndarray | None, diameter_m: float
    ) -> None:
        self.position_m, self.velocity_mps, self.heard, self.diameter_m = position_m, velocity_mps, heard, diameter_m
        self._contacts_before = contacts_before
        self._known: dict[str, Any] = {}

    def _once(self, name: str, compute: Callable[[], Any]) -> Any:
        if name not in self._known:
            self._known[name] = compute()
        return self._known[name]

    @property
    def speeds_mps(self) -> np.ndarray:
        return self._once("speeds", lambda: np.sqrt(np.einsum("ij,ij->i", self.velocity_mps, self.velocity_mps)))

    @property
    def mean_velocity_mps(self) -> np.ndarray:
        return self._once("velocity", lambda: self.velocity_mps.mean(axis=0))

    @property
    def way_from_centre_m(self) -> np.ndarray:
        return self._once("way", lambda: self.position_m - self.position_m.mean(axis=0))

    @property
    def from_centre_m(self) -> np.ndarray:
        way_m = self.way_from_centre_m
        return self._once("centre", lambda: np.sqrt(np.einsum("ij,ij->i", way_m, way_m)))

    @property
    def distances_m(self) -> np.ndarray:
        """Of each pair."""

        def compute() -> np.ndarray:
            one, other = np.triu_indices(len(self.position_m), 1)
            way_m = self.position_m[one] - self.position_m[other]
            return np.sqrt(np.einsum("ij,ij->i", way_m, way_m))

        return self._once("distances", compute)

    @property
    def contacts(self) -> np.ndarray:
        """Which pairs are closer than a robot's diameter."""
        return self._once("contacts", lambda: self.distances_m < self.diameter_m)

    @property
    def contacts_before(self) -> np.ndarray:
        return np.zeros_like(self.contacts) if self._contacts_before is None else self._contacts_before


def _flock_speed_mps(step: Step) -> float | None:
    return _norm(step.mean_velocity_mps)


def _mean_speed_mps(step: Step) -> float | None:
    return float(step.speeds_mps.mean())


def _polarisation(step: Step) -> float | None:
    moving = step.speeds_mps > NO_DIRECTION
    n_moving = np.count_nonzero(moving)
    if n_moving == 0:
        return None
    if n_moving == len(moving):
        return _norm((step.velocity_mps / step.speeds_mps[:, None]).sum(axis=0)) / n_moving
    return _norm((step.velocity_mps[moving] / step.speeds_mps[moving, None]).sum(axis=0)) / n_moving


def _cohesion_m(step: Step) -> float | None:
    return float(step.from_centre_m.mean())


def _radial_speed_mps(step: Step) -> float | None:
    away = step.from_centre_m > NO_DIRECTION
    if not away.any():
        return None
    outward = step.way_from_centre_m[away] / step.from_centre_m[away, None]
    relative_mps = step.velocity_mps[away] - step.mean_velocity_mps
    return float(np.einsum("ij,ij->i", relative_mps, outward).mean())


def _final_spread_m(step: Step) -> float | None:
    return float(np.sqrt((step.from_centre_m**2).mean()))


def _min_distance_m(step: Step) -> float | None:
    return float(step.distances_m.min()) if len(step.distances_m) else None


def _collisions(step: Step) -> float | None:
    return float(np.count_nonzero(step.contacts & ~step.contacts_before))


def _fragments(step: Step) -> float | None:
    heard, n = step.heard, len(step.position_m)
    group = np.arange(n)
    # Everyone takes the least number of those it shares a delivery with, until nobody changes.
    while True:
        least = group.copy()
        np.minimum.at(least, heard.receiver, group[heard.sender])
        np.minimum.at(least, heard.sender, group[heard.receiver])
        least = least[least]
        if np.array_equal(least, group):
            return float(len(np.unique(group)))
        group = least


def _line_rms_m(step: Step) -> float | None:
    xx, xy, yy = _moments(step.way_from_centre_m)
    greater = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
    lesser = (xx * yy - xy * xy) / greater if greater > 0 else 0.0
    return float(np.sqrt(max(lesser, 0.0) / len(step.position_m)))


def _circle_rms_m(step: Step) -> float | None:
    n = len(step.position_m)
    if n < 3:
        return None
    x, y = step.way_from_centre_m[:, 0], step.way_from_centre_m[:, 1]
    z = x * x + y * y
    xx, xy, yy = _moments(step.way_from_centre_m)
    determinant = xx * yy - xy * xy
    if determinant <= 1e-12 * (xx + yy) ** 2:
        return None
    xz, yz = float(x @ z), float(y @ z)
    a = 0.5 * (xz * yy - yz * xy) / determinant
    b = 0.5 * (yz * xx - xz * xy) / determinant
    radius_m = np.sqrt(a * a + b * b + z.sum() / n)
    return float(np.sqrt(((np.hypot(x - a, y - b) - radius_m) ** 2).mean()))


def _moments(way_m: np.ndarray) -> tuple[float, float, float]:
    x, y = way_m[:, 0], way_m[:, 1]
    return float(x @ x), float(x @ y), float(y @ y)


def _norm(vector: np.ndarray) -> float:
    return float(np.sqrt(vector @ vector))


# What an episode has of a figure: its time mean, or its last, least or total value.
FIGURES: dict[str, tuple[Callable[[Step], float | None], str]] = {
    "flock_speed_mps": (_flock_speed_mps, "mean"),
    "mean_speed_mps": (_mean_speed_mps, "mean"),
    "polarisation": (_polarisation, "mean"),
    "cohesion_m": (_cohesion_m, "mean"),
    "radial_speed_mps": (_radial_speed_mps, "mean"),
    "fragments": (_fragments, "mean"),
    "min_distance_m": (_min_distance_m, "least"),
    "collisions": (_collisions, "total"),
    "final_spread_m": (_final_spread_m, "last"),
    "line_rms_m": (_line_rms_m, "last"),
    "circle_rms_m": (_circle_rms_m, "last"),
}  # fmt: skip


def task_name(name: str) -> str:
    """The name in `task` of summary.json: that of a short name or of a path below `task`; of anything else itself."""
    return name if name in FIGURES else path_of(name).removeprefix("task.")


class Metrics:
    """The figures of these names, over the steps of an episode. Results have the names as they are given."""

    def __init__(self, names: Iterable[str], diameter_m: float) -> None:
        self.names = tuple(dict.fromkeys(names))
        self.diameter_m = diameter_m
        self._figure_of = {name: task_name(name) for name in self.names}
        for name, figure in self._figure_of.items():
            if figure not in FIGURES:
                raise InvalidInput(f"{name!r} is not a figure of a task; there are {', '.join(FIGURES)}")
        self.reset()

    def reset(self) -> None:
        """Begins an episode."""
        self._values: dict[str, list[float]] = {name: [] for name in self.names}
        self._weights: dict[str, list[float]] = {name: [] for name in self.names}
        self._contacts: np.ndarray | None = None

    def add(self, dt_s: float, position_m: np.ndarray, velocity_mps: np.ndarray, heard: Heard) -> dict[str, float | None]:
        """The figures of a step; `None`: not defined in it."""
        step = Step(position_m, velocity_mps, heard, self._contacts, self.diameter_m)
        values: dict[str, float | None] = {}
        for name in self.names:
            value = values[name] = FIGURES[self._figure_of[name]][0](step)
            if value is not None:
                self._values[name].append(value)
                self._weights[name].append(dt_s)
        if "collisions" in self._figure_of.values():
            self._contacts = step.contacts
        return values

    def episode(self) -> dict[str, float | None]:
        """The figures of the episode so far, as `task` of summary.json has them."""
        figures: dict[str, float | None] = {}
        for name in self.names:
            values, kind = self._values[name], FIGURES[self._figure_of[name]][1]
            if not values:
                figures[name] = None
            elif kind == "mean":
                figures[name] = float(np.average(values, weights=self._weights[name]))
            else:
                figures[name] = {"last": values[-1], "least": min(values), "total": sum(values)}[kind]
        return figures
