"""Voltages of the two motors as functions of time, smooth between known breaks."""

import abc
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from stickslip.checks import (
    Check,
    Given,
    Numeric,
    Row,
    as_parameter,
    check_arguments,
    check_callable,
    check_finite,
    check_handed_on,
    check_increasing,
    check_own_methods,
    check_positive,
    is_concrete,
    one_number,
    one_real,
    one_row,
    reals,
    refusal,
    shape_refusal,
)
from stickslip.fastmath import sin_cos, where
from stickslip.show import AbstractShown

VOLTAGES = "an AbstractVoltage, such as ConstantVoltage(v1, v2) or UserVoltage(function)"
NEVER = 1e300  # time of a break that does not come [s]


def pieces(owner: Any, name: str, value: Any) -> Any:
    """Number of a piece, a float without fraction, or an array of them."""
    value = reals(owner, name, value)
    if is_concrete(value):
        array = np.asarray(value)
        fraction = (np.floor(array) != array) & ~np.isnan(array)
        if fraction.any():
            raise refusal(name, array[fraction].flat[0].item(), "the number of a piece, a whole one")
    return value


# What the methods that a voltage defines look at: their arguments in order.
_CHECKED: dict[str, dict[str, Check]] = {
    "volts": {"t": reals, "piece": pieces},
    "piece_of": {"t": reals},
    "piece_end": {"piece": pieces},
}


class AbstractVoltage(AbstractShown):
    """Input $(v_1, v_2)$ [V] of the two motors.

    The time axis is cut into pieces at known breaks; within piece number `piece` the voltages are
    smooth, also a little beyond its ends. Event-driven simulation lands on every break.

    **Raises**, in all methods: `TypeError` for a value that is not a number, `ValueError` for a
    piece that is not a whole one.
    """

    has_breaks: ClassVar[bool] = True

    def __init_subclass__(cls, **kwargs: Any):
        super().__init_subclass__(**kwargs)
        check_own_methods(cls, _CHECKED)

    @abc.abstractmethod
    def volts(self, t: Numeric, piece: Numeric) -> tuple[Any, Any]:
        """Voltages [V] at time `t` [s] as piece number `piece` (a float) has them."""

    @abc.abstractmethod
    def piece_of(self, t: Numeric) -> Any:
        """Number of the piece that begins at or before `t` [s], as a float."""

    @abc.abstractmethod
    def piece_end(self, piece: Numeric) -> Any:
        """Time [s] at which the piece ends."""

    def time_scale(self) -> Any:
        """Shortest time [s] in which the voltages change by their own size within a piece.

        It bounds the steps while the machine rests; `None` if it is not known. By default they are
        taken as constant or linear between their breaks.
        """
        return jnp.inf if self.has_breaks else None

    @check_arguments(t=reals)
    def __call__(self, t: Numeric) -> tuple[Any, Any]:
        """Voltages [V] at time `t` [s]."""
        t = jnp.asarray(t, jnp.float64)
        return self.volts(t, self.piece_of(t))


class ConstantVoltage(AbstractVoltage):
    """The same voltages all the time. **Arguments:** `v1`, `v2` [V], finite."""

    v1: Float[Array, "..."]
    v2: Float[Array, "..."]

    parameter_units: ClassVar = {"v1": "V", "v2": "V"}

    has_breaks: ClassVar[bool] = False

    def __init__(self, v1: Numeric, v2: Numeric):
        self.v1 = as_parameter(check_finite("v1", v1))
        self.v2 = as_parameter(check_finite("v2", v2))

    def volts(self, t, piece):
        return self.v1, self.v2

    def time_scale(self):
        return jnp.inf

    def piece_of(self, t):
        return jnp.zeros_like(t)

    def piece_end(self, piece):
        return jnp.full_like(piece, NEVER)


class Harmonic(AbstractVoltage):
    r"""$v_1 = v_{01}\sin 2\pi f t$, $v_2 = v_{02}\cos 2\pi f t$, the input of scenarios 1 and 2.

    **Arguments:** amplitudes `v01`, `v02` [V]; `frequency` $f$ [Hz], positive. Table 1 gives
    $\omega_v = 0.5$ "rad/s" and uses it as $2\pi\omega_v t$, so it is 0.5 Hz (erratum A5).
    """

    v01: Float[Array, "..."]
    v02: Float[Array, "..."]
    frequency: Float[Array, "..."]

    parameter_units: ClassVar = {"v01": "V", "v02": "V", "frequency": "Hz"}

    has_breaks: ClassVar[bool] = False

    def __init__(self, v01: Numeric, v02: Numeric, frequency: Numeric = 0.5):
        self.v01 = as_parameter(check_finite("v01", v01))
        self.v02 = as_parameter(check_finite("v02", v02))
        self.frequency = as_parameter(check_positive("frequency", frequency))

    def volts(self, t, piece):
        angle = 2 * jnp.pi * self.frequency * t
        sine, cosine = sin_cos(angle)
        return self.v01 * sine, self.v02 * cosine

    def time_scale(self):
        return 1.0 / (2 * jnp.pi * self.frequency)

    def piece_of(self, t):
        return jnp.zeros_like(t)

    def piece_end(self, piece):
        return jnp.full_like(piece, NEVER)


class SquareWave(AbstractVoltage):
    r"""$v_1 = v_{01}\,\mathrm{sign}\sin 2\pi f t$, $v_2 = v_{02}\,\mathrm{sign}\cos 2\pi f t$.

    The piecewise step of scenario 3. The paper prints $\mathrm{sign}|\sin|$, which is constant
    (erratum A6).

    **Arguments:** amplitudes `v01`, `v02` [V]; `frequency` $f$ [Hz], positive. Pieces are quarter
    periods; `t >= 0`.
    """

    v01: Float[Array, "..."]
    v02: Float[Array, "..."]
    frequency: Float[Array, "..."]

    parameter_units: ClassVar = {"v01": "V", "v02": "V", "frequency": "Hz"}

    def __init__(self, v01: Numeric, v02: Numeric, frequency: Numeric = 0.5):
        self.v01 = as_parameter(check_finite("v01", v01))
        self.v02 = as_parameter(check_finite("v02", v02))
        self.frequency = as_parameter(check_positive("frequency", frequency))

    def volts(self, t, piece):
        quarter = piece - 4.0 * jnp.floor(piece / 4.0)
        sine = where(quarter < 2.0, 1.0, -1.0)
        cosine = where((quarter < 1.0) | (quarter >= 3.0), 1.0, -1.0)
        return self.v01 * sine, self.v02 * cosine

    def piece_of(self, t):
        return jnp.floor(4.0 * self.frequency * t)

    def piece_end(self, piece):
        return (piece + 1.0) / (4.0 * self.frequency)


class AbstractTable(AbstractVoltage):
    """Rows of voltages at increasing times; base of what is given by a table."""

    times: Float[Array, " row"]
    v1: Float[Array, " row"]
    v2: Float[Array, " row"]

    parameter_units: ClassVar = {"times": "s", "v1": "V", "v2": "V"}

    def __init__(self, times: Row, v1: Row, v2: Row):
        self.times = as_parameter(check_increasing("times", one_row("times", times, least=2)))
        rows = self.times.shape
        for name, volts in (("v1", v1), ("v2", v2)):
            setattr(self, name, as_parameter(check_finite(name, volts)))
            if getattr(self, name).shape != rows:
                raise shape_refusal(name, volts, f"of shape {rows}, as times")

    def _row(self, piece):
        return jnp.clip(piece, 0.0, self.times.shape[0] - 1.0).astype(jnp.int32)

    @check_arguments(t=one_real)
    def piece_of(self, t):
        after = jnp.sum((self.times <= t).astype(jnp.float64))
        return jnp.maximum(after - 1.0, 0.0)

    def piece_end(self, piece):
        last = self.times.shape[0] - 1
        row = self._row(piece)
        return where(row >= last, NEVER, self.times[jnp.minimum(row + 1, last)])


class PiecewiseStep(AbstractTable):
    """Voltages `v1`, `v2` [V] held from each of `times` [s] to the next, the last for ever.

    Before the first time the first row holds.

    **Raises** `ValueError` for shapes that differ, fewer than two rows, times that do not increase,
    values that are not finite.
    """

    if TYPE_CHECKING:  # which would take the fields for the arguments
        __init__ = AbstractTable.__init__

    def volts(self, t, piece):
        row = self._row(piece)
        return self.v1[row], self.v2[row]


class Sampled(AbstractTable):
    """Samples `v1`, `v2` [V] at `times` [s], linear in between, constant after the last.

    Before the first time the first piece is continued. Errors as for `PiecewiseStep`.
    """

    if TYPE_CHECKING:  # which would take the fields for the arguments
        __init__ = AbstractTable.__init__

    def volts(self, t, piece):
        last = self.times.shape[0] - 1
        row = self._row(piece)
        after = jnp.minimum(row + 1, last)
        span = self.times[after] - self.times[row]
        share = where(row >= last, 0.0, (t - self.times[row]) / where(row >= last, 1.0, span))

        def between(v):
            return v[row] + share * (v[after] - v[row])

        return between(self.v1), between(self.v2)


class Ramps(AbstractTable):
    """Voltages linear between jumps: from each of `times` [s] `v1`, `v2` [V] that change by `slope_1`,
    `slope_2` [V/s] until the next, the last for ever.

    Before the first time the first row is continued. Errors as for `PiecewiseStep`.
    """

    slope_1: Float[Array, " row"]
    slope_2: Float[Array, " row"]

    parameter_units: ClassVar = {**AbstractTable.parameter_units, "slope_1": "V/s", "slope_2": "V/s"}

    def __init__(self, times: Row, v1: Row, v2: Row, slope_1: Row, slope_2: Row):
        super().__init__(times, v1, v2)
        for name, slope in (("slope_1", slope_1), ("slope_2", slope_2)):
            setattr(self, name, as_parameter(check_finite(name, slope)))
            if getattr(self, name).shape != self.times.shape:
                raise shape_refusal(name, slope, f"of shape {self.times.shape}, as times")

    def volts(self, t, piece):
        row = self._row(piece)
        since = t - self.times[row]
        return self.v1[row] + self.slope_1[row] * since, self.v2[row] + self.slope_2[row] * since


class UserVoltage(AbstractVoltage):
    """Voltages from a function `(t, args) -> (v1, v2)` [V], smooth in `t` [s].

    **Arguments:** `function`; `args`, a pytree of its parameters, which may be differentiated;
    `shortest` [s], the shortest time in which the voltages change by their own size. It bounds
    the steps while the machine rests; not given, a pulse shorter than 1/2500 of the run can be missed.
    The voltage itself is called with the time alone, `voltage(t)`: it has its `args`.
    **Raises** `TypeError` unless `function` is callable and gives a pair of numbers, `ValueError` for a
    time that is not positive.
    """

    function: Callable = eqx.field(static=True)
    args: PyTree
    shortest: Numeric | None

    has_breaks: ClassVar[bool] = False

    def __init__(
        self,
        function: Given[Callable[[Any, Any], tuple[Any, Any]]],
        args: PyTree = None,
        shortest: Numeric | None = None,
    ):
        self.function = check_callable("function", function, "f(t, args) -> (v1, v2)", 0.0, args)
        self.args = check_handed_on("args", args)
        gives = eqx.filter_eval_shape(function, jnp.zeros(()), args)
        if not isinstance(gives, tuple | list) or len(gives) != 2 or not all(map(_is_number, gives)):
            pair = "callable as f(t, args) -> (v1, v2), a pair of numbers [V]"
            raise refusal("function", function, pair, TypeError, but=f"which gives {gives!r}")
        if shortest is not None:
            shortest = as_parameter(one_number("shortest", shortest, "positive"))
        self.shortest = shortest

    def time_scale(self):
        return self.shortest

    def volts(self, t, piece):
        v1, v2 = self.function(t, self.args)
        return jnp.asarray(v1, jnp.float64), jnp.asarray(v2, jnp.float64)

    def piece_of(self, t):
        return jnp.zeros_like(t)

    def piece_end(self, piece):
        return jnp.full_like(piece, NEVER)


def _is_number(value: Any) -> bool:
    """Whether it is a real number, or the shape of an array of them."""
    kind = value.dtype.kind if hasattr(value, "dtype") else np.asarray(value).dtype.kind
    return kind in "iuf"
