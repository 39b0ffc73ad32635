"""A time loop as one compiled function, and which loops that is for.

XLA's CPU compiler makes of a loop a list of small functions, one for each operation that it could not
fuse, and walks through the list in every step. In a single run, whose operations are of one number
each, nine tenths of the time go into that walk. A call with the attribute `xla_cpu_small_call` is
compiled to one function instead: a run takes a third to a tenth of the time, and compiles as fast. From
JAX 0.11 on XLA does the same by itself with all small loops; before, with those that touch less than a
kilobyte.

The compiler takes few operations inside, and for many numbers the list is the better form, so a loop is
looked through first.
"""

import math
from typing import Any

import jax
import jax.core
import jax.extend
import jax.numpy as jnp
from jax.experimental.xla_metadata import set_xla_metadata
from jax.interpreters import ad, batching, mlir

from .._jaxpr import equations

# Attributes XLA's CPU compiler reads on a call. `inlineable="false"` keeps a call a call, so that what
# it computes is not recomputed by all that it would be fused into; `xla_cpu_small_call` compiles it to
# one function. Both are internal to XLA: `sweep._canary` proves in a subprocess that this jaxlib still
# honours them.
BOUNDARY = {"inlineable": "false"}
AS_ONE = {**BOUNDARY, "xla_cpu_small_call": "true"}
LOOP_NAME = "fused_time_loop"  # of the call that holds a whole time loop, in a traced program
# From JAX 0.11 on XLA makes small loops one function itself, and knows one way to emit kernels.
OLDER = jax.__version_info__ < (0, 11)

LANES = 64  # whose state fits the first-level cache
# Operations of a step, because larger functions compile for longer in one piece than in many that are
# compiled side by side; and numbers of one operation in all lanes, beyond which the list is as fast.
MOST = LANES * LANES

_CONTROL = frozenset({
    "while", "scan", "cond", "jit", "pjit", "closed_call", "core_call", "custom_jvp_call",
    "custom_vjp_call", "remat2", "checkpoint", "stickslip_alone_or_batched",
})  # fmt: skip
# Rows are written in place, so that the size of a log does not count.
_IN_PLACE = frozenset({"dynamic_update_slice"})
_TAKEN = _CONTROL | _IN_PLACE | frozenset("""
    abs acos acosh add add_any and argmax argmin asin asinh atan atan2 atanh bitcast_convert_type
    broadcast_in_dim cbrt ceil clamp clz concatenate convert_element_type copy copy_p cos cosh div
    dynamic_slice eq erf erf_inv erfc exp exp2 expand_dims expm1 floor gather ge gt integer_pow iota
    is_finite le le_to lgamma log log1p logistic lt lt_to max min mul ne neg nextafter not
    optimization_barrier or pad population_count pow reduce_and reduce_max reduce_min reduce_or
    reduce_precision reduce_prod reduce_sum rem reshape rev round rsqrt select_n shift_left
    shift_right_arithmetic shift_right_logical sign sin sinh slice split sqrt square squeeze stack
    stop_gradient sub tan tanh transpose unvmap_all unvmap_any unvmap_max xor
""".split())  # fmt: skip


def lanes_taken(jaxpr: Any) -> int:
    """How many lanes of a loop the compiler takes as one function with profit; 0: not even one."""
    if jax.default_backend() != "cpu" or jaxpr.effects:
        return 0
    count, largest = 0, 1
    for eqn in equations(jaxpr):
        name = eqn.primitive.name
        count += 1
        if name not in _TAKEN or count > MOST:
            return 0
        if name not in _CONTROL and name not in _IN_PLACE:
            sizes = [math.prod(v.aval.shape) for v in eqn.outvars]
            if not all(isinstance(size, int) for size in sizes):
                return 0  # of an exported program whose batch has any size
            largest = max(largest, *sizes)
    return min(LANES, MOST // largest)


def as_one_call(jaxpr: Any, given: list, lanes: int | None) -> list:
    """Results of a program whose call is compiled to one function; batched over more than so many
    `lanes`, to an ordinary one.

    The compiler aborts the process on such a call with an operand that nothing in it depends on. It
    makes one by moving a constant into the call, which the barrier hides from it, or where a loop
    stops carrying what nobody reads. So one more result depends on all operands, and is asked for
    whenever another is.
    """
    function = jax.extend.core.jaxpr_as_fun(jax.extend.core.ClosedJaxpr(jaxpr, ()))

    def whole(*values):
        return [*function(*values), sum(map(_first_number, values), 0.0)]

    whole.__name__ = LOOP_NAME
    # One barrier for each: of all at once JAX would take derivatives by those that have none too. They
    # would be zeros, and zero times what has no value is no number.
    out = jax.jit(whole)(*map(jax.lax.optimization_barrier, given))
    return _marked_p.bind(*out, lanes=lanes)[:-1]


def _first_number(x: Any) -> Any:
    if jnp.issubdtype(x.dtype, jax.dtypes.extended):  # a random key
        x = jax.random.key_data(x)
    if x.size == 0:
        return 0.0
    return jax.lax.slice(x, (0,) * x.ndim, (1,) * x.ndim).reshape(()).astype(jnp.float64)


def _mark(*results, lanes):
    return set_xla_metadata(list(results), **AS_ONE)


def _batch(results, axes, *, lanes):
    size = next(x.shape[axis] for x, axis in zip(results, axes, strict=True) if axis is not None)
    # An exported program has a batch of any size.
    left = None if lanes is None else lanes // size if isinstance(size, int) else 0
    return results if left == 0 else _marked_p.bind(*results, lanes=left), axes


def _push_forward(results, tangents, *, lanes):
    return _marked_p.bind(*results, lanes=lanes), tangents


# The results of a call, all of which are kept if one is; lowered, it sets the attributes on their call.
_marked_p = jax.extend.core.Primitive("stickslip_as_one")
_marked_p.multiple_results = True
_marked_p.def_impl(lambda *results, lanes: list(results))
_marked_p.def_abstract_eval(lambda *results, lanes: list(results))
ad.primitive_jvps[_marked_p] = _push_forward
batching.primitive_batchers[_marked_p] = _batch
mlir.register_lowering(
    _marked_p, mlir.lower_fun(_mark, multiple_results=True), cacheable=False
)  # fmt: skip
