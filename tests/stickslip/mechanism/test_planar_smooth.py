"""The smooth forms of friction in a plane: along one line, and to the exact limit."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb, Dahl, Stribeck
from stickslip.mechanism import AbstractMechanism, Contact, DeclarationError
from tests.stickslip.mechanism._planar import G, Puck
from tests.stickslip.mechanism.test_planar import MU, array

TIGHT = ss.Integrator(step=ss.AdaptiveStep(1e-11))


class Driven(Puck):
    """A spring and a force that swings, both along one line that no axis is."""

    def forces(self, t, q, v, args):
        f = 5.0 * jnp.sin(2.0 * t)
        return {"x": 0.6 * f - 3.0 * q.x, "y": 0.8 * f - 3.0 * q.y}

    def time_scale(self, args):
        return 0.5


class Line(AbstractMechanism):
    law: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"along": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": 5.0 * jnp.sin(2.0 * t) - 3.0 * q.x}

    def contacts(self, t, q, v, args):
        return {"along": Contact(self.law, G)}

    def time_scale(self, args):
        return 0.5


@pytest.mark.more
def test_regularised_along_one_line():
    law = Stribeck(0.3, 0.2, 0.1)
    wide, narrow = Driven(law).regularised(0.02), Line(law).regularised(0.02)
    a = ss.simulate(wide, 0.0, 5.0, wide.state(v_x=0.6, v_y=0.8), integrator=TIGHT)
    b = ss.simulate(narrow, 0.0, 5.0, narrow.state(v_x=1.0), integrator=TIGHT)
    x, v = b.y1.x, b.y1.v_x
    np.testing.assert_allclose(array(a.y1), [0.6 * x, 0.8 * x, 0.6 * v, 0.8 * v], atol=1e-8)


@pytest.mark.more
@pytest.mark.parametrize("kind", ["lugre", "dahl"])
def test_bristles_along_one_line(kind):
    law = Stribeck(0.3, 0.2, 0.1) if kind == "lugre" else Coulomb(0.2)
    options = dict(sigma_0=2e3, sigma_1=5.0) if kind == "lugre" else dict(kind=Dahl, sigma_0=2e3)
    wide, narrow = Driven(law), Line(law)
    a, b = wide.bristles(**options), narrow.bristles(**options)
    wide = ss.simulate(a, 0.0, 3.0, a.start(wide.state(v_x=0.6, v_y=0.8)), integrator=TIGHT)
    narrow = ss.simulate(b, 0.0, 3.0, b.start(narrow.state(v_x=1.0)), integrator=TIGHT)
    x, v, z = array(narrow.y1)
    exact = [0.6 * x, 0.8 * x, 0.6 * v, 0.8 * v, 0.6 * z, 0.8 * z]
    np.testing.assert_allclose(array(wide.y1), exact, atol=1e-8)


@pytest.mark.more
def test_both_tend_to_the_exact_form():
    """A slide on a curve to rest: with the width of the smoothing, the softness of the bristles."""
    puck = Puck(Coulomb(MU), 1.0, -0.4, 0.3, 0.1)
    start = puck.state(v_x=1.0, v_y=2.0)
    exact = array(ss.simulate(puck, 0.0, 1.5, start).y1)
    errors = []
    for width in (1e-2, 1e-3):
        smooth = puck.regularised(width)
        errors.append(np.abs(array(ss.simulate(smooth, 0.0, 1.5, start).y1) - exact).max())
    assert errors[1] < 2e-3
    assert errors[0] > 5.0 * errors[1]
    errors = []
    for stiffness in (1e3, 1e5):
        soft = puck.bristles(sigma_0=stiffness, sigma_1=2.0 * np.sqrt(stiffness / G))
        run = ss.simulate(soft, 0.0, 1.5, soft.start(start))
        errors.append(np.abs(array(run.y1)[:4] - exact).max())
    assert errors[1] < 5e-3  # as the damping over the stiffness, its square root
    assert errors[0] > 5.0 * errors[1]


def test_other_bristles_are_refused():
    puck = Puck(Dahl(Coulomb(MU), 1e3, exponent=2.0)).bristles(sigma_0=1e3)
    with pytest.raises(DeclarationError, match=r"the law of contact 'along' = Dahl.*exponent 1"):
        ss.simulate(puck, 0.0, 1.0, puck.start(puck.mechanism.state()))
