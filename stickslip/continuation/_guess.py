"""Where Newton's method starts: a state, a mode and a period, by hand or from a simulation."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from .._show import value_text
from .._types import Given, Mode, Numeric
from .._validation import (
    MOST,
    as_float64,
    as_parameter,
    check_mapping,
    check_text,
    check_type,
    is_concrete,
    one_number,
    refusal,
    whole_number,
)
from ..analysis.neutral_directions import neutral_shifts, projection_on
from ..hybrid import (
    AbstractHybridSystem,
    SaveAt,
    Section,
    current_executor,
    jit_plainly,
    simulate,
    use_executor,
)
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.arguments import a_time, check_field, start_of, the_system
from ..hybrid.longest_step import spanning
from ..hybrid.same_system import AbstractSameSystem
from ..hybrid.tree import with_float_arrays
from ._accuracy import ACCURACY
from ._closing import in_units
from ._options import SHOOTING, Shooting
from ._turns import apart, given_turns, turns_of


class OrbitGuess(eqx.Module):
    """A state that nearly returns after a period.

    - `y0`: the state; `mode0`: its mode, name or number, by default that of `system.initial_mode`.
    - `period` [s]: positive.
    - `t0` [s]: time of the state; it matters if the system depends on the time.
    - `turns`: how often angles (components with one of the system's `periods`) go round in the period,
      by name: `{"phi": -2}`; by default the whole numbers that are nearest in the motion from it.

    **Errors** `ValueError`/`TypeError` naming the argument.
    """

    y0: PyTree
    period: Numeric
    mode0: Mode | None = None
    t0: Numeric = 0.0
    turns: Mapping[str, Any] | None = None

    def __repr__(self) -> str:
        mode = "" if self.mode0 is None else f", mode {value_text(self.mode0)}"
        turns = f", turns {value_text(self.turns)}" if self.turns else ""
        at = f"{value_text(self.y0)} at t = {value_text(self.t0, 's')}{mode}{turns}"
        return f"OrbitGuess: period {value_text(self.period, 's')}, from {at}"

    def __check_init__(self):
        as_float64("y0", self.y0)
        if not sum(np.size(leaf) for leaf in jax.tree.leaves(self.y0)):
            raise refusal("y0", self.y0, "a state with at least one component")
        a_time("period", one_number("period", self.period, "positive"))
        a_time("t0", self.t0)
        check_mapping("turns", self.turns, "a mapping from names of angles to whole numbers")
        if isinstance(self.mode0, str):
            check_text("mode0", self.mode0, "the name of a mode")
        elif self.mode0 is not None:
            whole_number("mode0", self.mode0, 0, MOST)


def orbit_guess(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    *,
    transient: Numeric,
    max_period: Numeric,
    forcing_period: Given[Numeric | None] = None,
    t0: Numeric = 0.0,
    mode0: Mode | None = None,
    args: PyTree = None,
    shooting: Given[Shooting] = SHOOTING,
) -> OrbitGuess:
    r"""A guess for `periodic_orbit` from a simulation that has settled.

    After the transient the motion is watched for `max_period`. Without forcing, its returns through the
    plane through its state, perpendicular to the motion there, are compared with this state; with
    forcing, its states after each `forcing_period`. The first return that is about as near as the
    nearest is the period. The guess starts in the middle of the longest time without an event, where
    small changes of a parameter do not move an event over the start.

    **Arguments**

    - `system`, `y0`, `t0`, `mode0`, `args`: as for `simulate`; `shooting`: a `Shooting`, of which
      `segments` do not matter here.
    - `transient` [s], not negative: time that is dropped; where the motion has not settled the guess is
      a rough one.
    - `max_period` [s]: the longest period looked for.
    - `forcing_period` [s]: of a system that depends on the time, or of a sampled controller its sample
      period; at most `max_period`. The guess has it or a multiple of it as its period.

    **Returns** an `OrbitGuess`. Where no return is seen within `max_period` its period is NaN:
    `periodic_orbit` raises, or answers with `guess_failed` under `jit` and `vmap`, where it works too.

    **Errors** `ValueError`/`TypeError` naming the argument, before compilation.
    """
    the_system(system)
    one_number("transient", transient, "not negative")
    max_period = one_number("max_period", max_period, "positive")
    multiples = None
    if forcing_period is not None:
        a_time("forcing_period", one_number("forcing_period", forcing_period, "positive"))
        if not is_concrete((forcing_period, max_period)):
            allowed = "concrete with a forcing_period, whose multiples are counted"
            raise refusal("max_period", max_period, allowed)
        multiples = int(float(max_period) / float(forcing_period) * (1 + 1e-9))
        if multiples < 1:
            raise refusal("max_period", max_period, f"at least forcing_period, {forcing_period}")
    check_type("shooting", shooting, Shooting, "a Shooting")
    t0 = a_time("t0", t0)
    y0, mode = start_of(system, t0, y0, mode0, args)
    system, args = with_float_arrays((system, args))
    numbers = y0, mode, t0, *map(as_parameter, (transient, max_period, forcing_period or 0.0))
    program = _compiled if is_concrete((system, args, numbers)) else _guess
    return program(
        system, args, shooting.integrator_or(ACCURACY.guessing), current_executor(), *numbers,
        multiples=multiples, max_events=shooting.max_events,
    )  # fmt: skip


def gained_by(system: AbstractHybridSystem, guess: Any) -> Float[Array, " size"]:
    """By how much the state of a guess goes on in its period; NaN where it does not say."""
    turn = turns_of(system, guess.y0)
    period = np.where(np.isfinite(turn), turn, 0.0)
    if isinstance(guess, OrbitGuess):
        return given_turns(system, guess.y0, guess.turns) * period
    turns = ravel_pytree(guess.turns)[0].astype(jnp.float64)
    return turns * period + ravel_pytree(guess.drift)[0]


def check_seen(argument: str, guess: Any) -> None:
    """Raise `ValueError` for a guess of `orbit_guess` that is none."""
    numbers = guess.period, guess.y0
    if not is_concrete(numbers) or np.ndim(guess.period):
        return
    if not all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(guess.y0)):
        allowed = "finite: of orbit_guess it is not where the motion could not be simulated"
        raise refusal(f"{argument}.y0", guess.y0, allowed)
    if np.isnan(guess.period):
        allowed = "positive: of orbit_guess it is NaN where no return is seen within max_period"
        raise refusal(f"{argument}.period", guess.period, allowed)


class _Anchored(AbstractSameSystem):
    """The same system, with the plane that a section of it looks for."""

    system: AbstractHybridSystem
    anchor: Array
    normal: Array
    size: Array
    neutral: Array


def _above_plane(system, t, y, dy, mode, args):
    away = apart(ravel_pytree(y)[0] - system.anchor, system.neutral, turns_of(system, y))
    return jnp.sum(system.normal * away / system.size)


RETURN = Section(_above_plane, "rising", name="return")


def _guess(
    system, args, integrator, execute, y0, mode, t0, transient, longest, forcing,
    *, multiples, max_events,
):  # fmt: skip
    check_field(system, t0, y0, mode, args)
    integrator = spanning(integrator, transient + longest)

    def run(system, begin, end, y, mode, **options):
        with use_executor(execute):
            return simulate(
                system, begin, end, y, mode, args, integrator=integrator, throw=False, **options
            )

    # Each run is a program of its own to compile: there are three.
    begin = t0 + transient
    if multiples is None:
        after = longest * jnp.linspace(0.0, 1.0, ACCURACY.samples)
    else:
        after = forcing * jnp.arange(multiples + 1.0)
    seen = run(system, t0, begin + after[-1], y0, mode,
               saveat=SaveAt(ts=begin + after, max_events=None)).outputs  # fmt: skip
    assert seen is not None
    y, slope = (jax.tree.map(lambda leaf: leaf[0], rows) for rows in (seen.y, seen.dy))
    mode = jnp.where(seen.mode[0] < 0, mode, seen.mode[0]).astype(jnp.asarray(mode).dtype)
    states = jax.vmap(lambda state: ravel_pytree(state)[0])(seen.y)
    size, (flat, unravel), turn = _sizes(states), ravel_pytree(y), turns_of(system, y)
    shifts = neutral_shifts(system, args, begin + after, states, seen.mode, unravel, size)
    beside = projection_on(shifts)
    neutral = in_units(beside, size)
    if multiples is None:
        slope = ravel_pytree(slope)[0] / size
        slope = slope - beside @ slope
        normal = slope / jnp.maximum(jnp.linalg.norm(slope), 1e-300)
        watched = run(
            _Anchored(system, flat, normal, size, neutral), begin, begin + longest, y, mode,
            saveat=SaveAt(sections=RETURN, max_events=max_events, max_crossings=64),
        )  # fmt: skip
        log = watched.crossings[0]
        states = jax.vmap(lambda state: ravel_pytree(state)[0])(log.y)
        after = log.t - begin
    else:
        kept = SaveAt(max_events=max_events)
        watched = run(system, begin, begin + after[-1], y, mode, saveat=kept)
        states, after = states[1:], after[1:]
    away = jnp.max(jnp.abs(apart(states - flat[None, :], neutral, turn) / size[None, :]), axis=1)
    away = jnp.where(jnp.isfinite(away), away, jnp.inf)
    # A return as near as two orbits are to be one is a return in any case, also if others are nearer.
    good = jnp.isfinite(away) & (away <= jnp.maximum(ACCURACY.as_near * jnp.min(away), ENGINE.same))
    period = jnp.where(jnp.any(good), after[jnp.argmax(good)], jnp.nan)

    # From the middle of the longest time without an event.
    whole = jnp.where(jnp.isfinite(period), period, longest)
    found = jnp.where(watched.events.t < begin + whole, watched.events.t, begin + whole)
    marks = jnp.concatenate([begin[None], found, (begin + whole)[None]])
    gaps = jnp.diff(marks)
    at = jnp.argmax(gaps)
    middle = marks[at] + 0.5 * gaps[at]
    start = run(system, begin, middle, y, mode, saveat=SaveAt(max_events=None))
    return OrbitGuess(start.y1, period, start.mode1, middle)


_compiled = jit_plainly(_guess)


def _sizes(states: Array) -> Array:
    """Extent of each column; 1 where nothing moves."""
    known = jnp.isfinite(states)
    span = jnp.max(jnp.where(known, states, -jnp.inf), axis=0)
    span = span - jnp.min(jnp.where(known, states, jnp.inf), axis=0)
    return jnp.where(span > 0, span, 1.0)
