"""The public callables, and which of them take no arguments of users, with the reason."""

import importlib
import inspect
from typing import Any

PACKAGES = (
    "stickslip", "stickslip.friction", "stickslip.contact", "stickslip.systems", "stickslip.sweep",
    "stickslip.derived", "stickslip.structure", "stickslip.control", "stickslip.estimation",
    "stickslip.basin",
    "stickslip.analysis", "stickslip.continuation", "stickslip.identification", "stickslip.hybrid",
    "stickslip.plot",
    "corexy_jax", "corexy_jax.elastic",
)  # fmt: skip
RETURNED = "returned to users, not made by them"
EXEMPT = {
    "Solution": RETURNED,
    "PeriodicOrbit": RETURNED,
    "Branch": RETURNED,
    "BranchPoint": RETURNED,
    "Equilibrium": RETURNED,
    "ForcedResponse": RETURNED,
    "FrequencyResponse": RETURNED,
    "Backbone": RETURNED,
    "EventLog": RETURNED,
    "StateLog": RETURNED,
    "Held": RETURNED,
    "Resolution": RETURNED,
    "LyapunovSpectrum": RETURNED,
    "Spectrum": RETURNED,
    "Separation": RETURNED,
    "Fit": RETURNED,
    "Simulation": RETURNED,
    "Sensitivity": RETURNED,
    "Profile": RETURNED,
    "Posterior": RETURNED,
    "Correlation": RETURNED,
    "LjungBox": RETURNED,
    "Comparison": RETURNED,
    "Prediction": RETURNED,
    "Score": RETURNED,
    "RecordSummary": RETURNED,
    "Report": RETURNED,
    "CoreXYSolution": RETURNED,
    "InputDesign": RETURNED,
    "Filtered": RETURNED,
    "StateEstimate": RETURNED,
    "Feedforward": RETURNED,
    "Trajectory": RETURNED,
    "RollingCheck": RETURNED,
    "current_executor": "takes nothing",
    "code_revision": "takes nothing",
    "versions": "takes nothing",
    "desktop_printer": "takes nothing",
    "as_json": "takes anything",
    **dict.fromkeys(
        ("positive_part", "absolute", "saturate", "backlash", "dead_band"),
        "what an author calls in a field, inside of programs",
    ),
}
# Arguments of a callable that no template has to give.
ELSEWHERE = {
    "self": "what the method belongs to",
    "cls": "what the method belongs to",
    "options": "each option is an argument of its own in the template",
    "changes": "each parameter is an argument of its own in the template of the class",
    "sweep": "each option is an argument of its own in the template",
    "values of CoreXYParameters": "each parameter is an argument of its own in the template",
}

OURS = ("stickslip", "corexy_jax")
CALLED_BY_ENGINE = "what an author writes and the engine calls, inside of its programs"
BUILT_BY_ENGINE = "what the engine asks its own parts, inside of its programs"
# Public methods that are not fed nonsense, by name or by class and name.
EXEMPT_METHODS = {
    **dict.fromkeys(
        (
            "vector_field", "guards", "transition", "inner", "time_scale", "check_start",
            "constraints", "held_state", "mass_matrix", "switches", "switches_in",
            "forces", "contacts", "gaps", "potential_energy", "rates", "HarmonicForce.__call__",
            "Jenkins.bounds", "LinearStructure.initial_mode",
            "PID.__call__", "Cascade.__call__", "ResetPID.__call__",
            "FrictionFeedforward.__call__", "DisturbanceObserver.__call__",
            "InputShaper.__call__", "Trajectory.__call__", "FirstOrderHold.__call__",
            "AxisShapers.__call__",
        ),
        CALLED_BY_ENGINE,
    ),
    **dict.fromkeys(
        (
            "declared_power", "smooth_powers", "from_coordinates", "to_coordinates",
            "AbstractWithObservables.instant", "AbstractWithObservables.drives_of_stops",
            "AbstractDeclaration.states", "AbstractDeclaration.mode_of",
            "AbstractMechanism.motion_together",
        ),
        "parts of a machine's vector field, called inside of its programs",
    ),
    "AbstractSmoothSystem.initial_mode": "there is one mode, whatever is given",
    "AbstractSystemWrapper.initial_mode": "takes what the author's `inner` takes",
    **dict.fromkeys(
        (
            "Section.uses_slope", "AdaptiveStep.factor", "AdaptiveStep.initial", "FixedStep.initial",
            "AbstractStepper.step_and_look", "AbstractStepper.solved_to", "AbstractStepper.vjp",
            "ProgressMeter.report", "Executor.trace_once",
        ),
        BUILT_BY_ENGINE,
    ),
    **dict.fromkeys(
        (
            "CoreXY.carriage_rests", "CoreXY.dmn", "CoreXY.energy", "CoreXY.initial_mode",
            "CoreXY.line_drive", "CoreXY.line_velocities", "CoreXY.mode_of", "CoreXY.motion_together",
            "Stepper.__call__", "DCMotors.__call__",
            "CoreXY.powers", "CoreXY.slips", "CoreXY.states", "CoreXY.torques",
        ),
        "parts of the machine's vector field, called inside of its programs",
    ),
    **dict.fromkeys(
        (
            "AbstractMechanism.bristles", "AbstractDeclaration.state", "CoreXY.state",
            "RegularisedMechanism.state",
        ),
        "has a template with the constructors",
    ),
    **dict.fromkeys(
        (
            "AbstractMethod.check_run", "AbstractMethod.many_near", "AbstractIterativeMethod.solve",
            "AbstractIterativeMethod.brought_near", "AbstractIterativeMethod.many_near",
            "MultipleShooting.check_run", "AbstractGaussNewton.begin",
            "AbstractGaussNewton.advance", "AbstractGaussNewton.finish",
            "GradientDescent.begin", "GradientDescent.advance", "GradientDescent.finish",
            "MultipleShooting.brought_near", "Homotopy.brought_near", "Homotopy.many_near",
            "KalmanFilter.rows",
        ),
        "steps of a method, called inside of the programs of fits",
    ),
    **dict.fromkeys(
        ("PeriodicOrbit.columns", "Equilibrium.columns"),
        "parts of `Branch.to_dataset`, which has a template",
    ),
    **dict.fromkeys(
        ("Follow.values_by_parameter", "Shooting.integrator_or"),
        "read by the verbs that take the settings",
    ),
    **dict.fromkeys(
        ("Block.read", "Belt.read", "Wall.read", "_LineBetween.read", "Pendulum.read"),
        "parts of a drawing, asked by `animate`, which has a template",
    ),
    "map_lanes.__call__": "has a template with the constructors",
    "load.__call__": "takes what the file names",
}  # fmt: skip


def methods_of(cls: type) -> dict[str, Any]:
    """Public methods that take something, of a class of ours, by the name of the definition."""
    found = {}
    for part in dir(cls):
        if part.startswith("_") and part != "__call__":
            continue
        owner = next((c for c in cls.__mro__ if part in vars(c)), None)
        method = vars(owner).get(part) if owner else None
        method = getattr(method, "method", method)  # equinox wraps what modules define
        ours = owner is not None and owner.__module__.split(".")[0] in OURS
        if not ours or not inspect.isfunction(method) or getattr(method, "__isabstractmethod__", False):
            continue
        name = f"{owner.__name__}.{part}"
        if {part, name} & EXEMPT_METHODS.keys() or len(inspect.signature(method).parameters) < 2:
            continue
        found[name] = method
    return found


def public_methods() -> dict[str, Any]:
    """Those of all classes that the packages export."""
    found = {}
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in getattr(module, "__all__", dir(module)):
            thing = getattr(module, name)
            if not name.startswith("_") and inspect.isclass(thing):
                found |= methods_of(thing)
    return found


def exempt(thing: Any) -> str | None:
    """Why a public object needs no template."""
    if not inspect.isclass(thing):
        return EXEMPT.get(thing.__name__)
    if issubclass(thing, BaseException):
        return "raised, not called"
    if thing.__name__ in ("RESULTS", "ORBITS"):
        return "an enumeration"
    if hasattr(thing, "_fields"):
        return "a named tuple of whatever is traced; looked at by whoever is given it"
    if thing.__name__.startswith("Abstract"):
        return "abstract: cannot be made"
    return EXEMPT.get(thing.__name__)


def public_callables() -> dict[str, Any]:
    """Everything that the packages export and that can be called, with the class and static methods of
    classes, by qualified name."""
    found = {}
    for package in PACKAGES:
        module = importlib.import_module(package)
        # `__all__` knows also what is imported when it is first asked for.
        for name in getattr(module, "__all__", dir(module)):
            thing = getattr(module, name)
            if name.startswith("_") or inspect.ismodule(thing) or not hasattr(thing, "__qualname__"):
                continue
            if not callable(thing) or exempt(thing):
                continue
            found[thing.__qualname__] = thing
            for part, method in inspect.getmembers(thing) if inspect.isclass(thing) else ():
                kind = inspect.getattr_static(thing, part)
                if isinstance(kind, classmethod | staticmethod) and not part.startswith("_"):
                    found[f"{thing.__qualname__}.{part}"] = method
    return found


def arguments_of(name: str, thing: Any) -> set[str]:
    """Names of the arguments that a template must give."""
    parameters = set(inspect.signature(thing).parameters)
    return {p for p in parameters if p not in ELSEWHERE and f"{p} of {name}" not in ELSEWHERE}
