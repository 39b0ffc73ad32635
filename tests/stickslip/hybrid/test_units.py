"""No newton, second or metre is special: the same motion in any units has the same events."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.hybrid import event_functions
from stickslip.mechanism import AbstractMechanism, Contact, Stop
from stickslip.systems import Motion

LARGE = (1e-12, 1e12)
UNITS = np.array(
    [(1.0, 1.0, 1.0), *((a, 1.0, 1.0) for a in LARGE), *((1.0, a, 1.0) for a in LARGE),
     *((1.0, 1.0, a) for a in LARGE)]
)  # fmt: skip


class Press(AbstractMechanism):
    """A block under a load and a normal force that depend on the time; it lifts off for a while."""

    mass: Any
    stiffness: Any
    load: Any
    omega: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"floor": {"x": 1.0}}
    opening: ClassVar = ("floor",)

    def time_scale(self, args):
        return 1.0 / self.omega

    def mass_matrix(self, q):
        return {"x": self.mass}

    def forces(self, t, q, v, args):
        return {"x": self.load * jnp.sin(self.omega * t) - self.stiffness * q.x}

    def contacts(self, t, q, v, args):
        press = self.load * (0.8 + jnp.cos(0.37 * self.omega * t))
        return {"floor": Contact(Coulomb(0.5, 0.3), press)}


def press(length, force, time):
    machine = Press(force * time**2 / length, 0.1 * force / length, force, 1.0 / time)
    return machine, 20.0 * time, machine.state()


class Between(AbstractMechanism):
    """A mass on a spring and rough ground, thrown against a stop."""

    mass: Any
    stiffness: Any
    force: Any
    gap: Any
    slow: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1.0}}
    stops: ClassVar = ("wall",)

    def mass_matrix(self, q):
        return {"x": self.mass}

    def forces(self, t, q, v, args):
        return {"x": -self.stiffness * q.x}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(Coulomb(0.1, 0.07), self.force)}

    def gaps(self, t, q, args):
        return {"wall": Stop(self.gap - q.x, restitution=0.7, rest_speed=self.slow)}


def between(length, force, time):
    one = length, 1e-6 * length / time
    machine = Between(force * time**2 / length, force / length, force, *one)
    return machine, 20.0 * time, machine.state(x=-2.0 * length, v_x=0.0)


class Row(AbstractMechanism):
    """Three blocks in a row, of which a belt pulls the last."""

    mass: Any
    stiffness: Any
    force: Any
    speed: Any
    coordinates: ClassVar = {"x": "m", "y": "m", "z": "m"}
    contact_directions: ClassVar = {"one": {"x": 1.0}, "two": {"y": 1.0}, "belt": {"z": 1.0}}

    def mass_matrix(self, q):
        return {"x": self.mass, "y": self.mass, "z": self.mass}

    def forces(self, t, q, v, args):
        left, right = self.stiffness * (q.y - q.x), self.stiffness * (q.z - q.y)
        return {"x": left, "y": right - left, "z": -right}

    def contacts(self, t, q, v, args):
        return {
            "one": Contact(Coulomb(0.3, 0.2), self.force),
            "two": Contact(Coulomb(0.4, 0.3), self.force),
            "belt": Contact(Coulomb(1.0, 0.7), self.force, self.speed),
        }


def in_a_row(length, force, time):
    machine = Row(force * time**2 / length, force / length, force, 0.3 * length / time)
    return machine, 20.0 * time, machine.state()


def found(make, units, **options):
    def run(length, force, time):
        machine, end, start = make(length, force, time)
        done = ss.simulate(
            machine, 0.0, end, start, saveat=ss.SaveAt(max_events=64), throw=False, **options
        )
        return done.y1.x / length, done.y1.v_x * time / length, done.events.t / time, done.num_events, (
            done.flags, done.successful
        )  # fmt: skip

    return jax.jit(jax.vmap(run))(*jnp.asarray(units.T))


def same(make, **options):
    x, v, times, events, (flags, good) = map_to_numpy(found(make, UNITS, **options))
    assert np.all(good)
    assert events[0] > 2
    np.testing.assert_array_equal(events, events[0])
    np.testing.assert_array_equal(flags, 0)
    for row in (x[:, None], v[:, None], times[:, : events[0]]):
        np.testing.assert_allclose(row - row[0], 0.0, atol=1e-9)


def map_to_numpy(tree):
    return jax.tree.map(np.asarray, tree)


@pytest.mark.more
def test_loads_of_the_time_alone_are_the_same_in_all_units():
    same(press)


@pytest.mark.slow
@pytest.mark.parametrize("make", [between, in_a_row])
def test_machines_are_the_same_in_all_units(make):
    same(make, integrator=ss.Integrator(step=ss.AdaptiveStep(1e-12)))


class Driven(AbstractMechanism):
    """A stiffening spring that a valve of first order, a number of order 1, drives after a break."""

    mass: Any
    force: Any
    length: Any
    time: Any
    coordinates: ClassVar = {"x": "m"}
    first_order: ClassVar = {"valve": "1"}

    def mass_matrix(self, q):
        return {"x": self.mass}

    def forces(self, t, q, v, args):
        part = q.x / self.length
        push = jnp.where(t >= 2.0 * self.time, 1.0, 0.5)
        return {"x": self.force * (push * q.valve - part - 4.0 * part**3)}

    def rates(self, t, q, v, args):
        # The fastest of all, so that it sets the steps.
        opens = jnp.cos(3.0 * t / self.time) - q.valve - 5.0 * q.valve**3
        return {"valve": 10.0 * opens / self.time}

    def time_scale(self, args):
        return self.time


@pytest.mark.more
@pytest.mark.parametrize("units", [(1e-12, 1.0, 1.0), (1e-3, 1e6, 1e6), (1e12, 1e-12, 1e-3)])
def test_what_has_no_metre_does_not_loosen_what_has(units):
    """A valve of order 1 and the number of the piece were the largest component: a motion of 1e-12 m
    was held to a tolerance 1e6 times too large, and was off by 4e-6 without a word."""

    @jax.jit
    @jax.vmap
    def end(length, force, time):
        machine = Driven(force * time**2 / length, force, length, time)
        broken = ss.WithBreaks(machine, jnp.stack([2.0 * time]))
        start = broken.start(machine.state(x=0.3 * length))
        y = ss.simulate(broken, 0.0, 9.0 * time, start, throw=False).y1.y
        return jnp.stack([y.x / length, y.v_x * time / length, y.valve])

    ends = end(*jnp.asarray([(1.0, 1.0, 1.0), units]).T)
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-11)


class Circuit(AbstractMechanism):
    """A carriage that feels nothing but the rounding of its force, its circuit, and a filter behind."""

    length: Any
    ampere: Any
    coordinates: ClassVar = {"turn": "rad", "x": "m"}
    first_order: ClassVar = {"current": "A", "filtered": "V", "heat": "K"}

    def mass_matrix(self, q):
        return {"turn": 1.0, "x": 1.0}

    def forces(self, t, q, v, args):
        c = self.length * jnp.cos(q.turn)
        return {"turn": -q.turn, "x": 3.0 * c - (1.1 * c + 1.9 * c)}

    def rates(self, t, q, v, args):
        driven, volts = -0.5 * v.x * self.ampere / self.length, q.current / self.ampere
        return {
            "current": (driven - q.current) / 0.1, "filtered": (volts - q.filtered) / 0.1,
            "heat": q.filtered,
        }  # fmt: skip


@pytest.mark.more
def test_what_follows_nothing_but_rounding_costs_no_steps():
    """Measured by themselves alone the speed of `x`, its current or its filter ended the run."""

    @jax.jit
    @jax.vmap
    def run(length, ampere):
        machine = Circuit(length, ampere)
        found = ss.simulate(machine, 0.0, 3.0, machine.state(turn=1.0), throw=False)
        return found.successful, found.stats.num_attempts, found.y1.turn

    units = jnp.asarray([(1.0, 1.0), (1e-12, 1.0), (1.0, 1e-12), (1e-6, 1e12)])
    good, attempts, turn = run(*units.T)
    assert np.all(good)
    assert np.max(attempts) < 2000
    np.testing.assert_allclose(turn, np.cos(3.0), atol=1e-9)


class Swing(ss.AbstractSmoothSystem):
    """x = size cos t."""

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, -y.x)


def test_short_excursions_through_a_section_are_seen_however_small():
    """`_doubt`: below 1e-12 of its own values a section is zero, and not below 1e-12 m."""
    section = ss.Section(lambda system, t, y, dy, mode, args: y.x + args, "both")

    def crossings(size):
        start = Motion(size, 0.0 * size)
        done = ss.simulate(
            Swing(), 0.0, 7.0, start, args=0.9999 * size, saveat=ss.SaveAt(sections=section)
        )
        return done.crossings[0].count, done.crossings[0].t[:2]

    count, times = map_to_numpy(jax.jit(jax.vmap(crossings))(jnp.asarray([1.0, 1e-14, 1e9])))
    np.testing.assert_array_equal(count, 2)
    np.testing.assert_allclose(
        times, np.pi + np.arccos(0.9999) * np.array([[-1.0, 1.0]] * 3), rtol=1e-7
    )


def parameters(force):
    machine = jax.tree.map(jnp.asarray, Press(1.0, 0.1, force, 1.0))
    return machine, jax.tree.map(jnp.asarray, machine.state())


@pytest.mark.parametrize("force", [1e-12, 1.0, 1e12])
def test_guards_that_depend_on_parameters_alone_have_a_magnitude(force):
    """At the border, where nothing is left of the terms but their rounding."""
    machine, y = parameters(force)
    mode = jnp.asarray(machine.mode_names.index("stick"), jnp.int32)
    border = jnp.arcsin(0.5 * (0.8 + 0.95))
    measured = event_functions.guards_over_magnitudes(machine, border, y, mode, None)
    scales = event_functions.terms_in_parameters(machine, border, y, mode, None)
    assert np.all(np.abs(measured) <= 1.0)
    assert np.max(scales) / force > 1e-4
