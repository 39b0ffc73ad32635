"""A step-size rule, a tableau and a method written with the public names alone."""

from typing import Any, ClassVar, NamedTuple

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion

V = 0.2
EXACT, SLOPE = 0.6584367552929, 16.2232182593  # x(30) and its derivative, in closed form


def end(integrator, v=V):
    block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, v)
    return ss.simulate(block, 0.0, 30.0, Motion(x=0.0, v=v), "stick", integrator=integrator)


class Doubling(ss.AbstractAdaptiveStep):
    rtol: float = 1e-10
    atol: Any = None
    dtmax: Any = None
    dtmin: float = 0.0
    remembers: ClassVar = False

    def initial(self, y, dy, scale):
        return jnp.asarray(1e-3)

    def factor(self, error, previous, order):
        return jnp.where(error > 1.0, 0.5, jnp.where(error < 2.0**-order, 2.0, 1.0))


class Kutta38(ss.AbstractStepper):
    """The 3/8 rule."""

    def order(self):
        return 4

    def has_error_estimate(self):
        return False

    def step(self, field, t, y, dy, h, execute):
        def along(weights, *slopes):
            move = lambda y, *k: y + h * sum(w * s for w, s in zip(weights, k, strict=True))  # noqa: E731
            return jax.tree.map(move, y, *slopes)

        k2 = field(t + h / 3, along((1 / 3,), dy))
        k3 = field(t + 2 * h / 3, along((-1 / 3, 1.0), dy, k2))
        k4 = field(t + h, along((1.0, -1.0, 1.0), dy, k2, k3))
        y1 = along((1 / 8, 3 / 8, 3 / 8, 1 / 8), dy, k2, k3, k4)
        return y1, field(t + h, y1), ()


HEUN = ss.Tableau(
    "Heun", 3, [[0, 0, 0], [1 / 3, 0, 0], [0, 2 / 3, 0]], [1 / 4, 0, 3 / 4], [0, 1 / 3, 2 / 3]
)
BOGACKI = ss.Tableau(
    "Bogacki-Shampine", 3, [[0, 0, 0], [1 / 2, 0, 0], [0, 3 / 4, 0]], [2 / 9, 1 / 3, 4 / 9],
    [0, 1 / 2, 3 / 4], [[2 / 9 - 7 / 24, 1 / 3 - 1 / 4, 4 / 9 - 1 / 3, -1 / 8]],
)  # fmt: skip


@pytest.mark.more
@pytest.mark.parametrize(
    ("integrator", "error"),
    [
        (ss.Integrator(step=Doubling()), 1e-9),
        (ss.Integrator(BOGACKI, ss.AdaptiveStep(1e-9)), 1e-6),
        (ss.Integrator(BOGACKI, Doubling(1e-9)), 1e-6),
        (ss.Integrator(HEUN, ss.FixedStep(0.01)), 1e-6),
        (ss.Integrator(Kutta38(), ss.FixedStep(0.01)), 1e-8),
    ],
)
def test_motion_and_derivatives(integrator, error):
    def position(v):
        run = end(integrator, v)
        return run.y1.x, (run.y1.x, run.successful, run.num_events)

    for slope in (jax.jacfwd, jax.grad):
        rate, (x, successful, events) = jax.jit(slope(position, has_aux=True))(V)
        assert bool(successful)
        assert int(events) == 6
        np.testing.assert_allclose(x, EXACT, atol=error)
        np.testing.assert_allclose(rate, SLOPE, atol=100 * error)


def test_a_rule_without_derivatives():
    """Of a run that is only simulated; those of fixed steps are below."""
    run = end(ss.Integrator(step=Doubling()))
    assert bool(run.successful)
    assert int(run.num_events) == 6
    np.testing.assert_allclose(run.y1.x, EXACT, atol=1e-9)


@pytest.mark.more
@pytest.mark.parametrize(("method", "order"), [(HEUN, 3), (Kutta38(), 4), (BOGACKI, 3)])
def test_order_of_convergence(method, order):
    def error(h):
        integrator = ss.Integrator(method, ss.FixedStep(h), max_steps=10_000)
        return abs(float(end(integrator).y1.x) - EXACT)

    assert np.log2(error(0.1) / error(0.05)) == pytest.approx(order, abs=0.4)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (dict(a=[[0, 0], [0.5, 0.1]]), "a"),
        (dict(a=[[0, 0]]), "a"),
        (dict(b=[0.5, 0.6]), "b"),
        (dict(c=[0.0, 0.4]), "c"),
        (dict(error_weights=[[1.0, 0.0]]), "error_weights"),
        (dict(order=0), "order"),
    ],
)
def test_a_wrong_tableau_is_refused(change, name):
    right = dict(name="midpoint", order=2, a=[[0, 0], [0.5, 0]], b=[0, 1.0], c=[0, 0.5])
    ss.Tableau(**right)
    with pytest.raises(ValueError, match=rf"^{name}"):
        ss.Tableau(**right | change)


class Parts(NamedTuple):
    """A state with an empty part, as the state of a law has that has none."""

    x: Any
    z: tuple
    v: Any


class Damped(ss.AbstractSmoothSystem):
    """An oscillator, critically damped."""

    def vector_field(self, t, y, mode, args):
        return Parts(y.v, (), -y.x - 2.0 * y.v)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, 2.0**-20])
def test_implicit_methods_take_as_many_steps_as_the_tolerance_asks_for(size):
    """Friction rounded off within 1/200 of the belt's speed; DOP853 takes tens of thousands."""
    block = CoulombOscillator(1.0, 1.0, 1.0 * size, 0.5 * size, 0.2 * size)
    start, block = block.state(x=0.0, v=0.2 * size), block.regularised(1e-3 * size)

    def run(method, tolerance):
        rule = ss.Integrator(method, ss.AdaptiveStep(tolerance))
        return ss.simulate(block, 0.0, 30.0, start, integrator=rule, saveat=ss.SaveAt(max_events=None))

    exact = float(run("dop853", 1e-12).y1.x)
    for tolerance, most, error in ((1e-5, 300, 2e-4), (1e-10, 2_000, 2e-8)):
        found = run(dfx.Kvaerno5(), tolerance)
        assert int(found.stats.num_accepted) < most
        assert float(found.y1.x) == pytest.approx(exact, abs=error * size)


@pytest.mark.more
def test_solvers_of_diffrax_take_states_with_empty_parts():
    """And have a forward derivative, which diffrax's own loop over the stages has not."""
    rule = ss.Integrator(dfx.Kvaerno3(), ss.AdaptiveStep(1e-6, 1e-6))

    def end(x0):
        return ss.simulate(Damped(), 0.0, 1.0, Parts(x0, (), 0.0), integrator=rule).y1

    y, dy = jax.jvp(end, (1.0,), (1.0,))
    assert y.z == ()
    for found in (y, dy):
        assert float(found.x) == pytest.approx(2.0 * np.exp(-1.0), abs=1e-5)
        assert float(found.v) == pytest.approx(-np.exp(-1.0), abs=1e-5)
