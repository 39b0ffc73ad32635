"""Where a function bends or jumps in the state, read off its program while tracing.

A comparison of numbers that depend on the state, in `max`, `abs`, `clip`, `where` or a table, changes
its outcome where the difference of the two is zero. Evaluated with outcomes that are given, the
function is smooth through that border, as the field of a mode is.
"""

import pathlib
import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient

from .._fastmath import SMOOTH
from .._jaxpr import bound, called_program, equations, walk
from ._steep import gently, steep_operand
from .accuracy import ACCURACY

_OWN = re.compile(f"/jax/_src/|^{re.escape(pathlib.Path(__file__).parents[1].as_posix())}/")
_CALLS = ("jit", "pjit", "closed_call", "core_call", "remat", "remat2", "checkpoint")
_ROOTS = {"sqrt", "pow", "asin", "acos", "acosh"}  # at the ends of where they have a value
_ROUNDED = {"floor", "ceil", "round", "rem"}
_SORTED = {"sort", "argmax", "argmin", "cummax", "cummin", "reduce_window_max", "reduce_window_min"}
# Said as "the first is above the second": whether the two change places, whether it is denied.
_COMPARED = {"gt": (False, False), "ge": (True, True), "lt": (True, False), "le": (False, True)}


class Change(NamedTuple):
    """Change of the code where a margin falls through zero."""

    adds: int | None  # None: the bit at `place` is turned over
    place: int


class Outcomes:
    """Outcomes of the comparisons of one evaluation, in their order, and the margins that they have.

    `code`: the outcomes given, as the bits of an integer; None: each is what its numbers say.
    """

    def __init__(self, code: Any = None, width: int = 0):
        self.code = code
        self.width = width  # bits so far
        self.found: Any = 0  # code of what the numbers say
        self.margins: list[Any] = []  # scalars, positive as long as an outcome stays what it is
        self.changes: list[Change] = []
        self.left = False  # whether there are more than there is room for, or some in a long loop
        self.declared = False  # whether the system declares switches
        self.jumps = False  # whether something is rounded, which jumps
        self.steep = False  # whether something has no slope where an outcome puts it, as a root at 0
        self.roots = False  # whether something is a root or a power, whose slopes may have none at 0
        self.extremes: dict[int, tuple] = {}  # results of `max` and the like, and what they came from
        self.asked: dict[tuple, tuple] = {}  # outcomes by the numbers compared, which they keep alive
        # Results of equations, and the operands that they keep alive.
        self.done: dict[tuple, tuple] = {}

    def above(self, a: Any, b: Any) -> Any:
        """Whether `a > b`, elementwise; asked twice it is one outcome, lest two of them contradict."""
        key = (_number(a), _number(b))
        if key not in self.asked:
            first, second = jnp.broadcast_arrays(a, b)
            self.asked[key] = self._outcome_of(first - second, first > second), a, b
        return self.asked[key][0]

    def _outcome_of(self, value: Any, plain: Any) -> Any:
        if self.width + value.size > ACCURACY.outcome_bits:
            self.left = True
            return plain
        rows = zip(jnp.ravel(value), jnp.ravel(plain), strict=True) if value.ndim else [(value, plain)]
        given = [self._bit(*row) for row in rows]
        return jnp.stack(given).reshape(value.shape) if value.ndim else given[0]

    def declares(self, value: Any) -> Any:
        """Whether a value that the system declares is positive."""
        self.declared = True
        return self._outcome_of(value, value > 0)

    def _bit(self, value: Any, plain: Any) -> Any:
        place, self.width = self.width, self.width + 1
        self.found = self.found + jnp.where(plain, 1 << place, 0)
        given = plain if self.code is None else ((self.code >> place) & 1) == 1
        margin = jnp.where(given, value, -value)
        # A comparison of NaN has no effect. An equal value that is said to be above has no value
        # as a margin, but its rate: unless that parts the two, the outcome is stale.
        margin = jnp.where(jnp.isnan(stop_gradient(margin)), 1.0, margin)
        equal = given & (stop_gradient(value) == 0.0)
        self.margins.append(margin + jnp.where(equal, jnp.nan, 0.0))
        self.changes.append(Change(None, place))
        return given

    def cell(self, nodes: Any, value: Any, plain: Any) -> Any:
        """Number of the cell between increasing `nodes` that a scalar `value` is in."""
        count = nodes.shape[0]
        bits = count.bit_length()
        if value.ndim or self.width + bits > ACCURACY.outcome_bits:
            self.left = True
            return plain
        place, self.width = self.width, self.width + bits
        self.found = self.found + (plain.astype(jnp.int64) << place)
        number = plain
        if self.code is not None:
            number = ((self.code >> place) & ((1 << bits) - 1)).astype(plain.dtype)
        # Sums, because the slope of an index is one that no fused loop takes.
        places = jnp.arange(count, dtype=plain.dtype)
        below = jnp.sum(jnp.where(places == number - 1, nodes, 0.0))
        above = jnp.sum(jnp.where(places == number, nodes, 0.0))
        self.margins.append(jnp.where(number > 0, value - below, 1.0))
        self.changes.append(Change(-1, place))
        self.margins.append(jnp.where(number < count, above - value, 1.0))
        self.changes.append(Change(1, place))
        return number


class _Known(NamedTuple):
    """A value; whether it depends on the state; what it is by the numbers, if an outcome is given."""

    value: Any
    varies: bool = False
    plain: Any = None
    rough: bool = False  # whether it comes from something that is rounded
    chosen: bool = False  # whether it comes from something that an outcome chose

    @property
    def by_numbers(self) -> Any:
        return self.value if self.plain is None else self.plain


def _number(value: Any) -> Any:
    """Key of a value: a number by its value, anything else by its identity."""
    if isinstance(value, jax.core.Tracer) or np.ndim(value):
        return id(value)
    return repr(np.asarray(value).item())  # which tells -0.0 from 0.0, and 1 from 1.0


def evaluate_with(closed: Any, operands: Sequence, varies: Sequence[bool], outcomes: Outcomes) -> list:
    """Results of a traced function of `operands`, some of which vary, with the outcomes given."""
    given = [_Known(value, v) for value, v in zip(operands, varies, strict=True)]
    found = _run(closed.jaxpr, closed.consts, given, outcomes, smooth=False)
    return [known.value for known in found]


def _run(jaxpr: Any, consts: Sequence, given: list[_Known], outcomes: Outcomes, smooth: bool) -> list:
    def rule(eqn: Any, operands: list[_Known]) -> list[_Known]:
        within = smooth or SMOOTH in str(eqn.source_info.name_stack)
        return _once(eqn, operands, outcomes, within)

    return walk(jaxpr, given, rule, lambda _, number: _Known(number), consts)


def _once(eqn: Any, given: list[_Known], outcomes: Outcomes, smooth: bool) -> list[_Known]:
    """Results of an equation; of what was computed before, the same ones."""
    try:
        key = (
            eqn.primitive,
            tuple(sorted(eqn.params.items())),
            smooth,
            *(_number(k.value) for k in given),
        )
        before = outcomes.done.get(key)
    except TypeError:  # a parameter that has no hash, as a program in it
        return _equation(eqn, given, outcomes, smooth)
    if before is None:
        outcomes.done[key] = before = _equation(eqn, given, outcomes, smooth), given
    return before[0]


def _equation(eqn: Any, given: list[_Known], outcomes: Outcomes, smooth: bool) -> list[_Known]:
    name = eqn.primitive.name
    varies = any(k.varies for k in given)
    if not varies:
        return [_Known(value) for value in bound(eqn, [k.value for k in given])]
    inner = called_program(eqn) if name in _CALLS else None
    if not smooth and (own := _own_rule(eqn)) is not None:
        return _evaluate_by_rule(eqn, own, given, outcomes)
    if (
        name in _CALLS
        and eqn.params.get("name") == "searchsorted"
        and not given[0].varies
        and not smooth
    ):
        (plain,) = bound(eqn, [k.by_numbers for k in given])
        return [_Known(outcomes.cell(given[0].value, given[1].value, plain), True)]
    if inner is not None:
        return _run(*inner, given, outcomes, smooth)
    if name == "cond":
        return _branches(eqn, given, outcomes, smooth)
    if name == "scan" and eqn.params["length"] <= ACCURACY.longest_scan:
        return _rounds(eqn, given, outcomes, smooth)
    real = jnp.issubdtype(eqn.invars[-1].aval.dtype, jnp.floating)
    whole = not jnp.issubdtype(eqn.outvars[0].aval.dtype, jnp.inexact)
    rounded = real and (name in _ROUNDED or (name == "convert_element_type" and whole))
    if any(k.rough for k in given) or (rounded and not smooth):
        # Next to a jump that is not located nothing else can be.
        outcomes.jumps = True
        found = bound(eqn, [k.by_numbers for k in given])
        return [_Known(value, True, None, True) for value in found]
    rule = _RULES.get(name)
    if real and rule is not None and not smooth:
        return [_Known(rule(eqn, given, outcomes), True, chosen=True)]
    if real and name in (*_COMPARED, "eq", "ne") and not smooth:
        return [_comparison(eqn, given, outcomes)]
    if not smooth:
        body = eqn.params.get({"scan": "jaxpr", "while": "body_jaxpr"}.get(name, ""))
        outcomes.left |= (name in _SORTED and real) or (body is not None and compares(body.jaxpr))
    outcomes.roots |= name in _ROOTS
    chosen, place = any(k.chosen for k in given), steep_operand(eqn)
    found = bound(eqn, [k.value for k in given])
    if place is not None and given[place].chosen:
        outcomes.steep = True
        found = gently(eqn, [k.value for k in given], place)
    if all(k.plain is None for k in given):
        return [_Known(value, True, chosen=chosen) for value in found]
    plain = bound(eqn, [k.by_numbers for k in given])
    if not jnp.issubdtype(eqn.outvars[0].aval.dtype, jnp.floating):
        return [_Known(*row) for row in zip(found, (True,) * len(found), plain, strict=True)]
    if name == "select_n":
        # Beyond its border a branch may have no value, as the root of a negative number.
        found = [jnp.where(jnp.isfinite(a), a, b) for a, b in zip(found, plain, strict=True)]
    return [_Known(value, True, chosen=True) for value in found]


def _comparison(eqn: Any, given: list[_Known], outcomes: Outcomes) -> _Known:
    name, (a, b) = eqn.primitive.name, (k.value for k in given)
    (plain,) = bound(eqn, [a, b])
    if name in _COMPARED:
        swap, negate = _COMPARED[name]
        outcome = outcomes.above(b, a) if swap else outcomes.above(a, b)
        return _Known(~outcome if negate else outcome, True, plain)
    # Derivatives of `max` ask which of the two it was.
    for result, operand in ((b, a), (a, b)):
        first, second, outcome, _ = outcomes.extremes.get(id(result), (None, None, None, None))
        if outcome is not None and (operand is first or operand is second):
            same = outcome if operand is first else ~outcome
            return _Known(same if name == "eq" else ~same, True, plain)
    return _Known(plain, True)


def _extreme(pick: Callable, a: Any, b: Any, outcomes: Outcomes) -> Any:
    """The greater or lesser of two, by `jax.lax.max` or `min`, with the slope of the outcome named."""
    plain = pick(*jnp.broadcast_arrays(a, b))
    outcome = ~(outcomes.above(b, a) if pick is jax.lax.max else outcomes.above(a, b))
    one = jnp.where(outcome, a, b)
    # At a border the value is that of both. Beyond, one that may be no operand there is not used.
    found = one + stop_gradient(plain - one)
    outcomes.extremes[id(found)] = (a, b, outcome, found)
    return found


def _clamp(eqn: Any, given: list[_Known], outcomes: Outcomes) -> Any:
    low, x, high = (k.value for k in given)
    return _extreme(jax.lax.min, high, _extreme(jax.lax.max, low, x, outcomes), outcomes)


def _magnitude(eqn: Any, given: list[_Known], outcomes: Outcomes) -> Any:
    x = given[0].value
    one = jnp.where(outcomes.above(0.0, x), -x, x)
    return one + stop_gradient(jnp.abs(x) - one)


def _sign(eqn: Any, given: list[_Known], outcomes: Outcomes) -> Any:
    # In two parts: what rests at zero has the sign 0.
    x = given[0].value
    up, down = outcomes.above(x, 0.0), outcomes.above(0.0, x)
    return up.astype(x.dtype) - down.astype(x.dtype)


def _cube_root(eqn: Any, given: list[_Known], outcomes: Outcomes) -> Any:
    outcomes.above(given[0].value, 0.0)
    outcomes.roots = outcomes.steep = True
    return gently(eqn, [given[0].value], 0)[0]


def _angle(eqn: Any, given: list[_Known], outcomes: Outcomes) -> Any:
    """`atan2`, which jumps by a turn where `y` is zero behind the origin; beyond, it goes on."""
    y, x = (k.value for k in given)
    half = jnp.where(outcomes.above(y, 0.0), jnp.pi, -jnp.pi)
    behind = x < 0.0
    # Taken the other way round no cut is near.
    way = jnp.where(behind, -1.0, 1.0)
    return jnp.arctan2(way * y, way * x) + jnp.where(behind, half, 0.0)


def _largest(eqn: Any, given: list[_Known], outcomes: Outcomes) -> Any:
    pick = jax.lax.max if eqn.primitive.name == "reduce_max" else jax.lax.min
    axes = eqn.params["axes"]
    rows = jnp.moveaxis(given[0].value, axes, range(len(axes)))
    rows = rows.reshape((-1, *rows.shape[len(axes) :]))
    found = rows[0]
    for i in range(1, rows.shape[0]):
        found = _extreme(pick, found, rows[i], outcomes)
    return found


def _of_two(eqn: Any, given: list[_Known], outcomes: Outcomes) -> Any:
    pick = jax.lax.max if eqn.primitive.name == "max" else jax.lax.min
    return _extreme(pick, given[0].value, given[1].value, outcomes)


_RULES: dict[str, Any] = {
    "max": _of_two, "min": _of_two, "clamp": _clamp, "abs": _magnitude, "sign": _sign,
    "reduce_max": _largest, "reduce_min": _largest, "cbrt": _cube_root, "atan2": _angle,
}  # fmt: skip


def _own_rule(eqn: Any) -> Any:
    """Program of a function with a derivative of its own that may bend; None for any other equation.

    Those of JAX and of this package compare numbers to choose between forms of what is smooth, as
    `logaddexp` does, all but two.
    """
    if not eqn.primitive.name.startswith(("custom_jvp_call", "custom_vjp_call")):
        return None
    inner = eqn.params["call_jaxpr"]
    name, _, place = str(getattr(inner.jaxpr.debug_info, "func_src_info", "")).partition(" at ")
    smooth = _OWN.search(place.replace("\\", "/")) and name not in ("relu", "relu6")
    return None if smooth or not compares(inner.jaxpr) else inner


def _evaluate_by_rule(eqn: Any, inner: Any, given: list[_Known], outcomes: Outcomes) -> list[_Known]:
    """A function with a derivative of its own: by that, while outcomes are what its numbers say."""
    start, before, first = outcomes.width, outcomes.found, len(outcomes.margins)
    found = _run(inner.jaxpr, inner.consts, given, outcomes, smooth=False)
    by_rule = bound(eqn, [k.value for k in given])
    if outcomes.code is None:
        return [_Known(value, True, k.plain, k.rough) for value, k in zip(by_rule, found, strict=True)]
    bits = (1 << outcomes.width) - (1 << start)
    same = ((outcomes.code ^ (outcomes.found - before)) & bits) == 0
    for margin in outcomes.margins[first:]:
        same = same & (margin != 0.0)  # at the border a rule knows one side only
    return [
        k._replace(value=jnp.where(same, value, k.value))
        for value, k in zip(by_rule, found, strict=True)
    ]


def compares(jaxpr: Any) -> bool:
    """Whether a program compares numbers, or picks one of them, wherever they come from."""
    return any(
        eqn.primitive.name in (*_RULES, *_COMPARED, *_SORTED)
        and any(jnp.issubdtype(a.aval.dtype, jnp.floating) for a in eqn.invars)
        for eqn in equations(jaxpr, _has_no_rule_of_jax)
    )


def _has_no_rule_of_jax(eqn: Any) -> bool:
    """Whether a call has no derivative that JAX itself has written for it."""
    name = eqn.primitive.name
    return not name.startswith(("custom_jvp_call", "custom_vjp_call")) or _own_rule(eqn) is not None


def _branches(eqn: Any, given: list[_Known], outcomes: Outcomes, smooth: bool) -> list[_Known]:
    """Branches of a choice; the outcomes in those not taken stay what they are."""
    branches, index, operands = eqn.params["branches"], given[0].value, given[1:]

    def look(branch: Any, own: Outcomes, values: Sequence) -> list:
        known = [k._replace(value=v, plain=None) for k, v in zip(operands, values, strict=True)]
        return [k.value for k in _run(branch.jaxpr, branch.consts, known, own, smooth)]

    # Traced once to know how many outcomes each has, and again where it belongs.
    forms, starts = [], [outcomes.width]
    for branch in branches:
        own = Outcomes(outcomes.code, starts[-1])
        jax.eval_shape(lambda *v, b=branch, own=own: look(b, own, v), *(k.value for k in operands))
        forms.append(own)
        starts.append(own.width)

    def part(number: int) -> Any:
        def run(*values):
            own = Outcomes(outcomes.code, starts[number])
            found = look(branches[number], own, values)
            margins = [jnp.ones(()) for form in forms for _ in form.margins]
            first = sum(len(form.margins) for form in forms[:number])
            margins[first : first + len(own.margins)] = own.margins
            return found, margins, jnp.asarray(own.found, jnp.int64)

        return run

    parts, values = [part(number) for number in range(len(branches))], [k.value for k in operands]
    found, margins, code = jax.lax.switch(index, parts, *values)
    outcomes.width = starts[-1]
    outcomes.left |= any(form.left for form in forms)
    outcomes.jumps |= any(form.jumps for form in forms)
    outcomes.roots |= any(form.roots for form in forms)
    outcomes.found = outcomes.found + code
    outcomes.margins += margins
    outcomes.changes += [change for form in forms for change in form.changes]
    varies = given[0].varies or any(k.varies for k in operands)
    return [_Known(value, varies, chosen=varies) for value in found]


def _same_axes(outside: Any, inside: Any) -> int:
    """How many operands of a loop, or results, are those of one round; rows have an axis more."""
    pairs = zip(outside, inside, strict=True)
    return sum(a.aval.ndim == b.aval.ndim for a, b in pairs)


def _rounds(eqn: Any, given: list[_Known], outcomes: Outcomes, smooth: bool) -> list[_Known]:
    """A loop of few rounds, written out."""
    params = eqn.params
    body = params["jaxpr"]
    # Constants, what is carried, rows: told apart by their axes, because versions of JAX count them in
    # parameters of different names.
    lasting = _same_axes(eqn.invars, body.jaxpr.invars)
    carried = _same_axes(eqn.outvars, body.jaxpr.outvars)
    consts, carry = given[: lasting - carried], given[lasting - carried : lasting]
    rows = given[lasting:]
    stacked: list[list] = []
    order = range(params["length"])
    for i in reversed(order) if params["reverse"] else order:
        row = [_Known(k.value[i], k.varies) for k in rows]
        out = _run(body.jaxpr, body.consts, [*consts, *carry, *row], outcomes, smooth)
        carry = out[:carried]
        stacked.append([k.value for k in out[carried:]])
    if params["reverse"]:
        stacked.reverse()
    columns = [jnp.stack(column) for column in zip(*stacked, strict=True)] if stacked else []
    return [*carry, *(_Known(column, True, chosen=True) for column in columns)]
