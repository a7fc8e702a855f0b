"""What an agent observes: itself, its mote, and the nearest of those it has heard. The environment and evaluation share it."""

from __future__ import annotations

import dataclasses

import numpy as np

from murmuration.robots import Heard, Motes


@dataclasses.dataclass(frozen=True)
class Layout:
    """Where each quantity stands in an observation, a vector of float32.

    Of each neighbour there is a place for each quantity; places that nobody takes are 0, their mask too. The nearest comes first.

    Attributes
    ----------
    neighbours : int
        Places for neighbours.
    dimensions : int
        2 or 3: of positions, velocities and actions.
    """

    neighbours: int
    dimensions: int

    @property
    def own_width(self) -> int:
        """Length of what comes before the neighbours: position, velocity, joined, n_heard.

        Returns
        -------
        int
            Number of entries.
        """
        return 2 * self.dimensions + 2

    @property
    def neighbour_width(self) -> int:
        """Length of a neighbour's place: mask, position, velocity, age, RSSI.

        Returns
        -------
        int
            Number of entries.
        """
        return 2 * self.dimensions + 3

    @property
    def width(self) -> int:
        """Length of an observation: the agent's own part, then one place after the other.

        Returns
        -------
        int
            Number of entries.
        """
        return self.own_width + self.neighbours * self.neighbour_width

    def split(self, observation: np.ndarray) -> dict[str, np.ndarray]:
        """Splits an observation, or a stack of them, into its quantities. docs/training.md lists them.

        Parameters
        ----------
        observation : numpy.ndarray
            An observation, or several along the first axes.

        Returns
        -------
        dict
            The quantities by name: views, not copies.
        """
        d, own = self.dimensions, self.own_width
        place = observation[..., own:].reshape(observation.shape[:-1] + (self.neighbours, self.neighbour_width))
        return {
            "position_m": observation[..., :d],
            "velocity_mps": observation[..., d : 2 * d],
            "joined": observation[..., 2 * d],
            "n_heard": observation[..., 2 * d + 1],
            "neighbour_mask": place[..., 0],
            "neighbour_position_m": place[..., 1 : 1 + d],
            "neighbour_velocity_mps": place[..., 1 + d : 1 + 2 * d],
            "neighbour_age_s": place[..., 1 + 2 * d],
            "neighbour_rssi_dbm": place[..., 2 + 2 * d],
        }


class Observer:
    """Makes observations of n robots, and remembers whom they heard."""

    def __init__(self, n: int, layout: Layout, keep_s: float = 0.0, extrapolate: bool = True) -> None:
        self.n, self.layout, self.keep_s, self.extrapolate = n, layout, keep_s, extrapolate
        self._width, self._own_width = layout.width, layout.own_width
        self._rows = np.arange(n)[:, None]
        self._way_m = np.empty((0, 3))
        self.reset()

    def reset(self) -> None:
        """Forgets everyone."""
        self._known: Heard | None = None
        self._held_s = np.zeros(0)

    def observe(
        self, dt_s: float, position_m: np.ndarray, velocity_mps: np.ndarray, heard: Heard | None, motes: Motes | None
    ) -> np.ndarray:
        """Observations at the end of a period of `dt_s`, one row for each robot. `heard`: what was heard in it."""
        n, d, k = self.n, self.layout.dimensions, self.layout.neighbours
        seen = np.zeros((n, self._width), dtype=np.float32)
        seen[:, :d], seen[:, d : 2 * d] = position_m[:, :d], velocity_mps[:, :d]
        seen[:, 2 * d] = 1.0 if motes is None else motes.joined
        if self.keep_s > 0.0:
            heard, held_s, n_new = self._with_memory(dt_s, heard)
        else:
            held_s, n_new = None, 0 if heard is None else len(heard.receiver)
        if heard is None or len(heard.receiver) == 0:
            return seen
        receiver, sender, n_all = heard.receiver, heard.sender, len(heard.receiver)
        pair = receiver * n + sender
        # Of a sender that was heard twice, the last message counts.
        which = np.full(n * n, -1)
        which[pair] = np.arange(n_all)
        # Nobody is a neighbour of its own.
        which[:: n + 1] = -1
        seen[:, 2 * d + 1] = np.add.reduce((which >= n_all - n_new).reshape(n, n), axis=1)
        there_m = heard.position_m
        if held_s is not None:
            counts = which[pair] == np.arange(n_all)
            self._known, self._held_s = _taken(heard, counts), held_s[counts]
            if self.extrapolate:
                there_m = there_m + heard.velocity_mps * held_s[:, None]
        if len(self._way_m) < n_all:
            self._way_m = np.empty((2 * n_all, 3))
        # In memory that is there already: fresh pages cost more than the sums. No receiver is out of range to be clipped.
        way_m = np.take(position_m, receiver, axis=0, out=self._way_m[:n_all], mode="clip")
        np.subtract(there_m, way_m, out=way_m)
        square_m2 = np.full(n * n, np.inf)
        square_m2[pair] = np.einsum("ij,ij->i", way_m, way_m)
        square_m2[:: n + 1] = np.inf
        nearest = _least(square_m2.reshape(n, n), k)
        chosen = which.reshape(n, n)[self._rows, nearest]
        chosen = chosen.ravel()
        taken = np.empty((len(chosen), 2 * d + 3))
        taken[:, 0] = 1.0
        taken[:, 1 : 1 + d], taken[:, 1 + d : 1 + 2 * d] = way_m.take(chosen, axis=0)[:, :d], heard.velocity_mps.take(chosen, axis=0)[:, :d]
        taken[:, 1 + 2 * d], taken[:, 2 + 2 * d] = heard.age_s[chosen], heard.rssi_dbm[chosen]
        # Places that nobody takes have the number -1.
        taken[chosen < 0] = 0.0
        taken = taken.reshape(n, -1)
        seen[:, self._own_width : self._own_width + taken.shape[1]] = taken
        return seen

    def _with_memory(self, dt_s: float, heard: Heard | None) -> tuple[Heard | None, np.ndarray, int]:
        """Those remembered, a period older, then those just heard; for how long each has been known; how many are new."""
        known, held_s = self._known, self._held_s
        n_new = 0 if heard is None else len(heard.receiver)
        if known is None:
            self._known, self._held_s = heard, np.zeros(n_new)
            return heard, self._held_s, n_new
        held_s = held_s + dt_s
        # Half a nanosecond: times are whole nanoseconds.
        kept = held_s <= self.keep_s + 5e-10
        known, held_s = _taken(known, kept), held_s[kept]
        known = dataclasses.replace(known, age_s=known.age_s + dt_s)
        if heard is not None and n_new:
            columns = {name: np.concatenate([getattr(known, name), getattr(heard, name)]) for name in COLUMNS}
            known, held_s = Heard(n=self.n, payload=[], **columns), np.concatenate([held_s, np.zeros(n_new)])
        self._known, self._held_s = known, held_s
        return known, held_s, n_new


COLUMNS = ("receiver", "sender", "position_m", "velocity_mps", "age_s", "rssi_dbm")


def _taken(heard: Heard, which: np.ndarray) -> Heard:
    return Heard(n=heard.n, payload=[], **{name: getattr(heard, name)[which] for name in COLUMNS})


def _least(square: np.ndarray, k: int) -> np.ndarray:
    """Columns of the k least entries of each row, ascending; of equal ones the first column first."""
    n = square.shape[1]
    k = min(k, n)
    if n <= 64 or n <= 4 * k:
        return np.argsort(square, axis=1, kind="stable")[:, :k]
    some = np.sort(np.argpartition(square, k - 1, axis=1)[:, :k], axis=1)
    order = np.argsort(np.take_along_axis(square, some, axis=1), axis=1, kind="stable")
    return np.take_along_axis(some, order, axis=1)
