"""Public signatures say what is allowed: no parameter is `Any`, or nothing, without a reason."""

import importlib
import inspect
from typing import Any

import pytest

from stickslip._types import Given
from tests.house._nonsense_public import OURS, PACKAGES

LINES = "properties of a line, which are matplotlib's to check"
RESULT = "an item of RESULTS, whose class equinox keeps to itself"
# Parameters that may be `Any`, as module.callable.parameter; the module may stand alone.
REASONS = {
    "corexy_jax._simulate.simulate.options": "those of the three ways to simulate",
    "corexy_jax._solution.CoreXYSolution.result": RESULT,
    "stickslip.hybrid._solution.Solution.result": RESULT,
    "stickslip.analysis._growth.LyapunovSpectrum.result": RESULT,
    "stickslip.analysis._lyapunov_diagram.lyapunov_diagram.sweep": "the settings of run_sweep",
    "stickslip.analysis._orbit_diagram.orbit_diagram.sweep": "the settings of run_sweep",
    "stickslip.identification._record.Record.from_table.options": "the options of Record",
    "stickslip.identification._record.Record.from_table.table": "what gives columns by name",
    "stickslip.continuation._orbit.PeriodicOrbit.result": RESULT,
    "stickslip.estimation._kalman_filter.Filtered.result": RESULT,
    "stickslip.continuation._orbit.PeriodicOrbit.simulation": RESULT,
    "stickslip.continuation._forced_response.ForcedResponse.result": RESULT,
    "stickslip.plot._basins.basins.options": LINES,
    "stickslip.plot._basins.shares.options": LINES,
    "stickslip.plot._branch.branch.options": LINES,
    "stickslip.plot._frequency_response.backbone.options": LINES,
    "stickslip.plot._frequency_response.frequency_response.options": LINES,
    "stickslip.plot._energy_account.energy_account.options": LINES,
    "stickslip.plot._exponents.exponents.options": LINES,
    "stickslip.plot._fit.fit.options": LINES,
    "stickslip.plot._hunting.hunting.options": LINES,
    "stickslip.plot._motion.motion.options": LINES,
    "stickslip.plot._multipliers.multipliers.options": LINES,
    "stickslip.plot._orbit.orbit.options": LINES,
    "stickslip.plot._orbit_diagram.orbit_diagram.options": LINES,
    "stickslip.plot._phase_plane.phase_plane.options": LINES,
    "stickslip.plot._prediction.prediction.options": LINES,
    "stickslip.plot._spectrum.spectrum.options": LINES,
    "stickslip.sweep.settings.Compute.client": "a class of a package that may be absent",
    "stickslip.sweep._manifest.as_json.value": "anything, of which it says what it is",
    "stickslip.systems._drive_voltage.voltage_for_belt_speed.options": "those of mean_belt_speed",
}


def says_nothing(annotation: Any) -> bool:
    """Whether an annotation is absent or `Any`, bare or as `Given[Any]`."""
    empty = annotation in (inspect.Parameter.empty, Any, "Any", Given)
    return empty or getattr(annotation, "allowed", None) in (Any, "Any")


def inherited(cls: type | None, name: str, at: int) -> Any:
    """Annotation of the same parameter, by its place, in the class that first says what it is."""
    for base in cls.__mro__[1:] if cls else ():
        method = vars(base).get(name)
        method = getattr(method, "method", method)  # equinox wraps what modules define
        if inspect.isfunction(method):
            parameters = list(inspect.signature(method).parameters.values())
            if at < len(parameters) and not says_nothing(parameters[at].annotation):
                return parameters[at].annotation
    return inspect.Parameter.empty


def silent(function: Any, where: str, cls: type | None = None) -> list[str]:
    """Parameters of a callable about which neither it nor a base class says anything."""
    found = []
    for at, parameter in enumerate(inspect.signature(function).parameters.values()):
        if parameter.name in ("self", "cls") or not says_nothing(parameter.annotation):
            continue
        if says_nothing(inherited(cls, where.rsplit(".", 1)[1], at)):
            found.append(f"{where}.{parameter.name}")
    return found


def of_class(cls: type) -> list[str]:
    """Those of the constructor and of the public methods that a class of ours has."""
    # Named tuples are pytrees, into whose leaves JAX puts numbers, arrays, tolerances, axes.
    if issubclass(cls, BaseException) or hasattr(cls, "_fields"):
        return []
    found = silent(cls, f"{cls.__module__}.{cls.__name__}")
    for part in dir(cls):
        owner = next((c for c in cls.__mro__ if part in vars(c)), None)
        if (part.startswith("_") and part != "__call__") or owner is None:
            continue
        thing = vars(owner)[part]
        thing = getattr(thing, "__func__", getattr(thing, "method", thing))
        if owner.__module__.split(".")[0] in OURS and inspect.isfunction(thing):
            found += silent(thing, f"{owner.__module__}.{owner.__name__}.{part}", owner)
    return found


def public_things() -> list[Any]:
    """Functions and classes of ours that the packages export."""
    found = {}
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in getattr(module, "__all__", dir(module)):
            thing = getattr(module, name)
            ours = (getattr(thing, "__module__", None) or "").split(".")[0] in OURS
            if not name.startswith("_") and ours and hasattr(thing, "__qualname__"):
                found[f"{thing.__module__}.{thing.__qualname__}"] = thing
    return list(found.values())


def complaints(things: list[Any]) -> set[str]:
    """Parameters about which a signature says nothing."""
    return {
        name
        for thing in things
        for name in (
            of_class(thing)
            if inspect.isclass(thing)
            else silent(thing, f"{thing.__module__}.{thing.__qualname__}")
        )
    }


def reason(name: str) -> str | None:
    """The entry of `REASONS` that a parameter falls under."""
    return next((key for key in REASONS if name == key or name.startswith(f"{key}.")), None)


def test_public_signatures_say_what_is_allowed():
    found = complaints(public_things())
    assert {name for name in found if reason(name) is None} == set()
    # Nothing stands in the table that needs no excuse.
    assert set(REASONS) == {reason(name) for name in found}


@pytest.mark.parametrize("annotation", [Any, inspect.Parameter.empty, "Any", Given, Given[Any]])
def test_signatures_that_say_nothing_are_seen(annotation):
    def function(x):
        """Takes anything."""

    function.__annotations__ = {} if annotation is inspect.Parameter.empty else {"x": annotation}
    assert complaints([function]) == {f"{__name__}.{function.__qualname__}.x"}


def test_what_a_base_class_says_holds_for_its_heirs():
    class Base:
        def method(self, x: int, y): ...

    class Heir(Base):
        def method(self, x, y): ...

    where = f"{__name__}.Heir.method"
    assert silent(Heir.method, where, Heir) == [f"{where}.y"]
