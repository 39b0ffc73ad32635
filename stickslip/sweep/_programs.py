"""Identity of a traced program: its text, its constants, and the code of the host that it calls.

The text alone does not say which function a host callback calls: two programs that differ in it only
have equal texts. Callbacks of `equinox.error_if` are known by their messages and never return. All
others have no identity here, so that their programs are neither shared nor vouched for.
"""

import collections
import hashlib
import re
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import jax
import jax.extend
import jax.numpy as jnp
import numpy as np

from .._compiled_once import MOST_KEPT
from .._jaxpr import equations

_PROGRAMS: collections.OrderedDict = collections.OrderedDict()
# Primitives that run code which is not in the program's text. Those of `jax.debug` return nothing.
_SILENT = ("debug_callback", "debug_print")
_HOST = re.compile(r"callback|ffi_call|custom_partitioning|^debug_print$|^outside_call")
_SPLIT = "Failed to materialize symbols"
UNKNOWN_OPERATION = "UNIMPLEMENTED"  # the status of everything that the compiler has no code for
_CALLBACK_IN_TEXT = re.compile(r"custom_call @\S*callback")


class Identity(NamedTuple):
    """Digest of a program, and the host code in it that the digest does not cover.

    - `unknown`: names of what decides results, e.g. `"pure_callback of measured"`.
    - `silent`: names of what only prints or records.
    """

    digest: str
    unknown: tuple[str, ...]
    silent: tuple[str, ...]


def identify(traced: Any, lowered: jax.stages.Lowered) -> Identity:
    """Identity of a program; that of an equal one in another process is equal."""
    text = re.sub(r"loc\([^)]*\)", "", lowered.as_text())
    total = hashlib.sha256(text.encode())
    unknown, silent, messages = set(), set(), set()
    called = False
    for kind, value in _outside(traced.jaxpr):
        if kind == "constant":
            array = np.asarray(
                jax.random.key_data(value) if jnp.issubdtype(value.dtype, jax.dtypes.prng_key)
                else value
            )  # fmt: skip
            total.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
            continue
        called = True
        function = _function(value)
        known = _error_message(function)
        if known is not None:
            messages.add(known)
        else:
            name = getattr(function, "__qualname__", None) or type(function).__qualname__
            what = kind if function is None else f"{kind} of {name}"
            (silent if kind in _SILENT else unknown).add(what)
    if not called and _CALLBACK_IN_TEXT.search(text):
        unknown.add("a host callback")
    total.update(repr(sorted(messages)).encode())
    return Identity(total.hexdigest(), tuple(sorted(unknown)), tuple(sorted(silent)))


def compiled_program(traced: Any, lowered: jax.stages.Lowered, devices: Any) -> jax.stages.Compiled:
    """Compiled program; functions that come to the same program share it."""
    identity = identify(traced, lowered)
    if identity.unknown or identity.silent:
        return lowered.compile()
    # Equal texts may hand out different types: another class of tuple, keys instead of their words.
    forms = [
        (jax.tree.structure(tree), *((x.shape, x.dtype) for x in jax.tree.leaves(tree)))
        for tree in (lowered.args_info, lowered.out_info)
    ]
    key = (identity.digest, repr(devices), *forms)
    try:
        known = key in _PROGRAMS
    except Exception:  # static data of a class that cannot be hashed or compared
        return lowered.compile()
    if not known:
        try:
            _PROGRAMS[key] = lowered.compile()
        except jax.errors.JaxRuntimeError as error:
            if not refused_to_fuse(error):
                raise
            # To find that out again would take as long.
            _PROGRAMS[key] = error
    _PROGRAMS.move_to_end(key)
    while len(_PROGRAMS) > MOST_KEPT:
        _PROGRAMS.popitem(last=False)
    found = _PROGRAMS[key]
    if isinstance(found, Exception):
        raise found.with_traceback(None)
    return found


def refused_to_fuse(error: Exception) -> bool:
    """Whether the compiler cannot make a fused loop of a program that is right otherwise.

    It has split an operation over threads, which it cannot link, or met one that it knows only outside
    of a fused loop, as the derivative of an index in reverse: that one no smaller chunk avoids.
    """
    return any(words in str(error) for words in (_SPLIT, UNKNOWN_OPERATION))


def _outside(closed: Any) -> Iterator[tuple[str, Any]]:
    """Constants that a program holds, and parameters of its calls of the host."""
    seen = set()

    def is_new(eqn: Any) -> bool:
        inside = set(map(id, jax.extend.core.jaxprs_in_params(eqn.params)))
        new = not inside <= seen
        seen.update(inside)
        return new

    yield from _arrays(closed.consts)
    for eqn in equations(closed.jaxpr, is_new):
        # Numbers are in the text, arrays may not be.
        literals = (getattr(atom, "val", None) for atom in eqn.invars)
        yield from _arrays(value for value in literals if getattr(value, "ndim", 0))
        if _HOST.search(eqn.primitive.name):
            yield eqn.primitive.name, eqn.params
        for value in eqn.params.values():
            for inner in value if isinstance(value, tuple | list) else (value,):
                if isinstance(inner, jax.extend.core.ClosedJaxpr):
                    yield from _arrays(inner.consts)


def _arrays(values: Iterable) -> Iterator[tuple[str, Any]]:
    return (("constant", value) for value in values if hasattr(value, "dtype"))


def _function(params: dict[str, Any]) -> Any:
    """The function that a call of the host calls, out of what JAX wraps around it."""
    function: Any = params.get("callback")
    while hasattr(function, "callback_func"):
        function = function.callback_func
    return function


def _error_message(function: Any) -> str | None:
    """Message of `equinox.error_if`; `None` for any other function."""
    if getattr(function, "__module__", None) != "equinox._errors":
        return None
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    held = {name: cell.cell_contents for name, cell in cells}
    return f"{function.__qualname__} {held.get('msgs')!r}"
