"""Basins of attraction: which attractor the motion from each start of a box comes to."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np
import scipy.stats.qmc
from jaxtyping import PyTree

from .._show import number
from .._types import Given
from .._validation import as_float64, check_count, check_handed_on, check_mapping, check_type, refusal
from ..hybrid import AbstractHybridSystem, Integrator
from ..hybrid.arguments import check_field, start_of, the_system
from ..hybrid.components import component_list, components_of, numbers_of, period_of, place_of, unit_of
from ..hybrid.longest_step import depends_on_time
from ..hybrid.tree import with_float_arrays
from ._attractor import Attractor
from ._codes import OTHERS, meanings_of
from ._judged import Judged
from ._lanes import Lanes, flat
from ._settle import Settle, check_limits

if TYPE_CHECKING:
    import xarray as xr


class Basins(NamedTuple):
    """Which attractor each start comes to; arrays have the axes of the points in front.

    - `attractors`: a tuple of `Attractor`; `code`: number of that of each start; -1 "not settled", -2
      "left the limits", -3 "failed". `entry` [s]: when that was known first, at one of 32 times; NaN.
    - `box`: of the components that differ; `starts`: the states, a pytree. `failure`: why a run failed.
    """

    attractors: tuple[Attractor, ...]
    box: dict[str, tuple[float, float]]
    starts: PyTree
    code: np.ndarray
    entry: np.ndarray
    failure: np.ndarray

    @property
    def names(self) -> dict[int, str]:
        """Names by code: of all attractors, and of the other codes that occur."""
        found = {k: attractor.name for k, attractor in enumerate(self.attractors)}
        return found | {k: word for k, word in OTHERS.items() if np.any(self.code == k)}

    @property
    def shares(self) -> dict[str, float]:
        """Part of the starts with each code, by name."""
        return {name: float(np.mean(self.code == k)) for k, name in self.names.items()}

    @property
    def errors(self) -> dict[str, float]:
        r"""Standard errors of the shares as parts of the box, $\sqrt{p (1 - p) / n}$.

        Those of independent points; evenly spread ones, on a grid or Sobol's, are nearer.
        """
        return {name: float(np.sqrt(p * (1.0 - p) / self.code.size)) for name, p in self.shares.items()}

    def __str__(self) -> str:
        shares, errors = self.shares, self.errors
        words = {a.name: a.words for a in self.attractors}
        rows = [
            f"  {words.get(name, name)}: {number(p)} +- {errors[name]:.1g}"
            for name, p in shares.items()
        ]
        return "\n".join([f"Basins: {self.code.size:,} starts", *rows])

    __repr__ = __str__

    def to_dataset(self, system: Given[AbstractHybridSystem]) -> "xr.Dataset":
        """Code and entry over the starts, with units: along the components of the box for a grid,
        otherwise along `start`."""
        import xarray as xr

        check_type("system", system, AbstractHybridSystem, "an AbstractHybridSystem")
        grid = self.code.ndim == len(self.box) and self.code.ndim > 1
        dims = tuple(self.box) if grid else ("start",)
        starts, coords = components_of(self.starts), {}
        for axis, name in enumerate(self.box):
            place: Any = place_of(self.starts, name)
            column = np.asarray(starts[place.name])
            column = column[(..., *place.index)] if place.index else column
            if grid:
                along = tuple(slice(None) if k == axis else 0 for k in range(len(dims)))
                coords[name] = ((name,), column[along], {"units": unit_of(system, place.name)})
            else:
                coords[name] = (dims, column, {"units": unit_of(system, place.name)})
        meanings = meanings_of(self.names)
        return xr.Dataset(
            {
                "code": (dims, self.code, {"long_name": "attractor", **meanings}),
                "entry": (dims, self.entry, {"long_name": "time of entry", "units": "s"}),
            },
            coords,
        )


def basins(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    box: Given[Mapping[str, tuple[float, float]]],
    settle: Given[Settle],
    *,
    points: Given[int | tuple[int, ...]] = 1024,
    integrator: Given[Integrator | None] = None,
    args: PyTree = None,
    known: Given[tuple[Attractor, ...]] = (),
) -> Basins:
    r"""Attractors that motions from a box come to, and which start comes to which.

    Attractors are found from where motions are after a while: a fixed point of the mode, or a periodic
    orbit, each solved by Newton's method and stable by its eigenvalues or multipliers; and sets of
    states at which contacts hold all that would move. About a fixed point and an orbit there is a
    radius within which all motions looked at come nearer, at this and every smaller distance (128
    directions and 12 distances, through their events): a motion belongs to an attractor as soon as it
    is so near, and in the same mode. Motions that are open at the end are asked for their Lyapunov
    exponents: of one that never repeats but attracts, quasi-periodic or chaotic, the attractor is known
    by 4,096 places of it. No motion is judged by the time alone: one that is on its way, beside
    an unstable one or hardly damped is "not settled".

    >>> import stickslip as ss
    >>> from stickslip.basin import Settle, basins
    >>> from stickslip.friction import Stribeck
    >>> from stickslip.mechanism import AbstractMechanism, Contact
    >>> class OnBelt(AbstractMechanism):
    ...     belt: float = 1.5
    ...     coordinates = {"x": "m"}
    ...     contact_directions = {"belt": {"x": 1}}
    ...     def mass_matrix(self, q):
    ...         return {"x": 1.0}
    ...     def forces(self, t, q, v, args):
    ...         return {"x": -q.x - 0.1 * v.x}
    ...     def contacts(self, t, q, v, args):
    ...         return {"belt": Contact(Stribeck(1.0, 0.5, 0.5, exponent=1), 1.0, self.belt)}
    >>> system = OnBelt()
    >>> box = {"x": (-2.0, 2.0), "v_x": (0.0, 2.0)}
    >>> basins(system, system.state(), box, Settle(300.0), points=(16, 16))
    Basins: 256 starts
      fixed point 1: 0.304688 +- 0.03
      orbit 1, 6.31631 s, 2 events: 0.695312 +- 0.03

    **Arguments**

    - `system`, `args`, `integrator`: as for `simulate`. The motions begin at the time 0.
    - `y0`: a state; components that `box` does not name are the same for all starts.
    - `box`: name of a number of the state to its least and greatest value.
    - `settle`: a `Settle`: for how long, period of the forcing, limits.
    - `points`: how many, spread evenly after Sobol, at best a power of two; or the cells of a grid, a
      number for each component of the box, whose middles are the starts.
    - `known`: attractors of an earlier map, of other starts or parameters. They keep their names where
      Newton's method leads from there to one that attracts.

    **Returns** `Basins`. It runs outside `jit`, and has no derivatives.

    **Errors** `ValueError`/`TypeError` naming the argument; also for a system that depends on the time
    without a `forcing_period`. A run that fails is a code.
    """
    check_type("settle", settle, Settle, "a Settle(duration)")
    y0, box = check_start(system, y0, box, settle, args)
    check_type("known", known, tuple, "a tuple of Attractors")
    for k, attractor in enumerate(known):
        check_type(f"known[{k}]", attractor, Attractor, "an Attractor")
    if integrator is not None:
        check_type("integrator", integrator, Integrator, "an Integrator or None")
    y, shape = starts_in(y0, box, points)
    lanes = Lanes(system, args, integrator, y0)
    judged = Judged(lanes, settle, y, turns(system, y0), known)
    judged.follow()
    starts = jax.vmap(lanes.unravel)(y)
    return Basins(
        tuple(judged.attractors),
        box,
        jax.tree.map(lambda leaf: np.asarray(leaf).reshape(*shape, *leaf.shape[1:]), starts),
        *(a.reshape(shape) for a in (judged.code, judged.entry, judged.failure)),
    )


def check_start(system: Any, y0: PyTree, box: Any, settle: Settle, args: PyTree) -> tuple[Any, dict]:
    """The state in float64 and the box; raises for names that the state has not."""
    check_handed_on("args", args)
    plain, given = with_float_arrays((the_system(system), args))
    y0, mode = start_of(plain, 0.0, y0, None, given)
    check_field(plain, 0.0, y0, mode, given)
    box = check_mapping("box", box, "a mapping from names of components to pairs of numbers")
    if not box:
        raise refusal("box", box, "a mapping with at least one component")
    names = numbers_of(y0)
    for argument, given in (("box", box), ("settle.limits", settle.limits)):
        for name in given:
            if name not in names:
                raise refusal(argument, name, f"numbers of the state: {component_list(y0)}")
    check_limits("box", box)
    if settle.forcing_period is None and depends_on_time(system, (), 0.0, y0, mode, args):
        allowed = "positive: the system depends on the time"
        raise refusal("settle.forcing_period", None, allowed, but="left out")
    return as_float64("y0", y0), {name: (float(low), float(high)) for name, (low, high) in box.items()}


def turns(system: AbstractHybridSystem, y0: PyTree) -> np.ndarray:
    """Period of each number of the state that is an angle, infinite for the others."""
    parts = [
        np.full(np.size(leaf), period_of(system, name) or np.inf)
        for name, leaf in components_of(y0).items()
    ]
    return np.concatenate(parts)


def starts_in(
    y0: PyTree, box: Mapping[str, tuple[float, float]], points: Any
) -> tuple[np.ndarray, tuple[int, ...]]:
    """Flat states of a box, `[start, size]`, and the shape of their grid."""
    unit, shape = _unit_points(points, len(box))
    y = np.tile(flat(y0), (len(unit), 1))
    names = numbers_of(y0)
    for part, (name, (low, high)) in zip(unit.T, box.items(), strict=True):
        y[:, names.index(name)] = low + (high - low) * part
    return y, shape


def _unit_points(points: Any, count: int) -> tuple[np.ndarray, tuple[int, ...]]:
    """Points of the unit cube, `[point, component]`, and their shape."""
    if not isinstance(points, tuple):
        number = check_count("points", points, 1)
        # Scrambled: the first of Sobol's own points is a corner of the box.
        whole = scipy.stats.qmc.Sobol(count, rng=0).random_base2(max(number - 1, 0).bit_length())
        return whole[:number], (number,)
    if len(points) != count:
        raise refusal("points", points, f"one number, or {count}, one for each component of the box")
    for k, number in enumerate(points):
        check_count(f"points[{k}]", number, 1)
    axes = [(np.arange(number) + 0.5) / number for number in points]
    mesh = np.meshgrid(*axes, indexing="ij")
    return np.stack([part.ravel() for part in mesh], axis=-1), points
