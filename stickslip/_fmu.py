"""Machines as functional mock-up units, which other simulation tools run."""

import json
import os
import pathlib
import re
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from ._export import export
from ._paths import the_file
from ._show import units_of
from ._types import Given, Mode, Numeric
from ._validation import check_callable, check_mapping, check_type, leaves_of, refusal
from ._version import __version__
from .hybrid import AbstractHybridSystem, Integrator, simulate
from .hybrid.accuracy import ACCURACY
from .hybrid.arguments import a_time, check_field, mode_index, start_of, the_system
from .hybrid.components import components_of, entries, per_second, second_of, unit_of
from .hybrid.system import guard_directions, mode_type
from .hybrid.tree import select

# What the unit has of its own, besides the state and the outputs.
OWN = ("time", "mode", "events", "event_time", "flags")
# The side of a guard that is inside of its mode; of one that fires both ways, the one it is on.
SIDES = {"falling": 1, "rising": -1, "both": 0}
SCRIPT = """from pythonfmu3 import Fmi3SlaveBase
from stickslip._fmu_slave import Machine


class {name}(Machine, Fmi3SlaveBase):
    pass
"""


def export_fmu(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    path: Given[str | os.PathLike[str]],
    *,
    mode0: Mode | None = None,
    args: PyTree = None,
    t0: Numeric = 0.0,
    inputs: Given[Sequence[str]] = (),
    outputs: Given[Mapping[str, Callable] | None] = None,
    integrator: Given[Integrator | None] = None,
) -> pathlib.Path:
    """Write a machine as a functional mock-up unit (FMI 3.0), for co-simulation and model exchange.

    Simulink, Dymola, OpenModelica, FMPy and the like load the unit as a block. It holds the finished
    programs, not the code of the machine; whoever runs it needs a Python with `stickslip` and the same
    JAX. Written with `pythonfmu3`: `pip install 'stickslip[fmu]'`.

    - **Co-simulation**: a communication step is a `simulate` from where the last one ended, events
      inside it located to rounding, inputs held. Results are those of one `simulate` over the whole
      time, but for the step sizes, which begin anew at each communication point.
    - **Model exchange**: the importing tool integrates the field of the mode and looks for zeros of
      the guards; at each the unit makes the transition. Accuracy, and what is seen of a guard inside
      a step, are those of the tool. Bends of the field and switches are no events there.

    **Variables** of the unit, all with their units:

    - `x`, `x[0]`, ...: the components of the state, outputs; a start value may be set for each. In
      model exchange, `der(x)` too;
    - `system.mass`, `args.amplitude`, ...: every float number in `system` and `args`, as tunable
      parameters, or as inputs where `inputs` names them;
    - the `outputs`; `mode`, its number; `events`, how many there were; `event_time` [s] of the last one
      (NaN before the first; in model exchange, known to the tool); `flags` of all steps.

    **Arguments**

    - `system`, `y0`, `mode0`, `args`, `integrator`: as of `simulate`. Without `mode0` the mode at the
      start is that of the state, whatever its start values are set to.
    - `path`: of the unit, `"machine.fmu"`; one that exists is replaced.
    - `t0`: a time [s] at which the field can be evaluated, to check it.
    - `inputs`: names of numbers in `system` and `args`, as `"args.force"`, that are inputs.
    - `outputs`: functions `(system, t, y, mode, args)` by name, each of one number.

    **Returns** the path. A step that fails ends with an error, the log says why, and the unit stays
    at the communication point before it; in model exchange it asks for the end of the simulation.

    **Errors** `ValueError`/`TypeError` naming the argument; `ImportError` without `pythonfmu3`;
    `OSError` of the file system.
    """
    path = the_file("path", path)
    integrator = Integrator() if integrator is None else integrator
    check_type("integrator", integrator, Integrator, "an Integrator")
    inputs = check_type("inputs", inputs, list | tuple, "a list of names of numbers")
    functions = {_identifier(k): f for k, f in check_mapping("outputs", outputs).items()}
    leaves_of("args", args)
    system, t0 = the_system(system), a_time("t0", t0)
    y0, start = start_of(system, t0, y0, mode0, args)
    check_field(system, t0, y0, start, args)
    numbers, rest = eqx.partition((system, args), _is_real)
    values, numbers_from = ravel_pytree(jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), numbers))
    state, state_from = ravel_pytree(y0)
    parameters = dict(_parameters(system, args, numbers))
    for name in inputs:
        if not isinstance(name, str) or name not in parameters:
            raise refusal("inputs", name, f"among {', '.join(parameters) or 'no numbers at all'}")
    components = dict(_components(system, y0))
    for name, function in functions.items():
        call, given = "f(system, t, y, mode, args)", (system, t0, y0, start, args)
        check_callable(f"outputs[{name!r}]", function, call, *given)
        found = eqx.filter_eval_shape(function, *given)
        if not eqx.is_array_like(found) and getattr(found, "shape", None) != ():
            raise refusal(f"outputs[{name!r}]", found, "one number")
    names = [*components, *(f"der({name})" for name in components), *functions, *parameters]
    for name in names:
        if name in OWN or names.count(name) > 1:
            raise refusal("outputs", name, f"a name of its own, and none of {', '.join(OWN)}")
    chosen = -1 if mode0 is None else int(mode_index("mode0", system, mode0))

    def machine(numbers: Any) -> tuple[Any, Any]:
        return eqx.combine(numbers_from(numbers), rest)

    def step(numbers: Any, state: Any, mode: Any, t: Any, lasts: Any) -> dict[str, Any]:
        own, given = machine(numbers)
        y = state_from(state)
        run = simulate(own, t, t + lasts, y, mode, given, integrator=integrator, throw=False)
        log, last = run.events, jnp.maximum(run.events.count - 1, 0)
        return {
            "state": ravel_pytree(run.y1)[0], "mode": run.mode1, "result": run.result,
            "events": run.num_events, "flags": run.flags,
            "event_time": jnp.where(log.count > 0, log.t[last], jnp.nan),
        }  # fmt: skip

    def look(numbers: Any, state: Any, mode: Any, t: Any) -> dict[str, Any]:
        own, given = machine(numbers)
        y = state_from(state)
        return {
            "rates": ravel_pytree(own.vector_field(t, y, mode, given))[0],
            "guards": jnp.array(own.guards(t, y, mode, given), jnp.float64),
            "outputs": jnp.array([f(own, t, y, mode, given) for f in functions.values()], jnp.float64),
        }

    def change(numbers: Any, state: Any, mode: Any, t: Any, guard: Any) -> dict[str, Any]:
        """State and mode after a guard has fired; with the guard -1 the mode of the state."""
        own, given = machine(numbers)
        y = state_from(state)
        begins = own.initial_mode(t, y, given) if chosen < 0 else mode
        after = y, jnp.asarray(begins, mode.dtype)
        if own.guard_names:
            fired = own.transition(t, y, mode, jnp.maximum(guard, 0), given)
            after = select(guard >= 0, (fired[0], jnp.asarray(fired[1], mode.dtype)), after)
        return {"state": ravel_pytree(after[0])[0], "mode": after[1]}

    guard, number = jnp.zeros((), jnp.int32), jnp.zeros((), mode_type(system))
    at = (values, state, number, jnp.asarray(t0, jnp.float64))
    about = {
        "name": re.sub(r"\W", "_", type(system).__name__, flags=re.ASCII),
        "description": f"{type(system).__name__} of stickslip {__version__}, JAX {jax.__version__}",
        "second": second_of(system),
        "parameters": parameters,
        "values": values.tolist(),
        "inputs": list(inputs),
        "components": components,
        "rates": {name: per_second(unit) for name, unit in components.items()},
        "state": state.tolist(),
        "mode": chosen,
        "time": float(t0),
        "modes": list(system.mode_names) if len(system.mode_names) <= ACCURACY.named_modes else [],
        "guards": list(system.guard_names),
        "sides": [SIDES[word] for word in guard_directions(system)],
        "outputs": list(functions),
    }
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder)
        export(look, at, place / "look.zip")
        export(step, (*at, at[-1]), place / "step.zip")
        export(change, (*at, guard), place / "change.zip")
        (place / "about.json").write_text(json.dumps(about), encoding="utf-8")
        return _build(place, about["name"], path)


def _is_real(leaf: Any) -> bool:
    return eqx.is_inexact_array_like(leaf) and not np.iscomplexobj(leaf)


def _build(place: pathlib.Path, name: str, path: pathlib.Path) -> pathlib.Path:
    """The unit from its parts in a folder."""
    try:
        from pythonfmu3.builder import FmuBuilder
    except ImportError as error:
        raise ImportError("export_fmu needs pythonfmu3: pip install 'stickslip[fmu]'") from error
    parts = list(place.iterdir())
    # Python knows a module by its name: two units of one process must not have the same.
    digest = zlib.crc32(b"".join(part.read_bytes() for part in sorted(parts)))
    script = place / f"{name}_{digest:08x}.py"
    script.write_text(SCRIPT.format(name=name), encoding="utf-8")
    made = FmuBuilder.build_FMU(
        script, place / "made", parts, canHandleVariableCommunicationStepSize=True,
        canGetAndSetFMUState=True, canSerializeFMUState=True,
    )  # fmt: skip
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(made.read_bytes())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
    return path


def _components(system: AbstractHybridSystem, y: PyTree) -> Iterator[tuple[str, str | None]]:
    """Names and units of the numbers of a state, in the order in which it is flattened."""
    for name, leaf in components_of(y).items():
        for entry in _entries(_identifier(name), leaf):
            yield entry, unit_of(system, name)


def _parameters(system: Any, args: PyTree, numbers: PyTree) -> Iterator[tuple[str, str | None]]:
    """Names and units of the float numbers of a system and its `args`."""
    for keys, leaf in jax.tree.leaves_with_path(numbers):
        owner: Any = (system, args)[keys[0].idx]
        name, unit = ("system", "args")[keys[0].idx], None
        for key in keys[1:]:
            if isinstance(key, jax.tree_util.GetAttrKey):
                unit = units_of(owner).get(key.name)
                name, owner = f"{name}.{key.name}", getattr(owner, key.name, None)
            elif isinstance(key, jax.tree_util.SequenceKey):
                name = f"{name}[{key.idx}]"
                owner = owner[key.idx] if isinstance(owner, list | tuple) else None
            else:
                name = f"{name}.{_identifier(jax.tree_util.keystr((key,), simple=True))}"
                owner = owner[key.key] if isinstance(owner, Mapping) else None
        for entry in _entries(name, leaf):
            yield entry, unit


def _entries(name: str, leaf: Any) -> list[str]:
    return [entry.replace(", ", ",") for entry in entries(name, np.shape(leaf))]


def _identifier(name: str) -> str:
    """A name as FMI takes it: what is more than letters, digits and underscores in quotes."""
    if re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
        return name
    return "'" + re.sub(r"(['\\])", r"\\\1", name) + "'"
