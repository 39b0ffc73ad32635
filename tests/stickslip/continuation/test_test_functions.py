"""Functions whose zeros are special points, by the eigenvalues of random matrices."""

from unittest.mock import Mock

import numpy as np

from stickslip.continuation import PeriodicOrbit
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
