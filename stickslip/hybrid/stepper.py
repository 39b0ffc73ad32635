"""One Runge-Kutta step: our fused explicit stages, or any solver of diffrax."""

import abc
import dataclasses
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import PyTree

from .._types import Numeric
from . import _rolled, _tableau
from ._alone import alone_or_batched
from ._pieces import in_pieces
from ._within import weights_within
from .accuracy import ACCURACY
from .executor import Executor, piece
from .tree import combine, cubics, weighted_sum

VectorField = Callable[[Any, PyTree], PyTree]
Points = tuple[float, ...]  # fractions of a step


class Looked(NamedTuple):
    """A step, and what was seen in it."""

    y1: PyTree
    dy1: PyTree
    errors: tuple[PyTree, ...]
    states: tuple[PyTree, ...]  # at the points asked for
    # The slope at the end less that of the last stage, which is at the same time and nearly the same
    # state, times `h`; None where the method has no such stage, or its error estimates see this slope.
    surprise: PyTree | None = None


class AbstractStepper(eqx.Module):
    """A one-step method, for `Integrator(method=...)`.

    An explicit Runge-Kutta method needs no class of its own: `Integrator` takes its `Tableau`. Any
    other method states `step`, `order` and `has_error_estimate`.
    """

    @abc.abstractmethod
    def step(
        self, field: VectorField, t: Numeric, y: PyTree, dy: PyTree, h: Numeric, execute: Executor
    ) -> tuple[PyTree, PyTree, tuple[PyTree, ...]]:
        """The step of length `h` from `(t, y)`, whose slope `dy = field(t, y)` is known.

        Returns `(y1, dy1, errors)`: the state at the end, its slope `field(t + h, y1)`, and error
        estimates of the form of `y` (none, one, or two as in `Tableau`). `h` is zero in the first
        attempt after an event, where `y1 = y` and only the slope counts. The function is pure and is
        differentiated by JAX, by `h` where a field has roots. A step that fails returns NaN, and is
        tried again shorter.
        `execute` says how the program is compiled; a method may ignore it.
        """

    def step_and_look(
        self, field: VectorField, t: Numeric, y: PyTree, dy: PyTree, h: Numeric, execute: Executor,
        points: Points, wanted: tuple[bool, ...], surprises: bool,
    ) -> "Looked":  # fmt: skip
        r"""`step`, and the states at $t + \theta h$ for the `points` $\theta$ inside it.

        There the event functions are looked at. `wanted` says which leaves of the state they depend
        on; of the others anything will do. The default is the cubic through the state and its slope at
        both ends, which knows of no excursion that the ends do not show; a method of an order above 3,
        whose steps are long, should know better. `surprises`: whether `Looked.surprise` is asked for.
        """
        y1, dy1, errors = self.step(field, t, y, dy, h, execute)
        return Looked(y1, dy1, errors, tuple(cubics(points, y, dy, y1, dy1, h)))

    def vjp(
        self, field: Callable, parameters: PyTree, t: Numeric, y: PyTree, dy: PyTree, h: Numeric,
        end: Callable, execute: Executor,
    ) -> tuple[PyTree, tuple[PyTree, Any, PyTree, PyTree]]:  # fmt: skip
        """Cotangents of `(parameters, t, y, dy)` of one step with the field `field(parameters, t, y)`.

        `end(y1, dy1)` gives the cotangents of `(y1, dy1)` and anything else, which is handed through
        as the first result. The default is the transpose of `step` by `jax.vjp`.
        """

        def run(parameters, t, y, dy):
            y1, dy1, _ = self.step(lambda t, y: field(parameters, t, y), t, y, dy, h, execute)
            return y1, dy1

        out, pull = jax.vjp(run, parameters, t, y, dy)
        cotangents, extra = end(*out)
        return extra, pull(cotangents)

    @property
    def solves(self) -> bool:
        """Whether a step solves equations, to the tolerance that `solved_to` gives."""
        return False

    def solved_to(self, unit: list) -> "AbstractStepper":
        """The method for one step, in which an error of `unit` in each leaf of the state is 1."""
        return self

    @abc.abstractmethod
    def order(self) -> int:
        """Order of convergence."""

    @abc.abstractmethod
    def has_error_estimate(self) -> bool:
        """Whether adaptive steps are possible."""


# A stage is a sum that all later ones read: without the marks a fused program would form it anew in
# each of them, and a step of s stages would cost s^2 sums.


@piece
def _move_state(execute, y, slopes, h, *, weights):
    return combine(y, slopes, weights, h)


@piece
def _sum_slopes(execute, slopes, h, *, weights):
    return weighted_sum(slopes, weights, h)


def _leaves(tree: PyTree, wanted: tuple[bool, ...]) -> list:
    return [leaf for leaf, w in zip(jax.tree.leaves(tree), wanted, strict=True) if w]


class ExplicitRungeKutta(AbstractStepper):
    """Explicit Runge-Kutta method given by a tableau.

    Its stages are a loop where one lane runs. In batches and in fused programs they are written out,
    and kept apart for the compiler.
    """

    tableau: _tableau.Tableau = eqx.field(static=True)

    def order(self) -> int:
        return self.tableau.order

    def has_error_estimate(self) -> bool:
        return bool(self.tableau.error_weights)

    def step(self, field, t, y, dy, h, execute):
        return self.step_and_look(field, t, y, dy, h, execute, (), (), False)[:3]

    def step_and_look(self, field, t, y, dy, h, execute, points, wanted, surprises):
        surprises = surprises and self.tableau.ends_twice
        rows = weights_within(self.tableau, points) if points else ()
        if execute.fused:
            found = self._step_written_out(field, t, y, dy, h, execute, rows, wanted, surprises)
        elif execute.compact:
            found = Looked(*_rolled.step(self.tableau, field, t, y, dy, h, rows, surprises))
        else:
            found = alone_or_batched(
                lambda f, t, y, dy, h: Looked(
                    *_rolled.step(self.tableau, f, t, y, dy, h, rows, surprises)
                ),
                lambda f, t, y, dy, h: self._step_written_out(
                    f, t, y, dy, h, execute, rows, wanted, surprises
                ),
                [(field, (t, y))], t, y, dy, h,
            )  # fmt: skip
        return found._replace(
            states=found.states or tuple(cubics(points, y, dy, found.y1, found.dy1, h))
        )

    def _step_written_out(self, field, t, y, dy, h, execute, inside, wanted, surprises):
        # Traced once and called in every stage, however large the field is.
        tab, field = self.tableau, execute.trace_once(field)
        slopes = [dy]
        for i in range(1, tab.stages):
            stage = _move_state(execute, y, slopes, h, weights=tab.a[i])
            slopes.append(field(t + tab.c[i] * h, stage))
        y1 = _move_state(execute, y, slopes, h, weights=tab.b)
        dy1 = field(t + h, y1)
        errors = tuple(weighted_sum([*slopes, dy1], row, h) for row in tab.error_weights)
        states = ()
        if inside:
            form = jax.tree.structure(y)
            parts = [_leaves(k, wanted) for k in (y, *slopes, dy1)]
            for row in inside:
                seen = iter(_move_state(execute, parts[0], parts[1:], h, weights=row))
                leaves = [
                    next(seen) if w else a for w, a in zip(wanted, jax.tree.leaves(y1), strict=True)
                ]
                states += (jax.tree.unflatten(form, leaves),)
        surprise = weighted_sum([slopes[-1], dy1], (-1.0, 1.0), h) if surprises else None
        return Looked(y1, dy1, errors, states, surprise)

    def vjp(self, field, parameters, t, y, dy, h, end, execute):
        if execute.fused:
            return self._vjp_written_out(field, end, parameters, t, y, dy, h, execute)
        return alone_or_batched(
            lambda *a: _rolled.vjp(self.tableau, *a),
            lambda f, end, p, t, y, dy, h: self._vjp_written_out(f, end, p, t, y, dy, h, execute),
            [(field, (parameters, t, y)), (end, (y, dy))], parameters, t, y, dy, h,
        )  # fmt: skip

    def _vjp_written_out(self, field, end, parameters, t, y, dy, h, execute):
        # Reverse sweep through the stages with each stage state recomputed once: the transpose of
        # `step` written out, because differentiating the fused stages would recompute all of them
        # for every one of them.
        tab, slope = self.tableau, execute.trace_once(field)
        stages, slopes = [y], [dy]
        for i in range(1, tab.stages):
            stages.append(_move_state(execute, y, slopes, h, weights=tab.a[i]))
            slopes.append(slope(parameters, t + tab.c[i] * h, stages[i]))
        y1 = _move_state(execute, y, slopes, h, weights=tab.b)
        dy1 = slope(parameters, t + h, y1)

        def pull_back(parameters, t, y, bar):
            return jax.vjp(field, parameters, t, y)[1](bar)

        pull = in_pieces(execute, pull_back)

        (y1_bar, dy1_bar), extra = end(y1, dy1)
        parameters_bar, t_bar, pull_back = pull(parameters, t + h, y1, dy1_bar)
        y1_bar = jax.tree.map(jnp.add, y1_bar, pull_back)
        stage_bars: list = [None] * tab.stages
        for i in reversed(range(tab.stages)):
            later = [stage_bars[j] for j in range(i + 1, tab.stages)]
            weights = [tab.b[i], *(tab.a[j][i] for j in range(i + 1, tab.stages))]
            bar = _sum_slopes(execute, [y1_bar, *later], h, weights=weights)
            if i == 0:
                dy_bar = bar
                break
            parameters_i, t_i, stage_bars[i] = pull(parameters, t + tab.c[i] * h, stages[i], bar)
            parameters_bar = jax.tree.map(jnp.add, parameters_bar, parameters_i)
            t_bar = t_bar + t_i
        # Every stage starts from `y`: its cotangents are summed with weight one.
        ones = [1.0] * (tab.stages - 1)
        y_bar = _move_state(execute, y1_bar, stage_bars[1:], h=1.0, weights=ones)
        return extra, (parameters_bar, t_bar, y_bar, dy_bar)


class DiffraxStepper(AbstractStepper):
    """Any diffrax solver through `solver.step`; implicit ones for stiff smoothed friction.

    `open`: which tolerances of its root finder are not set. `unit`: what its stage equations are solved
    to in each leaf of the state, for a step that is tried; None for one that was accepted before.
    """

    solver: dfx.AbstractSolver
    open: tuple[str, ...] = eqx.field(static=True, default=())
    rtol: Any = ACCURACY.solved
    unit: tuple | None = None

    @property
    def solves(self) -> bool:
        return isinstance(self.solver, dfx.AbstractImplicitSolver)

    def solved_to(self, unit: list) -> "DiffraxStepper":
        return eqx.tree_at(lambda s: s.unit, self, tuple(unit), is_leaf=lambda a: a is None)

    def _with_tolerances(self) -> Any:
        """The solver with tolerances of its stage equations, which diffrax leaves to its own rule."""
        if not self.open:
            return self.solver
        found = {
            "rtol": ACCURACY.root_share * self.rtol,
            "atol": ACCURACY.root_share,
            "norm": optx.max_norm,
        }
        return eqx.tree_at(
            lambda s: [getattr(_innermost(s).root_finder, name) for name in self.open],
            self.solver,
            [found[name] for name in self.open],
            is_leaf=lambda x: x is None,
        )

    def _units(self, y: list, dy: list, h: Numeric) -> list:
        """Unit of each number of the state, so that one tolerance serves them all."""
        if not self.open:
            return [jnp.ones(()) for _ in y]
        if self.unit is not None:
            return list(self.unit)
        y, dy, h, rtol = jax.lax.stop_gradient((y, dy, jnp.asarray(h), self.rtol))
        moves = [jnp.abs(a) + jnp.abs(h * b) for a, b in zip(y, dy, strict=True)]
        largest = functools.reduce(jnp.maximum, [jnp.max(a, initial=ACCURACY.tiny) for a in moves])
        return [rtol * jnp.maximum(a, ACCURACY.smallest * largest) for a in moves]

    def order(self) -> int:
        return int(self.solver.order(None) or 1)

    def has_error_estimate(self) -> bool:
        return isinstance(self.solver, dfx.AbstractAdaptiveSolver)

    def step(self, field, t, y, dy, h, execute):
        # As a tuple of leaves: solvers of diffrax reject empty parts, such as the state of most laws.
        flat, form = jax.tree.flatten(y)
        units = self._units(flat, jax.tree.leaves(dy), h)

        def of_leaves(leaves):
            return jax.tree.unflatten(form, [a * s for a, s in zip(leaves, units, strict=True)])

        # The step is the unit of time: stages are solved for slopes, which have seconds in them.
        def flat_field(part, leaves, args):
            slopes = jax.tree.leaves(field(t + part * h, of_leaves(leaves)))
            return tuple(h * a / s for a, s in zip(slopes, units, strict=True))

        term: Any = dfx.ODETerm(flat_field)
        if _is_additive(self.solver):
            # Of its two methods the explicit one is given nothing to do.
            term = dfx.MultiTerm(dfx.ODETerm(lambda t, y, args: jax.tree.map(jnp.zeros_like, y)), term)
        solver: Any = self._with_tolerances()
        begin = tuple(a / s for a, s in zip(flat, units, strict=True))
        zero, one = jnp.zeros_like(t), jnp.ones_like(t)
        state = solver.init(term, zero, one, begin, None)
        end, error, _, _, result = solver.step(term, zero, one, begin, None, state, made_jump=True)
        failed = (result != dfx.RESULTS.successful) & (self.unit is not None)
        y1 = jax.tree.map(
            lambda new, old: jnp.where(h > 0, jnp.where(failed, jnp.nan, new), old), of_leaves(end), y
        )
        errors = () if error is None else (of_leaves(error),)
        return y1, field(t + h, y1), errors

    def vjp(self, *given):
        back = dataclasses.replace(self, solver=_with_own_loop(self.solver, None))
        return super(DiffraxStepper, back).vjp(*given)


def _with_own_loop(solver: Any, kind: str | None) -> Any:
    """The solver with another loop over its stages: that of diffrax has no forward derivative."""
    return dataclasses.replace(solver, scan_kind=kind) if hasattr(solver, "scan_kind") else solver


def _innermost(solver: Any) -> Any:
    return _innermost(solver.solver) if isinstance(solver, dfx.AbstractWrappedSolver) else solver


def _is_additive(solver: Any) -> bool:
    """Whether it splits the field in two, as KenCarp's methods do: explicit part, implicit part."""
    return isinstance(getattr(_innermost(solver), "tableau", None), dfx.MultiButcherTableau)


def as_stepper(method: Any, rtol: Any = None) -> AbstractStepper:
    """Stepper from a name (`"dop853"`, `"tsit5"`, `"rk4"`), a tableau, or a diffrax solver.

    `rtol` of adaptive steps: implicit methods solve their stages to a part of it.
    Raises `ValueError` for anything else, naming what is allowed.
    """
    if isinstance(method, AbstractStepper):
        return method
    if isinstance(method, str) and method.lower() in _tableau.NAMED:
        return ExplicitRungeKutta(_tableau.NAMED[method.lower()])
    if isinstance(method, _tableau.Tableau):
        return ExplicitRungeKutta(method)
    plain = not isinstance(method, dfx.AbstractItoSolver) and _innermost(method) is method
    if plain and isinstance(method, dfx.AbstractERK):
        return ExplicitRungeKutta(_tableau.from_diffrax(method))
    if isinstance(method, dfx.AbstractSolver):
        rtol = ACCURACY.solved if rtol is None else rtol
        return DiffraxStepper(*_with_newton(_with_own_loop(method, "lax")), rtol)
    raise ValueError(
        f"method={method!r} is not a solver; allowed: {sorted(_tableau.NAMED)}, a Tableau, or a "
        f"diffrax solver such as diffrax.Dopri5() or diffrax.Kvaerno5()"
    )


def _with_newton(solver: Any) -> tuple[Any, tuple[str, ...]]:
    """The solver, and what its root finder takes from diffrax's own rule, which is not used here.

    A root finder that nobody chose is Newton's method. The one of diffrax keeps the slopes of the field
    from the start of the step; in friction they are others at its end, and half of the steps failed.
    """
    inner = _innermost(solver)
    if not isinstance(inner, dfx.AbstractImplicitSolver):
        return solver, ()
    usual = type(inner).__dataclass_fields__["root_finder"].default
    if eqx.tree_equal(inner.root_finder, usual) is True:
        newton = dfx.with_stepsize_controller_tols(optx.Newton)()
        solver = eqx.tree_at(lambda s: _innermost(s).root_finder, solver, newton)
    finder = _innermost(solver).root_finder
    return solver, tuple(
        name
        for name in ("rtol", "atol", "norm")
        if hasattr(finder, name) and not isinstance(getattr(finder, name), float | jax.Array | Callable)
    )
