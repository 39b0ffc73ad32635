"""States of first order beside the coordinates: a winding, a filter, temperatures; truth from SciPy."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import scipy.optimize

import stickslip as ss
from stickslip.derived import WithIntegrals
from stickslip.friction import Coulomb, LuGre
from stickslip.mechanism import AbstractMechanism, Contact, DeclarationError, Stop


class Winch(AbstractMechanism):
    """A motor with inductance pulls a block on rough ground against a spring."""

    U: Any
    mass: Any = 1.0
    stiffness: Any = 2.0
    L: Any = 0.5
    R: Any = 0.4
    k: Any = 1.5
    law: Any = Coulomb(1.0, 0.6)
    coordinates: ClassVar = {"x": "m"}
    first_order: ClassVar = {"current": "A"}
    contact_directions: ClassVar = {"ground": {"x": 1.0}}

    def mass_matrix(self, q):
        return self.mass

    def forces(self, t, q, v, args):
        return {"x": self.k * q.current - self.stiffness * q.x}

    def rates(self, t, q, v, args):
        return {"current": (self.U - self.R * q.current - self.k * v.x) / self.L}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(self.law)}

    def potential_energy(self, q):
        return 0.5 * self.stiffness * q.x**2 + 0.5 * self.L * q.current**2


class Walled(Winch):
    """The same before a wall."""

    wall: Any = 0.5
    restitution: Any = 0.7
    stops: ClassVar = ("wall",)

    def gaps(self, t, q, args):
        return {"wall": Stop(self.wall - q.x, self.restitution)}


def winch_by_exponentials(U, end, k=1.5, wall=None, restitution=0.0, most=60):
    """Times of the events and (x, v, i) at the end: matrix exponentials, roots of their components."""
    m, k_s, L, R, static, kinetic = 1.0, 2.0, 0.5, 0.4, 1.0, 0.6
    t, y, sense, events = 0.0, np.array([0.0, 0.0, 0.0]), 0, []

    def at(dt):
        A = np.array(
            [[0, 1, 0, 0], [-k_s / m, 0, k / m, -sense * kinetic / m], [0, -k / L, -R / L, U / L]]
        )
        if sense == 0:
            A[:2] = 0.0
        return (scipy.linalg.expm(np.vstack([A, np.zeros(4)]) * dt) @ [*y, 1.0])[:3]

    def guard(dt):
        x, v, i = at(dt)
        ways = [static - abs(k * i - k_s * x) if sense == 0 else sense * v]
        return np.array(ways if wall is None else [*ways, wall - x])

    for _ in range(most):
        grid = np.arange(0.0, end - t + 2e-3, 1e-3)
        later = np.array([guard(dt) for dt in grid])
        found = [
            (scipy.optimize.brentq(lambda dt, g=g: guard(dt)[g], grid[i], grid[i + 1], xtol=1e-15), g)
            for g in range(later.shape[1])
            for i in [int(np.argmax((later[1:-1, g] > 0) & (later[2:, g] <= 0))) + 1]
            if later[i, g] > 0 >= later[i + 1, g]
        ]
        dt, which = min(found, default=(np.inf, 0))
        if t + dt >= end:
            return np.array(events), at(end - t)
        y, t = at(dt), t + dt
        events.append(t)
        load = k * y[2] - k_s * y[0]
        if which == 1:
            y = np.array([wall, -restitution * y[1], y[2]])
            sense = int(np.sign(y[1]))
        elif sense == 0 or abs(load) > static:
            sense, y = int(np.sign(load)), np.array([y[0], 0.0, y[2]])
        else:
            sense, y = 0, np.array([y[0], 0.0, y[2]])
    raise AssertionError("too many events")


@pytest.mark.more
@pytest.mark.parametrize(("U", "k"), [(4.5, 1.5), (6.0, 0.3)])
def test_a_motor_that_pulls_a_block_is_the_matrix_exponential(U, k):
    winch = Winch(U, k=k)
    run = ss.simulate(winch, 0.0, 12.0, winch.state())
    events, end = winch_by_exponentials(U, 12.0, k)
    assert len(events) == int(run.num_events) >= (1 if k > 1.0 else 3)
    np.testing.assert_allclose(run.events.t[: len(events)], events, rtol=0, atol=1e-9)
    np.testing.assert_allclose([run.y1.x, run.y1.v_x, run.y1.current], end, rtol=0, atol=1e-9)


@pytest.mark.more
def test_an_impact_leaves_the_current_as_it_is():
    winch = Walled(2.0)
    run = ss.simulate(winch, 0.0, 2.1, winch.state())
    events, end = winch_by_exponentials(2.0, 2.1, wall=0.5, restitution=0.7)
    assert len(events) == int(run.num_events) >= 3
    np.testing.assert_allclose(run.events.t[: len(events)], events, rtol=0, atol=1e-9)
    np.testing.assert_allclose([run.y1.x, run.y1.v_x, run.y1.current], end, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(run.events.y_after.current, run.events.y_before.current)


@pytest.mark.more
def test_every_joule_of_the_winding_is_accounted_for():
    winch = Winch(4.5)
    powers = Winch.powers
    names = winch.powers(0.0, winch.state(), 1, None)
    ledger = WithIntegrals(winch, powers, units=dict.fromkeys(names, "J"))
    end = ss.simulate(ledger, 0.0, 12.0, ledger.start(winch.state())).y1
    assert abs(sum(end.integrals.values()) - winch.energy(end.y)) < 1e-9
    # What is declared takes the power of the supply less that of the resistance.
    y = winch.state(x=0.2, v_x=0.3, current=0.7)
    found = winch.powers(0.0, y, 2, None)["forces"]
    assert float(found) == pytest.approx(4.5 * 0.7 - 0.4 * 0.7**2, abs=1e-14)


@pytest.mark.slow
def test_slopes_are_those_of_differences_and_lanes_those_of_single_runs():
    def end(U):
        winch = Winch(U)
        return ss.simulate(winch, 0.0, 12.0, winch.state()).y1.current

    U, h = 4.5, 1e-5
    differences = (end(U + h) - end(U - h)) / (2 * h)
    assert jax.grad(end)(U) == pytest.approx(float(differences), rel=1e-6)
    assert jax.jvp(end, (U,), (1.0,))[1] == pytest.approx(float(differences), rel=1e-6)
    lanes = jax.vmap(end)(jnp.array([2.0, 4.5]))
    np.testing.assert_allclose(lanes, [end(2.0), end(4.5)], rtol=0, atol=1e-9)


@pytest.mark.more
def test_both_smooth_forms_tend_to_the_event_driven_one():
    winch = Winch(4.5, law=Coulomb(0.6, 0.6))
    exact = ss.simulate(winch, 0.0, 4.0, winch.state()).y1

    def off(form, start):
        y = ss.simulate(form, 0.0, 4.0, start).y1
        y = getattr(y, "y", y)
        return max(abs(float(a - b)) for a, b in zip(y, exact, strict=True))

    rounded = [off(winch.regularised(v), winch.state()) for v in (1e-1, 1e-2)]
    assert rounded[1] < 0.2 * rounded[0] < 0.05
    forms = [winch.bristles(LuGre, sigma_0=s, sigma_1=2 * s**0.5) for s in (1e2, 1e3)]
    elastic = [off(form, form.start(winch.state())) for form in forms]
    assert elastic[1] < 0.2 * elastic[0] < 0.02


class Filtered(AbstractMechanism):
    """A block on a belt whose speed follows a command late; friction heats and weakens it."""

    law: Any = Coulomb(1.0, 0.8)
    coordinates: ClassVar = {"x": "m"}
    first_order: ClassVar = {"belt": "m/s", "heat": "K"}
    contact_directions: ClassVar = {"belt": {"x": 1.0}}

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {"x": -q.x - 0.1 * v.x}

    def rates(self, t, q, v, args):
        warm = jnp.square(v.x - q.belt) - 0.3 * q.heat
        return {"heat": warm, "belt": 3.0 * (2.5 * jnp.sin(1.3 * t) - q.belt)}

    def contacts(self, t, q, v, args):
        return {"belt": Contact(self.law, 1.0 / (1.0 + 0.5 * q.heat), q.belt)}

    def time_scale(self, args):
        return 1.0 / 1.3


def filtered_by_scipy(end):
    """Times of the events and (x, v, belt, heat): `solve_ivp` from event to event, sticking."""
    t, y, sense, times = 0.0, np.zeros(4), 0, []

    def load(t, y):
        return -y[0] - 0.1 * y[1] - 3.0 * (2.5 * np.sin(1.3 * t) - y[2])  # less what the belt needs

    def field(t, y):
        x, v, w, heat = y
        drive = 3.0 * (2.5 * np.sin(1.3 * t) - w)
        slip = -x - 0.1 * v - sense * 0.8 / (1 + 0.5 * heat)
        return [v, drive if sense == 0 else slip, drive, (v - w) ** 2 - 0.3 * heat]

    def reached(t, y):
        if sense == 0:
            return 1.0 / (1 + 0.5 * y[3]) - abs(load(t, y))
        return sense * (y[1] - y[2]) if t > begin + 1e-7 else 1.0

    reached.terminal, reached.direction = True, -1
    for _ in range(40):
        begin = t
        run = scipy.integrate.solve_ivp(
            field, (t, end), y, method="DOP853", rtol=1e-12, atol=1e-13, events=reached, max_step=0.05
        )
        t, y = run.t[-1], run.y[:, -1].copy()
        if run.status != 1:
            return np.array(times), y
        times.append(t)
        over = abs(load(t, y)) > 1.0 / (1 + 0.5 * y[3]) or sense == 0
        sense = int(np.sign(load(t, y))) if over else 0
        y[1] = y[2]
    raise AssertionError("too many events")


@pytest.mark.more
def test_a_belt_behind_a_filter_and_a_warm_contact_are_scipys():
    machine = Filtered()
    run = ss.simulate(machine, 0.0, 15.0, machine.state())
    times, end = filtered_by_scipy(15.0)
    assert len(times) == int(run.num_events) >= 5
    np.testing.assert_allclose(run.events.t[: len(times)], times, rtol=0, atol=1e-8)
    found = [run.y1.x, run.y1.v_x, run.y1.belt, run.y1.heat]
    np.testing.assert_allclose(found, end, rtol=0, atol=1e-8)


class Rod(AbstractMechanism):
    """A block on ground whose normal force falls as a rod above it cools: an array of temperatures."""

    law: Any = Coulomb(1.0, 0.8)
    coordinates: ClassVar = {"x": "m"}
    first_order: ClassVar = {"rod": "K"}
    contact_directions: ClassVar = {"ground": {"x": 1.0}}

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {"x": 1.0}

    def rates(self, t, q, v, args):
        return {"rod": jnp.array([[-2.0, 1.0, 0.0], [1.0, -2.0, 1.0], [0.0, 1.0, -2.0]]) @ q.rod}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(self.law, 1.0 + q.rod[1])}


def test_a_state_may_be_an_array():
    """The normal force 1 + T_2 holds the block until the middle has cooled enough."""
    start = np.array([1.0, 3.0, -0.5])
    A = np.array([[-2.0, 1.0, 0.0], [1.0, -2.0, 1.0], [0.0, 1.0, -2.0]])
    machine = Rod(Coulomb(0.9, 0.8))
    run = ss.simulate(machine, 0.0, 10.0, machine.state(rod=start))
    np.testing.assert_allclose(run.y1.rod, scipy.linalg.expm(10.0 * A) @ start, rtol=0, atol=1e-9)
    begin = scipy.optimize.brentq(
        lambda t: 0.9 * (1.0 + (scipy.linalg.expm(t * A) @ start)[1]) - 1.0, 0.0, 10.0, xtol=1e-14
    )
    assert int(run.num_events) == 1
    assert float(run.events.t[0]) == pytest.approx(begin, abs=1e-9)


class Clamp(AbstractMechanism):
    """A magnet whose current rises presses a block on the ground."""

    coordinates: ClassVar = {"x": "m"}
    first_order: ClassVar = {"current": "A"}
    contact_directions: ClassVar = {"ground": {"x": 1.0}}
    opening: ClassVar = ("ground",)

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {"x": 1.0}

    def rates(self, t, q, v, args):
        return {"current": 1.0 - q.current}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(Coulomb(5.0, 2.0), q.current)}


def test_a_contact_closes_as_the_current_begins_to_rise():
    machine = Clamp()
    rising, off = machine.state(v_x=1.0), machine.state(v_x=1.0, current=1.0)
    mode = machine.mode_names[int(machine.initial_mode(0.0, rising, None))]
    assert mode == "slip forward"
    falling = machine.state(v_x=1.0, current=-1.0)
    assert machine.mode_names[int(machine.initial_mode(0.0, falling, None))] == "open"
    assert machine.mode_names[int(machine.initial_mode(0.0, off, None))] == "slip forward"


def broken(kind=Winch, **changes):
    return type("Broken", (kind,), changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"first_order": ("current",)}, "first_order = .*: it must be a mapping"),
        ({"first_order": {"x": "A"}}, "first_order = 'x': it must be a name that no coordinate"),
        ({"first_order": {"v_x": "A"}}, "first_order = 'v_x': it must be a name that no coordinate"),
        ({"first_order": {"a b": "A"}}, "first_order = 'a b'"),
        ({"first_order": {"current": 3}}, r"first_order\['current'\] = 3"),
        ({"rates": AbstractMechanism.rates}, r"first_order = \('current',\).*`rates`"),
    ],
)
def test_wrong_names_are_refused_as_the_machine_is_made(changes, message):
    with pytest.raises((TypeError, ValueError), match=message):
        broken(**changes)(2.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "'current' too"),
        ({"current": 1.0, "voltage": 2.0}, "keys out of 'current'"),
        ((1.0,), "a mapping with a rate for each of 'current'"),
        ({"current": "fast"}, r"rates\(...\)\['current'\] = 'fast'"),
        ({"current": np.zeros(3)}, r"shape of rates\(...\)\['current'\]"),
    ],
)
def test_wrong_rates_are_refused_before_anything_compiles(given, message):
    machine = broken(rates=lambda self, t, q, v, args: given)(2.0)
    forms = [machine, machine.regularised(1e-2)]
    for form in forms:
        with pytest.raises((TypeError, ValueError), match=message):
            ss.simulate(form, 0.0, 1.0, machine.state())


def test_a_gap_that_a_current_moves_is_refused():
    kind = broken(Walled, gaps=lambda self, t, q, args: {"wall": Stop(0.5 - q.x - q.current, 0.5)})
    machine = kind(2.0)
    with pytest.raises(DeclarationError, match="the gap of stop 'wall'"):
        ss.simulate(machine, 0.0, 1.0, machine.state())


def test_a_state_without_the_current_is_refused():
    winch = Winch(2.0)
    with pytest.raises((TypeError, ValueError), match="current"):
        ss.simulate(winch, 0.0, 1.0, {"x": 0.0, "v_x": 0.0})
    with pytest.raises(TypeError, match=r"no component 'voltage'.*current"):
        winch.state(voltage=1.0)
