"""Contacts that constant inertia does not join are treated each by itself, and only those."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.mechanism._independent import CoupledContacts, SeparateContacts
from stickslip.mechanism._laws import Bounds
from stickslip.mechanism._scalars import Mass
from tests.stickslip.mechanism._groups import group, states_by_law
from tests.stickslip.mechanism._machines import Chain, Train, chain


class Wagons(AbstractMechanism):
    """Two wagons, the distance between them a coordinate; `joint` is inertia that both share."""

    mass: Any
    joint: Any
    kind: Any
    coordinates: ClassVar = {"x": "m", "gap": "m"}
    contact_directions: ClassVar = {"first": (1, 0), "second": (1, 1)}

    def mass_matrix(self, q):
        first, second, joint = self.kind(self.mass, self.joint)
        return ((first + second + 2.0 * joint, second + joint), (second + joint, second))

    def forces(self, t, q, v, args):
        return (2.0, 1.0)

    def contacts(self, t, q, v, args):
        return [Contact(Coulomb(1.0, 0.5))] * 2


@pytest.mark.parametrize(
    ("kind", "separate"),
    [
        (lambda m, j: (m, 2.0 * m, 0.0), True),
        (lambda m, j: (m, 2.0 * m, j), False),
        # Neither is known to vanish: at these parameters it does, at others it does not.
        (lambda m, j: (m, m, jnp.maximum(j, 0.0)), False),
        (lambda m, j: (m, m, m * j), False),
    ],
)
def test_what_vanishes_is_read_off_the_declaration(kind, separate):
    (of,) = Wagons(1.0, 0.0, kind).structure.groups
    assert type(of) is (SeparateContacts if separate else CoupledContacts)


@pytest.mark.parametrize("blocks", [1, 2, 5])
def test_relative_coordinates_are_parted(blocks):
    (of,) = chain(blocks, Train).structure.groups
    assert type(of) is SeparateContacts
    np.testing.assert_array_equal(of.decoupled, ~np.eye(blocks, dtype=bool))


@pytest.mark.more
def test_a_group_and_each_by_itself_find_the_same():
    """Random loads below, at and above the limits, against the search over all contacts."""
    n, rng = 4, np.random.default_rng(3)
    J = np.tril(np.ones((n, n)))
    generic = J.T @ np.diag([0.7, 1.1, 1.3, 0.9]) @ J
    alone, together = group(J, generic[None]), group(J)
    assert type(alone) is SeparateContacts
    assert type(together) is CoupledContacts

    def states(of, masses, load, limit):
        M = Mass(full=[list(row) for row in J.T @ jnp.diag(masses) @ J])
        limits = Bounds(None, tuple(limit))
        found, ended = states_by_law(of, M, tuple(load), [0.0] * n, limits, limits)
        return jnp.stack(found), ended

    count = 300
    given = (
        jnp.asarray(10.0 ** rng.uniform(-2, 2, (count, n))),
        jnp.asarray(rng.normal(size=(count, n)) @ J),
        jnp.asarray(rng.uniform(0.1, 2.0, (count, n))),
    )
    one, ended = jax.vmap(lambda *x: states(alone, *x))(*given)
    other, also = jax.vmap(lambda *x: states(together, *x))(*given)
    assert ended.all()
    assert also.all()
    assert {*np.unique(one)} == {-1.0, 0.0, 1.0}
    np.testing.assert_array_equal(one, other)


@pytest.mark.more
def test_the_motion_is_that_of_the_places():
    """The same chain in its two sets of coordinates: events and ends."""
    ends = []
    for kind in (Chain, Train):
        machine = chain(3, kind, speed=0.2)
        first = dict(x_1=0.5, x_2=-0.8) if kind is Chain else dict(x_1=0.5, x_2=-1.3, x_3=0.8)
        tight = ss.Integrator("dop853", ss.AdaptiveStep(1e-11, 1e-12))
        run = ss.simulate(machine, 0.0, 12.0, machine.state(**first), integrator=tight)
        x = np.array([float(v) for v in run.y1[:3]])
        ends.append((x if kind is Chain else np.cumsum(x), np.asarray(run.events.t)))
    (places, times), (relative, others) = ends
    assert np.isfinite(times).sum() >= 6
    np.testing.assert_allclose(relative, places, atol=1e-8)
    np.testing.assert_allclose(others, times, atol=1e-7)


def test_what_a_contact_bears_at_rest_is_asked_without_the_friction_of_others():
    """A guard for each contact: its operations grow like the blocks, but for sums of forces."""

    def operations(kind):
        machine = chain(6, kind)
        run = jax.make_jaxpr(lambda y, mode: machine.guards(0.0, y, mode, None))
        return str(run(machine.state(), jnp.zeros((), jnp.int32))).count(" = ")

    assert operations(Train) < 1.8 * operations(Chain)
