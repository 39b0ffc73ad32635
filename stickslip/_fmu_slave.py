"""What runs inside a functional mock-up unit of `export_fmu`; `pythonfmu3` calls it."""

import json
import math
import pathlib
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from pythonfmu3 import (
    CoSimulation,
    Float64,
    Fmi3Causality,
    Fmi3Initial,
    Fmi3SlaveBase,
    Fmi3Status,
    Fmi3StepResult,
    Fmi3Variability,
    Int64,
    ModelExchange,
    Unit,
)
from pythonfmu3.modelexchange import Fmi3UpdateDiscreteStatesResult

from ._export import load
from .hybrid import RESULTS

PROGRAMS = ("look", "step", "change")


class Machine(Fmi3SlaveBase, ModelExchange, CoSimulation):
    """A machine as FMI 3.0 asks for it: its variables, its steps, its rates, guards and transitions.

    All that changes is in `now`, numbers that JSON can hold, so that a tool can keep and restore it.

    Nothing is raised after the constructor: the library that calls gives up its references twice then,
    and the process ends in a later collection of garbage. What fails is said by the status and the log.
    """

    def __init__(self, **kwargs: Any):
        super().__init__(**kwargs)
        self._folder = pathlib.Path(str(self.resources))
        self._about = about = json.loads((self._folder / "about.json").read_text(encoding="utf-8"))
        self._programs = {name: load(self._folder / f"{name}.zip") for name in PROGRAMS}
        self._failure: str | None = None
        self._seen: tuple[Any, Any] = (None, None)
        self.description = about["description"]
        self.time = about["time"]
        self.now: dict[str, Any] = {
            "values": about["values"],
            "state": about["state"],
            "mode": about["mode"],
            "sides": about["sides"],
            "highest": [0.0] * len(about["sides"]),
            "events": 0,
            "event_time": math.nan,
            "flags": 0,
        }
        self._register()

    def _register(self) -> None:
        about, continuous = self._about, Fmi3Variability.continuous
        every = [*about["parameters"].values(), *about["components"].values(), *about["rates"].values()]
        self.register_units([Unit(name) for name in dict.fromkeys([about["second"], *every]) if name])

        def number(name: str, unit: str | None, read: Any, write: Any = None, **about: Any) -> None:
            made = Float64(name, unit=unit, getter=read, setter=write or self._kept, **about)
            self.register_variable(made, nested=False)

        second = about["second"]
        number("time", second, lambda: self.time, self.set_time,
               causality=Fmi3Causality.independent, variability=continuous)  # fmt: skip
        first = len(self.vars)
        for i, (name, unit) in enumerate(about["components"].items()):
            number(name, unit, *self._place("state", i), causality=Fmi3Causality.output,
                   variability=continuous, initial=Fmi3Initial.exact)  # fmt: skip
        for i, (name, unit) in enumerate(about["rates"].items()):
            number(f"der({name})", unit, lambda i=i: self._look()["rates"][i], derivative=first + i,
                   causality=Fmi3Causality.local, variability=continuous)  # fmt: skip
        for i, (name, unit) in enumerate(about["parameters"].items()):
            if name in about["inputs"]:
                kind = {"causality": Fmi3Causality.input, "variability": continuous}
            else:
                kind = {"causality": Fmi3Causality.parameter, "variability": Fmi3Variability.tunable}
            number(name, unit, *self._place("values", i), **kind)
        for i, name in enumerate(about["outputs"]):
            number(name, None, lambda i=i: self._look()["outputs"][i],
                   causality=Fmi3Causality.output, variability=continuous)  # fmt: skip
        for i, name in enumerate(about["guards"]):
            number(f"guards[{i}]", None, lambda i=i: self.get_event_indicators()[i], description=name,
                   causality=Fmi3Causality.local, variability=continuous)  # fmt: skip
            self.register_event_indicator(len(self.vars) - 1)
        modes = ", ".join(f"{i}: {name}" for i, name in enumerate(about["modes"]))
        for name, text in (("mode", modes), ("events", "so far"), ("flags", "of all steps")):
            kind = {"causality": Fmi3Causality.output, "variability": Fmi3Variability.discrete}
            read = partial(self._whole, name)
            made = Int64(name, getter=read, setter=self._kept, description=text, **kind)
            self.register_variable(made, nested=False)
        number("event_time", second, lambda: self.now["event_time"], description="of the last event",
               causality=Fmi3Causality.output, variability=Fmi3Variability.discrete)  # fmt: skip

    def _place(self, part: str, i: int) -> tuple[Any, Any]:
        def write(value: float) -> None:
            changed = list(self.now[part])
            changed[i] = float(value)
            self.now[part] = changed

        return lambda: self.now[part][i], write

    def _whole(self, name: str) -> int:
        return int(self.now[name])

    def _kept(self, value: Any) -> None:
        self.log("An output cannot be set: it stays what it is.", Fmi3Status.error)

    def _run(self, name: str, *more: Any, mode: int | None = None) -> dict[str, Any]:
        now, mode = self.now, self.now["mode"] if mode is None else mode
        given = np.asarray(now["values"]), np.asarray(now["state"]), mode, self.time
        return self._programs[name](*given, *more)

    def _look(self) -> dict[str, list]:
        """Rates, guards and outputs of where the machine is."""
        here = (self.now["values"], self.now["state"], self.now["mode"], self.time)
        if self._seen[0] != here:
            # A tool may read outputs before the start, when the mode is still that of the state.
            mode = self.now["mode"] if self.now["mode"] >= 0 else int(self._run("change", -1)["mode"])
            found = self._run("look", mode=mode)
            self._seen = here, {k: np.asarray(v).tolist() for k, v in found.items()}
        return self._seen[1]

    def _step(self, lasts: float) -> None:
        """Go on for a time, or to the end of what happens at this instant."""
        found = self._run("step", lasts)
        result = self._programs["step"].words["result"][int(found["result"])]
        if result != "successful":
            raise _Failure(getattr(RESULTS, result))
        self.now["state"] = np.asarray(found["state"]).tolist()
        self.now["mode"] = int(found["mode"])
        self.now["flags"] |= int(found["flags"])
        if int(found["events"]):
            self.now["events"] += int(found["events"])
            self.now["event_time"] = float(found["event_time"])

    def _change(self, guard: int) -> None:
        """The transition of a guard; with -1 into the mode of the state."""
        found = self._run("change", guard)
        if int(found["mode"]) < 0:
            raise _Failure(RESULTS.no_admissible_mode)
        self.now["state"] = np.asarray(found["state"]).tolist()
        self.now["mode"] = int(found["mode"])

    def _goes(self, do: Callable[[], None]) -> bool:
        """Whether what is done succeeds; what stands against it goes to the log, and stays."""
        if self._failure is None:
            try:
                do()
            except _Failure as failure:
                self._failure = f"{failure.result} at {self.time} s. {RESULTS[failure.result]}"
            except Exception as error:
                self._failure = f"{type(error).__name__} at {self.time} s. {error}"
        if self._failure is not None:
            self.log(self._failure, Fmi3Status.error)
        return self._failure is None

    # -- of both kinds

    def setup_experiment(self, start_time: float) -> None:
        self.time = start_time

    def exit_initialization_mode(self) -> None:
        self._goes(self._begin)

    def _begin(self) -> None:
        if self.now["mode"] < 0:
            self._change(-1)
        self._step(0.0)

    def _get_fmu_state(self) -> dict[str, Any]:
        return {**self.now, "time": self.time}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self.time = state["time"]
        self.now = {name: state[name] for name in self.now}
        self._failure = None

    # -- co-simulation

    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        self.time = current_time
        if not self._goes(lambda: self._step(step_size)):
            return Fmi3StepResult(status=Fmi3Status.error)
        self.time = current_time + step_size
        return Fmi3StepResult()

    # -- model exchange

    def get_continuous_state_derivatives(self) -> list[float]:
        return self._look()["rates"]

    def get_event_indicators(self) -> list[float]:
        """The guards, positive inside their modes; of one that fires both ways, its own value."""
        self._inside()
        fixed, guards = self._about["sides"], self._look()["guards"]
        return [-g if side < 0 else g for side, g in zip(fixed, guards, strict=True)]

    def _inside(self) -> list[float]:
        """How far each guard is inside of its mode; the farthest so far is remembered."""
        now, guards = self.now, self._look()["guards"]
        now["sides"] = [s or _sign(g) for s, g in zip(now["sides"], guards, strict=True)]
        inside = [s * g for s, g in zip(now["sides"], guards, strict=True)]
        now["highest"] = list(map(max, now["highest"], inside))
        return inside

    def update_discrete_states(self) -> Fmi3UpdateDiscreteStatesResult:
        """The transition of a guard that has left its mode, if there is one.

        A guard that is zero as its mode begins, as the sliding speed of what starts to slide, has
        not been inside yet and does not fire; what is outside beyond rounding fires all the same.
        """
        before = self.now["events"], self.now["state"]
        going = self._goes(self._fire)
        after = self.now["events"], self.now["state"]
        return Fmi3UpdateDiscreteStatesResult(
            discreteStateNeedsUpdate=going and after[0] != before[0],
            valuesOfContinuousStatesChanged=after[1] != before[1],
            terminateSimulation=not going,
        )

    def _fire(self) -> None:
        inside, highest = self._inside(), self.now["highest"]
        fired = [i for i, value in enumerate(inside) if value <= 0.0 < highest[i]]
        if fired:
            first = min(fired, key=inside.__getitem__)
            self.now["events"] += 1
            self.now["event_time"] = self.time
            if not self._about["sides"][first]:
                self.now["sides"][first] *= -1
            self._change(first)
        self._step(0.0)
        self.now["highest"] = [0.0] * len(inside)
        self._inside()


class _Failure(Exception):
    """A run that ends with a result other than success."""

    def __init__(self, result: Any):
        self.result = result


def _sign(value: float) -> int:
    return (value > 0.0) - (value < 0.0)
