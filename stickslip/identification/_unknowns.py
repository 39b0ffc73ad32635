"""Named unknowns as one row of unbounded coordinates."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._types import Given
from .._validation import as_parameter, check_positive, is_concrete, refusal, shape_refusal
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._unknown import Bounds, Normal, Unknown

NamedValues = dict[str, Any]
NamedUnknowns: TypeAlias = Given[Mapping[str, float | np.ndarray | Array | Unknown]]
NamedUnknownRows: TypeAlias = Given[Mapping[str, Sequence[Any] | np.ndarray | Array | Unknown]]


class Space(eqx.Module):
    """The unknowns in alphabetical order, and the smooth map between their values and coordinates.

    - `names`, `bounds`, `units`: one each. `stated`: whether the bounds were given by the user.
    - `scales`: sizes of the unknowns without bounds, distance of the start from a single bound.
    - `priors`: a `Normal` or `None` each.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    bounds: tuple[Bounds, ...] = eqx.field(static=True)
    units: tuple[str, ...] = eqx.field(static=True)
    stated: tuple[bool, ...] = eqx.field(static=True)
    scales: tuple[Any, ...]
    priors: tuple[Normal | None, ...]

    @property
    def num_priors(self) -> int:
        """How many rows of the residual are those of priors, behind the data."""
        return sum(prior is not None for prior in self.priors)

    def values(self, z: Float[Array, "*batch unknown"]) -> NamedValues:
        """Values by name; the inverse of `coordinates`."""
        return {name: self._value(i, z[..., i]) for i, name in enumerate(self.names)}

    def _value(self, i: int, z: Any) -> Any:
        low, high = self.bounds[i]
        if low is None and high is None:
            return self.scales[i] * z
        if high is None:
            return low + jnp.exp(z) if low else jnp.exp(z)
        if low is None:
            return high - jnp.exp(z)
        # From the nearer bound, so that no digits are lost next to it.
        part = (high - low) * jax.nn.sigmoid(-jnp.abs(z))
        return jnp.where(z < 0.0, low + part, high - part)

    def coordinates(self, values: NamedValues) -> Float[Array, "*batch unknown"]:
        """One row, the last axis the unknown."""
        rows = [self._coordinate(i, values[name]) for i, name in enumerate(self.names)]
        return jnp.stack(rows, axis=-1)

    def _coordinate(self, i: int, value: Any) -> Any:
        low, high = self.bounds[i]
        if low is None and high is None:
            return value / self.scales[i]
        if high is None:
            return jnp.log(value - low if low else value)
        if low is None:
            return jnp.log(high - value)
        return jnp.log(value - low) - jnp.log(high - value)

    def slopes(self, values: NamedValues) -> Float[Array, "*batch unknown"]:
        """Derivatives of the values by their coordinates."""
        rows = [self._slope(i, jnp.asarray(values[name])) for i, name in enumerate(self.names)]
        return jnp.stack(rows, axis=-1)

    def _slope(self, i: int, value: Any) -> Any:
        low, high = self.bounds[i]
        if low is None and high is None:
            return jnp.broadcast_to(self.scales[i], jnp.shape(value))
        if high is None:
            return value - low if low else value
        if low is None:
            return value - high
        return (value - low) * (high - value) / (high - low)

    def prior_rows(self, values: NamedValues) -> Float[Array, " prior"]:
        """Deviations from the means of the priors, in standard deviations."""
        rows = [
            (values[name] - prior.mean) / prior.sd
            for name, prior in zip(self.names, self.priors, strict=True)
            if prior is not None
        ]
        return jnp.stack(rows) if rows else jnp.zeros(0)

    def active(self, values: NamedValues, errors: NamedValues) -> NamedValues:
        """By name -1 or +1 where the value lies at its lower or upper bound, otherwise 0.

        A coordinate that has to go to infinity stops on its way there: what is nearer to the bound than
        a small part of its standard error is at it.
        """
        return {name: self._side(i, values[name], errors[name]) for i, name in enumerate(self.names)}

    def _side(self, i: int, value: Any, error: Any) -> Any:
        low, high = self.bounds[i] if self.stated[i] else (None, None)
        span = self.scales[i] if low is None or high is None else high - low
        side = jnp.zeros(jnp.shape(value), jnp.int32)
        if low is None and high is None:
            return side
        part = jnp.where(jnp.isfinite(error), ACCURACY.near * error, 0.0)
        near = jnp.clip(part, ENGINE.same * span, ACCURACY.near * span)
        if low is not None:
            side = jnp.where(value - low < near, -1, side)
        if high is not None:
            side = jnp.where(high - value < near, 1, side)
        return side


def space_of(name: str, values: Any) -> tuple[Space, NamedValues]:
    """A mapping of names to unknowns or positive numbers, or rows of them, in alphabetical order."""
    if not isinstance(values, Mapping) or not values or not all(isinstance(k, str) for k in values):
        allowed = "a mapping from names to positive numbers or Unknowns, not empty"
        raise refusal(name, values, allowed, TypeError)
    names, starts = tuple(sorted(values)), {}
    bounds, units, stated, scales, priors = [], [], [], [], []
    for key in names:
        given = values[key]
        if isinstance(given, Unknown):
            starts[key] = given.start
            bounds.append(given.bounds)
            units.append(given.unit)
            priors.append(given.prior)
            scales.append(_scale(given))
        else:
            starts[key] = as_parameter(check_positive(f"{name}[{key!r}]", given))
            bounds.append((0.0, None))
            units.append("")
            priors.append(None)
            scales.append(None)
        stated.append(isinstance(given, Unknown))
    rows = (names, bounds, units, stated, scales, priors)
    return Space(*(tuple(row) for row in rows)), starts


def _scale(given: Unknown) -> Any:
    """Size of an unknown without bounds, distance of the start from a single one."""
    low, high = given.bounds
    if low is not None and high is not None:
        return None
    open_ends = low is None and high is None
    if open_ends and given.scale is not None:
        return given.scale
    if open_ends and given.prior is not None:
        return given.prior.sd
    # A start that is traced has its own lane; the starts of a row have one scale.
    known = is_concrete(given.start)
    lib: Any = np if known else jnp
    size = lib.max(lib.abs(lib.asarray(given.start) - ((high if low is None else low) or 0.0)))
    size = lib.where(size > 0.0, size, 1.0)
    return as_parameter(size) if known else size


def names_among(argument: str, given: Any, known: tuple[str, ...]) -> list[str]:
    """Names of unknowns that are chosen: all for `None`, in alphabetical order."""
    row = known if given is None else [given] if isinstance(given, str) else given
    if not isinstance(row, list | tuple) or not row or not set(map(str, row)) <= set(known):
        raise refusal(argument, given, f"names among {', '.join(known)}")
    return sorted(set(row))


def scalars(name: str, values: Any) -> tuple[Space, NamedValues]:
    """A mapping of names to one unknown or positive number each."""
    space, found = space_of(name, values)
    for key, value in found.items():
        if value.shape != ():
            raise shape_refusal(f"{name}[{key!r}]", value, "one number (many_starts takes rows)")
    return space, found
