"""The three scenarios of the paper, Table 2."""

from typing import NamedTuple

import jax.numpy as jnp

from stickslip.checks import check_count, check_in, check_type

from ._errata import Errata
from ._parameters import CoreXYParameters
from ._voltage import AbstractVoltage, Harmonic, PiecewiseStep, SquareWave


class Scenario(NamedTuple):
    """A machine and its input."""

    parameters: CoreXYParameters
    voltage: AbstractVoltage


def scenario(number: int, errata: Errata | None = None) -> Scenario:
    """Scenario 1, 2 or 3 of Table 2.

    The input of scenario 3 is `v0 sign(sin)`, `v0 sign(cos)`; with `errata` given and its `A6` false
    it is `v0 sign|sin|` as printed, which is constant. **Raises** `ValueError` for another number.
    """
    check_in("number", check_count("number", number, 1), (1, 2, 3))
    check_type("errata", errata, Errata | None, "an Errata or None")
    if number == 1:
        return Scenario(
            CoreXYParameters(P1=20.0, P2=20.0, mu_1s_b=10.0, mu_2s_b=0.1), Harmonic(10.0, 5.0)
        )
    if number == 2:
        return Scenario(
            CoreXYParameters(P1=30.0, P2=30.0, mu_1s_b=0.001, mu_2s_b=0.001), Harmonic(20.0, 10.0)
        )
    voltage = SquareWave(20.0, 10.0)
    if errata is not None and not errata.A6:
        voltage = PiecewiseStep(jnp.array([0.0, 1.0]), jnp.full(2, 20.0), jnp.full(2, 10.0))
    return Scenario(CoreXYParameters(P1=20.0, P2=30.0, mu_1s_b=10.0, mu_2s_b=10.0), voltage)
