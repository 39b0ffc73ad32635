"""Functions whose zeros are special points, by the eigenvalues of random matrices."""

from unittest.mock import Mock

import numpy as np

from stickslip.continuation import PeriodicOrbit
from stickslip.continuation._orbit import beyond
from stickslip.continuation._orbits import OWN
from stickslip.continuation._point import Point
from stickslip.continuation._points import doubling, torus


def point(matrix):
    multipliers = np.append(np.linalg.eigvals(matrix), 1.0)
    orbit = Mock(spec=PeriodicOrbit, multipliers=multipliers, neutral=np.ones((1, 1)))
    return Mock(spec=Point, orbit=orbit)


def test_a_period_doubles_where_the_determinant_of_m_plus_one_vanishes():
    for matrix in np.random.default_rng(0).normal(size=(20, 3, 3)):
        expected = np.linalg.det(matrix + np.eye(3))
        np.testing.assert_allclose(doubling(point(matrix)), expected, rtol=1e-9, atol=1e-9)


def test_a_torus_begins_where_a_pair_is_on_the_unit_circle():
    turn = np.array([[np.cos(0.7), np.sin(0.7)], [-np.sin(0.7), np.cos(0.7)]])
    for size in (0.9, 1.0, 1.1):
        assert np.sign(np.round(torus(point(size * turn)), 12)) == np.sign(size - 1.0)


def pairs_of(sizes):
    """A matrix with conjugate pairs of multipliers of these magnitudes."""
    matrix = np.zeros((2 * len(sizes), 2 * len(sizes)))
    for k, size in enumerate(sizes):
        a = 0.3 + 0.4 * k
        turn = np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
        matrix[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = size * turn
    return matrix


def test_a_torus_among_many_pairs_that_are_hardly_damped():
    """The product of all is 1e-17. A pair on the circle, as exactly as it is known, has no sign."""
    (test,) = (test for test in OWN if test.label == "NS")
    rest = [1.0 - 1e-4 * k for k in range(1, 7)]
    assert abs(torus(point(pairs_of([1.0 - 1e-5, *rest])))) < 1e-16
    for size, sign in ((1.0 - 1e-5, -1), (1.0, 0), (1.0 + 1e-5, 1)):
        assert test.sign(point(pairs_of([size, *rest]))) == sign * (-1) ** len(rest)


def test_what_nothing_damps_is_no_torus_and_not_stable():
    """Rounding moves its multipliers to either side of the circle."""
    (test,) = (test for test in OWN if test.label == "NS")
    for off in (-1e-13, 1e-13):
        assert test.sign(point(pairs_of([1.0 + off, 1.0 - off]))) == 0
        assert beyond(np.linalg.eigvals(pairs_of([1.0 + off])), 0) == 2
    assert beyond(np.linalg.eigvals(pairs_of([1.0 - 1e-9])), 0) == 0
