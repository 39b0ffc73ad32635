"""Contacts whose direction passes through zero: dead centres, dead points, dwells, rest at them."""

import itertools
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.mechanism._laws import Bounds
from stickslip.mechanism._scalars import Mass
from tests.stickslip.mechanism._groups import group, states_by_law


class Crank(AbstractMechanism):
    """A crank under a torque, whose friction has the lever `sin(phi)`; `size` scales all forces."""

    friction: Any
    torque: Any
    ramp: Any
    size: Any
    coordinates: ClassVar = {"phi": "rad"}
    contact_directions: ClassVar = {"slider": None}

    def mass_matrix(self, q):
        return {"phi": self.size}

    def forces(self, t, q, v, args):
        return {"phi": self.size * (self.torque + self.ramp * t)}

    def time_scale(self, args):
        return 1.0

    def contacts(self, t, q, v, args):
        return [Contact(Coulomb(self.friction), self.size, direction={"phi": jnp.sin(q.phi)})]


def end(p):
    crank = Crank(*p[:4])
    found = ss.simulate(crank, p[6], p[7], crank.state(phi=p[4], v_phi=p[5]), throw=False)
    return found.y1.phi, (found.y1.v_phi, found.flags, found.successful)


@pytest.fixture(scope="module")
def ends():
    """Angle, slopes, speed and flags for rows of friction, torque, ramp, size, phi, w, t0, t1."""
    slopes = jax.jit(jax.vmap(jax.jacfwd(lambda p: (end(p)[0], end(p)), has_aux=True)))

    def run(rows):
        # Always six lanes: one program.
        padded = jnp.asarray([*rows, *rows[:1] * (6 - len(rows))], jnp.float64)
        found, (phi, (w, flags, successful)) = slopes(padded)
        assert np.all(successful)
        return tuple(np.asarray(x)[: len(rows)] for x in (phi, found, w, flags))

    return run


@pytest.mark.more
def test_without_friction_a_dead_centre_is_not_felt(ends):
    """In the middle, at time 0, on the way back; reached with a speed that goes to zero; from rest."""
    rows = [
        (0, 0, 0, 1, 2.5, 1, 0, 2), (0, 0, 0, 1, -2.5, 1, -2.5, 2), (0, 0, 0, 1, 2.5, -1, 0, 9),
        (0, -1, 0, 1, -0.5, 1, 0, 3), (0, 0.1, 0, 1, 0, 0, 0, 8), (0, 0, 0.1, 1, 0, 0, 0, 8),
    ]  # fmt: skip
    phi, slopes, w, flags = ends(rows)
    span = np.array([t1 - t0 for *_, t0, t1 in rows])
    np.testing.assert_allclose(phi, [4.5, 2.0, -6.5, -2.0, 3.2, 0.1 * 8**3 / 6], rtol=1e-12)
    np.testing.assert_allclose(w, [1.0, 1.0, -1.0, -2.0, 0.8, 3.2], rtol=1e-12)
    np.testing.assert_allclose(slopes[:, 5], span, rtol=1e-9)  # by the speed
    np.testing.assert_allclose(slopes[:5, 1], span[:5] ** 2 / 2, rtol=1e-9)  # by the torque
    assert not flags[[0, 1, 2, 4, 5]].any()


def duration(friction, torque, phi, w, end):
    """Time from `phi` to `end` without a turn, by energy: friction takes 2 of it in half a turn."""

    def taken(x):
        halves, rest = np.divmod(x, np.pi)
        return 2.0 * halves + 1.0 - np.cos(rest)

    way = np.sign(end - phi)

    def slowness(x):
        lost = friction * (taken(x) - taken(phi)) * way
        return way / np.sqrt(w * w + 2.0 * (torque * (x - phi) - lost))

    inside = [k * np.pi for k in range(-3, 9) if min(phi, end) < k * np.pi < max(phi, end)]
    edges = [phi, *(inside if way > 0 else inside[::-1]), end]
    return sum(quad(slowness, a, b, epsabs=1e-12)[0] for a, b in itertools.pairwise(edges))


@pytest.mark.more
def test_friction_about_dead_centres_by_energy(ends):
    """From dead centres too, and in any units of force."""
    rows = [
        (0.3, 0.1, 0, 1, 0.3, 1.5, 0, 4), (0.3, 0.1, 0, 1e-12, 0.3, 1.5, 0, 4),
        (0.3, 0.1, 0, 1e12, 0.3, 1.5, 1e4, 1e4 + 4), (0.3, 0, 0, 1, np.pi, 1, 0, 2),
        (0.3, 0, 0, 1, -np.pi, 1, 0, 2), (0.3, 0, 0, 1, 0, -1, 0, 2),
    ]  # fmt: skip
    phi, slopes, _, flags = ends(rows)
    assert not flags.any()
    for (friction, torque, _, _, start, speed, t0, t1), stop, slope in zip(
        rows, phi, slopes, strict=True
    ):
        p = np.array([friction, torque, start, speed])
        assert duration(*p, stop) == pytest.approx(t1 - t0, rel=1e-8)

        def change(k, p=p, stop=stop):
            step = 1e-4 * np.eye(4)[k]
            return (duration(*(p + step), stop) - duration(*(p - step), stop)) / 2e-4

        ahead = (duration(*p, stop + 1e-4) - duration(*p, stop - 1e-4)) / 2e-4
        for k, column in ((0, 0), (3, 5)):
            assert slope[column] == pytest.approx(-change(k) / ahead, rel=1e-4)


@pytest.mark.more
def test_rest_at_a_dead_centre_holds_nothing(ends):
    """Whatever friction there is, the smallest torque moves it: the same motion both ways."""
    rows = [(0.3, s, 0, 1, 0, 0, 0, 2) for s in (0.1, -0.1)]
    rows += [(0.3, s, 0, 1, k, 0, 0, 2) for s, k in ((0.1, np.pi), (-0.1, -np.pi))]
    phi, *_ = ends(rows)
    # phi'' = 0.1 - 0.3 sin(phi)
    true = solve_ivp(
        lambda _, y: [y[1], 0.1 - 0.3 * np.sin(y[0])], (0, 2), [0, 0], "DOP853", rtol=1e-12, atol=1e-14
    ).y[0, -1]
    np.testing.assert_allclose(phi - [0, 0, np.pi, -np.pi], true * np.array([1, -1, 1, -1]), rtol=1e-8)


class Linkage(AbstractMechanism):
    """A crank moves a body with friction at `lever(phi)` times its own speed."""

    p: Any  # friction, torque, amplitude of the torque, mass of the body
    coordinates: ClassVar = {"phi": "rad"}
    contact_directions: ClassVar = {"guide": None}

    def mass_matrix(self, q):
        return {"phi": 1.0 + self.p[3] * self.lever(q.phi) ** 2}

    def forces(self, t, q, v, args):
        bend = jax.jvp(self.lever, (q.phi,), (jnp.ones_like(q.phi),))[1]
        turn = self.p[1] + self.p[2] * jnp.cos(q.phi) - 0.05 * v.phi
        return {"phi": turn - self.p[3] * self.lever(q.phi) * bend * v.phi**2}

    def contacts(self, t, q, v, args):
        return [Contact(Coulomb(self.p[0]), direction={"phi": self.lever(q.phi)})]


R, L = 0.4, 1.1  # crank and connecting rod
A, B, C, D = 0.5, 1.2, 1.0, 1.3  # crank, coupler, rocker and frame of a four-bar linkage


class SliderCrank(Linkage):
    def lever(self, x):
        s = jnp.sin(x)
        return -R * s - R * R * s * jnp.cos(x) / jnp.sqrt(L * L - (R * s) ** 2)


class ScotchYoke(Linkage):
    def lever(self, x):
        return -R * jnp.sin(x)


class FourBar(Linkage):
    def lever(self, x):
        def rocker(x):
            across, up = D - A * jnp.cos(x), -A * jnp.sin(x)
            apart = jnp.sqrt(across**2 + up**2)
            return jnp.arctan2(up, across) + jnp.arccos((B**2 - C**2 - apart**2) / (2 * C * apart))

        return jax.jvp(rocker, (x,), (jnp.ones_like(x),))[1]


class Geneva(Linkage):
    def lever(self, x):
        """A wheel that stands still for half of each turn."""
        return jnp.where(jnp.sin(x) > 0.0, jnp.sin(x), 0.0) ** 3


def slider_crank(x):
    return (R * np.cos(x + 1e-20j) + np.sqrt(L * L - (R * np.sin(x + 1e-20j)) ** 2)).imag / 1e-20


def four_bar(x):
    """Freudenstein's equation, by a step along the imaginary axis."""
    x = x + 1e-20j
    k1, k2, k3 = D / A, D / C, (A * A - B * B + C * C + D * D) / (2 * A * C)
    a, b = np.cos(x) - k1 - k2 * np.cos(x) + k3, -2 * np.sin(x)
    c = k1 - (k2 + 1) * np.cos(x) + k3
    return (2 * np.arctan((-b - np.sqrt(b * b - 4 * a * c)) / (2 * a))).imag / 1e-20


REFERENCE = {
    SliderCrank: slider_crank,
    ScotchYoke: lambda x: -R * np.sin(x),
    FourBar: four_bar,
    Geneva: lambda x: max(np.sin(x), 0.0) ** 3,
}


def referred(lever, border, p, phi, w, t1):
    """SciPy with events at zeros of the speed and of the lever, which `border` has too."""
    friction, torque, swing, mass = p
    y, t = np.array([phi, w]), 0.0
    while t < t1:
        n = lever(y[0])
        drive = torque + swing * np.cos(y[0])
        if abs(y[1]) < 1e-11:
            if abs(drive) <= friction * abs(n):
                return np.array([y[0], 0.0])
            way = np.sign(drive)
        else:
            way = np.sign(y[1])

        def field(_, y, way=way):
            n = lever(y[0])
            bend = (lever(y[0] + 1e-6) - lever(y[0] - 1e-6)) / 2e-6
            load = torque + swing * np.cos(y[0]) - 0.05 * y[1] - friction * abs(n) * way
            return [y[1], (load - mass * n * bend * y[1] ** 2) / (1 + mass * n * n)]

        def dead(_, y):
            return border(y[0])

        def stops(_, y, way=way):
            return way * y[1]

        dead.terminal = stops.terminal = True
        stops.direction = -1
        # Off the zero that it starts on.
        first = solve_ivp(field, (t, min(t + 1e-4, t1)), y, "DOP853", rtol=1e-12, atol=1e-14)
        t, y = first.t[-1], first.y[:, -1]
        found = solve_ivp(
            field, (t, t1), y, "DOP853", rtol=1e-12, atol=1e-14, events=[dead, stops], max_step=0.05
        )
        t, y = found.t[-1], found.y[:, -1]
        if len(found.t_events[1]):
            y[1] = 0.0
    return y


@pytest.mark.slow
@pytest.mark.parametrize("kind", [SliderCrank, ScotchYoke, FourBar, Geneva])
def test_linkages(kind):
    """Turning, turning back and stopping; without friction too."""
    number = 8
    p = np.random.default_rng(3).uniform([0.1, 0.0, 0.0, 0.3], [0.6, 0.5, 0.8, 2.0], (number, 4))
    p[0, 0] = 0.0
    phi, w = np.linspace(0.3, 6.0, number), np.linspace(3.0, -2.0, number)

    @jax.jit
    @jax.vmap
    def run(p, phi, w):
        machine = kind(p)
        return ss.simulate(machine, 0.0, 12.0, machine.state(phi=phi, v_phi=w), throw=False)

    found = run(p, phi, w)
    assert np.all(found.successful)
    lever = REFERENCE[kind]
    # One that rests on zero in its dwell would be met at every step.
    border = np.sin if kind is Geneva else lever
    for i in range(number):
        true = referred(lever, border, p[i], phi[i], w[i], 12.0)
        assert found.y1.phi[i] == pytest.approx(true[0], abs=2e-6)
    if kind is not Geneva:  # whose guard rests on zero in its dwell
        assert not np.any(found.flags)


def test_a_direction_that_vanishes_holds_nothing():
    """A resting contact changes no acceleration where its direction is 0, and all of it elsewhere."""
    of, one = group([[np.nan]]), jnp.ones(())
    for n, truth in ((0.0, 1.5), (2.0, 0.0)):
        rest = (jnp.asarray(True),)
        found = of.motion(Mass([2.0 * one]), [3.0 * one], [[n * one]], rest, [0.0])
        assert float(found.acceleration[0]) == truth
        assert float(found.force[0]) == (-1.5 if n else 0.0)


def test_a_direction_near_zero_is_no_measure_of_the_others():
    """Its force over its lever is beyond all others; beside that their own excess would be rounding."""
    of, one = group([[np.nan, np.nan], [0.0, 1.0]]), jnp.ones(())
    limits = Bounds(None, (0.3 * one, 0.3 * one))
    J, gamma = [[1e-13 * one, 0.0 * one], [0.0, 1.0]], [0.0, 0.0]
    states, ended = states_by_law(of, Mass([one, one]), (one, 0.5 * one), gamma, limits, limits, J)
    assert bool(ended)
    assert [float(s) for s in states] == [1.0, 1.0]
