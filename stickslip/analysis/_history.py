"""Time histories of any observables, their Poincaré points, and the energy ledger, with labels."""

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import PyTree

from .._jit_by_code import jit_by_code
from .._types import Given, Mode, Named, Row
from .._validation import check_count, check_mapping, check_type, refusal
from ..derived import WithIntegrals
from ..hybrid import AbstractHybridSystem, Integrator, SaveAt, Section, raise_failures, simulate
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.arguments import the_system
from ..hybrid.components import own_axes
from ..hybrid.tree import with_float_arrays
from ..sweep import Labels, Variable
from ._arguments import an_integrator, start_of
from ._builder import check_labels
from ._recording import Samples, samples_of
from .observable import (
    Angle,
    Maximum,
    Minimum,
    as_observable,
    as_section,
    axes_of,
    named_observables,
    shape_of,
)


def time_history(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    record: Given[Samples] | Row,
    observables: Given[str | Sequence[str] | Named],
    *,
    sections: Given[Mapping[str, Section | Maximum | Minimum] | None] = None,
    labels: Given[Labels | None] = None,
    mode0: Mode | None = None,
    args: PyTree = None,
    integrator: Given[Integrator | None] = None,
) -> xr.Dataset:
    r"""Observables of a motion at given times, and at the crossings of any number of sections.

    A phase portrait is one observable over another; a Poincaré section is any scalar of the motion.

    **Arguments**

    - `system`, `y0`, `mode0`, `args`, `integrator`: as for `simulate`.
    - `record`: the times [s], which increase; or `Samples(ts, transient)`, for a motion that starts
      before the first of them.
    - `observables`: names of components of the state, `"x[0]"` for one number of an array,
      `"slope of x"`, `"t"`, methods `(t, y, mode, args)` of the system; or a mapping from names to
      those or to functions `(system, t, y, dy, mode, args)`. A component with a period is given within
      half of it on both sides of zero.
    - `sections`: mapping from names to a `Section` (any scalar, direction in words), `Maximum("x")` or
      `Minimum("x")` of an observable. Crossings before the first time are left out.
    - `labels`: `Labels(variables={"x": Variable(units="m")}, attrs, name)`: units the system does not
      know, longer names, attributes and the title of the dataset.

    **Returns** an `xarray.Dataset`: each observable over `time`, `mode`, and for each section
    `at_<section>_<observable>` and `at_<section>_t` over `<section>_point`. `attrs["mode_names"]` names
    the modes; of a system with more than 1024 only those that occur, numbered in
    `attrs["mode_numbers"]`. A component that is an array has axes of its own after these, `x_0`, `x_1`,
    ... of `x` and of its slope, as in `Solution.to_dataset`; what a function gives, after its name.

    **Errors** `ValueError`/`TypeError` naming the argument; `SimulationError` where the motion fails.
    """
    the_system(system)
    record = samples_of(record)
    times = np.asarray(record.ts)
    y0, mode = start_of(system, record.t0, y0, mode0, args)
    integrator = an_integrator(integrator)
    sections = check_mapping("sections", sections)
    labels = check_type("labels", Labels() if labels is None else labels, Labels, "a Labels, or None")
    if labels.settings:
        raise refusal("labels.settings", labels.settings, "unset, which only a sweep has")
    variables, title = labels.variables or {}, {} if labels.name is None else {"title": labels.name}
    named = named_observables(observables)
    found = {k: as_observable(f"observables[{k!r}]", what, system, y0) for k, what in named.items()}
    for name, section in sections.items():
        what = "a Section, a Maximum or a Minimum"
        check_type(f"sections[{name!r}]", section, (Section, Maximum, Minimum), what)
    cuts = tuple(
        as_section(section, system, y0, f"sections[{name!r}]") for name, section in sections.items()
    )
    check_labels(variables, found)
    own = {
        k: axes_of(k, f, len(shape_of(f"observables[{k!r}]", named[k], f, system, y0, mode, args)))
        for k, (f, _) in found.items()
    }
    system, args = with_float_arrays((system, args))
    solution, *data = _run(
        system, y0, jnp.asarray(times), jnp.asarray(record.transient, jnp.float64), mode, args,
        integrator, cuts, record.max_points, tuple((k, f) for k, (f, _) in found.items()),
    )  # fmt: skip
    raise_failures(solution, solution.successful)
    values, mode, points = jax.tree.map(np.asarray, data)
    attrs: dict[str, dict[str, Any]] = {
        k: {"units": unit} if unit else {} for k, (_, unit) in found.items()
    }
    for k, (function, _) in found.items():
        if isinstance(function, Angle):
            attrs[k]["period"] = function.period
        attrs[k] |= variables.get(k, Variable()).attributes()
    second = _second(system)
    arrays: dict[str, Any] = {k: (("time", *own[k]), v, attrs[k]) for k, v in values.items()}
    arrays["mode"] = ("time", mode, {})
    for name, (when, at) in zip(sections, points, strict=True):
        # Sorted by time: what the log has room for beyond the crossings, and what is too early, goes.
        kept = np.isfinite(when) & (when >= times[0])
        arrays[f"at_{name}_t"] = (f"{name}_point", when[kept], second)
        for k, v in at.items():
            arrays[f"at_{name}_{k}"] = ((f"{name}_point", *own[k]), v[kept], attrs[k])
    about = {**_mode_names(system, mode), **title, **(labels.attrs or {})}
    return xr.Dataset(arrays, {"time": ("time", times, second)}, about)


def _mode_names(system: Any, mode: np.ndarray) -> dict[str, list]:
    names = system.mode_names
    if len(names) <= ENGINE.named_modes:
        return {"mode_names": list(names)}
    met = [int(number) for number in np.unique(mode) if number >= 0]
    return {"mode_numbers": met, "mode_names": [names[number] for number in met]}


@jit_by_code
def _run(system, y0, t, transient, mode0, args, integrator, cuts, max_crossings, functions):
    solution = simulate(
        system, t[0] - transient, t[-1], y0, mode0, args, integrator=integrator,
        saveat=SaveAt(ts=t, sections=cuts, max_events=None, max_crossings=max_crossings), throw=False,
    )  # fmt: skip

    def read(log):
        def values(t, y, dy, mode):
            return {k: f(system, t, y, dy, mode, args) for k, f in functions}

        return jax.vmap(values)(log.t, log.y, log.dy, log.mode)

    outputs = solution.outputs
    assert outputs is not None
    return solution, read(outputs), outputs.mode, [(log.t, read(log)) for log in solution.crossings]


def energy_ledger(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    record: Given[Samples] | Row,
    *,
    mode0: Mode | None = None,
    args: PyTree = None,
    integrator: Given[Integrator | None] = None,
    max_events: int = 4096,
) -> xr.Dataset:
    r"""Where the energy of a motion comes from and goes: powers, works and what is left over.

    $$E(t) - E(t_0) = \sum_i \int_{t_0}^t P_i\,dt + \sum_{\text{events}} \Delta E$$

    **Arguments**: as for `simulate`; `record` as for `time_history`, the account begins with the first
    of its times. The system must have `energy(y)` and `powers(t, y, mode, args)`, as an
    `AbstractMechanicalSystem` has.

    **Returns** an `xarray.Dataset` over `time`: `energy`, `power_<name>`, `work_<name>`,
    `loss_at_events` (the sum of $\Delta E$ so far), and `imbalance`, what the equation above leaves
    over: the error of the account. A power that is an array, as of many contacts, has axes of its own,
    `<name>_0`, ..., and its numbers are added up.

    **Errors** `TypeError` for a system without an account; else as `simulate`.
    """
    the_system(system)
    for method in ("energy", "powers"):
        if not callable(getattr(system, method, None)):
            raise refusal("system", system, f"a system with a method `{method}`", TypeError)
    record = samples_of(record)
    times = np.asarray(record.ts)
    y0, mode = start_of(system, record.t0, y0, mode0, args)
    check_count("max_events", max_events, 1)
    integrator = an_integrator(integrator)
    if record.transient > 0:
        early = simulate(
            system,
            record.t0,
            times[0],
            y0,
            mode,
            args,
            integrator=integrator,
            saveat=SaveAt(max_events=None),
        )
        y0, mode = early.y1, early.mode1
    system, args = with_float_arrays((system, args))
    solution, *data = _account(system, y0, jnp.asarray(times), mode, args, integrator, max_events)
    raise_failures(solution, solution.successful)
    energy, powers, works, when, jumps = jax.tree.map(np.asarray, data)
    jumps = np.where(np.isfinite(when), jumps, 0.0)
    # An event at an output time is taken before the output.
    counted = np.where(np.isfinite(when), when, np.inf)[None, :] <= times[:, None]
    lost = (counted * jumps[None, :]).sum(axis=1)
    second = _second(system)
    joule, watt = ({"units": "J"}, {"units": "W"}) if second["units"] == "s" else (second, second)
    whole = sum(v.reshape(times.size, -1).sum(axis=1) for v in works.values())
    imbalance = energy - energy[0] - whole - lost
    rows = {k: ("time", *own_axes(k, v.ndim - 1)) for k, v in powers.items()}
    return xr.Dataset(
        {
            "energy": ("time", energy, joule),
            **{f"power_{k}": (rows[k], v, watt) for k, v in powers.items()},
            **{f"work_{k}": (rows[k], v, joule) for k, v in works.items()},
            "loss_at_events": ("time", lost, joule),
            "imbalance": ("time", imbalance, joule),
        },
        {"time": ("time", times, second)},
    )


@jit_by_code
def _account(system, y0, t, mode0, args, integrator, max_events):
    ledger = WithIntegrals(system, _powers)
    solution = simulate(
        ledger, t[0], t[-1], ledger.start(y0, t[0], args), mode0, args,
        integrator=integrator, saveat=SaveAt(ts=t, max_events=max_events), throw=False,
    )  # fmt: skip
    log, events = solution.outputs, solution.events
    assert log is not None
    assert events is not None
    energy = jax.vmap(system.energy)
    powers = jax.vmap(lambda t, y, mode: system.powers(t, y, mode, args))(log.t, log.y.y, log.mode)
    jumps = energy(events.y_after.y) - energy(events.y_before.y)
    return solution, energy(log.y.y), powers, log.y.integrals, events.t, jumps


def _powers(system, t, y, mode, args):
    return system.powers(t, y, mode, args)


def _second(system: AbstractHybridSystem) -> dict[str, str]:
    """Attributes of a time."""
    return {"units": "1" if getattr(system, "is_dimensionless", False) else "s"}
