"""Stiffness and damping of the belts and friction from accelerations at the head."""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from stickslip.checks import (
    Given,
    Row,
    check_increasing,
    check_known,
    check_type,
    one_row,
    refusal,
    shape_refusal,
    whole_number,
)
from stickslip.hybrid import jit_plainly
from stickslip.identification import Fit, LevenbergMarquardt, Unknown, least_squares

from ._belts import Belts
from ._head_response import head_speeds
from ._machine import ElasticCoreXY
from ._stepper import Stepper
from ._trajectory import Trajectory


class HeadRecord(eqx.Module):
    """Accelerations of the collar, and the path along which the motors were commanded meanwhile.

    **Arguments**

    - `path`: a `Trajectory`, such as a `resonance_sweep`, in the coordinates of the machine.
    - `times` [s]: even, but for missing samples; on a clock of its own, which `fit_belts` finds.
    - `x`, `y` [m/s²]: rows as long; their means do not matter.

    **Raises** `TypeError`, `ValueError` naming the argument.
    """

    path: Trajectory
    times: np.ndarray
    x: np.ndarray
    y: np.ndarray

    def __init__(self, path: Given[Trajectory], times: Row, x: Row, y: Row):
        self.path = check_type("path", path, Trajectory, "a Trajectory")
        self.times, self.x, self.y = (
            np.asarray(one_row(name, check_known(name, row), least=64), np.float64)
            for name, row in (("times", times), ("x", x), ("y", y))
        )
        check_increasing("times", self.times)
        for name, row in (("x", self.x), ("y", self.y)):
            if row.shape != self.times.shape:
                raise shape_refusal(name, row, f"as long as times, {self.times.size}")
            if np.ptp(row) == 0.0:
                raise refusal(name, row, "a row that changes")

    @property
    def step(self) -> float:
        """Time from sample to sample [s]."""
        return float(np.median(np.diff(self.times)))

    @property
    def noise(self) -> float:
        """Standard deviation of a sample [m/s²], by the middle size of third differences: jumps, as
        friction makes them, are few among them."""
        rest = np.abs(np.concatenate([np.diff(self.x, 3), np.diff(self.y, 3)]))
        return float(np.median(rest)) / (0.6745 * 20.0**0.5)


class BeltFit(NamedTuple):
    """What records show of the belts.

    - `fit` of `EA_1`, `EA_2` [N], `retardation` [s], `mu` (of all contacts), and for each record
      `begin[number]` [s], the time of its clock at which the path began.
    - `errors`: standard errors by name, without trust in the noise (`Fit.standard_errors`). Masses,
      motors and lengths that were stated wrong are not in them.
    - `times` [s], `measured`, `computed` [m/s²], `[window, 2]`, of each record: means over windows.
    - `unexplained`: root mean square of the residuals over that of what was measured.
    """

    fit: Fit
    errors: dict[str, float]
    times: tuple[np.ndarray, ...]
    measured: tuple[np.ndarray, ...]
    computed: tuple[np.ndarray, ...]
    unexplained: float


class _Windows(NamedTuple):
    """Of one record: ends of windows [s] of the record's clock, numbers of those that are whole, what
    was measured there, mean position and speeds of the command, the step [s], the first guess of its
    begin [s]."""

    edges: Array
    whole: Array
    measured: Array
    place: Array
    command: Array
    step: float
    begin: float


def fit_belts(
    machine: Given[ElasticCoreXY], records: Given[HeadRecord | Sequence[HeadRecord]], window: int = 8
) -> BeltFit:
    r"""Fit the machine, at small motions and with its friction, to what its head has measured.

    **Seen** are the stiffnesses of both belts at the place of each record, by the frequencies and by
    what is felt across the commanded axis; their damping; friction as far as it is not small beside
    the forces of inertia. All as ratios to the masses, which are taken as given, as are the motors
    and the frame: at one place a wrong frame is a factor of $EA$ and fits as well. Records at places
    far apart do not agree with it. **Not seen** is the tension, which moves no frequency of the
    machine while no span is slack: a free span tells it (`pluck_tone`).

    Accelerations are compared as means over windows of samples, those of the model as differences of
    its speed: friction makes them jump, and a jump is not where a sample is. Kinetic and static
    friction are taken as equal, and as the one coefficient `mu` of all contacts.

    **Arguments**

    - `machine`: what is known, and where the fit begins. Up to four fits from the best of 84 starts
      about it are made, until one is down to the noise; look at `fit.reduced_chi_squared`. Where
      friction all but holds a belt, its stiffness is hardly told (errors of percent), and all errors
      are rough: take a stronger sweep. Its drive is a `Stepper`, whose path is not used.
    - `records`: a `HeadRecord` or several. `window`: samples, of which the fastest vibration should
      have 40 in a period.

    **Returns** a `BeltFit`. **Raises** `TypeError`, `ValueError` naming the argument. It reads numbers
    and does not work under `jit`.
    """
    check_type("machine", machine, ElasticCoreXY, "an ElasticCoreXY")
    stepper = check_type("machine.drive", machine.drive, Stepper, "a Stepper")
    p, belts = machine.parameters, machine.belts
    rows = (records,) if isinstance(records, HeadRecord) else records
    if not isinstance(rows, tuple | list) or not rows:
        raise refusal("records", records, "a HeadRecord or several", TypeError)
    for i, record in enumerate(rows):
        check_type(f"records[{i}]", record, HeadRecord, "a HeadRecord")
    whole_number("window", window, 1, min(record.times.size for record in rows) // 16)
    cut = tuple(windows_of(record, window) for record in rows)
    noise = tuple(
        max(r.noise / window**0.5, 1e-3 * float(np.std(part.measured)))
        for r, part in zip(rows, cut, strict=True)
    )
    data = (p, belts, stepper, cut, noise)
    other = {"retardation": max(float(belts.retardation), 1e-5), "mu": max(float(p.mu_k), 1e-3)}
    method = LevenbergMarquardt(tolerance=1e-5)
    found: list[Fit] = []
    for start in _nearest(data, other):
        found.append(least_squares(lambda values: residual_of(values, data), start, method))
        costs = sorted(float(one.cost) for one in found)
        # Down to the noise, or twice the same: other starts have nothing to add.
        if costs[0] < 0.75 * len(found[0].residual) or (costs[1:] and costs[1] < 1.01 * costs[0]):
            break
    fit = min(found, key=lambda one: float(one.cost))
    counts = [len(part.whole) for part in cut]
    instants = [i * max(counts) + np.repeat(np.arange(n), 2) for i, n in enumerate(counts)]
    grid = len(cut), max(counts)
    fit = dataclasses.replace(fit, instants=jnp.asarray(np.concatenate(instants)), grid=grid)
    own = [np.asarray(row) for row in _alone(fit.values, data)]
    middles = [np.asarray(0.5 * (part.edges[1:] + part.edges[:-1])[part.whole]) for part in cut]
    measured = [np.asarray(part.measured) for part in cut]
    off = sum(float(np.sum((a - b) ** 2)) for a, b in zip(own, measured, strict=True))
    all_of = sum(float(np.sum(a**2)) for a in measured)
    errors = {name: float(error) for name, error in fit.standard_errors(robust=True).items()}
    return BeltFit(fit, errors, tuple(middles), tuple(measured), tuple(own), (off / all_of) ** 0.5)


def _speeds(values: dict, data: tuple) -> list[Array]:
    """Speeds of the head in the steps of each record [m/s]."""
    p, belts, stepper, cut, _ = data
    guess = eqx.tree_at(lambda a: a.mu_k, p, values["mu"])
    now = Belts(belts.frame, values["EA_1"], values["EA_2"], values["retardation"])
    return [head_speeds(guess, now, one.place, stepper, one.command, one.step) for one in cut]


def _computed(values: dict, data: tuple) -> list[Array]:
    """Means of the acceleration of the head over the windows of each record [m/s²]."""
    found = enumerate(zip(_speeds(values, data), data[3], strict=True))
    return [_means(speeds, part, values[f"begin[{i}]"]) for i, (speeds, part) in found]


_alone = jit_plainly(_computed)


def residual_of(values: dict, data: tuple) -> Array:
    found = zip(_computed(values, data), *data[-2:], strict=True)
    return jnp.concatenate([((own - part.measured) / sd).ravel() for own, part, sd in found])


@jit_plainly
def _costs(rows: dict, data: tuple) -> tuple[Array, Array]:
    """Sums of squares with rows of values, and the begins [s] of each record with which they are
    least, up to 60 ms from where the command fits best: the answer is late."""
    shifts = jnp.asarray(np.linspace(-0.06, 0.06, 121))

    def cost(values):
        total, begins = jnp.zeros(()), []
        for speeds, part, sd in zip(_speeds(values, data), *data[-2:], strict=True):
            found = jax.vmap(lambda t, s=speeds, part=part: _means(s, part, t))(part.begin + shifts)
            squares = jnp.sum(((found - part.measured[None]) / sd) ** 2, axis=(1, 2))
            total, begins = (
                total + jnp.min(squares),
                [*begins, shifts[jnp.argmin(squares)] + part.begin],
            )
        return total, jnp.stack(begins)

    return jax.lax.map(cost, rows, batch_size=28)


def _nearest(data: tuple, other: dict) -> list[dict[str, Any]]:
    """Unknowns from where the fit begins, the best first: of common factors of both stiffnesses and of
    friction."""
    own = {"EA_1": float(data[1].EA_1), "EA_2": float(data[1].EA_2), **other}
    both, friction = (
        np.ravel(a) for a in np.meshgrid(np.geomspace(0.6, 1.6, 21), [0.5, 1.0, 2.0, 4.0])
    )
    factors = {"EA_1": both, "EA_2": both, "retardation": 2.0, "mu": friction}
    rows = {name: own[name] * factors[name] * np.ones(both.size) for name in own}
    costs, begins = (np.asarray(a) for a in _costs(jax.tree.map(jnp.asarray, rows), data))
    tried = [
        {name: float(row[k]) for name, row in rows.items()}
        | {f"begin[{i}]": float(b) for i, b in enumerate(begins[k])}
        for k in np.argsort(costs)
    ]
    starts: list[dict[str, Any]] = []
    for values in tried:
        # Others must be elsewhere, by more than a step of the common factor.
        if len(starts) < 4 and all(abs(values["EA_1"] / one["EA_1"] - 1.0) > 0.06 for one in starts):
            starts.append(values)
    unit = {"scale": 1e-3, "unit": "s"}
    return [
        {name: Unknown(v, **unit) if name.startswith("begin") else v for name, v in one.items()}
        for one in starts
    ]


def windows_of(record: HeadRecord, window: int) -> _Windows:
    """Means of the samples of a record, as far as its path and 0.1 s before and after it go."""
    t, step, margin = record.times, record.step, 0.1
    path = record.path
    seconds = float(path.times[-1] - path.times[0])
    begin = _begin(record)
    ends = np.arange(0, t.size - window, window) + window
    edges = 0.5 * (t[ends - 1] + t[ends])
    rows = np.stack([record.x, record.y], axis=1)
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(rows, axis=0)])
    measured = (sums[ends[1:]] - sums[ends[:-1]]) / window
    whole = np.abs(np.diff(edges) / (window * step) - 1.0) < 0.5 / window
    whole &= (edges[:-1] > begin - margin) & (edges[1:] < begin + seconds + margin)
    if int(whole.sum()) < 16:
        raise refusal("times", t, f"of 16 windows without gaps during the path of {seconds:g} s")
    h = step / 4.0
    count = int(np.ceil((seconds + 2.0 * margin) / h))
    (_, speeds) = jax.vmap(lambda t: path(t, None))(
        jnp.asarray(float(path.times[0]) + h * np.arange(count + 1))
    )
    measured = measured[whole] - np.mean(measured[whole], axis=0)
    command = jnp.stack(speeds, axis=1)
    numbers = jnp.asarray(np.flatnonzero(whole))
    place = jnp.mean(path.positions, axis=0)
    return _Windows(jnp.asarray(edges), numbers, jnp.asarray(measured), place, command, h, begin)


def _begin(record: HeadRecord) -> float:
    """The time of a record's clock at which what was measured is most like what was commanded."""
    path, step = record.path, record.step
    since = np.arange(0.0, float(path.times[-1] - path.times[0]), step)
    piece = np.searchsorted(np.asarray(path.times), float(path.times[0]) + since, side="right") - 1
    asked = np.asarray(path.accelerations)[np.clip(piece, 0, len(path.accelerations) - 1)]
    even = np.arange(record.times[0], record.times[-1], step)
    size = even.size + since.size
    total = 0.0
    for row, command in ((record.x, asked[:, 0]), (record.y, asked[:, 1])):
        found = np.interp(even, record.times, row)
        product = np.fft.rfft(found - np.mean(found), size) * np.conj(np.fft.rfft(command, size))
        total = total + np.fft.irfft(product, size)
    at = int(np.argmax(np.asarray(total)))
    return float(record.times[0] + step * (at if at < even.size else at - size))


def _means(speeds: Array, part: _Windows, begin: Any) -> Float[Array, "window 2"]:
    """Means of the acceleration [m/s²] over the windows that are whole, without their own mean."""
    at = (part.edges - begin) / part.step
    at = jnp.clip(at, 0.0, speeds.shape[0] - 1.0)
    below = jnp.clip(jax.lax.stop_gradient(at).astype(jnp.int32), 0, speeds.shape[0] - 2)
    share = (at - below.astype(jnp.float64))[:, None]
    v = (1.0 - share) * speeds[below] + share * speeds[below + 1]
    means = ((v[1:] - v[:-1]) / jnp.diff(part.edges)[:, None])[part.whole]
    return means - jnp.mean(means, axis=0, keepdims=True)
