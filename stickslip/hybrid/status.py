"""Result codes, as messages, and the verdict on derivatives."""

from typing import Any

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from .._outcome import in_words
from .._show import number

RUNNING = -1
NO_MODE = -1  # what `transition` and `initial_mode` return where no mode is admissible
JUMP = -1  # in place of a guard, for systems that answer jumps


@in_words
class RESULTS(dfx.RESULTS):  # pyright: ignore[reportGeneralTypeIssues]
    """Outcome of a simulation, per lane; extends `diffrax.RESULTS`.

    `str` of an item is its name, of a batch of them how many there are of each; `RESULTS[item]` says
    what it means and what to do.
    """

    successful = ""
    max_events_reached = (
        "The log of events is full. Increase `max_events`, or set `max_events=None` if the log is "
        "not needed."
    )
    max_crossings_reached = "The log of a section is full. Increase `max_crossings`."
    chattering = (
        "Events follow each other without time passing (chattering or Zeno): the mode that "
        "`transition` returns is left at once. Return a mode that is admissible right after the "
        "event, such as sticking or resting. With a friction law of your own, ask check_friction_law."
    )
    no_admissible_mode = (
        "No mode is admissible: `transition` or `initial_mode` returned -1 for this state."
    )


# The text of diffrax does not say whose steps; equinox warns of an item that is declared once more.
RESULTS._index_to_message[int(RESULTS.max_steps_reached._value)] = (
    "The run took all its attempts, the `max_steps` of its `Integrator`, before it came to its end. "
    "Give `Integrator(max_steps=...)` more, or ask for less accuracy; should it always stop at the "
    "same time, see what the motion does there."
)

# The loop carries small integers; this is their order.
CODES = (
    "successful",
    "max_steps_reached",
    "dt_min_reached",
    "event_occurred",
    "max_events_reached",
    "max_crossings_reached",
    "chattering",
    "no_admissible_mode",
    "nonfinite",
)
CODE = {name: number for number, name in enumerate(CODES)}


def item_of(results: Any, names: tuple[str, ...], code: Int[Array, "*batch"]) -> Any:
    """Item of an enumeration by a code, the place in the row of `names`; the first by default."""
    result = getattr(results, names[0])
    for place, name in enumerate(names):
        result = results.where(code == place, getattr(results, name), result)
    return result


# Bits of `Solution.flags`: where the derivative of the result does not exist or is not to be trusted.
GRAZING = 1  # a guard touched zero, or missed it, so closely that rounding and tolerance decide
COINCIDENT = 2  # two guards reached zero at the same instant
EVENT_AT_START = 4  # a guard was already violated when a mode began
DISCONTINUOUS = 8  # a guard or the field jumped inside a step, at a time that nobody declared
COARSE = 16  # an absolute tolerance is above the motion of a component
STILL = 32  # the motion is too small to set the steps that its derivative needs
BENT = 64  # the field bends in more places than are located, or inside a loop


def describe_flags(flags: int) -> str:
    """Words for the bits of `Solution.flags`."""
    names = {
        GRAZING: "grazing: a guard touched or missed zero with almost no slope",
        COINCIDENT: "coincident: two guards reached zero at the same instant",
        EVENT_AT_START: "violated: a guard was already violated when a mode began",
        DISCONTINUOUS: "discontinuous: a guard or the field jumped within a step",
        COARSE: "coarse: an absolute tolerance is above the motion of a component",
        STILL: "still: at an equilibrium the steps are too long for derivatives; give dtmax",
        BENT: "bent: a force bends in a long loop, or in too many places; declare its switches",
    }
    return "; ".join(text for bit, text in names.items() if int(flags) & bit) or "none"


def flags_text(solution: Any) -> str:
    """Why a run has no derivative; when that was seen first, and at which guard."""
    text, guard = describe_flags(int(solution.flags)), int(solution.flagged_guard)
    if not np.isfinite(solution.flagged_at):
        return text
    whose = f", guard {solution.guard_names[guard]!r}" if guard >= 0 else ""
    return f"{text} (first at t = {number(solution.flagged_at)} s{whose})"


def flag(condition, bit: int):
    """`bit` where `condition`, else 0."""
    return jnp.where(condition, jnp.int32(bit), jnp.int32(0))


# While a run goes on, the first of its flags is kept with its guard and time in one number, the bits of
# the time as a float: the last of them, a part in 4e-9, make room for the others.
BITS = 9  # those of the flags, and two more that are used inside of a step
FLAGS = (1 << BITS) - 1
# Of a bend of a force, inside a step only: what it makes of derivatives is seen at the end of the step.
TOUCHED, RESTED = 1 << 7, 1 << 8
NOTED = (1 << 24) - 1


def of_guard(index: Any) -> Any:
    """The number of a guard beside flags; nothing for -1."""
    return (index + 1).astype(jnp.int32) << BITS


def flags_with(before: Any, found: Any, t: Any) -> Any:
    """Flags `found` in a step that ends at `t` together with those before it."""
    time = jax.lax.bitcast_convert_type(t, jnp.int64) & ~NOTED
    found = found.astype(jnp.int64)
    flags = found & FLAGS
    after = jnp.where(before == 0, time | found, before | flags)
    return jnp.where(flags == 0, before, after)


def told(flags: Any) -> tuple[Any, Any, Any]:
    """Flags, time of the first, and its guard; NaN and -1 where there is none."""
    t = jax.lax.bitcast_convert_type(flags & ~NOTED, jnp.float64)
    guard = ((flags & NOTED) >> BITS).astype(jnp.int32) - 1
    return (flags & FLAGS).astype(jnp.int32), jnp.where(flags == 0, jnp.nan, t), guard
