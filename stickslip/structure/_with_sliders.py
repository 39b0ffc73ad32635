"""A mechanism or a structure with massless sliders behind springs."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from .._argument_checks import check_arguments, instance, one_real, time, whole_state, with_components
from .._argument_checks import modes as some_modes
from .._types import Given, Numeric, Whole
from .._validation import (
    MOST_NUMBERED,
    as_parameter,
    check_finite,
    check_mapping,
    check_type,
    is_concrete,
    refusal,
    shape_refusal,
)
from ..hybrid import AbstractSystemWrapper
from ..hybrid.status import JUMP, NO_MODE
from ..hybrid.system import guard_directions, mode_type
from ..hybrid.tree import select
from ..mechanism import AbstractMechanicalSystem, AbstractMechanism
from ._jenkins import Along, Jenkins
from ._linear_structure import LinearStructure
from ._modes import SliderModes
from ._push import under_push
from ._sliders import Push, Rates, Sliders, elongations, guard_names, moving, with_places


class Slid(NamedTuple):
    """State `y` of the system, and the positions `z` of all sliders [m], in a row."""

    y: PyTree
    z: Any


_slid = instance(Slid, "a Slid, as `start` makes it")
_SYSTEM = "an AbstractMechanism or a LinearStructure"


class WithSliders(AbstractSystemWrapper, AbstractMechanicalSystem):
    r"""The same system with Jenkins elements: sliders without mass behind springs.

    $$M(q)\,\dot v = f(t, q, v) + \sum_c n_c\lambda_c - \sum_j \frac{\partial e_j}{\partial q} f_j$$

    with the force $f_j$ of each element and its elongation $e_j(q)$, as `Jenkins` has them. Stick, slip
    and turning are events, located to rounding; nothing is regularised. A damped oscillator under a
    harmonic force, with a friction damper:

    >>> import stickslip as ss
    >>> from stickslip.structure import HarmonicForce, Jenkins, LinearStructure, WithSliders
    >>> oscillator = LinearStructure([[1.0]], [[0.04]], [[1.0]], HarmonicForce([0.1], 1.2))
    >>> damped = WithSliders(oscillator, {"damper": Jenkins([1.0], stiffness=0.5, bound=0.1)})
    >>> run = ss.simulate(damped, 0.0, 40.0, damped.start(oscillator.state()))
    >>> f"{run.y1.y.q[0]:.10f}"
    '-0.0632910122'
    >>> [damped.mode_names[m] for m in run.events.mode_after[:3]]
    ['slip forward', 'stick', 'slip backward']

    - State `Slid`; `start(y)` makes one with springs that bear nothing.
    - Modes: those of `system`, and for each element which of its sliders slip. Events are those of
      `system`, and of each element: a slider slips, or all turn; one whose bound varies opens or
      closes. Elements that turn in the same instant do so one after the other, no more than 16.
    - A slider that never slips stays where it began: periodic orbits are then a family over its place,
      with a multiplier of 1 for it, and not `stable`. From `start(y)` none is displaced.
    - The positions of sliders in a row keep the order of their limits, as from rest without forces they
      do: $|z_i - z_{i+1}|$ is at most the difference of the limits. Elements with one slider begin
      anywhere. A state that is not admissible has no mode.

    **Arguments:** `system`, an `AbstractMechanism` or a `LinearStructure`; `sliders`, a mapping from
    names to `Jenkins` elements.
    **Raises** `TypeError`, `ValueError` naming the argument; at the start for sliders out of bounds.
    """

    system: Any
    elements: tuple[Jenkins, ...]
    names: tuple[str, ...] = eqx.field(static=True)

    def __init__(
        self,
        system: Given[AbstractMechanism | LinearStructure],
        sliders: Given[Mapping[str, Jenkins]],
    ):
        self.system = check_type("system", system, AbstractMechanism | LinearStructure, _SYSTEM)
        given = check_mapping("sliders", sliders, "a mapping from names to Jenkins elements")
        if not given:
            raise refusal("sliders", sliders, "a mapping from at least one name to a Jenkins element")
        # Not as a mapping: JAX sorts its keys.
        self.names, self.elements = tuple(given), tuple(given.values())
        for name, element in given.items():
            check_type(f"sliders[{name!r}]", element, Jenkins, "a Jenkins element")
            if not name or " / " in name:
                raise refusal("sliders", name, "names of elements: texts without ' / '")
            self._check_direction(name, element)
        names = self.mode_names
        if names.places[-1] * names.bases[-1] > MOST_NUMBERED:
            allowed = "fewer, or with their sliders in common elements: modes are numbers of 64 bits"
            raise refusal("sliders", f"{len(given)} elements", allowed)

    def _check_direction(self, name: str, element: Jenkins) -> None:
        direction, system = element.direction, self.system
        if not isinstance(direction, Along):
            return
        what = f"the direction of sliders[{name!r}]"
        if isinstance(system, LinearStructure):
            if direction.names is not None or direction.row.shape != system.shape:
                raise refusal(what, direction.row, f"a row of {system.shape[0]}, one for each node")
            return
        known = tuple(system.coordinates)
        for one in direction.names or ():
            if one not in known:
                raise refusal(what, one, f"names of coordinates: {', '.join(map(repr, known))}")
        if direction.names is None and direction.row.shape != (len(known),):
            raise refusal(what, direction.row, f"{len(known)} numbers, for {', '.join(known)}")

    # -- names

    @property
    def sliders(self) -> dict[str, Jenkins]:
        """The elements by name."""
        return dict(zip(self.names, self.elements, strict=True))

    @property
    def _at_rest(self) -> Any:
        """The system under the force of sliders, of which it matters only that there is one."""
        return self._under(jnp.zeros(self._number), jnp.zeros(len(self.names)))

    @property
    def _number(self) -> int:
        return sum(element.count for element in self.elements)

    def _under(self, z: Any, k: Any) -> Any:
        """The system under the force of sliders in these positions and states."""
        return under_push(self.system, Push(self.elements, z, k))

    @property
    def mode_names(self) -> SliderModes:
        """Those of `system`, with the state of each element behind them."""
        counts = tuple(element.count for element in self.elements)
        varies = tuple(element.varies for element in self.elements)
        return SliderModes(self.system.mode_names, counts, varies)

    @property
    def _own_guards(self) -> tuple[str, ...]:
        return guard_names(self.names, self.elements)

    @property
    def guard_names(self) -> tuple[str, ...]:
        """Those of `system`, then its own."""
        return (*self._at_rest.guard_names, *self._own_guards)

    @property
    def guard_directions(self) -> tuple[str, ...]:
        """Those of `system`, then `"falling"` for its own."""
        return (*guard_directions(self._at_rest), *("falling",) * len(self._own_guards))

    @property
    def guard_scales(self) -> Any:
        """Those of `system` if it states them; its own follow the motion."""
        stated = self._at_rest.guard_scales
        return None if stated is None else (*stated, *(None,) * len(self._own_guards))

    @property
    def units(self) -> dict[str, str]:
        """Those of `system`; the sliders are in metres."""
        return {**self.system.units, "z": "m"}

    @property
    def continuous_guards(self) -> tuple[int, ...]:
        """Those of `system`."""
        return self._at_rest.continuous_guards

    @property
    def answers_jumps(self) -> bool:
        """True: sliders follow bounds that jump, and the system is asked again."""
        return True

    # -- one instant

    def inner(self, y, args):
        return y.y, args

    def _split(self, mode: Any) -> tuple[Any, Any]:
        """Mode of `system`, and the states of the elements."""
        names = self.mode_names
        inner = jnp.asarray(mode % len(names.system), mode_type(self.system))
        word = mode_type(self)
        digits = jnp.asarray(mode, word) // np.array(names.places, np.int64).astype(word)
        digits = digits % np.array(names.bases, np.int64).astype(word)
        return inner, digits.astype(jnp.float64) - np.array(names.counts, float)

    def _mode_of(self, inner: Any, k: Any) -> Any:
        names, word = self.mode_names, mode_type(self)
        digits = (k + np.array(names.counts, float)).astype(word)
        places = np.array(names.places, np.int64).astype(word)
        whole = jnp.asarray(inner, word) + jnp.sum(digits * places, dtype=word)
        return jnp.where(inner < 0, jnp.asarray(NO_MODE, word), whole)

    def _sliders(self, t: Any, y: Slid, k: Any, args: Any) -> Sliders:
        q, _ = self.system.to_coordinates(y.y)
        return Sliders(self.elements, t, q, elongations(self.elements, q), y.z, k, args)

    def _rates(self, t: Any, y: Slid, args: Any, dy: Any = None) -> Rates:
        """Rates of elongations and limits; accelerations too where the slope `dy` is given."""
        elements = self.elements
        q, v = self.system.to_coordinates(y.y)
        places, t = moving(q, v), jnp.asarray(t, jnp.float64)

        def stretch_of(places):
            return elongations(elements, with_places(q, places))

        def limits(t, places):
            now = with_places(q, places)
            found = [e.bounds(t, now, args)[0] / e.stiffness if e.varies else 0.0 * t for e in elements]
            return jnp.stack([jnp.reshape(d, ()) for d in found])

        rates = jax.jvp(stretch_of, (places,), (v,))[1]
        limit = jax.jvp(limits, (t, places), (jnp.ones_like(t), v))[1]
        if dy is None:
            return Rates(rates, limit)
        _, v_rate = self.system.to_coordinates(dy)
        along = jax.jvp(
            lambda places, v: jax.jvp(stretch_of, (places,), (v,))[1], (places, v), (v, v_rate)
        )
        return Rates(rates, limit, along[1])

    def vector_field(self, t, y, mode, args):
        inner, k = self._split(mode)
        dy = self._under(y.z, k).vector_field(t, y.y, inner, args)
        return Slid(dy, self._sliders(t, y, k, args).slider_rates(self._rates(t, y, args)))

    def guards(self, t, y, mode, args):
        inner, k = self._split(mode)
        under = self._under(y.z, k)
        rates = self._rates(t, y, args, under.vector_field(t, y.y, inner, args))
        own = self._sliders(t, y, k, args).guards(rates)
        return (*under.guards(t, y.y, inner, args), *own)

    def transition(self, t, y, mode, guard, args):
        """State and mode right after guard number `guard` has fired; -1 if a load has jumped."""
        inner, k = self._split(mode)
        others = len(self._at_rest.guard_names)
        jumps, of_system = guard == JUMP, guard < others
        sliders = self._sliders(t, y, k, args)
        moved = jnp.where(jumps, sliders.within_limits(), sliders.at_their_limits(k))
        own = sliders.after_guard(guard - others, self._rates(t, y, args))
        own = jnp.where(of_system, k, own)
        after, new = y.y, inner
        if others or self.system.answers_jumps:
            asked = jnp.minimum(guard, others - 1)
            found = self._under(moved, k).transition(t, y.y, inner, asked, args)
            after, new = select(of_system, (found[0], jnp.asarray(found[1], inner.dtype)), (after, new))
        z = jnp.where(of_system, moved, sliders.at_their_limits(own))
        # The speeds of the system may have jumped.
        dy = self._under(z, k).vector_field(t, after, jnp.maximum(new, 0), args)
        later = self._sliders(t, Slid(after, z), k, args)
        rates = self._rates(t, Slid(after, z), args, dy)
        k = jnp.where(jumps, later.states(rates), jnp.where(of_system, later.after_jump(rates), own))
        return Slid(after, z), self._mode_of(new, k)

    @check_arguments(t=one_real, y=_slid)
    def initial_mode(self, t, y, args):
        k = jnp.zeros(len(self.names))
        under = self._under(y.z, k)
        inner = under.initial_mode(t, y.y, args)
        dy = under.vector_field(t, y.y, jnp.maximum(inner, 0), args)
        sliders = self._sliders(t, y, k, args)
        found = self._mode_of(inner, sliders.states(self._rates(t, y, args, dy)))
        return jnp.where(sliders.admissible(), found, jnp.asarray(NO_MODE, found.dtype))

    def constraints(self, t, y, mode, args):
        """Those of `system`; sliders at their limits have no influence, and need not be held there."""
        inner, k = self._split(mode)
        return self._under(y.z, k).constraints(t, y.y, inner, args)

    def switches_in(self, t, y, mode, args):
        inner, k = self._split(mode)
        return self._under(y.z, k).switches_in(t, y.y, inner, args)

    def check_start(self, t, y, mode, args):
        """That of `system`; raises `ValueError` for sliders that are missing or out of bounds too."""
        if not isinstance(y, Slid):
            raise refusal("y0", y, "a Slid, as `start` makes it", TypeError)
        if np.shape(y.z) != (self._number,):
            raise shape_refusal("y0.z", y.z, f"a row of {self._number}, one for each slider")
        inner, system = None, self.system
        if mode is not None and is_concrete(mode) and not np.ndim(mode) and int(mode) >= 0:
            inner, k = self._split(jnp.asarray(mode, mode_type(self)))
            system = self._under(y.z, k)
        type(system).check_start(system, t, y.y, inner, args)
        if is_concrete((self, t, y, args)):
            sliders = self._sliders(t, y, jnp.zeros(len(self.names)), args)
            if not bool(sliders.admissible()):
                away = np.asarray(sliders.spread(sliders.e) - sliders.z)
                allowed = (
                    "within their limits f_s / k_t of the elongations, those in a row in the order of "
                    f"their limits; elongations less positions are {away.tolist()}"
                )
                raise refusal("y0.z", np.asarray(y.z).tolist(), allowed)

    @check_arguments(y=whole_state, t=time)
    def start(
        self, y: PyTree, z: Given[Numeric | None] = None, t: Numeric = 0.0, args: PyTree = None
    ) -> Slid:
        """State with sliders at `z` [m], a row of all; by default where the springs bear nothing."""
        with_components("y", y, tuple(self.system.units))
        if z is None:
            zero = jnp.zeros(self._number)
            sliders = self._sliders(t, Slid(y, zero), jnp.zeros(len(self.names)), args)
            return Slid(y, jnp.zeros(self._number) + sliders.spread(sliders.e))
        row = as_parameter(check_finite("z", z))
        if row.shape != (self._number,):
            raise shape_refusal("z", z, f"a row of {self._number}, one for each slider")
        return Slid(y, row)

    # -- what is observed

    @check_arguments(y=_slid)
    def energy(self, y):
        """That of `system`, and of the springs of the sliders [J]."""
        q, _ = self.system.to_coordinates(y.y)
        e = elongations(self.elements, q)
        k = jnp.concatenate([jnp.ravel(element.stiffness) for element in self.elements])
        counts = np.array([element.count for element in self.elements])
        stretch = jnp.repeat(e, counts, total_repeat_length=self._number) - y.z
        return self.system.energy(y.y) + 0.5 * jnp.sum(k * stretch * stretch)

    @check_arguments(t=one_real, y=_slid, mode=some_modes)
    def powers(self, t, y, mode, args):
        """Those of `system` [W], and `friction of NAME`, what the sliders of each element lose."""
        inner, k = self._split(jnp.asarray(mode))
        found = dict(self._under(y.z, k).powers(t, y.y, inner, args))
        sliders, rates = self._sliders(t, y, k, args), self._rates(t, y, args)
        # The springs keep what the elements take from the system, but for what the sliders lose.
        taken = jnp.sum(sliders.forces() * rates.v)
        found["forces"] = found.get("forces", 0.0) + taken
        losses = -sliders.sums(sliders.springs() * sliders.slider_rates(rates))
        return {**found, **{f"friction of {n}": x for n, x in zip(self.names, losses, strict=True)}}

    @check_arguments(t=one_real, y=_slid, mode=some_modes)
    def slider_forces(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree = None) -> dict[str, Any]:
        """Force of each element [N], by name: what its springs bear together."""
        _, k = self._split(jnp.asarray(mode))
        forces = self._sliders(t, y, k, args).forces()
        return dict(zip(self.names, forces, strict=True))

    @check_arguments(mode=some_modes)
    def slider_states(self, mode: Whole) -> dict[str, Any]:
        """State of each element in a mode, in the words of `mode_names`, by name.

        An array of modes, as of a log, gives arrays of words; in mode -1, of rows that were never
        reached, they are empty.
        """
        if not is_concrete(mode):
            raise refusal("mode", mode, "known: words are made outside of jit and vmap")
        names, array, found = self.mode_names, np.asarray(mode), {}
        for j, (name, base) in enumerate(zip(self.names, names.bases, strict=True)):
            words = np.array([names.word(j, state - names.counts[j]) for state in range(base)])
            digit = array // names.places[j] % base
            word = np.where(array < 0, "", words[digit])
            found[name] = word if array.shape else str(word)
        return found
