"""What the parameters of experiments may be, before anything is computed."""

import math
from collections.abc import Mapping
from typing import Any

KINDS = {int: "an integer", float: "a number", bool: "true or false", str: "a text"}
CHOICES = {
    "method": ("dop853", "tsit5", "rk4"),
    "executor": ("auto", "fused", "portable"),
    "direction": ("rising", "falling", "both"),
    "sign": ("consistent", "printed"),
    "models": ("all", "simplified"),
    "friction": ("smooth", "set-valued"),
    "shaper": ("", "ZV", "ZVD", "MZV", "EI", "2HUMP_EI"),
}
POSITIVE = (
    "k3", "k3_min", "k3_max", "k3_step", "h", "coarse_h", "dt", "step", "rate", "V_max", "distance",
    "duration", "recorded", "settled", "segment", "shown", "tolerance", "follow_min", "follow_max",
    "orbit_tolerance", "speed", "speed_max", "curve_speed", "curve_step", "fine_step", "acceleration",
    "corner_speed",
)  # fmt: skip
FROM_ZERO = (
    "transient", "converged_transient", "converged_duration", "dropped", "spread", "width",
    "exponents", "adam_steps", "seed", "generations", "founders", "rounds", "looks", "coarse_transient",
    "doublings", "speed_min", "radius",
    "tension_error", "frequency_x", "frequency_y",
)  # fmt: skip
LEAST = {"segments": 4, "rows": 2, "columns": 2, "points": 2, "coarse": 2, "fine": 2}
MOST = 10_000_000  # of anything that is counted
ORDERED = (
    ("k3_min", "k3_max"), ("v_min", "v_max"), ("dropped", "duration"), ("follow_min", "follow_max"),
    ("speed_min", "speed_max"), ("speed_min", "curve_speed"), ("curve_speed", "speed_max"),
)  # fmt: skip
# Lengths and what they are cut into.
CUT = (("k3_max", "k3_min", "k3_step"), ("duration", None, "dt"), ("duration", None, "step"))


def parsed(key: str, text: str, like: Any) -> Any:
    """`text` as a value of the type of `like`. Errors: `ValueError` if it is not one."""
    kind = type(like)
    try:
        if kind is bool:
            return {"true": True, "false": False}[text.lower()]
        return kind(text)
    except (ValueError, KeyError):
        raise refused(key, text, KINDS[kind]) from None


def refused(key: str, value: Any, allowed: str) -> ValueError:
    """The error for a wrong value, in the words of the command line."""
    return ValueError(f"--set {key}={value}: it must be {allowed}.")


def check(values: Mapping[str, Any], changed: Mapping[str, str]) -> None:
    """Refuse values with which no experiment could run; of those that do not go together the one that
    was `changed` (to a text) is named.

    Errors: `ValueError` naming the key, its value and what is allowed.
    """
    for key, text in changed.items():
        _check_one(key, text, values)
    for low, high in ORDERED:
        if low in values and high in values and not values[low] < values[high]:
            if high in changed:
                raise refused(high, changed[high], f"above {low} = {values[low]}")
            raise refused(low, values[low], f"below {high} = {values[high]}")
    for end, begin, step in CUT:
        if end in values and step in values:
            _check_cut(values, changed, end, begin, step)


def _check_one(key: str, text: str, values: Mapping[str, Any]) -> None:
    value = values[key]
    if isinstance(value, bool):
        return
    if isinstance(value, str):
        allowed = choices_of(key)
        if allowed and value not in allowed:
            raise refused(key, text, f"one of {', '.join(allowed)}")
        return
    if not math.isfinite(value):
        raise refused(key, text, "finite")
    if isinstance(value, int):
        least = LEAST.get(key, 0 if key in FROM_ZERO else 1)
        if not least <= value <= MOST:
            raise refused(key, text, f"from {least} to {MOST}")
        return
    # Where there are fixed steps too, a tolerance of 0 asks for them.
    zero = key in FROM_ZERO or (key == "tolerance" and "h" in values)
    if value < 0 and zero:
        raise refused(key, text, "0 or more")
    if value <= 0 and key in POSITIVE and not zero:
        raise refused(key, text, "above 0")
    if key == "tolerance" and value >= 1:
        raise refused(key, text, "below 1")


def _check_cut(values, changed, end: str, begin: str | None, step: str) -> None:
    length = values[end] - (0.0 if begin is None else values[begin])
    whole = end if begin is None else f"{end} - {begin}"
    if values[step] > length:
        raise refused(step, changed.get(step, values[step]), f"at most {whole} = {length:g}")
    if length / values[step] > MOST:
        at_least = f"at least {length / MOST:g}, a part in {MOST} of {whole} = {length:g}"
        raise refused(step, changed.get(step, values[step]), at_least)


def choices_of(key: str) -> tuple[str, ...]:
    """The texts that a key may have; none where any may be."""
    if key == "set":
        from .block._sets import FOUND  # an experiment; it knows this module by way of its own

        return ("A", *FOUND)
    return CHOICES.get(key, ())
