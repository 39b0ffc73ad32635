"""The statements B1 to B6 and a cascade from below as a score of a parameter set."""

from typing import NamedTuple

import numpy as np

from .._thresholds import Block

LIMIT = 0.04  # [1/s]
END_OF_CHAOS, SPECIAL = Block.END_OF_CHAOS, Block.SPECIAL
ITEMS = ("B1", "B2", "B3", "B4", "B5", "B6", "cascade")


class Regimes(NamedTuple):
    """What a model does along rising k3, and at `SPECIAL`.

    `period`: maxima of x after which the motion repeats, 0 if it does not, -1 if that cannot be told;
    `chaotic`: whether it is
    chaos, judged by the exponent or, in the first look, by the missing period.
    """

    k3: np.ndarray
    period: np.ndarray
    chaotic: np.ndarray
    special_period: int
    special_chaotic: bool


def chaotic(period: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """Whether a motion counts as chaos: no period, and a largest exponent [1/s] above 0.04.

    Over a minute the exponent of a periodic motion is off zero by up to 0.05 1/s, as the tangent's
    length follows the speed along the orbit; a slow transient has no period either. Chaos is both.
    """
    return (np.asarray(period) == 0) & (np.asarray(exponent) > LIMIT)


def doubling(model: Regimes) -> float | None:
    """Least k3 at which the first period has doubled, from there on; None if it begins doubled."""
    # A lane without a period that is not chaos has not settled: it says nothing.
    told = (model.period > 0) | model.chaotic
    period, wild, k3 = model.period[told], model.chaotic[told], model.k3[told]
    if period.size < 3 or period[0] <= 0 or period[0] != period[:3].min():
        return None
    more = (period >= 2 * period[0]) | wild
    settled = np.flatnonzero(more[:-1] & more[1:])
    return float(k3[settled[0]]) if settled.size else None


def cascade(model: Regimes) -> float:
    """How much of p, 2p, 4p, chaos the motion goes through along rising k3: 0 to 1.

    Two thirds for one doubling before chaos, 1 for two or more; half of it, without the last third,
    if another period comes in between. Lanes without a period that are not chaos are passed over.
    """
    first, ratio, doublings = model.period[0], 1, 0
    if first <= 0:
        return 0.0
    for period, is_chaotic in zip(model.period, model.chaotic, strict=True):
        if is_chaotic:
            return (min(doublings, 2) + 1) / 3 if doublings else 0.0
        if period <= 0 or period == ratio * first:
            continue
        if period == 2 * ratio * first:
            ratio, doublings = 2 * ratio, doublings + 1
        else:
            return min(doublings, 2) / 6
    return min(doublings, 2) / 3


def end_of_chaos(model: Regimes) -> float | None:
    """Greatest k3 with chaos, None without any or if it reaches the last value."""
    if not model.chaotic.any() or model.chaotic[-1]:
        return None
    return float(model.k3[np.flatnonzero(model.chaotic)[-1]])


def _near(a: float | None, b: float | None, width: float) -> float:
    return 0.0 if a is None or b is None else max(0.0, 1.0 - abs(a - b) / width)


def variety(model: Regimes) -> float:
    """1 for three kinds of motion or more, of which one period, another, chaos."""
    kinds = set(model.period[model.period > 0].tolist()) | ({-1} if model.chaotic.any() else set())
    return min(len(kinds) - 1, 2) / 2 if kinds else 0.0


def first_look(simple: Regimes) -> float:
    """Score of the simplified model alone, by which sets are ranked: at most 4."""
    periodic = simple.special_period > 0
    return (
        variety(simple)
        + cascade(simple)
        + _near(end_of_chaos(simple), END_OF_CHAOS, 4.0)
        + float(periodic and not simple.special_chaotic)
    )


def score(simple: Regimes, full: Regimes) -> dict[str, float]:
    """Each of `ITEMS` between 0 (does not hold) and 1 (holds)."""
    one, other = doubling(simple), doubling(full)
    step = float(np.diff(simple.k3).mean())
    ends = end_of_chaos(simple), end_of_chaos(full)
    inside = simple.chaotic | full.chaotic
    differ = float((simple.chaotic != full.chaotic)[inside].mean()) if inside.any() else 0.0
    earlier = one is not None and other is not None and other <= one - 0.99 * step
    wider = bool(simple.chaotic.any() and full.chaotic.sum() > simple.chaotic.sum())
    return {
        "B1": 0.5 * (variety(simple) + variety(full)),
        "B2": float(earlier),
        "B3": float(wider),
        "B4": 0.5 * (_near(*ends, 2.0) + _near(ends[0], END_OF_CHAOS, 2.0)),
        "B5": 0.5 * (float(simple.special_period > 0) * (not simple.special_chaotic))
        + 0.5 * float(full.special_chaotic),
        "B6": min(differ / Block.DIFFERENT, 1.0),
        "cascade": cascade(simple),
    }
