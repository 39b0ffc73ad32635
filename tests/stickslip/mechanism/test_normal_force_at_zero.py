"""Normal forces that are exactly 0 until a load jumps at a declared time; surfaces that jump."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.friction import Coulomb, Sum, ViscousDamping
from stickslip.mechanism import AbstractMechanism, Contact, Stop

END = 4.0


class Shop(AbstractMechanism):
    """Bodies of 1 kg: under a pad that opens, one that does not, held at rest; on a belt that jumps."""

    p: Any  # normal force of the pads, their times on, off and on, unit of all forces
    coordinates: ClassVar = {"x": "m", "y": "m", "held": "m", "z": "m"}
    contact_directions: ClassVar = {
        "opens": {"x": 1.0}, "pad": {"y": 1.0}, "brake": {"held": 1.0}, "belt": {"z": 1.0},
    }  # fmt: skip
    opening: ClassVar = ("opens",)

    def mass_matrix(self, q):
        return dict.fromkeys(self.coordinates, self.p[4])

    def forces(self, t, q, v, args):
        # Pushed from 1.2 s to 2.5 s, by less than the brake holds while it is on.
        return {"held": jnp.where((t >= 1.2) & (t < 2.5), 1.0, 0.0) * self.p[4]}

    def contacts(self, t, q, v, args):
        load, first, off, again, unit = self.p
        on = jnp.where((t >= first) & (t < off) | (t >= again), load, 0.0) * unit
        belt = jnp.where(t < 1.0, 0.1, jnp.where(t < 2.0, 0.5, jnp.where(t < 3.0, 0.1, -0.2)))
        law = Coulomb(0.5)
        return [Contact(law, on), Contact(law, on), Contact(law, on), Contact(law, unit, belt)]


def shop(p):
    machine = Shop(p)
    system = ss.WithBreaks(machine, jnp.sort(jnp.stack([*p[1:4], 1.2, 2.5, 3.0 + 0.0 * p[0]])))
    start = system.start(machine.state(v_x=5.0, v_y=5.0, v_z=0.1))
    found = ss.simulate(system, 0.0, END, start, throw=False)
    return found.y1.y, (found.y1.y, found.flags, found.successful)


class Pad(AbstractMechanism):
    """A pad is put on at 1 s; a belt runs away from the body that sticks to it."""

    opening: ClassVar = ("pad",)
    coordinates: ClassVar = {"x": "m", "z": "m"}
    contact_directions: ClassVar = {"pad": {"x": 1.0}, "belt": {"z": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1e-12, "z": 1.0}

    def forces(self, t, q, v, args):
        return {}

    def contacts(self, t, q, v, args):
        pad = Contact(Coulomb(0.5), jnp.where(t >= 1.0, 4e-12, 0.0))
        return [pad, Contact(Coulomb(0.5), 1.0, jnp.where(t >= 1.0, 0.5, 0.1))]


@pytest.mark.more
def test_a_pad_is_put_on_and_a_belt_jumps():
    system = ss.WithBreaks(Pad(), [1.0])
    end = ss.simulate(system, 0.0, 1.5, system.start(Pad().state(v_x=5.0, v_z=0.1)))
    np.testing.assert_allclose(end.y1.y.v_x, 4.0, rtol=1e-12)
    np.testing.assert_allclose(end.y1.y.v_z, 0.35, rtol=1e-12)
    assert int(end.flags) == 0
    assert int(end.num_events) == 1


def check(unit, y, slope, flags, successful):
    """`slope`: by 1 N more, and times later by 1, 2 and 4 s."""
    assert successful
    assert int(flags) == 1  # the brake lets go of a body without a load
    for speed, change in ((y.v_x, slope.v_x), (y.v_y, slope.v_y)):  # 2 m/s^2 while the pad is on
        np.testing.assert_allclose(speed, 5.0 - 2.0 * (1.0 + 1.3), rtol=1e-9)
        np.testing.assert_allclose(change, -0.5 * 2.3 + 2.0 * (1.0 - 2.0 + 4.0), rtol=1e-9)
    # Free from 2 s on: 0.5 m/s at 2.5 s, which the brake takes away from 2.7 s to 2.95 s.
    np.testing.assert_allclose(y.held, 0.125 + 0.1 + 0.0625, rtol=1e-9)
    np.testing.assert_allclose(y.v_held, 0.0, atol=1e-15)
    belt = 0.1 + (0.08 + 0.16) + 0.1 + (0.24 + 0.02) + (-0.03 - 0.08)
    np.testing.assert_allclose(y.z, belt, rtol=1e-9)
    np.testing.assert_allclose(y.v_z, -0.2, rtol=1e-12)


def sloped(unit):
    p, along = jnp.stack([4.0, 1.0, 2.0, 2.7, unit]), jnp.array([1.0, 1.0, 2.0, 4.0, 0.0])
    _, slope, (y, flags, successful) = jax.jvp(shop, (p,), (along,), has_aux=True)
    return y, slope, flags, successful


@pytest.mark.slow
def test_pads_belts_and_brakes_in_units_of_force():
    units = np.array([1e-12, 1.0, 1e12])
    found = jax.jit(jax.vmap(sloped))(units)
    for i, unit in enumerate(units):
        check(unit, *jax.tree.map(lambda x, i=i: x[i], found))


class Clutches(AbstractMechanism):
    """Four wheels in a row with a clutch between neighbours."""

    p: Any  # times at which the three clutches are engaged, and disengaged
    coordinates: ClassVar = {f"a{i}": "rad" for i in range(4)}
    contact_directions: ClassVar = {f"c{i}": {f"a{i}": -1, f"a{i + 1}": 1} for i in range(3)}
    opening: ClassVar = tuple(contact_directions)

    def mass_matrix(self, q):
        return {"a0": 1.0, "a1": 1.5, "a2": 0.7, "a3": 2.0}

    def forces(self, t, q, v, args):
        return {"a0": 3.0, "a1": -0.1 * v.a1, "a2": -0.2 * v.a2, "a3": -0.5 * v.a3}

    def contacts(self, t, q, v, args):
        on = [(t >= self.p[i]) & (t < self.p[3 + i]) for i in range(3)]
        return [Contact(Coulomb(0.6, 0.5), jnp.where(x, 4.0 - 0.5 * i, 0.0)) for i, x in enumerate(on)]


def marched(p, step=2e-4):
    """Moreau's time stepping."""
    m, v, q = np.array([1.0, 1.5, 0.7, 2.0]), np.array([1.0, 0.3, 0.0, -0.2]), np.zeros(4)
    J = np.array([[-1.0, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1]])
    G, rests = J / m @ J.T, np.zeros(3, bool)
    for k in range(round(5.0 / step)):
        t = (k + 0.5) * step
        on = [(t >= p[i]) and (t < p[3 + i]) for i in range(3)]
        most = np.where(rests, 0.6, 0.5) * np.array([4.0, 3.5, 3.0]) * on * step
        free = v + step * (np.array([3.0, 0, 0, 0]) - np.array([0, 0.1, 0.2, 0.5]) * v) / m
        pulse = np.zeros(3)
        for _ in range(200):
            old = pulse.copy()
            for i in range(3):
                u = J[i] @ (free + (J.T @ pulse) / m)
                pulse[i] = np.clip(pulse[i] - u / G[i, i], -most[i], most[i])
            if np.abs(pulse - old).max() < 1e-16:
                break
        new = free + (J.T @ pulse) / m
        rests = np.abs(J @ new) < 1e-12
        q, v = q + step * (v + new) / 2, new
    return q, v


@pytest.mark.slow
def test_three_clutches_engaged_and_disengaged_in_one_instant():
    rows = [(1, 1, 1, 3, 3, 3), (0.5, 1, 1.5, 3, 2.5, 4), (1, 1, 2, 2, 3, 3), (0, 0, 0, 2, 2, 2)]

    @jax.jit
    @jax.vmap
    def run(p):
        machine = Clutches(p)
        system = ss.WithBreaks(machine, [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0])
        start = system.start(machine.state(v_a0=1.0, v_a1=0.3, v_a3=-0.2))
        found = ss.simulate(system, 0.0, 5.0, start, throw=False)
        y = found.y1.y
        return jnp.stack(y[:4]), jnp.stack(y[4:]), found.flags, found.successful

    q, v, flags, successful = run(jnp.asarray(rows, jnp.float64))
    assert np.all(successful)
    assert not np.any(flags)
    for i, p in enumerate(rows):
        places, speeds = marched(p)
        np.testing.assert_allclose(q[i], places, atol=2e-4)
        np.testing.assert_allclose(v[i], speeds, atol=1e-4)


class Skid(AbstractMechanism):
    """An oscillator on a skid that opens and has a drag of its own besides friction."""

    c: Any  # damping of the skid [N s/m]
    parts: Any  # of three normal forces
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"skid": {"x": 1.0}}
    opening: ClassVar = ("skid",)

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": 3.0 * jnp.cos(1.3 * t) - 4.0 * q.x}

    def contacts(self, t, q, v, args):
        loads = jnp.stack(
            [jnp.maximum(jnp.sin(2 * t), 0.0), jnp.sin(2 * t), jnp.maximum(0.3 + q.x, 0.0)]
        )
        return [Contact(Sum(Coulomb(0.0), ViscousDamping(self.c)), self.parts @ loads)]


def test_drag_of_a_contact_ends_where_its_normal_force_is_zero_for_a_while():
    """By time and by the state; it went on, but where a run began so, and in smooth forms always."""

    @jax.jit
    @jax.vmap
    def ends(parts):
        skid = Skid(0.8, parts)
        start = skid.state(x=0.4, v_x=0.3)
        tight = ss.Integrator(step=ss.AdaptiveStep(1e-8))
        exact = ss.simulate(skid, 0.0, 9.0, start, throw=False)
        smooth = ss.simulate(skid.regularised(1e-3), 0.0, 9.0, start, integrator=tight, throw=False)
        return exact.y1.x, smooth.y1.x, exact.num_events

    def load(k, t, x):
        return (np.sin(2 * t) if k < 2 else 0.3 + x) > 0.0

    found = ends(np.eye(3))
    assert np.all(found[2] < 20)
    for k, (exact, smooth) in enumerate(zip(*found[:2], strict=True)):

        def field(t, y, k=k):
            return [y[1], 3.0 * np.cos(1.3 * t) - 4.0 * y[0] - 0.8 * y[1] * load(k, t, y[0])]

        truth = solve_ivp(field, (0.0, 9.0), [0.4, 0.3], rtol=1e-10, atol=1e-12, max_step=0.01).y[0, -1]
        np.testing.assert_allclose(exact, truth, atol=1e-6)
        np.testing.assert_allclose(smooth, truth, atol=1e-5)


@pytest.mark.more
def test_slopes_where_drag_ends_are_those_of_differences():
    @jax.jit
    @jax.vmap
    def exact(c, parts):
        def end(c):
            skid = Skid(c, parts)
            run = ss.simulate(skid, 0.0, 9.0, skid.state(x=0.4, v_x=0.3), throw=False)
            return run.y1.x, (run.flags, run.successful)

        x, slope, rest = jax.jvp(end, (c,), (jnp.ones_like(c),), has_aux=True)
        return x, slope, *rest

    h = 1e-5
    parts = np.repeat(np.eye(3), 3, axis=0)
    x, slope, flags, ok = exact(np.tile(0.8 + h * np.arange(-1, 2), 3), parts)
    assert np.all(ok)
    flags, x = np.reshape(flags, (3, 3)), np.reshape(x, (3, 3))
    assert not np.any(flags[1])  # the others land on what is flat: flagged, and right too
    np.testing.assert_allclose(slope[1::3], (x[:, 2] - x[:, 0]) / (2 * h), atol=1e-7)


def test_a_contact_begins_open_unless_its_normal_force_rises_from_zero():
    class Ramp(AbstractMechanism):
        rate: Any
        coordinates: ClassVar = {"x": "m"}
        contact_directions: ClassVar = {"pad": {"x": 1.0}}
        opening: ClassVar = ("pad",)

        def mass_matrix(self, q):
            return 1.0

        def forces(self, t, q, v, args):
            return 0.0

        def contacts(self, t, q, v, args):
            return {"pad": Contact(Coulomb(0.5), self.rate * t)}

    for rate, name in ((-1.0, "open"), (0.0, "open"), (1.0, "stick")):
        ramp = Ramp(rate)
        assert ramp.mode_names[int(ramp.initial_mode(0.0, ramp.state(), None))] == name


class Pads(AbstractMechanism):
    """A body of 1 kg slides on two pads along one coordinate; their loads n - t end at one instant."""

    loads: Any
    friction: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"a": {"x": 1.0}, "b": {"x": 1.0}}
    opening: ClassVar = ("a", "b")

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {}

    def contacts(self, t, q, v, args):
        return [Contact(Coulomb(mu), n - t) for mu, n in zip(self.friction, self.loads, strict=True)]


@pytest.mark.more
def test_where_two_contacts_open_at_once_derivatives_exist():
    """Friction ends with the load, so it does not matter which of them opens first."""
    end, speed, friction = 3.0, 2.0, jnp.array([0.3, 0.2])

    def run(loads):
        machine = Pads(loads, friction)
        found = ss.simulate(machine, 0.0, end, machine.state(v_x=speed))
        return jnp.stack([found.y1.x, found.y1.v_x]), (found.flags, found.events.t[:2])

    def exact(loads):
        lost, way = friction * loads**2 / 2.0, friction * loads**3 / 3.0
        return jnp.stack([speed * end - jnp.sum(way + (end - loads) * lost), speed - jnp.sum(lost)])

    loads = jnp.array([1.0, 1.0])
    slope, (flags, times) = jax.jacfwd(run, has_aux=True)(loads)
    np.testing.assert_allclose(times, loads, rtol=1e-12)
    np.testing.assert_allclose(slope, jax.jacfwd(exact)(loads), rtol=1e-9)
    assert int(flags) == 0


class Shoe(AbstractMechanism):
    """A shoe that presses a body against a wall, at the instant at which it is about to open."""

    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"shoe": {"x": 1.0}}
    opening: ClassVar = ("shoe",)
    stops: ClassVar = ("wall",)

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {}

    def contacts(self, t, q, v, args):
        return {"shoe": Contact(Coulomb(0.5), normal_force=-4e-16, normal_direction={"x": 1.0})}

    def gaps(self, t, q, args):
        return {"wall": Stop(0.1 - q.x, 0.5)}


def test_a_stop_that_bears_nothing_stays_closed_as_a_contact_opens():
    """What counts as rounding had the sign of the normal force: 0 was more than could be borne."""
    machine = Shoe()
    names = [str(name) for name in machine.mode_names]
    guard = machine.guard_names.index("shoe opens or closes")
    before = jnp.asarray(names.index("stick / closed"))
    _, mode = machine.transition(0.0, machine.state(x=0.1), before, guard, None)
    assert names[int(mode)] == "open / closed"
