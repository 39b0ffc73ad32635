"""Which contacts begin to slide: against all patterns tried, linear programming, and `resolve`."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from stickslip.mechanism._laws import Bounds
from stickslip.mechanism._scalars import Mass
from tests.oracle import resolve
from tests.stickslip.mechanism._groups import (
    OF_SEVERAL_VELOCITIES,
    STRUCTURES,
    distance,
    enumerated,
    found,
    instants,
    named,
)

CASES = 500


@pytest.mark.more
@pytest.mark.parametrize("name", STRUCTURES)
def test_the_least_of_gauss_function(name):
    """Static friction as kinetic: the acceleration is the minimum of a convex function."""
    of, given = named(name), instants(name, CASES)
    states, acceleration, ended = found(of, given)
    assert ended.all()
    assert {*np.unique(states)} == {-1.0, 0.0, 1.0}
    assert distance(given, acceleration, enumerated(of.directions, given)).max() < 1e-9


@pytest.mark.parametrize("name", ["chain, relative", "carriage", "five in space"])
def test_a_drop_of_friction_ends_in_a_state_that_is_allowed(name):
    """What slides goes in its sense under kinetic friction; what rests bears no more than static."""
    of, given = named(name), instants(name, CASES, seed=1)
    J = of.directions
    states, a, ended = found(of, given, static=1.4)
    assert ended.all()
    # Masses of one scale, so that all is of the order 1.
    for i in range(1, CASES, 6):
        M, F, gamma, low, high = (x[i] for x in given)
        s, slips = states[i], J @ a[i] - gamma
        size = np.abs(F).sum() + np.abs(high - low).sum() + np.abs(M @ a[i]).sum()
        pace = np.abs(a[i]).sum() + np.abs(gamma).sum() + 1e-300
        assert (s * slips >= -1e-9 * pace).all()
        assert np.abs(slips[s == 0]).max(initial=0.0) < 1e-9 * pace
        slides = J.T @ np.where(s > 0, low, np.where(s < 0, high, 0.0))
        bounds = [(1.4 * lo, 1.4 * hi) if x == 0 else (0, 0)
                  for lo, hi, x in zip(low, high, s, strict=True)]  # fmt: skip
        assert outside(J, M @ a[i] - F - slides, bounds) <= 1e-9 * size


def outside(J, load, bounds) -> float:
    """How far the load is from what contact forces within the bounds can make (sum of misfits)."""
    m, n = J.shape
    equal = np.hstack([J.T, np.eye(n), -np.eye(n)])
    cost = np.r_[np.zeros(m), np.ones(2 * n)]
    size = np.abs(load).max() + max(abs(x) for b in bounds for x in b) + 1e-300
    scaled = [(lo / size, hi / size) for lo, hi in bounds] + [(0, None)] * (2 * n)
    answer = linprog(cost, A_eq=equal, b_eq=load / size, bounds=scaled)
    assert answer.status == 0
    return answer.fun * size


@pytest.mark.more
@pytest.mark.parametrize("name", OF_SEVERAL_VELOCITIES)
def test_share_of_what_dependent_contacts_bear(name):
    """The largest load in the direction of the given one, by linear programming."""
    of, given = named(name), instants(name, 60, seed=2)
    J = of.directions
    rest, rows = (jnp.ones((), bool),) * of.m, J.tolist()

    def share(M, F, low, high):
        motion = of.motion(Mass(full=[list(row) for row in M]), tuple(F), rows, rest, [0.0] * of.m)
        reaction = of.row([jnp.asarray(x, jnp.float64) for x in motion.reaction])
        bounds = Bounds(of.row(list(low)), of.row(list(high)))
        return of.onset(bounds, of.row(list(rest)), reaction).share, jnp.stack(list(reaction))

    arguments = map(jnp.asarray, (given.M, given.F, given.low, given.high))
    shares, reactions = jax.jit(jax.vmap(share))(*arguments)
    compared = 0
    for i in range(len(given.F)):
        low, high, reaction = given.low[i], given.high[i], np.asarray(reactions[i])
        if min(-low.max(), high.min()) < 1e-6 * np.abs(reaction).max():
            continue  # a contact without friction: some loads cannot be borne at all
        # J' lambda = s reaction, s as large as can be.
        answer = linprog(
            np.r_[np.zeros(of.m), -1.0],
            A_eq=np.c_[J.T, -reaction],
            b_eq=np.zeros(of.n),
            bounds=[*zip(low, high, strict=True), (0, None)],
        )
        assert answer.status == 0
        np.testing.assert_allclose(shares[i], -1.0 / answer.fun, rtol=1e-7)
        compared += 1
    assert compared > 30


@pytest.mark.more
@pytest.mark.parametrize("name", ["carriage", "carriage on four skew rails", "five in space"])
def test_as_resolve(name):
    """The search of `tests.oracle`, another one, for friction that is the same both ways."""
    of, given = named(name), instants(name, CASES, seed=3)
    given = given._replace(low=-given.high, gamma=0.0 * given.gamma)
    _, acceleration, _ = found(of, given)
    answer = jax.vmap(resolve, in_axes=(0, 0, None, 0))(
        jnp.asarray(given.M), jnp.asarray(given.F), jnp.asarray(of.directions), jnp.asarray(given.high)
    )
    assert distance(given, acceleration, np.asarray(answer.acceleration)).max() < 1e-9


def test_a_velocity_that_no_contact_touches():
    """Its lever is zero, which once made every overload rounding: a block that carries a pendulum."""
    of, given = named("dependent, of fewer than all velocities"), instants("carriage", 1)
    J = of.directions
    M = np.array([[[3.0, 0.0, 1.0], [0.0, 2.0, 0.0], [1.0, 0.0, 1.0]]])
    F, limits = np.array([[4.0, 0.0, 0.0]]), np.full((1, 3), 0.5)
    given = given._replace(M=M, F=F, gamma=np.zeros((1, 3)), low=-limits, high=limits)
    states, acceleration, _ = found(of, given)
    np.testing.assert_array_equal(states, [[1.0, -1.0, 1.0]])
    np.testing.assert_allclose(acceleration, enumerated(J, given), rtol=1e-12)
