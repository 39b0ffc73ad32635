"""What can be measured on the machine, and how far a model is from it."""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

import stickslip as ss
from stickslip import Integrator, SaveAt
from stickslip.checks import (
    Given,
    as_float64,
    as_parameter,
    check_increasing,
    check_mapping,
    check_nonnegative,
    check_positive,
    one_row,
    refusal,
    shape_refusal,
)

from ._arguments import named, the_integrator, the_machine
from ._parameters import CoreXYParameters, check_parameter
from ._system import CoreXY
from ._voltage import AbstractVoltage

FITTED_PARAMETERS = ("mu_s", "mu_k", "mu_1k_b", "mu_2k_b", "P1", "P2")


class Measurement(NamedTuple):
    """Encoder speeds `omega_1`, `omega_2` [rad/s] of the motors, position `x`, `y` [m] of the collar,
    each a row over the times of the samples."""

    omega_1: Any
    omega_2: Any
    x: Any
    y: Any


MEASUREMENT_NOISE = Measurement(0.05, 0.05, 1e-4, 1e-4)  # standard deviations of a sample


def measurement(
    parameters: CoreXYParameters,
    voltage: AbstractVoltage,
    times: Float[Array, " sample"],
    *,
    integrator: Integrator | None = None,
) -> Measurement:
    """What the machine under the consistent law shows at `times` [s], from rest at 0, without noise.

    NaN where the run fails. **Raises** `TypeError`, `ValueError` for bad arguments: `times` must be
    one row, not negative and increasing.
    """
    system = CoreXY(parameters, voltage)
    the_integrator(integrator)
    times = _checked_times(times)
    found = ss.simulate(
        system, 0.0, times[-1], system.state(), integrator=integrator,
        saveat=SaveAt(ts=times, max_events=None), throw=False,
    )  # fmt: skip
    assert found.outputs is not None
    y = found.outputs.y
    return Measurement(y.omega_1, y.omega_2, y.x, y.y)


def _checked_times(times: Any) -> Float[Array, " sample"]:
    return as_float64("times", check_increasing("times", _row_of("times", times)))


def _row_of(name: str, values: Any) -> Any:
    one_row(name, values, "not negative")
    return jnp.asarray(values) if isinstance(values, list | tuple) else values


def _check_noise(noise: Any) -> None:
    named("noise", noise, Measurement)
    for name, sigma in zip(noise._fields, noise, strict=True):
        check_nonnegative(f"noise.{name}", sigma)


def with_noise(
    clean: Measurement, key: Given[Array], noise: Measurement = MEASUREMENT_NOISE
) -> Measurement:
    """`clean` with normal noise of the standard deviations `noise`, independent in every sample.

    **Raises** `TypeError`, `ValueError` for an argument that is not a `Measurement`, not a key, or
    negative.
    """
    named("clean", clean, Measurement)
    _check_noise(noise)
    one_key = isinstance(key, jax.Array) and jnp.issubdtype(key.dtype, jax.dtypes.prng_key)
    old_key = isinstance(key, jax.Array) and key.dtype == jnp.uint32 and key.shape == (2,)
    if not ((one_key and key.shape == ()) or old_key):
        raise refusal("key", key, "one key of jax.random", TypeError)
    keys = jax.random.split(key, len(clean))
    return Measurement(
        *(
            a + s * jax.random.normal(k, jnp.shape(a))
            for a, s, k in zip(clean, noise, keys, strict=True)
        )
    )


def with_values(parameters: CoreXYParameters, values: dict[str, Any]) -> CoreXYParameters:
    """`parameters` with some replaced by name.

    **Raises** `ValueError` for an unknown name, and as `CoreXYParameters` for a value.
    """
    the_machine(parameters, "parameters")
    if values is None:
        raise refusal("values", values, "a mapping from names", TypeError)
    values = check_mapping("values", values)
    known = [field.name for field in dataclasses.fields(parameters)]
    for name, value in values.items():
        if name not in known:
            raise refusal(f"values[{name!r}]", value, f"named after one of {', '.join(known)}")
        check_parameter(f"values[{name!r}]", name, value)
    names = sorted(values)
    return eqx.tree_at(
        lambda p: [getattr(p, name) for name in names],
        parameters,
        [as_parameter(values[name]) for name in names],
    )


def measurement_residuals(
    values: dict[str, Any],
    data: Measurement,
    parameters: CoreXYParameters,
    voltage: AbstractVoltage,
    times: Float[Array, " sample"],
    *,
    noise: Measurement = MEASUREMENT_NOISE,
    integrator: Integrator | None = None,
) -> Float[Array, " row"]:
    r"""Residuals $(\text{model} - \text{data})/\sigma$ for `stickslip.identification`.

    **Arguments:** `values` of the unknowns by name, e.g. of `FITTED_PARAMETERS`; `data` at `times` [s];
    `parameters`, the machine but for the unknowns; `noise`, the standard deviations $\sigma$.
    **Returns** one row, signal after signal; NaN where the run fails. **Raises** `TypeError`,
    `ValueError` for an unknown that is not a parameter, data that are not finite or not as many as
    `times`, a `noise` that is not positive.
    """
    times = _checked_times(times)
    named("data", data, Measurement)
    for name, row in zip(data._fields, data, strict=True):
        if jnp.shape(row) != jnp.shape(times):
            raise shape_refusal(f"data.{name}", row, f"of shape {jnp.shape(times)}, as times")
    _check_noise(noise)
    for name, sigma in zip(noise._fields, noise, strict=True):
        check_positive(f"noise.{name}", sigma)
    model = measurement(with_values(parameters, values), voltage, times, integrator=integrator)
    rows = zip(model, data, noise, strict=True)
    return jnp.concatenate([(a - b) / sigma for a, b, sigma in rows])
