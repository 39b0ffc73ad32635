"""Elementary functions for vector fields that run inside one compiled loop.

XLA's CPU backend compiles a loop over fixed-size lanes into straight vector code only if its body
holds no call. `jnp.where`, `jnp.sign` and friends are jitted functions and become calls, the
library exponential is slower than a polynomial in line, and `tanh`, `cosh` and `pow` are slower
still. These functions are built from `lax` primitives alone and is exact enough to replace them.
"""

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, ArrayLike, Bool, Float, Real

# Scope of comparisons inside of what is smooth all the same, or bends only where a mode ends: a run
# does not look for bends there.
SMOOTH = "smooth_all_the_same"

_LOG2_E = 1.4426950408889634
# ln 2 in two parts; the first has 21 trailing zero bits, so its product with any exponent is exact.
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
# Adding it to an integral float leaves the integer in the low bits of the sum.
_INTEGER_BITS = 6755399441055744.0  # 1.5 * 2**52
_MANTISSA_BITS = 52
# Outside, the result would leave the range of normal numbers and the bit arithmetic its meaning.
_EXP_MIN, _EXP_MAX = -708.0, 709.0
# exp(f) = 1 + f + f^2 q(f) on |f| <= ln(2)/2, q interpolated in the ten Chebyshev points of that
# interval: the polynomial is wrong by 3.3e-17 at most, four hundred times less than Taylor's.
_C2, _C3 = 0.5, 1 / 6
_C4, _C5 = 0.041666666666624164, 0.008333333333330065
_C6, _C7 = 0.0013888888917196719, 0.00019841269863040545
_C8, _C9 = 2.4801521322368692e-05, 2.7557268480310024e-06
_C10, _C11 = 2.7620075879983367e-07, 2.5100375832561234e-08

# Half of pi in three parts; the first two have 33 bits, so their product with a count below 2**20 is
# exact.
_TWO_OVER_PI = 0.6366197723675814
_HALF_PI = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
# sin(f) = f + f^3 s(f^2), cos(f) = 1 - f^2/2 + f^4 c(f^2) on |f| <= pi/4, interpolated in the six
# Chebyshev points of f^2: wrong by 1.4e-17 at most.
_SIN_0, _SIN_1, _SIN_2 = -0.16666666666666666, 0.008333333333330943, -0.0001984126983674956
_SIN_3, _SIN_4, _SIN_5 = 2.755731609787775e-06, -2.5051130870968297e-08, 1.591805913698281e-10
_COS_0, _COS_1 = 0.041666666666666664, -0.0013888888888887393
_COS_2, _COS_3 = 2.4801587298760048e-05, -2.755731726880539e-07
_COS_4, _COS_5 = 2.0876145659059344e-09, -1.1382588535352522e-11


def where(
    condition: Bool[ArrayLike, "..."], yes: Real[ArrayLike, "..."], no: Real[ArrayLike, "..."]
) -> Real[Array, "..."]:
    """`jnp.where` as one `lax.select`, with scalars broadcast."""
    dtype = jnp.result_type(yes, no)
    shape = lax.broadcast_shapes(jnp.shape(condition), jnp.shape(yes), jnp.shape(no))
    condition, yes, no = (
        jnp.broadcast_to(x, shape)
        for x in (
            condition,
            lax.convert_element_type(yes, dtype),
            lax.convert_element_type(no, dtype),
        )
    )
    return lax.select(condition, yes, no)


@jax.named_scope(SMOOTH)
def side_of(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """+1 for x >= 0, else -1; unlike a sign it keeps the slope of `side * f(side * x)` at 0."""
    return lax.select(x < 0, lax.full_like(x, -1.0), lax.full_like(x, 1.0))


def _scaled_polynomial(z: Float[Array, "..."]) -> Float[Array, "..."]:
    z = lax.clamp(_EXP_MIN, z, _EXP_MAX)
    # The rounding must be `lax.round`: XLA folds (x + 1.5 * 2**52) - 1.5 * 2**52 to x. And the bits
    # must come from the rounded number, lest the two disagree where x lies between two integers.
    n = lax.round(z * _LOG2_E, lax.RoundingMethod.TO_NEAREST_EVEN)
    f = (z - n * _LN2_HIGH) - n * _LN2_LOW
    f2 = f * f
    f4 = f2 * f2
    low = (1.0 + f) + f2 * (_C2 + f * _C3)
    middle = (_C4 + f * _C5) + f2 * (_C6 + f * _C7)
    high = (_C8 + f * _C9) + f2 * (_C10 + f * _C11)
    mantissa = lax.bitcast_convert_type(low + f4 * (middle + f4 * high), jnp.int64)
    exponent = lax.bitcast_convert_type(n + _INTEGER_BITS, jnp.int64)
    exponent = lax.shift_left(exponent, lax.full_like(exponent, _MANTISSA_BITS))
    return lax.bitcast_convert_type(mantissa + exponent, jnp.float64)


@jax.custom_jvp
def exp(z: Float[Array, "..."]) -> Float[Array, "..."]:
    """Exponential with a relative error below 4e-16 for z in [-708, 709].

    A polynomial on [-ln 2/2, ln 2/2] and an addition to the exponent bits: no call, one vector
    instruction per operation. Beyond the range it saturates at exp(-708) = 3.3e-308 and
    exp(709) = 8.2e307; NaN stays NaN; exp(0) is exactly 1. Derivatives of every order are exact
    multiples of the value. Other precisions than float64 take the library function.

    Method: range reduction after Cody and Waite (Software Manual for the Elementary Functions,
    1980), polynomial evaluated after Estrin (1960).
    """
    return _scaled_polynomial(z) if z.dtype == jnp.float64 else lax.exp(z)


@exp.defjvp
def _exp_jvp(primals, tangents):
    value = exp(primals[0])
    return value, value * tangents[0]


def tanh(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Hyperbolic tangent from one exponential and one division; absolute error below 3e-16.

    Odd to the last bit, 0 at 0 and slope 1 there, never outside [-1, 1].
    """
    side = side_of(x)
    decay = exp(side * x * -2.0)
    return side * (1.0 - decay) / (1.0 + decay)


@jax.custom_jvp
def power(
    base: Float[Array, "..."], exponent: Float[Array, "..."], odd: Bool[Array, "..."]
) -> Float[Array, "..."]:
    """`|base|^exponent`, times the sign of `base` where `odd`: a power for bases of both signs.

    With `odd` false for even integers and true otherwise, it continues the power of a positive base
    to negative ones as smoothly as the exponent allows: integer powers come out as polynomials. The
    derivatives at zero are the limits from the right, and 0 where that has no bound: a base that is
    zero at an event is so whatever the parameters, and an infinite slope times none is NaN.
    """
    magnitude = lax.pow(lax.abs(base), exponent)
    return where(odd, lax.sign(base) * magnitude, magnitude)


@power.defjvp
def _power_jvp(primals, tangents):
    base, exponent, odd = primals
    value = power(base, exponent, odd)
    # A constant has no lower power: any finite one does, as the factor is zero.
    lower = exponent * power(base, where(exponent == 0, 1.0, exponent - 1.0), ~odd)
    lower = where((base == 0) & (exponent < 1.0), 0.0, lower)
    log_base = lax.log(where(base == 0, 1.0, lax.abs(base)))
    return value, lower * tangents[0] + value * log_base * tangents[1]


def _sin_cos(x: Float[Array, "..."]) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    n = lax.round(x * _TWO_OVER_PI, lax.RoundingMethod.TO_NEAREST_EVEN)
    f = ((x - n * _HALF_PI[0]) - n * _HALF_PI[1]) - n * _HALF_PI[2]
    u = f * f
    u2 = u * u
    odd = (_SIN_0 + u * _SIN_1) + u2 * ((_SIN_2 + u * _SIN_3) + u2 * (_SIN_4 + u * _SIN_5))
    even = (_COS_0 + u * _COS_1) + u2 * ((_COS_2 + u * _COS_3) + u2 * (_COS_4 + u * _COS_5))
    sine, cosine = f + f * u * odd, (1.0 - 0.5 * u) + u2 * even
    quarter = n - 4.0 * lax.floor(n * 0.25)
    swap = (quarter == 1.0) | (quarter == 3.0)
    s, c = where(swap, cosine, sine), where(swap, sine, cosine)
    return where(quarter >= 2.0, -s, s), where((quarter == 1.0) | (quarter == 2.0), -c, c)


@jax.custom_jvp
def sin(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Sine with an absolute error below 3e-16 for |x| up to 1e6: arithmetic alone, no call.

    Exactly 0 at 0; NaN and infinities give NaN. Other precisions than float64 take the library
    function. Method: reduction to [-pi/4, pi/4] after Cody and Waite (1980), as in `exp`.
    """
    return _sin_cos(x)[0] if x.dtype == jnp.float64 else lax.sin(x)


@sin.defjvp
def _sin_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    return sin(x), cos(x) * dx


@jax.custom_jvp
def sin_cos(x: Float[Array, "..."]) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """`sin(x), cos(x)`, which have almost all of their work in common, derivatives included."""
    return _sin_cos(x) if x.dtype == jnp.float64 else (lax.sin(x), lax.cos(x))


@sin_cos.defjvp
def _sin_cos_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    s, c = sin_cos(x)
    return (s, c), (c * dx, -s * dx)


@jax.custom_jvp
def cos(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Cosine, as `sin`."""
    return _sin_cos(x)[1] if x.dtype == jnp.float64 else lax.cos(x)


@cos.defjvp
def _cos_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    return cos(x), -sin(x) * dx
