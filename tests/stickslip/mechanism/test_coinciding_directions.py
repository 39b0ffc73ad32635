"""Contacts whose directions coincide at the start alone, or always without that it is known."""

import itertools
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact


class Pad(AbstractMechanism):
    """A body on the ground, on which a pad rubs whose direction turns with a rotor from `x` on."""

    load: Any
    normal: Any
    lever: Any
    begin: Any
    coordinates: ClassVar = {"a": "rad", "x": "m"}
    contact_directions: ClassVar = {"pad": None, "ground": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"a": 1.0, "x": 1.0}

    def forces(self, t, q, v, args):
        on = jnp.where(t >= self.begin, 1.0, 0.0)
        return {"a": 1.03 * on, "x": self.load * on}

    def contacts(self, t, q, v, args):
        pad = {"a": self.lever * jnp.tanh(q.a), "x": 1.0}
        return {
            "pad": Contact(Coulomb(1.0), self.normal, direction=pad),
            "ground": Contact(Coulomb(1.0)),
        }


def regularised(load, normal, lever):
    """Place of the body after 1 s, by SciPy, with friction that rises over 1e-6 m/s.

    It creeps where the load is just what the ground can bear.
    """

    def rates(t, y):
        a, _, va, v = y
        pad = -normal * np.tanh((lever * np.tanh(a) * va + v) / 1e-6)
        return [va, v, 1.03 + pad * lever * np.tanh(a), load + pad - np.tanh(v / 1e-6)]

    found = solve_ivp(rates, (0.0, 1.0), [0.0, 0.1, 0.0, 0.0], method="Radau", rtol=1e-8, atol=1e-12)
    return found.y[1, -1]


LOADS = [*itertools.product((2.0, 1.2, 0.5, -1.2), (0.0, 0.1, 0.5), (0.8, -0.8))]


@pytest.fixture(scope="module")
def ends():
    """Ends of all `LOADS`, which begin before the start, or jump after a rest of 0.5 s."""

    @jax.jit
    @jax.vmap
    def run(p, begin, t1):
        pad = Pad(*p, begin)
        system = ss.WithBreaks(pad, jnp.stack([begin]))
        found = ss.simulate(system, 0.0, t1, system.start(pad.state(x=0.1)), throw=False)
        return found.successful, found.y1.y.x

    lanes = np.array([*LOADS, *LOADS])
    late = np.repeat([False, True], len(LOADS))
    found = run(jnp.array(lanes), jnp.where(late, 0.5, -1.0), jnp.where(late, 1.5, 1.0))
    return [np.asarray(x).reshape(2, -1) for x in found]


@pytest.mark.more
@pytest.mark.parametrize("how", [0, 1], ids=["at the start", "as loads jump"])
def test_a_pad_that_turns_away_from_a_body_at_rest(ends, how):
    """The law of rest ended in no mode where the contacts coincide."""
    successful, x = (part[how] for part in ends)
    assert np.all(successful)
    np.testing.assert_allclose(x, [regularised(*p) for p in LOADS], atol=1e-5)


class Pressed(AbstractMechanism):
    """A body on the ground and against a pad of the same direction, which only the run knows."""

    load: Any
    normal: Any
    lever: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1.0}, "pad": None}
    opening: ClassVar = ("pad",)

    def mass_matrix(self, q):
        return [[1.0, 0.0 * self.load], [0.0 * self.load, 1.0]]

    def forces(self, t, q, v, args):
        return {"x": self.load, "y": 0.0}

    def contacts(self, t, q, v, args):
        pad = Contact(Coulomb(1.0), self.normal, direction={"x": self.lever})
        return {"ground": Contact(Coulomb(1.0)), "pad": pad}


@pytest.mark.more
def test_a_pad_beside_the_ground_on_one_line():
    """The load is borne by both, or by none of them."""
    rows = [*itertools.product((2.0, 1.2, 0.5, -0.5, -1.2, -2.0), (0.0, 0.1, 0.5), (0.8, -0.8, 1.0))]

    @jax.jit
    @jax.vmap
    def run(p):
        body = Pressed(*p)
        found = ss.simulate(body, 0.0, 1.0, body.state(x=0.1), throw=False)
        return found.successful, found.y1.x

    successful, x = run(jnp.array(rows))
    load, normal, lever = np.array(rows).T
    over = np.maximum(np.abs(load) - 1.0 - normal * np.abs(lever), 0.0)
    assert np.all(successful)
    np.testing.assert_allclose(x, 0.1 + 0.5 * over * np.sign(load), atol=1e-13)
