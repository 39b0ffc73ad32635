"""A fit of eight unknowns along stick-slip events, against SciPy's with finite differences."""

import time
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import scipy.optimize

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.identification import LevenbergMarquardt, Observed, Problem, Record
from stickslip.mechanism import AbstractMechanism, Contact

TRUTH = {
    "stiffness": 1.0, "coupling": 0.5, "kinetic": 0.3, "static": 0.5, "mass": 1.5, "speed": 0.2,
    "x": 0.1, "y": 0.2,
}  # fmt: skip
SD = 1e-3  # [m]
OFF = 0.03  # part by which the starts are off
ENOUGH = 1e-3  # of a standard error: the same optimum
STEPS = (None, 1e-7, 1e-6, 1e-5, 1e-4)  # of the differences
INTEGRATOR = ss.Integrator(step=ss.AdaptiveStep(1e-10, 1e-10))


class Blocks(AbstractMechanism):
    """Two blocks on one belt, a spring each and one between them."""

    values: Any

    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"left": {"x": 1}, "right": {"y": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": self.values["mass"]}

    def forces(self, t, q, v, args):
        between = self.values["coupling"] * (q.y - q.x)
        springs = self.values["stiffness"]
        return {"x": between - springs * q.x, "y": -between - springs * q.y}

    def contacts(self, t, q, v, args):
        law = Coulomb(self.values["static"], self.values["kinetic"])
        return {name: Contact(law, 1.0, self.values["speed"]) for name in ("left", "right")}


def _blocks(p, inputs):
    return Blocks({name: p[name] for name in TRUTH})


def _state(p, inputs):
    return _blocks(p, inputs).state(x=p["x"], y=p["y"], v_x=p["speed"], v_y=p["speed"])


def problem(seconds: float) -> Problem:
    """Noisy positions of both blocks, ten a second."""
    times = np.arange(0.1, seconds, 0.1)
    run = ss.simulate(_blocks(TRUTH, {}), 0.0, seconds, _state(TRUTH, {}), saveat=ss.SaveAt(ts=times))
    rng = np.random.default_rng(0)
    outputs = run.outputs
    assert outputs is not None
    rows = {
        name: np.asarray(getattr(outputs.y, name)) + SD * rng.normal(size=times.size)
        for name in ("x", "y")
    }
    observed = {
        "x": Observed(lambda t, y, system: y.x, SD, "m"),
        "y": Observed(lambda t, y, system: y.y, SD, "m"),
    }
    record = Record(times, rows, begin=0.0)
    return Problem(_blocks, _state, TRUTH, observed, record, integrator=INTEGRATOR)


def timed(call: Any) -> tuple[Any, float, float]:
    """What a call returns, the seconds that its first time takes, and the best of three later."""
    laps = []
    for _ in range(4):
        begin = time.perf_counter()
        found = jax.block_until_ready(call())
        laps.append(time.perf_counter() - begin)
    return found, laps[0], min(laps[1:])


def by_scipy(residual: Any, start: np.ndarray, **options: Any) -> tuple[Any, int]:
    """Estimate and number of calls; unknowns in units of their starts."""
    calls = 0

    def counted(u):
        nonlocal calls
        calls += 1
        return np.asarray(residual(jnp.asarray(u * start)))

    found = scipy.optimize.least_squares(counted, np.ones(start.size), **options)
    return found.x * start, calls


def compare(seconds: float = 20.0) -> dict[str, Any]:
    """Both fits; SciPy's with the method and step that need the fewest runs to the same optimum."""
    made = problem(seconds)
    names = sorted(TRUTH)
    signs = np.random.default_rng(1).choice([-1.0, 1.0], len(names))
    start = np.array([TRUTH[n] for n in names]) * (1.0 + OFF * signs)
    ours, first, seconds_ours = timed(
        lambda: made.fit(
            method=LevenbergMarquardt(), start=dict(zip(names, map(float, start), strict=True))
        )
    )
    errors = ours.standard_errors()
    estimate = np.array([float(ours.values[n]) for n in names])
    scale = np.array([float(errors[n]) * v for n, v in zip(names, estimate, strict=True)])
    plain = jax.jit(lambda p: made.residual_function(dict(zip(names, p, strict=True))))
    slopes = jax.jit(jax.jacfwd(lambda p: made.residual_function(dict(zip(names, p, strict=True)))))
    _, plain_first, plain_seconds = timed(lambda: plain(jnp.asarray(start)))
    _, _, slope_seconds = timed(lambda: slopes(jnp.asarray(start)))
    theirs = []
    for method in ("trf", "lm", "dogbox"):
        for step in STEPS:
            options = {"method": method, "diff_step": step}
            begin = time.perf_counter()
            found, runs = by_scipy(plain, start, **options)
            lap = time.perf_counter() - begin
            off = float(np.max(np.abs(found - estimate) / scale))
            theirs.append({"method": method, "step": step, "runs": runs, "seconds": lap, "off": off})
    there = [t for t in theirs if t["off"] < ENOUGH]
    best = min(there, key=lambda t: t["runs"]) if there else None
    return {
        "steps": int(ours.steps), "chi": float(ours.reduced_chi_squared), "first": first,
        "seconds": seconds_ours, "plain_first": plain_first, "plain": plain_seconds,
        "slopes": slope_seconds, "theirs": theirs, "best": best, "count": len(names),
        "successful": bool(ours.successful),
    }  # fmt: skip


def main(size: str = "normal") -> str:
    """Table: ours and SciPy's, compile time apart."""
    told = compare(10.0 if size == "quick" else 20.0)
    cost = told["slopes"] / told["plain"]
    lines = [
        f"Fit of {told['count']} unknowns, starts {OFF:.0%} off, chi squared {told['chi']:.3f}",
        f"ours: {told['steps']} runs, each with {told['count']} tangents, {told['seconds']:.3f} s",
        f"first call {told['first']:.1f} s, most of it compiling; of the plain run for SciPy "
        f"{told['plain_first']:.1f} s",
        f"a run {1e3 * told['plain']:.2f} ms, with all tangents {cost:.1f} times that: ours are worth "
        f"{told['steps'] * cost:.0f} plain runs",
    ]
    best = told["best"]
    for t in told["theirs"]:
        mark = " <- fewest runs to the same optimum" if t is best else ""
        step = "default" if t["step"] is None else f"{t['step']:g}"
        lines.append(
            f"SciPy {t['method']}, differences {step}: {t['runs']} runs, {t['seconds']:.3f} s, "
            f"{t['off']:.1e} standard errors off{mark}"
        )
    if best is not None:
        lines.append(
            f"SciPy over ours: {best['runs'] / told['steps']:.1f} times the runs, "
            f"{best['seconds'] / told['seconds']:.1f} times the time"
        )
    return "\n".join(lines)
