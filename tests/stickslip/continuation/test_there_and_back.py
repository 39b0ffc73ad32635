"""Values of the parameter that a branch passes twice within one step, beside a fold."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.continuation import (
    Follow,
    OrbitGuess,
    continue_equilibrium,
    continue_orbit,
    periodic_orbit,
)


class Place(NamedTuple):
    """A coordinate."""

    x: Any


class Fold(ss.AbstractSmoothSystem):
    r"""$\dot x = p - x^2$: equilibria at $\pm\sqrt p$."""

    p: Any
    units: ClassVar = {"x": "m"}

    def vector_field(self, t, y, mode, args):
        return Place(self.p - y.x**2)


@pytest.mark.parametrize("value", [1e-2, 1e-5, 1e-9])
def test_a_value_beside_the_fold_of_a_square_root(value):
    follow = Follow(step=0.02, values=(value,))
    branch = continue_equilibrium(Fold(0.8), Place(0.9), "p", (-1.0, 1.0), follow=follow)
    assert [point.label for point in branch.specials] == ["EP", "UZ", "LP", "UZ", "EP"]
    found = [float(point.orbit.y.x) for point in branch["UZ"]]
    np.testing.assert_allclose(found, [-np.sqrt(value), np.sqrt(value)], rtol=1e-9)
    assert [point.value for point in branch["UZ"]] == [value, value]


@pytest.mark.parametrize("bound", [1e-2, 1e-5, 1e-9])
def test_a_bound_before_the_fold_ends_the_branch(bound):
    branch = continue_equilibrium(Fold(0.8), Place(0.9), "p", (bound, 1.0), follow=Follow(step=0.02))
    assert [point.value for point in branch.ends] == pytest.approx([bound, 1.0], rel=1e-9)
    assert float(branch.ends[0].orbit.y.x) == pytest.approx(np.sqrt(bound), rel=1e-9)
    assert len(branch.specials) == 2
    assert np.min(branch.values) == branch.ends[0].value


class Motion(NamedTuple):
    """Displacement and velocity."""

    x: Any
    v: Any


class Duffing(ss.AbstractSmoothSystem):
    """A driven oscillator with a stiffening spring, whose response turns back at its peak."""

    rate: Any
    units: ClassVar = {"x": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        force = 0.3 * jnp.cos(self.rate * t)
        return Motion(y.v, force - 0.15 * y.v - y.x - y.x**3)


@pytest.mark.more
def test_a_value_beside_the_fold_of_a_response():
    """Two orbits more before the fold than beyond it, apart as the root of the distance."""

    def followed(*values):
        system = Duffing(jnp.asarray(1.0))
        guess = OrbitGuess(Motion(0.5, 0.0), 2.0 * np.pi)
        orbit = periodic_orbit(system, guess, forced=True)
        return continue_orbit(
            system, orbit, "rate", (1.0, 2.5), forcing_period=lambda s: 2.0 * np.pi / s.rate,
            follow=Follow(step=0.02, values=values),
        )  # fmt: skip

    fold = followed()["LP"][0].value
    near = (fold - 1e-4, fold - 1e-6, fold + 1e-6)
    branch = followed(*near)
    counts = [sum(point.value == value for point in branch["UZ"]) for value in near]
    assert counts == [3, 3, 1]
    apart = []
    for value in near[:2]:
        places = np.sort([float(p.orbit.y0.x) for p in branch["UZ"] if p.value == value])
        apart.append(np.min(np.diff(places)))
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=1e-2)
