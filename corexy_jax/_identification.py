"""What can be measured on the machine, and how far a model is from it."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

import stickslip as ss
from stickslip import Integrator, SaveAt
from stickslip._validation import (
    as_parameter,
    check_finite,
    check_nonnegative,
    check_positive,
    check_that,
    check_type,
    is_concrete,
)

from ._parameters import CoreXYParameters
from ._system import CoreXY
from ._voltage import AbstractVoltage

UNKNOWNS = ("mu_s", "mu_k", "mu_1k_b", "mu_2k_b", "P1", "P2")


class Measurement(NamedTuple):
    """Encoder speeds `omega_1`, `omega_2` [rad/s] of the motors, position `x`, `y` [m] of the collar,
    each a row over the times of the samples."""

    omega_1: Any
    omega_2: Any
    x: Any
    y: Any


NOISE = Measurement(0.05, 0.05, 1e-4, 1e-4)  # standard deviations of a sample


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
    times = _checked_times(times)
    found = ss.simulate(
        system, 0.0, times[-1], system.state(), integrator=integrator,
        saveat=SaveAt(ts=times, events=False), max_events=None, throw=False,
    )  # fmt: skip
    assert found.outputs is not None
    y = found.outputs.y
    return Measurement(y.omega_1, y.omega_2, y.x, y.y)


def _checked_times(times: Any) -> Float[Array, " sample"]:
    row = as_parameter(check_nonnegative("times", times))
    if row.ndim != 1 or row.size == 0:
        raise ValueError(f"times has shape {row.shape}: it must be one row of at least one.")
    if is_concrete(times):
        check_that(
            "difference of times", jnp.diff(row), lambda d: d > 0, "positive: times must increase"
        )
    return row


def with_noise(clean: Measurement, key: Any, noise: Measurement = NOISE) -> Measurement:
    """`clean` with normal noise of the standard deviations `noise`, independent in every sample."""
    keys = jax.random.split(key, len(clean))
    return Measurement(
        *(
            a + s * jax.random.normal(k, jnp.shape(a))
            for a, s, k in zip(clean, noise, keys, strict=True)
        )
    )


def with_values(parameters: CoreXYParameters, values: dict[str, Any]) -> CoreXYParameters:
    """`parameters` with some replaced by name. **Raises** `ValueError` for an unknown name."""
    for name in values:
        if name not in parameters.__dataclass_fields__:
            raise ValueError(
                f"values has {name!r}: it must be a parameter of the machine, one of "
                f"{', '.join(parameters.__dataclass_fields__)}."
            )
    names = sorted(values)
    return eqx.tree_at(
        lambda p: [getattr(p, name) for name in names],
        parameters,
        [as_parameter(values[name]) for name in names],
    )


def misfit(
    values: dict[str, Any],
    data: Measurement,
    parameters: CoreXYParameters,
    voltage: AbstractVoltage,
    times: Float[Array, " sample"],
    *,
    noise: Measurement = NOISE,
    integrator: Integrator | None = None,
) -> Float[Array, " row"]:
    r"""Residuals $(\text{model} - \text{data})/\sigma$ for `stickslip.identification`.

    **Arguments:** `values` of the unknowns by name, e.g. of `UNKNOWNS`; `data` at `times` [s];
    `parameters`, the machine but for the unknowns; `noise`, the standard deviations $\sigma$.
    **Returns** one row, signal after signal; NaN where the run fails. **Raises** `TypeError`,
    `ValueError` for an unknown that is no parameter, data that are not finite or not as many as
    `times`, a `noise` that is not positive.
    """
    check_type("data", data, Measurement, "a Measurement")
    for name, row in zip(data._fields, data, strict=True):
        if jnp.shape(row) != jnp.shape(times):
            raise ValueError(
                f"data.{name} has shape {jnp.shape(row)}: it must be {jnp.shape(times)}, as times."
            )
        check_finite(f"data.{name}", row)
    for name, sigma in zip(noise._fields, noise, strict=True):
        check_positive(f"noise.{name}", sigma)
    model = measurement(with_values(parameters, values), voltage, times, integrator=integrator)
    rows = zip(model, data, noise, strict=True)
    return jnp.concatenate([(a - b) / sigma for a, b, sigma in rows])
