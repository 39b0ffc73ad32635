"""Stops with friction and with each other: time stepping, energy, derivatives, random cases."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb, LuGre
from stickslip.mechanism import AbstractMechanism, DeclarationError, Stop
from tests.stickslip.mechanism._machines import flat
from tests.stickslip.mechanism._stopped import (
    Ball,
    Box,
    DryPendulum,
    Guided,
    Pair,
    Pendulum,
    Pushed,
    Row,
    Wire,
)
from tests.stickslip.mechanism.test_against_moreau import moreau
from tests.stickslip.mechanism.test_energy import accounted
from tests.stickslip.mechanism.test_gradients import agree_with_differences

DRY = (0.6, 0.5, 0.7)
FINE = ss.Integrator(step=ss.AdaptiveStep(rtol=1e-12))


def row_in_numpy(machine):
    n = machine.blocks

    def force(t, q):
        i = np.arange(n)
        drive = float(machine.drive) * np.sin((1.0 + 0.3 * i) * t + 0.9 * i)
        return drive - float(machine.stiffness) * q

    return np.diag(machine.masses), force, (np.diff(np.eye(n), axis=0), 0.2, float(machine.e))


@pytest.mark.more
@pytest.mark.parametrize(
    ("e", "limits", "least"),
    [
        (0.0, (), 6),
        pytest.param(0.0, DRY, 12, marks=pytest.mark.slow),
        pytest.param(0.4, DRY, 40, marks=pytest.mark.slow),
    ],
)
def test_blocks_that_bump_against_moreau(e, limits, least):
    """Stops and dry contacts in one island, dependent on each other; several closed at a time."""
    row = Row((1.0, 2.0, 1.5), tuple(map(Coulomb, limits)), e)
    run = ss.simulate(row, 0.0, 8.0, row.state())
    assert int(run.num_events) >= least
    exact = np.asarray(flat(run.y1))
    M, force, stops = row_in_numpy(row)
    J = np.eye(3) if limits else np.zeros((0, 3))
    errors = [
        np.abs(moreau(M, force, J, 0.0, limits, np.zeros(3), 8.0, n, stops) - exact).max()
        for n in (500, 16000)
    ]
    # The instant of an impact is known to a step: of an order between 1/2 and 1.
    assert errors[1] < min(3e-3, 0.3 * errors[0])


@pytest.mark.more
def test_block_between_walls_against_moreau():
    laws, e = Coulomb(0.4), 0.6
    block = Pushed(laws, lambda t: jnp.sin(0.7 * t), e)
    run = ss.simulate(block, 0.0, 20.0, block.state(x=0.5))
    assert int(run.num_events) > 10
    stops = (np.array([[1.0], [-1.0]]), np.array([0.0, 1.0]), e)
    errors = [
        np.abs(
            moreau(
                np.eye(1), lambda t, q: np.sin(0.7 * np.array([t])), np.eye(1), 0.0, [0.4],
                np.array([0.5]), 20.0, n, stops,
            ) - np.asarray(flat(run.y1))
        ).max()
        for n in (1000, 16000)
    ]  # fmt: skip
    assert errors[1] < min(2e-3, 0.3 * errors[0])


ENERGY = {
    "ball on a table": (lambda: (m := Ball(0.6, table=0.5, omega=1.7), m.state(x=1.0)), 12.0, 4),
    "ball that rides": (lambda: (m := Ball(0.6, table=0.5, omega=2.0), m.state(v_x=1.0)), 0.25, 0),
    "pendulum": (lambda: (m := Pendulum(0.3, 0.6), m.state(a=0.8)), 6.0, 3),
    "dry pendulum": (lambda: (m := DryPendulum(0.3, 0.6, law=Coulomb(0.3)), m.state(a=0.8)), 6.0, 3),
    "mass on a block": (
        lambda: (m := Guided((2.0, 1.0), 0.3, Coulomb(100.0, 50.0), 1e-3), m.state(mass=1.0)), 2.0, 5,
    ),
    "between walls": (
        lambda: (m := Pushed(Coulomb(0.5, 0.3), lambda t: jnp.sin(0.7 * t), 0.6), m.state(x=0.5)),
        20.0,
        10,
    ),
    "corner": (lambda: (m := Box(0.5, rest=1e-4), m.state(x=-0.2, y=1.0)), 6.0, 20),
    "bead": (lambda: (m := Wire(0.3), m.state(x=1.0, y=2.0)), 6.0, 5),
}  # fmt: skip


OFTEN = ("between walls", "bead")


@pytest.mark.more
@pytest.mark.parametrize(
    "name", [n if n in OFTEN else pytest.param(n, marks=pytest.mark.slow) for n in ENERGY]
)
def test_powers_and_impacts_account_for_the_energy(name):
    make, t1, least = ENERGY[name]
    machine, y0 = make()
    change, sums, run = accounted(machine, y0, t1)
    count = int(run.num_events)
    assert count >= least
    before, after = (jax.vmap(machine.energy)(y.y) for y in (run.events.y_before, run.events.y_after))
    losses = np.asarray(after - before)[:count]
    size = 1.0 + sum(map(abs, sums.values())) + np.abs(losses).sum()
    np.testing.assert_allclose(change, sum(sums.values()) + losses.sum(), atol=1e-9 * size)
    if "table" not in machine.stops:  # which gives energy too
        assert (losses < 1e-12).all()
        assert losses.min(initial=0.0) < -1e-3
    else:
        assert abs(sums["drive of table"]) > 1e-3


def blocks(p):
    mass, drive, e = p
    row = Row((mass, 2.0, 1.5), (), e, 0.02, drive=drive)
    return ss.simulate(row, 0.0, 4.0, row.state(x_0=0.1), saveat=ss.SaveAt(max_events=None))


def wall(p):
    start, place, e, gravity = p
    pendulum = Pendulum(place, e, gravity=gravity)
    return ss.simulate(pendulum, 0.0, 4.0, pendulum.state(a=start), saveat=ss.SaveAt(max_events=None))


def shaken(p):
    e, table, weight = p
    ball = Ball(e, 1e-3, weight, table, 2.0, 0.3)
    return ss.simulate(ball, 0.0, 6.0, ball.state(x=1.0), saveat=ss.SaveAt(max_events=None))


def landed(p):
    masses, e, kinetic, gravity = p
    machine = Guided((2.0, masses), e, Coulomb(100.0, kinetic), 0.2, gravity)
    return ss.simulate(machine, 0.0, 0.65, machine.state(mass=1.0), saveat=ss.SaveAt(max_events=None))


def bead(p):
    x, e, gravity = p
    wire = Wire(e, 0.05, gravity)
    return ss.simulate(wire, 0.0, 4.0, wire.state(x=x, y=2.0), saveat=ss.SaveAt(max_events=None))


SLOPES = {
    "pendulum": (wall, [0.8, 0.3, 0.6, 9.81], 3),
    "shaken ball": (shaken, [0.6, 0.2, 1.0], 3),
    "mass on a block": (landed, [1.0, 0.3, 50.0, 10.0], 3),
    "bead": (bead, [1.0, 0.3, 1.0], 3),
    "blocks": (blocks, [1.0, 2.0, 0.4], 6),
}
QUICK = ("pendulum",)


@pytest.mark.more
@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in SLOPES]
)
def test_derivatives_through_stops_as_central_differences(name):
    agree_with_differences(*SLOPES[name], h=1e-6)


@pytest.mark.more
def test_random_pairs():
    """Springs, pushes, restitution at random: no mass goes through the other, laws hold at impacts."""
    random = np.random.default_rng(3)
    count = 64
    numbers = jnp.asarray(
        np.column_stack([
            random.uniform(0.5, 3.0, (count, 2)), random.uniform(0.0, 0.95, count),
            random.uniform(0.2, 2.0, (count, 2)), random.normal(size=(count, 2)),
            random.normal(size=(count, 2)),
        ])
    )  # fmt: skip

    @jax.jit
    @jax.vmap
    def runs(p):
        pair = Pair((p[0], p[1]), p[2], 1e-3, (p[3], p[4]), (p[5], p[6]))
        y0 = pair.state(x=-1.0, y=1.0, v_x=p[7], v_y=p[8])
        at = ss.SaveAt(ts=jnp.linspace(0.0, 12.0, 97), max_events=128)
        return ss.simulate(pair, 0.0, 12.0, y0, saveat=at, throw=False)

    found = runs(numbers)
    assert (found.result == ss.RESULTS.successful).all()
    assert float((found.outputs.y.y - found.outputs.y.x).min()) > -1e-11
    closed, left = 0, 0
    for k in range(count):
        events = jax.tree.map(lambda x, k=k: np.asarray(x[k]), found.events)
        rows = slice(0, int(events.count))
        masses, e = np.asarray(numbers[k, :2]), float(numbers[k, 2])
        impact = events.mode_before[rows] == 0
        before, after = (np.stack(y[2:], axis=1)[rows] for y in (events.y_before, events.y_after))
        before, after = before[impact], after[impact]
        np.testing.assert_allclose(before @ masses, after @ masses, atol=1e-12)
        rests = events.mode_after[rows][impact] == 1
        u_before, u_after = np.diff(before)[:, 0], np.diff(after)[:, 0]
        expected = np.where(rests, 0.0, -e * u_before)
        np.testing.assert_allclose(u_after, expected, atol=1e-12)
        assert (-e * u_before[rests] <= 1e-3 + 1e-12).all()
        closed, left = closed + rests.sum(), left + (~impact).sum()
    assert closed > 20
    assert left > 5


@pytest.mark.more
def test_a_stop_met_as_a_contact_of_its_island_stops():
    """The block comes to rest in the guide at the instant at which the mass lands on it."""
    law = Coulomb(100.0, 31.0)
    machine = Guided((2.0, 1.0), 0.3, law, 1e-3)
    still = ss.simulate(machine, 0.0, 8.0, machine.state(mass=1.0))
    fall, brake = np.sqrt(0.2), 31.0 / 2.0 - 10.0
    for late in (-1e-9, 0.0, 1e-9):
        speed = brake * (fall + late)
        start = machine.state(mass=1.0, block=speed**2 / (2 * brake), v_block=-speed)
        run = ss.simulate(machine, 0.0, 8.0, start)
        assert machine.mode_names[int(run.mode1)] == "stick / closed"
        np.testing.assert_allclose(run.y1.block, still.y1.block, atol=1e-6)


class Free(AbstractMechanism):
    """Two masses with stops as a test gives them."""

    given: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}
    stops: ClassVar = ("lid", "floor")

    def mass_matrix(self, q):
        return 1.0, 1.0

    def forces(self, t, q, v, args):
        return 0.0, -1.0

    def gaps(self, t, q, args):
        return self.given(t, q)


def both(gap=lambda t, q: q.y, **changes):
    stop = {"restitution": 0.5, **changes}
    return lambda t, q: {"lid": Stop(gap(t, q), **stop), "floor": Stop(q.x, 0.5)}


WRONG = {
    "restitution": (both(restitution=1.5), "restitution of stop 'lid' = 1.5"),
    "restitution NaN": (both(restitution=np.nan), "restitution of stop 'lid' = nan"),
    "rest_speed": (both(rest_speed=-1.0), "rest_speed of stop 'lid' = -1.0"),
    "no number": (both(restitution="much"), "restitution of stop 'lid'.*'much'"),
    "missing": (lambda t, q: {"lid": Stop(q.x, 0.5)}, "gaps.*'floor'"),
    "unknown": (lambda t, q: {**both()(t, q), "roof": Stop(q.x, 0.5)}, "gaps.*'lid', 'floor'"),
    "no stop": (lambda t, q: {**both()(t, q), "lid": q.x}, r"gaps\(...\)\['lid'\].*a Stop"),
    "of no coordinate": (both(lambda t, q: 1.0 + t), "gap of stop 'lid'.*coordinates"),
    "several gaps": (both(lambda t, q: jnp.stack([q.x, q.y])), "gap of stop 'lid'.*one number"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_stops_are_refused_by_name(case):
    given, message = WRONG[case]
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        Free(given)
    assert "\n" not in str(caught.value).strip()


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ("ground", "stops = 'ground'.*tuple"),
        (("a / b",), "stops.*a / b"),
        (("lid", "lid"), "stops = 'lid'.*no other stop"),
        ((3,), "stops = 3"),
    ],
)
def test_wrong_names_are_refused(names, message):
    kind = type("Named", (Free,), {"stops": names})
    with pytest.raises((ValueError, TypeError), match=message):
        kind(both())


def test_dependent_stops_that_turn_are_refused_by_name():
    class Valley(Free):
        stops: ClassVar = ("left", "right", "bowl")

    def given(t, q):
        return [Stop(q.x, 0.5), Stop(1.0 - q.x, 0.5), Stop(q.y - q.x**2, 0.5)]

    with pytest.raises(DeclarationError, match="left, right, bowl"):
        Valley(given)


def test_smooth_forms_refuse_stops_by_name():
    block = Pushed(Coulomb(0.5), lambda t: 0.0 * t, 0.5)
    with pytest.raises(DeclarationError, match=r"'left', 'right'.*no impacts"):
        block.regularised(1e-3)
    with pytest.raises(DeclarationError, match=r"'left', 'right'.*no impacts"):
        block.bristles(LuGre, sigma_0=1e4)


def test_stops_that_depend_on_args():
    """Their directions are known to no one before the run: all coordinates may be theirs."""

    class Tilted(Ball):
        def gaps(self, t, q, args):
            return {"table": Stop(args["slope"] * q.x - args["height"], self.e, self.rest)}

    ball = Tilted(0.5)
    args = {"slope": 2.0, "height": 1.0}
    run = ss.simulate(ball, 0.0, 1.5, ball.state(x=1.0), args=args)
    np.testing.assert_allclose(run.events.t[0], 1.0, rtol=1e-12)
    np.testing.assert_allclose(run.y1.x, 0.5 + 0.5 * 0.5 - 0.125, rtol=1e-12)
    with pytest.raises(ValueError, match=r"restitution of stop 'table' = 2\.0"):
        ss.simulate(Tilted(2.0), 0.0, 1.5, ball.state(x=1.0), args=args)


def test_structure_of_the_directions():
    """Constant slopes of the gaps are known while tracing, whatever the parameters in them."""
    np.testing.assert_array_equal(Pair((1.0, 1.0), 0.5).structure.slopes, [[-1.0, 1.0, 0.0]])
    np.testing.assert_array_equal(Box(0.5).structure.slopes, [[0.5, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    slopes = Ball(0.5, table=0.2).structure.slopes
    assert slopes[0, 0] == 1.0
    assert np.isnan(slopes[0, 1])
    assert np.isnan(Wire(0.5).structure.slopes[0, 0])
    assert Wire(0.5).structure.slopes[0, 1] == 1.0
    assert len(Row((1.0,) * 3, (), 0.5).structure.groups) == 1
    assert len(Free(both()).structure.groups) == 2
