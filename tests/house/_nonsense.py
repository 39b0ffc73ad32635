"""Random nonsense for every argument of the public functions; prints what is not refused properly.

Run as a program, so that the annotations checked in the other tests do not catch the nonsense first.
What lies behind the checks is replaced by `Reached`: a value that is allowed costs nothing.
"""

import dataclasses
import decimal
import os
import pathlib
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from typing import Any

os.environ["STICKSLIP_EXECUTOR"] = "portable"

import hypothesis
import jax.numpy as jnp
import numpy as np
from hypothesis import strategies as st

import corexy_jax
import stickslip as ss
from corexy_jax import (
    CoreXYParameters,
    Harmonic,
    PiecewiseStep,
    Sampled,
    SquareWave,
    UserVoltage,
    scenario,
)
from experiments._experiment import chosen, load
from stickslip.analysis import (
    amplitude_spectrum,
    energy_ledger,
    lyapunov_diagram,
    lyapunov_spectrum,
    orbit_diagram,
    spectral_peaks,
    time_history,
    two_trajectory_exponent,
    volume_growth,
)
from stickslip.friction import SmoothHyperbolicWeakening
from stickslip.hybrid import _simulate
from stickslip.identification import (
    _many_starts,
    _methods,
    gradient_descent,
    least_squares,
    many_starts,
)
from stickslip.sweep import _evaluate, run_sweep
from stickslip.systems import BlockOnBelt, BlockOnBeltSetValued, BlockState, DCDrive, JointedBeam

EXAMPLES = int(sys.argv[1]) if len(sys.argv) > 1 else 300
OURS = tuple(str(pathlib.Path(m.__file__).parent) for m in (ss, corexy_jax, sys.modules["experiments"]))
LIMIT = 1.0  # s of the processor, so that a busy machine does not count
BLOCK = dict(m=0.2, M=0.2, J=0.04, k1=17.0, k2=11.0, k3=85.0, c1=1.0, c2=0.03, r=0.25, Q=-0.4, V_b=0.1)
DRIVE = dict(
    L_w=2e-3, R_w=2.0, k_e=0.05, k_m=0.05, J_dc=5e-5, b=2e-5, T_k=5e-3, rho=20.0, eta=0.6, J_bp=1e-4,
    r_bp=0.03, U_in=4.0,
)  # fmt: skip
BEAM = dict(
    m=0.1, k1=0.25, k2=7.6, k3=22.8, mu_s=0.3, gamma=10.0, v=5e-4, z_A=0.4, modes=5, damping=0.0
)
LAW = dict(mu_0=0.26, alpha=190.0, beta=0.9, gamma=1.75)
START = BlockState(0.0, 0.0, 0.0, 0.0)


class Reached(Exception):
    """All checks were passed."""


def reached(*_: Any, **__: Any) -> Any:
    raise Reached


@dataclasses.dataclass
class Target:
    """A call with good arguments, of which one at a time is replaced."""

    name: str
    call: Callable
    good: dict[str, Any]
    free: tuple[str, ...] = ()  # arguments to replace; all if empty
    ends: bool = True  # whether the good call must reach what lies behind the checks

    @property
    def arguments(self) -> tuple[str, ...]:
        return self.free or tuple(self.good)


def _diagram(**given: Any) -> Any:
    system = BlockOnBelt.constructed(k3=85.0)
    return orbit_diagram(system, **{"section": system.zero_acceleration_section(), **given})


def _of_block(function: Callable) -> Callable:
    return lambda **given: function(BlockOnBelt.constructed(k3=85.0), **given)


def _experiment(**given: Any) -> Any:
    experiment = load()["block-fig02"]
    return chosen(experiment, False, [f"{key}={value}" for key, value in given.items()])


INSIDE = tempfile.TemporaryDirectory()
TARGETS = [
    Target("BlockOnBelt", BlockOnBelt, {**BLOCK, "law": SmoothHyperbolicWeakening(**LAW)}, ends=False),
    Target(
        "BlockOnBeltSetValued", BlockOnBeltSetValued,
        {**BLOCK, "law": SmoothHyperbolicWeakening(**LAW).set_valued_limit()}, ("law", "m", "k3"),
        ends=False,
    ),
    Target("SmoothHyperbolicWeakening", SmoothHyperbolicWeakening, LAW, ends=False),
    Target(
        "DCDrive", DCDrive, {**DRIVE, "motor_friction": "printed", "belt_reaction": "printed"},
        ends=False,
    ),
    Target("SaveAt", ss.SaveAt, dict(steps=True, events=True, max_rows=8), ends=False),
    Target(
        "simulate-saveat",
        lambda ts: ss.simulate(
            BlockOnBelt.constructed(k3=85.0), 0.0, 1.0, START, 0, saveat=ss.SaveAt(ts)
        ),
        dict(ts=[0.5]),
    ),
    Target("FixedStep", ss.FixedStep, dict(h=0.1), ends=False),
    Target("AdaptiveStep", ss.AdaptiveStep, dict(rtol=1e-6, atol=1e-8), ends=False),
    Target(
        "Integrator", ss.Integrator,
        dict(
            method="tsit5", step=ss.FixedStep(0.1), max_steps=10, detect_dips=True,
            progress=ss.ProgressMeter(),
        ),
        ends=False,
    ),
    Target(
        "Section", ss.Section,
        dict(
            function=lambda t, y, dy, mode, args: y.x, direction="rising", terminal=False, name="top"
        ),
        ends=False,
    ),
    Target(
        "simulate",
        lambda **given: ss.simulate(BlockOnBelt.constructed(k3=85.0), **given),
        dict(
            t0=0.0, t1=1.0, y0=START, mode0=0, integrator=ss.Integrator(), saveat=ss.SaveAt(),
            sections=(), max_events=8, max_crossings=8,
        ),
    ),
    Target(
        "map_lanes",
        lambda inputs, **given: ss.map_lanes(reached, **given)(inputs),
        dict(inputs=np.arange(3.0), executor="portable", chunk_size=4, workers=1),
    ),
    Target(
        "run_sweep",
        lambda **given: run_sweep(**given),
        dict(
            function=lambda k: {"x": k}, grid={"k": [1.0, 2.0]}, carry=None, along=None, backward=False,
            inputs=None, store=INSIDE.name + "/store", variables=None, settings=None, attrs=None,
            chunk=4, resume=True, executor="portable", workers=1,
        ),
    ),
    Target(
        "orbit_diagram",
        _diagram,
        dict(
            grid={"k3": [80.0, 81.0]}, y0=START, section=ss.Section(lambda t, y, dy, m, a: dy.vx),
            observables="x", transient=1.0, duration=1.0, points=None, max_points=8, t0=0.0, mode0=None,
            integrator=ss.Integrator(), domain=(), carried=None, along=None, period_tolerance=1e-4,
            max_period=4, check=0, labels=None, settings=None,
        ),
    ),
    Target("--set", _experiment, dict(k3_min=72.0, exponents=3, method="tsit5"), ends=False),
]  # fmt: skip
ANALYSES = [
    Target(
        "lyapunov_spectrum",
        _of_block(lyapunov_spectrum),
        dict(
            y0=START, segment=1.0, segments=40, transient=1.0, warm_up=4, exponents=1,
            components=("x",), scales=None, t0=0.0, mode0=0, integrator=ss.Integrator(), blocks=4,
        ),
    ),
    Target(
        "two_trajectory_exponent",
        _of_block(two_trajectory_exponent),
        dict(
            y0=START, segment=1.0, segments=40, distance=1e-3, renormalise=True, transient=1.0,
            warm_up=4, components=("x",), t0=0.0, mode0=0, integrator=ss.Integrator(), blocks=4,
        ),
    ),
    Target(
        "volume_growth",
        _of_block(volume_growth),
        dict(y0=START, duration=1.0, t0=0.0, mode0=0, integrator=ss.Integrator(), max_events=8),
    ),
    Target(
        "lyapunov_diagram",
        _of_block(lyapunov_diagram),
        dict(
            grid={"k3": [80.0, 81.0]}, y0=START, segment=1.0, segments=40, scales=None, labels=None,
            settings=None, spectrum=None, chunk=4,
        ),
    ),
    Target(
        "time_history",
        _of_block(time_history),
        dict(
            y0=START, t=[0.0, 1.0], observables="x", sections=None, transient=1.0, mode0=0,
            integrator=ss.Integrator(), max_crossings=8, labels=None,
        ),
    ),
    Target(
        "energy_ledger",
        _of_block(energy_ledger),
        dict(y0=START, t=[0.0, 1.0], mode0=0, integrator=ss.Integrator(), max_events=8),
    ),
    Target(
        "amplitude_spectrum", amplitude_spectrum, dict(signal=np.arange(16.0), dt=0.1, window="hann"),
        ends=False,
    ),
    Target(
        "spectral_peaks",
        lambda **given: spectral_peaks(amplitude_spectrum(np.sin(np.arange(64.0)), 0.1), **given),
        dict(count=3, floor=1e-3, bases={"f": 1.0}, tolerance=1.0),
        ends=False,
    ),
    Target("JointedBeam", JointedBeam.constructed, {**BEAM, "joint": "printed"}, ends=False),
]  # fmt: skip
MACHINE = [
    Target("CoreXYParameters", CoreXYParameters, dict(m=0.5, mu_s=0.4, P1=20.0, r_f=0.05), ends=False),
    Target("Harmonic", Harmonic, dict(v01=10.0, v02=5.0, frequency=0.5), ends=False),
    Target("SquareWave", SquareWave, dict(v01=10.0, v02=5.0, frequency=0.5), ends=False),
    Target("Sampled", Sampled, dict(times=[0.0, 1.0], v1=[1.0, 2.0], v2=[0.0, 0.0]), ends=False),
    Target(
        "PiecewiseStep", PiecewiseStep, dict(times=[0.0, 1.0], v1=[1.0, 2.0], v2=[0.0, 0.0]), ends=False
    ),
    Target("UserVoltage", UserVoltage, dict(function=lambda t, args: (t, t)), ends=False),
    Target("scenario", scenario, dict(number=1, errata=None), ends=False),
    Target(
        "corexy-simulate",
        corexy_jax.simulate,
        dict(
            parameters=CoreXYParameters(), voltage=Harmonic(10.0, 5.0), t1=1.0, way="consistent",
            rows=11, y0=None,
        ),
    ),
    Target(
        "least_squares", lambda **given: least_squares(lambda p: p["a"], **given),
        dict(start={"a": 1.0}, damping=1.0, tolerance=1e-8, max_steps=8),
    ),
    Target(
        "gradient_descent", lambda **given: gradient_descent(lambda p: p["a"], **given),
        dict(start={"a": 1.0}, steps=3, tolerance=0.1),
    ),
    Target(
        "many_starts", lambda **given: many_starts(lambda p: p["a"], **given),
        dict(starts={"a": [1.0, 2.0]}, fit=least_squares, chunk_size=2, executor="portable"),
    ),
]  # fmt: skip
CHOSEN = {"analyses": ANALYSES, "machine": MACHINE}.get(sys.argv[-1], TARGETS)

NUMBERS = st.floats() | st.integers() | st.sampled_from([0.0, -1.0, -0.0, 1e-320, 1e308, 2**70])
ARRAYS = st.builds(
    lambda shape, fill, kind: np.full(shape, fill).astype(kind),
    st.sampled_from([(), (0,), (1,), (2,), (3,), (2, 2), (0, 3)]),
    st.sampled_from([0.0, 1.0, -1.0, np.nan, np.inf]),
    st.sampled_from(["f8", "f4", "c16", "O", "U4", "M8[s]"]),
)
LEAVES = st.one_of(
    st.none(), st.booleans(), NUMBERS, st.text(max_size=6), st.binary(max_size=3), ARRAYS,
    st.complex_numbers(max_magnitude=10.0),
    st.sampled_from(
        [object(), object, len, lambda: 0, decimal.Decimal(1), slice(3), ..., range(3), np.float32(1.0),
         pathlib.Path("x"), jnp.zeros(2), START, frozenset()]
    ),
)  # fmt: skip
NONSENSE = LEAVES | st.lists(LEAVES, max_size=3) | st.dictionaries(
    st.text(max_size=3) | st.sampled_from(["k3", "k"]), LEAVES, max_size=2
) | st.tuples(LEAVES, LEAVES)  # fmt: skip


def complaint(target: Target, name: str, value: Any) -> str | None:
    """What is wrong with how `value` for argument `name` is treated; None if nothing."""
    begin = time.process_time()
    try:
        target.call(**{**target.good, name: value})
    except Reached:
        pass
    except (ValueError, TypeError) as error:
        text = str(error)
        inner = traceback.extract_tb(error.__traceback__)[-1].filename
        # `t1 < t0` may be told of either; `y0` speaks of its components.
        if not inner.startswith(OURS):
            return f"raised in {inner}: {type(error).__name__}: {text[:200]}"
        if name not in text:
            return f"does not name it: {text[:200]}"
        if not any(word in text for word in ("must", "allowed", "at most", "shape")):
            return f"does not say what is allowed: {text[:200]}"
    except Exception as error:
        inner = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__} in {inner.filename}:{inner.lineno}: {str(error)[:200]}"
    took = time.process_time() - begin
    return f"took {took:.1f} s" if took > LIMIT else None


def good_calls_reach() -> None:
    """Every target accepts its good arguments, or all the rest would prove nothing."""
    for target in CHOSEN:
        try:
            target.call(**target.good)
            assert not target.ends, target.name
        except Reached:
            assert target.ends, target.name


def main() -> None:
    """Print each kind of complaint once."""
    _simulate.core = reached
    _evaluate.Evaluate.output_shapes = reached
    _methods.AbstractMethod.solve = reached
    _many_starts._evaluator = reached
    if CHOSEN is MACHINE:
        ss.simulate = reached
    good_calls_reach()
    found: dict[tuple[str, str], str] = {}
    pairs = [(target, name) for target in CHOSEN for name in target.arguments]

    @hypothesis.settings(
        max_examples=EXAMPLES,
        derandomize=True,
        deadline=None,
        database=None,
        suppress_health_check=list(hypothesis.HealthCheck),
        phases=[hypothesis.Phase.generate],
    )
    @hypothesis.given(st.data())
    def attempt(data):
        # All arguments in each example, so that none is left out.
        for target, name in pairs:
            value = data.draw(NONSENSE)
            words = complaint(target, name, value)
            if words:
                found.setdefault((target.name, name), f"{value!r:.80}: {words}")

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        attempt()
    for (target, name), words in found.items():
        print(f"{target}({name}=...): {words}")


if __name__ == "__main__":
    main()
