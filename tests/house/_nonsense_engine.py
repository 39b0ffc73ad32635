"""Right arguments of the engine and the sweeps."""

import pathlib
import tempfile

import jax
import numpy as np

import stickslip as ss
from stickslip import hybrid, sweep
from stickslip.systems import CoulombOscillator, Motion
from tests.house._nonsense_target import Target, arg, reached

OSCILLATOR = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
START = Motion(x=0.0, v=0.2)
RK4 = ss.Integrator("rk4", ss.FixedStep(0.1))
INSIDE = tempfile.TemporaryDirectory()
PORTABLE = sweep.Compute("portable")

SYSTEM = arg(OSCILLATOR)
STATE = arg(START)
TIME = arg(0.0, "finite")
INTEGRATOR = arg(RK4, "none")
MODE = arg(0, "none", "whole")
ARGS = arg(None, "handed on")
COUNT = arg(8, "count")
ENGINE_ONLY = {"system": SYSTEM, "args": ARGS}


def _run() -> ss.Solution:
    return ss.simulate(
        OSCILLATOR, 0.0, 0.3, START, 0, integrator=RK4,
        saveat=ss.SaveAt(steps=True, max_rows=8, max_events=None),
    )  # fmt: skip


RUN = _run()


def _broken(system: ss.WithBreaks) -> ss.Solution:
    return ss.simulate(system, 0.0, 1.0, system.start(START), 0, integrator=RK4)


def _recurring(system: ss.WithPeriodicBreaks) -> ss.Solution:
    return ss.simulate(system, 0.0, 1.0, START, 0, integrator=RK4)


def _store() -> str:
    path = f"{INSIDE.name}/finished"
    sweep.run_sweep(lambda k: {"x": k}, {"k": [1.0]}, store=path, compute=PORTABLE)
    return path


def _program() -> str:
    """A file of `export`."""
    return str(ss.export(lambda x: x, (1.0,), f"{INSIDE.name}/program.zip"))


ENGINE = [
    Target(
        ss.SaveAt,
        {
            "ts": arg([0.5], "none", "no times"), "steps": arg(True, "flag"),
            "events": arg(True, "flag"), "sections": arg((), "none of them"), "max_rows": arg(8),
            "max_events": arg(8, "none", "count"), "max_crossings": arg(8),
        },
        lambda **given: ss.simulate(OSCILLATOR, 0.0, 1.0, START, 0, saveat=ss.SaveAt(**given)),
    ),
    Target(ss.FixedStep, {"h": arg(0.1, "positive", "float32")}),
    Target(
        ss.AdaptiveStep,
        {
            "rtol": arg(1e-6, "positive", "float32"),
            "atol": arg(1e-8, "none", "positive", "float32", "batch", "tolerances"),
            "dtmax": arg(1.0, "none", "positive", "float32", "infinite"),
            "dtmin": arg(0.0, "not negative", "float32"),
            "h0": arg(None, "none", "positive", "float32"),
        },
    ),
    Target(
        ss.Tableau,
        {
            "name": arg("midpoint", "text"), "order": arg(2, "count"),
            "a": arg([[0.0, 0.0], [0.5, 0.0]]), "b": arg([0.0, 1.0], "row"), "c": arg([0.0, 0.5]),
            "error_weights": arg(((1.0, -1.0, 0.0),), "no times"),
        },
    ),
    Target(
        ss.Integrator,
        {
            "method": arg("tsit5"), "step": arg(ss.FixedStep(0.1)), "max_steps": arg(10),
            "detect_dips": arg(True, "flag"), "progress": arg(None, "none"),
        },
    ),
    Target(ss.ProgressMeter, {"name": arg("run", "text"), "interval": arg(0.5, "not negative")}),
    Target(
        ss.Section,
        {
            "function": arg(lambda s, t, y, dy, m, args: y.x, "constant"), "direction": arg("rising"),
            "terminal": arg(False, "flag"), "name": arg("top", "text"),
        },
        lambda **given: ss.simulate(
            OSCILLATOR, 0.0, 1.0, START, 0, saveat=ss.SaveAt(sections=ss.Section(**given))
        ),
    ),
    Target(
        ss.simulate,
        {
            "system": SYSTEM, "t0": TIME, "t1": arg(1.0, "finite"), "y0": STATE, "mode0": MODE,
            "args": ARGS, "integrator": INTEGRATOR, "saveat": arg(ss.SaveAt(), "none"),
            "throw": arg(True, "flag"),
        },
    ),
    Target(
        ss.interpolate,
        {
            "system": SYSTEM, "solution": arg(RUN), "ts": arg([0.1], "times", "no times"), "args": ARGS,
            "integrator": INTEGRATOR,
        },
    ),
    Target(
        ss.saltation_matrix,
        {
            "system": SYSTEM, "t": TIME, "y": STATE, "mode": arg(0, "whole"), "guard": arg(0, "whole"),
            "args": ARGS,
        },
    ),
    Target(ss.same_mode_sequence, {"one": arg(RUN), "other": arg(RUN)}),
    Target(
        ss.switch,
        {
            "mode": arg(0, "whole", "any whole"),
            "functions": arg((lambda x: x, lambda x: x)),
            "operands": arg(1.0, "numbers"),
        },
        lambda mode, functions, operands: ss.switch(mode, functions, operands),
    ),
    Target(
        ss.WithBreaks,
        {"system": SYSTEM, "times": arg([0.5, 1.5], "times")},
        lambda **given: _broken(ss.WithBreaks(**given)),
    ),
    Target(
        ss.WithPeriodicBreaks,
        {
            "system": SYSTEM,
            "times": arg([0.5, 1.5], "times"),
            "period": arg(2.0, "positive"),
        },
        lambda **given: _recurring(ss.WithPeriodicBreaks(**given)),
    ),
    Target(
        ss.enable_compilation_cache,
        {"directory": arg("cache", "none", "path"), "max_bytes": arg(4e9, "positive")},
        lambda directory, max_bytes: ss.enable_compilation_cache(
            inside(directory), max_bytes=max_bytes
        ),
    ),
    Target(
        ss.export,
        {
            "function": arg(lambda x: x, "function"), "arguments": arg((1.0,)),
            "path": arg("program.zip", "path"), "batch": arg(False, "flag"),
            "derivatives": arg(False, "flag"), "units": arg(None, "none", "mapping"),
        },
        lambda path, **given: ss.export(path=inside(path), **given),
    ),
    Target(
        ss.export_fmu,
        {
            "system": SYSTEM, "y0": STATE, "path": arg("machine.fmu", "path"), "mode0": MODE,
            "args": ARGS, "t0": TIME, "inputs": arg((), "none of them"),
            "outputs": arg(None, "none", "mapping"), "integrator": INTEGRATOR,
        },
        lambda path, **given: ss.export_fmu(path=inside(path), **given),
    ),
    Target(ss.load, {"path": arg(_program(), "path")}),
    Target(hybrid.piece, {"function": arg(lambda execute, x: x, "constant")}),
    Target(hybrid.jit_by_code, {"function": arg(lambda x: x, "constant")}),
    Target(hybrid.jit_plainly, {"function": arg(lambda x: x, "constant")}),
    Target(hybrid.time_loop, {"function": arg(lambda execute, x: x, "constant")}),
    Target(
        hybrid.raise_failures, {"solution": arg(RUN), "successful": arg(True, "flag", "mask")},
        lambda **given: jax.eval_shape(lambda: hybrid.raise_failures(**given)),
    ),
    Target(hybrid.Executor, dict.fromkeys(("fused", "single", "compact"), arg(False, "flag"))),
    Target(
        hybrid.use_executor, {"executor": arg(hybrid.PORTABLE)},
        lambda executor: hybrid.use_executor(executor).__enter__(),
    ),
]  # fmt: skip

SWEEP = {
    "store": arg(None, "none", "path"), "labels": arg(None, "none"), "compute": arg(PORTABLE, "none"),
    "part": arg(None, "none"),
}  # fmt: skip
SWEEPS = [
    Target(
        ss.map_lanes,
        {
            "function": arg(reached, "any function"), "chunk_size": arg(4, "none"),
            "executor": arg("portable"), "workers": arg(1, "none"),
        },
    ),
    Target(
        ss.map_lanes.__call__, {"inputs": arg(np.arange(3.0), "lanes")},
        lambda inputs: ss.map_lanes(reached, executor="portable")(inputs),
    ),
    Target(
        sweep.run_sweep,
        {
            "function": arg(lambda k: {"x": k}, "function"), "grid": arg({"k": [1.0, 2.0]}),
            "inputs": arg(None, "none", "mapping"), **SWEEP,
        },
        lambda store, **given: sweep.run_sweep(store=inside(store), **given),
    ),
    Target(
        sweep.run_sweep,
        {"carry": arg(1.0, "numbers"), "carried": arg(sweep.Carried(), "none")},
        lambda **given: sweep.run_sweep(lambda c=0, *, k: (c, k), {"k": [1.0, 2.0]}, **given),
    ),
    Target(
        sweep.refine_sweep,
        {
            "function": arg(lambda k: {"x": k}, "function"), "grid": arg({"k": [1.0, 2.0]}),
            "by": arg({"x": 0.5}, "results"), "levels": arg(1, "count"), "max_points": arg(100),
            **SWEEP,
        },
        lambda store, **given: sweep.refine_sweep(store=inside(store), **given),
    ),
    Target(
        sweep.Variable,
        {
            "dims": arg(("point",), "none of them"), "units": arg("m", "none", "empty text", "text"),
            "long_name": arg("length", "none", "empty text", "text"), "attrs": arg({}, "entries"),
        },
    ),
    Target(sweep.open_dataset, {"path": arg(_store()), "verify": arg(True, "flag")}),
    Target(
        sweep.Storage,
        {
            "path": arg(None, "none", "path"), "chunk": arg(4, "none"), "shard": arg(8, "none"),
            "resume": arg(True, "flag"), "hosts": arg("alike"),
        },
    ),
    Target(
        sweep.Compute,
        {
            "executor": arg("portable"), "workers": arg(1, "none"), "client": arg(None, "none"),
            "progress": arg(None, "none", "flag"),
        },
    ),
    Target(
        sweep.Labels,
        {
            "variables": arg(None, "none", "mapping"), "settings": arg(None, "none", "entries"),
            "attrs": arg(None, "none", "entries"), "name": arg("a sweep", "none", "text"),
        },
    ),
    Target(sweep.Carried, {"direction": arg("upwards"), "along": arg(None, "none", "text")}),
    Target(sweep.sweep_status, {"store": arg(_store())}),
    Target(sweep.verify_store, {"store": arg(_store()), "repair": arg(True, "flag")}),
]  # fmt: skip


def inside(store):
    """Not in the working directory."""
    return f"{INSIDE.name}/{store}" if isinstance(store, str | pathlib.Path) and str(store) else store


TARGETS = [*ENGINE, *SWEEPS]
