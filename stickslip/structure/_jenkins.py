"""Jenkins elements: sliders without mass behind springs, one or many in parallel."""

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from .._argument_checks import check_arguments, count, number
from .._types import Given, Numeric, Row
from .._validation import (
    as_parameter,
    check_callable,
    check_finite,
    check_nonnegative,
    check_positive,
    is_concrete,
    refusal,
    shape_refusal,
)


class Along(eqx.Module):
    """Elongation along a constant direction: by names of coordinates, or by a row of numbers."""

    row: Float[Array, " coordinate"]
    names: tuple[str, ...] | None = eqx.field(static=True)

    def __call__(self, q: Any) -> Any:
        if self.names is not None:
            return sum(c * getattr(q, name) for c, name in zip(self.row, self.names, strict=True))
        if isinstance(q, tuple):
            return sum(c * x for c, x in zip(self.row, q, strict=False))
        return self.row @ q


class Called(eqx.Module):
    """A function of the user, a part of the program."""

    function: Callable = eqx.field(static=True)

    def __call__(self, *given: Any) -> Any:
        return self.function(*given)


def as_called(name: str, value: Any, call: str, *arguments: Any) -> Any:
    """A module with parameters of its own as it is, a function of the user in a `Called`."""
    value = check_callable(name, value, call, *arguments)
    return value if isinstance(value, eqx.Module) else Called(value)


def _along(direction: Any) -> Any:
    if isinstance(direction, Along | Called):
        return direction
    if isinstance(direction, Mapping):
        if not direction or not all(isinstance(name, str) for name in direction):
            raise refusal("direction", direction, "a mapping from names of coordinates to numbers")
        for name, value in direction.items():
            _entry(f"direction[{name!r}]", value)
        row, names = jnp.stack([as_parameter(x) for x in direction.values()]), tuple(direction)
    elif callable(direction):
        return as_called("direction", direction, "direction(q) -> elongation", 0)
    else:
        if np.ndim(check_finite("direction", direction)) != 1:
            raise shape_refusal("direction", direction, "one row, a number for each coordinate")
        row, names = as_parameter(direction), None
    if is_concrete(row) and not np.any(np.asarray(row)):
        raise refusal("direction", direction, "numbers of which one at least is not 0")
    return Along(row, names)


def _entry(name: str, value: Any) -> None:
    check_finite(name, value)
    if np.shape(value) != ():
        raise shape_refusal(name, value, "one number")


class Jenkins(eqx.Module):
    r"""Sliders without mass, each behind a spring, in parallel between two places of a structure.

    With the elongation $e$ of the element and the position $z$ of a slider, each spring bears

    $$f = k_t (e - z), \qquad |f| \le f_s, \qquad
      \dot z = 0 \text{ while } |f| < f_s, \qquad f = f_s\,\mathrm{sgn}\,\dot z \text{ in slip},$$

    set-valued, with nothing rounded. A slider that slips sticks again where the elongation turns. On
    the structure the element acts with $-f$ along the gradient of $e$. Several sliders in parallel are
    an Iwan element, whose loops follow Masing's rule; their program does not grow with their number.

    **Arguments:**

    - `direction`: makes the elongation [m] out of the coordinates: a mapping from their names to
      numbers, as `{"x": 1.0, "y": -1.0}` between two of them or `{"x": 1.0}` to the ground; a row of
      numbers; or a function `direction(q)` that is smooth.
    - `stiffness` $k_t$ [N/m], positive; a row for several sliders.
    - `bound` $f_s = \mu N$ [N], not negative; a row for several. Or a function `bound(t, q, args)` of
      one slider, whose normal force varies with time and place: while it is 0 or less the element is
      open, with the force 0, and its slider follows. With $\mu k_n (y - g)$ a contact closes where $y$
      has gone through the gap $g$, and a preload is a gap below zero.

    Several sliders are kept in the order of their limits $f_s / k_t$. A function may be an
    `equinox.Module` with a method `__call__`: then its numbers are parameters.

    **Raises** `ValueError`, `TypeError` naming the argument.

    ??? cite "Reference"

        W. D. Iwan, *J. Appl. Mech.* 33(4):893, 1966; G. Masing, *Proc. 2nd Int. Congress Applied
        Mechanics*, 1926.
    """

    direction: Any
    stiffness: Float[Array, "..."]
    bound: Any

    def __init__(
        self,
        direction: Given[Mapping[str, float] | Row | Callable],
        stiffness: Numeric | Row,
        bound: Given[Numeric | Row | Callable],
    ):
        self.direction = _along(direction)
        k = as_parameter(check_positive("stiffness", stiffness))
        if callable(bound):
            if k.shape:
                allowed = "one number, where `bound` is a function"
                raise shape_refusal("stiffness", stiffness, allowed)
            self.stiffness = k
            self.bound = as_called("bound", bound, "bound(t, q, args)", 0, 0, 0)
            return
        f = as_parameter(check_nonnegative("bound", bound))
        if k.ndim > 1 or f.ndim > 1:
            name, wrong = ("stiffness", k) if k.ndim > 1 else ("bound", f)
            raise shape_refusal(name, wrong, "one number, or one row with a number for each slider")
        if k.shape and f.shape and k.shape != f.shape:
            raise shape_refusal("bound", bound, f"of the shape of stiffness, {k.shape}")
        k, f = jnp.broadcast_arrays(k, f)
        if k.shape:
            order = jnp.argsort(f / k)
            k, f = k[order], f[order]
        self.stiffness, self.bound = k, f

    @property
    def count(self) -> int:
        """How many sliders there are."""
        return self.stiffness.size

    @property
    def varies(self) -> bool:
        """Whether the bound is a function."""
        return callable(self.bound)

    def bounds(self, t: Numeric, q: PyTree, args: PyTree) -> Float[Array, " slider"]:
        """Largest force of each slider [N]; not positive where the element is open."""
        given = self.bound(t, q, args) if callable(self.bound) else self.bound
        found = jnp.asarray(given, jnp.float64)
        if self.varies and found.shape != ():
            raise shape_refusal("bound(t, q, args)", given, "one number")
        return jnp.ravel(found)


@check_arguments(
    slip_force=number("positive"), stiffness=number("positive"), exponent=number("any"),
    ratio=number("not negative"), sliders=count(2, 10_000),
)  # fmt: skip
def iwan(
    direction: Given[Mapping[str, float] | Row | Callable],
    slip_force: Numeric,
    stiffness: Numeric,
    exponent: Numeric,
    ratio: Numeric,
    sliders: Given[int] = 100,
) -> Jenkins:
    r"""Iwan element by the four parameters of Segalman's joint model, as sliders in parallel.

    Limits $\varphi$ of the springs have the density
    $\rho = R\varphi^\chi$ on $[0, \varphi_m]$ and the rest $S\,\delta(\varphi - \varphi_m)$, so that
    the loss per turn of small loops grows as the force to the power $3 + \chi$; with
    $B = \beta + (\chi + 1)/(\chi + 2)$

    $$\varphi_m = \frac{F_S(1 + \beta)}{K_T B}, \quad
      R = \frac{F_S(\chi + 1)}{\varphi_m^{\chi + 2} B}, \quad S = \frac{F_S\,\beta}{\varphi_m B}$$

    The interval is divided evenly; each part is one slider with its stiffness and its force.

    **Arguments:** `direction` as of `Jenkins`; `slip_force` $F_S$ [N], at which all slip; `stiffness`
    $K_T$ [N/m] of all at rest; `exponent` $\chi$ [-], above -1 and at most 0; `ratio` $\beta$ [-], of
    the stiffness that is lost at once as the last ones slip; `sliders`, their number.
    **Raises** `ValueError`, `TypeError` naming the argument.

    ??? cite "Reference"

        D. J. Segalman, *J. Appl. Mech.* 72(5):752, 2005.
    """
    if is_concrete(exponent) and not -1.0 < float(exponent) <= 0.0:
        raise refusal("exponent", exponent, "above -1 and at most 0")
    chi, beta = as_parameter(exponent), as_parameter(ratio)
    share = beta + (chi + 1.0) / (chi + 2.0)
    most = slip_force * (1.0 + beta) / (stiffness * share)
    ends = jnp.arange(sliders, dtype=jnp.float64) / (sliders - 1)
    # Integrals of the density over each part, and of the density times the limit.
    k = slip_force / (most * share) * jnp.diff(ends ** (chi + 1.0))
    f = slip_force * (chi + 1.0) / (share * (chi + 2.0)) * jnp.diff(ends ** (chi + 2.0))
    rest = slip_force * beta / (most * share)
    if not is_concrete(beta) or float(beta) > 0.0:
        k, f = jnp.append(k, rest), jnp.append(f, rest * most)
    return Jenkins(direction, k, f)
