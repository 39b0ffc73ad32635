"""The paper's algorithm: as printed, each erratum, and corrected against the event-driven motion."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax as cx
from corexy_jax._errata import CHOICES, CLAIMS, SWITCHES
from corexy_jax._fixed_step import dead_zone_row
from tests.corexy_jax._runs import columns, solution


def fixed(number, errata, t1=2.0, rows=201, dt=1e-4):
    p, v = cx.scenario(number, errata)
    return cx.simulate(p, v, t1, method="as_printed", errata=errata, rows=rows, dt=dt)


def test_dead_zone_of_one_axis():
    load = jnp.array([0.5, -0.5, 1.0, -1.0, 3.0, -3.0])
    np.testing.assert_array_equal(dead_zone_row(load, 1.0), [0, 0, 0, 0, 2, -2])


@pytest.mark.more
def test_corrected_algorithm_agrees_with_the_events():
    """All errata corrected: first order in the step, to the motion of `consistent` over 2 s."""
    exact = columns(solution(1))[0][:201]
    errors = []
    for dt in (4e-4, 1e-4):
        position = columns(fixed(1, cx.Errata.corrected(), dt=dt, rows=51))[0]
        errors.append(np.max(np.abs(position - exact[::4])[:, :2]))
    assert errors[1] < 1e-3
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.more
def test_rounding_is_no_sense_of_motion():
    """Along the diagonal one contact rests, in whatever last place x and y differ."""
    errata = cx.Errata.corrected()
    p, v = cx.scenario(1, errata)
    ends = []
    for vy in (0.1, np.nextafter(0.1, 1.0), np.nextafter(0.1, 0.0)):
        y0 = cx.CoreXY(p, v).state(vx=0.1, vy=vy, omega_1=4.0)
        found = cx.simulate(p, v, 0.01, method="as_printed", errata=errata, y0=y0, rows=3)
        assert float(found.senses[0][3]) == 0.0
        ends.append(np.array(found.y.x))
    np.testing.assert_allclose(ends[1:], [ends[0]] * 2, rtol=0, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2, 3])
def test_corrected_algorithm_in_every_scenario(number):
    exact = columns(solution(number))[0]
    position = columns(fixed(number, cx.Errata.corrected(), t1=6.0, rows=601))[0]
    assert np.max(np.abs(position - exact)[:, :2]) < {1: 2e-3, 2: 1e-12, 3: 0.2}[number]


@pytest.mark.slow
def test_printed_belt_reaction_creates_energy():
    """Erratum A2: net friction work at the belts with the printed reaction, the rest corrected."""
    net = {}
    for A2 in (False, True):
        errata = cx.Errata.corrected(A2=A2)
        belts = fixed(3, errata, t1=6.0, rows=601).ledger.friction[:, 6:]
        net[A2] = float(jnp.sum(belts[-1]))
        gained = float(jnp.max(jnp.diff(belts, axis=0)))
        assert (gained > 1e-3) == (not A2)
    assert net[True] < -1000
    assert net[False] > net[True] + 500


@pytest.mark.more
def test_first_step_as_printed_by_hand():
    """Scenario 2 at t = 0: v = (0, 10) V at rest, Eqs. (28)-(30), (38)-(40), (74)-(82) by hand."""
    torque = 2.0 / 0.9 * 10.0
    # Static friction of the rows; with erratum A1 pulleys 1_1, 1_4 and 2_1, 2_4 cancel.
    passive, motor = 2 * 2**0.5 * 30 * 0.05, 2 * 30 * 0.05
    rows = [0.5 * 9.81 * 0.05 + 2 * passive + 2 * motor, 1.5 * 9.81 * 0.05 + 2 * passive + 2 * motor]
    a_x = (torque - 0.4 * rows[0]) / (0.5 * 0.05 + 8 * 5e-4 / 0.05 + 2 * 1e-3 / 0.05)
    a_y = -(torque - 0.4 * rows[1]) / (1.5 * 0.05 + 4 * 5e-4 / 0.05 + 2 * 1e-3 / 0.05)
    needed = [
        1e-3 / 60 * abs((a_x + a_y) / 0.05**2 + 0.4 * motor / 0.05),
        1e-3 / 60 * abs((a_x - a_y) / 0.05**2 - (torque - 0.4 * motor) / 0.05),
    ]
    p, v = cx.scenario(2)
    for belt in (0, 1):
        for share, slips in ((0.999, True), (1.001, False)):
            mu = [10.0, 10.0]
            mu[belt] = share * needed[belt]
            other = eqx.tree_at(lambda p: (p.mu_1s_b, p.mu_2s_b), p, tuple(map(jnp.asarray, mu)))
            found = cx.simulate(other, v, 2e-4, method="as_printed", rows=3)
            assert int(found.dmn[0]) == (1 + 2**belt if slips else 1)
    # Slipping from rest there is no sense and no friction yet, Eqs. (31)-(32), and no motor torque.
    data = cx.outputs(cx.simulate(p, v, 2e-4, method="as_printed", rows=3), cx.Errata())
    assert int(data.dmn[0]) == 4
    np.testing.assert_array_equal(data.tau_belt[0], 0.0)


def test_errata_are_described():
    assert set(SWITCHES) | set(CHOICES) == set(CLAIMS) == {f"A{i}" for i in range(1, 13)}
    assert "Hz" in cx.Errata.describe("A5")
    with pytest.raises(ValueError, match="name = 'A13'"):
        cx.Errata.describe("A13")
    constant = cx.scenario(3, cx.Errata())[1]
    assert {tuple(float(a) for a in constant(t)) for t in (0.1, 0.7, 1.3)} == {(20.0, 10.0)}
