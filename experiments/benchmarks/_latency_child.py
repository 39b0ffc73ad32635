"""One program in a process of its own: how long until its first result, and how large it is."""

import json
import os
import pathlib
import sys
import time
from collections.abc import Callable
from typing import Any

START = time.perf_counter()


def block():
    """`(function, k3)`: the block on a belt with its pendulum, 12 s, four states, no event."""
    import stickslip as ss
    from stickslip.systems import BlockOnBelt, BlockState

    rest = BlockState(0.0, 0.0, 0.0, 0.0)
    return lambda k3: ss.simulate(BlockOnBelt.constructed(k3=k3), 0.0, 12.0, rest).y1.x, 85.0


def block_section():
    """The same with its recorded turning points."""
    import stickslip as ss
    from stickslip.systems import BlockOnBelt, BlockState

    rest = BlockState(0.0, 0.0, 0.0, 0.0)
    turns = ss.Section(lambda system, t, y, dy, mode, args: y.vx, "falling")

    def end(k3):
        run = ss.simulate(
            BlockOnBelt.constructed(k3=k3), 0.0, 12.0, rest, saveat=ss.SaveAt(sections=turns)
        )
        return run.y1.x, run.crossings[0].t

    return end, 85.0


def block_diffrax():
    """The block by diffrax: the same field, method of the same order, the same tolerance."""
    import diffrax as dfx
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    # The field is ours, for it must be the same; what it imports is not counted: see `main`.
    from stickslip.systems import BlockOnBelt, BlockState

    rest = BlockState(*(jnp.zeros(()) for _ in range(4)))

    def end(k3):
        system = BlockOnBelt.constructed(k3=k3)
        term = dfx.ODETerm(lambda t, y, args: system.vector_field(t, y, 0, None))
        control = dfx.PIDController(rtol=1e-10, atol=1e-10)
        found: Any = dfx.diffeqsolve(
            term, dfx.Dopri8(), 0.0, 12.0, None, rest, stepsize_controller=control, max_steps=100_000
        )  # fmt: skip
        return found.ys.x

    return end, 85.0


def stick_slip(throw: bool = True):
    """The stick-slip oscillator of the README."""
    import stickslip as ss
    from stickslip.systems import CoulombOscillator, Motion

    def end(v):
        oscillator = CoulombOscillator(1.0, 1.0, 1.0, 0.5, v)
        return ss.simulate(oscillator, 0.0, 30.0, Motion(x=0.0, v=v), "stick", throw=throw).y1.x

    return end, 0.2


def stick_slip_jacfwd():
    """Its derivative, forward."""
    import jax

    function, at = stick_slip()
    return jax.jacfwd(function), at


def stick_slip_grad():
    """Its derivative, reverse."""
    import jax

    function, at = stick_slip()
    return jax.grad(function), at


def corexy(throw: bool = True):
    """Scenario 1 of the CoreXY machine, consistent law, 1 s."""
    import corexy_jax as cx

    parameters, voltage = cx.scenario(1)

    def end(friction):
        import equinox as eqx

        machine = eqx.tree_at(lambda p: p.mu_k, parameters, friction)
        return cx.simulate(machine, voltage, 1.0, rows=11, throw=throw).y.x

    return end, 0.1


def corexy_jvp():
    """Its derivative by one friction coefficient."""
    import jax

    function, at = corexy()
    return lambda friction: jax.jvp(function, (friction,), (1.0,))[1], at


CASES = {
    case.__name__: case
    for case in (
        block, block_section, block_diffrax, stick_slip, stick_slip_jacfwd, stick_slip_grad, corexy,
        corexy_jvp,
    )
}  # fmt: skip


def imports(modules: str) -> dict[str, float]:
    """Seconds to import what is named."""
    for name in modules.split(","):
        __import__(name)
    return {"import": time.perf_counter() - START}


def first_result(name: str) -> dict[str, float]:
    """Seconds of the parts of a first result after the imports, the next, and the program's size.

    Its size in instructions: the text has as many lines again for the frames of the Python stack.
    """
    import jax
    import jax.numpy as jnp

    function, at = CASES[name]()
    at = jnp.asarray(at)
    begin = time.perf_counter()
    lowered = jax.jit(function).lower(at)
    traced = time.perf_counter()
    program = lowered.compile()
    compiled = time.perf_counter()
    jax.block_until_ready(program(at))
    first = time.perf_counter()
    for _ in range(5):
        jax.block_until_ready(program(at))
    return {
        "trace": traced - begin, "compile": compiled - traced, "first": first - begin,
        "next": (time.perf_counter() - first) / 5, "size": str(program.as_text()).count(" = "),
    }  # fmt: skip


def plain_call(name: str) -> dict[str, float]:
    """Seconds of a first and a further call as in a notebook, with programs kept on disk."""
    import stickslip as ss

    ss.enable_compilation_cache()
    function, at = CASES[name]()
    begin = time.perf_counter()
    return _first_and_next(function, at, begin)


def loaded_call(name: str) -> dict[str, float]:
    """The same of an exported program, from reading its file on; the first process writes it."""
    import stickslip as ss

    ss.enable_compilation_cache()
    path = pathlib.Path(os.environ["STICKSLIP_CACHE"], f"{name}.zip")
    make: Any = CASES[name]
    function, at = make(throw=False)
    if not path.is_file():
        ss.export(function, (at,), path)
    begin = time.perf_counter()
    return _first_and_next(ss.load(path), at, begin)


def _first_and_next(function: Callable, at: float, begin: float) -> dict[str, float]:
    import jax

    jax.block_until_ready(function(at))
    first = time.perf_counter()
    for _ in range(5):
        jax.block_until_ready(function(at))
    return {"first": first - begin, "next": (time.perf_counter() - first) / 5}


if __name__ == "__main__":
    kind, what = sys.argv[1:]
    kinds = {
        "import": imports, "program": first_result, "call": plain_call, "load": loaded_call
    }  # fmt: skip
    print(json.dumps(kinds[kind](what)))
