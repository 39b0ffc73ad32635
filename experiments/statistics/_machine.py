r"""A synthetic CoreXY machine, two records of it, and what its fits and intervals come to.

Everything but gravity is drawn within `WITHIN` of Table 1 with the tensions and static belt friction of
scenario 3, where both belts hold until they slip. The six unknowns are those of `identify-corexy`;
all else is known, as from data sheets and a balance.

One record is gentle: the belts hold, and friction on the ground and tensions show. In the other the
voltage rises above what the belts hold, and their kinetic friction shows. Both inputs are designed for
each machine from what is known of it, with the values of Table 1 and others around them for the
unknowns. Every signal has normal noise of a part `NOISE` of its own root mean square.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import corexy_jax as cx
import stickslip as ss
from stickslip.identification import Fit, Profile, least_squares, profile, sensitivity

from ..corexy._input import Input

NAMES = tuple(sorted(cx.FITTED_PARAMETERS))
KNOWN = ("m", "M", "J", "J_passive", "r", "R", "K_t", "K_e", "mu_1s_b", "mu_2s_b")
WITHIN, NOISE, AWAY = 0.5, 0.01, 0.8
DURATION, RATE, PIECE = 2.0, 100.0, 0.125  # [s], [1/s], [s]
TIMES = np.linspace(0.0, DURATION, round(DURATION * RATE) + 1)[1:]
BEGINS = np.arange(0.0, DURATION, PIECE)
TOLERANCE = 1e-7
FINEST = (1e-3, 1e-3, 1e-6, 1e-6)  # noise of signals that hardly move [rad/s, rad/s, m, m]
CANDIDATES = 12  # of each kind of input
AROUND = (1.0, 0.6, 1.4)  # factors of the tensions for which the inputs are designed
HORIZONS = (0.25, 0.5, 1.0)  # parts of the records that a start is led through
MAX_STEPS = 60
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
    return jnp.maximum(NOISE * size, jnp.asarray(FINEST))


def _residual(values, data, machine, ends, sigma, keep):
    found = both(cx.with_values(machine, values), ends)
    return (keep * (found - data) / sigma[..., None]).reshape(-1)


@jax.jit
def _fit(start, *data) -> Fit:
    return least_squares(lambda values: _residual(values, *data), start, max_steps=MAX_STEPS)


@jax.jit
def _profile(fit, *data) -> Profile:
    return profile(lambda values: _residual(values, *data), fit)


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
    return values | {"r_f": values["r"]}


def candidates(rng: np.random.Generator, known: dict[str, Any]) -> np.ndarray:
    """Inputs [V], `[gentle or rough, candidate, piece, end, motor]`, in parts of the voltages that
    bring the belts to their limits under the tensions of Table 1."""
    held = [known[f"mu_{i}s_b"] * float(getattr(TABLE, f"P{i}")) for i in (1, 2)]
    limit = known["r"] * known["R"] / known["K_t"] * np.array(held)
    shape = (2, CANDIDATES, BEGINS.size, 2, 2)
    size = np.exp(rng.uniform(*np.log((0.3, 1.0)), (2, CANDIDATES, 1, 1, 1)))
    ends = size * rng.uniform(-1.0, 1.0, shape)
    high = rng.uniform(size=(CANDIDATES, BEGINS.size, 1, 2)) < 0.3
    far = rng.uniform(-1.0, 1.0, shape[1:]) * rng.uniform(1.5, 4.0, CANDIDATES)[:, None, None, None]
    ends[1] = np.where(high, far, ends[1])
    ends[:, :, 0, 0] = 0.0
    return ends * limit


def designed(rng: np.random.Generator, known: dict[str, Any]) -> tuple[np.ndarray, float]:
    """Of pairs of candidates, a gentle and a rough one, that whose worst seen combination is seen best
    in the worst of the cases `AROUND`; and that smallest singular value."""
    machine = cx.with_values(TABLE, {name: known[name] for name in (*KNOWN, "r_f")})
    inputs = candidates(rng, known)
    least = np.full((CANDIDATES, CANDIDATES), np.inf)
    for factor in AROUND:
        values = {
            name: np.float64(float(getattr(TABLE, name)) * (factor if name[0] == "P" else 1.0))
            for name in NAMES
        }
        gentle, rough = (
            np.stack([np.asarray(_information(values, machine, ends)) for ends in kind])
            for kind in inputs
        )
        whole = gentle[:, None] + rough[None]
        good = np.isfinite(whole).all(axis=(-2, -1))
        eigenvalues = np.linalg.eigvalsh(np.where(good[..., None, None], whole, 0.0))
        least = np.minimum(least, eigenvalues[..., 0])
    i, j = np.unravel_index(np.argmax(least), least.shape)
    return np.stack([inputs[0, i], inputs[1, j]]), float(np.sqrt(max(least[i, j], 0.0)))
