"""Lyapunov exponents of hybrid systems by tangent dynamics, events included."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from .._types import Given, Mode
from .._validation import (
    as_parameter,
    check_positive,
    check_type,
    is_concrete,
    leaves_of,
    refusal,
    shape_refusal,
)
from ..derived import WithDeviations
from ..hybrid import (
    RESULTS,
    AbstractHybridSystem,
    Integrator,
    SaveAt,
    current_executor,
    jit_plainly,
    simulate,
    use_executor,
)
from ..hybrid.arguments import a_time, the_system
from ..hybrid.components import component_list, place_of
from ..hybrid.longest_step import spanning
from ..hybrid.tree import with_float_arrays
from ._accuracy import ACCURACY
from ._arguments import an_integrator, start_of
from ._growth import (
    LyapunovSpectrum,
    accumulate,
    check_exponents,
    first_frame,
    spectrum_of_rates,
    with_neutral,
)
from ._recording import Segments
from .held_directions import held_directions
from .neutral_directions import neutral_shifts


def lyapunov_spectrum(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    record: Given[Segments],
    *,
    exponents: Given[int | None] = None,
    components: Given[Sequence[str] | None] = None,
    scales: PyTree = None,
    mode0: Mode | None = None,
    args: PyTree = None,
    integrator: Given[Integrator | None] = None,
) -> LyapunovSpectrum:
    r"""Lyapunov exponents of the motion from `y0`: growth rates of small deviations of the state.

    $$\lambda_i = \lim_{T \to \infty} \frac1T \sum_n \ln R^{(n)}_{ii}, \qquad
      \Phi^{(n)} Q^{(n-1)} = Q^{(n)} R^{(n)}$$

    with the tangent map $\Phi^{(n)}$ of segment $n$ and a QR factorisation after each (Benettin et al.
    1980; Shimada & Nagashima 1979). The deviations are integrated with the motion, under the same
    error control (`WithDeviations`); every event contributes its saltation matrix (Müller 1995), of
    lower rank where slip turns into stick. A deviation lost there has the exponent `-inf`.

    **Arguments**

    - `system`, `y0`, `mode0`, `args`, `integrator`: as for `simulate`.
    - `record`: `Segments(length, count, transient, warm_up, blocks, t0)`: a factorisation after each
      segment. Let it be so short that over it the fastest direction outgrows the slowest by less than
      `1e11`, beyond which a direction counts as lost.
    - `exponents`: how many, greatest first (default: all). The cost of each is about that of a motion.
    - `components`: names of the state's components that deviate (default: all), `"x[0]"` for one number
      of an array. Where the others do not depend on them, these are the exponents of the driven part;
      otherwise conditional exponents (Pecora & Carroll 1990). An undamped or forced part that moves by
      itself has exponents of zero, which hide a negative exponent of the part that it drives.
    - `scales`: a state of positive numbers, the units in which deviations are measured (default 1).
      Exponents do not depend on them, but how fast they converge does: with speeds in units of a
      frequency times the length, an oscillation has the same size all the time.

    **Returns** a `LyapunovSpectrum`. The function works under `jit`, `vmap`, `map_lanes` and
    `run_sweep`, whose grids it is meant for: `lyapunov_diagram`.

    An autonomous motion other than a rest has an exponent of zero along itself. Where a shift of the
    state changes nothing, as of a body that no spring holds, the exponent of zero is named "neutral" by
    its `status`. Deviations that a stick does not allow are taken away after each segment, as an event
    would do: of a block that the belt carries for ever the exponents are 0 and `-inf`. Which they are a
    mechanism knows; of a system written by hand its `constraints` say it, or else its transitions.

    **Errors** `ValueError`/`TypeError` naming the argument, before compilation.
    """
    the_system(system)
    integrator = an_integrator(integrator)
    check_type("record", record, Segments, "a Segments(length, count)")
    transient, segment = record.transient, as_parameter(record.length)
    t0 = a_time("t0", record.t0)
    y0, mode = start_of(system, t0, y0, mode0, args)
    moving = moving_components(y0, components)
    count = int(moving.sum()) if exponents is None else exponents
    check_exponents(count, int(moving.sum()))
    units = _flat_scales(scales, y0)

    dropped = transient
    if isinstance(transient, int | float):
        dropped = None if transient == 0 else jnp.asarray(transient, jnp.float64)
    system, args = with_float_arrays((system, args))
    numbers = y0, mode, t0, segment, dropped, units
    # Called plainly it is compiled as a whole, for all calls with arguments of one form.
    program = _compiled if is_concrete((system, args, numbers)) else _spectrum
    return program(
        system, args, integrator, current_executor(), *numbers,
        segments=record.count, warm_up=record.warm_up_count, blocks=record.blocks, count=count,
        moving=tuple(moving.tolist()),
    )  # fmt: skip


def _spectrum(
    system, args, integrator, execute, y0, mode, t0, segment, transient, scales,
    *, segments, warm_up, blocks, count, moving,
):  # fmt: skip
    whole = (0.0 if transient is None else transient) + segment * (segments + warm_up)
    integrator = spanning(integrator, whole)

    def run(system, begin, end, y, mode):
        with use_executor(execute):
            return simulate(
                system,
                begin,
                end,
                y,
                mode,
                args,
                integrator=integrator,
                saveat=SaveAt(max_events=None),
                throw=False,
            )

    result, good = RESULTS.successful, jnp.ones((), bool)
    begin = t0
    if transient is not None:
        begin = t0 + transient
        solution = run(system, t0, begin, y0, mode)
        y0, mode = solution.y1, solution.mode1
        result, good = solution.result, solution.successful
    tangent = WithDeviations(system)
    mask, unit = jnp.asarray(moving, jnp.float64)[:, None], scales[:, None]

    def step(carry, frame):
        number, y, mode, flags, result, good, rests, seen = carry
        start, end = begin + segment * number, begin + segment * (number + 1.0)
        solution = run(tangent, start, end, tangent.start(y, unit * frame), mode)
        # A lane that failed stays where it is; its numbers are discarded.
        usable = good & solution.successful
        images = mask * tangent.columns(solution.y1) / unit
        # A motion may end in a stick: no event takes away what the stick does not allow.
        held = held_directions(system, end, solution.y1.y, solution.mode1, args, scales, mask[:, 0])
        images = jnp.where(usable, held @ images, frame)
        same = jax.tree.map(lambda a, b: jnp.all(a == b), solution.y1.y, y)
        carry = (
            number + 1.0,
            jax.tree.map(lambda a, b: jnp.where(usable, a, b), solution.y1.y, y),
            jnp.where(usable, solution.mode1, mode),
            flags | solution.flags,
            RESULTS.where(good, solution.result, result),
            usable,
            rests & jnp.all(jnp.stack(jax.tree.leaves(same))),
            tuple(
                rows.at[number.astype(jnp.int32) % ACCURACY.samples].set(new)
                for rows, new in zip(seen, (start, ravel_pytree(y)[0], mode), strict=True)
            ),
        )
        return carry, images

    size = sum(moving)
    frame = jnp.zeros((len(moving), count)).at[np.flatnonzero(moving)].set(first_frame(size, count))
    flags = jnp.zeros((), jnp.int32)
    flat, unravel = ravel_pytree(y0)
    seen = tuple(jnp.broadcast_to(a, (ACCURACY.samples, *jnp.shape(a))) for a in (begin, flat, mode))
    carry = (jnp.zeros(()), y0, mode, flags, result, good, jnp.ones((), bool), seen)
    carry, growth = accumulate(step, carry, frame, count=segments, warm_up=warm_up)
    _, y1, mode, flags, result, good, rests, (ts, states, modes) = carry
    local = jnp.where(good, growth / segment, jnp.nan)
    mean, error, status = spectrum_of_rates(local, rests, blocks)
    reach = jnp.max(states, axis=0) - jnp.min(states, axis=0)
    shifts = neutral_shifts(
        system, args, ts, states, modes, unravel, jnp.where(reach > 0.0, reach, scales)
    )
    # Only for components that deviate, and by shifts of these alone.
    own = jnp.any(shifts != 0.0, axis=0) & ~jnp.any((shifts != 0.0) & (mask == 0.0), axis=0)
    status = with_neutral(mean, error, status, jnp.sum(own, dtype=jnp.int32))
    return LyapunovSpectrum(
        exponents=mean,
        error=error,
        local=local,
        time=segment * jnp.arange(1.0, segments + 1),
        lost=jnp.sum(jnp.isneginf(local), axis=0, dtype=jnp.int32),
        t1=begin + segment * float(segments + warm_up),
        y1=y1,
        mode1=mode,
        result=result,
        flags=flags,
        status=status,
    )


_compiled = jit_plainly(_spectrum)


def _flat_scales(scales: PyTree, y0: PyTree) -> Float[Array, " size"]:
    """Units of the deviations in the order of the flattened state."""
    if scales is None:
        return jnp.ones(sum(a.size for a in jax.tree.leaves(y0)))
    named = leaves_of("scales", scales)
    if jax.tree.structure(scales) != jax.tree.structure(y0):
        raise refusal("scales", scales, f"of the structure of y0, {jax.tree.structure(y0)}", TypeError)
    flat = []
    for (name, s), a in zip(named, jax.tree.leaves(y0), strict=True):
        check_positive(name, s)
        if jnp.shape(s) not in ((), a.shape):
            raise shape_refusal(name, s, f"one number or of shape {a.shape}, as in y0")
        flat.append(jnp.ravel(jnp.broadcast_to(as_parameter(s), a.shape)))
    return jnp.concatenate(flat)


def moving_components(y0: PyTree, components: Any) -> np.ndarray:
    """Which numbers of the flattened state belong to the named components (all for None)."""
    leaves, form = jax.tree.flatten(y0)
    ends = np.cumsum([int(np.prod(jnp.shape(a))) for a in leaves])
    if components is None:
        return np.ones(ends[-1], bool)
    names = tuple(getattr(y0, "_fields", None) or getattr(y0, "__dict__", ()))
    row = (components,) if isinstance(components, str) else components
    if not isinstance(row, Sequence) or not row or not all(isinstance(name, str) for name in row):
        raise _unknown_component(components, y0)
    places = [
        np.arange(end - a.size, end).reshape(a.shape) for a, end in zip(leaves, ends, strict=True)
    ]
    moving = np.zeros(ends[-1], bool)
    for name in row:
        place = place_of(y0, name)
        if place is not None:
            moving[places[place.leaf][place.index or ()]] = True
        elif name in names:  # a field that is made of several components
            for numbers in jax.tree.leaves(getattr(jax.tree.unflatten(form, places), name)):
                moving[numbers] = True
        else:
            raise _unknown_component(components, y0)
    return moving


def _unknown_component(components: Any, y0: PyTree) -> Exception:
    return refusal(
        "components", components, f"names of components of the state, of {component_list(y0)}"
    )
