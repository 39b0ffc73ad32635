"""How many lanes a fused chunk may hold: what the cache takes, and what the compiler does.

XLA's CPU compiler splits an operation over threads where it believes that it takes 0.1 ms and more;
inside a fused time loop it then ends with an error. This belief grows with the lanes of a chunk,
so that smaller chunks compile.
"""

from collections import Counter
from typing import Any, NamedTuple

import jax
import jax.extend
import jax.numpy as jnp
import numpy as np

from .._jaxpr import equations, nowhere
from ..hybrid.executor import ALONG_NAME
from ..hybrid.one_call import LANES, LOOP_NAME, OLDER

MANY_DIRECTIONS = 3  # of a derivative: from here on half of the lanes fit it
CHUNK_PORTABLE = 16 * LANES  # more: each operation is dispatched by itself
VECTOR = 8  # lanes of the widest vector unit of a CPU: below, the portable executor is no slower
PORTABLE_INSTEAD = (
    "the compiler does not fuse this function: it is computed by the portable executor. Fewer output "
    "times per lane may help."
)


_OF_LAPACK = frozenset(
    thing.name
    for thing in vars(jax.lax.linalg).values()
    if isinstance(thing, jax.extend.core.Primitive)
)


class Fit(NamedTuple):
    """Executor and the most lanes of a chunk; whether one chunk is computed at a time."""

    executor: str
    lanes: int
    alone: bool = False


class TooManyMotions(Exception):
    """A time loop of a traced program runs more motions at once than chunks should hold."""

    def __init__(self, lanes: int):
        super().__init__(lanes)
        self.lanes = lanes


def check_motions(closed: Any, lanes: int) -> None:
    """Raise `TooManyMotions` where a lane runs so many motions at once that fewer lanes fit.

    With slopes along three directions and more half of the lanes do: eight of a stick-slip motion take
    6.2 plain runs and not 8.6. A quarter of them is slower again: too few for a loop over vectors.
    """
    loops = (eqn for eqn in equations(closed.jaxpr) if eqn.params.get("name") == LOOP_NAME)
    motions = max(map(_motions, loops), default=lanes)
    directions = max(map(_directions, equations(closed.jaxpr)), default=0)
    each = -(-motions // lanes) * (2 if directions >= MANY_DIRECTIONS else 1)
    fitting = LANES // each
    fitting = max(fitting - fitting % VECTOR if fitting > VECTOR else fitting, 2)
    if each > 1 and lanes > fitting:
        raise TooManyMotions(fitting)


class NotWorthCompiling(Exception):
    """A fused loop takes the compiler longer than so few lanes would gain."""


def check_worth(closed: Any, lanes: int) -> None:
    """Raise `NotWorthCompiling` for loops with more products of matrices than there are lanes.

    Each product is a loop of its own there. Orbits of structures have a thousand of them with all
    derivatives: they compile for minutes, and run up to twenty times as fast.
    """
    loops = (eqn for eqn in equations(closed.jaxpr) if eqn.params.get("name") == LOOP_NAME)
    inside = (equations(getattr(loop.params["jaxpr"], "jaxpr", loop.params["jaxpr"])) for loop in loops)
    products = sum(eqn.primitive.name == "dot_general" for loop in inside for eqn in loop)
    if products > lanes:
        raise NotWorthCompiling


class MustBeAlone(Exception):
    """A traced program must not run beside others."""


def check_alone(closed: Any) -> None:
    """Raise `MustBeAlone` for a program that calls LAPACK, where two may wait for each other.

    With JAX 0.10 two at once on larger matrices wait for ever, most of the time, with all threads idle;
    one at a time never did, and neither do those of JAX 0.12.
    """
    if OLDER and any(eqn.primitive.name in _OF_LAPACK for eqn in equations(closed.jaxpr)):
        raise MustBeAlone


def smaller(fit: Fit, lanes: int) -> Fit:
    """The next try where the compiler did not fuse `lanes` of them; 0: however few."""
    if lanes // 4 >= VECTOR:
        return fit._replace(lanes=lanes // 4)
    return fit._replace(executor="portable", lanes=CHUNK_PORTABLE)


def _directions(eqn: Any) -> int:
    """Along how many directions an equation has the slopes of a run."""
    along = eqn.primitive.name == ALONG_NAME
    return eqn.invars[0].aval.shape[0] if along and eqn.params["request"].many else int(along)


def _motions(eqn: Any) -> int:
    """Motions that a time loop runs at once: the size of most of its counters.

    Counters have no derivatives, whose directions would be counted as motions. Rows that a scan stacks
    are no counters, but results.
    """
    kept = _handed_from_step_to_step(eqn)
    sizes = Counter(
        int(np.prod(v.aval.shape))
        for v in (eqn.outvars if kept is None else kept)
        if v.aval.shape and not jnp.issubdtype(v.aval.dtype, jnp.floating)
    )
    return sizes.most_common(1)[0][0] if sizes else 1


def _handed_from_step_to_step(eqn: Any) -> Any:
    """Variables that a marked loop that is a scan hands from step to step; None for other loops."""
    for inner in equations(getattr(eqn.params["jaxpr"], "jaxpr", eqn.params["jaxpr"]), nowhere):
        if inner.primitive.name == "scan":
            # A stacked one has one axis more outside of the step than inside. How many are
            # carried has another name in each version of JAX.
            step = inner.params["jaxpr"]
            ends = getattr(step, "jaxpr", step).outvars
            pairs = zip(inner.outvars, ends, strict=True)
            return [v for v, end in pairs if v.aval.shape == end.aval.shape]
    return None
