"""How many of the paper's statements a set of parameters satisfies, from a few belt speeds.

C1 holds with every set, and the contact period is kept. C9b is left to the judge of the best set.
"""

import functools
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

import stickslip as ss
from stickslip.analysis import Segments, amplitude_spectrum, lyapunov_spectrum

from .._experiment import Statement
from .._thresholds import Beam
from ._coordinates import system_and_start
from ._diagram import points
from ._exponent import DRIVEN
from ._judge import judge_powers, judge_slow_frequency, judge_stick_slip
from ._model import CONTACT_PERIOD, fixed_step, norm_of, stick_section

# Within the ranges of the text, up to near their borders.
SPEEDS = np.array(
    [3e-4, 1e-3, 1.8e-3, 2.3e-3, 2.8e-3, 4.5e-3, 6.3e-3, 8.3e-3, 1e-2, 1.5e-2, 2e-2, 2.9e-2]
)
ITEMS = ("C2", "C3", "C4a", "C4b", "C5", "C6", "C7", "C8")
MOTIONS = (Beam.SLOW, Beam.FAST)
FOUND = "found by search"
NUMBERS = ("h", "transient")  # settings that enter as inputs of a program
Settings = Mapping[str, Any]
Lane = Callable[[Any, Any, Any], Any]
Make = Callable[[Settings], Lane]
Scorer = Callable[[np.ndarray], np.ndarray]
Judge = Callable[[xr.Dataset], list[Statement]]


def items(
    y_width: np.ndarray, w_width: np.ndarray, w_size: np.ndarray, per_contact: np.ndarray
) -> np.ndarray:
    """Share of the speeds `SPEEDS` at which C2 to C5 hold, `[..., item]`; inputs `[..., speed]`.

    C2 counts half for w being a single curve and half for its growth from speed to speed.
    """
    slow, fast = SPEEDS < Beam.STICK_SLIP_BELOW, SPEEDS > Beam.SLIP_ABOVE
    middle = ~slow & ~fast
    free = per_contact == 0
    grows = np.diff(w_size, axis=-1) > 0
    claims = (
        0.5 * (w_width < Beam.SINGLE).mean(axis=-1) + 0.5 * grows.mean(axis=-1),
        (per_contact[..., slow] > Beam.EVERY).mean(axis=-1),
        (y_width[..., middle] > Beam.SINGLE).mean(axis=-1),
        free[..., middle].mean(axis=-1),
        (free & (y_width < Beam.SINGLE))[..., fast].mean(axis=-1),
    )
    return np.stack(claims, axis=-1)


def in_blocks(make: Make, at_once: int, settings: Settings) -> Callable[[Any, Any], Any]:
    """Results of lanes of sets and belt speeds, `call(coordinates, v)` with one row for each.

    Lanes are taken `at_once`, the last block filled up, because another number of lanes is another
    program. Settings that differ in `NUMBERS` only share one.
    """
    static = tuple(sorted((key, value) for key, value in settings.items() if key not in NUMBERS))
    run = _lanes(make, static)
    numbers = {key: np.full(at_once, float(settings[key])) for key in NUMBERS}

    def call(coordinates: np.ndarray, v: np.ndarray) -> Any:
        rows = np.minimum(np.arange(-(-len(v) // at_once) * at_once), len(v) - 1)
        parts = [
            jax.tree.map(np.asarray, run(jnp.asarray(coordinates[k]), jnp.asarray(v[k]), numbers))
            for k in rows.reshape(-1, at_once)
        ]
        return jax.tree.map(lambda *a: np.concatenate(a)[: len(v)], *parts)

    return call


@functools.cache
def _lanes(make: Make, static: tuple) -> ss.map_lanes:
    settings = dict(static)
    lane = make(settings)
    return ss.map_lanes(lane, executor=settings["executor"])


def every_set(run: Callable[[Any, Any], Any], speeds: np.ndarray) -> Callable[[np.ndarray], Any]:
    """`run` of every set at every speed, arrays `[set, speed, ...]`."""

    def call(sets: np.ndarray) -> Any:
        found = run(np.repeat(sets, speeds.size, axis=0), np.tile(speeds, len(sets)))
        shape = (len(sets), speeds.size)
        return jax.tree.map(lambda a: a.reshape((*shape, *a.shape[1:])), found)

    return call


def _diagram_lane(settings: Settings) -> Lane:
    def lane(coordinates, v, numbers):
        return points(*system_and_start(coordinates, v, settings["modes"]), {**settings, **numbers})

    return lane


def diagram_points(settings: Settings) -> Callable[[Any, Any], Any]:
    """Poincaré points and stick of lanes of sets and speeds."""
    return in_blocks(_diagram_lane, settings["block"] * SPEEDS.size, settings)


def diagram_scorer(settings: Settings) -> Scorer:
    """C2 to C5 of each set; 0 for a set in which a lane failed."""
    run = every_set(diagram_points(settings), SPEEDS)

    def width(a):
        seen = np.isfinite(a)
        top = np.max(np.where(seen, a, -np.inf), axis=-1)
        low = np.min(np.where(seen, a, np.inf), axis=-1)
        size = np.max(np.where(seen, np.abs(a), 0.0), axis=-1)
        return (top - low) / np.where(size > 0, size, 1.0), top

    def call(sets: np.ndarray) -> np.ndarray:
        out = run(sets)
        (y_width, _), (w_width, w_size) = width(out["y"]), width(out["w"])
        per_contact = out["sticks"] * CONTACT_PERIOD / settings["duration"]
        found = items(y_width, w_width, w_size, per_contact)
        return np.where(out["ok"].all(axis=1)[:, None], found, 0.0)

    return call


def _motion_lane(settings: Settings) -> Lane:
    times = settings["dt"] * np.arange(round(settings["recorded"] / settings["dt"]))

    def lane(coordinates, v, numbers):
        options: dict[str, Any] = {"integrator": fixed_step(numbers["h"]), "throw": False}
        begin = numbers["transient"]
        t = begin + times
        system, start = system_and_start(coordinates, v, settings["modes"])
        settled = ss.simulate(system, 0.0, begin, start, saveat=ss.SaveAt(max_events=None), **options)
        run = ss.simulate(
            system, begin, t[-1], settled.y1, settled.mode1,
            saveat=ss.SaveAt(ts=t, sections=stick_section(), max_events=None, max_crossings=512),
            **options,
        )  # fmt: skip
        log = run.outputs
        assert log is not None

        def read(t, y, mode):
            return {
                "y": y.y,
                "w": system.w(t, y),
                "W_f": system.friction_power(t, y, mode),
                "W_b": system.beam_power(t, y, mode),
            }

        signals = jax.vmap(read)(log.t, log.y, log.mode)
        good = settled.successful & run.successful
        return {**signals, "mode": log.mode, "stick_begins": run.crossings[0].t, "ok": good}

    return lane


def motion_scorer(settings: Settings) -> Scorer:
    """C6, C7 and C8 of each set, 1 where the predicates of Figs. 2.5, 2.7 and 2.9 are true."""
    begin, dt = settings["transient"], settings["dt"]
    t = begin + dt * np.arange(round(settings["recorded"] / dt))
    frequency = np.fft.rfftfreq(t.size, dt)
    run = every_set(
        in_blocks(_motion_lane, settings["block"] * len(MOTIONS), settings), np.array(MOTIONS)
    )

    def holds(found: dict[str, np.ndarray], judge: Judge) -> bool:
        """Whether the one statement of a figure is true of a motion."""
        if not found["ok"]:
            return False
        data = {name: ("time", found[name]) for name in ("y", "w", "W_f", "W_b", "mode")}
        for name in ("y", "w"):
            amplitude = np.asarray(amplitude_spectrum(found[name], dt).amplitude)
            data[f"{name}_amplitude"] = ("frequency", amplitude)
        data["stick_begins"] = ("stick", found["stick_begins"])
        one = xr.Dataset(data, {"time": t, "frequency": frequency}, {"dropped": begin})
        return bool(judge(one.expand_dims(variant=[FOUND]))[0].holds)

    def call(sets: np.ndarray) -> np.ndarray:
        found = run(sets)
        # Belt speed and judge of C6, C7 and C8.
        judges = ((0, judge_stick_slip), (0, judge_powers), (1, judge_slow_frequency))
        return np.array(
            [
                [holds({k: a[i, speed] for k, a in found.items()}, judge) for speed, judge in judges]
                for i in range(len(sets))
            ],
            float,
        )

    return call


def _exponent_lane(settings: Settings) -> Lane:
    def lane(coordinates, v, numbers):
        system, start = system_and_start(coordinates, v, settings["modes"])
        found = lyapunov_spectrum(
            system, start, Segments(0.5, settings["segments"], numbers["transient"]), exponents=1,
            components=DRIVEN, scales=norm_of(system), integrator=fixed_step(numbers["h"]),
        )  # fmt: skip
        return {"exponent": found.exponents[0], "error": found.error[0]}

    return lane


def greatest_exponents(settings: Settings) -> Callable[[Any, Any], Any]:
    """Greatest exponent of y and the beam, and its error, of lanes of sets and speeds."""
    return in_blocks(_exponent_lane, settings["block"] * SPEEDS.size, settings)


def exponent_scorer(settings: Settings) -> Scorer:
    """C9a: share of `SPEEDS` at which the greatest exponent is above twice its error."""
    run = every_set(greatest_exponents(settings), SPEEDS)

    def call(sets: np.ndarray) -> np.ndarray:
        found = run(sets)
        return (found["exponent"] > Beam.ERRORS * found["error"]).mean(axis=1, keepdims=True)

    return call


def scorer(settings: Settings, *parts: Callable[[Settings], Scorer]) -> Scorer:
    """Items of each set, `[set, item]`, of several scorers side by side."""
    made = [part(settings) for part in parts]
    return lambda sets: np.concatenate([part(sets) for part in made], axis=1)
