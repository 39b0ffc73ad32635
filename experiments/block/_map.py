"""Settled motions of the simplified block over k3 and the belt speed: periods, or why there is none."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from stickslip.analysis import STATUS, PeriodTest, Recording, orbit_diagram
from stickslip.sweep import Variable
from stickslip.systems import BlockOnBelt, BlockOnBeltSetValued, BlockState

from .._experiment import Context
from ._diagram import integrator_of, sweep_options
from ._regimes import MAXIMA

SYSTEMS = {"smooth": BlockOnBelt, "set-valued": BlockOnBeltSetValued}
# What a lane comes to, where it is not a period: numbers below 1 of `motion`.
IRREGULAR, RESTS, FAILED, UNTOLD = 0, -1, -2, -3
MEANINGS = {
    IRREGULAR: "irregular", RESTS: "rests", FAILED: "failed", UNTOLD: "not settled or not told",
}  # fmt: skip
REPEATS = 1e-3  # of the motion's size
LONGEST = 16
# A block slower than this part of the belt's speed at the end rests, but for the creep of smooth
# friction. On a belt that stands it rests in the end, whatever is left.
SLOW = 1e-3
# A motion that alternates, as one of two points per period, is settled if the alternation changes by
# less than this part over the record: near a doubling it decays for long.
CHANGES = 0.02
STANDS = 1e-6  # m/s
USABLE = [STATUS.index(word) for word in ("ok", "buffer_full", "not_settled", "too_few_points")]
SILENT = [STATUS.index(word) for word in ("no_crossing", "at_rest")]
CAPTION = (
    "Constructed parameters (set A): the paper prints none. Friction: {}. Each lane from rest, {} with "
    "adaptive steps at {:g}, {:g} s dropped, {:g} s looked at. Curves: located by Newton's method."
)
LABELS = {
    "k3": Variable(units="N/m", long_name="stiffness k3"),
    "V_b": Variable(units="m/s", long_name="belt speed V_b"),
}


def system_at(friction: str, k3: Any, V_b: Any) -> Any:
    """The simplified block with set A, of smooth or set-valued friction.

    Errors: `ValueError` for another word.
    """
    if friction not in SYSTEMS:
        raise ValueError(f"friction is {friction!r}; it must be one of {', '.join(SYSTEMS)}.")
    return SYSTEMS[friction].constructed(k3, V_b=V_b)


def settled_motions(parameters: Mapping[str, Any], context: Context) -> xr.Dataset:
    """A lane from rest for each pair of k3 and belt speed.

    `motion` counts the maxima of x after which x and y repeat, or is one of `MEANINGS`; `seconds` is
    the time of them, NaN without a period; `status` and `period_status` are those of `orbit_diagram`,
    and `end_...` the states at the end.
    """
    friction = parameters["friction"]
    grid = {
        "k3": np.linspace(parameters["k3_min"], parameters["k3_max"], parameters["columns"]),
        "V_b": np.linspace(parameters["speed_min"], parameters["speed_max"], parameters["rows"]),
    }
    keys = (
        "friction", "k3_min", "k3_max", "columns", "speed_min", "speed_max", "rows", "transient",
        "duration", "max_points", "tolerance", "method",
    )  # fmt: skip
    found = orbit_diagram(
        lambda k3, V_b: system_at(friction, k3, V_b),
        grid,
        BlockState(0.0, 0.0, 0.0, 0.0),
        Recording(
            parameters["transient"], parameters["duration"], MAXIMA, ("x", "y", "t"),
            max_points=parameters["max_points"], period=PeriodTest(REPEATS, LONGEST), check=0,
        ),
        integrator=integrator_of(parameters),
        **sweep_options(
            "map", "simplified", {key: parameters[key] for key in keys}, context, variables=LABELS
        ),
    ).load()  # fmt: skip
    found = found.assign(
        motion=(("k3", "V_b"), motion_of(found), {
            "long_name": "maxima of x after which the motion repeats, or what it is instead",
            "flag_values": list(MEANINGS),
            "flag_meanings": " ".join(words.replace(" ", "_") for words in MEANINGS.values()),
        }),
        seconds=(("k3", "V_b"), seconds_of(found), {"units": "s", "long_name": "period"}),
    )  # fmt: skip
    steps, run = parameters["tolerance"], (parameters["transient"], parameters["duration"])
    about = CAPTION.format(friction, parameters["method"], steps, *run)
    return found.drop_vars(["x", "y", "t"]).assign_attrs(caption=about, friction=friction)


def motion_of(found: xr.Dataset) -> np.ndarray:
    """What each lane comes to, `[k3, V_b]`."""
    status, period = np.asarray(found.status), np.asarray(found.period)
    slow = np.asarray(found.slow_transient).astype(bool)
    speed = np.hypot(np.asarray(found.end_vx), np.asarray(found.end_vy))
    belt = np.broadcast_to(np.asarray(found.V_b), speed.shape)
    slow |= alternation_changes(found) > CHANGES
    rests = np.where(belt == 0.0, speed <= STANDS, speed <= SLOW * np.abs(belt))
    ran = np.isin(status, USABLE)
    motion = np.where(ran & ~slow & (period >= 0), period, UNTOLD)
    motion = np.where(~ran & ~np.isin(status, SILENT), FAILED, motion)
    return np.where(rests & (ran | np.isin(status, SILENT)), RESTS, motion).astype(np.int32)


def alternation_changes(found: xr.Dataset) -> np.ndarray:
    """By how much of itself the difference of points half a period apart changes over the record.

    `[k3, V_b]`; 0 where the period is odd or none.
    """
    period, count = np.asarray(found.period), np.asarray(found["count"])
    x = np.asarray(found.x.transpose("k3", "V_b", "point"))
    half = np.where((period > 0) & (period % 2 == 0), period // 2, 0)
    index = np.arange(x.shape[2])
    other = np.take_along_axis(x, np.clip(index - half[..., None], 0, None), axis=2)
    size = np.abs(x - other)

    def largest(begin: np.ndarray) -> np.ndarray:
        rows = (index >= begin[..., None]) & (index < (begin + 2 * half)[..., None])
        return np.max(np.where(rows & np.isfinite(size), size, 0.0), axis=2)

    early, late = largest(half), largest(count - 2 * half)
    most = np.maximum(early, late)
    return np.where(most > 0.0, np.abs(early - late) / np.where(most > 0.0, most, 1.0), 0.0)


def seconds_of(found: xr.Dataset) -> np.ndarray:
    """Time of the last period of each lane [s], NaN where it has none; `[k3, V_b]`."""
    period, last = np.asarray(found.period), np.asarray(found["count"]) - 1
    times = np.asarray(found.t.transpose("k3", "V_b", "point"))
    known = (period > 0) & (last >= period)
    ends = np.where(known, last, 0), np.where(known, last - period, 0)
    end, begin = (np.take_along_axis(times, at[..., None], axis=2)[..., 0] for at in ends)
    return np.where(known, end - begin, np.nan)
