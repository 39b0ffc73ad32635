"""A key of the code behind a pytree: what its classes and functions would compute if traced again.

JAX keeps a program by the function that it traced, and what that function reads besides its arguments
is never looked at again: a helper function or a constant of a notebook that was edited since would be
ignored in silence. So every program of this package is kept by `code_key` too. It changes with the
byte code of all functions that can be reached from the classes and functions in a pytree, and with the
globals, closures, defaults and class attributes that they read: functions by their code, numbers and
arrays by value.

Code of the standard library, of site-packages and of this package is taken to stay as it is.
Where an object of an extension module is reached, whose state cannot be read, that is said once.
"""

import collections
import dataclasses
import dis
import enum
import functools
import hashlib
import itertools
import operator
import os
import pathlib
import sys
import sysconfig
import types
import warnings
import weakref
import zlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
import numpy as np

MOST_GROUPS = 64  # groups of classes and functions whose code is remembered
MOST_OBJECTS = 20_000  # reached from one group; any further one counts by its identity
_NUMBERS = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), range, slice, np.generic)
_OPERANDS = (*_NUMBERS, np.ndarray, jax.Array)
_CALLED = (types.FunctionType, types.MethodType, functools.partial)
# Where the code lies that is taken to stay as it is: this package, and what is installed.
_INSTALLED = tuple(
    f"{folder}{os.sep}"
    for folder in {
        str(pathlib.Path(__file__).parent),
        *(sysconfig.get_paths()[name] for name in ("stdlib", "platstdlib", "purelib", "platlib")),
    }
)
# Attributes that Python gives every class.
_OF_CLASSES = frozenset(
    "__module__ __dict__ __weakref__ __doc__ __annotations__ __abstractmethods__ __parameters__ "
    "__dataclass_fields__ __dataclass_params__ __match_args__ __firstlineno__ __static_attributes__ "
    "__qualname__ __orig_bases__ __annotate__ __annotate_func__ __annotations_cache__ _abc_impl "
    "__replace__ __type_params__".split()
)


def code_key(*trees: Any) -> str:
    """The digest of `code_and_traced`, without the traced numbers."""
    return code_and_traced(*trees)[0]


def code_and_traced(*trees: Any) -> tuple[str, list[jax.core.Tracer]]:
    """Digest of the code of all classes and functions in `trees`; empty where none is a user's own.

    With it the numbers of a trace that functions close over. Arrays and numbers in `trees` are
    operands, and do not count. Costs microseconds where nothing was
    edited. Where a function is found to have changed since it was last met, JAX's own traces of it are
    dropped (`jax.clear_caches`), because loops and branches would go on with them.
    """
    roots = list({id(root): root for tree in trees for root in _roots(tree)}.values())
    if not roots:
        return "", []
    key = tuple(map(id, roots))  # those kept here are alive, so no other object has their number
    kept = _kept.get(key)
    if kept is None or not kept.stands():
        kept = _Reached(roots)
        if not kept.traced:
            _kept[key] = kept
        while len(_kept) > MOST_GROUPS:
            _kept.popitem(last=False)
    return kept.digest, kept.traced


_kept: collections.OrderedDict[tuple, "_Reached"] = collections.OrderedDict()
_last: weakref.WeakKeyDictionary[Any, str] = weakref.WeakKeyDictionary()  # functions as last met
_serials: dict[int, tuple[Any, int]] = {}  # objects that count by their identity
_count = itertools.count()
_equals: dict[Any, Any] = {}  # one object for all that are equal
_said: set[type] = set()


def _roots(tree: Any) -> list[Any]:
    """Classes, functions and other objects in a pytree that are not of the libraries."""
    found, left = [], [tree]
    while left:
        part = left.pop()
        kind = type(part)
        operand, called, own, fields = _role(kind)
        if operand:
            continue
        if called:
            if not _of_library(part):
                found.append(part)
            continue
        if own:
            found.append(kind)
        if isinstance(part, dict):
            left += reversed(part.values())
        elif isinstance(part, tuple | list):
            left += reversed(part)
        elif fields:
            left += reversed(vars(part).values())
        elif not jax.tree_util.all_leaves([part]):
            left += reversed(jax.tree.leaves(part, is_leaf=lambda inner, part=part: inner is not part))
        elif not _of_library(part):  # what JAX knows nothing of; a function behind `jax.jit`, say
            found.append(part)
    return found


@functools.lru_cache(maxsize=512)
def _role(kind: type) -> tuple[bool, bool, bool, bool]:
    """Of objects of a class: are they operands, called, of a user's own class, with fields inside?"""
    return (
        issubclass(kind, _OPERANDS),
        issubclass(kind, type) or kind in _CALLED,
        not _of_library(kind),
        dataclasses.is_dataclass(kind) and kind.__dictoffset__ != 0,
    )


@functools.lru_cache(maxsize=4096)
def _in_library(module: str) -> bool:
    if module == "__main__":
        return False
    found = sys.modules.get(module)
    path = getattr(found, "__file__", None) or getattr(getattr(found, "__spec__", None), "origin", None)
    # A module with neither a file nor an origin was typed into a notebook.
    return path in ("built-in", "frozen") or str(path).startswith(_INSTALLED)


def _of_library(thing: Any) -> bool:
    module = getattr(thing, "__module__", None)
    return isinstance(module, str) and _in_library(module)


@functools.lru_cache(maxsize=4096)
def _reads(code: types.CodeType) -> tuple[frozenset[str], frozenset[str]]:
    """Names of globals that a code object and those within it read, and names of attributes."""
    names, attributes = set(), set()
    for step in dis.get_instructions(code):
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME", "IMPORT_NAME"):
            names.add(step.argval)
        elif step.opname in ("LOAD_ATTR", "LOAD_METHOD", "IMPORT_FROM"):
            attributes.add(step.argval)
    for inner in code.co_consts:
        if isinstance(inner, types.CodeType):
            own, others = _reads(inner)
            names |= own
            attributes |= others
    return frozenset(names), frozenset(attributes)


class _Reached:
    """All that is reached from some classes and functions: its digest, and what to look at again."""

    def __init__(self, roots: list[Any]):
        self.roots = roots
        # Where objects were read: they are compared by identity,
        self.functions: list[types.FunctionType] = []
        self.cells: list[types.CellType] = []
        self.names: dict[int, tuple[dict, set, set]] = {}  # of a namespace those read, and those absent
        self.holders: list[Any] = []
        self.containers: list[list | dict] = []
        # and where values were, which come anew.
        self.values: list[tuple[Callable, Any, Any]] = []
        self.met: dict[int, tuple[Any, Any]] = {}  # objects described already
        self.open: dict[int, int] = {}  # objects being described, by their depth
        self.lowest = sys.maxsize  # depth of the outermost of those that was met again
        self.traced: list[jax.core.Tracer] = []  # numbers that exist in one trace only
        self.changed = False
        self.digest = _digest(tuple(map(self._description, roots)))
        if not self.traced:
            self.seen = self._objects()
        if self.changed:
            jax.clear_caches()

    def stands(self) -> bool:
        """Whether all is still what it was."""
        try:
            now = self._objects()
        except (KeyError, ValueError, AttributeError):
            return False
        same = len(now) == len(self.seen) and all(map(operator.is_, now, self.seen))
        return same and all(read(thing) == seen for read, thing, seen in self.values)

    def _objects(self) -> list[Any]:
        found: list[Any] = [function.__code__ for function in self.functions]
        found += [cell.cell_contents for cell in self.cells]
        for namespace, read, absent in self.names.values():
            found += [namespace[name] for name in read]
            found.append(absent.isdisjoint(namespace.keys()) if absent else True)
        for thing in self.holders:
            found += _held(thing).values()
        for thing in self.containers:
            found += thing
            if isinstance(thing, dict):
                found += thing.values()
        return found

    def _description(self, thing: Any) -> Any:
        """A description that is equal for all things that compute the same."""
        if isinstance(thing, _NUMBERS):
            return type(thing).__name__, repr(thing)
        if id(thing) in self.met:
            return self.met[id(thing)][1]
        if id(thing) in self.open:
            depth = self.open[id(thing)]
            self.lowest = min(self.lowest, depth)
            return "again", len(self.open) - depth
        depth, outside = len(self.open), self.lowest
        self.open[id(thing)], self.lowest = depth, sys.maxsize
        try:
            found = _digest((type(thing).__qualname__, *self._parts(thing)))
        finally:
            del self.open[id(thing)]
        if self.lowest < depth:  # described by the way that led here: not for other ways
            self.lowest = min(outside, self.lowest)
            return found
        self.lowest = outside
        self.met[id(thing)] = thing, found
        if isinstance(thing, types.FunctionType | type):
            self.changed |= _last.get(thing, found) != found
            _last[thing] = found
        return found

    def _parts(self, thing: Any) -> Iterator[Any]:
        if isinstance(thing, jax.core.Tracer):
            self.traced.append(thing)
            yield str(thing.aval)
        elif isinstance(thing, np.ndarray):
            self.values.append((_checksum, thing, _checksum(thing)))
            yield _content(thing)
        elif isinstance(thing, jax.Array):
            keys = jnp.issubdtype(thing.dtype, jax.dtypes.prng_key)
            yield _content(np.asarray(jax.random.key_data(thing) if keys else thing))
        elif isinstance(thing, types.ModuleType):
            yield thing.__name__
        elif isinstance(thing, types.FunctionType | type) and _of_library(thing):
            yield thing.__module__, thing.__qualname__
        elif len(self.met) > MOST_OBJECTS:
            yield self._identity(thing)
        elif isinstance(thing, types.CodeType):
            yield from self._code(thing)
        elif isinstance(thing, types.FunctionType):
            yield from self._function(thing)
        elif isinstance(thing, types.CellType):
            self.cells.append(thing)
            yield self._description(thing.cell_contents)
        elif isinstance(thing, dict):
            self.containers.append(thing)
            yield from self._items(thing)
        elif isinstance(thing, list | tuple):
            if isinstance(thing, list):
                self.containers.append(thing)
            yield from map(self._description, tuple(thing))
        elif isinstance(thing, set | frozenset):
            if isinstance(thing, set):
                self.values.append((frozenset, thing, frozenset(thing)))
            yield sorted(str(self._description(element)) for element in thing)
        elif isinstance(thing, enum.Enum):
            yield thing.name
        elif isinstance(thing, type):
            self.holders.append(thing)
            yield from map(self._description, thing.__bases__)
            own = {name: held for name, held in vars(thing).items() if name not in _OF_CLASSES}
            yield from self._items(own)
        else:
            yield from self._object(thing)

    def _items(self, things: Mapping[Any, Any]) -> Iterator[Any]:
        yield from ((str(name), self._description(thing)) for name, thing in list(things.items()))

    def _code(self, code: types.CodeType) -> Iterator[Any]:
        yield code.co_code, code.co_names, code.co_varnames, code.co_freevars
        yield from map(self._description, code.co_consts)

    def _function(self, function: types.FunctionType) -> Iterator[Any]:
        self.functions.append(function)
        yield self._description(function.__code__)
        yield self._description(function.__defaults__)
        yield self._description(function.__kwdefaults__)
        yield from map(self._description, function.__closure__ or ())
        names, attributes = _reads(function.__code__)
        for name in sorted(names):
            value = self._value_of_name(function.__globals__, name)
            yield name, self._description(value)
            if isinstance(value, types.ModuleType) and not _in_library(value.__name__):
                for attribute in sorted(attributes & vars(value).keys()):
                    yield attribute, self._description(self._value_of_name(vars(value), attribute))

    def _value_of_name(self, namespace: dict, name: str) -> Any:
        _, read, absent = self.names.setdefault(id(namespace), (namespace, set(), set()))
        (read if name in namespace else absent).add(name)
        # An absent name is built in, or a module that the function imports itself.
        return namespace[name] if name in namespace else sys.modules.get(name)

    def _object(self, thing: Any) -> Iterator[Any]:
        """Any other object: what it wraps, or its class and what it holds."""
        kind = type(thing)
        wrapped = getattr(thing, "__func__", None) or getattr(thing, "__wrapped__", None)
        if callable(wrapped):  # of a method and of a function that JAX compiles
            yield self._description(wrapped)
            yield self._description(getattr(thing, "__self__", None))
        elif isinstance(thing, property):
            yield from map(self._description, (thing.fget, thing.fset))
        elif isinstance(thing, functools.partial):
            yield from map(self._description, (thing.func, thing.args, thing.keywords))
        elif _held(thing) and not (_standard(kind) and kind is not types.SimpleNamespace):
            self.holders.append(thing)
            yield self._description(kind)
            yield from self._items(_held(thing))
        elif _is_value(kind):
            yield self._identity(_equals.setdefault(thing, thing))
        elif _standard(kind) and " at 0x" not in repr(thing):
            self.values.append((repr, thing, repr(thing)))
            yield repr(thing)
        else:
            yield self._description(kind)
            yield self._identity(thing)

    def _identity(self, thing: Any) -> int:
        kind = type(thing)
        if not (callable(thing) or kind in _said or _standard(kind) or _is_value(kind)):
            _said.add(kind)
            warnings.warn(
                f"What an object of {kind.__module__}.{kind.__qualname__} holds cannot be read. If it "
                "changes, programs that were compiled with it do not: what changes belongs in `args` "
                "or in a field of the system.",
                stacklevel=2,
            )
        if id(thing) not in _serials:
            _serials[id(thing)] = thing, next(_count)  # kept alive, so that no other has its number
        return _serials[id(thing)][1]


def _held(thing: Any) -> Mapping[str, Any]:
    """Attributes of an object or a class, by name."""
    if hasattr(thing, "__dict__"):
        return vars(thing)
    slots = getattr(type(thing), "__slots__", ())
    names = [slots] if isinstance(slots, str) else slots
    return {name: getattr(thing, name, None) for name in names}


def _standard(kind: type) -> bool:
    return kind.__module__.partition(".")[0] in sys.stdlib_module_names


def _is_value(kind: type) -> bool:
    """Whether objects of a class are known by what they hold, which then never changes."""
    return kind.__hash__ not in (None, object.__hash__)


def _digest(parts: Any) -> str:
    return hashlib.blake2b(repr(parts).encode(), digest_size=16).hexdigest()


def _bytes(array: np.ndarray) -> bytes:
    return repr(array.tolist()).encode() if array.dtype.hasobject else array.tobytes()


def _content(array: np.ndarray) -> Any:
    return array.shape, str(array.dtype), hashlib.blake2b(_bytes(array), digest_size=16).hexdigest()


def _checksum(array: np.ndarray) -> int:
    """A sum that an array keeps unless somebody writes into it."""
    return zlib.crc32(_bytes(array)) if array.flags.writeable else 0
