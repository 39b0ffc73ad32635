"""The contract that every friction law must fulfil, checked by numbers."""

from collections.abc import Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from stickslip._jit_by_code import jit_by_code
from stickslip._types import Row
from stickslip._validation import one_row
from stickslip.friction.law import AbstractFrictionLaw, Number, State, check_law

# Close to rest in every law's own scale of velocity, which is 1e-50 m/s for rate-and-state friction,
# yet so far from the smallest number that the cube of it is one.
_NEAR = 1e-100


def _close(a, b, tolerance: float) -> bool:
    a, b = np.asarray(a), np.asarray(b)
    return bool(np.all(np.abs(a - b) <= tolerance * (1.0 + np.abs(b))))


def _form(law: AbstractFrictionLaw, v: Float[Array, " n"]) -> Iterator[str]:
    for dtype in (jnp.float32, jnp.float64):
        results = eqx.filter_eval_shape(
            lambda law, v: (law.coefficient(v), law.drag(v)), law, v.astype(dtype)
        )
        if any(result.dtype != dtype for result in results):
            yield (
                f"coefficient and drag must keep {jnp.dtype(dtype).name}, as by "
                ".astype(jnp.result_type(v, float))"
            )
        elif any(result.shape != v.shape for result in results):
            yield "coefficient and drag must have the shape of v"


@jit_by_code
def _coefficient(law: AbstractFrictionLaw, v: Number) -> Array:
    return law.coefficient(v)


@jit_by_code
def _branch(law: AbstractFrictionLaw, v: Number, sense: Number) -> tuple[Array, Array]:
    return jax.value_and_grad(lambda v: law.kinetic(v, sense))(v)


def _rest(law: AbstractFrictionLaw) -> Iterator[str]:
    if float(law.coefficient(0.0)) != 0.0 or float(law.drag(0.0)) != 0.0:
        yield "coefficient and drag must be 0 at rest"
    near = jnp.array(_NEAR)
    for sense in (jnp.array(1.0), jnp.array(-1.0)):
        limit, static = law.kinetic_limit(sense), law.static_coefficient(sense)
        if not _close(_coefficient(law, sense * near), sense * limit, 1e-9):
            yield f"coefficient must tend to kinetic_limit({sense:+.0f}) as v -> 0"
        if not law.set_valued and law.num_states == 0 and limit != 0.0:
            yield "a smooth law must not jump at rest"
        if static < limit - 1e-9:
            yield f"static_coefficient({sense:+.0f}) must not be below kinetic_limit({sense:+.0f})"
        before, slope_before = _branch(law, -near, sense)
        after, slope_after = _branch(law, near, sense)
        if not _close(before + _NEAR * slope_before, after - _NEAR * slope_after, 1e-4):
            yield f"kinetic must be continuous through rest in sense {sense:+.0f}"
        elif not _close(slope_before, slope_after, 1e-4):
            yield f"kinetic must be differentiable through rest in sense {sense:+.0f}"
    low, high = law.static_interval()
    if low != -law.static_coefficient(-1) or high != law.static_coefficient(1):
        yield "static_interval must agree with static_coefficient"


@jit_by_code
def _in_motion(law: AbstractFrictionLaw, v: Array) -> dict[str, Any]:
    def slopes(v):
        return eqx.filter_grad(lambda at: at[0].coefficient(at[1]) + at[0].drag(at[1]))((law, v))

    return {
        "mu": law.coefficient(v),
        "drag": law.drag(v),
        "branch": law.kinetic(v, jnp.sign(v)),
        "vmap": jax.vmap(law.coefficient)(v),
        "slopes": jax.tree.leaves(jax.vmap(slopes)(v)),
    }


def _motion(law: AbstractFrictionLaw, v: Float[Array, " n"]) -> Iterator[str]:
    found = _in_motion(law, v)
    mu, drag = found["mu"], found["drag"]
    if not (jnp.isfinite(mu).all() and jnp.isfinite(drag).all()):
        yield "coefficient and drag must be finite"
    if not _close(found["branch"], mu, 1e-14):
        yield "kinetic must equal coefficient on its own side"
    if law.is_odd and not (_close(mu[::-1], -mu, 1e-14) and _close(drag[::-1], -drag, 1e-14)):
        yield "the law claims to be odd: coefficient(-v) must be -coefficient(v), drag alike"
    if law.is_dissipative and not ((mu * v >= 0).all() and (drag * v >= 0).all()):
        yield "the law claims to be dissipative: coefficient and drag must have the sign of v"
    if not _close(found["vmap"], [_coefficient(law, x) for x in v], 1e-14):
        yield "coefficient must give the same under vmap as one by one"
    if not all(jnp.isfinite(leaf).all() for leaf in found["slopes"]):
        yield "derivatives must be finite away from rest, for the parameters too"


@jit_by_code
def _in_steady_sliding(law: AbstractFrictionLaw, v: Array) -> tuple[State, State, Array, Array]:
    state = law.steady_state(v)
    rates = law.state_rate(v, state)
    return state, rates, law.coefficient_from_state(v, state), law.coefficient(v)


def _memory(law: AbstractFrictionLaw, v: Float[Array, " n"]) -> Iterator[str]:
    state, rates, mu, steady = _in_steady_sliding(law, v)
    if not law.num_states == len(state) == len(rates):
        yield "steady_state and state_rate must have num_states entries"
        return
    if not all(_close(rate / v, 0.0, 1e-12) for rate in rates):
        yield "the state must be at rest in steady sliding"
    if not _close(mu, steady, 1e-12):
        yield "coefficient_from_state must give coefficient in steady sliding"


def _limit(law: AbstractFrictionLaw) -> Iterator[str]:
    limit = law.set_valued_limit()
    if limit.num_states > 0:
        yield "set_valued_limit must have no internal state"
    for sense in (1, -1):
        if not _close(limit.static_coefficient(sense), law.static_coefficient(sense), 1e-12):
            yield f"set_valued_limit must keep static_coefficient({sense:+})"


def check_friction_law(law: AbstractFrictionLaw, speeds: Row | None = None) -> None:
    """Raise `ValueError` with every claim of `law` that does not hold at the given speeds.

    For a law of your own: it looks at rest and at the limits there, at both directions of motion,
    at oddness and dissipation as claimed, at derivatives, types and `vmap`, at steady sliding for
    laws with internal states, and at the set-valued limit.

    **Arguments:**

    - `law`: the law, with scalar parameters.
    - `speeds`: a row of positive speeds [m/s] to look at in both directions; from 1e-9 to 100 if left
      out.
    """
    check_law("law", law)
    speeds = np.geomspace(1e-9, 1e2, 45) if speeds is None else one_row("speeds", speeds, "positive")
    v = np.asarray(speeds, np.float64)
    v = jnp.concatenate([-v[::-1], v])
    # Numbers of the wrong form cannot be compared.
    broken = [*_form(law, v)] or [
        *_rest(law),
        *_motion(law, v),
        *_memory(law, v),
        *_limit(law),
    ]
    if broken:
        raise ValueError(f"{type(law).__name__}: " + "; ".join(broken) + ".")
