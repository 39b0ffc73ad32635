"""Distances from attractors against closed forms."""

import numpy as np

from stickslip.basin._tube import distances, tube_of


def test_distances_from_places_and_from_a_circle():
    """More states than one block has, in two modes."""
    rng = np.random.default_rng(0)
    angle, radius = rng.uniform(0.0, 2.0 * np.pi, 300), rng.uniform(0.98, 1.02, 300)
    y = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    mode = rng.integers(0, 2, 300)
    scale, turn = np.array([2.0, 2.0]), np.array([np.inf, np.inf])

    def place(x, m):
        return tube_of((None, np.array([x]), None), [m], np.eye(2), scale, turn)

    t = np.linspace(0.0, 2.0 * np.pi, 129)
    rows = t, np.stack([np.cos(t), np.sin(t)], axis=1), np.stack([-np.sin(t), np.cos(t)], axis=1)
    circle = tube_of(rows, np.zeros(129, int), np.eye(2), scale, turn)
    found = distances([place([0.3, 0.1], 0), circle, place([-1.0, 1.0], 1)], y, mode)

    def away(x):
        return np.linalg.norm(y - np.array(x), axis=1) / 2.0

    right = [away([0.3, 0.1]), np.abs(radius - 1.0) / 2.0, away([-1.0, 1.0])]
    for k, (row, own) in enumerate(zip(right, (0, 0, 1), strict=True)):
        np.testing.assert_allclose(found[mode == own, k], row[mode == own], atol=2e-8)
        assert np.all(np.isinf(found[mode != own, k]))
    assert distances([circle], np.zeros((0, 2)), np.zeros(0, int)).shape == (0, 1)
