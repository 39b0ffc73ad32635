"""The smallest kick that takes a motion out of its basin."""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy.optimize
import scipy.stats
from jaxtyping import PyTree

from .._jit_by_code import jit_by_code
from .._types import Given
from .._validation import check_mapping, check_type, one_concrete, refusal
from ..hybrid import AbstractHybridSystem, Integrator
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.components import numbers_of
from ._accuracy import ACCURACY
from ._basins import Basins, check_start, turns
from ._border import border_between
from ._codes import FAILED, LEFT, NOT_SETTLED, OTHERS
from ._judged import Judged, codes_from
from ._lanes import Lanes, flat, motion_of
from ._settle import Settle


class Kick(NamedTuple):
    """A change of the state that leads to the border of its basin.

    - `size`: its length, in the sizes of `by`, and `error`: half of the width in which the border is
      enclosed: where slow motions beside it are not settled, `settle` decides.
    - `change`: the kick, by component. `y`: the last state inside of the border. `to`: the attractor on
      the other side, or `"left the limits"`.
    """

    size: float
    error: float
    change: dict[str, float]
    y: PyTree
    to: str


def smallest_kick(
    system: Given[AbstractHybridSystem],
    found: Given[Basins],
    y0: PyTree,
    by: Given[Mapping[str, float]],
    settle: Given[Settle],
    *,
    integrator: Given[Integrator | None] = None,
    args: PyTree = None,
) -> Kick:
    r"""The smallest change of a state after which the motion comes to something else.

    The distance $r(u)$ to the border along a direction $u$ is enclosed as narrowly as numbers allow.
    It is least where $u$ is normal to the border. The normal $n$ there is the change that grows most
    along the motion beside the border, the first right singular vector of $\partial y(t)/\partial y(0)$
    through all events, which gives the slope of the distance,

    $$\frac{\partial r}{\partial u} = r\left(u - \frac{n}{n \cdot u}\right), \qquad |u| = 1.$$

    Of a state at rest, it is the local integrity measure of Soliman and Thompson (1989); their global
    one is the share of the basin.

    **Arguments**

    - `system`, `args`, `integrator`, `settle`: those of the map `found`.
    - `y0`: the state that is kicked, such as `found.attractors[0].motion.y`.
    - `by`: the components that the kick changes, all in the box of the map, to the change of each
      that counts as 1: `{"v_x": 1.0}`, or `{"x": 0.1, "v_x": 1.0}`.

    **Returns** the smallest `Kick` within the box, from the best of 1,024 that are spread over it: a
    part of another basin that lies between those is not seen. It runs outside `jit`.

    **Errors** `ValueError`/`TypeError` naming the argument; `ValueError` where the motion from `y0`
    itself is not settled, and where no kick within the box changes it.

    ??? cite "Reference"

        M. S. Soliman and J. M. T. Thompson, *Integrity measures quantifying the erosion of smooth and
        fractal basins of attraction*, Journal of Sound and Vibration 135, 1989.
    """
    check_type("found", found, Basins, "a Basins")
    check_type("settle", settle, Settle, "a Settle(duration)")
    if integrator is not None:
        check_type("integrator", integrator, Integrator, "an Integrator or None")
    y0, box = check_start(system, y0, found.box, settle, args)
    start, components = flat(y0), numbers_of(y0)
    sizes = check_mapping("by", by, "a mapping from components to the change that counts as 1")
    for name, size in sizes.items():
        one_concrete(f"by[{name!r}]", size, "positive")
    if not sizes or not set(sizes) <= set(box):
        raise refusal("by", list(sizes), f"some of the components of the box: {', '.join(box)}")
    lanes = Lanes(system, args, integrator, y0)
    attractors = Judged(lanes, settle, start[None], turns(system, y0), found.attractors).attractors
    own = int(codes_from(lanes, settle, attractors, start[None])[0])
    if own < 0:
        raise refusal("y0", y0, "a state from which the motion comes to an attractor of the map")
    kicks = _Kicks(lanes, settle, attractors, own, start, components, sizes, box)
    ways = kicks.by_distance()
    if not len(ways):
        allowed = "components by which a kick within the box changes the motion"
        raise refusal("by", list(sizes), allowed, but="none was found")
    u = ways[0]
    if len(sizes) > 1:
        few = {"ftol": ENGINE.slack, "maxls": ACCURACY.few, "maxiter": ACCURACY.few}
        u = scipy.optimize.minimize(kicks.distance, u, jac=True, method="L-BFGS-B", options=few).x
    border = kicks.border_along(u / np.linalg.norm(u))
    change = border.y - start
    names = [attractor.name for attractor in attractors]
    return Kick(
        float(border.distance),
        float(border.error),
        {name: float(change[components.index(name)]) for name in sizes},
        lanes.unravel(border.y),
        OTHERS[LEFT] if border.beyond == LEFT else names[border.beyond],
    )


class _Border(NamedTuple):
    """Where the border is along a direction: the state just inside, and the code beyond it."""

    distance: float
    error: float
    y: np.ndarray
    outside: np.ndarray
    beyond: int


class _Kicks:
    """Kicks of one state along directions `u` in the sizes of the components."""

    def __init__(self, lanes, settle, attractors, own, start, names, sizes, box):
        self.lanes, self.settle, self.attractors = lanes, settle, attractors
        self.own, self.start = own, start
        self.places = [names.index(name) for name in sizes]
        self.size = np.array([float(size) for size in sizes.values()])
        self.box = np.array([box[name] for name in sizes])

    def change(self, u: np.ndarray) -> np.ndarray:
        """The change of the state by kicks `[..., component]`."""
        rows = np.zeros((*u.shape[:-1], len(self.start)))
        rows[..., self.places] = u * self.size
        return rows

    def elsewhere(self, code: np.ndarray) -> np.ndarray:
        """Which motions come to something else, a rest that is found on the way among it."""
        return (code != self.own) & (code != NOT_SETTLED) & (code != FAILED)

    def room(self, u: np.ndarray) -> np.ndarray:
        """Distances along directions to the end of the box."""
        speed = u * self.size
        room = self.box.T[:, None, :] - self.start[self.places]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.nanmin(np.where(speed > 0.0, room[1], room[0]) / speed, axis=-1)

    def by_distance(self) -> np.ndarray:
        """Directions in which something changes, that with the nearest change first."""
        # Spread over the sphere: Sobol's points by the quantiles of the normal distribution.
        count = len(self.size)
        even = scipy.stats.qmc.Sobol(count, rng=0).random(ACCURACY.many)
        u = scipy.stats.norm.ppf(even) if count > 1 else np.array([[1.0], [-1.0]])
        u = u / np.linalg.norm(u, axis=1, keepdims=True)
        low, high = np.zeros(len(u)), self.room(u)
        part = np.linspace(0.0, 1.0, ACCURACY.few + 1)
        for _ in range(ACCURACY.few // 2):
            length = low[:, None] + (high - low)[:, None] * part
            rows = self.start + self.change(length[:, 1:, None] * u[:, None, :])
            given = self.lanes, self.settle, self.attractors, rows.reshape(-1, rows.shape[-1])
            changes = self.elsewhere(codes_from(*given).reshape(rows.shape[:2]))
            u, length, changes = (a[np.any(changes, axis=1)] for a in (u, length, changes))
            if not len(u):
                return u
            at, row = np.argmax(changes, axis=1), np.arange(len(u))
            low, high = length[row, at], length[row, at + 1]
        return u[np.argsort(high)]

    def border_along(self, u: np.ndarray) -> _Border:
        """The border along a direction of length 1."""
        room = float(self.room(u[None])[0])
        end = self.start + self.change(room * u)
        given = self.lanes, self.settle, self.attractors, (self.start, end)
        low, high, code = border_between(*given, self.own, self.elsewhere)
        inside, outside = (self.start + self.change(part * room * u) for part in (low, high))
        distance = 0.5 * (low + high) * room if code != self.own else np.inf
        return _Border(distance, 0.5 * (high - low) * room, inside, outside, code)

    def distance(self, u: np.ndarray) -> tuple[float, np.ndarray]:
        """Distance of the border along a direction of any length, and its slope."""
        length = np.linalg.norm(u)
        u = u / length
        border = self.border_along(u)
        if not np.isfinite(border.distance):
            return np.inf, np.zeros(len(u))
        n = self.normal(border)
        return border.distance, border.distance * (u - n / (n @ u)) / length

    def normal(self, border: _Border) -> np.ndarray:
        """The direction across the border: the change that grows most while both sides are together."""
        y, mode = np.stack([border.y, border.outside]), np.array([-1, -1])
        far = ACCURACY.near**2 * max(border.distance, float(np.max(np.abs(border.y))))
        before = 0.0
        for t in self.settle.times:
            moved = self.lanes(before, t, y, mode)
            y, mode = moved.y, moved.mode
            if before > 0.0 and not np.max(np.abs(y[0] - y[1])) <= far:
                break
            before = t
        lanes = self.lanes
        given = lanes.system, lanes.args, lanes.integrator, lanes.unravel, jnp.asarray(before)
        growth = np.asarray(_growth(*given, border.y)) @ self.change(np.eye(len(self.size))).T
        return np.linalg.svd(np.nan_to_num(growth))[2][0]


@jit_by_code
def _growth(system, args, integrator, unravel, t, y):
    begin, mode = jnp.zeros(()), jnp.asarray(-1)
    return jax.jacfwd(lambda y: motion_of(system, args, integrator, unravel, begin, t, y, mode).y)(y)
