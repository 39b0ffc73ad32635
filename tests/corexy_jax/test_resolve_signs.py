"""What begins to slide at one instant, against the general solver of `stickslip.contact`."""

import jax
import jax.numpy as jnp
import numpy as np

from corexy_jax._contact_motion import contact_motion, onset
from corexy_jax._contacts import NORMALS, Line
from corexy_jax._modes import NO_SENSE, SIGNS
from corexy_jax._resolve_signs import resolve_signs
from stickslip.contact import dead_zone_gauge, resolve

COUNT = 600
NONE = (jnp.asarray(False),) * 8


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
    parts = (tuple(a) for a in (drive, static, kinetic, signs))
    return jnp.stack(resolve_signs(Line(*mass), *parts, NONE))


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
    friction = tuple(-signs * kinetic)
    motion = contact_motion(Line(*mass), tuple(drive), friction, tuple(rest))
    giving_way = onset(tuple(static), tuple(rest), motion.reaction)
    # The reaction of the resting contacts must lie in the set of their friction forces.
    reaction = jnp.stack(motion.reaction)
    gauge = dead_zone_gauge(reaction, jnp.asarray(NORMALS), static, active=rest)
    held = jnp.abs(jnp.asarray(NORMALS) @ jnp.stack(motion.acceleration)) * rest.astype(float)
    return giving_way.reserve, gauge, jnp.max(held)


def test_the_fourteen_lines_are_the_zonotope():
    """The sign of the reserve against the gauge of the zonotope of the resting contacts."""
    mass, drive, static, kinetic, _ = problems()
    faces = jnp.asarray(SIGNS[np.arange(COUNT) % len(SIGNS)].astype(float))
    some = jnp.any(faces == 0, axis=1)
    reserve, gauge, held = (np.asarray(a)[some] for a in reserves(mass, drive, static, kinetic, faces))
    np.testing.assert_array_equal(reserve < 0, gauge > 1)
    assert 0.1 < np.mean(reserve < 0) < 0.95
    assert np.max(held) < 1e-9
