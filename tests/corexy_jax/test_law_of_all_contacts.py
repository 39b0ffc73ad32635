"""What begins to slide at one instant, against the general solver of `tests.oracle`."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax as cx
from corexy_jax._contact_motion import contact_motion
from corexy_jax._contacts import NORMALS, Line
from corexy_jax._modes import SIGNS
from stickslip.mechanism._laws import Bounds
from stickslip.mechanism._motion import Motion
from stickslip.mechanism._scalars import Mass
from stickslip.mechanism._search import Problem
from tests.oracle import dead_zone_gauge, resolve

COUNT = 600
NO_SENSE = 9.0
SYSTEM = cx.CoreXY(*cx.scenario(1))
(GROUP,) = SYSTEM.structure.groups


def problems():
    """Masses, drives, limits and faces; kinetic friction may be less, equal or more than static."""
    rng = np.random.default_rng(3)
    mass = rng.uniform(0.3, 3.0, (COUNT, 4))
    static = rng.uniform(0.5, 8.0, (COUNT, 8))
    kinetic = static * rng.uniform(0.1, 1.0, (COUNT, 8))
    kinetic[::5] = static[::5]
    drive = rng.normal(size=(COUNT, 2)) * 10 ** rng.uniform(0.0, 3.0, (COUNT, 1))
    faces = SIGNS[rng.integers(0, len(SIGNS), COUNT)].astype(float)
    faces[: COUNT // 2] = 0
    return tuple(map(jnp.asarray, (mass, drive, static, kinetic, faces)))


@jax.jit
@jax.vmap
def ours(mass, drive, static, kinetic, signs):
    """By the law of the base class with the closed form of the machine; `NO_SENSE` without an end."""
    force = jnp.concatenate([jnp.zeros(2), drive]) - (signs * kinetic) @ jnp.asarray(NORMALS)

    def motion(M, F, J, rest, gamma):
        return Motion(*SYSTEM.motion_together(GROUP, M, F, rest), None)

    limits = [0.0] * 8, Bounds(None, static), Bounds(None, kinetic), motion
    start = signs, jnp.zeros(8, bool), jnp.asarray(True)
    found, ended = GROUP.law(Problem(Mass(list(mass)), force, NORMALS.tolist(), *limits, *start))
    return jnp.where(ended, found, NO_SENSE)


@jax.jit
@jax.vmap
def asked_again(mass, drive, static, kinetic, signs, given):
    """Senses by the general solver, the friction of what has begun being that of `given`."""
    normals = jnp.asarray(NORMALS)
    standing = signs == 0
    bias = jnp.where(standing, 0.5 * given * (static - kinetic), -signs * kinetic)
    limits = jnp.where(given == 0, static, 0.5 * (static + kinetic))
    force = bias @ normals + jnp.concatenate([jnp.zeros(2), drive])
    found = resolve(jnp.diag(mass), force, normals, limits, active=standing)
    return jnp.where(standing, jnp.sign(found.contact_acceleration), signs)


@pytest.mark.more
def test_the_general_solver_finds_the_same_senses():
    given = problems()
    found = np.asarray(ours(*given))
    assert not np.any(found == NO_SENSE)
    expected = given[4]
    for _ in range(20):
        expected = asked_again(*given, expected)
    settled = np.all(np.asarray(asked_again(*given, expected)) == np.asarray(expected), axis=1)
    assert np.mean(settled) > 0.99
    np.testing.assert_array_equal(found[settled], np.asarray(expected)[settled])
    begun = np.sum((found != 0) & (np.asarray(given[4]) == 0), axis=1)
    assert {0, 1, 2, 3} <= set(begun)


@jax.jit
@jax.vmap
def reserves(mass, drive, static, kinetic, signs):
    rest = signs == 0
    force = jnp.concatenate([jnp.zeros(2), drive]) - (signs * kinetic) @ jnp.asarray(NORMALS)
    acceleration, reaction = contact_motion(Line(*mass), tuple(force), tuple(rest))
    giving_way = GROUP.onset(Bounds(None, tuple(static)), tuple(rest), reaction)
    # The reaction of the resting contacts must lie in the set of their friction forces.
    reaction = jnp.stack(reaction)
    gauge = dead_zone_gauge(reaction, jnp.asarray(NORMALS), static, active=rest)
    held = jnp.abs(jnp.asarray(NORMALS) @ jnp.stack(acceleration)) * rest.astype(float)
    return giving_way.share, gauge, jnp.max(held)


def test_the_fourteen_lines_are_the_zonotope():
    """The share of the friction that is used, against the gauge of the zonotope."""
    mass, drive, static, kinetic, _ = problems()
    faces = jnp.asarray(SIGNS[np.arange(COUNT) % len(SIGNS)].astype(float))
    some = jnp.any(faces == 0, axis=1)
    share, gauge, held = (np.asarray(a)[some] for a in reserves(mass, drive, static, kinetic, faces))
    np.testing.assert_array_equal(share > 1, gauge > 1)
    assert 0.1 < np.mean(share > 1) < 0.95
    assert np.max(held) < 1e-9
