"""Dependent contacts in rows: as a vector, as a tuple, and line by line in NumPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.friction import Asymmetric, Coulomb, Stribeck
from stickslip.hybrid import use_executor
from stickslip.hybrid.executor import FUSED, PORTABLE
from stickslip.mechanism import Contact
from stickslip.mechanism._dependent import motion_in_rows
from stickslip.mechanism._laws import Bounds, Laws
from stickslip.mechanism._rows import each, row
from stickslip.mechanism._scalars import Mass
from stickslip.mechanism._search import UNRESISTED
from tests.stickslip.mechanism._groups import (
    DEPENDENT,
    OF_SEVERAL_VELOCITIES,
    distance,
    found,
    instants,
    named,
)

EXECUTORS = {"vector": PORTABLE, "tuple": FUSED}
COUNT = 300


def stacked(rows):
    return jnp.stack(rows) if isinstance(rows, tuple) else rows


@pytest.mark.more
@pytest.mark.parametrize("name", DEPENDENT)
def test_the_law_does_not_depend_on_the_form(name):
    of, given = named(name), instants(name, COUNT)
    answers = []
    for executor in EXECUTORS.values():
        with use_executor(executor):
            answers.append(found(of, given))
    (_, a, ended), (_, b, also) = answers
    # States may differ where the load is at a limit to the last digits.
    assert np.max(distance(given, a, b)) < 1e-9
    assert np.all(ended & also)


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("name", OF_SEVERAL_VELOCITIES)
def test_how_contacts_give_way(name, symmetric):
    """By the definition of the zonotope's facets, line by line in NumPy."""
    of, rng = named(name), np.random.default_rng(5)
    high = rng.uniform(0.1, 3.0, (COUNT, of.m))
    low = -high if symmetric else -rng.uniform(0.1, 3.0, (COUNT, of.m))
    rest, reaction = rng.random((COUNT, of.m)) < 0.6, rng.normal(size=(COUNT, of.n))
    rest[0] = False

    def in_rows(low, high, rest, reaction):
        high, rest, reaction = (row(list(x)) for x in (high, rest, reaction))
        bounds = Bounds(None if symmetric else row(list(low)), high)
        answer = of.onset(bounds, rest, reaction)
        slow = each(lambda r: r | True, rest)
        return answer.share, stacked(answer.ways), stacked(of.closure(rest, slow))

    expected = [one_by_one(of, *numbers) for numbers in zip(low, high, rest, reaction, strict=True)]
    shares, ways, closures = (np.array(x) for x in zip(*expected, strict=True))
    for executor in EXECUTORS.values():
        with use_executor(executor):
            answer = jax.jit(jax.vmap(in_rows))(low, high, rest, reaction)
        np.testing.assert_allclose(answer[0], shares, rtol=1e-12)
        np.testing.assert_array_equal(answer[1], ways)
        np.testing.assert_array_equal(answer[2], closures)
    assert np.any(shares > 1.0)
    assert np.any(shares < 1.0)


def one_by_one(of, low, high, rest, reaction):
    """Share of what can be borne and senses of giving way, by every line; what rests with `rest`."""
    share, ways = UNRESISTED, np.zeros(of.m)
    for line, along in zip(of.tables.lines, of.tables.along, strict=True):
        load = line @ reaction
        against = np.where(along * load > 0.0, high, -low) * rest
        used = abs(load) / (np.abs(along) @ against + 1e-150) if (along * rest).any() else UNRESISTED
        if used > share:
            share, ways = used, -np.sign(load) * np.sign(along) * rest
    J = of.directions
    rank = np.linalg.matrix_rank(J[rest]) if rest.any() else 0
    spanned = [np.linalg.matrix_rank(np.vstack([J[rest], J[c : c + 1]])) == rank for c in range(of.m)]
    return share, ways, rest | np.array(spanned)


KINDS = {
    "Coulomb": lambda a: Coulomb(2.0 * a, a),
    "Stribeck": lambda a: Stribeck(2.0 * a, a, 0.3),
    "asymmetric": lambda a: Asymmetric(Coulomb(2.0 * a, a), Coulomb(3.0 * a, 0.5 * a)),
}


@pytest.mark.parametrize("form", EXECUTORS)
@pytest.mark.parametrize("kinds", [("Coulomb",) * 4, ("Stribeck",) * 4, ("asymmetric",) * 4,
                                   ("Coulomb", "Stribeck", "asymmetric", "Coulomb")])  # fmt: skip
def test_friction_of_laws_side_by_side(form, kinds):
    loads, a = jnp.asarray([1.0, 2.0, 0.5, 3.0]), jnp.asarray([0.1, 0.2, 0.3, 0.4])
    speeds, states = jnp.asarray([0.2, -0.3, 0.1, -0.4]), jnp.asarray([1.0, -1.0, 0.0, -1.0])
    with use_executor(EXECUTORS[form]):
        laws = [KINDS[kind](x) for kind, x in zip(kinds, a, strict=True)]
        contacts = [Contact(law, load) for law, load in zip(laws, loads, strict=True)]
        side_by_side = Laws(contacts, row)
        friction = stacked(side_by_side.friction(lambda: row(list(speeds)), row(list(states))))
        static = side_by_side.bounds("static_coefficient")
        low, high = stacked(static.lower), stacked(static.high)
    for c, law in enumerate(laws):
        slips = law.slip_force(speeds[c], loads[c], states[c]) if states[c] else 0.0
        np.testing.assert_allclose(friction[c], slips, rtol=1e-14)
        np.testing.assert_allclose(low[c], -law.static_coefficient(1) * loads[c], rtol=1e-14)
        np.testing.assert_allclose(high[c], law.static_coefficient(-1) * loads[c], rtol=1e-14)


def test_motion_in_rows_is_that_of_the_group():
    of, mass = named("carriage"), Mass([2.0, 3.0])
    rest = jnp.asarray([False, False, True, False])
    a, reaction = motion_in_rows(of, mass, jnp.asarray([1.0, -4.0]), rest)
    # Along x - y, where x + y is held: 5 a = 5.
    np.testing.assert_allclose(a, [1.0, -1.0], rtol=1e-14)
    np.testing.assert_allclose(reaction, [1.0, 1.0], rtol=1e-14)
