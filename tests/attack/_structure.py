"""A machine as text: what a draw declares, the source of its class, and its runs.

All expressions are texts over `t`, coordinates `x`, velocities `v_x`, states of first order and the
names of parameters. The class is made from them, and the reference evaluates the same texts in Python.
"""

import linecache
import re
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.hybrid import Pieced
from stickslip.mechanism import BristleState

Dimension = tuple[int, int, int]  # exponents of length, force and time
HEAD = """from typing import Any, ClassVar
import jax.numpy as jnp
import stickslip as ss
from jax.numpy import abs, clip, cos, exp, maximum, minimum, mod, sin, sqrt, tanh, where
from stickslip.friction import Asymmetric, Coulomb, HyperbolicWeakening, LuGre, Stribeck, Sum
from stickslip.friction import ViscousDamping, ViscousFriction
from stickslip.mechanism import AbstractMechanism, Contact, Stop
"""


@dataclass(frozen=True)
class Parameter:
    """Its dimension, range, whether it may have either sign or be zero, and where it is declared.

    `where`: "field", "args" or "default" (args with a default, `default`, for `args=None`).
    """

    dimension: Dimension
    low: float
    high: float
    signed: bool = False
    zero: bool = False
    where: str = "field"
    default: float = 0.0


@dataclass(frozen=True)
class Touch:
    """A dry contact: its row by coordinate, `fixed` if it is declared beside the coordinates."""

    name: str
    row: dict[str, str]
    fixed: bool
    law: str
    normal: str | None = None
    surface: str | None = None
    opens: bool = False
    push: dict[str, str] | None = None


@dataclass(frozen=True)
class Wall:
    """A rigid stop."""

    name: str
    gap: str
    restitution: str
    rest_speed: str


@dataclass(frozen=True)
class Structure:
    """Everything of a machine but its numbers.

    `coordinates`: their kinds, "m" or "rad". `mass`: entries by pair, the upper triangle. `forces`:
    pairs of a coordinate and a term. `states`: first-order states, their dimension and rate.
    `breaks`: times at which loads jump, `period` with which they recur.
    `form`: "" or the call that makes a smooth one.
    """

    coordinates: dict[str, str]
    mass: dict[tuple[str, str], str]
    forces: tuple[tuple[str, str], ...] = ()
    contacts: tuple[Touch, ...] = ()
    stops: tuple[Wall, ...] = ()
    states: dict[str, tuple[Dimension, str]] = field(default_factory=dict)
    cyclic: tuple[str, ...] = ()
    breaks: tuple[str, ...] = ()
    period: str | None = None
    time_scale: str | None = None
    form: str = ""
    parameters: dict[str, Parameter] = field(default_factory=dict)
    style: str = "mapping"

    @property
    def components(self) -> list[str]:
        """Those of the state, in order."""
        kept = [c for c in self.coordinates if c not in self.cyclic]
        return [*kept, *self.states, *(f"v_{c}" for c in self.coordinates)]

    @property
    def texts(self) -> list[str]:
        """All expressions."""
        found = [*self.mass.values(), *(term for _, term in self.forces), *self.breaks, self.form]
        found += [x for x in (self.period, self.time_scale) if x]
        found += [rate for _, rate in self.states.values()]
        for c in self.contacts:
            found += [*c.row.values(), c.law, c.normal or "", c.surface or "", *(c.push or {}).values()]
        for s in self.stops:
            found += [s.gap, s.restitution, s.rest_speed]
        return found

    @property
    def used(self) -> set[str]:
        """Names in all expressions."""
        return {name for text in self.texts for name in words(text)}

    def pruned(self) -> "Structure":
        """Without parameters that nothing uses."""
        used = self.used
        kept = {name: p for name, p in self.parameters.items() if name in used}
        return replace(self, parameters=kept)


class Numbers(NamedTuple):
    """Values of the parameters and of the start by name, and the end of the run [s]."""

    values: dict[str, float]
    start: dict[str, float]
    end: float


class Outcome(NamedTuple):
    """States at the output times `[time, component]` (NaN where not reached), and the verdict."""

    y: np.ndarray
    t1: float
    result: str
    flags: int
    sequence: int


def words(text: str) -> set[str]:
    return set(re.findall(r"[A-Za-z_]\w*", text))


def dimension_of(structure: Structure, component: str) -> Dimension:
    """Of a component of the state."""
    if component in structure.states:
        return structure.states[component][0]
    rate = component.startswith("v_")
    kind = structure.coordinates[component.removeprefix("v_")]
    return (1 if kind == "m" else 0, 0, -1 if rate else 0)


def _method(structure: Structure, head: str, body: str) -> list[str]:
    used, q, v = words(body), (*structure.coordinates, *structure.states), structure.coordinates
    pairs = [(name, f"q.{name}") for name in q if name in used and name not in structure.cyclic]
    pairs += [(f"v_{name}", f"v.{name}") for name in v if f"v_{name}" in used]
    for name, p in structure.parameters.items():
        if name in used:
            given = f"args[{name!r}]"
            guarded = f"{p.default!r} if args is None else {given}"
            pairs.append((name, {"field": f"self.{name}", "args": given}.get(p.where, guarded)))
    lines = [f"        {name} = {value}" for name, value in pairs]
    return [f"    def {head}:", *lines, f"        return {body}"]


def _row(row: dict[str, str]) -> str:
    return "{" + ", ".join(f"{c!r}: {x}" for c, x in row.items()) + "}"


def source(structure: Structure) -> str:
    """The class, as a user would write it."""
    s = structure
    lines = ["class Machine(AbstractMechanism):"]
    lines += [f"    {name}: Any" for name, p in s.parameters.items() if p.where == "field"]
    lines.append(f"    coordinates: ClassVar = {s.coordinates}")
    rows = {c.name: c.row if c.fixed else None for c in s.contacts}
    given = ", ".join(f"{n!r}: {'None' if r is None else _row(r)}" for n, r in rows.items())
    lines.append(f"    contact_directions: ClassVar = {{{given}}}")
    if s.states:
        lines.append(f"    first_order: ClassVar = {dict.fromkeys(s.states, '1')}")
    if s.cyclic:
        lines.append(f"    cyclic: ClassVar = {s.cyclic}")
    angles = [c for c, kind in s.coordinates.items() if kind == "rad" and c not in s.cyclic]
    if angles and s.style != "tuple":
        lines.append(f"    periods: ClassVar = {dict.fromkeys(angles, 6.283185307179586)}")
    if any(c.opens for c in s.contacts):
        lines.append(f"    opening: ClassVar = {tuple(c.name for c in s.contacts if c.opens)}")
    if s.stops:
        lines.append(f"    stops: ClassVar = {tuple(w.name for w in s.stops)}")
    lines += _method(s, "mass_matrix(self, q)", _mass(s))
    parts: dict[str, list[str]] = {c: [] for c in s.coordinates}
    for c, term in s.forces:
        parts[c].append(term)
    sums = {c: " + ".join(terms) for c, terms in parts.items() if terms}
    body = _row(sums)
    if s.style == "tuple":
        body = "(" + ", ".join(sums.get(c, "0.0") for c in s.coordinates) + ",)"
    lines += _method(s, "forces(self, t, q, v, args)", body)
    if s.contacts:
        entries = [f"{c.name!r}: {_contact(c)}" for c in s.contacts]
        lines += _method(s, "contacts(self, t, q, v, args)", "{" + ", ".join(entries) + "}")
    if s.stops:
        entries = [f"{w.name!r}: Stop({w.gap}, {w.restitution}, {w.rest_speed})" for w in s.stops]
        lines += _method(s, "gaps(self, t, q, args)", "{" + ", ".join(entries) + "}")
    if s.states:
        rates = _row({name: rate for name, (_, rate) in s.states.items()})
        lines += _method(s, "rates(self, t, q, v, args)", rates)
    if s.time_scale:
        lines += _method(s, "time_scale(self, args)", s.time_scale)
    return "\n".join(lines) + "\n"


def _mass(s: Structure) -> str:
    names = list(s.coordinates)
    if all(a == b for a, b in s.mass):
        return _row({a: x for (a, _), x in s.mass.items()})

    def entry(a: str, b: str) -> str:
        return s.mass.get((a, b)) or s.mass.get((b, a)) or "0.0"

    if s.style == "mapping":
        rows = {a: _row({b: entry(a, b) for b in names if entry(a, b) != "0.0"}) for a in names}
        return _row(rows)
    rows = [f"[{', '.join(entry(a, b) for b in names)}]" for a in names]
    text = f"[{', '.join(rows)}]"
    return f"jnp.array({text})" if s.style == "array" else text


def _contact(c: Touch) -> str:
    parts = [c.law]
    parts += [f"normal_force={c.normal}"] if c.normal else []
    parts += [f"surface_speed={c.surface}"] if c.surface else []
    parts += [] if c.fixed else [f"direction={_row(c.row)}"]
    parts += [f"normal_direction={_row(c.push)}"] if c.push else []
    return f"Contact({', '.join(parts)})"


def around(structure: Structure) -> list[str]:
    """Lines that make `system` and its start `y0` of `machine` and `y`."""
    lines, start, inner = ["system = machine"], "y", structure.form
    if inner:
        lines = [f"system = machine.{inner}"]
        start = "system.start(y, args=args)" if inner.startswith("bristles") else "y"
    lines.append(f"y0 = {start}")
    if structure.breaks:
        times = f"jnp.stack([{', '.join(f'jnp.asarray({b}, float)' for b in structure.breaks)}])"
        if structure.period:
            lines.append(f"system = ss.WithPeriodicBreaks(system, {times}, {structure.period})")
        else:
            lines += [f"system = ss.WithBreaks(system, {times})", "y0 = system.start(y0)"]
    return lines


def script(structure: Structure, numbers: Numbers, times: int) -> str:
    """The whole run as a script."""
    s, v = structure, numbers.values
    fields = ", ".join(f"{n}={n}" for n, p in s.parameters.items() if p.where == "field")
    others = ", ".join(f"{n!r}: {n}" for n, p in s.parameters.items() if p.where != "field")
    start = ", ".join(f"{c}={numbers.start[c]!r}" for c in s.components)
    return "\n".join(
        [
            HEAD + "\n\n" + source(s),
            *(f"{n} = {v[n]!r}" for n in s.parameters),
            f"machine = Machine({fields})",
            f"args = {{{others}}}" if others else "args = None",
            f"y = machine.state({start})",
            *around(s),
            f"ts = jnp.linspace(0.0, {numbers.end!r}, {times})",
            f"run = ss.simulate(system, 0.0, {numbers.end!r}, y0, args=args, saveat=ss.SaveAt(ts=ts), "
            "throw=False)",
            "print(run)\nprint(run.outputs.y)",
        ]
    )


class Program:
    """The class of a structure, and runs of it that share one compiled program."""

    count = 0

    def __init__(self, structure: Structure):
        Program.count += 1
        self.structure, text = structure, HEAD + source(structure)
        name = f"<drawn machine {Program.count}>"
        linecache.cache[name] = (len(text), None, text.splitlines(True), name)
        self.space: dict[str, Any] = {"__name__": "drawn"}
        exec(compile(text, name, "exec"), self.space)
        self.around = compile("\n".join(around(structure)), name, "exec")

    def made(self, values: dict, start: dict) -> tuple[Any, Any, Any]:
        """System, start and `args`."""
        s = self.structure
        given = {
            n: jnp.asarray(values[n], float) for n, p in s.parameters.items() if p.where != "field"
        }
        fields = {n: values[n] for n, p in s.parameters.items() if p.where == "field"}
        machine = self.space["Machine"](**fields)
        here = {**self.space, **values, "machine": machine, "args": given or None}
        here["y"] = machine.state(**start)
        exec(self.around, here)
        return here["system"], here["y0"], here["args"]

    def solution(self, numbers: Numbers, ts: Any, **how: Any) -> Any:
        """`simulate` from the first to the last of `ts`; `begin`: a state to go on from."""
        begin, bare = how.pop("begin", None), how.pop("bare", False)
        system, y0, args = self.made(numbers.values, numbers.start)
        y0 = y0 if begin is None else begin
        ts = jnp.asarray(ts, jnp.float64)
        keep = ss.SaveAt(ts=ts)
        return ss.simulate(
            system, ts[0], ts[-1], y0, args=None if bare else args, saveat=keep, throw=False, **how
        )

    def run(self, numbers: Numbers, ts: np.ndarray, **how: Any) -> Outcome:
        return self.outcome(self.solution(numbers, ts, **how))

    def outcome(self, found: Any) -> Outcome:
        """Of one run, as numbers."""
        found = jax.tree.map(np.asarray, found)
        y = self.bare(found.outputs.y)
        rows = np.stack([np.asarray(getattr(y, c), float) for c in self.structure.components], -1)
        ended = "" if bool(found.successful) else str(found.result)
        return Outcome(rows, float(found.t1), ended, int(found.flags), int(found.sequence))

    def bare(self, y: Any) -> Any:
        """The state of the mechanism in one of the system."""
        y = y.y if isinstance(y, Pieced) else y
        return y.y if isinstance(y, BristleState) else y
