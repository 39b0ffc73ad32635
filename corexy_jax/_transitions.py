"""Rolling or slipping in the next step, Eqs. (72)-(84).

Wrong arguments raise `ValueError` or `TypeError`.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from stickslip.checks import Whole

from ._arguments import dmn_number, named, pair, the_errata, the_machine
from ._errata import Errata
from ._parameters import CoreXYParameters


class RollingRequirement(NamedTuple):
    r"""What rolling requires: belt forces $f_{is}^b$ [N], coefficients $\mu_{is}^\star$."""

    f_1s: Any
    f_2s: Any
    mu_1s: Any
    mu_2s: Any


def needed_friction(
    p: CoreXYParameters,
    accelerations: tuple[Any, Any],
    torques: tuple[Any, Any],
    ground: tuple[Any, Any],
    errata: Errata | None = None,
) -> RollingRequirement:
    r"""Friction required to keep rolling, Eqs. (77)-(84).

    $$f_{is}^b = J\hat\alpha_i/r - (\tau_i^0 + \tau_i^E)/r, \qquad
      \mu_{is}^\star = |f_{is}^b|/(2P_i)$$

    **Arguments:** ideal angular accelerations [rad/s²] of the motor pulleys, motor torques and
    torques of the ground on the pulleys [N m]. Printed, (81)-(84) multiply the torques by `J` too;
    `errata.A3` corrects it.
    """
    the_machine(p)
    errata = the_errata(errata)
    accelerations = pair("accelerations", accelerations)
    torques, ground = pair("torques", torques), pair("ground", ground)
    inertia = [p.J * a / p.r for a in accelerations]
    load = [(tau_0 + tau) / p.r for tau_0, tau in zip(ground, torques, strict=True)]
    f_1s, f_2s = (i - f for i, f in zip(inertia, load, strict=True))
    share_1, share_2 = (
        f if errata.A3 else i - p.J * t for f, i, t in zip((f_1s, f_2s), inertia, load, strict=True)
    )
    return RollingRequirement(
        f_1s, f_2s, jnp.abs(share_1) / (2.0 * p.P1), jnp.abs(share_2) / (2.0 * p.P2)
    )


def available_coefficients(p: CoreXYParameters, errata: Errata | None = None) -> tuple[Any, Any]:
    """Coefficients up to which the belts hold; as printed the static ones, with A9 corrected
    `max(mu_s, mu_k)`."""
    the_machine(p)
    if errata is not None and not the_errata(errata).A9:
        return p.mu_1s_b, p.mu_2s_b
    return jnp.maximum(p.mu_1s_b, p.mu_1k_b), jnp.maximum(p.mu_2s_b, p.mu_2k_b)


def next_dmn(number: Whole, needed: RollingRequirement, available: tuple[Any, Any]) -> Any:
    """Dynamic model of the next step from rolling motors, Eq. (72) and the cases RR, SR, RS, SS.

    A rolling motor goes on while `mu_is* <= mu_is^b`; a slipping one stays so, whatever is needed:
    it comes back by Eq. (73).
    """
    number = jnp.asarray(dmn_number("number", number), jnp.int32)
    named("needed", needed, RollingRequirement)
    available = pair("available", available)
    rolls_1, rolls_2 = (number == 1) | (number == 3), (number == 1) | (number == 2)
    slips_1 = ~rolls_1 | (needed.mu_1s > available[0])
    slips_2 = ~rolls_2 | (needed.mu_2s > available[1])
    return number_of(slips_1, slips_2)


def number_of(slips_1: Any, slips_2: Any) -> Any:
    """1 RR, 2 SR, 3 RS, 4 SS."""
    return 1 + slips_1.astype(jnp.int32) + 2 * slips_2.astype(jnp.int32)
