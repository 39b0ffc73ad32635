"""Combinations of the unknowns that the data do not see, in words."""

import fractions
from typing import Any

import numpy as np

from .._argument_checks import check_arguments
from .._types import Given
from ._accuracy import ACCURACY
from ._fit import Fit, one_fit


@check_arguments(fit=one_fit)
def unseen(fit: Given[Fit]) -> list[str]:
    """Unknowns that the data do not see, a sentence for each group of unknowns that hide each other.

    Positive unknowns hide each other in products, e.g. `"k1 * k2 is seen, k1 / k2 is not"`; others in
    sums, with coefficients in their units. To first order, at the estimate. Both lists of a sentence
    name as many combinations as there are; other ones can be made of them.

    >>> import jax.numpy as jnp
    >>> from stickslip.identification import least_squares
    >>> fit = least_squares(
    ...     lambda p: jnp.stack([p["k1"] * p["k2"] - 6.0, p["c"] - 1.0]), dict(k1=1.0, k2=1.0, c=2.0)
    ... )
    >>> unseen(fit)
    ['k1 * k2 is seen, k1 / k2 is not']

    **Arguments:** `fit`, one. **Raises** `TypeError`, `ValueError` for anything else; it reads numbers
    and does not work under `jit`.
    """
    hidden = np.asarray(fit.sensitivity.directions)[~np.asarray(fit.sensitivity.seen_directions())]
    if not hidden.size:
        return []
    # In products where all that hide each other are positive numbers, otherwise in sums.
    slopes = np.asarray(fit.slopes)
    positive = [bounds[0] == 0.0 and bounds[1] is None for bounds in fit.space.bounds]
    sentences = []
    for group in _groups(hidden):
        names = [fit.names[i] for i in group]
        rows = hidden[:, group]
        rows = rows[np.linalg.norm(rows, axis=1) > ACCURACY.part]
        if len(group) == 1:
            sentences.append(f"{names[0]} is not seen")
            continue
        scale = np.abs(slopes[group])
        if all(positive[i] for i in group):
            unknown, known = (_echelon_form(part(rows)) for part in (_span, _complement))
            lost, seen = ([_product(names, row) for row in part] for part in (unknown, known))
        else:
            signed = slopes[group]
            unknown, known = (
                _echelon_form(_span(rows * signed)),
                _echelon_form(_complement(rows)) / signed,
            )
            lost, seen = ([_sum(names, row, scale) for row in part] for part in (unknown, known))
        if not seen:
            sentences.append(f"none of {', '.join(names)} is seen")
            continue
        sentences.append(f"{_list_of(seen)} seen, {_list_of(lost)} not")
    return sentences


def _list_of(words: list[str]) -> str:
    return f"{', '.join(words)} {'is' if len(words) == 1 else 'are'}"


def _groups(hidden: np.ndarray) -> list[list[int]]:
    """Unknowns with a part in common combinations that are not seen."""
    # The projection on what is not seen does not depend on the basis that was found for it.
    joined = np.abs(hidden.T @ hidden) > ACCURACY.part
    left, groups = {int(i) for i in np.flatnonzero(joined.any(axis=0))}, []
    while left:
        group, new = set(), {min(left)}
        while new:
            group |= new
            new = {int(j) for i in new for j in np.flatnonzero(joined[i])} - group
        groups.append(sorted(group))
        left -= group
    return groups


def _span(rows: np.ndarray) -> np.ndarray:
    _, s, directions = np.linalg.svd(rows, full_matrices=False)
    return directions[s > ACCURACY.part * s[0]]


def _complement(rows: np.ndarray) -> np.ndarray:
    _, s, directions = np.linalg.svd(rows, full_matrices=True)
    return directions[int(np.sum(s > ACCURACY.part * s[0])) :]


def _echelon_form(rows: np.ndarray) -> np.ndarray:
    """The same span by rows with a one where all others have zeros, as far as there are ones."""
    rows, done = rows.copy(), 0
    for column in range(rows.shape[1]):
        if done == len(rows):
            break
        best = done + int(np.argmax(np.abs(rows[done:, column])))
        if abs(rows[best, column]) < ACCURACY.part:
            continue
        rows[[done, best]] = rows[[best, done]]
        rows[done] /= rows[done, column]
        for other in range(len(rows)):
            if other != done:
                rows[other] -= rows[other, column] * rows[done]
        done += 1
    return rows


def _whole(row: np.ndarray) -> list[Any]:
    """Exponents as small integers where they are such numbers times one factor."""
    found = [fractions.Fraction(float(x)).limit_denominator(ACCURACY.largest_denominator) for x in row]
    if any(abs(float(f) - x) > 1e-3 for f, x in zip(found, row, strict=True)):
        return [round(float(x), 2) for x in row]
    common = int(np.lcm.reduce([f.denominator for f in found]))
    return [int(f * common) for f in found]


def _product(names: list[str], row: np.ndarray) -> str:
    powers = [(n, e) for n, e in zip(names, _whole(row), strict=True) if abs(e) > ACCURACY.part]
    above = [n if e == 1 else f"{n}^{e}" for n, e in powers if e > 0]
    below = [n if e == -1 else f"{n}^{-e}" for n, e in powers if e < 0]
    text = " * ".join(above) or "1"
    if below:
        under = " * ".join(below)
        text += f" / ({under})" if len(below) > 1 else f" / {under}"
    return text


def _sum(names: list[str], row: np.ndarray, scale: np.ndarray) -> str:
    """A term for each unknown that matters when all change by their own sizes."""
    part = np.abs(row) * scale
    least = ACCURACY.part * np.max(part)
    kept = [(n, c) for n, c, p in zip(names, row, part, strict=True) if p > least]
    text, first = "", abs(kept[0][1])
    for n, c in kept:
        c = c / first
        size = "" if abs(abs(c) - 1.0) < 1e-3 else f"{abs(c):.3g} "
        sign = (" - " if c < 0 else " + ") if text else ("-" if c < 0 else "")
        text += f"{sign}{size}{n}"
    return text
