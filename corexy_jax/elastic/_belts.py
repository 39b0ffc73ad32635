"""Toothed belts as springs: the frame that they run around, their spans, tensions and energy."""

from typing import Any, NamedTuple

import equinox as eqx
from jaxtyping import Array, Float

from stickslip import positive_part
from stickslip.checks import Given, Numeric, as_parameter, check_nonnegative, check_positive, check_type

from .._arguments import finite
from .._parameters import CoreXYParameters


class Spans(NamedTuple):
    """A number for each span: `a` pulls the collar along the travel of its belt, `b` against it."""

    one_a: Any
    one_b: Any
    two_a: Any
    two_b: Any


class Frame(eqx.Module):
    r"""Where the belts of a CoreXY run, seen from above; `x` to the right, `y` to the rear.

        motor 2  o-----------------o  motor 1      y = depth
                 |                 |
                 o====[collar]=====o               the slider with two idlers of each belt
                 |                 |
                 o-----------------o               two idlers of each belt, y = 0
               x = 0            x = width

    Belt 1 goes from motor 1 to the right end of the slider and the collar (span 1a), and from the
    collar to the left end, around the front and back to the motor (1b). Its travel $s_1 = x + y$
    shortens the one and lengthens the other. Belt 2 is its mirror image, $s_2 = x - y$: from motor 2
    around the front and by the right end to the collar (2a), and from there by the left end back (2b).

    $$L_{1a} = w + d - x - y, \quad L_{1b} = w + d + x + y, \quad
      L_{2a} = 2w + d - x + y, \quad L_{2b} = d + x - y$$

    **Arguments:** `width` $w$, `depth` $d$ [m], positive; `x`, `y`: where in the frame the collar is
    when the coordinates of the machine are 0 [m], by default in the middle. **Raises** `ValueError`,
    `TypeError` naming the argument.
    """

    width: Float[Array, "..."]
    depth: Float[Array, "..."]
    x: Float[Array, "..."]
    y: Float[Array, "..."]

    def __init__(
        self, width: Numeric, depth: Numeric, x: Numeric | None = None, y: Numeric | None = None
    ):
        self.width = as_parameter(check_positive("width", width))
        self.depth = as_parameter(check_positive("depth", depth))
        self.x = 0.5 * self.width if x is None else as_parameter(check_positive("x", x))
        self.y = 0.5 * self.depth if y is None else as_parameter(check_positive("y", y))

    def lengths(self, x: Numeric, y: Numeric) -> Spans:
        """Lengths of the spans [m] with the machine at `x`, `y` [m]."""
        x, y = finite(x=x, y=y)
        x, y = self.x + x, self.y + y
        around = self.width + self.depth
        return Spans(around - x - y, around + x + y, around + self.width - x + y, self.depth + x - y)


class Belts(eqx.Module):
    r"""Two belts of stiffness $EA$ in a frame, with the tensions $P$ of the machine.

    With the stretch $e_i = r\theta_i - s_i$, what the motor takes in and the collar does not follow,

    $$T_a = \max\left(P + \frac{EA}{L_a}(e + \tau\dot e),\ 0\right), \qquad
      T_b = \max\left(P - \frac{EA}{L_b}(e + \tau\dot e),\ 0\right),$$

    a span that would have to push is slack. As long as none is, the stiffness is
    $k = EA(1/L_a + 1/L_b)$. The lengths depend on the position, and a force on it comes from that:
    $T(2P - T)/(2EA)$ by the length of each span, with $T$ at rest.

    **Arguments**

    - `frame`: a `Frame`. `EA_1`, `EA_2`: stiffness of the belts [N], the force at which one would be
      twice as long; data sheets give it by the width.
    - `retardation` $\tau$ [s]: damping of the material (Kelvin and Voigt), not negative. Of a
      vibration of frequency $\omega$ it is the part $\frac12\omega\tau$ of the critical one.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """

    frame: Frame
    EA_1: Float[Array, "..."]
    EA_2: Float[Array, "..."]
    retardation: Float[Array, "..."]

    def __init__(self, frame: Given[Frame], EA_1: Numeric, EA_2: Numeric, retardation: Numeric = 0.0):
        self.frame = check_type("frame", frame, Frame, "a Frame")
        self.EA_1 = as_parameter(check_positive("EA_1", EA_1))
        self.EA_2 = as_parameter(check_positive("EA_2", EA_2))
        self.retardation = as_parameter(check_nonnegative("retardation", retardation))

    def stiffness(self, x: Numeric, y: Numeric) -> tuple[Any, Any]:
        """Stiffness of both belts [N/m] at a position [m], while no span is slack."""
        one_a, one_b, two_a, two_b = self.frame.lengths(x, y)
        return self.EA_1 * (1.0 / one_a + 1.0 / one_b), self.EA_2 * (1.0 / two_a + 1.0 / two_b)


def span_tensions(
    belts: Belts, p: CoreXYParameters, x: Any, y: Any, stretch: tuple, rate: tuple = (0.0, 0.0)
) -> Spans:
    """Tension of each span [N], 0 where it is slack: at a position [m], by the `stretch` of both belts
    [m] and its `rate` [m/s]."""
    lengths = belts.frame.lengths(x, y)
    one, two = (e + belts.retardation * v for e, v in zip(stretch, rate, strict=True))
    pulls = (belts.EA_1 * one, -belts.EA_1 * one, belts.EA_2 * two, -belts.EA_2 * two)
    parts = zip((p.P1, p.P1, p.P2, p.P2), pulls, lengths, strict=True)
    return Spans(*(positive_part(P + pull / length) for P, pull, length in parts))


def belt_forces(
    belts: Belts, p: CoreXYParameters, x: Any, y: Any, stretch: tuple, rate: tuple
) -> tuple[Any, Any, tuple]:
    """What pulls the collar along the travel of either belt [N], and the forces on it along the travels
    that come from the change of the lengths [N]."""
    now = span_tensions(belts, p, x, y, stretch, rate)
    still = span_tensions(belts, p, x, y, stretch)

    def by_length(P, EA, a, b):
        return (a * (2.0 * P - a) - b * (2.0 * P - b)) / (2.0 * EA)

    moved = (
        by_length(p.P1, belts.EA_1, still.one_a, still.one_b),
        by_length(p.P2, belts.EA_2, still.two_a, still.two_b),
    )
    return now.one_a - now.one_b, now.two_a - now.two_b, moved


def strain_energy(belts: Belts, p: CoreXYParameters, x: Any, y: Any, stretch: tuple) -> Any:
    """Strain energy of all spans [J], above that of the belts at rest."""
    parts = zip(
        span_tensions(belts, p, x, y, stretch), belts.frame.lengths(x, y),
        (belts.EA_1, belts.EA_1, belts.EA_2, belts.EA_2), (p.P1, p.P1, p.P2, p.P2), strict=True,
    )  # fmt: skip
    return sum(0.5 * (T**2 - P**2) * length / EA for T, length, EA, P in parts)
