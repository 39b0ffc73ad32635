"""Attractors: found from where motions end, and the distance within which motions come nearer."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.optimize
from jax.flatten_util import ravel_pytree

from .._jit_by_code import jit_by_code
from .._show import number
from ..analysis.held_directions import held_directions
from ..continuation import Equilibrium, OrbitGuess, PeriodicOrbit, orbit_guess, periodic_orbit
from ..hybrid import SaveAt, simulate
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._lanes import Lanes, rows_of
from ._tube import Tube, distances, tube_of


class Attractor(NamedTuple):
    """A motion to which others come.

    - `name`: its kind and its number. `kind`: `"fixed point"`, `"orbit"`, `"torus"` (quasi-periodic),
      `"chaos"`, or `"rest"`: all states of one mode in which nothing moves, and that hang together.
    - `motion`: an `Equilibrium`, a `PeriodicOrbit`, of the next two a `LyapunovSpectrum`, of a rest one
      state of it.
    - `mode`: number of the mode, of an orbit at its start.
    - `radius`: distance in parts of the size of the motions, within which all that were looked at come
      nearer; 0 of a rest, which a motion has come to or not. `tube`: where the distance is taken from.
    """

    name: str
    kind: str
    motion: Any
    mode: int
    radius: float = 0.0
    tube: Tube | None = None

    @property
    def repeats(self) -> bool:
        """Whether the motion comes back to where it was, so that others can come to it exactly."""
        return self.kind not in ("torus", "chaos")

    @property
    def words(self) -> str:
        """Its name, with the period of an orbit, or the greatest exponent of what never repeats."""
        if not self.repeats:
            greatest = float(self.motion.exponents[0])
            return f"{self.name}, exponent {greatest:+.2g} +- {float(self.motion.error[0]):.1g} 1/s"
        if self.kind != "orbit":
            return self.name
        orbit: Any = self.motion
        period = float(orbit.period) / int(orbit.repeats)
        return (
            f"{self.name}, {number(period)} s, {int(orbit.events.count) // int(orbit.repeats)} events"
        )


class Search(NamedTuple):
    """The motions as far as they are known while attractors are looked for."""

    lanes: Lanes
    scale: np.ndarray  # extent of each component
    turn: np.ndarray  # period of each component, infinite where it has none
    duration: float
    forcing_period: float | None


def motions_at(search: Search, t: float, y: np.ndarray, mode: int) -> Iterator["Found"]:
    """The fixed point and the orbit near a state, those that there are, stable or not."""
    ways = (fixed_point_at, orbit_at) if search.forcing_period is None else (orbit_at,)
    for way in ways:
        found = way(search, t, y, mode)
        if found is not None:
            yield found


class Found(NamedTuple):
    """A motion that returns, and how others beside it do: `rate` of the slowest [1/s], `wait` until
    their distance is known to be halved [s]."""

    attractor: Attractor
    rate: float
    wait: float


@jit_by_code
def _rates(system, args, unravel, t, mode, z, scale):
    def rates(z):
        return ravel_pytree(system.vector_field(t, unravel(z * scale), mode, args))[0] / scale

    return rates(z), jax.jacfwd(rates)(z)


def fixed_point_at(search: Search, t: float, y: np.ndarray, mode: int) -> Found | None:
    """The state near `y` at which the field of a mode is zero."""
    lanes, scale = search.lanes, search.scale
    number_of_mode = jnp.asarray(mode, lanes.mode_type)

    def rates(z):
        found = _rates(lanes.system, lanes.args, lanes.unravel, t, number_of_mode, z, scale)
        return tuple(np.nan_to_num(np.asarray(a), posinf=0.0, neginf=0.0) for a in found)

    z = scipy.optimize.root(rates, y / scale, jac=True, method="hybr", tol=ENGINE.slack).x
    given = lanes.system, lanes.args, lanes.unravel, t, number_of_mode
    values, jacobian = (np.asarray(a) for a in _rates(*given, z, scale))
    if not (np.all(np.isfinite(values)) and np.all(np.isfinite(jacobian))):
        return None  # on the way such numbers only tell where not to go on
    eigenvalues = np.linalg.eigvals(jacobian)
    largest = float(np.max(np.abs(eigenvalues), initial=0.0))
    if not np.max(np.abs(values)) <= ENGINE.zero * largest * max(np.max(np.abs(z)), 1.0):
        return None
    eigenvalues = eigenvalues[np.lexsort((-eigenvalues.imag, -eigenvalues.real))]
    rate = float(eigenvalues[0].real)
    rate = 0.0 if abs(rate) <= ENGINE.zero * largest else rate
    size, state = len(z), z * scale
    tube = tube_of((None, state[None], None), [mode], np.eye(size), scale, search.turn)
    motion = Equilibrium(
        lanes.unravel(state), np.asarray(mode), eigenvalues, np.asarray(np.nan), np.zeros(size)
    )
    swing = float(np.max(np.abs(eigenvalues.imag)))
    wait = max(2.0 * np.log(2.0) / abs(rate) if rate else np.inf, 2.0 * np.pi / swing if swing else 0.0)
    return Found(Attractor("fixed point", "fixed point", motion, mode, tube=tube), rate, wait)


def rest_at(lanes: Lanes, y: np.ndarray, mode: int) -> Attractor | None:
    """The rest that a state is one of, at which nothing moves; None where a deviation would grow, as on
    top of a hill."""
    mode_number = jnp.asarray(mode, lanes.mode_type)
    given = lanes.system, lanes.args, lanes.unravel, jnp.zeros(()), mode_number
    slopes = np.nan_to_num(np.asarray(_rates(*given, y, np.ones(len(y)))[1]), posinf=0.0, neginf=0.0)
    growth = np.linalg.eigvals(slopes)
    if np.any(growth.real > ENGINE.zero * np.max(np.abs(growth), initial=0.0)):
        return None
    return Attractor("rest", "rest", lanes.unravel(y), mode)


def orbit_at(search: Search, t: float, y: np.ndarray, mode: int) -> Found | None:
    """The periodic orbit that the motion from `y` comes near to."""
    lanes, forcing = search.lanes, search.forcing_period
    state = lanes.unravel(y)
    longest = search.duration / 4 if forcing is None else ACCURACY.few * forcing
    guess = orbit_guess(
        lanes.system, state, transient=0.0, max_period=longest, forcing_period=forcing, t0=t,
        mode0=mode, args=lanes.args, shooting=lanes.shooting,
    )  # fmt: skip
    if not np.isfinite(guess.period):
        return None
    if forcing is not None:
        # At a time at which motions are judged.
        guess = OrbitGuess(state, guess.period, mode, t)
    return orbit_of(search, guess)


def orbit_of(search: Search, guess: OrbitGuess | PeriodicOrbit) -> Found | None:
    """The periodic orbit near a guess, with the tube about it."""
    lanes, forcing = search.lanes, search.forcing_period
    orbit = periodic_orbit(
        lanes.system, guess, forced=forcing is not None, args=lanes.args, shooting=lanes.shooting
    )
    if not bool(orbit.successful):
        return None
    t0, period = float(orbit.t0), float(orbit.period) / int(orbit.repeats)
    # Motions under a force are looked at after whole periods of it, others at any time.
    if forcing is not None:
        saved = SaveAt(ts=t0 + forcing * np.arange(round(period / forcing)))
    else:
        saved = SaveAt(steps=True)
    fine = lanes.integrator
    step: Any = fine.step
    if forcing is None and step.adaptive:
        # As an array: a number of Python would be a part of the program.
        longest = jnp.asarray(period / ACCURACY.many)
        if step.dtmax is not None:
            longest = jnp.minimum(longest, step.dtmax)
        fine = eqx.tree_at(lambda i: i.step.dtmax, fine, longest, is_leaf=lambda a: a is None)
    run = simulate(
        lanes.system, t0, t0 + period, orbit.y0, orbit.mode0, lanes.args, integrator=fine, saveat=saved
    )
    rows: Any = run.steps if forcing is None else run.outputs
    count = int(rows.count)
    t, mode = np.asarray(rows.t)[:count], np.asarray(rows.mode)[:count]
    y, slope = (rows_of(tree, len(rows.t))[:count] for tree in (rows.y, rows.dy))
    across = np.eye(y.shape[1]) - np.asarray(orbit.neutral)
    slopes = slope if forcing is None else None
    tube = tube_of((t, y, slopes), mode, across, search.scale, search.turn)
    largest = float(np.max(np.abs(orbit.multipliers), initial=0.0))
    # One that is 0 needs one round, and one that is 1 never comes nearer.
    rate = np.log(max(largest, ENGINE.tiny)) / float(orbit.period)
    rate = 0.0 if bool(orbit.stable) != (rate < 0.0) else rate
    rounds = max(np.ceil(-2.0 * np.log(2.0) / (rate * period)), 1.0) if rate < 0.0 else np.inf
    attractor = Attractor("orbit", "orbit", orbit, int(orbit.mode0), tube=tube)
    return Found(attractor, float(rate), float(rounds * period))


@jit_by_code
def _deviations_in(system, args, unravel, t, y, modes, scale):
    def one(y, mode):
        return held_directions(system, t, unravel(y), mode, args, scale, jnp.ones_like(scale))

    return jax.vmap(one)(y, modes)


def with_radius(search: Search, t: float, found: Found) -> Attractor | None:
    """The attractor with the largest radius within which motions come nearer; None without, and where
    deviations decay by less than a tenth over the duration.

    From the border of each of several balls about places of the attractor, each half as large as the
    one before, all motions looked at must be in the ball of half the radius at the end of `wait`, in
    which the slowest linear motion halves its distance twice, or of twice that time, and so on: where
    directions of decay are all but parallel, or a place becomes a speed, which has another size,
    distances grow before they fall. Deviations are those that the mode allows.

    Of a motion that never repeats only a part is known, and others come no nearer to it than its gaps.
    It has the smallest radius from within which all motions looked at come to within half of it.
    """
    lanes, tube, count = search.lanes, found.attractor.tube, ACCURACY.many
    assert tube is not None

    def whole(time: float) -> float:
        period = search.forcing_period
        return time if period is None else period * max(round(time / period), 1)

    place = np.linspace(0, len(tube.mode) - 1, ACCURACY.few).astype(int)
    mode = jnp.asarray(tube.mode[place], lanes.mode_type)
    allowed = _deviations_in(
        lanes.system, lanes.args, lanes.unravel, t, tube.start[place], mode, tube.scale
    )
    which = np.arange(count) % ACCURACY.few
    random = np.random.default_rng(0).standard_normal((count, len(tube.scale)))
    ways = np.einsum("kij,kj->ki", np.asarray(allowed)[which], random)
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    ways = ways / np.where(length > 0.0, length, 1.0)
    radii = 0.5 ** np.arange(1.0, ACCURACY.levels + 1)
    start = tube.start[place[which]]
    y = (start + radii[:, None, None] * ways * tube.scale).reshape(-1, len(tube.scale))
    modes, good, fine = np.tile(tube.mode[place[which]], ACCURACY.levels), True, [False]
    wait, end, last = found.wait, 0.0, whole(search.duration)
    if np.exp(found.rate * last) > 1.0 - ACCURACY.near:
        return None  # it is not to be told from a motion without damping
    while not np.any(fine) and end < last:
        since, end, wait = end, min(whole(min(wait, last)), last), 2.0 * wait
        moved = lanes(t + since, t + end, y, modes)
        y, modes, good = moved.y, moved.mode, good & moved.successful
        away = np.where(good, distances([tube], y, modes)[:, 0], np.inf)
        farthest = np.max(away.reshape(ACCURACY.levels, count), axis=1)
        if found.attractor.repeats:
            # A slower one is judged by what the time allows.
            share = max(0.5, 0.5 * (1.0 + np.exp(found.rate * end)))
            fine = np.logical_and.accumulate((farthest <= share * radii)[::-1])[::-1]
        else:
            fine = np.maximum.accumulate(farthest[::-1])[::-1] <= 0.5 * radii
            fine &= radii <= ACCURACY.near
    if not np.any(fine):
        return None
    if not found.attractor.repeats:
        return found.attractor._replace(radius=float(radii[fine][-1]))
    # Half of it: between the directions there are others.
    return found.attractor._replace(radius=0.5 * float(radii[np.argmax(fine)]))
