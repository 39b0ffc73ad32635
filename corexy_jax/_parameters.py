"""Parameters of the machine, Table 1 of the paper."""

from typing import Any, ClassVar

from jaxtyping import Array, Float

from stickslip.checks import Numeric, as_parameter, check_nonnegative, check_positive, refusal
from stickslip.show import AbstractShown

_POSITIVE = ("m", "M", "J", "J_passive", "r", "R", "K_t", "P1", "P2", "g")

TABLE_1 = {
    "m": 0.5,
    "M": 1.0,
    "J": 1e-3,
    "J_passive": 5e-4,
    "r": 0.05,
    "R": 0.9,
    "K_t": 2.0,
    "K_e": 0.03,
    "mu_s": 0.4,
    "mu_k": 0.1,
    "mu_1s_b": 10.0,
    "mu_2s_b": 0.1,
    "mu_1k_b": 0.2,
    "mu_2k_b": 0.2,
    "P1": 20.0,
    "P2": 20.0,
    "g": 9.81,
}


class CoreXYParameters(AbstractShown):
    r"""Everything that describes one CoreXY machine; immutable, in SI units.

    Defaults are Table 1, and for the tensions and the static belt friction, which Table 1 leaves to
    the scenarios, those of scenario 1. To change one, make another object or use
    `equinox.tree_at(lambda p: p.P1, parameters, value)`.

    **Arguments** (keywords; scalars, or arrays to be mapped over):

    - `m`, `M` [kg]: collar and slider. `J`, `J_passive` [kg m²]: motor pulley and passive pulley.
    - `r` [m]: radius of every pulley. `r_f` [m]: arm of the friction of the pulleys on the ground,
      which the paper does not state (erratum A7); `r` if not given.
    - `R` [ohm], `K_t` [N m/A], `K_e` [V s/rad]: the motors. In SI units `K_t` equals `K_e` for a real
      motor; the printed values make the shaft work 66.7 times the electrical work (erratum A11).
      They are kept, so that the mechanical energy balance closes and the electrical one does not.
    - `mu_s`, `mu_k`: static and kinetic friction of all contacts with the ground.
    - `mu_1s_b`, `mu_2s_b`, `mu_1k_b`, `mu_2k_b`: static and kinetic friction of the two belts on the
      motor pulleys.
    - `P1`, `P2` [N]: tensions of the belts. `g` [m/s²].

    **Raises** `ValueError` naming the parameter that is not finite, or not positive, or negative
    where it is a coefficient of friction, `K_e` or `r_f`; `TypeError` for a value that is not a number.

    Source: Table 1 and Table 2.
    """

    m: Float[Array, "..."]
    M: Float[Array, "..."]
    J: Float[Array, "..."]
    J_passive: Float[Array, "..."]
    r: Float[Array, "..."]
    R: Float[Array, "..."]
    K_t: Float[Array, "..."]
    K_e: Float[Array, "..."]
    mu_s: Float[Array, "..."]
    mu_k: Float[Array, "..."]
    mu_1s_b: Float[Array, "..."]
    mu_2s_b: Float[Array, "..."]
    mu_1k_b: Float[Array, "..."]
    mu_2k_b: Float[Array, "..."]
    P1: Float[Array, "..."]
    P2: Float[Array, "..."]
    g: Float[Array, "..."]
    r_f: Float[Array, "..."]

    parameter_units: ClassVar = {
        "m": "kg", "M": "kg", "J": "kg m2", "J_passive": "kg m2", "r": "m", "R": "ohm",
        "K_t": "N m/A", "K_e": "V s/rad", "mu_s": "1", "mu_k": "1", "mu_1s_b": "1",
        "mu_2s_b": "1", "mu_1k_b": "1", "mu_2k_b": "1", "P1": "N", "P2": "N", "g": "m/s2",
        "r_f": "m",
    }  # fmt: skip

    def __init__(self, *, r_f: Numeric | None = None, **values: Numeric):
        unknown = sorted(set(values) - set(TABLE_1))
        if unknown:
            known = f"left out: the parameters of the machine are {', '.join(TABLE_1)}, r_f"
            raise refusal(unknown[0], values[unknown[0]], known, TypeError)
        given = {**TABLE_1, **values}
        given["r_f"] = given["r"] if r_f is None else r_f
        for name, value in given.items():
            setattr(self, name, as_parameter(check_parameter(name, name, value)))


def check_parameter(called: str, name: str, value: Any) -> Any:
    """A value for the parameter `name`, which the caller knows as `called`."""
    check = check_positive if name in _POSITIVE else check_nonnegative
    return check(called, value)
