"""The headline job by numba, heyoka, diffrax and SciPy; each returns a function of k3."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from ._diagram_job import Case, Job, Points, plain_field, slopes, tsit5
from ._illinois import compiled


def scipy_dop853(job: Job, tolerance: float) -> Callable[[np.ndarray], Points]:
    """`solve_ivp` with DOP853 and an event, lane after lane."""
    from scipy.integrate import solve_ivp

    field = plain_field(job.case)
    start = (*job.case.start, 0.0, 0.0)

    def acceleration(t, s, k3):
        return field(t, s, k3)[2]

    acceleration.direction = -1.0

    def run(k3s):
        out = job.empty(len(k3s))
        for i, k3 in enumerate(k3s):
            solution = solve_ivp(
                field, (0.0, job.end), start, "DOP853", args=(k3,),
                rtol=max(tolerance, 3e-14), atol=0.1 * tolerance, events=acceleration,
            )  # fmt: skip
            late = solution.t_events[0] > job.transient
            n = int(late.sum())
            out.t[i, :n] = solution.t_events[0][late]
            out.x[i, :n] = np.asarray(solution.y_events[0])[late, 0]
            out.count[i] = n
        return out

    return run


def _heyoka_equations(hy, case: Case):
    x, y, u, v = hy.make_vars("x", "y", "u", "v")
    a, b = slopes(
        case.values, x, y, u, v, hy.par[0],
        absolute=lambda V: hy.relu(V) + hy.relu(-V), tanh=hy.tanh, cosh=hy.cosh,
    )  # fmt: skip
    return [(x, u), (y, v), (u, a), (v, b)], a


def heyoka_serial(job: Job, tolerance: float) -> Callable[[np.ndarray], Points]:
    """One trajectory after the other: the reference, at the tightest tolerance."""
    import heyoka as hy  # pyright: ignore[reportMissingImports]

    equations, a = _heyoka_equations(hy, job.case)
    found = []

    def put_down(ta, t, sign):
        if t > job.transient:
            ta.update_d_output(t)
            found.append((t, ta.d_output[0]))

    event = hy.nt_event(a, put_down, direction=hy.event_direction.negative)
    ta = hy.taylor_adaptive(equations, [0.0] * 4, pars=[80.0], nt_events=[event], tol=tolerance)

    def run(k3s):
        out = job.empty(len(k3s))
        for i, k3 in enumerate(k3s):
            ta.time, ta.state[:2], ta.state[2:], ta.pars[:] = 0.0, job.case.start, 0.0, k3
            found.clear()
            ta.propagate_until(job.end)
            out.count[i] = len(found)
            for j, (t, x) in enumerate(found):
                out.t[i, j], out.x[i, j] = t, x
        return out

    return run


def heyoka_batch(job: Job, tolerance: float, *, points: bool = True) -> Callable[[np.ndarray], Points]:
    """Batch mode at the SIMD width in one thread; without `points`, x at the crossings is left out."""
    import heyoka as hy  # pyright: ignore[reportMissingImports]

    equations, a = _heyoka_equations(hy, job.case)
    width = hy.recommended_simd_size()
    found: list[list[tuple[float, float]]] = [[] for _ in range(width)]
    times = np.empty(width)

    def put_down(ta, t, sign, lane):
        if t > job.transient:
            if points:
                times[:] = ta.time
                times[lane] = t
                ta.update_d_output(times)
                found[lane].append((t, ta.d_output[0, lane]))
            else:
                found[lane].append((t, np.nan))

    event = hy.nt_event_batch(a, put_down, direction=hy.event_direction.negative)
    ta = hy.taylor_adaptive_batch(
        equations, np.zeros((4, width)), pars=np.full((1, width), 80.0), nt_events=[event],
        tol=tolerance,
    )  # fmt: skip

    def run(k3s):
        out = job.empty(len(k3s))
        for first in range(0, len(k3s), width):
            index = np.minimum(np.arange(first, first + width), len(k3s) - 1)
            ta.set_time(0.0)
            ta.state[0], ta.state[1] = job.case.start
            ta.state[2:], ta.pars[0] = 0.0, k3s[index]
            for lane in found:
                lane.clear()
            ta.propagate_until(job.end)
            for i in range(first, min(first + width, len(k3s))):
                lane = found[i - first]
                out.count[i] = len(lane)
                for j, (t, x) in enumerate(lane):
                    out.t[i, j], out.x[i, j] = t, x
        return out

    return run


def numba_lanes(job: Job, threads: int) -> Callable[[np.ndarray], Points]:
    """`prange` over the lanes: what a researcher writes who knows about one exponential and Tsit5."""
    import math

    import numba as nb  # pyright: ignore[reportMissingImports]

    p = job.case.values
    X0, Y0 = job.case.start
    M, P, J, K1, K2, C1, C2 = (p[n] for n in ("M_BLOCK", "M_PENDULUM", "J", "K1", "K2", "C1", "C2"))
    R, G, Q, V_B, MU_0, ALPHA, BETA, GAMMA = (
        p[n] for n in ("R", "G", "Q", "V_B", "MU_0", "ALPHA", "BETA", "GAMMA")
    )
    a, b = tsit5()
    nodes = [tuple(float(c) for c in row[:i]) for i, row in enumerate(a)]
    A1, A2, A3, A4, A5 = nodes[1:]
    B = tuple(float(c) for c in b)
    jit = functools.partial(nb.njit, fastmath=True, inline="always", error_model="numpy")
    secant, narrow = compiled()

    @jit
    def field(x, y, u, v, k3):
        stretched = k3 * (y + x * x * (0.5 / R))
        z = y * (1.0 / R)
        weight = (0.75 * P * G) * (1.0 + z * (1.0 + z * (-0.5 - z * (1.0 / 6.0))))
        rim = C2 * v + stretched
        speed = abs(u - V_B)
        e = math.exp(-ALPHA * speed)
        one = 1.0 + e * e
        mu = MU_0 * (1.0 - e * e) * (one + 2.0 * BETA * e) / ((1.0 + GAMMA * speed) * one * one)
        force = (mu if u > V_B else -mu) * (M * G + weight - rim)
        shared = C1 * (u + v) + K2 * (x + y)
        return (
            (shared + K1 * x + stretched * x * (1.0 / R) + force) * (-1.0 / M),
            (shared + rim + weight + Q / R) * (-R * R / J),
        )

    @jit
    def step(x, y, u, v, k3, h, a0, b0):
        u1, v1 = u + h * (A1[0] * a0), v + h * (A1[0] * b0)
        a1, b1 = field(x + h * A1[0] * u, y + h * A1[0] * v, u1, v1, k3)
        u2, v2 = u + h * (A2[0] * a0 + A2[1] * a1), v + h * (A2[0] * b0 + A2[1] * b1)
        x2, y2 = x + h * (A2[0] * u + A2[1] * u1), y + h * (A2[0] * v + A2[1] * v1)
        a2, b2 = field(x2, y2, u2, v2, k3)
        u3 = u + h * (A3[0] * a0 + A3[1] * a1 + A3[2] * a2)
        v3 = v + h * (A3[0] * b0 + A3[1] * b1 + A3[2] * b2)
        x3 = x + h * (A3[0] * u + A3[1] * u1 + A3[2] * u2)
        y3 = y + h * (A3[0] * v + A3[1] * v1 + A3[2] * v2)
        a3, b3 = field(x3, y3, u3, v3, k3)
        u4 = u + h * (A4[0] * a0 + A4[1] * a1 + A4[2] * a2 + A4[3] * a3)
        v4 = v + h * (A4[0] * b0 + A4[1] * b1 + A4[2] * b2 + A4[3] * b3)
        x4 = x + h * (A4[0] * u + A4[1] * u1 + A4[2] * u2 + A4[3] * u3)
        y4 = y + h * (A4[0] * v + A4[1] * v1 + A4[2] * v2 + A4[3] * v3)
        a4, b4 = field(x4, y4, u4, v4, k3)
        u5 = u + h * (A5[0] * a0 + A5[1] * a1 + A5[2] * a2 + A5[3] * a3 + A5[4] * a4)
        v5 = v + h * (A5[0] * b0 + A5[1] * b1 + A5[2] * b2 + A5[3] * b3 + A5[4] * b4)
        x5 = x + h * (A5[0] * u + A5[1] * u1 + A5[2] * u2 + A5[3] * u3 + A5[4] * u4)
        y5 = y + h * (A5[0] * v + A5[1] * v1 + A5[2] * v2 + A5[3] * v3 + A5[4] * v4)
        a5, b5 = field(x5, y5, u5, v5, k3)
        return (
            x + h * (B[0] * u + B[1] * u1 + B[2] * u2 + B[3] * u3 + B[4] * u4 + B[5] * u5),
            y + h * (B[0] * v + B[1] * v1 + B[2] * v2 + B[3] * v3 + B[4] * v4 + B[5] * v5),
            u + h * (B[0] * a0 + B[1] * a1 + B[2] * a2 + B[3] * a3 + B[4] * a4 + B[5] * a5),
            v + h * (B[0] * b0 + B[1] * b1 + B[2] * b2 + B[3] * b3 + B[4] * b4 + B[5] * b5),
        )

    @nb.njit(fastmath=True, parallel=True, error_model="numpy")
    def lanes(k3s, h, steps, first, xs, ts, count):
        for lane in nb.prange(k3s.shape[0]):
            k3 = k3s[lane]
            x, y, u, v = X0, Y0, 0.0, 0.0
            px, py, pu, pv = x, y, u, v
            pa, pb = -1.0, 0.0
            n = 0
            for it in range(steps + 1):
                a, b = field(x, y, u, v, k3)
                if pa > 0.0 and a <= 0.0 and it > first and n < xs.shape[1]:
                    bracket = (0.0, 1.0, pa, a, 0)
                    part, X = 0.0, px
                    for _ in range(6):
                        part = secant(bracket)
                        X, Y, U, V = step(px, py, pu, pv, k3, part * h, pa, pb)
                        value, _unused = field(X, Y, U, V, k3)
                        bracket = narrow(bracket, part, value)
                    xs[lane, n] = X
                    ts[lane, n] = h * (it - 1 + part)
                    n += 1
                px, py, pu, pv, pa, pb = x, y, u, v, a, b
                x, y, u, v = step(x, y, u, v, k3, h, a, b)
            count[lane] = n

    nb.set_num_threads(min(threads, nb.get_num_threads()))

    def run(k3s):
        out = job.empty(len(k3s))
        lanes(np.asarray(k3s), job.h, job.steps, job.first, *out)
        return out

    return run


def diffrax_end(job: Job, solver: str, tolerance: float) -> Callable[[np.ndarray], np.ndarray]:
    """`jit(vmap)` with a PID controller: x at the end, no crossings, one exponential a step."""
    solve = _diffrax_solve(job, solver, tolerance, 1_000_000)

    def lane(k3):
        ys = solve(k3).ys
        assert ys is not None
        return ys[0][0]

    program = jax.jit(jax.vmap(lane))
    return lambda k3s: np.asarray(program(jnp.asarray(k3s)))


def diffrax_points(job: Job, solver: str, tolerance: float) -> Callable[[np.ndarray], Points]:
    """The same with the points, by Newton steps on the dense output, for which all steps are kept."""
    import diffrax as dfx

    most = 4096
    solve = _diffrax_solve(job, solver, tolerance, most, dfx.SaveAt(steps=True, dense=True))

    def lane(k3):
        solution = solve(k3)
        ts, ys = solution.ts, solution.ys
        assert ts is not None
        assert ys is not None

        def acceleration(t):
            return _diffrax_field(job.case, solution.evaluate(t), k3)[2]

        value = jax.vmap(lambda *s: _diffrax_field(job.case, s, k3)[2])(*ys)
        over = (value[:-1] > 0.0) & (value[1:] <= 0.0) & (ts[1:] > job.transient) & (ts[1:] <= job.end)
        (index,) = jnp.nonzero(over, size=job.room, fill_value=most)
        inside = index < most
        low, high = ts[index], ts[index + 1]
        a, b = value[index], value[index + 1]
        t = jnp.where(inside, low + (high - low) * a / (a - b), job.end)
        for _ in range(4):
            now, rate = jax.vmap(lambda t: jax.jvp(acceleration, (t,), (1.0,)))(t)
            t = jnp.where(inside, jnp.clip(t - now / rate, low, high), job.end)
        late = inside & (t > job.transient)
        x = jax.vmap(lambda t: solution.evaluate(t)[0])(t)
        order = jnp.argsort(~late, stable=True)
        x, t = (jnp.where(late, a, jnp.nan)[order] for a in (x, t))
        return x, t, late.sum()

    program = jax.jit(jax.vmap(lane))
    return lambda k3s: Points(*(np.asarray(a) for a in program(jnp.asarray(k3s))))


def _diffrax_field(case: Case, s, k3):
    p = case.values
    x, y, u, v = s
    e = jnp.exp(-p["ALPHA"] * jnp.abs(u - p["V_B"]))
    one = 1.0 + e * e
    a, b = slopes(
        p, x, y, u, v, k3, absolute=jnp.abs,
        tanh=lambda s: jnp.sign(s) * (1.0 - e * e) / one, cosh=lambda s: one / (2.0 * e),
    )  # fmt: skip
    return u, v, a, b


def _diffrax_solve(job: Job, solver: str, tolerance: float, max_steps: int, saveat=None):
    import diffrax as dfx

    def solve(k3):
        start = tuple(jnp.asarray(c) for c in (*job.case.start, 0.0, 0.0))
        return dfx.diffeqsolve(
            dfx.ODETerm(lambda t, s, k3: _diffrax_field(job.case, s, k3)), getattr(dfx, solver)(),
            0.0, job.end, 1e-3, start, args=k3, saveat=saveat or dfx.SaveAt(t1=True),
            stepsize_controller=dfx.PIDController(rtol=tolerance, atol=0.1 * tolerance),
            max_steps=max_steps, adjoint=dfx.ForwardMode(),
        )  # fmt: skip

    return solve
