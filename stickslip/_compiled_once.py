"""A function that comes anew at every call, compiled once for all that mean the same."""

import collections
import itertools
import threading
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.extend
import jax.numpy as jnp
from jaxtyping import PyTree

from ._blas import one_thread
from ._code import code_key
from ._validation import is_concrete
from .hybrid.compile_options import plain_options
from .hybrid.executor import closed_jaxpr
from .progress import ready

MOST_KEPT = 16  # programs, here and of sweeps
_programs: collections.OrderedDict[Any, Any] = collections.OrderedDict()
_known: collections.OrderedDict[Any, Any] = collections.OrderedDict()
_turn = threading.Lock()


def compiled_once(function: Callable[..., PyTree], *operands: PyTree, key: Any = None) -> PyTree:
    """`function(*operands)`, compiled unless a function with the same program was.

    `jax.jit` knows a function by its identity and never looks again at what it closes over. Here it is
    traced at every call, and known by the text of its program; the arrays it closes over are operands.
    A function made anew costs no compiling, and one whose data changed is not mistaken for the old one.

    With a `key` a function of an equal one, whose code is still the same, and operands of the same form
    is taken for the same, and not even traced: for functions whose closures change with the key only.

    Inside `jit`, `vmap` and `grad` it is called plainly.
    """
    if not is_concrete(operands):
        return function(*operands)
    if key is not None:
        leaves, tree = jax.tree.flatten(operands)
        key = (key, code_key(key), tree, tuple((jnp.shape(a), jnp.result_type(a)) for a in leaves))
        with _turn:
            kept = _known.get(key)
        if kept is not None:
            ready()
            program, consts, form, rest = kept
            return eqx.combine(jax.tree.unflatten(form, _run(program, consts, leaves)), rest)
    rest: Any = None

    def arrays(*operands):
        nonlocal rest
        found, rest = eqx.partition(function(*operands), eqx.is_array)
        return found

    jaxpr, consts, form = closed_jaxpr(arrays, operands)
    given = [*consts, *jax.tree.leaves(operands)]
    if not is_concrete(given):
        return function(*operands)
    run = jax.extend.core.jaxpr_as_fun(jax.extend.core.ClosedJaxpr(jaxpr, ()))
    lowered = jax.jit(run).lower(*given)
    text = lowered.as_text()
    with _turn:
        program = _programs.pop(text, None)
    if program is None:
        program = lowered.compile(compiler_options=plain_options())
    ready()
    with _turn:
        _programs[text] = program
        while len(_programs) > MOST_KEPT:
            _programs.popitem(last=False)
        if key is not None:
            _known[key] = program, consts, form, rest
            while len(_known) > MOST_KEPT:
                _known.popitem(last=False)
    return eqx.combine(jax.tree.unflatten(form, _run(program, given)), rest)


def _run(program: Callable, *operands: list) -> Any:
    # The end of a call is that of its meter.
    with one_thread:
        return jax.block_until_ready(program(*itertools.chain(*operands)))
