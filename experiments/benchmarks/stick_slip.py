"""25,000 stick-slip motions with exact events: the engine against peers, errors beside the times.

Block on belt, m = k = 1, F_s = 1, F_k = 0.5, belt speed 0.2 to 0.4, start stuck at x = 0, T = 50;
the closed form is the truth. C and numba take the method and the steps of the engine.
"""

import concurrent.futures
import ctypes
import functools
import os
import pathlib

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion

from ._c import CompilerAbsentError, compiled
from ._harness import Candidate, absent, interleave, table

END = 50.0
STEP = 0.35
LANES = 25_088  # 25,000, filled up to whole chunks on two cores


def closed_form(v: float, end: float = END, fs: float = 1.0, fk: float = 0.5) -> float:
    """x(end), phase by phase."""
    t, x, a = 0.0, 0.0, fs - fk
    slip = 2 * np.pi - 2 * np.arctan(a / v)
    while True:
        stick = (fs - x) / v
        if t + stick >= end:
            return x + v * (end - t)
        t += stick
        if t + slip >= end:
            return fk + a * np.cos(end - t) + v * np.sin(end - t)
        t += slip
        x = fk + a * np.cos(slip) + v * np.sin(slip)


def engine(step: ss.FixedStep | ss.AdaptiveStep, executor: str):
    """x(T) of one lane through the public interface, mapped over lanes."""

    def lane(v):
        system = CoulombOscillator(1.0, 1.0, 1.0, 0.5, v)
        run = ss.simulate(
            system, 0.0, END, Motion(0.0 * v, v), "stick", saveat=ss.SaveAt(max_events=None),
            throw=False, integrator=ss.Integrator(step=step, max_steps=2048),
        )  # fmt: skip
        return run.y1.x

    return ss.map_lanes(lane, executor=executor)


def dop853() -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of the method of the engine, as SciPy has them."""
    from scipy.integrate import DOP853

    return DOP853.A[: DOP853.n_stages, : DOP853.n_stages], DOP853.B


def by_c(speeds, h: float, threads: int):
    """The loop of `stick_slip.c`: eight lanes a register."""
    a, b = dop853()

    def sum_of(name: str, row: np.ndarray) -> str:
        return " + ".join(f"{name}{j} * {float(c)!r}" for j, c in enumerate(row) if c) or "zero"

    lines = []
    for i, row in enumerate(a):
        lines.append(f"real p{i} = u + h * ({sum_of('q', row)});")
        lines.append(f"real q{i} = slips * (half - x - h * ({sum_of('p', row)}));")
    lines.append(f"x1 = x + h * ({sum_of('p', b)}); u1 = u + h * ({sum_of('q', b)});")
    header = f"#define STEP {' '.join(lines)}\n"
    source = pathlib.Path(__file__).with_name("stick_slip.c")
    function = compiled(source, "stick-slip", header).stick_slip
    pointer, number = ctypes.c_void_p, ctypes.c_double
    function.argtypes = [ctypes.c_long, pointer, number, number, ctypes.c_int, pointer]
    function.restype = None

    def run():
        out = np.empty(speeds.size)
        function(speeds.size, speeds.ctypes.data, h, END, threads, out.ctypes.data)
        return out

    return run


def by_numba(speeds, h: float):
    """A lane after the other, each event by Newton's method on a step that is repeated."""
    import numba  # pyright: ignore[reportMissingImports]

    a, b = dop853()
    n = b.size

    @numba.njit(fastmath=True, error_model="numpy")
    def step(x, u, slips, h, dx, du):
        for s in range(n):
            xs, us = x, u
            for j in range(s):
                xs += h * a[s, j] * dx[j]
                us += h * a[s, j] * du[j]
            dx[s], du[s] = us, (0.5 - xs) * slips
        for s in range(n):
            x += h * b[s] * dx[s]
            u += h * b[s] * du[s]
        return x, u

    @numba.njit(parallel=True, fastmath=True, error_model="numpy")
    def run():
        out = np.empty(speeds.size)
        for lane in numba.prange(speeds.size):
            v, t, x, u, slips = speeds[lane], 0.0, 0.0, speeds[lane], 0.0
            dx, du = np.empty(n), np.empty(n)
            while t < END:
                hh = min(h, END - t)
                x1, u1 = step(x, u, slips, hh, dx, du)
                g = v - u1 if slips else 1.0 - x1
                fires = g < 0.0
                if fires:
                    for _ in range(20):
                        rate = x1 - 0.5 if slips else -u1
                        change = -g / rate
                        hh += change
                        x1, u1 = step(x, u, slips, hh, dx, du)
                        g = v - u1 if slips else 1.0 - x1
                        if abs(change) < 1e-13:
                            break
                t, x, u = t + hh, x1, u1
                if fires:
                    u, slips = v, 1.0 - slips
            out[lane] = x
        return out

    return run


def diffrax_loop(speeds, tolerance):
    """The pattern diffrax's maintainers advise: an outer loop of solves that end at an event."""
    import diffrax as dfx
    import optimistix as optx

    finder = optx.Newton(tolerance, tolerance)

    def guard(t, y, args, **_):
        mode, v = args
        return jnp.where(mode == 0, 1.0 - y[0], v - y[1])

    def field(t, y, args):
        mode, _ = args
        return jnp.stack([y[1], jnp.where(mode == 0, 0.0, 0.5 - y[0])])

    def lane(v):
        def body(state):
            t, y, mode, count = state
            solution = dfx.diffeqsolve(
                dfx.ODETerm(field), dfx.Dopri8(), t, END, 0.1, y, args=(mode, v),
                stepsize_controller=dfx.PIDController(rtol=tolerance, atol=tolerance),
                event=dfx.Event(guard, finder, direction=False), max_steps=4096, throw=False,
                adjoint=dfx.ForwardMode(),
            )  # fmt: skip
            assert solution.ys is not None
            assert solution.ts is not None
            y = solution.ys[0]
            return solution.ts[0], jnp.stack([y[0], jnp.where(mode == 1, v, y[1])]), 1 - mode, count + 1

        state = (jnp.zeros(()), jnp.stack([0.0 * v, v]), jnp.zeros((), jnp.int32), 0)
        return jax.lax.while_loop(lambda s: (s[0] < END) & (s[3] < 100), body, state)[1][0]

    program = jax.jit(jax.vmap(lane))
    return lambda: jax.block_until_ready(program(speeds))


def heyoka_equations(hy):
    """Right-hand side and event of the Taylor integrator; par: mode (0 stick, 1 slip), belt speed."""
    x, u = hy.make_vars("x", "u")
    mode, v = hy.par[0], hy.par[1]
    equations = [(x, u), (u, mode * (0.5 - x))]
    event = (1.0 - mode) * (1.0 - x) + mode * (v - u)
    return equations, event


def heyoka_serial(speeds):
    """One trajectory after the other in one thread, terminal event with a callback."""
    import heyoka as hy  # pyright: ignore[reportMissingImports]

    equations, event = heyoka_equations(hy)

    def turn(ta, sign):
        if ta.pars[0] == 1.0:
            ta.state[1] = ta.pars[1]
        ta.pars[0] = 1.0 - ta.pars[0]
        return True

    ev = hy.t_event(event, callback=turn, direction=hy.event_direction.negative)
    ta = hy.taylor_adaptive(equations, [0.0, 0.2], pars=[0.0, 0.2], t_events=[ev])

    def run():
        out = np.empty(len(speeds))
        for i, v in enumerate(speeds):
            ta.time = 0.0
            ta.state[:] = (0.0, v)
            ta.pars[:] = (0.0, v)
            ta.propagate_until(END)
            out[i] = ta.state[0]
        return out

    return run


def heyoka_batch(speeds, threads=2):
    """Batch mode at the SIMD width, one integrator per thread: heyoka at its best."""
    import heyoka as hy  # pyright: ignore[reportMissingImports]

    equations, event = heyoka_equations(hy)
    width = hy.recommended_simd_size()

    def turn(ta, sign, lane):
        if ta.pars[0, lane] == 1.0:
            ta.state[1, lane] = ta.pars[1, lane]
        ta.pars[0, lane] = 1.0 - ta.pars[0, lane]
        return True

    def make():
        ev = hy.t_event_batch(event, callback=turn, direction=hy.event_direction.negative)
        return hy.taylor_adaptive_batch(
            equations, np.zeros((2, width)), pars=np.zeros((2, width)), t_events=[ev]
        )

    workers = [make() for _ in range(threads)]
    groups = np.array_split(speeds[: len(speeds) // width * width].reshape(-1, width), threads)

    def work(ta, group):
        out = np.empty(group.shape)
        for i, v in enumerate(group):
            ta.set_time(0.0)
            ta.state[0], ta.state[1] = 0.0, v
            ta.pars[0], ta.pars[1] = 0.0, v
            while np.any(ta.time < END):
                ta.propagate_until(END)
            out[i] = ta.state[0]
        return out

    def run():
        with concurrent.futures.ThreadPoolExecutor(threads) as pool:
            return np.concatenate(list(pool.map(work, workers, groups))).ravel()

    return run


def main(size: str = "normal") -> str:
    """The table: engine in its variants, C, numba, heyoka, diffrax."""
    quick = size == "quick"
    speeds = np.linspace(0.2, 0.4, LANES)
    truth = np.array([closed_form(v) for v in speeds])
    few = speeds[:: LANES // 1024][:1024] if quick else speeds
    candidates, missing = [], []

    def add(name, call, lanes=speeds, rounds=None):
        reference = truth if len(lanes) == LANES else np.array([closed_form(v) for v in lanes])
        out = np.asarray(call())
        error = float(np.max(np.abs(out - reference[: len(out)])))
        candidates.append(Candidate(name, call, error, len(out) / LANES, rounds))

    def mapped(step, executor):
        program = engine(step, executor)
        return functools.partial(lambda p: jax.block_until_ready(p(speeds)), program)

    fixed = ss.FixedStep(STEP)
    adaptive = ss.AdaptiveStep(1e-10, 1e-10)
    add("engine, fused, fixed steps 0.35", mapped(fixed, "fused"))
    add("engine, fused, adaptive 1e-10", mapped(adaptive, "fused"))
    add("engine, portable, fixed steps 0.35", mapped(fixed, "portable"))
    threads = os.cpu_count() or 1
    try:
        add(f"C, eight lanes a register, {threads} threads", by_c(speeds, STEP, threads))
    except CompilerAbsentError:
        missing.append("a C compiler")
    if absent("numba"):
        missing.append("numba")
    else:
        add(f"numba, {threads} threads", by_numba(speeds, STEP))
    if absent("heyoka"):
        missing.append("heyoka")
    else:
        part = speeds[::8] if quick else speeds
        add("heyoka, one after the other, one thread", heyoka_serial(part), part, 3)
        add(f"heyoka, batches, {threads} threads", heyoka_batch(part, threads), part, 3)
    for tolerance in (1e-8, 3e-14):
        call = diffrax_loop(jnp.asarray(few), tolerance)
        add(f"diffrax, outer loop, tolerance {tolerance:.0e}", call, few, 3)
    rows = interleave(candidates, 3 if quick else 9)
    return table(f"{LANES} stick-slip motions to T = {END:g} (whole job)", rows, missing)
