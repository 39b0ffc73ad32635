"""Event-driven runs against Moreau's time stepping, which knows neither modes nor events."""

import jax
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from tests.stickslip.mechanism._machines import (
    BetweenBelts,
    Oscillator,
    Train,
    carriage,
    chain,
    flat,
)


def moreau(M, force, J, w, limit, q, t1, steps, stops=None, v=0.0):
    """Steps of `h`: contact impulses by projected Gauss-Seidel, Coulomb friction without a drop.

    M v' = f + J' lambda with -lambda in limit * Sign(J v - w), implicit in v; the force is taken in
    the middle of the step. `stops`: gradients and offsets of linear gaps, and a restitution; where a
    gap is closed in the middle of a step, 0 <= impulse, 0 <= u after + e * u before, one of them 0.
    """
    h, v = t1 / steps, np.zeros(len(q)) + v
    inverse = np.linalg.inv(M)
    G, offset, e = stops or (np.zeros((0, len(q))), 0.0, 0.0)
    count, J = len(J), np.vstack([J, G])
    D = J @ inverse @ J.T
    impulse = np.zeros(len(J))
    lowest, highest = np.zeros(len(J)), np.zeros(len(J))
    lowest[:count], highest[:count] = -h * np.array(limit), h * np.array(limit)
    for k in range(steps):
        middle = q + 0.5 * h * v
        free = v + h * inverse @ force((k + 0.5) * h, middle)
        slip = J @ free
        slip[:count] -= w
        slip[count:] += e * (G @ v)
        highest[count:] = np.where(G @ middle + offset <= 0.0, np.inf, 0.0)
        for _ in range(2000):
            before = impulse.copy()
            for c in range(len(J)):
                other = slip[c] + D[c] @ impulse - D[c, c] * impulse[c]
                impulse[c] = np.clip(-other / D[c, c], lowest[c], highest[c])
            if np.abs(impulse - before).max() < 1e-13 * h:
                break
        v = free + inverse @ (J.T @ impulse)
        q = middle + 0.5 * h * v
    return np.concatenate([q, v])


def chain_in_numpy(machine):
    """Stiffness and drive of a chain in the coordinates of its blocks."""
    n = machine.blocks
    K = machine.pull * np.eye(n)
    for i in range(n - 1):
        K[i : i + 2, i : i + 2] += machine.coupling * np.array([[1, -1], [-1, 1]])
    pull = float(machine.pull * machine.speed)
    return np.eye(n), lambda t, q: pull * t - K @ q, np.eye(n)


def converges(exact, reference, steps=(500, 4000)):
    """First order: the difference falls with the step, to nothing."""
    errors = [np.abs(reference(n) - exact).max() for n in steps]
    assert errors[-1] < 5e-3
    assert errors[0] / errors[-1] > 0.5 * steps[-1] / steps[0]


@pytest.mark.more
@pytest.mark.parametrize("blocks", [3, pytest.param(8, marks=pytest.mark.slow)])
def test_chain_in_both_coordinates(blocks):
    """Friction without a drop: time stepping has no other."""
    machine = chain(blocks)
    laws = tuple(Coulomb(1.0 + 0.1 * (i % 3)) for i in range(blocks))
    t1, speed = 25.0, 0.4
    make = dict(mass=1.0, pull=1.0, coupling=2.0, laws=laws, speed=speed, blocks=blocks)
    machine, train = type(machine)(**make), Train(**make)
    start = {f"x_{i + 1}": 0.3 * (-1.0) ** i for i in range(blocks)}
    run = ss.simulate(machine, 0.0, t1, machine.state(**start), saveat=ss.SaveAt(max_events=512))
    exact = np.asarray(flat(run.y1))
    assert int(run.num_events) > 2 * blocks

    apart = np.diff([*start.values()], prepend=0.0)
    relative = {name: float(x) for name, x in zip(start, apart, strict=True)}
    other = ss.simulate(train, 0.0, t1, train.state(**relative), saveat=ss.SaveAt(max_events=512))
    both = np.asarray(flat(other.y1)).reshape(2, blocks).cumsum(1).ravel()
    np.testing.assert_allclose(both, exact, atol=1e-9)
    assert int(other.num_events) == int(run.num_events)

    M, force, J = chain_in_numpy(machine)
    limits = [float(law.mu_s) for law in laws]
    q = np.array([*start.values()])
    converges(exact, lambda n: moreau(M, force, J, 0.0, limits, q, t1, n))


@pytest.mark.more
def test_carriage_with_dependent_contacts():
    machine = carriage()
    t1 = 12.0
    run = ss.simulate(machine, 0.0, t1, machine.state(), saveat=ss.SaveAt(max_events=128))
    assert int(run.num_events) > 10
    J = np.array([[1, 0], [0, 1], [1, 1], [1, -1]], float)

    def force(t, q):
        a = float(machine.amplitude)
        return np.array([a * np.sin(1.1 * t), 0.8 * a * np.sin(1.9 * t + 0.3)]) - 0.5 * q

    limits = [float(law.mu_s) for law in machine.laws]
    M = np.diag([1.0, 1.5])
    exact = np.asarray(flat(run.y1))
    converges(exact, lambda n: moreau(M, force, J, 0.0, limits, np.zeros(2), t1, n))


def between_belts(t1, low=0.4, high=0.7, slow=0.1, fast=0.5, stiffness=1.0):
    """Closed form: the stronger, faster belt carries the block on, the weaker brakes it.

    Riding on the fast belt the block bears stiffness x + low, up to high; it slips at
    x = high - low. Friction is high - low towards the fast belt for slow < v < fast then, so that
    the block starts with the force 0 and v = fast: it turns round at the slow belt.
    """
    x_1 = (high - low) / stiffness
    t_1 = x_1 / fast
    # Undamped oscillation about x_1 until v falls to `slow`, where the slow belt may hold it:
    # there it must bear stiffness x - high <= low.
    omega = np.sqrt(stiffness)
    t_2 = t_1 + np.arccos(slow / fast) / omega
    x_2 = x_1 + fast / omega * np.sqrt(1 - (slow / fast) ** 2)
    # It rides on the slow belt until the spring takes both: x_3 = (high + low) / stiffness.
    x_3 = (high + low) / stiffness
    if stiffness * x_2 >= high + low:
        raise ValueError("the slow belt does not hold it")
    t_3 = t_2 + (x_3 - x_2) / slow
    if t1 < t_3:
        return [t_1, t_2], (x_2 + slow * (t1 - t_2), slow)
    # Then it swings about x_3 from v = slow, under both: v = slow cos, back at `slow` never to be
    # held before v = slow again after a whole turn.
    turn = 2 * np.pi / omega
    assert t1 < t_3 + turn
    phase = omega * (t1 - t_3)
    return [t_1, t_2, t_3], (x_3 + slow / omega * np.sin(phase), slow * np.cos(phase))


@pytest.mark.more
@pytest.mark.parametrize("t1", [3.0, 10.0])
def test_block_between_two_belts(t1):
    machine = BetweenBelts(1.0, (Coulomb(0.4), Coulomb(0.7)), (0.1, 0.5))
    run = ss.simulate(machine, 0.0, t1, machine.state(v_x=0.5), saveat=ss.SaveAt(max_events=32))
    times, end = between_belts(t1)
    count = int(run.num_events)
    np.testing.assert_allclose(np.unique(np.round(run.events.t[:count], 9)), times, atol=1e-8)
    np.testing.assert_allclose(flat(run.y1), end, atol=1e-9)


@pytest.mark.more
def test_two_belts_of_one_speed_are_one_belt():
    """Contacts whose directions and speeds agree rest and slide together."""
    pair = BetweenBelts(1.0, (Coulomb(0.4, 0.2), Coulomb(0.7, 0.4)), (0.2, 0.2))
    one = Oscillator(1.0, 1.0, Coulomb(1.1, 0.6), 0.2)
    end = [
        ss.simulate(m, 0.0, 30.0, m.state(v_x=0.2), saveat=ss.SaveAt(max_events=64))
        for m in (pair, one)
    ]
    np.testing.assert_allclose(flat(end[0].y1), flat(end[1].y1), atol=1e-9)
    assert jax.tree.leaves(end[0].num_events) == jax.tree.leaves(end[1].num_events)
