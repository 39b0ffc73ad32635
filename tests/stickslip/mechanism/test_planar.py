"""Friction in a plane: closed forms, SciPy away from rest, Moreau's time stepping, symmetry."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.derived import WithIntegrals
from stickslip.friction import Coulomb, Stribeck, Sum, ViscousDamping
from stickslip.mechanism import AbstractMechanism, Contact
from tests.stickslip.mechanism._planar import (
    G,
    Puck,
    Pulled,
    Swayed,
    Turntable,
    by_scipy,
    moreau,
    slide_to_rest,
)

MU = 0.3


def array(y):
    return np.array(jax.tree.leaves(y))


def log(machine, run):
    count = int(run.num_events)
    return [machine.mode_names[int(m)] for m in run.events.mode_after[:count]], run.events.t[:count]


@pytest.mark.more
def test_a_puck_goes_straight_and_stops():
    """|v|^2 / (2 mu g) along its velocity, in |v| / (mu g)."""
    puck = Puck(Coulomb(MU))
    run = ss.simulate(puck, 0.0, 4.0, puck.state(v_x=3.0, v_y=4.0))
    names, times = log(puck, run)
    assert names == ["slip forward / stick", "stick / stick"]
    np.testing.assert_allclose(array(run.y1)[:2], [2.548419979612640, 3.397893306150187], rtol=1e-13)
    np.testing.assert_allclose(times[-1], 5.0 / (MU * G), rtol=1e-12)
    assert array(run.y1)[2:].tolist() == [0.0, 0.0]
    assert not run.flags


@pytest.mark.parametrize(
    ("start", "load"),
    [
        ((3.0, 4.0), (1.0, 0.0)), ((-0.6, -0.8), (1.0, -0.4)), ((3.0, 4.0), (0.0, 2.5)),
        ((-3.0, 1e-4), (2.9, 0.1)), ((1e-9, -2.0), (-0.5, 2.0)),
    ],
)  # fmt: skip
def test_a_slide_on_an_incline_ends_on_a_curve(start, load):
    """Its direction settles by a power of the time left; the invariants of the slide give its end."""
    puck = Puck(Coulomb(MU), *load)
    run = ss.simulate(puck, 0.0, 12.0, puck.state(v_x=start[0], v_y=start[1]))
    time, way = slide_to_rest(start, load, MU * G)
    np.testing.assert_allclose(array(run.y1), [*way, 0.0, 0.0], atol=3e-10)
    np.testing.assert_allclose(log(puck, run)[1][-1], time, atol=1e-10)


@pytest.mark.parametrize("beside", [0.0, 1e-9, 1e-6, 1e-2])
def test_a_load_beyond_the_disc_turns_it_back(beside):
    """Up an incline too steep to rest on, and down again; straight through zero or past it."""
    load = np.array([-2.1, -2.8])
    puck = Puck(Coulomb(MU), *load)
    start = np.array([3.0 - 0.8 * beside, 4.0 + 0.6 * beside])
    run = ss.simulate(puck, 0.0, 2.0, puck.state(v_x=start[0], v_y=start[1]))
    if beside < 1e-7:
        assert log(puck, run)[0] == ["slip forward / stick", "slip forward / slip forward"]
    if beside < 1e-3:
        up, down, e = 3.5 + MU * G, 3.5 - MU * G, np.array([0.6, 0.8])
        back = 2.0 - 5.0 / up
        way, speed = 12.5 / up - 0.5 * down * back**2, -down * back
        exact = [*(way * e), *(speed * e)]
    else:
        exact = _scipy(lambda t, q: load, lambda t, q: 0.0, lambda s: MU * G, [0.0, 0.0, *start], 2.0)
    np.testing.assert_allclose(array(run.y1), exact, atol=1e-9 + 3.0 * beside * (beside < 1e-3))


def _scipy(force, surface, limit, y0, t1, t0=0.0):
    """A puck of 1 kg that does not come to rest."""

    def field(t, y):
        u = y[2:] - surface(t, y[:2])
        s = np.hypot(*u)
        friction = limit(t, s) if limit.__code__.co_argcount == 2 else limit(s)
        return [*y[2:], *(force(t, y[:2]) - friction * u / s)]

    return solve_ivp(field, (t0, t1), y0, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]


@pytest.mark.more
@pytest.mark.parametrize(
    ("law", "mu"),
    [
        (Stribeck(0.4, 0.25, 0.3), lambda s: 0.25 + 0.15 * np.exp(-((s / 0.3) ** 2))),
        (Coulomb(MU), lambda s: MU),
    ],
)  # fmt: skip
def test_pushed_sideways_while_it_slides(law, mu):
    puck = Swayed(law, 0.5, 0.2)
    run = ss.simulate(puck, 0.0, 0.8, puck.state(v_x=2.0, v_y=1.0))
    exact = _scipy(
        lambda t, q: np.array([0.5 - 3.0 * q[0], 0.2 + 1.5 * np.sin(2.0 * t)]), lambda t, q: 0.0,
        lambda t, s: mu(s) * G * (1.0 + 0.3 * np.cos(3.0 * t)), [0.0, 0.0, 2.0, 1.0], 0.8,
    )  # fmt: skip
    assert np.hypot(*exact[2:]) > 0.05
    np.testing.assert_allclose(array(run.y1), exact, atol=1e-9)


@pytest.mark.more
def test_it_slides_on_a_turntable():
    table = Turntable(Coulomb(MU))
    run = ss.simulate(table, 0.0, 1.2, table.state(x=0.5))
    surface = lambda t, q: 3.0 * np.array([-q[1], q[0]])  # noqa: E731
    exact = _scipy(lambda t, q: np.zeros(2), surface, lambda s: MU * G, [0.5, 0.0, 0.0, 0.0], 1.2)
    np.testing.assert_allclose(array(run.y1), exact, atol=1e-10)


@pytest.mark.more
def test_it_rides_on_a_turntable():
    table = Turntable(Coulomb(MU))
    run = ss.simulate(table, 0.0, 20.0, table.state(x=0.2, v_y=0.6))
    c, s = np.cos(60.0), np.sin(60.0)
    assert not int(run.num_events)
    np.testing.assert_allclose(array(run.y1), [0.2 * c, 0.2 * s, -0.6 * s, 0.6 * c], atol=1e-11)


@pytest.mark.more
@pytest.mark.parametrize("static", [0.3, 0.4])
def test_a_turntable_that_gathers_speed_loses_it(static):
    """Where the load r sqrt(w^4 + rate^2), which turns with the table, is beyond the static disc."""
    table = Turntable(Coulomb(static, MU), turn=0.5, rate=0.3)
    run = ss.simulate(table, 0.0, 11.0, table.state(x=0.3, v_y=0.15))
    w = ((static * G / 0.3) ** 2 - 0.3**2) ** 0.25
    names, times = log(table, run)
    assert names == ["slip forward / slip forward"]
    np.testing.assert_allclose(times, [(w - 0.5) / 0.3], rtol=1e-9)
    angle = 0.5 * times[0] + 0.15 * times[0] ** 2
    place = 0.3 * np.array([np.cos(angle), np.sin(angle)])
    begun = jax.tree.map(lambda x: x[0], run.events.y_after)
    np.testing.assert_allclose(array(begun)[:2], place, atol=1e-9)
    soon = ss.simulate(table, float(times[0]), float(times[0]) + 2e-3, begun, mode0=names[0])
    v = w * np.array([-place[1], place[0]])
    u = array(soon.y1)[2:] - (w + 6e-4) * np.array([-array(soon.y1)[1], array(soon.y1)[0]])
    load = w * w * place - 0.3 * np.array([-place[1], place[0]])
    # It gives way along its load: outwards, and behind the table that gathers speed.
    assert u @ load > 0.999 * np.hypot(*u) * np.hypot(*load), v


@pytest.mark.more
@pytest.mark.parametrize("law", [Coulomb(0.4, 0.3), Coulomb(MU), Stribeck(0.3, 0.2, 0.1)])
def test_along_one_line_it_is_a_contact_of_one_line(law):
    """Stops, sticks, gives way and turns back, 12 times and more, in a direction of its own."""

    class Plane(Puck):
        def forces(self, t, q, v, args):
            f = 5.0 * jnp.sin(2.0 * t)
            return {"x": 0.6 * f - 3.0 * q.x, "y": 0.8 * f - 3.0 * q.y}

        def time_scale(self, args):
            return 0.5

    class Line(AbstractMechanism):
        law: object
        coordinates = {"x": "m"}  # noqa: RUF012
        contact_directions = {"along": {"x": 1.0}}  # noqa: RUF012

        def mass_matrix(self, q):
            return {"x": 1.0}

        def forces(self, t, q, v, args):
            return {"x": 5.0 * jnp.sin(2.0 * t) - 3.0 * q.x}

        def contacts(self, t, q, v, args):
            return {"along": Contact(self.law, G)}

    plane, line = Plane(law), Line(law)
    wide = ss.simulate(plane, 0.0, 20.0, plane.state(v_x=0.6, v_y=0.8))
    narrow = ss.simulate(line, 0.0, 20.0, line.state(v_x=1.0))
    names, times = log(plane, wide)
    kept = np.array(names) != "slip forward / stick"
    assert int(narrow.num_events) > 10
    np.testing.assert_allclose(times[kept], narrow.events.t[: int(narrow.num_events)], atol=2e-9)
    x, v = narrow.y1.x, narrow.y1.v_x
    np.testing.assert_allclose(array(wide.y1), [0.6 * x, 0.8 * x, 0.6 * v, 0.8 * v], atol=3e-9)


def test_a_puck_is_carried_along_by_a_belt():
    """In the frame of the belt it slides to rest."""
    puck = Puck(Coulomb(MU), 0.4, -0.3, -1.2, 0.5)
    run = ss.simulate(puck, 0.0, 3.0, puck.state(v_x=0.3, v_y=-1.0))
    time, way = slide_to_rest((1.5, -1.5), (0.4, -0.3), MU * G)
    np.testing.assert_allclose(array(run.y1), [-3.6 + way[0], 1.5 + way[1], -1.2, 0.5], atol=1e-10)
    np.testing.assert_allclose(log(puck, run)[1][-1], time, atol=1e-10)


@pytest.mark.parametrize("angle", [0.3, 1.9, 4.0])
def test_no_direction_is_special(angle):
    """Start, load and belt turned: the whole motion turns, to rounding."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])

    def run(by):
        load, belt, v = by @ [0.7, -1.9], by @ [0.2, 0.4], by @ [2.0, 1.0]
        puck = Puck(Coulomb(0.35, MU), *load, *belt)
        found = ss.simulate(puck, 0.0, 3.0, puck.state(v_x=v[0], v_y=v[1]))
        return array(found.y1).reshape(2, 2), log(puck, found)

    straight, (names, times) = run(np.eye(2))
    turned, (others, when) = run(turn)
    assert names == others == ["slip forward / stick", "stick / stick"]
    np.testing.assert_allclose(turned, straight @ turn.T, atol=1e-10)
    np.testing.assert_allclose(when, times, atol=1e-10)


@pytest.mark.parametrize("angle", np.linspace(0.0, 2.0 * np.pi, 7))
def test_it_holds_within_the_disc_and_gives_way_beyond(angle):
    """No creep at 0.999999 of it in any direction; beyond it the puck goes where it is pushed."""
    way = np.array([np.cos(angle), np.sin(angle)])
    for share in (0.999999, 1.000001):
        puck = Puck(Coulomb(0.4, MU), *(share * 0.4 * G * way))
        run = ss.simulate(puck, 0.0, 1.0, puck.state())
        gone = 0.5 * (share * 0.4 - MU) * G if share > 1.0 else 0.0
        np.testing.assert_allclose(array(run.y1)[:2], gone * way, atol=1e-12)


@pytest.mark.more
def test_two_pucks_and_a_spring_against_time_stepping():
    law = Coulomb(MU)
    pucks = Pulled(law)
    run = ss.simulate(pucks, 0.0, 8.0, pucks.state())

    def force(t, q):
        spring, pull = 10.0 * (q[1] - q[0]), 4.0 * (np.array([0.5, 0.2]) * t - q[0])
        return np.array([spring + pull, -spring])

    def stepped(steps):
        none = np.zeros((2, 2))
        limits = MU * G * np.array([1.0, 0.7])
        return moreau([1.0, 0.7], lambda t: limits, force, lambda t, q: none, none, none, 8.0, steps)

    names = {name for name in log(pucks, run)[0]}
    assert len(names) >= 3
    exact = array(run.y1)
    errors = [np.abs(stepped(n) - exact).max() for n in (4000, 32000)]
    assert errors[1] < 1e-3
    assert errors[0] > 3.0 * errors[1]


LANES = 64


@pytest.mark.more
def test_random_pucks_against_time_stepping():
    """Static friction is kinetic here, as in time stepping; none of them is silently wrong."""
    rng = np.random.default_rng(5)
    start, load, belt = (rng.normal(size=(LANES, 2)) * x for x in (2.0, 1.2, 0.7))
    swing = rng.uniform(0.0, 3.0, LANES)

    def end(load, belt, start, swing):
        puck = Swayed(Coulomb(MU), *load, *belt, swing=swing)
        run = ss.simulate(
            puck, 0.0, 4.0, puck.state()._replace(v_x=start[0], v_y=start[1]), throw=False
        )
        return jnp.stack(jax.tree.leaves(run.y1)), run.result == ss.RESULTS.successful

    exact, fine = jax.jit(jax.vmap(end))(load, belt, start, swing)
    assert np.all(fine)

    def force(t, q):
        return np.stack([load[:, 0] - 3.0 * q[:, 0], load[:, 1] + swing * np.sin(2.0 * t)], 1)

    steps = 8000
    found = moreau(
        np.ones(LANES), lambda t: np.full(LANES, MU * G * (1.0 + 0.3 * np.cos(3.0 * t))), force,
        lambda t, q: belt, np.zeros((LANES, 2)), start, 4.0, steps,
    )  # fmt: skip
    found = np.concatenate(found.reshape(2, LANES, 2), axis=1)
    np.testing.assert_allclose(exact, found, atol=3e-3)


@pytest.mark.more
def test_random_pucks_against_events_of_scipy():
    """Static friction above kinetic, forces that swing: to what the reference takes for rest."""
    lanes, rng = 40, np.random.default_rng(11)
    start, load, belt = (rng.normal(size=(lanes, 2)) * x for x in (2.0, 1.2, 0.7))
    swing, static = rng.uniform(0.0, 4.0, lanes), rng.uniform(0.2, 0.5, lanes)
    kinetic = static * rng.uniform(0.6, 1.0, lanes)

    def end(load, belt, start, swing, static, kinetic):
        puck = Swayed(Coulomb(static, kinetic), *load, *belt, swing=swing)
        y0 = puck.state()._replace(v_x=start[0], v_y=start[1])
        run = ss.simulate(puck, 0.0, 6.0, y0, throw=False)
        return jnp.stack(jax.tree.leaves(run.y1)), run.num_events

    exact, events = jax.jit(jax.vmap(end))(load, belt, start, swing, static, kinetic)
    assert np.mean(np.asarray(events) > 2) > 0.4
    for i in range(lanes):
        found = by_scipy(
            lambda t, q, i=i: load[i] - [3.0 * q[0], -swing[i] * np.sin(2.0 * t)],
            lambda t: G * (1.0 + 0.3 * np.cos(3.0 * t)), belt[i], static[i], kinetic[i], start[i], 6.0,
        )  # fmt: skip
        np.testing.assert_allclose(exact[i], found, atol=1e-6, err_msg=f"lane {i}")


@pytest.mark.more
def test_the_account_of_energy_closes():
    """Losses by friction and the work of the belt are those that the motion takes."""
    puck = Puck(Coulomb(0.35, MU), 0.7, -1.9, 0.2, 0.4)
    account = WithIntegrals(puck, Puck.powers)
    run = ss.simulate(account, 0.0, 3.0, account.start(puck.state(v_x=2.0, v_y=1.0)))
    state, work = run.y1
    count = int(run.num_events)
    after, before = (
        jax.vmap(puck.energy)(y.y)[:count] for y in (run.events.y_after, run.events.y_before)
    )
    # On a belt the straight end of a slide has another velocity, by the speed of rest at most.
    jumps = np.asarray(after - before)
    assert np.abs(jumps).max() < 1e-6
    np.testing.assert_allclose(puck.energy(state) - 2.5, sum(work.values()) + jumps.sum(), atol=1e-9)
    assert work["friction of along"] < 0.0
    assert work["friction of across"] < 0.0
    assert work["drive of across"] != 0.0


@pytest.mark.more
def test_drag_is_against_the_velocity():
    """A straight slide under mu g + c v stops at m/c (v - (mu g/c) ln(1 + c v/(mu g)))."""
    c, v = 0.8, 5.0
    puck = Puck(Sum(Coulomb(MU), ViscousDamping(c)))
    run = ss.simulate(puck, 0.0, 4.0, puck.state(v_x=3.0, v_y=4.0))
    time = np.log(1.0 + c * v / (MU * G)) / c
    way = (v - MU * G * time) / c
    np.testing.assert_allclose(array(run.y1)[:2], [0.6 * way, 0.8 * way], atol=1e-9)
    np.testing.assert_allclose(log(puck, run)[1][-1], time, atol=1e-9)
