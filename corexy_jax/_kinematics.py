"""Speeds of the pulleys, Eqs. (4)-(15). Wrong arguments raise `ValueError` or `TypeError`."""

from typing import Any, NamedTuple

from stickslip.checks import Numeric, check_positive

from ._arguments import finite


class PassivePulleys(NamedTuple):
    r"""One number per passive pulley; `theta_1_2` is $\theta_1^2$, pulley 2 of belt 1."""

    theta_1_1: Any
    theta_1_2: Any
    theta_1_3: Any
    theta_1_4: Any
    theta_2_1: Any
    theta_2_2: Any
    theta_2_3: Any
    theta_2_4: Any


def _checked(vx: Any, vy: Any, r: Any) -> list[Any]:
    check_positive("r", r)
    return finite(vx=vx, vy=vy, r=r)


def virtual_pulleys(vx: Numeric, vy: Numeric, r: Numeric) -> tuple[Any, Any]:
    r"""Speeds of the virtual pulleys $\dot\theta_1^v = (\dot x + \dot y)/r$,
    $\dot\theta_2^v = (\dot x - \dot y)/r$ [rad/s], Eqs. (12)-(13), from speeds [m/s]; from
    accelerations [m/s²] the accelerations [rad/s²], Eqs. (14)-(15); from positions the angles."""
    vx, vy, r = _checked(vx, vy, r)
    return (vx + vy) / r, (vx - vy) / r


def passive_pulleys(vx: Numeric, vy: Numeric, r: Numeric) -> PassivePulleys:
    """Speeds of the eight passive pulleys [rad/s], Eqs. (4)-(11), from `vx`, `vy` [m/s] and the radius
    `r` [m]; accelerations from accelerations."""
    vx, vy, r = _checked(vx, vy, r)
    along, against = (vx + vy) / r, (vx - vy) / r
    return PassivePulleys(
        theta_1_1=-vx / r, theta_1_2=along, theta_1_3=along, theta_1_4=vx / r,
        theta_2_1=-vx / r, theta_2_2=against, theta_2_3=against, theta_2_4=vx / r,
    )  # fmt: skip
