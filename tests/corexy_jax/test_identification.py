"""What is measured on the machine, and the residuals of a fit, on scenario 1 up to 0.9 s."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax as cx
import stickslip as ss
from tests.corexy_jax._moreau import SCENARIOS, Reference

TIMES = jnp.array([0.2, 0.5, 0.9])
NAMES = ("mu_1k_b", "mu_2k_b", "mu_k", "mu_s", "P1", "P2")


def residuals(values, data):
    """Residuals of scenario 1."""
    p, voltage = cx.scenario(1)
    step = ss.AdaptiveStep(1e-10, 1e-10)
    integrator = ss.Integrator("tsit5", step)
    return cx.measurement_residuals(values, data, p, voltage, TIMES, integrator=integrator)


rows = jax.jit(residuals)


@functools.cache
def truth():
    p = cx.scenario(1).parameters
    return {name: getattr(p, name) for name in NAMES}


@functools.cache
def clean() -> cx.Measurement:
    """The residuals against nothing, unscaled, are what the machine shows."""
    nothing = cx.Measurement(*(jnp.zeros(3),) * 4)
    found = rows(truth(), nothing).reshape(4, 3)
    return cx.Measurement(
        *(row * sigma for row, sigma in zip(found, cx.MEASUREMENT_NOISE, strict=True))
    )


@pytest.mark.slow
def test_it_is_what_the_reference_shows():
    h = 1e-4
    stepped = Reference(SCENARIOS[1], h).run(0.9, round(0.1 / h))
    position, velocity = (np.asarray(a)[[2, 5, 9]] for a in stepped[1:3])
    wanted = cx.Measurement(velocity[:, 2], velocity[:, 3], position[:, 0], position[:, 1])
    for name, got, want in zip(wanted._fields, clean(), wanted, strict=True):
        assert np.abs(want).max() > 1e-3 or name == "y"
        assert got == pytest.approx(want, rel=2e-3, abs=2e-4), name


@pytest.mark.slow
def test_residuals_are_deviations_in_units_of_the_noise():
    assert np.abs(rows(truth(), clean())).max() < 1e-9
    moved = clean()._replace(x=clean().x.at[1].add(3 * cx.MEASUREMENT_NOISE.x))
    assert rows(truth(), moved) == pytest.approx(np.eye(12)[7] * -3.0, abs=1e-9)


@pytest.mark.slow
def test_derivatives_by_the_unknowns():
    rates = jax.jit(jax.jacfwd(residuals))(truth(), clean())
    for name, value in truth().items():
        h = 1e-4 * value
        up, down = (rows({**truth(), name: value + s * h}, clean()) for s in (1, -1))
        scale = np.abs(rates[name]).max() + 1e-3
        assert np.abs((up - down) / (2 * h) - rates[name]).max() < 1e-5 * scale, name


def test_noise_is_normal_with_the_given_deviations():
    wide = cx.Measurement(*(jnp.zeros(20_000),) * 4)
    noisy = cx.with_noise(wide, jax.random.key(1))
    for row, sigma in zip(noisy, cx.MEASUREMENT_NOISE, strict=True):
        assert np.std(row) == pytest.approx(sigma, rel=0.03)
        assert abs(np.mean(row)) < 5 * sigma / np.sqrt(20_000)
    assert abs(np.corrcoef(np.stack(noisy)) - np.eye(4)).max() < 0.04


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"times": [0.1, 0.3, 0.2]}, r"times\[2\] = 0.2.*above the one before it, 0.3"),
        ({"times": [-0.1, 0.3, 0.4]}, "times.*-0.1"),
        ({"values": {"mu": 0.1}}, r"values\['mu'\] = .*mu_s"),
        ({"data": cx.Measurement(*(jnp.zeros(2),) * 4)}, r"data\.omega_1 = .*, of shape \(2,\)"),
        ({"data": cx.Measurement(*(jnp.full(3, np.nan),) * 4)}, r"data\.omega_1.*nan"),
        ({"noise": cx.Measurement(0.05, 0.05, 0.0, 1e-4)}, r"noise\.x.*0"),
    ],
)
def test_bad_input(change, words):
    p, voltage = cx.scenario(1)
    given = {"values": truth(), "data": cx.Measurement(*(jnp.zeros(3),) * 4), "times": TIMES, **change}
    given["times"] = jnp.asarray(given["times"])
    with pytest.raises(ValueError, match=words):
        cx.measurement_residuals(
            given["values"], given["data"], p, voltage, given["times"],
            noise=given.get("noise", cx.MEASUREMENT_NOISE),
        )  # fmt: skip
