"""Numbers read off a motion: components of the state, methods of the system, functions."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import PyTree

from .._one_function import first_alike
from .._validation import check_callable, check_text, refusal, shown_value
from ..hybrid import AbstractHybridSystem, Section
from ..hybrid.components import (
    Place,
    component_list,
    entries,
    own_axes,
    per_second,
    period_of,
    place_of,
    unit_of,
)

CALL = "f(system, t, y, dy, mode, args)"
OBSERVABLES = "a name, a sequence of names, or a mapping from names to names or functions"
Observable = Callable[[AbstractHybridSystem, Any, PyTree, PyTree, Any, PyTree], Any]


class Maximum(eqx.Module):
    """Section at the local maxima along the motion of an observable (smooth, without slopes in it)."""

    observable: str | Callable = eqx.field(static=True, converter=first_alike)
    direction: ClassVar = "falling"
    word: ClassVar = "maximum"

    def __check_init__(self):
        _check_observable(self.observable)


class Minimum(eqx.Module):
    """Section at the local minima along the motion of an observable (smooth, without slopes in it)."""

    observable: str | Callable = eqx.field(static=True, converter=first_alike)
    direction: ClassVar = "rising"
    word: ClassVar = "minimum"

    def __check_init__(self):
        _check_observable(self.observable)


def _check_observable(observable: Any) -> None:
    if callable(observable) and not isinstance(observable, type):
        check_callable("observable", observable, CALL, *range(6))
    else:
        check_text("observable", observable, f"the name of an observable or a function {CALL}")


# An observable is a value, not a closure: equal ones make equal programs, which are traced once.


@dataclasses.dataclass(frozen=True)
class Time:
    """Time itself."""

    def __call__(self, system, t, y, dy, mode, args):
        return t


@dataclasses.dataclass(frozen=True)
class Component:
    """A component of the state or one number of it, or the time derivative."""

    place: Place
    slope: bool

    def __call__(self, system, t, y, dy, mode, args):
        return self.place.read(dy if self.slope else y)


@dataclasses.dataclass(frozen=True)
class Angle:
    """A component with a period, within half of it on both sides of zero; `whole` is not folded."""

    whole: Component
    period: float

    def __call__(self, system, t, y, dy, mode, args):
        value = self.whole(system, t, y, dy, mode, args)
        return value - self.period * jnp.floor(value / self.period + 0.5)


def whole_of(observable: "Observable") -> "Observable":
    """The observable as it is, without a fold where it goes round."""
    return observable.whole if isinstance(observable, Angle) else observable


@dataclasses.dataclass(frozen=True)
class Method:
    """A method `(t, y, mode, args)` of the system."""

    name: str

    def __call__(self, system, t, y, dy, mode, args):
        return getattr(system, self.name)(t, y, mode, args)


@dataclasses.dataclass(frozen=True)
class RateOf:
    """Rate of change along the motion of an observable without slopes in it."""

    value: Observable

    def __call__(self, system, t, y, dy, mode, args):
        def along(t, y):
            return self.value(system, t, y, dy, mode, args)

        return jax.jvp(along, (t, y), (jnp.ones_like(t), dy))[1]


def as_observable(
    argument: str, what: Any, system: AbstractHybridSystem, y0: PyTree
) -> tuple[Observable, str | None]:
    """Function `(system, t, y, dy, mode, args)` of an observable, and its unit if that is known.

    - `"x"`: a component of the state, within half of its period on both sides of zero if it has one;
      `"x[0]"`: one number of an array; `"t"`: time; `"slope of x"`: the time derivative of `"x"`.
    - the name of a method `(t, y, mode, args)` of the system, such as `"normal_force"`.
    - a function `(system, t, y, dy, mode, args)`, as a `Section` takes it.
    """
    if callable(what) and not isinstance(what, type):
        return check_callable(argument, what, CALL, *range(6)), None
    if isinstance(what, str):
        if what == "t":
            return Time(), "s"
        name = what.removeprefix("slope of ")
        place, slope = place_of(y0, name), name != what
        if place is not None:
            unit = unit_of(system, place.name)
            period = None if slope else period_of(system, place.name)
            if period is not None:
                return Angle(Component(place, False), period), unit
            return Component(place, slope), per_second(unit) if slope else unit
        if not slope and callable(getattr(type(system), name, None)) and name[:1] != "_":
            return Method(name), None
    allowed = (
        f"a component of the state ({component_list(y0)}), 'slope of' one, 't', the name of a "
        "method (t, y, mode, args) of the system, or a function (system, t, y, dy, mode, args)"
    )
    raise refusal(argument, what, allowed)


def named_observables(observables: Any) -> dict[str, Any]:
    """Observables by name: of a name, a sequence of names, or a mapping."""
    if isinstance(observables, str):
        observables = (observables,)
    if isinstance(observables, Mapping):
        named = dict(observables)
    elif isinstance(observables, Sequence) and all(isinstance(o, str) for o in observables):
        named = {o.replace(" ", "_"): o for o in observables}
    else:
        raise refusal("observables", observables, OBSERVABLES, TypeError)
    if not named or not all(isinstance(name, str) and name for name in named):
        raise refusal("observables", observables, f"{OBSERVABLES}, at least one")
    return named


def shape_of(
    argument: str, what: Any, observable: "Observable", system: AbstractHybridSystem, y0: PyTree,
    mode: Any, args: PyTree, *, single: bool = False,
) -> tuple[int, ...]:  # fmt: skip
    """Shape of an observable, found without compiling; raises if it is not an array of real numbers.

    With `single` it must be one number, as of a section. `what`: the observable as it was asked for.
    """
    y0 = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), y0)
    found = eqx.filter_eval_shape(observable, system, jnp.zeros(()), y0, y0, mode, args)
    if isinstance(found, int | float):
        return ()
    kinds = (jnp.number, jnp.bool_)
    array = isinstance(found, jax.ShapeDtypeStruct)
    if not array or not any(jnp.issubdtype(found.dtype, kind) for kind in kinds):
        given = f"which gives a {type(found).__name__}"
        raise refusal(argument, what, "an observable that gives a number or one array", but=given)
    shape = found.shape
    if single and shape:
        place = getattr(whole_of(observable), "place", None)
        names = list(entries(place.name, shape)) if place is not None else ()
        slope = "slope of " if isinstance(what, str) and what.startswith("slope of ") else ""
        such = f", of {slope}{names[0]} to {slope}{names[-1]}" if names else ""
        raise refusal(argument, what, f"one number{such}", but=f"of shape {shape}")
    return shape


def axes_of(name: str, observable: "Observable", rank: int) -> tuple[str, ...]:
    """Names of an observable's own axes: those of its component, else of its own name."""
    place = getattr(whole_of(observable), "place", None)
    return own_axes(name if place is None else place.name, rank)


def as_section(
    section: Any, system: AbstractHybridSystem, y0: PyTree, argument: str = "section"
) -> Section:
    """The section that a `Section`, a `Maximum` or a `Minimum` stands for; none ends a motion."""
    if isinstance(section, Section):
        return Section(section.function, section.direction, name=section.name)
    if isinstance(section, Maximum | Minimum):
        what = section.observable
        value, _ = as_observable(f"{argument}.observable", what, system, y0)
        place = getattr(whole_of(value), "place", None)
        if place is not None and jnp.ndim(place.read(y0)):
            shape_of(f"{argument}.observable", what, value, system, y0, None, None, single=True)
        label = what if isinstance(what, str) else "observable"
        rate, name = RateOf(whole_of(value)), f"{section.word} of {label}"
        return Section(rate, section.direction, name=name)
    raise refusal(argument, section, "a Section, a Maximum or a Minimum", TypeError)


def with_parameters(system: AbstractHybridSystem, values: dict[str, Any]) -> AbstractHybridSystem:
    """`system` with the parameters at dotted paths, e.g. `"drive.U_in"` as `drive__U_in`, replaced."""
    for name, value in values.items():
        path = name.split("__")

        def find(tree, path=path):
            for part in path:
                tree = getattr(tree, part)
            return tree

        system = eqx.tree_at(find, system, value)
    return system


def check_parameter(system: AbstractHybridSystem, name: str, argument: str | None = None) -> None:
    """Raise for a name that is not a number in the system; `argument`: by default that of a grid."""
    argument = f"grid[{name!r}]" if argument is None else argument
    tree: Any = system
    for part in name.split("__"):
        known = [key for key, v in vars(tree).items()] if isinstance(tree, eqx.Module) else []
        if part not in known:
            here = f"one of {', '.join(known) or 'none'} (a__b for b inside a)"
            named = f"named after a parameter of {type(system).__name__}, here {here}"
            raise refusal(argument, name, named)
        tree = getattr(tree, part)
    traced = isinstance(tree, Tracer)  # of which Equinox asks what it has not
    real = jnp.issubdtype(tree.dtype, jnp.inexact) if traced else eqx.is_inexact_array_like(tree)
    if jnp.shape(tree) != () or not real:
        named = f"named after a parameter that is a real number, not {shown_value(tree)}"
        raise refusal(argument, name, named)
