"""A periodic orbit, found by Newton's method: what it is, and how stable."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Complex, Float, Int, PyTree, UInt

from .._show import html_table, number
from .._types import Given
from .._validation import is_concrete
from ..hybrid import AbstractHybridSystem, EventLog
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.components import components_of, numbers_of
from ..hybrid.status import describe_flags
from ._outcome import ORBITS


class PeriodicOrbit(eqx.Module):
    r"""A closed motion $\varphi_T(y_0) = y_0$ and what becomes of small deviations over one period.

    Under `vmap` every array has the batch axes in front.

    - `t0` [s], `y0`, `mode0`: a point of the orbit; `period` $T$ [s].
    - `multipliers`: Floquet multipliers, the eigenvalues of the `monodromy` matrix
      $M = \partial\varphi_T/\partial y_0$ (with the saltation matrices of all events), largest first.
      Exactly 0 for each direction that stick removes. Of an orbit of unknown period the multiplier 1 of
      the direction along the orbit is not among them, but is `trivial` (NaN otherwise), whose distance
      from 1 shows the accuracy.
    - `rank`: how many multipliers, `trivial` included, are not zero.
    - `repeats`: into how many equal parts the motion divides the period: 1, unless the orbit has a
      shorter one. Numbers that divide 60 are looked for.
    - `stable`: whether all `multipliers` are inside the unit circle, but for those of `neutral` shifts
      and of the `num_conserved` quantities that stay as they are.
    - `determinant`, `determinant_by_events`: $\det M$, and
      $\exp(\int \mathrm{div} f\,dt)\prod\det S$ with the saltation matrix $S$ of each event: equal for
      every orbit.
    - `residual`: how far the end is from the beginning, in parts of the size of each component;
      `steps`: evaluations of the return map and its derivative.
    - `closing_error`: the same after the orbit was simulated once more.
    - `turns`: how often each angle (component with one of the system's `periods`) goes round in the
      period, forwards or, negative, backwards; 0 for other components.
    - `lowest`, `highest`: least and greatest value of each component over the period: where its rate is
      zero, or on either side of an event; as accurate as the motion itself.
    - `events`: log of one period. `sequence`: hash of its guards and modes.
    - `result`: an `ORBITS` item; `simulation`: a `stickslip.RESULTS` item.
    - `neutral`: projection on the shifts of the state that change nothing, as that of a body which no
      spring and no wall holds; zero where there are none. Each has a multiplier that is exactly 1. The
      orbit is one of a family, whose place is that of the guess; `drift`: by how much it moves on along
      these shifts in a period, besides its `turns`.
    - `flags`: as of a `Solution`. Where they are not 0 the multipliers may be wrong, though the orbit
      is right: a field or guard that jumps where nobody declared it has no derivative.
    """

    t0: Float[Array, "*batch"]
    y0: PyTree
    mode0: Int[Array, "*batch"]
    period: Float[Array, "*batch"]
    multipliers: Complex[Array, "*batch multiplier"]
    trivial: Float[Array, "*batch"]
    rank: Int[Array, "*batch"]
    repeats: Int[Array, "*batch"]
    monodromy: Float[Array, "*batch size size"]
    determinant: Float[Array, "*batch"]
    determinant_by_events: Float[Array, "*batch"]
    residual: Float[Array, "*batch"]
    closing_error: Float[Array, "*batch"]
    steps: Int[Array, "*batch"]
    lowest: PyTree
    highest: PyTree
    events: EventLog
    sequence: UInt[Array, "*batch"]
    flags: Int[Array, "*batch"]
    result: Any
    simulation: Any
    neutral: Float[Array, "*batch size size"]
    drift: PyTree
    turns: PyTree

    @property
    def successful(self) -> Bool[Array, "*batch"]:
        """Whether the orbit was found, and found again by simulating it."""
        return self.result == ORBITS.successful

    @property
    def stable(self) -> Given[Bool[Array, "*batch"]]:
        """Whether all multipliers are inside the unit circle, without those of shifts of time and state
        that change nothing, and of conserved quantities."""
        xp = _numpy_of(self.neutral)
        neutral = xp.round(xp.trace(self.neutral, axis1=-2, axis2=-1)).astype(np.int32)
        return self.successful & (
            beyond(self.multipliers, xp.maximum(neutral, self.num_conserved)) == 0
        )

    @property
    def num_conserved(self) -> Given[Int[Array, "*batch"]]:
        """How many quantities a forced motion leaves as they are, such as the place of a massless
        slider that sticks all the time: as many multipliers are 1, and the orbit is one of a family."""
        xp, axes = _numpy_of(self.monodromy), self.period.ndim

        def flat(tree):
            rows = [xp.reshape(leaf, (*xp.shape(leaf)[:axes], -1)) for leaf in jax.tree.leaves(tree)]
            return xp.concatenate(rows, axis=-1)

        low, high = flat(self.lowest), flat(self.highest)
        size = xp.where(high > low, high - low, xp.maximum(xp.abs(high), xp.abs(low)))
        size = xp.where(size > 0.0, size, 1.0)
        scaled = self.monodromy * size[..., None, :] / size[..., :, None]
        return xp.where(xp.isnan(self.trivial), silent_directions(scaled), 0)

    @property
    def place(self) -> str:
        """In words, along which components a single orbit may be shifted, and how far it moves on."""
        moved = np.any(np.asarray(self.neutral) != 0.0, axis=1)
        if not np.any(moved):
            return ""
        names, flat = numbers_of(self.y0), np.asarray(ravel_pytree(self.drift)[0])
        free = ", ".join(name for name, is_free in zip(names, moved, strict=True) if is_free)
        reach = np.asarray(ravel_pytree(self.highest)[0] - ravel_pytree(self.lowest)[0])
        goes = [f"{name} by {number(d)}" for name, d, r in zip(names, flat, reach, strict=True)
                if abs(d) > ENGINE.zero * r]  # fmt: skip
        return f"place free along {free}" + f", in a period moves on {', '.join(goes)}" * bool(goes)

    @property
    def rotation(self) -> str:
        """In words, which angles go round in a period, and how often."""
        counts = zip(numbers_of(self.y0), np.asarray(ravel_pytree(self.turns)[0]), strict=True)
        found = ", ".join(f"{name} {count}" for name, count in counts if count)
        return f"whole turns {found}" if found else ""

    def columns(self, system: AbstractHybridSystem) -> dict[str, Any]:
        """Columns of a dataset along `point`, of orbits with one leading axis."""
        data: dict[str, Any] = {
            "period": ("point", np.asarray(self.period), {"units": "s"}),
            "stable": ("point", np.asarray(self.stable)),
            "multiplier_real": (("point", "multiplier"), np.real(self.multipliers)),
            "multiplier_imag": (("point", "multiplier"), np.imag(self.multipliers)),
            "num_events": ("point", np.asarray(self.events.count)),
            "flags": ("point", np.asarray(self.flags)),
        }
        for prefix, tree in (("start", self.y0), ("lowest", self.lowest), ("highest", self.highest)):
            for name, leaf in components_of(tree).items():
                axes = ["point", *(f"{name}_{k}" for k in range(np.ndim(leaf) - 1))]
                label = {"units": system.units[name]} if name in system.units else {}
                data[f"{prefix}_{name}"] = (axes, np.asarray(leaf), label)
        for name in components_of(self.lowest):
            axes, low, label = data[f"lowest_{name}"]
            data[f"amplitude_{name}"] = (axes, 0.5 * (data[f"highest_{name}"][1] - low), label)
        return data

    def __str__(self) -> str:
        """Period and multipliers; of a batch, how many orbits were found and are stable."""
        if not is_concrete(self):
            return f"PeriodicOrbit(traced, of shape {self.period.shape})"
        if self.period.shape != ():
            stable = int(np.sum(np.asarray(self.stable)))
            return f"PeriodicOrbit: {self.period.size:,} orbits, {self.result}; {stable:,} stable"
        if not bool(self.successful):
            return f"PeriodicOrbit: {self.result}: {ORBITS[self.result]}"
        found = ", ".join(map(_multiplier, np.asarray(self.multipliers)))
        turns = int(self.repeats)
        period = f"{float(self.period):.10g} s" + f" ({turns} turns of a shorter one)" * (turns > 1)
        flagged = f"; derivative flags: {describe_flags(int(self.flags))}" * (int(self.flags) != 0)
        return (
            f"PeriodicOrbit: period {period}, {int(self.events.count)} events, "
            f"{'stable' if bool(self.stable) else 'unstable'}, multipliers {found}"
            f"{'; ' * bool(self.rotation)}{self.rotation}"
            f"{'; ' * bool(self.place)}{self.place}{flagged}"
        )

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return html_table(str(self), (), ())


def beyond(multipliers: Given[Complex[Array, "*batch multiplier"]], count: Any) -> Any:
    """How many multipliers are not inside the unit circle, without so many that are nearest to 1.

    On it, to rounding, is not inside: what nothing damps.
    """
    xp = _numpy_of(multipliers)
    order = xp.argsort(xp.abs(multipliers - 1.0), axis=-1)
    outside = xp.take_along_axis(~(xp.abs(multipliers) < 1.0 - ENGINE.solved), order, axis=-1)
    number = np.arange(multipliers.shape[-1], dtype=np.int32)
    left = number.reshape(*(1,) * (multipliers.ndim - 1), -1) >= xp.asarray(count)[..., None]
    return xp.sum(outside & left, axis=-1, dtype=np.int32)


def silent_directions(monodromy: Given[Float[Array, "*batch size size"]]) -> Any:
    """How many linear functions of the state a motion has at its end as at its beginning, whatever the
    state is; of a monodromy matrix in parts of the motion's size."""
    xp = _numpy_of(monodromy)
    whole = np.eye(monodromy.shape[-1]).reshape(*(1,) * (monodromy.ndim - 2), *monodromy.shape[-2:])
    away = xp.where(xp.isfinite(monodromy), monodromy, 0.0) - whole
    strength = xp.linalg.svd(away, compute_uv=False)
    return xp.sum(strength <= ENGINE.slack * strength[..., :1], axis=-1, dtype=np.int32)


def _numpy_of(array: Any) -> Any:
    """NumPy for its own arrays, of which every shape would be a program of JAX."""
    return np if isinstance(array, np.ndarray) else jnp


def _multiplier(value: complex) -> str:
    if value.imag == 0:
        return number(value.real)
    return f"{number(value.real)} {'-' if value.imag < 0 else '+'} {number(abs(value.imag))}i"
