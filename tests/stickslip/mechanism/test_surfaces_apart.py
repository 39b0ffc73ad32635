"""Contacts whose directions depend on each other, on surfaces with speeds of their own.

They never all rest at once: each stops at its own time, which one guard for all of them would miss.
"""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact, Stop
from tests.stickslip.mechanism.test_against_moreau import moreau

END = 10.0


class BetweenSurfaces(AbstractMechanism):
    """1 kg on a spring between two belts."""

    p: Any

    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"lower": {"x": 1.0}, "upper": {"x": -1.0}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        stiffness, *_, amplitude, rate = self.p
        return {"x": amplitude * jnp.cos(rate * t) - stiffness * q.x}

    def time_scale(self, args):
        return 1.0 / self.p[-1]

    def contacts(self, t, q, v, args):
        _, lower, upper, first, second, _, _ = self.p
        return {
            "lower": Contact(Coulomb(1.0), normal_force=first, surface_speed=lower),
            "upper": Contact(Coulomb(1.0), normal_force=second, surface_speed=-upper),
        }


class Shaken(AbstractMechanism):
    """A body between surfaces that move to and fro, each on its own; `n` are its directions."""

    mass: Any
    stiffness: Any
    limits: Any
    steady: Any
    amplitudes: Any
    rates: Any

    n: ClassVar = (1.0, -0.7, 1.3)
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"low": {"x": 1.0}, "side": {"x": -0.7}, "top": {"x": 1.3}}

    def mass_matrix(self, q):
        return {"x": self.mass}

    def forces(self, t, q, v, args):
        return {"x": -self.stiffness * q.x + 0.3 * jnp.sin(0.7 * t)}

    def contacts(self, t, q, v, args):
        speeds = self.steady + self.amplitudes * jnp.sin(self.rates * t)
        return {
            name: Contact(Coulomb(self.limits[c]), surface_speed=speeds[c])
            for c, name in enumerate(self.contact_directions)
        }


class OnRails(AbstractMechanism):
    """A slider on two rails of one speed, or on one that bears as much; a stop beside them or none."""

    stiffness: Any
    limits: Any
    speed: Any

    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"left": {"x": 1.0}, "right": {"x": -0.5}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": 1.5 * jnp.sin(t) - self.stiffness * q.x}

    def contacts(self, t, q, v, args):
        left, right = self.limits
        return {
            "left": Contact(Coulomb(left), surface_speed=self.speed),
            "right": Contact(Coulomb(right), surface_speed=-0.5 * self.speed),
        }


class OnOneRail(OnRails):
    contact_directions: ClassVar = {"rail": {"x": 1.0}}

    def contacts(self, t, q, v, args):
        left, right = self.limits
        return {"rail": Contact(Coulomb(left + 0.5 * right), surface_speed=self.speed)}


class OnRailsToAStop(OnRails):
    stops: ClassVar = ("end",)

    def gaps(self, t, q, args):
        return {"end": Stop(1.0 - q.x, 0.4)}


class OnOneRailToAStop(OnOneRail):
    stops: ClassVar = ("end",)

    def gaps(self, t, q, args):
        return {"end": Stop(1.0 - q.x, 0.4)}


class Table(AbstractMechanism):
    """A slab in a plane on four guides; the third and fourth depend on the first two."""

    limits: Any
    speeds: Any
    rates: Any

    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {
        "x": {"x": 1.0}, "y": {"y": 1.0}, "sum": (1.0, 1.0), "difference": (1.0, -1.0),
    }  # fmt: skip

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.5}

    def forces(self, t, q, v, args):
        a, b = 3.0 * jnp.sin(self.rates[0] * t), 2.5 * jnp.sin(self.rates[1] * t + 0.3)
        return {"x": a - 0.5 * q.x, "y": b - 0.5 * q.y}

    def time_scale(self, args):
        return 1.0 / jnp.max(self.rates)

    def contacts(self, t, q, v, args):
        return {
            name: Contact(Coulomb(1.0), normal_force=self.limits[c], surface_speed=self.speeds[c])
            for c, name in enumerate(("x", "y", "sum", "difference"))
        }


def along_the_line(p, start, steps=20_000):
    """Moreau's time stepping of one velocity, its inclusion solved exactly in each step."""
    stiffness, lower, upper, first, second, amplitude, rate = p.T
    x, v, h = np.full(len(p), start), np.zeros(len(p)), END / steps
    swap = lower > upper
    w1, w2 = np.minimum(lower, upper), np.maximum(lower, upper)
    f1, f2 = np.where(swap, second, first), np.where(swap, first, second)
    for i in range(steps):
        force = amplitude * np.cos(rate * (i + 0.5) * h) - stiffness * (x + 0.5 * h * v)
        b = v + h * force
        # Friction falls as the speed passes either belt: the solution is the middle of these.
        below, between, above = b + h * (f1 + f2), b + h * (f2 - f1), b - h * (f1 + f2)
        fast = np.where(above <= w2, w2, above)
        middle = np.where(between <= w1, w1, np.where(between < w2, between, fast))
        u = np.where(below < w1, below, middle)
        x, v = x + 0.5 * h * (u + v), u
    return x, v


@pytest.mark.more
def test_one_velocity_between_two_belts():
    low = [0.5, -0.5, -0.5, 0.1, 0.1, 0.0, 0.3]
    high = [4.0, 0.5, 0.5, 0.6, 0.6, 2.0, 4.0]
    p = np.random.default_rng(0).uniform(low, high, (40, 7))

    @jax.jit
    @jax.vmap
    def run(p):
        block = BetweenSurfaces(p)
        return ss.simulate(
            block, 0.0, END, block.state(x=0.3), throw=False, saveat=ss.SaveAt(max_events=256)
        )

    found = run(jnp.asarray(p))
    assert np.all(found.successful)
    assert np.sum(found.num_events) > 300
    x, v = along_the_line(p, 0.3)
    np.testing.assert_allclose(found.y1.x, x, atol=2e-3)
    np.testing.assert_allclose(found.y1.v_x, v, atol=1e-2)
    # Every other run stops on a belt without a drop of friction; none of that is a reason to doubt.
    assert np.mean(np.asarray(found.flags) == 0) > 0.9


def shaken(p, start, steps):
    """Moreau's time stepping: the zero of a sum of signs and a line is the median of its bends and of
    what it would be on each side of them."""
    mass, stiffness, limits, steady, amplitudes, rates = p
    n, x, v, h = np.array(Shaken.n), start.copy(), np.zeros(len(start)), END / steps
    force = np.abs(n) * limits * h
    for i in range(steps):
        surfaces = (steady + amplitudes * np.sin(rates * (i + 1) * h)) / n
        order = np.argsort(surfaces, axis=1)
        bends, falls = (np.take_along_axis(a, order, 1) for a in (surfaces, force))
        passed = np.concatenate([np.zeros((len(x), 1)), np.cumsum(falls, 1)], 1)
        load = 0.3 * np.sin(0.7 * (i + 0.5) * h) - stiffness * (x + 0.5 * h * v)
        sides = ((mass * v + h * load)[:, None] + passed[:, -1:] - 2 * passed) / mass[:, None]
        u = np.median(np.concatenate([bends, sides], 1), axis=1)
        x, v = x + 0.5 * h * (u + v), u
    return x


def test_surfaces_that_move_each_on_its_own():
    """What rests on one while another turns round follows the one that holds it."""
    rng, lanes = np.random.default_rng(3), 24
    shape = (lanes, 3)
    p = (
        rng.uniform(0.3, 2.0, lanes), rng.uniform(0.0, 2.0, lanes), rng.uniform(0.1, 1.2, shape),
        rng.uniform(-1.0, 1.0, shape) * (rng.random(shape) > 0.5),
        rng.uniform(0.1, 1.5, shape) * (rng.random(shape) > 0.3), rng.uniform(0.3, 3.0, shape),
    )  # fmt: skip
    start = rng.uniform(-2.0, 2.0, lanes)

    @jax.jit
    @jax.vmap
    def run(p, x):
        body = Shaken(*p)
        found = ss.simulate(body, 0.0, END, body.state(x=x), throw=False)
        return found.y1.x, found.successful, found.num_events

    x, good, events = run(tuple(map(jnp.asarray, p)), jnp.asarray(start))
    assert np.all(good)
    assert np.sum(events) > 200
    coarse, fine = shaken(p, start, 10_000), shaken(p, start, 20_000)
    np.testing.assert_allclose(x, 2 * fine - coarse, atol=2e-3)
    assert np.median(np.abs(x - (2 * fine - coarse))) < 2e-4


def test_a_belt_that_turns_round_carries_or_slips():
    @jax.jit
    def end(ground, belt):
        limits, moves = jnp.stack([ground, 0.0, belt]), jnp.array([0.0, 0.0, 1.3])
        body = Shaken(1.0, 0.0, limits, 0.0, moves, 2.0)
        return ss.simulate(body, 0.0, END, body.state(), throw=False).y1.x

    # The belt holds it against the ground all the time, or the ground against the belt.
    np.testing.assert_allclose(end(0.3, 5.0), 0.5 * (1 - np.cos(2.0 * END)), atol=1e-9)
    assert float(end(5.0, 0.3)) == 0.0


@pytest.mark.parametrize(
    ("two", "one", "speed"), [(OnRails, OnOneRail, 0.0), (OnRailsToAStop, OnOneRailToAStop, 0.3)]
)
def test_two_rails_of_one_speed_are_one(two, one, speed):
    starts = jnp.linspace(-0.5, 0.5, 8)

    def run(machine):
        def end(p, x):
            mechanism = machine(p[0], p[1:3], p[3])
            found = ss.simulate(mechanism, 0.0, END, mechanism.state(x=x, v_x=0.8), throw=False)
            return found.y1.x, (found.y1.x, found.num_events, found.flags)

        slopes = jax.jacfwd(end, has_aux=True)
        p = jnp.array([1.2, 0.3, 0.4, speed])
        return jax.jit(jax.vmap(slopes, (None, 0)))(p, starts)

    slopes, (x, events, flags) = run(two)
    expected, (exact, number, none) = run(one)
    assert np.all(events > 2)
    np.testing.assert_array_equal((events, flags), (number, none))
    np.testing.assert_allclose(x, exact, rtol=1e-10)
    np.testing.assert_allclose(slopes, expected, rtol=1e-8, atol=1e-9)


@pytest.mark.more
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_slab_on_four_guides(seed):
    rng = np.random.default_rng(seed)
    limits, speeds = rng.uniform(0.2, 1.0, 4), rng.uniform(-0.5, 0.5, 4)
    rates = rng.uniform(0.8, 2.0, 2)
    table = Table(*map(jnp.asarray, (limits, speeds, rates)))
    run = ss.simulate(table, 0.0, END, table.state(), saveat=ss.SaveAt(max_events=256))
    assert int(run.num_events) > 10
    J = np.array([[1, 0], [0, 1], [1, 1], [1, -1]], float)

    def force(t, q):
        a, b = 3.0 * np.sin(rates[0] * t), 2.5 * np.sin(rates[1] * t + 0.3)
        return np.array([a, b]) - 0.5 * q

    exact = np.array([run.y1.x, run.y1.y, run.y1.v_x, run.y1.v_y])
    found = moreau(np.diag([1.0, 1.5]), force, J, speeds, limits, np.zeros(2), END, 4000)
    np.testing.assert_allclose(found, exact, atol=1e-2)


@pytest.mark.more
def test_what_two_contacts_hold_rests_with_them():
    """On one surface: as the last of the speeds vanishes nothing but rounding is left to compare."""
    rng = np.random.default_rng(5)
    limits, rates = rng.uniform(0.2, 1.0, (24, 4)), rng.uniform(0.8, 2.0, (24, 2))
    surface = np.concatenate([np.zeros((12, 2)), rng.uniform(-0.3, 0.3, (12, 2))])
    J = np.array([[1, 0], [0, 1], [1, 1], [1, -1]], float)
    speeds = surface @ J.T
    # The times at which the engine looks depend on the end of the run, and the rounding on them.
    lane = np.concatenate([np.arange(24), np.full(40, 14)])
    ends = np.concatenate([np.full(24, END), np.linspace(0.5 * END, END, 40)])

    @jax.jit
    @jax.vmap
    def run(limits, speeds, rates, end):
        table = Table(limits, speeds, rates)
        return ss.simulate(
            table, 0.0, end, table.state(), throw=False, saveat=ss.SaveAt(max_events=256)
        )

    found = run(*(jnp.asarray(a[lane]) for a in (limits, speeds, rates)), jnp.asarray(ends))
    assert np.all(found.successful)
    assert not np.any(np.asarray(found.flags))
    for i in (0, 4, 13, 20):

        def force(t, q, i=i):
            a, b = 3.0 * np.sin(rates[i, 0] * t), 2.5 * np.sin(rates[i, 1] * t + 0.3)
            return np.array([a, b]) - 0.5 * q

        y = found.y1
        exact = np.array([y.x[i], y.y[i], y.v_x[i], y.v_y[i]])
        M = np.diag([1.0, 1.5])
        stepped = moreau(M, force, J, speeds[i], limits[i], np.zeros(2), END, 4000)
        np.testing.assert_allclose(stepped, exact, atol=1e-2)
