"""One computation in two forms: a small program for one lane, a fast one for a batch.

Which of them is wanted shows only when the batch comes, and a function that was traced for one lane
is batched later, without its Python code. So both forms are the two readings of one primitive.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.core
import jax.extend
import jax.numpy as jnp
from jax.interpreters import ad, batching, mlir

from .._jaxpr import ProgramOnDemand
from .executor import closed_jaxpr


def alone_or_batched(
    alone: Callable, batched: Callable, functions: Sequence[tuple[Callable, tuple]], *operands: Any
) -> Any:
    """`alone(*functions, *operands)`, and under `vmap` `batched(*functions, *operands)`.

    Both give the same pytree of floats, to rounding. `functions` are those of the caller, each with
    operands of the form it is called with: what they close over may be batched or differentiated
    too. There is a forward derivative and no transpose.
    """
    # A primitive sees arrays only. Arrays that the functions close over are made operands, or `vmap`
    # and `jvp` would not see it.
    opened = [closed_jaxpr(function, examples) for function, examples in functions]
    leaves, form = jax.tree.flatten(([consts for _, consts, _ in opened], operands))
    out_form: Any = None

    def on_leaves(which):
        def run(*leaves):
            nonlocal out_form
            all_consts, operands = jax.tree.unflatten(form, leaves)
            called = [
                _as_function(jaxpr, consts, form)
                for (jaxpr, _, form), consts in zip(opened, all_consts, strict=True)
            ]
            out, out_form = jax.tree.flatten(which(*called, *operands))
            return out

        return jax.jit(run, inline=True)

    # Both forms are jitted functions of leaves: hashable parameters, traced once for all batches.
    leaves = list(map(jnp.asarray, leaves))
    out = _alone_p.bind(
        *leaves, alone=_Alone(on_leaves(alone)), batched=on_leaves(batched), given=(len(leaves), 0)
    )  # fmt: skip
    return jax.tree.unflatten(out_form, out)


class _Alone(ProgramOnDemand):
    """The form for one lane, into which one may look."""

    def __init__(self, function: Callable):
        self.function = jax.jit(function, inline=True)

    def __call__(self, *leaves):
        return self.function(*leaves)

    def program(self, *operands):
        return jax.make_jaxpr(self.function)(
            *(jax.ShapeDtypeStruct(a.shape, a.dtype) for a in operands)
        )


def _as_function(jaxpr: Any, consts: Any, form: Any) -> Callable:
    run = jax.extend.core.jaxpr_as_fun(jax.extend.core.ClosedJaxpr(jaxpr, ()))
    return lambda *operands: jax.tree.unflatten(form, run(*consts, *jax.tree.leaves(operands)))


def _run_alone(*leaves, alone, batched, given):
    return alone(*leaves)


def _shapes(*avals, alone, batched, given):
    out = jax.eval_shape(alone, *(jax.ShapeDtypeStruct(a.shape, a.dtype) for a in avals))
    return [jax.core.ShapedArray(a.shape, a.dtype) for a in out]


def _push_forward(primals, tangents, *, alone, batched, given):
    """The derivative of a form is the derivative of the program that it stands for."""
    # Tangents that are zero stay symbolic: instantiated, each would be differentiated along.
    moving = [type(t) is not ad.Zero for t in tangents]

    def along(form):
        def run(*leaves):
            values, rates = leaves[: len(primals)], leaves[len(primals) :]

            def of_moving(*varied):
                varied = iter(varied)
                pairs = zip(values, moving, strict=True)
                return form(*(next(varied) if moves else value for value, moves in pairs))

            varied = [value for value, moves in zip(values, moving, strict=True) if moves]
            out, rates = jax.jvp(of_moving, varied, list(rates))
            return [*out, *rates]

        return jax.jit(run, inline=True)

    rates = [t for t, moves in zip(tangents, moving, strict=True) if moves]
    # Values of the leading leaves if this is the first derivative; they decide.
    deciding, decided = given
    if deciding == len(primals):
        decided = len(_shapes(*map(jax.typeof, primals), alone=alone, batched=batched, given=given))
    given = deciding, decided
    out = _alone_p.bind(
        *primals, *rates, alone=_Alone(along(alone)), batched=along(batched), given=given
    )
    return out[: len(out) // 2], out[len(out) // 2 :]


def _batch(leaves, axes, *, alone, batched, given):
    """One lane with a batch of tangents is still one lane, and its values are not a batch."""
    # A batch of the leading leaves is a batch of lanes. A batch of the others alone is `jacfwd`: one
    # lane, many tangents, for which the small program is the right one.
    deciding, decided = given
    if any(axis is not None for axis in axes[:deciding]):
        out = jax.vmap(batched, in_axes=tuple(axes))(*leaves)
        return out, [0] * len(out)

    def together(form):
        def run(*leaves):
            pairs = [*zip(leaves, axes, strict=True)]
            if any(axis is not None and x.shape[axis] == 0 for x, axis in pairs):  # no tangents
                one = (x if axis is None else jnp.zeros_like(x).sum(axis) for x, axis in pairs)
                out = form(*one)
                return [*out[:decided], *(x[None][:0] for x in out[decided:])]
            out = jax.vmap(form, in_axes=tuple(axes))(*leaves)
            # The values are the same for all tangents; unbatched, the loop around stays that of a lane.
            return [*(value[0] for value in out[:decided]), *out[decided:]]

        return jax.jit(run, inline=True)

    out = _alone_p.bind(*leaves, alone=_Alone(together(alone)), batched=together(batched), given=given)
    return out, [None] * decided + [0] * (len(out) - decided)


_alone_p = jax.extend.core.Primitive("stickslip_alone_or_batched")
_alone_p.multiple_results = True
# Run or lowered as it is, it was not batched. There is no transpose: the reverse sweep is written out
# in `_adjoint.py` and asks for the two forms of `vjp` itself.
_alone_p.def_impl(_run_alone)
_alone_p.def_abstract_eval(_shapes)
ad.primitive_jvps[_alone_p] = _push_forward
batching.primitive_batchers[_alone_p] = _batch
mlir.register_lowering(_alone_p, mlir.lower_fun(_run_alone, multiple_results=True))
