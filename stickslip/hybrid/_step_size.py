"""Step-size rules: fixed, or adaptive by an error estimate."""

import abc
from typing import TYPE_CHECKING, Any, ClassVar, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from .._argument_checks import check_arguments, checked_by, number, or_none
from .._types import Numeric
from .._validation import check_at_least, check_that
from ._tolerance import check_tolerances

if TYPE_CHECKING:
    # By this name in this file, or type checkers take class attributes for fields.
    from typing import ClassVar as AbstractClassVar
else:
    from equinox import AbstractClassVar


class AbstractStepSize(eqx.Module):
    """How long the next step may be. Events and output times shorten it further.

    Two kinds exist. A rule that is not `adaptive` takes steps of `initial(None, None, None)` all along,
    and needs nothing else. An adaptive one is an `AbstractAdaptiveStep`.
    """

    adaptive: AbstractClassVar[bool]  # whether the error estimate is used

    @abc.abstractmethod
    def initial(self, y: PyTree, dy: PyTree, scale: PyTree) -> Any:
        """First step length to try [s], a positive float64 scalar; infinite where these do not say.

        `y`, `dy`: state and its slope at the start; `scale`: what an error of 1 means in each leaf of
        `y`, in the order of `jax.tree.leaves`.
        """


class AbstractAdaptiveStep(AbstractStepSize):
    r"""A rule that sets the step by the scaled error $E$ of the last one; $E \le 1$ is accepted.

    $E$ is the root mean square of the error estimates of all components, each divided by its
    `atol + rtol |y|`; see `AdaptiveStep` for `atol=None`. The doubt about an event function replaces it
    where it is larger. Whatever `factor` says, a rejected step becomes shorter by a tenth at least, no
    step is longer than `dtmax`, and one that would have to be shorter than `dtmin` ends the run with
    `RESULTS.dt_min_reached`.

    Your own rule, here one that halves and doubles:

    ```python
    class Doubling(stickslip.AbstractAdaptiveStep):
        rtol: float = 1e-9
        atol: float | None = None
        dtmax: float | None = None
        dtmin: float = 0.0
        remembers: ClassVar = False

        def initial(self, y, dy, scale):
            return jnp.asarray(1e-3)

        def factor(self, error, previous, order):
            return jnp.where(error > 1.0, 0.5, jnp.where(error < 2.0**-order, 2.0, 1.0))
    ```
    """

    if TYPE_CHECKING:
        # A type checker takes what is annotated here for fields, in this order, of every subclass.
        rtol = atol = dtmax = dtmin = cast("Any", None)
        remembers = cast("bool", False)
    else:
        rtol: eqx.AbstractVar[Any]
        atol: eqx.AbstractVar[Any]  # as in `AdaptiveStep`
        dtmax: eqx.AbstractVar[Any]  # [s]; None: as in `AdaptiveStep`
        dtmin: eqx.AbstractVar[Any]  # [s]
        remembers: eqx.AbstractVar[bool]  # whether `factor` depends on the error before the last

    adaptive: ClassVar = True

    @abc.abstractmethod
    def factor(self, error: Numeric, previous: Numeric, order: int) -> Any:
        """Ratio of the next step to this one.

        `error`: scaled error of this step; `previous`: that of the last accepted one, 1 for a step that
        is tried again; `order`: order of the method.
        """


@check_arguments(h=number("positive"))
class FixedStep(AbstractStepSize):
    """Steps of length `h` [s] wherever no event and no output time is nearer.

    Errors: `ValueError` if `h` is not positive and finite.
    """

    h: Numeric

    adaptive: ClassVar = False

    def initial(self, y, dy, scale):
        return jnp.asarray(self.h, jnp.float64)


@check_arguments(
    rtol=number("positive"), atol=checked_by(check_tolerances), dtmin=number("not negative"),
    dtmax=or_none(number("any")), h0=or_none(number("positive")),
)  # fmt: skip
class AdaptiveStep(AbstractAdaptiveStep):
    r"""Steps such that the local error estimate stays below `atol + rtol |y|` in every component.

    `atol` is a number, a mapping from names of components or from units (`{"m": 1e-12, "m/s": 1e-9}`),
    or a pytree like the state. For `None`, the default, and for components that a mapping leaves out,
    the size of the motion itself takes its place: the error of a component stays below `rtol` times its
    largest magnitude so far, but at least 1e-6 of that of the largest component of its kind, and above
    the rounding of the field. So lengths may be in metres or in nanometres. A kind are coordinates and
    velocities, or states of one unit; what has no stated unit is compared with all others. An `atol`
    above 1e-4 of a component's motion is flagged (`Solution.flags`).

    After an accepted step of scaled error `E` the length is multiplied by `0.9 * E**(-1/k)`, kept
    within `[0.2, 10]`, where `k` is the order of the method (Hairer, Nørsett & Wanner II.4). `h0` [s]:
    length of the first step, by default a hundredth of the time in which the state changes. `dtmax` [s]
    bounds the step; infinity means no bound. For `None`, the default, what the error of a step does not
    see is bounded: the time, where the field or an event function depends on it, and components of the
    state that move on whatever they do to others, as the angle of a rotor, where these depend on it by
    more than a line, a parabola or two bends. Such steps are no longer than twice the `time_scale` of
    the system; where it states none, a component goes no farther in one step than 1/36 of its period
    (`periods`), and a time or a component without one lasts no longer than 1/1000 of the run. A
    component that is acted upon by what it drives is bounded so while it moves evenly; else its own
    motion says how long a step is (with a period at most 1/8 of it). An excursion that begins and ends
    within 0.4 of the longest step, or within 1/60 of a period, can be missed. `dtmin` [s]: a step that
    would have to be shorter ends the lane with `RESULTS.dt_min_reached`.

    Errors: `ValueError` if a tolerance is not positive, or `dtmin < 0`, or `dtmax` not above 0 or below
    `dtmin`, or `h0` not positive. If `atol` does not fit the state, `simulate` raises an error.
    """

    rtol: Numeric
    atol: Numeric | PyTree | None = None
    dtmax: Numeric | None = None
    dtmin: Numeric = 0.0
    h0: Numeric | None = None

    remembers: ClassVar = False

    def __check_init__(self):
        if self.dtmax is not None:
            check_that("dtmax", self.dtmax, lambda a: a > 0, "positive (infinity for no bound)")
            check_at_least("dtmax", self.dtmax, "dtmin", self.dtmin)

    def initial(self, y, dy, scale):
        """The given `h0`, else a hundredth of the time in which the state changes by itself; infinite
        where it is zero.

        `scale`: what an error of 1 means in each leaf of `y`.
        """
        if self.h0 is not None:
            return jnp.asarray(self.h0, jnp.float64)

        def square(tree):
            pairs = zip(jax.tree.leaves(tree), scale, strict=True)
            return sum(jnp.sum(jnp.clip(v / s, -1e70, 1e70) ** 2) for v, s in pairs)

        size, rate = square(y), square(dy)
        usable = (size > 1e-10) & (rate > 1e-10)
        return 0.01 * jnp.sqrt(jnp.where(usable, size / rate, jnp.inf))

    def factor(self, error: Numeric, previous: Numeric, order: int) -> Any:
        """Ratio of the next step to this one."""
        logarithm = -1.0 / order * jnp.log(jnp.maximum(error, 1e-10))
        return jnp.clip(0.9 * jnp.exp(logarithm), 0.2, 10.0)
