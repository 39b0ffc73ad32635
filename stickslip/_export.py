"""Finished programs as files, which run without the code that they were made of."""

import datetime
import hashlib
import inspect
import json
import os
import pathlib
import zipfile
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

import equinox as eqx
import jax
import jax.export
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from ._outcome import Outcome
from ._paths import the_file
from ._types import Given
from ._validation import check_callable, check_flag, check_mapping, check_text, check_type, refusal
from ._version import __version__

FORMAT = "stickslip program 1"
HEADER, PROGRAM = "header.json", "program"
# Whatever `zipfile` and `json` raise for a file that is not whole.
DAMAGES = (zipfile.BadZipFile, KeyError, ValueError, NotImplementedError, RuntimeError, EOFError)


def export(
    function: Given[Callable],
    arguments: Given[tuple],
    path: Given[str | os.PathLike[str]],
    *,
    batch: Given[bool] = False,
    derivatives: Given[bool] = False,
    units: Given[Mapping[str, str] | None] = None,
) -> pathlib.Path:
    """Write the program of `function(*arguments)` to a file, which `load` makes callable anywhere.

    The file holds the program (StableHLO, of `jax.export`) and a header with the versions, names,
    shapes, units, the date and a hash. Whoever loads it needs neither the code of `function` nor that
    of the mechanism.

    >>> import stickslip as ss
    >>> from stickslip.systems import CoulombOscillator, Motion
    >>> def run(mu_k, speed):
    ...     block = CoulombOscillator(1.0, 1.0, 1.0, mu_k, speed)
    ...     run = ss.simulate(block, 0.0, 30.0, Motion(x=0.0, v=speed), "stick", throw=False)
    ...     return {"end": run.y1, "result": run.result}
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "oscillator.zip")
    ...     program = load(export(run, (0.5, 0.2), path, units={"end.x": "m"}))
    >>> found = program(0.5, 0.2)
    >>> print(f"{found['end']['x']:.6f}", program.words["result"][found["result"]])
    0.658437 successful

    **Arguments**

    - `function`: of trees of arrays and numbers, in pure JAX. A failure has to be a part of its result:
      `simulate` with `throw=False`, whose `result` is a number in the file, with its `words` beside it.
    - `arguments`: a tuple of examples. Shapes and types of their numbers are those of the file, all
      else in them is constant.
    - `path`: of the file; one that exists is replaced when the new one is whole.
    - `batch`: the program maps over a leading axis of any length, which all numbers have.
    - `derivatives`: the program can be differentiated, in reverse mode (`jax.grad`, `jax.vjp`).
    - `units`: of arguments and results, by name, as `"end.x"`.

    **Returns** the path.

    **Errors** `ValueError`/`TypeError` naming the argument, for a function that calls the host too;
    `OSError` of the file system.
    """
    allowed = "a tuple with an example for each argument, of one at least"
    check_type("arguments", arguments, tuple, allowed)
    if not arguments:
        raise refusal("arguments", arguments, allowed)
    check_callable("function", function, "f(*arguments)", *arguments)
    path = the_file("path", path)
    check_flag("batch", batch)
    check_flag("derivatives", derivatives)
    units = check_mapping("units", units)
    for name, unit in units.items():
        check_text(f"units[{name!r}]", unit)
    names = _names_of(function, len(arguments))
    given, rest = eqx.partition(arguments, eqx.is_array_like)
    form = jax.tree.structure(given)
    inputs = {name: jnp.asarray(leaf) for name, leaf in _by_name(names, given)}
    if len(inputs) < form.num_leaves:
        raise refusal("arguments", arguments, "a tuple whose numbers have names of their own")
    outputs: dict[str, dict[str, Any]] = {}

    def flat(*leaves: Any) -> list[Any]:
        found: list[Any] = []
        outputs_of: dict[str, dict[str, Any]] = {}
        made = function(*eqx.combine(jax.tree.unflatten(form, leaves), rest))
        for place, leaf in jax.tree.leaves_with_path(made, is_leaf=_is_code):
            name, about = _path_text(place), {"place": _keys(place)}
            if _is_code(leaf):
                about["words"] = list(leaf._enumeration._name_to_item)
                leaf = leaf._value
            if eqx.is_array_like(leaf):
                if name in outputs_of:
                    raise refusal("function", function, f"one with one result named {name!r}")
                outputs_of[name] = about
                found.append(jnp.asarray(leaf))
        outputs.update(outputs_of)
        return found

    (size,) = jax.export.symbolic_shape("n")
    before = (size,) if batch else ()
    shapes = [jax.ShapeDtypeStruct(before + a.shape, a.dtype) for a in inputs.values()]
    try:
        made = jax.export.export(jax.jit(jax.vmap(flat) if batch else flat))(*shapes)
        program = bytes(made.serialize(vjp_order=int(derivatives)))
    except NotImplementedError as error:
        pure = "a function that does not call the host, as `simulate` does unless `throw=False`"
        raise refusal("function", function, pure) from error
    if not outputs:
        raise refusal("function", function, "one whose result has numbers")
    about = {name: {"shape": a.shape, "dtype": a.dtype.name} for name, a in inputs.items()}
    for name, unit in units.items():
        if name not in {**about, **outputs}:
            allowed = f"the name of an argument or result: {', '.join([*about, *outputs])}"
            raise refusal("units", name, allowed)
        ({**about, **outputs}[name])["unit"] = unit
    header = {
        "format": FORMAT,
        "stickslip": __version__,
        "jax": jax.__version__,
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "platforms": list(made.platforms),
        "function": getattr(function, "__qualname__", type(function).__name__),
        "arguments": names,
        "batch": batch,
        "derivatives": derivatives,
        "inputs": about,
        "outputs": outputs,
        "sha256": hashlib.sha256(program).hexdigest(),
    }
    return _write(path, header, program)


class load:
    """A program that `export` has written to a file, as a function of the same arguments.

    Named tuples and modules among the arguments may be given as they were or as dicts of their fields;
    results are dicts, lists and arrays. The first call compiles. It works under `jit` and `vmap`, and
    under `grad` where it was exported with `derivatives`.

    - `header`: versions, date, platforms, names, shapes and units, as the file has them;
    - `words`: of each result that is a code, by its name, the meaning of its numbers.

    **Errors** `ValueError` for a file that is not one of `export`, is damaged, or was made by another
    version of JAX or for another kind of device; `OSError` of the file system. A call raises
    `TypeError`/`ValueError` naming the argument whose names, shape or type are not those of the file.
    """

    def __init__(self, path: Given[str | os.PathLike[str]]):
        self.header, program = _read(the_file("path", path))
        outputs = self.header["outputs"]
        self.words = {
            name: tuple(about["words"]) for name, about in outputs.items() if "words" in about
        }
        self._run = jax.jit(jax.export.deserialize(bytearray(program)).call)
        self._inputs = {
            name: (tuple(about["shape"]), np.dtype(about["dtype"]))
            for name, about in self.header["inputs"].items()
        }

    def __repr__(self) -> str:
        given, found = (_names_with_units(self.header[part]) for part in ("inputs", "outputs"))
        made = f"stickslip {self.header['stickslip']}, JAX {self.header['jax']}, {self.header['date']}"
        return f"{self.header['function']}({given}) -> {found} ({made})"

    def __call__(self, *arguments: PyTree) -> PyTree:
        names = self.header["arguments"]
        if len(arguments) != len(names):
            raise TypeError(f"{self!r} takes {len(names)} arguments, not {len(arguments)}.")
        leaves = dict(_by_name(names, eqx.filter(arguments, eqx.is_array_like)))
        if leaves.keys() != self._inputs.keys():
            allowed = f"those of the file: {', '.join(self._inputs)}"
            raise refusal("names of the arguments", ", ".join(leaves), allowed, TypeError)
        numbers = [self._number(name, leaves[name]) for name in self._inputs]
        if self.header["batch"] and len({a.shape[0] for a in numbers}) > 1:
            lengths = {name: a.shape[0] for name, a in zip(self._inputs, numbers, strict=True)}
            raise refusal("arguments", lengths, "batches of one length")
        places = (about["place"] for about in self.header["outputs"].values())
        return _tree_of(list(zip(places, self._run(*numbers), strict=True)))

    def _number(self, name: str, leaf: Any) -> Any:
        shape, dtype = self._inputs[name]
        array = leaf if isinstance(leaf, jax.Array) else np.asarray(leaf)
        # An `int` has no size of its own: it is one of the smallest type that holds it.
        given = np.min_scalar_type(leaf) if type(leaf) is int else array.dtype
        if not np.can_cast(given, dtype, "safe"):
            raise refusal(name, leaf, f"of type {dtype}", TypeError)
        batch = self.header["batch"]
        if array.ndim != len(shape) + batch or array.shape[batch:] != shape:
            axes = ", ".join(map(str, ("n", *shape) if batch else shape))
            raise refusal(name, leaf, f"of shape ({axes})", but=f"of shape {array.shape}")
        return array.astype(dtype)


def _names_with_units(parts: dict[str, dict[str, Any]]) -> str:
    return ", ".join(
        f"{name} [{about['unit']}]" if "unit" in about else name for name, about in parts.items()
    )


def _names_of(function: Callable, count: int) -> list[str]:
    """Names of the arguments, their numbers where there are none."""
    try:
        named = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        named = ()
    names = [p.name for p in named if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    return [*names, *map(str, range(len(names), count))][:count]


def _by_name(names: list[str], arguments: tuple) -> list[tuple[str, Any]]:
    """Names and leaves of the arguments."""
    return [
        (".".join(filter(None, (name, _path_text(place)))), leaf)
        for name, argument in zip(names, arguments, strict=True)
        for place, leaf in jax.tree.leaves_with_path(argument)
    ]


def _path_text(place: tuple) -> str:
    return jax.tree_util.keystr(place, simple=True, separator=".")


def _is_code(leaf: Any) -> bool:
    return isinstance(leaf, Outcome)


def _keys(place: tuple) -> list[str | int]:
    """The way to a result: numbers in tuples and lists, names elsewhere."""
    return [
        key.idx if isinstance(key, jax.tree_util.SequenceKey) else _path_text((key,)) for key in place
    ]


def _tree_of(placed: list[tuple[list, Any]]) -> Any:
    """Dicts and lists by the ways to their numbers."""
    if not placed[0][0]:
        return placed[0][1]
    parts: dict[Any, list] = {}
    for (first, *rest), value in placed:
        parts.setdefault(first, []).append((rest, value))
    found = {first: _tree_of(inner) for first, inner in parts.items()}
    if isinstance(next(iter(found)), int):
        return [found.get(i) for i in range(1 + max(found))]
    return found


def _write(path: pathlib.Path, header: dict[str, Any], program: bytes) -> pathlib.Path:
    part = path.with_name(path.name + ".part")
    try:
        with zipfile.ZipFile(part, "w") as file:
            file.writestr(HEADER, json.dumps(header, indent=1))
            file.writestr(PROGRAM, program)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
    return path


def _read(path: pathlib.Path) -> tuple[dict[str, Any], bytes]:
    def refuse(why: str) -> NoReturn:
        raise ValueError(f"{path} {why}.")

    if not path.is_file():
        raise refusal("path", str(path), "a file of stickslip.export")
    try:
        with zipfile.ZipFile(path) as file:
            header = json.loads(file.read(HEADER))
            program = file.read(PROGRAM)
    except DAMAGES as error:
        but = f"which is damaged or another file ({error})"
        raise refusal("path", str(path), "a file of stickslip.export", but=but) from error
    if header.get("format") != FORMAT:
        refuse(f"has the format {header.get('format')!r}; this version reads {FORMAT!r}")
    if hashlib.sha256(program).hexdigest() != header["sha256"]:
        refuse("is damaged: its program is not the one that its header tells of")
    if header["jax"] != jax.__version__:
        refuse(f"was made with JAX {header['jax']}, and this is JAX {jax.__version__}: export it again")
    if jax.default_backend() not in header["platforms"]:
        refuse(f"was made for {', '.join(header['platforms'])}, not for {jax.default_backend()}")
    return header, program
