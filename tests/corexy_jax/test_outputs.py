"""Outputs over time and the dead zone, from runs that other tests share."""

import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax as cx
from corexy_jax._contacts import NORMALS, contact_loads
from tests.corexy_jax._runs import solution
from tests.oracle import in_dead_zone


@pytest.mark.more
def test_outputs_of_scenario_1():
    data = cx.outputs(solution(1))
    # Facts that an independent study found: motor 1 needs at most 1.58, its limit is 10.
    needed = data.mu_needed.sel(motor=1)
    assert float(needed.max()) == pytest.approx(1.58, abs=0.01)
    assert np.all(needed <= data.mu_available.sel(motor=1))
    slips = np.isin(data.dmn, (3, 4))
    np.testing.assert_array_equal(np.isnan(data.mu_needed.sel(motor=2)), slips)
    belt = data.tau_belt.sel(motor=2)
    np.testing.assert_allclose(np.abs(belt[slips]), 2 * 0.2 * 20 * 0.05)
    np.testing.assert_allclose(belt[~slips], data.tau_motor.sel(motor=2)[~slips])
    np.testing.assert_allclose(data.tau_x, data.tau_belt.sum("motor"))
    np.testing.assert_allclose(
        data.v_high - data.v_low, np.full((601, 2), 2 * 0.9 / 2 * 0.8), rtol=1e-12
    )
    assert float(np.abs(data.energy_error).max()) < 1e-8 * float(data.work.max())
    rolling = data.sel(motor=1)
    np.testing.assert_allclose(rolling.omega, rolling.omega_v, atol=1e-9)
    assert {data[name].attrs["units"] for name in data.data_vars} >= {"m", "J", "V", "N m", "rad/s"}
    with pytest.raises(TypeError, match="solution"):
        cx.outputs(3.0)


def test_slip_distance_is_the_path_of_the_belt():
    found = solution(3)
    r = 0.05
    y = found.y
    relative = np.stack([r * y.omega_1 - (y.vx + y.vy), r * y.omega_2 - (y.vx - y.vy)], axis=1)
    integral = np.cumsum(0.5 * (np.abs(relative[1:]) + np.abs(relative[:-1])) * 0.01, axis=0)
    # The trapezium misses the corners of the speed at jumps of the input.
    np.testing.assert_allclose(found.ledger.slip[1:], integral, atol=0.02 * np.max(integral))
    friction = np.asarray(found.ledger.friction)[:, 6:]
    kinetic = 2 * 0.2 * np.array([20.0, 30.0])
    np.testing.assert_allclose(friction, -kinetic * np.asarray(found.ledger.slip), rtol=1e-12)


def test_corners_of_the_dead_zone():
    """Just inside a corner the machine at rest stays, just outside it moves: by the law itself."""
    p = cx.CoreXYParameters(mu_1s_b=50.0, mu_2s_b=50.0)
    corners = np.asarray(cx.torque_dead_zone(p))
    loads = 0.4 * np.array([float(a) for a in contact_loads(p)])
    normals = NORMALS
    for corner in corners[:4]:
        for size, holds in ((0.999, True), (1.001, False)):
            force = np.concatenate([[0.0, 0.0], size * corner / float(p.r)])
            limits = loads.copy()
            limits[6:] = 1e4
            assert bool(in_dead_zone(jnp.asarray(force), normals, jnp.asarray(limits))) == holds
    np.testing.assert_allclose(cx.voltage_dead_zone(p), corners * 0.45, rtol=1e-12)
    x, y = cx.axis_dead_zones(cx.scenario(2)[0], 0.0, 0.0)
    np.testing.assert_allclose([x, y], [6.886, 3.688], atol=1e-3)
