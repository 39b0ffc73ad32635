"""Arguments of public methods: numbers, states and modes, one at a time or whole logs of them.

A method names the arguments that are checked before it runs, each with its check:

>>> import equinox as eqx
>>> class Spring(eqx.Module):
...     stiffness: float
...
...     @check_arguments(x=reals)
...     def force(self, x):
...         return -self.stiffness * x
>>> Spring(2.0).force(0.5)
-1.0
>>> Spring(2.0).force("0.5")
Traceback (most recent call last):
    ...
TypeError: x = '0.5': it must be a real number or an array of real numbers.

Types and shapes are checked, and numbers where few of them are allowed; tracers pass by their type,
so that nothing is added to a program. NaN and infinity pass: logs have them in rows that were never
reached, and there the answer is NaN.
"""

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ._validation import (
    REAL,
    check_float64,
    check_type,
    is_concrete,
    leaves_of,
    misshaped,
    numbers,
    one_number,
    refusal,
)

Method = TypeVar("Method", bound=Callable[..., Any])
Check = Callable[[Any, str, Any], Any]  # the object, the argument's name, its value -> the value to use


def check_arguments(**checks: Check) -> Callable[[Method], Method]:
    """Decorator of a method: the arguments named here are checked before it runs."""

    def decorated(method: Method) -> Method:
        names = tuple(inspect.signature(method).parameters)[1:]
        assert set(checks) <= set(names), (method, checks)
        row = tuple(checks.get(name) for name in names)

        @functools.wraps(method)
        def checked(self: Any, *args: Any, **named: Any) -> Any:
            given = (
                check(self, name, value) if check else value
                for name, check, value in zip(names, row, args, strict=False)
            )
            for name in named.keys() & checks.keys():
                named[name] = checks[name](self, name, named[name])
            return method(self, *given, *args[len(names) :], **named)

        return cast(Method, checked)

    return decorated


def check_own_methods(cls: type, checks: dict[str, dict[str, Check]]) -> None:
    """Let the methods that a class defines itself check the arguments that `checks` names."""
    for name, of in checks.items():
        method = vars(cls).get(name)
        if inspect.isfunction(method) and not getattr(method, "__isabstractmethod__", False):
            arguments = list(inspect.signature(method).parameters)[1:]
            # An heir may call its arguments what it likes; their order is what the base class says.
            named = dict(zip(arguments, of.values(), strict=False))
            setattr(cls, name, check_arguments(**named)(method))


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
    """What has these components, numbers or arrays of them."""
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
        raise misshaped(name, value, "one number")
    return value


def not_negative_number(owner: Any, name: str, value: Any) -> Any:
    """One number that is not negative, traced or not."""
    value = one_real(owner, name, value)
    if is_concrete(value) and not np.isfinite(np.asarray(value)) & (np.asarray(value) >= 0):
        raise refusal(name, value, "finite and not negative")
    return value


def or_none(check: Check) -> Check:
    """The same, or None."""
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
            raise misshaped(where, leaf, "a number or an array with at least one element")
    return value


def instance(expected: type, allowed: str) -> Check:
    """What is of this class."""
    return lambda owner, name, value: check_type(name, value, expected, allowed)


def own_arguments(owner: Any, name: str, value: Any) -> Any:
    """The user's own arguments: any pytree that ends."""
    leaves_of(name, value)
    return value


# What an observable of a system takes.
OBSERVABLE: dict[str, Check] = {"t": reals, "y": state, "mode": modes, "args": own_arguments}
