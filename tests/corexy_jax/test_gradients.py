"""Derivatives of end position and slip distance by every parameter: forward, reverse, differences."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax as cx
import stickslip as ss
from corexy_jax._parameters import TABLE_1
from stickslip.derived import WithIntegrals
from tests.corexy_jax._runs import shared

NAMES = (*TABLE_1, "r_f", "v01", "v02", "frequency")
SLIP_UNITS = {"slip_1": "m", "slip_2": "m"}


def values(number):
    p, v = shared(number)
    machine = [getattr(p, name) for name in NAMES[:-3]]
    return jnp.stack([*machine, v.square.v01, v.square.v02, v.square.frequency])


@eqx.filter_jit
def outcome(theta, t1, number_like):
    """End position and slip distances [m], and the hash of the mode sequence."""
    table = dict(zip(NAMES, theta, strict=True))
    v01, v02, frequency = (table.pop(name) for name in NAMES[-3:])
    p, v = cx.CoreXYParameters(**table), number_like
    waves = (cx.Harmonic(v01, v02, frequency), cx.SquareWave(v01, v02, frequency))
    v = eqx.tree_at(lambda v: (v.harmonic, v.square), v, waves)
    system = cx.CoreXY(p, v)
    ledger = WithIntegrals(system, cx.CoreXY.slips, units=SLIP_UNITS)
    integrator = ss.Integrator(step=ss.AdaptiveStep(1e-12, 1e-12))
    found = ss.simulate(
        ledger, 0.0, t1, ledger.start(system.state()), integrator=integrator,
        saveat=ss.SaveAt(max_events=None),
    )  # fmt: skip
    y, slips = found.y1.y, found.y1.integrals
    return jnp.stack([y.x, y.y, slips["slip_1"], slips["slip_2"]]), (found.sequence, found.flags)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "t1"), [(1, 1.4), (2, 0.9), (3, 1.3)])
def test_forward_reverse_and_differences_agree(number, t1):
    theta, wave, t1 = values(number), shared(number)[1], jnp.asarray(t1)
    forward, (_, flags) = jax.jacfwd(lambda a: outcome(a, t1, wave), has_aux=True)(theta)
    reverse = jax.jacrev(lambda a: outcome(a, t1, wave)[0])(theta)
    assert int(flags) == 0
    scale = np.max(np.abs(forward), axis=1, keepdims=True) + 1e-9
    np.testing.assert_allclose(reverse / scale, forward / scale, atol=1e-9)

    sequence = outcome(theta, t1, wave)[1][0]
    exact = np.asarray(forward) * np.asarray(theta)
    size = np.max(np.abs(exact), axis=1) + 1e-9
    for i, name in enumerate(NAMES):
        gaps = []
        for step in (3e-5, 1e-5):
            high, low = (outcome(theta.at[i].multiply(1 + sign * step), t1, wave) for sign in (1, -1))
            assert int(high[1][0]) == int(low[1][0]) == int(sequence), name
            slope = np.asarray(high[0] - low[0]) / (2 * step)
            gaps.append(np.abs(slope - exact[:, i]) / size)
        assert np.all(gaps[1] < 1e-6), (name, gaps)
    moved = {1: (0, 1, 3), 2: (2, 3), 3: (0, 1, 2, 3)}[number]
    for output in moved:
        assert np.sum(np.abs(exact[output]) > 1e-3 * size[output]) >= 8
