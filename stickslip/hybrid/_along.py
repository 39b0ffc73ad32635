"""Results of a run and their slopes along directions, as one primitive with several readings.

Forward mode takes results and slopes from one pass. Reverse mode takes the results first, then a linear
map of the directions that has a transpose; which of them is wanted shows only as JAX takes a program
apart. The primitive also decides where directions lie in memory. `jax.jacfwd` batches over them, and
a batch of lanes around it comes outside: the numbers of a time step would be `[lanes, directions]`, and
a vector of the processor would hold the few directions of one lane. So a batch of directions is kept
apart until the lanes come, which go inside: `[directions, lanes]`.

Not public in JAX: the registries of partial evaluation, by which a primitive says what is known of it.
"""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.core
import jax.extend
import jax.numpy as jnp
from jax.interpreters import ad, batching, mlir
from jax.interpreters import partial_eval as pe
from jaxtyping import PyTree

from .._jaxpr import ProgramOnDemand
from .executor import ALONG_NAME

NO_SECOND = (
    "second derivatives of a simulation (the event times are corrected to first order only); use "
    "Gauss-Newton, or finite differences of the gradient"
)


def along(
    directions: PyTree, operands: PyTree, like: tuple[PyTree, PyTree], both: Callable,
    results: Callable, slopes: Callable, pull: Callable,
) -> tuple[PyTree, PyTree]:  # fmt: skip
    """Results, which depend on the `operands` alone, and slopes, which are linear in the `directions`.

    All are pytrees of arrays. `like` has the shapes and types of results and slopes: to ask one of the
    functions for them would be to trace it, and most of the time another one is wanted.

    **Arguments**, readings of one map: `both(directions, operands)`, results and slopes in one pass;
    `results(operands)`; `slopes(directions, operands, results)`; and its transpose
    `pull(wanted, bars, operands, results)`, of cotangents `bars` of the slopes that are None where they
    are zero, in the form of the directions, for those that are `wanted`.
    """
    moving, moving_form = jax.tree.flatten(directions)
    others, other_form = jax.tree.flatten(operands)
    (found_like, found_form), (rates_like, rates_form) = map(jax.tree.flatten, like)
    n, split = len(moving), len(moving) + len(others)

    def both_of(*leaves):
        return jax.tree.leaves(
            both(moving_form.unflatten(leaves[:n]), other_form.unflatten(leaves[n:]))
        )

    def results_of(*others):
        return jax.tree.leaves(results(other_form.unflatten(others)))

    def slopes_of(*leaves):
        given = moving_form.unflatten(leaves[:n]), other_form.unflatten(leaves[n:split])
        return jax.tree.leaves(slopes(*given, found_form.unflatten(leaves[split:])))

    def pull_of(wanted, bars, others):
        known = other_form.unflatten(others[: split - n]), found_form.unflatten(others[split - n :])
        bars = pull(moving_form.unflatten(wanted), rates_form.unflatten(bars), *known)
        return moving_form.flatten_up_to(bars)

    # A jitted function of leaves is traced once, whatever asks for it.
    once = functools.partial(jax.jit, inline=True)
    maps = _Maps(once(both_of), once(results_of), once(slopes_of), pull_of)
    found, rates = (tuple(map(_shape, row)) for row in (found_like, rates_like))
    out = _along_p.bind(*moving, *others, request=_Request(maps, n, found, rates))
    number = len(found_like)
    return found_form.unflatten(out[:number]), rates_form.unflatten(out[number:])


def _shape(like: jax.ShapeDtypeStruct | jax.core.ShapedArray, *sizes: int) -> jax.core.ShapedArray:
    """Shape and type, with axes of these sizes in front."""
    return jax.core.ShapedArray((*sizes, *like.shape), like.dtype)


@dataclasses.dataclass(frozen=True, eq=False)
class _Maps:
    """The readings, as functions of leaves: directions, operands, then results where they are known."""

    run: Callable  # results and slopes; of the linear map the slopes alone
    results: Callable
    slopes: Callable
    pull: Callable  # (which are wanted, cotangents, all leaves but the directions)

    def linear(self) -> "_Maps":
        return dataclasses.replace(self, run=self.slopes)

    def of_lanes(self, number: int, axes: Sequence) -> "_Maps":
        """The same for a batch of lanes along `axes` of the leaves, the first `number` directions."""

        def lanes(function, axes):
            # Results that are given as leaves have their lanes in front.
            def run(*leaves):
                rest = [0] * (len(leaves) - len(axes))
                return jax.vmap(function, in_axes=(*axes, *rest))(*leaves)

            return jax.jit(run, inline=True)

        def pull(wanted, bars, others):
            rest = [0] * (len(others) - len(axes) + number)
            each = jax.vmap(
                lambda bars, others: self.pull(wanted, bars, others), (0, [*axes[number:], *rest])
            )
            found = each(bars, [*others])
            # Lanes share a direction that has none: its cotangent is the sum of theirs.
            pairs = zip(found, axes, strict=False)
            return [x if x is None or axis is not None else jnp.sum(x, 0) for x, axis in pairs]

        results = lanes(self.results, axes[number:])
        return _Maps(lanes(self.run, axes), results, lanes(self.slopes, axes), pull)


@dataclasses.dataclass(frozen=True)
class _Request(ProgramOnDemand):
    """A request: the readings, and how operands and what is returned divide."""

    maps: _Maps
    directions: int  # how many of the operands are directions
    found: tuple[jax.core.ShapedArray, ...]  # the results that are returned; none of the linear map
    slopes: tuple[jax.core.ShapedArray, ...]  # the slopes along one direction
    many: bool = False  # whether directions have an axis of their own in front

    @property
    def results(self) -> int:
        return len(self.found)

    def linear(self) -> "_Request":
        return dataclasses.replace(self, maps=self.maps.linear(), found=())

    def of_lanes(self, size: int, axes: Sequence) -> "_Request":
        def lanes(row):
            return tuple(_shape(a, size) for a in row)

        maps = self.maps.of_lanes(self.directions, axes)
        return dataclasses.replace(self, maps=maps, found=lanes(self.found), slopes=lanes(self.slopes))

    def run(self, *leaves):
        n = self.directions
        if not self.many:
            return self.maps.run(*leaves)
        if leaves[0].shape[0] == 0:  # no directions, as of `jacfwd` by an empty array
            found = self.maps.results(*leaves[n:]) if self.results else ()
            return [*found, *(jnp.zeros((0, *a.shape), a.dtype) for a in self.slopes)]
        out = jax.vmap(lambda *moving: self.maps.run(*moving, *leaves[n:]))(*leaves[:n])
        # The results are the same for all directions.
        return [*(x[0] for x in out[: self.results]), *out[self.results :]]

    def program(self, *operands):
        return _program_of(self, tuple(jax.ShapeDtypeStruct(a.shape, a.dtype) for a in operands))


@functools.lru_cache(maxsize=32)
def _program_of(request: _Request, operands: tuple) -> Any:
    return jax.make_jaxpr(request.run)(*operands)


def _run(*leaves, request):
    return jax.extend.core.jaxpr_as_fun(request.program(*leaves))(*leaves)


def _shapes(*avals, request):
    many = avals[0].shape[:1] if request.many else ()
    return [*request.found, *(_shape(a, *many) for a in request.slopes)]


def _batch(leaves, axes, *, request):
    """A batch of the directions alone is one of directions, any other is one of lanes."""
    n = request.directions
    pairs = [*zip(leaves, axes, strict=True)]
    size = next(x.shape[axis] for x, axis in pairs if axis is not None)
    if all(axis is None for axis in axes[n:]):
        moving = [batching.bdim_at_front(x, axis, size) for x, axis in pairs[:n]]
        many = moving[0].shape[: 1 + request.many]
        moving = [x.reshape(-1, *x.shape[len(many) :]) for x in moving]
        out = _along_p.bind(*moving, *leaves[n:], request=dataclasses.replace(request, many=True))
        slopes = [x.reshape(*many, *x.shape[1:]) for x in out[request.results :]]
        return [*out[: request.results], *slopes], [None] * request.results + [0] * len(slopes)
    inside = [
        x if axis is None else jnp.moveaxis(x, axis, 1 if request.many and i < n else 0)
        for i, (x, axis) in enumerate(pairs)
    ]
    lanes = request.of_lanes(size, [None if axis is None else 0 for axis in axes])
    out = _along_p.bind(*inside, request=lanes)
    return out, [0] * request.results + [int(request.many)] * (len(out) - request.results)


def _push_forward(primals, tangents, *, request):
    n = request.directions
    if any(type(t) is not ad.Zero for t in tangents[n:]):
        raise NotImplementedError(f"stickslip.simulate does not offer {NO_SECOND}.")
    moving = map(ad.instantiate_zeros, tangents[:n])
    out, along = (_along_p.bind(*m, *primals[n:], request=request) for m in (primals[:n], moving))
    still = (ad.Zero(jax.typeof(x).to_tangent_aval()) for x in out[: request.results])
    return out, [*still, *along[request.results :]]


def _pull_back(bars, *leaves, request):
    n = request.directions
    wanted = [ad.is_undefined_primal(x) for x in leaves[:n]]
    bars = [None if type(bar) is ad.Zero else bar for bar in bars]

    def of_one(bars):
        return request.maps.pull(wanted, bars, leaves[n:])

    return [*(jax.vmap(of_one) if request.many else of_one)(bars), *[None] * (len(leaves) - n)]


def _partly_known(trace, *tracers, request):
    """Of directions that are not known yet the results are known, and the slopes a linear map."""
    others = [t.pval.get_known() for t in tracers[request.directions :]]
    if request.results == 0 or any(x is None for x in others):
        return trace.default_process_primitive(_along_p, tracers, {"request": request})
    found = request.maps.results(*others)
    given = [*tracers, *map(trace.to_jaxpr_tracer, found)]
    return [*found, *trace.default_process_primitive(_along_p, given, {"request": request.linear()})]


def _cut_in_two(saveable, unknown, given, eqn):
    """The same for a program that is cut in two, as by `jax.checkpoint`, which computes the results in
    both parts."""
    request, n = eqn.params["request"], eqn.params["request"].directions
    flags = [any(unknown)] * len(eqn.outvars)
    pairs = zip(eqn.invars, given, strict=True)
    kept = [x for x, has in pairs if not has and not isinstance(x, jax.extend.core.Literal)]
    if not any(unknown):
        return eqn, None, flags, flags, []
    if request.results == 0 or any(unknown[n:]):
        return None, eqn, flags, flags, kept
    found, slopes = eqn.outvars[: request.results], eqn.outvars[request.results :]
    maps = dataclasses.replace(request.maps, run=request.maps.results)
    alone = _Request(maps, 0, request.found, ())
    now = eqn.replace(invars=eqn.invars[n:], outvars=found, params={"request": alone})
    unread = [jax.extend.core.DropVar(x.aval) for x in found]
    flags = [False] * len(found) + [True] * len(slopes)
    return now, eqn.replace(outvars=[*unread, *slopes]), flags, flags, kept


_along_p = jax.extend.core.Primitive(ALONG_NAME)
_along_p.multiple_results = True
_along_p.def_impl(_run)
_along_p.def_abstract_eval(_shapes)
ad.primitive_jvps[_along_p] = _push_forward
ad.primitive_transposes[_along_p] = _pull_back
batching.primitive_batchers[_along_p] = _batch
pe.custom_partial_eval_rules[_along_p] = _partly_known
pe.partial_eval_jaxpr_custom_rules[_along_p] = _cut_in_two
mlir.register_lowering(_along_p, mlir.lower_fun(_run, multiple_results=True))
