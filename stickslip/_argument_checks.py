"""Checks at the door: what each argument of a public function, method or constructor must be.

A decorator names the arguments that are checked before anything runs, each with its check:

>>> import equinox as eqx
>>> class Spring(eqx.Module):
...     stiffness: float
...
...     @check_arguments(x=reals, level=or_none(number("positive")))
...     def force(self, x, level=None):
...         return -self.stiffness * x
>>> Spring(2.0).force(0.5)
-1.0
>>> Spring(2.0).force("0.5")
Traceback (most recent call last):
    ...
TypeError: x = '0.5': it must be a real number or an array of real numbers.

On a class it checks the fields of every object that is made:

>>> @check_arguments(stiffness=number("positive"))
... class Positive(Spring):
...     pass
>>> Positive(-1.0)
Traceback (most recent call last):
    ...
ValueError: stiffness = -1.0: it must be finite and positive.

A check is handed the object whose method is called, the name of the argument and its value, and returns
the value to use. Those of methods that take whole logs look at types and shapes, and at numbers where
few of them are allowed: NaN and infinity pass, since logs have them in rows that were never reached.
Tracers pass by their type, so that nothing is added to a program.
"""

import functools
import inspect
from collections.abc import Callable, Collection
from typing import Any, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ._validation import (
    KINDS,
    MOST,
    REAL,
    as_parameter,
    check_between,
    check_callable,
    check_count,
    check_flag,
    check_float64,
    check_in,
    check_text,
    check_type,
    leaves_of,
    numbers,
    one_concrete,
    one_number,
    one_row,
    one_static,
    refusal,
    shape_refusal,
)

Checked = TypeVar("Checked", bound=Callable[..., Any])
Check = Callable[[Any, str, Any], Any]  # the object, the argument's name, its value -> the value to use
# Or in a word what numbers, or arrays of them, must be: "any", "finite", "positive", "not negative".
Rule = Check | str


def check_of(rule: Rule) -> Check:
    """A check, also where it is said in a word."""
    return checked_by(KINDS[rule]) if isinstance(rule, str) else rule


def check_arguments(**rules: Rule) -> Callable[[Checked], Checked]:
    """Decorator of a function, a method or a module: the arguments named here are checked first."""

    checks = {name: check_of(rule) for name, rule in rules.items()}

    def decorate(of: Any) -> Any:
        parameters = inspect.signature(of).parameters
        assert checks.keys() <= parameters.keys(), (of, checks)
        if inspect.isclass(of):
            return _with_checked_fields(of, checks)
        places = [p.name for p in parameters.values() if p.kind is p.POSITIONAL_OR_KEYWORD]
        row = tuple(checks.get(name) for name in places)
        bound = places[:1] in (["self"], ["cls"])

        @functools.wraps(of)
        def with_checks(*args: Any, **named: Any) -> Any:
            owner = args[0] if bound and args else None
            given = [
                check(owner, name, value) if check else value
                for name, check, value in zip(places, row, args, strict=False)
            ]
            for name in checks:
                if name in named:
                    named[name] = checks[name](owner, name, named[name])
            return of(*given, *args[len(places) :], **named)

        return with_checks

    return cast(Any, decorate)


def parameters(**rules: Rule) -> Callable[[Checked], Checked]:
    """Decorator of a constructor: the arguments named here are checked, and stored in fields of their
    names, as float64 arrays or `None`, before the constructor itself runs."""

    checks = {name: check_of(rule) for name, rule in rules.items()}

    def decorate(init: Any) -> Any:
        signature = inspect.signature(init)

        @functools.wraps(init)
        def with_parameters(self: Any, *args: Any, **named: Any) -> None:
            given = signature.bind(self, *args, **named)
            given.apply_defaults()
            for name, check in checks.items():
                value = check(self, name, given.arguments[name])
                setattr(self, name, None if value is None else as_parameter(value))
            init(self, *args, **named)

        return with_parameters

    return cast(Any, decorate)


def _with_checked_fields(cls: type, checks: dict[str, Check]) -> type:
    own: Any = vars(cls).get("__check_init__")

    def __check_init__(self: Any) -> None:
        for name, check in checks.items():
            check(self, name, getattr(self, name))
        if own is not None:
            own(self)

    cast(Any, cls).__check_init__ = __check_init__
    return cls


def check_own_methods(cls: type, checks: dict[str, dict[str, Check]]) -> None:
    """Let the methods that a class defines itself check the arguments that `checks` names."""
    for name, of in checks.items():
        method = vars(cls).get(name)
        if inspect.isfunction(method) and not getattr(method, "__isabstractmethod__", False):
            arguments = list(inspect.signature(method).parameters)[1:]
            # An heir may call its arguments what it likes; their order is what the base class says.
            named = dict(zip(arguments, of.values(), strict=False))
            setattr(cls, name, check_arguments(**named)(method))


def checked_by(check: Callable[..., Any], *rest: Any) -> Check:
    """The check `check(name, value, *rest)`, which asks nothing of the object."""
    return lambda owner, name, value: check(name, value, *rest)


flag = checked_by(check_flag)  # True or False


def between(low: float, high: float) -> Check:
    """Numbers in a closed interval."""
    return checked_by(check_between, low, high)


def number(kind: str = "finite") -> Check:
    """One number, traced or not: `"any"`, `"finite"`, `"positive"` or `"not negative"`."""
    return checked_by(one_number, kind)


def known_number(kind: str = "finite") -> Check:
    """One number that is known now, not traced."""
    return checked_by(one_concrete, kind)


def static_number(kind: str = "finite") -> Check:
    """A number of Python, part of the program."""
    return checked_by(one_static, kind)


def row(kind: str = "finite", least: int = 1) -> Check:
    """A vector of at least so many numbers."""
    return checked_by(one_row, kind, least)


def count(low: int, high: int = MOST) -> Check:
    """An integer of Python from `low` to `high`."""
    return checked_by(check_count, low, high)


def choice(allowed: Collection[Any]) -> Check:
    """One of a few words."""
    return checked_by(check_in, allowed)


def text(allowed: str = "a text") -> Check:
    """A text that is not empty."""
    return checked_by(check_text, allowed)


def callable_as(call: str, *arguments: Any) -> Check:
    """Callable as `call` shows, with such `arguments`."""
    return checked_by(check_callable, call, *arguments)


def instance(expected: Any, allowed: str) -> Check:
    """An object of this class."""
    return checked_by(check_type, expected, allowed)


def reals(owner: Any, name: str, value: Any) -> Any:
    """A real number or an array of them, of any value and shape; a list becomes an array."""
    if isinstance(value, list | tuple):
        return numbers(name, value)
    return _one_real(name, value)


def _one_real(name: str, value: Any) -> Any:
    if isinstance(value, jax.Array | np.ndarray | np.generic):
        kind = value.dtype
        good = jnp.issubdtype(kind, jnp.floating) or jnp.issubdtype(kind, jnp.integer)
        if not good or isinstance(value, np.ma.MaskedArray):
            raise refusal(name, value, REAL, TypeError)
        return value
    if isinstance(value, list | tuple):
        raise refusal(name, value, REAL, TypeError)
    numbers(name, value)
    return value


def senses(owner: Any, name: str, value: Any) -> Any:
    """+1 or -1, or 0 for rest; NaN where the motion is."""
    value = reals(owner, name, value)
    if not isinstance(value, Tracer):
        array = np.asarray(value)
        good = np.isin(array, (-1.0, 0.0, 1.0)) | np.isnan(array)
        if not good.all():
            raise refusal(name, array[~good].flat[0].item(), "+1 or -1, or 0 at rest")
    return value


def whole_numbers(name: str, value: Any, count: int) -> Any:
    """Integers from -1, which rows of logs have that were never reached, to below `count`."""
    allowed = f"an integer from 0 to {count - 1}, or an array of them, -1 for none"
    whole = isinstance(value, int) and not isinstance(value, bool)
    if isinstance(value, jax.Array | np.ndarray | np.generic):
        masked = isinstance(value, np.ma.MaskedArray)
        whole = jnp.issubdtype(value.dtype, jnp.integer) and not masked
    if not whole:
        raise refusal(name, value, allowed, TypeError)
    if isinstance(value, int):
        bad = [] if -1 <= value < count else [value]
    else:
        bad = [] if isinstance(value, Tracer) else [n for n in np.unique(value) if not -1 <= n < count]
    if bad:
        raise refusal(name, bad[0], allowed)
    return value


def modes(owner: Any, name: str, value: Any) -> Any:
    """Number of a mode of the system, or an array of them."""
    return whole_numbers(name, value, len(owner.mode_names))


def guard_numbers(owner: Any, name: str, value: Any) -> Any:
    """Number of a guard of the system, or an array of them."""
    return whole_numbers(name, value, len(owner.guard_names))


def state(owner: Any, name: str, value: Any) -> Any:
    """A state of the system: what has its components, which `units` names, as numbers or arrays."""
    return with_components(name, value, tuple(owner.units))


def with_components(name: str, value: Any, components: tuple[str, ...]) -> Any:
    """The value if it has these components, numbers or arrays of them."""
    for part in components:
        try:
            number = getattr(value, part)
        except AttributeError:
            allowed = f"a state with the components {', '.join(components)}"
            raise refusal(name, value, allowed, TypeError) from None
        _one_real(f"{name}.{part}", number)
    return value


def one_real(owner: Any, name: str, value: Any) -> Any:
    """One real number, traced or not."""
    value = reals(owner, name, value)
    if np.shape(value) != ():
        raise shape_refusal(name, value, "one number")
    return value


def or_none(rule: Rule) -> Check:
    """The same, or None."""
    check = check_of(rule)
    return lambda owner, name, value: None if value is None else check(owner, name, value)


def time(owner: Any, name: str, value: Any) -> Any:
    """One finite time, traced or not."""
    return one_number(name, value)


def whole_state(owner: Any, name: str, value: Any) -> Any:
    """A state to begin with: a pytree of at least one finite number, none in single precision."""
    leaves = leaves_of(name, value)
    if not leaves:
        raise refusal(name, value, "a state: a pytree of at least one number", TypeError)
    for where, leaf in leaves:
        if not np.size(check_float64(where, leaf)):
            raise shape_refusal(where, leaf, "a number or an array with at least one element")
    return value


def own_arguments(owner: Any, name: str, value: Any) -> Any:
    """The user's own arguments: any pytree."""
    leaves_of(name, value)
    return value


# Arguments of an observable of a system.
OBSERVABLE: dict[str, Check] = {"t": reals, "y": state, "mode": modes, "args": own_arguments}
