"""Covariance matrix adaptation: a search for a maximum that takes values only, many at once."""

import numpy as np


class Evolution:
    r"""CMA-ES in the unit cube: draws of a normal distribution, whose mean, size and shape follow the
    better half of them.

    `ask` returns the points of a round, `tell` takes their values, of which the greatest is sought.
    Points outside of the cube are moved to its surface, and pay for the way.

    Source: N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, with its constants.
    """

    def __init__(self, mean: np.ndarray, size: float, population: int, seed: int):
        n = mean.size
        self.rng = np.random.default_rng(seed)
        self.mean, self.size, self.population = mean.copy(), size, population
        half = population // 2
        weights = np.log(half + 0.5) - np.log(np.arange(1, half + 1))
        self.weights = weights / weights.sum()
        self.mass = mass = 1.0 / np.sum(self.weights**2)
        self.shape = np.eye(n)
        self.path, self.long_path = np.zeros(n), np.zeros(n)
        self.fade = (mass + 2.0) / (n + mass + 5.0)
        self.damping = 1.0 + self.fade + 2.0 * max(0.0, np.sqrt(max(mass - 1.0, 0.0) / (n + 1.0)) - 1.0)
        self.long_fade = (4.0 + mass / n) / (n + 4.0 + 2.0 * mass / n)
        self.by_path = 2.0 / ((n + 1.3) ** 2 + mass)
        self.by_draws = min(
            1.0 - self.by_path, 2.0 * (mass - 2.0 + 1.0 / mass) / ((n + 2.0) ** 2 + mass)
        )
        self.expected = np.sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n))
        self.rounds = 0

    def ask(self) -> np.ndarray:
        """Points of the next round, `[point, coordinate]` between 0 and 1."""
        values, self.axes = np.linalg.eigh(self.shape)
        self.lengths = np.sqrt(np.maximum(values, 1e-20))
        draws = self.rng.normal(size=(self.population, self.mean.size))
        self.steps = (draws * self.lengths) @ self.axes.T
        free = self.mean + self.size * self.steps
        inside = np.clip(free, 0.0, 1.0)
        # In units of the draws, so that the pay does not depend on how far the search has come.
        self.outside = np.sum(((free - inside) / self.size) ** 2, axis=1)
        return inside

    def tell(self, values: np.ndarray) -> None:
        """Values at the points of `ask`; what is not finite is worse than all others."""
        good = np.isfinite(values)
        spread = np.ptp(values[good]) if good.any() else 0.0
        paid = np.where(good, values - spread * self.outside / self.mean.size, -np.inf)
        best = self.steps[np.argsort(-paid, kind="stable")[: self.weights.size]]
        step = self.weights @ best
        self.mean = np.clip(self.mean + self.size * step, 0.0, 1.0)
        self.rounds += 1
        keep, mass = 1.0 - self.fade, self.mass
        white = self.axes @ ((self.axes.T @ step) / self.lengths)
        self.path = keep * self.path + np.sqrt(self.fade * (2.0 - self.fade) * mass) * white
        length = np.linalg.norm(self.path)
        usual = np.sqrt(1.0 - keep ** (2 * self.rounds))
        going = length / usual < (1.4 + 2.0 / (self.mean.size + 1.0)) * self.expected
        fade = self.long_fade
        self.long_path = (1.0 - fade) * self.long_path
        if going:
            self.long_path += np.sqrt(fade * (2.0 - fade) * mass) * step
        draws = (best.T * self.weights) @ best
        left = 1.0 - self.by_path - self.by_draws
        self.shape = (
            left * self.shape
            + self.by_path * np.outer(self.long_path, self.long_path)
            + self.by_draws * draws
        )
        self.size *= float(np.exp(self.fade / self.damping * (length / self.expected - 1.0)))
        self.size = min(self.size, 1.0)
