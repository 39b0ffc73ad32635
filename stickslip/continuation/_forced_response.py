"""`forced_response`: the periodic motion at one frequency, in lanes and with derivatives."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Complex, Float, Int, PyTree, UInt

from .._show import amount, number
from .._types import Given, Mode, Named
from .._validation import check_count, check_type, is_concrete
from ..analysis.observable import as_observable, named_observables, shape_of, whole_of
from ..hybrid import (
    AbstractHybridSystem,
    AbstractSmoothSystem,
    current_executor,
    jit_plainly,
    use_executor,
)
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.arguments import check_field, start_of, the_system
from ..hybrid.components import numbers_of
from ..hybrid.longest_step import spanning
from ..hybrid.tree import frozen, with_float_arrays
from ._accuracy import ACCURACY
from ._beginning import beside_breaks
from ._closing import Frame, Motion, closure, residual_at_place, samples_of
from ._floquet import multipliers_of
from ._forcing import FORCING, Forcing, check_forcing
from ._measured import measure
from ._newton import Newton
from ._options import SHOOTING, Shooting
from ._orbit import beyond, silent_directions
from ._outcome import ORBITS, first_of
from ._periodic_orbit import solve_orbit
from ._turns import turns_of


class ForcedResponse(eqx.Module):
    r"""A periodic motion with the period $T$ of the forcing, and what is told of it.

    Of each observable by its name, in its own unit: `mean`, `lowest` and `highest` over the period, and
    `harmonics`, $u(t) = \bar u + \mathrm{Re} \sum_k u_k e^{ik(\omega t + \varphi)}$, complex, from the
    first one on, with the phase $\varphi$ of the force. Under `vmap` all has the batch axes in front.

    - `frequency`: $\omega = 2\pi/T$ [rad/s].
    - `t0` [s], `y0`, `mode0`: a point of the motion.
    - `multipliers`: Floquet multipliers, largest first. `num_conserved`: how many are 1 since the
      motion leaves as many quantities as they are, such as the places of sliders that stick all the
      time: the motion is one of a family, of which it is the one with the quantities of the start.
    - `residual`: how far the end is from the beginning, in parts of the motion's size.
    - `at_rest`: whether nothing moves: friction holds everything.
    - `num_events` in a period; `sequence`: hash of their guards and modes; `flags`: as of a `Solution`.
    - `result`: an `ORBITS` item.
    """

    frequency: Float[Array, "*batch"]
    t0: Float[Array, "*batch"]
    y0: PyTree
    mode0: Int[Array, "*batch"]
    mean: dict[str, Float[Array, "*batch"]]
    lowest: dict[str, Float[Array, "*batch"]]
    highest: dict[str, Float[Array, "*batch"]]
    harmonics: dict[str, Complex[Array, "*batch harmonic"]]
    multipliers: Complex[Array, "*batch multiplier"]
    num_conserved: Int[Array, "*batch"]
    residual: Float[Array, "*batch"]
    at_rest: Bool[Array, "*batch"]
    num_events: Int[Array, "*batch"]
    sequence: UInt[Array, "*batch"]
    flags: Int[Array, "*batch"]
    result: Any

    @property
    def amplitude(self) -> dict[str, Array]:
        """Half of the difference between the greatest and the least value over the period."""
        return {name: 0.5 * (high - self.lowest[name]) for name, high in self.highest.items()}

    @property
    def phase(self) -> dict[str, Any]:
        """Phase of the first harmonic against that of the force [rad]: negative where it lags."""
        first = {name: row[..., 0] for name, row in self.harmonics.items()}
        return {
            name: (np if isinstance(u, np.ndarray | np.generic) else jnp).angle(u)
            for name, u in first.items()
        }

    @property
    def successful(self) -> Bool[Array, "*batch"]:
        """Whether the motion is periodic, to rounding."""
        return self.result == ORBITS.successful

    @property
    def stable(self) -> Given[Bool[Array, "*batch"]]:
        """Whether all multipliers are inside the unit circle, but for those of a family."""
        return self.successful & (beyond(self.multipliers, self.num_conserved) == 0)

    def __repr__(self) -> str:
        if not is_concrete(self):
            return f"ForcedResponse(traced, of shape {self.frequency.shape})"
        if self.frequency.shape != ():
            stable = int(np.sum(np.asarray(self.stable)))
            size = amount(self.frequency.size, "motion")
            return f"ForcedResponse: {size}, {self.result}; {stable:,} stable"
        if not bool(self.successful):
            return f"ForcedResponse: {self.result}: {ORBITS[self.result]}"
        parts = [
            f"{name} {number(a)} at {number(np.rad2deg(self.phase[name]))} deg"
            for name, a in self.amplitude.items()
        ]
        family = f"; one of a family: {int(self.num_conserved)} conserved" * (
            int(self.num_conserved) > 0
        )
        return (
            f"ForcedResponse at {number(self.frequency)} rad/s: amplitude of {', '.join(parts)}; "
            f"{int(self.num_events)} events, {'stable' if bool(self.stable) else 'unstable'}{family}"
        )


def forced_response(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    forcing: Given[Forcing] = FORCING,
    *,
    observables: Given[str | Sequence[str] | Named | None] = None,
    periods: Given[int] = 20,
    mode0: Mode | None = None,
    shooting: Given[Shooting] = SHOOTING,
    args: PyTree = None,
) -> ForcedResponse:
    r"""Steady response of a forced system at the frequency that it has, with derivatives.

    Solves $\varphi_T(y) = y$ by Newton's method through all events, and integrates the harmonics of the
    observables along the motion. Derivatives of all results by parameters and `args` are exact, forward
    and reverse, by the implicit function theorem: gradients of an amplitude, for instance.

    Newton's method begins where a simulation ends, and that begins in the periodic motion that the
    system would have if it stayed in the mode of `y0` for ever; if it has none, as where that is not
    linear, at `y0`. So sliders that can stick all the time do so where `y0` has them: from a virgin
    state, `y0 = 0`, they stick as they are until the amplitude makes them slip.

    **Arguments**

    - `system`, `args`, `mode0`: as for `simulate`; `y0`: a state, most often at rest, at time 0.
    - `forcing`: a `Forcing`: the parameter that is the frequency, the force, how many harmonics.
    - `observables`: names of components of the state, `"slope of x"`, methods `(t, y, mode, args)` of
      the system, or a mapping from names to those or to functions `(system, t, y, dy, mode, args)`; of
      one number each. By default the first component.
    - `periods`: so many are simulated before Newton's method, and where that fails 4, 16 and 64 times
      as many: what is hardly damped takes long to settle.
    - `shooting`: a `Shooting`.

    **Returns** a `ForcedResponse`. Its `result` says, also under `jit`, `vmap` and `map_lanes`, whether
    it is periodic. Where several motions are stable it is the one that the simulation led to.

    **Errors** `ValueError`/`TypeError` naming the argument, before compilation.
    """
    the_system(system)
    check_type("shooting", shooting, Shooting, "a Shooting")
    check_count("periods", periods, 1)
    system, args = with_float_arrays((system, args))
    check_forcing(forcing, system)
    y0, mode0, found = start_and_observables(system, y0, mode0, args, forcing, observables)
    numbers = y0, mode0, jnp.zeros(())
    program = response_program if is_concrete((system, args, numbers)) else _response
    return program(
        system, args, shooting.integrator_or(), current_executor(), *numbers, periods, forcing=forcing,
        observables=found, max_events=shooting.max_events,
    )  # fmt: skip


def start_and_observables(
    system: Any, y0: PyTree, mode0: Any, args: PyTree, forcing: Forcing, observables: Any
) -> tuple[PyTree, Array, Any]:
    """The start of a response, and its observables as functions, all checked."""
    y0, mode0 = start_of(system, 0.0, y0, mode0, args)
    check_field(system, 0.0, y0, mode0, args)
    return y0, mode0, read_of(system, y0, mode0, args, forcing, observables)


def read_of(system: Any, y0: PyTree, mode0: Any, args: PyTree, forcing: Forcing, observables: Any):
    """Observables by name, as functions, and behind them the force if there is one."""
    if observables is None:
        observables = numbers_of(y0)[0]
    found = []
    for name, what in named_observables(observables).items():
        argument = f"observables[{name!r}]"
        value = whole_of(as_observable(argument, what, system, y0)[0])
        shape_of(argument, what, value, system, y0, mode0, args, single=True)
        found.append((name, value))
    if forcing.force is not None:
        value = as_observable("forcing.force", forcing.force, system, y0)[0]
        shape_of("forcing.force", forcing.force, value, system, y0, mode0, args, single=True)
        found.append((FORCE, value))
    return tuple(found)


FORCE = ""  # no observable has this name


class InOneMode(AbstractSmoothSystem):
    """Motion of a system as long as it stays in a mode."""

    system: AbstractHybridSystem
    mode: Any

    @property
    def units(self):
        """Those of `system`."""
        return self.system.units

    @property
    def periods(self):
        """Those of `system`."""
        return self.system.periods

    def time_scale(self, args):
        return self.system.time_scale(args)

    def constraints(self, t, y, mode, args):
        return self.system.constraints(t, y, self.mode, args)

    def vector_field(self, t, y, mode, args):
        return self.system.vector_field(t, y, self.mode, args)


def _response(
    system, args, integrator, execute, y0, mode0, t0, periods, *, forcing, observables, max_events
):  # fmt: skip
    """The response from a start; `periods` negative: the start is near the motion."""
    period, periods = jnp.asarray(forcing.rule(system), jnp.float64), jnp.asarray(periods, jnp.float64)
    with use_executor(execute):
        still, given, start, cycle = frozen((system, args, y0, period))
        t0, start, mode0 = beside_breaks(still, given, spanning(integrator, cycle), t0, start, mode0)
        motion, unravel = Motion(still, given, spanning(integrator, cycle)), ravel_pytree(start)[1]
        start = jax.lax.cond(
            periods < 0, lambda: start, lambda: _in_one_mode(motion, start, mode0, t0, cycle)
        )
        start, frame, found = _solution_after_transient(motion, start, mode0, t0, cycle, periods)
        flat, carried = ravel_pytree(start)[0], found.carried
        # One more step of Newton's method, with the derivative of the solution.
        moving, frame = motion._replace(system=system, args=args), frame._replace(period=period)
        away = _residual((system, args, period), found=found, motion=motion, frame=frame, start=start)
        known = jnp.isfinite(found.norm) & jnp.all(jnp.isfinite(found.jacobian))
        # Nothing can be solved, nor need be, where friction holds everything wherever it is.
        rank = jnp.linalg.matrix_rank(jnp.where(known, found.jacobian, 0.0), ENGINE.slack)
        good = known & (rank == flat.size)
        jacobian = jnp.where(good, found.jacobian, jnp.eye(flat.size))
        step = -jnp.linalg.solve(jacobian, jnp.where(good, away, 0.0))
        small = jnp.all(jnp.abs(step) <= ENGINE.same)
        step = jnp.where(small, step, 0.0)
        # Components that stay as they are do so to the last digit: their size is their value.
        still = jnp.abs(found.u - flat / frame.size) <= ACCURACY.short
        u = jnp.where(still, flat / frame.size, found.u) + step
        state, mode = unravel(u * frame.size), carried.modes[-1]
        measured, run, end = measure(
            moving, t0, period, state, mode, observables, forcing.harmonics, max_events, frame.size
        )  # fmt: skip
    closing = residual_at_place(
        carried._replace(residual=(ravel_pytree(end)[0] - u * frame.size) / frame.size),
        u, frame, carried.neutral,
    )  # fmt: skip
    closes = jnp.max(jnp.abs(closing))
    growth = jnp.where(known, carried.pieces[0], 0.0)
    reached = _is_reached(found)
    rests = run.y1.integrals["motion"] <= ENGINE.zero**2
    allowed = jnp.minimum(moving.closes * jnp.maximum(jnp.max(jnp.abs(growth)), 1.0), ACCURACY.near)
    result = first_of(
        (~jnp.isfinite(found.norm), "guess_failed"),
        (found.singular, "singular"),
        (~reached & found.stalled, "stalled"),
        # Without the step its derivative is lost.
        (~reached | ~(good | rests) | ~small, "not_converged"),
        (run.mode1 != mode, "mode_differs"),
        (~(run.successful & (closes <= allowed)), "not_reproduced"),
    )
    force = measured.harmonics.get(FORCE)
    lead = jnp.zeros(()) if force is None else jnp.angle(force[0])
    back = -lead * jnp.arange(1.0, forcing.harmonics + 1.0)
    power = jax.lax.complex(jnp.cos(back), jnp.sin(back))
    measured = measured._replace(harmonics={k: v * power for k, v in measured.harmonics.items()})
    # A motion that is not periodic has no amplitude.
    periodic = result == ORBITS.successful
    mean, lowest, highest, harmonics = (
        {name: jnp.where(periodic, value, jnp.nan) for name, value in values.items() if name != FORCE}
        for values in measured
    )
    return ForcedResponse(
        2.0 * jnp.pi / period, t0, state, mode, mean, lowest, highest, harmonics,
        multipliers_of(growth, flat.size), silent_directions(growth), found.norm,
        rests, run.num_events, run.sequence, run.flags, result,
    )  # fmt: skip


response_program = jit_plainly(_response)


@eqx.filter_custom_jvp
def _residual(moving: Any, *, found: Newton, motion: Motion, frame: Frame, start: PyTree) -> Array:
    """The residual of a solution, which is known: only its derivative by what moves is a run."""
    return found.carried.residual


@_residual.def_jvp
def _residual_jvp(primals, tangents, *, found, motion, frame, start):
    def residual(moving):
        system, args, period = moving
        there, carried = frame._replace(period=period), found.carried
        away = closure(
            found.u, carried.modes, motion._replace(system=system, args=args), there,
            ravel_pytree(start)[1],
        )  # fmt: skip
        return residual_at_place(away, found.u, there, carried.neutral)

    return found.carried.residual, eqx.filter_jvp(residual, primals, tangents)[1]


def _in_one_mode(motion: Motion, y0: PyTree, mode0: Any, t0: Any, period: Any) -> PyTree:
    """A state of the periodic motion in the mode of the start; the start where there is none."""
    flat, unravel = ravel_pytree(y0)
    alone = motion._replace(system=InOneMode(motion.system, mode0))
    run = samples_of(alone, y0, jnp.zeros((), jnp.int32), t0, period, 1)
    _, frame, found, _ = solve_orbit(
        alone, run, t0, period, jnp.full(flat.shape, jnp.nan), ENGINE.solved,
        forced=True, segments=1, max_steps=ACCURACY.few, shifts=False,
    )  # fmt: skip
    still = jnp.abs(found.u - flat / frame.size) <= ACCURACY.short
    linear = found.norm <= ENGINE.solved
    return unravel(jnp.where(linear & ~still, found.u * frame.size, flat))


def _is_reached(found: Newton) -> Any:
    rounding = found.stalled & (found.norm <= ACCURACY.stalled * ENGINE.solved)
    return (found.norm <= ENGINE.solved) | rounding


def _solution_after_transient(
    motion: Motion, y0: PyTree, mode0: Any, t0: Any, period: Any, periods: Any
) -> tuple:
    """State after the transient, frame and outcome of Newton's method from there.

    Where it fails, as what is hardly damped has not settled yet, as much again and more is simulated:
    `periods` times 1, 4, 16, 64. Negative ones: the start is near the motion, and tried as it is.
    """

    def attempt(number, y0, mode0):
        # Begun again and again at the same phase: a run has only so many steps. The last is one period.
        runs = jnp.where(periods < 0, 0, ACCURACY.few**number)

        def along(y, mode, span):
            return samples_of(motion, y, mode, t0, span, 1)

        along = eqx.filter_closure_convert(along, y0, mode0, period)
        shapes = eqx.filter_eval_shape(along, y0, mode0, period)
        begun = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes)

        def after(k, run):
            return along(run.y1, run.mode1, jnp.where(k < runs, periods, 1.0) * period)

        begun = begun._replace(y1=y0, mode1=mode0)
        run = jax.lax.fori_loop(0, runs + 1, after, begun)
        _, frame, found, _ = solve_orbit(
            motion, run, t0, period, jnp.full(run.y.shape[1:], jnp.nan), ENGINE.solved,
            forced=True, segments=1, max_steps=ACCURACY.tries,
        )  # fmt: skip
        return run.y0, run.mode0, frame._replace(free=(), turn=()), found

    def goes_on(state):
        number, _, mode0, _, found = state
        # One that ends in another mode than it begins in is none.
        closed = _is_reached(found) & (found.carried.modes[-1] == mode0)
        return (number == 0) | ((periods >= 0) & (number < ACCURACY.few) & ~closed)

    # The motion with its derivatives is nearly all of the program: traced once, compiled once.
    number = jnp.zeros((), jnp.int32)
    attempt = eqx.filter_closure_convert(attempt, number, y0, mode0)
    shapes = eqx.filter_eval_shape(attempt, number, y0, mode0)
    frame, found = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes[2:])
    _, y0, _, frame, found = jax.lax.while_loop(
        goes_on, lambda state: (state[0] + 1, *attempt(*state[:3])), (number, y0, mode0, frame, found)
    )
    return y0, frame._replace(free=False, turn=turns_of(motion.system, y0)), found
