r"""A synthetic CoreXY machine, two records of it, and what its fits and intervals come to.

Everything but gravity is drawn within `WITHIN` of Table 1 with the tensions and static belt friction of
scenario 3, where both belts hold until they slip. The six unknowns are those of `identify-corexy`;
all else is known, as from data sheets and a balance.

A slow ramp until a belt slips comes first, and tells its tension to 20%; it serves nothing but the
inputs of two records. One is gentle: the belts hold, and friction on the ground and tensions show. In
the other pulses rise above what the belts hold, and their kinetic friction shows. Both inputs are
designed for each machine, with the values of Table 1 and others around them for the other unknowns.
Every signal has normal noise of a part `NOISE` of its own root mean square.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import corexy_jax as cx
import stickslip as ss
from stickslip.identification import (
    Fit,
    LevenbergMarquardt,
    Profile,
    least_squares,
    profile,
    sensitivity,
)

from ..corexy._input import Input
from ._many import Case
from .coverage import PROFILED

NAMES = tuple(sorted(cx.FITTED_PARAMETERS))
BELTS = ("mu_1k_b", "mu_2k_b")
KNOWN = ("m", "M", "J", "J_passive", "r", "R", "K_t", "K_e", "mu_1s_b", "mu_2s_b")
WITHIN, NOISE, AWAY = 0.5, 0.01, 0.8
DURATION, RATE, PIECE = 2.0, 100.0, 0.125  # [s], [1/s], [s]
TIMES = np.linspace(0.0, DURATION, round(DURATION * RATE) + 1)[1:]
BEGINS = np.arange(0.0, DURATION, PIECE)
TOLERANCE = 1e-7
FINEST = (1e-3, 1e-3, 1e-6, 1e-6)  # noise of signals that hardly move [rad/s, rad/s, m, m]
RAMP = 0.2  # how far a slow ramp until a belt slips may be wrong about its tension
LOW, HIGH, PULSES = (0.25, 0.75), (2.0, 5.0), 0.15
AROUND = ((1.0, 1.0), (0.85, 0.6), (1.2, 1.4))  # factors of tensions, friction for the design
ENOUGH = 10.0  # a worst combination to 10% is enough
HORIZONS = (0.25, 0.5, 1.0)  # parts of the records that a start is led through
MAX_STEPS = 60
WINDOWS = 4
LOWER, AGAIN = 1e-3, 3  # fall of the sum of squares along a profile for which a fit starts again
REFITS = 3
UNDECIDED = 3  # of a verdict
LONGER, NEAR = 4, 3.0  # fits that go on where they are near the noise, in reduced chi squared
TABLE = cx.scenario(3).parameters


def voltage(ends: Any) -> Input:
    """Ramps [V] from `ends[piece, 0]` to `ends[piece, 1]`, with jumps between."""
    begin, slope = ends[:, 0], (ends[:, 1] - ends[:, 0]) / PIECE
    none = cx.Harmonic(0.0, 0.0)
    return Input(BEGINS, begin[:, 0], begin[:, 1], slope[:, 0], slope[:, 1], none)


def shown(machine: cx.CoreXYParameters, ends: Any) -> Any:
    """What the machine shows `[signal, time]` under one input."""
    integrator = ss.Integrator("tsit5", ss.AdaptiveStep(TOLERANCE, TOLERANCE))
    return jnp.stack(cx.measurement(machine, voltage(ends), jnp.asarray(TIMES), integrator=integrator))


def both(machine: cx.CoreXYParameters, ends: Any) -> Any:
    """The same `[record, signal, time]` under both."""
    return jax.lax.map(lambda one: shown(machine, one), ends)


def noise_of(found: Any) -> Any:
    """Standard deviations `[..., signal]` of the noise of what is shown `[..., signal, time]`."""
    size = jnp.sqrt(jnp.mean(jnp.asarray(found) ** 2, axis=-1))
    return jnp.maximum(NOISE * size, jnp.broadcast_to(jnp.asarray(FINEST), size.shape))


def _residual(values, data, machine, ends, sigma, keep):
    found = both(cx.with_values(machine, values), ends)
    return (keep * (found - data) / sigma[..., None]).reshape(-1)


@jax.jit
def _fit(start, *data) -> Fit:
    method = LevenbergMarquardt(max_steps=MAX_STEPS)
    return least_squares(lambda values: _residual(values, *data), start, method)


@jax.jit
def _profile(fit, *data) -> Profile:
    return profile(lambda values: _residual(values, *data), fit, max_steps=250)


@jax.jit
def _information(values, machine, ends) -> Any:
    """Of one record about the logarithms of the unknowns, at noise of the part of each signal."""

    def rows(values):
        found = shown(cx.with_values(machine, values), ends)
        return (found / jax.lax.stop_gradient(noise_of(found))[..., None]).reshape(-1)

    matrix = sensitivity(rows, values).matrix
    return matrix.T @ matrix


_clean = jax.jit(both)
_rows = jax.jit(_residual)


def drawn(rng: np.random.Generator) -> dict[str, np.float64]:
    """All parameters of a machine."""
    values = {
        name: np.float64(float(getattr(TABLE, name)) * rng.uniform(1.0 - WITHIN, 1.0 + WITHIN))
        for name in (*KNOWN, *NAMES)
    }
    ramps = {
        f"ramp_{name}": values[name] * rng.uniform(1.0 - RAMP, 1.0 + RAMP) for name in ("P1", "P2")
    }
    return values | ramps | {"r_f": values["r"]}


def machine_of(values: dict[str, Any]) -> cx.CoreXYParameters:
    """The machine with these values, ramps apart."""
    return cx.with_values(TABLE, {name: values[name] for name in (*KNOWN, *NAMES, "r_f")})


def candidates(rng: np.random.Generator, known: dict[str, Any], count: int) -> np.ndarray:
    """Inputs [V], `[gentle or rough, candidate, piece, end, motor]`, in parts of the voltages at
    which the belts slip, as the ramps told: below `LOW`, in the rough ones with pulses in `HIGH`. What
    lies between is left out: where a belt just slips or does not, the motion jumps with the unknowns.
    """
    held = [known[f"mu_{i}s_b"] * known[f"ramp_P{i}"] for i in (1, 2)]
    limit = known["r"] * known["R"] / known["K_t"] * np.array(held)
    shape = (2, count, BEGINS.size, 2, 2)
    size = np.exp(rng.uniform(np.log(LOW[0]), np.log(LOW[1]), (2, count, 1, 1, 1)))
    ends = size * rng.uniform(-1.0, 1.0, shape)
    pulse = (count, BEGINS.size, 1, 2)
    level = rng.uniform(*HIGH, pulse) * rng.choice([-1.0, 1.0], pulse)
    ends[1] = np.where(rng.uniform(size=pulse) < PULSES, level, ends[1])
    ends[:, :, 0, 0] = 0.0
    return ends * limit


def designed(
    rng: np.random.Generator, known: dict[str, Any], count: int, rounds: int
) -> tuple[np.ndarray, float]:
    """Of pairs of `count` candidates each, a gentle and a rough one, that whose worst seen combination
    is seen best in the worst of the cases `AROUND`; and that smallest singular value. Where it is
    small, more candidates are drawn, in so many `rounds`."""
    machine = cx.with_values(TABLE, {name: known[name] for name in (*KNOWN, "r_f")})
    best: tuple[Any, float] = (None, -1.0)
    for _ in range(rounds):
        inputs = candidates(rng, known, count)
        least = np.full((count, count), np.inf)
        for tension, friction in AROUND:
            values = {
                name: np.float64(
                    tension * known[f"ramp_{name}"]
                    if name[0] == "P"
                    else friction * float(getattr(TABLE, name))
                )
                for name in NAMES
            }
            gentle, rough = (
                np.stack([np.asarray(_information(values, machine, ends)) for ends in kind])
                for kind in inputs
            )
            whole = gentle[:, None] + rough[None]
            good: Any = np.isfinite(whole).all(axis=(-2, -1))
            eigenvalues = np.linalg.eigvalsh(np.where(good[..., None, None], whole, 0.0))
            least = np.minimum(least, eigenvalues[..., 0])
        i, j = np.unravel_index(np.argmax(least), least.shape)
        found = float(np.sqrt(max(least[i, j], 0.0)))
        if found > best[1]:
            best = np.stack([inputs[0, i], inputs[1, j]]), found
        if found >= ENOUGH:
            break
    return best


def kept(part: float) -> np.ndarray:
    """Weights `[signal, time]` that show a fit the first part of a record."""
    shape = (len(cx.Measurement._fields), TIMES.size)
    return np.broadcast_to(TIMES <= part * DURATION, shape).astype(np.float64)


def led(run: Any, start: dict[str, Any], truth: dict[str, Any], *data: Any, horizons=HORIZONS) -> Fit:
    """The fit from one start, led through ever longer parts of the records."""
    fit = None
    for part in horizons:
        fit = run(start, *data, kept(part))
        # What a short part does not show may have run away.
        start = {
            name: np.float64(np.clip(float(fit.values[name]), truth[name] / 1e3, truth[name] * 1e3))
            for name in start
        }
    assert fit is not None
    for _ in range(LONGER):
        if bool(fit.successful) or not float(fit.reduced_chi_squared) < NEAR:
            break
        fit = run(start, *data, kept(1.0))
        start = {name: np.float64(float(fit.values[name])) for name in start}
    return fit


def limit_of(rows: int, unknowns: int) -> float:
    """Sum of squares up to which a fit is taken to be at the noise."""
    from scipy.stats import chi2

    return float(chi2.ppf(1.0 - 1e-4, rows - unknowns))


class Search:
    """The best of fits from afar.

    The gentle record comes first: it tells friction on the ground and tensions without the friction of
    the belts. Where friction is too large nothing moves, and a fit has no slope to follow; where it is
    too small the sum of squares is larger still. So of many starts those are tried first whose motion
    is as large as that of the data, window by window, until one comes down to the noise. From there
    all six are fitted to both records, with that draw of the belts' friction that is nearest.
    """

    def __init__(self, truth, machine, ends, data, sigma, rng, starts: int, tries: int):
        self.truth, self.machine, self.rng = truth, machine, rng
        self.data = (data, machine, ends, sigma)
        factors = rng.uniform(1.0 - AWAY, 1.0 + AWAY, (starts, len(NAMES)))
        self.starts = [{name: truth[name] * row[i] for i, name in enumerate(NAMES)} for row in factors]
        self.limit = limit_of(data.size, len(NAMES))
        self.gentle_costs, self.costs = np.full((2, tries), np.nan)
        self.tried = 0

    def best(self) -> Fit:
        gentle_limit = limit_of(self.data[0][0].size, len(NAMES) - len(BELTS))
        best, nearest = None, None
        for k in self._order()[: self.costs.size]:
            start = self.starts[k]
            fit = self._gentle(start)
            cost = self.gentle_costs[self.tried] = 2.0 * float(fit.cost)
            self.tried += 1
            if nearest is None or cost < 2.0 * float(nearest.cost):
                nearest = fit
            if cost <= gentle_limit:
                whole = self._whole(fit)
                self.costs[self.tried - 1] = 2.0 * float(whole.cost)
                if best is None or float(whole.cost) < float(best.cost):
                    best = whole
                if self._good(best):
                    break
        assert nearest is not None
        return self._whole(nearest) if best is None else best

    def _order(self) -> np.ndarray:
        """Of the starts, nearest first, by the size of the motion in the gentle record."""
        data, machine, ends, sigma = self.data
        wanted = sizes(data[:1], sigma[:1])
        far = []
        for start in self.starts:
            found = np.asarray(_clean(cx.with_values(machine, start), ends[:1]))
            far.append(np.mean(np.abs(sizes(found, sigma[:1]) - wanted)))
        return np.argsort(np.nan_to_num(far, nan=np.inf), kind="stable")

    def _gentle(self, start: dict[str, Any]) -> Fit:
        data, machine, ends, sigma = self.data
        machine = cx.with_values(machine, {name: start[name] for name in BELTS})
        ground = {name: start[name] for name in NAMES if name not in BELTS}
        return led(_fit, ground, self.truth, data[:1], machine, ends[:1], sigma[:1])

    def _whole(self, fit: Fit) -> Fit:
        """All six from what the gentle record told: from the draw, of those that it allows and of any
        friction of the belts, that is nearest to both records."""
        names, rows = fit.names, self._drawn_around(fit)
        draws = [
            dict(zip(names, row, strict=True)) | {name: start[name] for name in BELTS}
            for row, start in zip(rows, self.starts, strict=True)
        ]
        nearest, best = min(draws, key=self._squares), None
        for horizons in ((1.0,), HORIZONS):
            fit = led(_fit, nearest, self.truth, *self.data, horizons=horizons)
            if best is None or float(fit.cost) < float(best.cost):
                best = fit
            if self._good(best):
                break
        assert best is not None
        return best

    def _good(self, fit: Fit) -> bool:
        return 2.0 * float(fit.cost) <= self.limit and bool(fit.successful)

    def profiled(self, fit: Fit) -> tuple[Fit, Profile, int]:
        """The profile of the fit, or of a better one that is found around it: a fit ends at an edge of
        the sum of squares, where a slip more or less begins, as at a minimum."""
        found, rounds = _profile(fit, *self.data, kept(1.0)), 1
        while self._doubtful(fit, found) and rounds <= AGAIN:
            every = found.others.values()
            points = np.stack([np.ravel([others[n] for others in every]) for n in NAMES], axis=-1)
            points = points[np.isfinite(points).all(axis=1)]
            rows = np.concatenate([self._drawn_around(fit), points])
            sets: list[dict[str, Any]] = [dict(zip(NAMES, row, strict=True)) for row in rows]
            near = sorted(sets, key=self._squares)
            again = [
                led(_fit, start, self.truth, *self.data, horizons=(1.0,)) for start in near[:REFITS]
            ]
            best = min(again, key=lambda other: float(other.cost))
            if not 2.0 * float(best.cost) < 2.0 * float(fit.cost) - LOWER:
                break
            fit, rounds = best, rounds + 1
            found = _profile(fit, *self.data, kept(1.0))
        return fit, found, rounds

    def _doubtful(self, fit: Fit, found: Profile) -> bool:
        at_noise = 2.0 * float(fit.cost) <= self.limit
        lower = float(found.fall) > LOWER
        return at_noise and (
            lower or bool((np.asarray(list(found.verdict.values())) == UNDECIDED).any())
        )

    def _drawn_around(self, fit: Fit) -> np.ndarray:
        """Values as likely as a Wald interval says, none further than a factor e from the fit."""
        middle = np.array([float(fit.values[name]) for name in fit.names])
        spread = np.nan_to_num(np.asarray(fit.covariance())) / np.outer(middle, middle)
        size = len(self.starts)
        off = self.rng.multivariate_normal(np.zeros(middle.size), spread, size, check_valid="ignore")
        return middle * np.exp(np.clip(off, -1.0, 1.0))

    def _squares(self, values: dict[str, Any]) -> float:
        """Sum of squares; infinite where the run fails."""
        found = np.asarray(_rows(values, *self.data, kept(1.0)))
        return float(np.nan_to_num(np.sum(found**2), nan=np.inf))


def sizes(found: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Logarithm of the root mean square of each signal in each of `WINDOWS`, noise included."""
    parts = np.array_split(found / sigma[..., None], WINDOWS, axis=-1)
    return np.log([np.sqrt(1.0 + np.mean(part**2, axis=-1)) for part in parts])


def one(parameters: dict[str, Any], number: int) -> Case:
    """A machine: its records, the best of its fits, and the intervals."""
    rng = np.random.default_rng((parameters["seed"], number))
    known = drawn(rng)
    truth = {name: known[name] for name in NAMES}
    ends, singular = designed(rng, known, parameters["candidates"], parameters["rounds"])
    machine = machine_of(known)
    clean = np.asarray(_clean(machine, ends))
    sigma = np.asarray(noise_of(clean))
    data = clean + sigma[..., None] * rng.standard_normal(clean.shape)
    # Nothing of the unknowns is handed on with what is known.
    given = cx.with_values(machine, {name: np.float64(float(getattr(TABLE, name))) for name in NAMES})
    search = Search(truth, given, ends, data, sigma, rng, parameters["starts"], parameters["tries"])
    best, found, rounds = search.profiled(search.best())
    errors = best.standard_errors()
    return {
        "truth": [truth[name] for name in NAMES],
        "machine": [known[name] for name in KNOWN],
        "error": [float(errors[name]) for name in NAMES],
        **{key: [getattr(found, key)[name] for name in NAMES] for key in (*PROFILED, "evaluations")},
        "fall": found.fall, "successful": best.successful,
        "least": 2.0 * float(best.cost), "limit": search.limit, "starts": search.tried,
        "rounds": rounds,
        "of_start": search.costs,
        "gentle_of_start": search.gentle_costs,
        "singular_value": best.sensitivity.singular_values, "foreseen": singular,
        "at_truth": float(np.sum(np.asarray(_rows(truth, *search.data, kept(1.0))) ** 2)),
        "input": ends, "root_mean_square": np.sqrt(np.mean(clean**2, axis=-1)),
    }  # fmt: skip
