"""Rate-and-state friction against closed forms and SciPy's stiff solver, which takes the age itself."""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate

import stickslip as ss
from stickslip.friction import Coulomb, RateAndState
from stickslip.mechanism import AbstractMechanism, Contact

MU_0, A, B, D_C, V_0 = 0.6, 0.009, 0.013, 7e-6, 3e-6
LAWS = {kind: RateAndState(MU_0, A, B, D_C, V_0, kind) for kind in ("ageing", "slip")}
every_kind = pytest.mark.parametrize("kind", LAWS)
SPEEDS = np.geomspace(1e-9, 1.0, 40)


@every_kind
def test_in_motion_it_is_the_law_of_dieterich_and_ruina(kind):
    law = LAWS[kind]
    steady = MU_0 + (A - B) * np.log(SPEEDS / V_0)
    np.testing.assert_allclose(law.coefficient(SPEEDS), steady, rtol=1e-10)
    np.testing.assert_allclose(law.coefficient(-SPEEDS), -steady, rtol=1e-10)
    theta = 2.5  # [s]
    other = MU_0 + A * np.log(SPEEDS / V_0) + B * np.log(V_0 * theta / D_C)
    state = (D_C * np.log(V_0 * theta / D_C),)
    np.testing.assert_allclose(law.coefficient_from_state(SPEEDS, state), other, rtol=1e-14)


def test_at_creep_it_is_the_regularised_form():
    theta = 2.5
    exponent = (MU_0 + B * np.log(V_0 * theta / D_C)) / A
    v = V_0 * np.exp(-exponent) * np.geomspace(1e-6, 1e6, 30)
    state = (D_C * np.log(V_0 * theta / D_C),)
    expected = A * np.arcsinh(v / (2 * V_0) * np.exp(exponent))
    np.testing.assert_allclose(LAWS["slip"].coefficient_from_state(v, state), expected, rtol=1e-12)
    assert float(LAWS["slip"].coefficient_from_state(0.0, state)) == 0.0
    slope = jax.grad(lambda v: LAWS["slip"].coefficient_from_state(v, state))(0.0)
    assert float(slope) == pytest.approx(A / (2 * V_0) * np.exp(exponent), rel=1e-12)


def test_hard_contacts_do_not_overflow():
    law = RateAndState(0.6, 2e-4, 3e-4, D_C, V_0)  # exp(mu_0/a) = 1e1300
    expected = 0.6 + 2e-4 * np.log(SPEEDS / V_0)
    np.testing.assert_allclose(law.coefficient_from_state(SPEEDS, (0.0,)), expected, rtol=1e-13)
    slope = jax.vmap(jax.grad(lambda v: law.coefficient_from_state(v, (0.0,))))(SPEEDS)
    np.testing.assert_allclose(slope, 2e-4 / SPEEDS, rtol=1e-12)
    np.testing.assert_allclose(law.velocity(expected, (0.0,)), SPEEDS, rtol=1e-9)


@every_kind
def test_velocity_is_the_inverse(kind):
    law, state = LAWS[kind], (-3.0 * D_C,)
    for sense in (1.0, -1.0):
        mu = law.coefficient_from_state(sense * SPEEDS, state)
        np.testing.assert_allclose(law.velocity(mu, state), sense * SPEEDS, rtol=1e-11)
    assert float(law.velocity(0.0, state)) == 0.0


def test_without_effects_it_is_coulombs_law():
    law = RateAndState(MU_0, 1e-7, 1e-7, D_C, V_0)
    assert isinstance(law.set_valued_limit(), Coulomb)
    np.testing.assert_allclose(
        law.coefficient_from_state(SPEEDS, (D_C,)),
        law.set_valued_limit().coefficient(SPEEDS),
        atol=3e-6,
    )


class _State(NamedTuple):
    z: Any


class _Dragged(ss.AbstractSmoothSystem):
    """A contact that slides at one speed."""

    law: RateAndState
    v: float
    units: ClassVar = {"z": "m"}

    def vector_field(self, t, y, mode, args):
        return _State(*self.law.state_rate(self.v, (y.z,)))


@every_kind
def test_response_to_a_step_of_the_speed(kind):
    """From steady sliding at v_1 to v_2: the age in closed form."""
    v_1, v_2 = 1e-6, 1e-5
    law = LAWS[kind]
    times = np.linspace(0.0, 8.0 * D_C / v_2, 9)
    run = ss.simulate(
        _Dragged(law, v_2), 0.0, times[-1], _State(*law.steady_state(v_1)),
        integrator=ss.Integrator("dop853", ss.AdaptiveStep(1e-11, 1e-18)),
        saveat=ss.SaveAt(ts=times, max_events=None),
    )  # fmt: skip
    found = law.coefficient_from_state(v_2, (run.outputs.y.z,))
    slip = v_2 * times / D_C
    if kind == "ageing":
        theta = D_C / v_2 + (D_C / v_1 - D_C / v_2) * np.exp(-slip)
        age = np.log(V_0 * theta / D_C)
    else:
        age = np.log(V_0 / v_2) + np.log(v_2 / v_1) * np.exp(-slip)
    expected = MU_0 + A * np.log(v_2 / V_0) + B * age
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    before = MU_0 + (A - B) * np.log(v_1 / V_0)
    assert float(found[0]) - before == pytest.approx(A * np.log(v_2 / v_1), rel=1e-9)


def test_at_rest_contacts_age_under_one_law_only():
    ageing, slip = (float(LAWS[kind].state_rate(0.0, (0.0,))[0]) for kind in ("ageing", "slip"))
    assert ageing == pytest.approx(V_0)  # of the logarithm: 1/theta
    assert abs(slip) < 1e-18


class _Slider(AbstractMechanism):
    law: RateAndState
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"rock": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"x": 2.0}

    def forces(self, t, q, v, args):
        return {"x": 400.0 * (0.02 * t - q.x)}

    def contacts(self, t, q, v, args):
        return {"rock": Contact(self.law, normal_force=20.0)}

    def time_scale(self, args):
        return 0.1


@pytest.mark.more
@every_kind
def test_declared_mechanism_against_a_stiff_solver(kind):
    """A slider with mass, pulled from slow creep into stick-slip; SciPy integrates age and speed."""
    mu_0, a, b, d_c, v_0 = 0.5, 0.01, 0.03, 1e-3, 0.01
    form = _Slider(RateAndState(mu_0, a, b, d_c, v_0, kind)).bristles()

    def slope(t, y):
        x, v, theta = y
        mu = a * np.arcsinh(v / (2 * v_0) * np.exp((mu_0 + b * np.log(v_0 * theta / d_c)) / a))
        u = abs(v) * theta / d_c
        rate = 1.0 - u if kind == "ageing" else -u * np.log(u)
        return [v, (400.0 * (0.02 * t - x) - 20.0 * mu) / 2.0, rate]

    times = np.linspace(0.0, 4.0, 41)
    told = scipy.integrate.solve_ivp(
        slope, (0.0, 4.0), [-0.024, 0.01, d_c / v_0], "Radau", times, rtol=1e-9, atol=1e-13
    )
    assert np.ptp(told.y[1]) > 0.02  # stick-slip, not the steady motion
    run = ss.simulate(
        form, 0.0, 4.0, form.start(form.mechanism.state(x=-0.024, v_x=0.01)),
        integrator=ss.Integrator("dop853", ss.AdaptiveStep(1e-9, 1e-12)),
        saveat=ss.SaveAt(ts=times, max_events=None),
    )  # fmt: skip
    np.testing.assert_allclose(run.outputs.y.y.x, told.y[0], rtol=0, atol=2e-8)
    np.testing.assert_allclose(run.outputs.y.z[0][0], d_c * np.log(v_0 * told.y[2] / d_c), atol=1e-7)


def test_derivatives_for_every_parameter():
    names = ("mu_0", "a", "b", "d_c", "v_0")
    at = jnp.array([MU_0, A, B, D_C, V_0])

    def coefficient(p):
        return RateAndState(*p).coefficient_from_state(1e-5, (2e-6,))

    found = jax.jit(jax.grad(coefficient))(at)
    expected = {
        "mu_0": 1.0, "a": np.log(1e-5 / V_0), "b": 2e-6 / D_C, "d_c": -B * 2e-6 / D_C**2,
        "v_0": -A / V_0,
    }  # fmt: skip
    np.testing.assert_allclose(found, [expected[n] for n in names], rtol=1e-10)


def test_what_it_refuses():
    with pytest.raises(ValueError, match=r"evolution = 'aging': it must be"):
        RateAndState(MU_0, A, B, D_C, V_0, "aging")
    with pytest.raises(ValueError, match=r"a = 0.0: it must be finite and positive"):
        RateAndState(MU_0, 0.0, B, D_C, V_0)
