"""A fit of the tensions in words: which belt is which, what to do, and how far to trust it."""

import math
import textwrap
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from stickslip.identification import Fit, Profile

from ._machine import Machine

GOOD = 1.5  # reduced chi squared of a fit that needs no other start
FAR = 10.0  # above it the model does not describe the log
NOISIEST = 0.01  # part of its range that the noise of a sensor is at most
SURE = 1.96  # standard errors of an interval of 95%
# The virtual pulleys turn by (x + y)/r and (x - y)/r: with the one at rest, the other belt runs.
WHICH = (
    "Belt 1 goes from the collar round motor 1 and back to it, belt 2 round motor 2. Turn motor 1 by "
    "hand while motor 2 is held: the collar runs along x = y. Motor 2, while motor 1 is held, moves "
    "it along x = -y."
)


def advice(
    fit: Fit, profile: Profile | None, tensions: Mapping[str, float], noise: Mapping[str, float],
    ranges: Mapping[str, float],
) -> list[str]:  # fmt: skip
    """Sentences for who has a spanner in the hand.

    `tensions` P1, P2 [N], those that were not fitted as given; `noise`: the root mean square of the
    residuals of each signal, in its unit; `ranges`: from the least to the greatest of it.
    """
    chi_squared = float(fit.reduced_chi_squared)
    if not chi_squared <= FAR:
        # Nobody's sensors are off by as much.
        believable = all(size <= NOISIEST * ranges[name] for name, size in noise.items())
        return [_void(chi_squared, noise if believable else {})]
    said = [WHICH]
    verdicts = {} if profile is None else profile.verdicts
    errors = {name: float(error) for name, error in fit.standard_errors().items()}
    fitted = [name for name in tensions if name in errors]
    lost = [
        name for name in fitted
        if not math.isfinite(errors[name]) or verdicts.get(name, "identifiable") != "identifiable"
    ]  # fmt: skip
    if not fitted:
        said.append("The tensions were not among the unknowns: this fit says nothing about them.")
    elif lost:
        said.append(
            f"This log does not show {' and '.join(lost)}: leave the belts as they are, move "
            "the machine otherwise, with jumps of the voltage in both directions of both motors, and "
            "fit again. Check its units first (--set units=time=ms,...)."
        )
    else:
        half = SURE * _error_of_difference(fit, fitted, chi_squared > GOOD)
        said.append(looser(tensions["P1"], tensions["P2"], half))
        said += [
            f"The tension {name} = {value:.4g} N was taken as given."
            for name, value in tensions.items() if name not in fitted
        ]  # fmt: skip
        said.append(
            "Identifiable: the data bound the tensions on both sides."
            if profile is not None
            else "The data see the tensions to first order; --set profile=true tests them farther off."
        )
    return [*said, _trust(chi_squared, noise)]


def _error_of_difference(fit: Fit, names: list[str], robust: bool) -> float:
    """Standard error of P1 - P2 [N], where both were fitted with their correlation."""
    places = [list(fit.names).index(name) for name in names]
    covariance = np.asarray(fit.covariance(robust))[np.ix_(places, places)]
    signs = np.array([1.0, -1.0])[: len(names)]
    return math.sqrt(float(signs @ covariance @ signs))


def looser(one: float, two: float, half: float) -> str:
    """Which belt is looser by how much [N], and what to do."""
    less = abs(one - two)
    if less <= half:
        return (
            f"The belts are equally tight as far as this log shows: {one:.4g} N and {two:.4g} N, which "
            f"differ by {less:.2g} N +- {half:.2g} N (95%). There is nothing to do."
        )
    loose, tight = (1, 2) if one < two else (2, 1)
    digits = max(0, 1 - math.floor(math.log10(half))) if half > 0.0 else 2
    low, high = min(one, two), max(one, two)
    return (
        f"Belt {loose} is looser, {low:.{digits}f} N against {high:.{digits}f} N, {less / high:.0%} "
        f"less. Tighten belt {loose} by {less:.{digits}f} N +- {half:.{digits}f} N (95%) to match belt "
        f"{tight}."
    )


def _option(noise: Mapping[str, float]) -> str:
    return "--set noise=" + ",".join(f"{name}={size:.2g}" for name, size in noise.items())


def _void(chi_squared: float, noise: Mapping[str, float]) -> str:
    """The one thing to say of a fit that does not describe the log."""
    option = f" If your sensors are as noisy as that, say so by {_option(noise)}." if noise else ""
    return (
        f"VOID: the residuals are {math.sqrt(chi_squared):.3g} times the noise that was assumed "
        f"(reduced chi squared {chi_squared:.3g}), so the machine computed is not the one measured, "
        "and nothing is said about the belts. Look at the picture; check units and signs "
        "(--set units=...), and that --set machine=FILE is your machine; take more --set starts=, or "
        "gentler voltages." + option
    )


def _trust(chi_squared: float, noise: Mapping[str, float]) -> str:
    """How far the numbers can be trusted."""
    ratio = math.sqrt(chi_squared)
    if chi_squared > GOOD:
        return (
            f"The residuals are {ratio:.3g} times the noise that was assumed (reduced chi squared "
            f"{chi_squared:.3g}). The interval of the advice takes them as they are; those of the "
            "table and of a profile trust the assumed noise and are too narrow. If your sensors are as "
            f"noisy as that, say so by {_option(noise)}."
        )
    if chi_squared < 1.0 / GOOD:
        return (
            f"The residuals are only {ratio:.2g} of the noise that was assumed (reduced chi squared "
            f"{chi_squared:.3g}), so the intervals are too wide. Say the noise by {_option(noise)}."
        )
    return (
        "The residuals are as large as the noise that was assumed (reduced chi squared "
        f"{chi_squared:.3g}): the intervals stand."
    )


def score_told(chi_squared: float) -> str:
    """What the worst chi squared of a signal of a further log says of the machine that was fitted."""
    if chi_squared <= GOOD:
        return "The machine that was fitted explains this log as well as its noise allows."
    return (
        f"The machine that was fitted is off this log by up to {math.sqrt(chi_squared):.3g} times the "
        "noise that was assumed: it is not the same machine, or this log is noisier."
    )


def lines_of(said: str) -> list[str]:
    """The sentences as lines that stand beneath the sketch."""
    return [line for text in said.split("\n") for line in textwrap.wrap(text, 62)]


def sketch(axis: Axes, tensions: Mapping[str, float], said: str) -> None:
    """The machine from above with the tension at each motor, and the sentences beneath it."""
    machine = Machine(axis, 1.0, 0.8)
    machine.move(0.6, 0.35, (0.0, 0.0), (False, False))
    for (x, y), (name, value) in zip(machine.centres, tensions.items(), strict=True):
        axis.annotate(
            f"{name} = {value:.3g} N", (x, y), (0.0, -34.0), textcoords="offset points", ha="center"
        )
    axis.annotate("x", (0.2, 0.05), (0.45, 0.05), arrowprops={"arrowstyle": "<-"}, va="center")
    axis.annotate("y", (0.2, 0.05), (0.2, 0.27), arrowprops={"arrowstyle": "<-"}, ha="center")
    axis.annotate(
        "\n".join(lines_of(said)), (0.0, 0.0), (0.0, -48.0), xycoords="axes fraction", fontsize=7,
        va="top", textcoords="offset points",
    )  # fmt: skip
